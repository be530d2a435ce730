// Tables of a report, in the daemon's order and with its names and units; figures have their uncertainties, values of
// clipped samples are marked.
import { digitsOf, element, number, withUncertainty } from "./dom.js";

const shown = (value, uncertainty) => (typeof value === "number" ? withUncertainty(value, uncertainty) : value ?? "–");

// With as many digits as tell it from the one before and after.
const startText = (start, beside) =>
  number(start, Math.max(4, ...beside.filter((t) => typeof t === "number" && t !== start).map((t) => digitsOf([Math.min(t, start), Math.max(t, start)]))));

function cell(row, column, beside) {
  const value = row[column.key];
  const text = column.key === "start_s" && typeof value === "number" ? startText(value, beside.map((r) => r?.start_s)) : shown(value, row[column.uncertainty]);
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
      element("tbody", {}, ...rows.map((row, k) => element("tr", {}, ...columns.map((c) => cell(row, c, [rows[k - 1], rows[k + 1]]))))))),
    ...notes.map((note) => element("p", { class: "note" }, note)));
}

// What a report's JSON has as tables, in its order.
export const tablesOf = (report) => (report.order?.tables ?? []).map((key) => report[key]).filter(Boolean);
export const factsOf = (report) => (report.order?.facts ?? []).map((name) => [name, report.facts[name]]);
