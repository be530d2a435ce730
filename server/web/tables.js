// Tables of a report, in the daemon's order and with its names and units; figures have their uncertainties, values of
// clipped samples are marked.
import { element, withUncertainty } from "./dom.js";

const shown = (value, uncertainty) => (typeof value === "number" ? withUncertainty(value, uncertainty) : value ?? "–");

function cell(row, column) {
  const value = row[column.key];
  const text = shown(value, row[column.uncertainty]);
  const clipped = row.clipped?.includes(column.key);
  return element("td", { class: [typeof value === "string" ? "" : "number", clipped ? "clipped" : ""].join(" ").trim() || undefined },
    clipped ? `${text} !` : text);
}

export function reportTable({ title, columns = [], rows = [], notes = [] }) {
  const isText = (c) => rows.some((row) => typeof row[c.key] === "string");
  return element("section", { class: "report-table" },
    element("h3", {}, title),
    element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": title }, element("table", {},
      element("thead", {}, element("tr", {}, ...columns.map((c) =>
        element("th", { scope: "col", class: isText(c) ? undefined : "number" }, c.title, c.unit ? element("small", {}, ` [${c.unit}]`) : null)))),
      element("tbody", {}, ...rows.map((row) => element("tr", {}, ...columns.map((c) => cell(row, c))))))),
    ...notes.map((note) => element("p", { class: "note" }, note)));
}

// What a report's JSON has as tables, in its order.
export const tablesOf = (report) => (report.order?.tables ?? []).map((key) => report[key]).filter(Boolean);
export const factsOf = (report) => (report.order?.facts ?? []).map((name) => [name, report.facts[name]]);
