// The recordings: the list, and one of them with its report and plots.
import { byId, count, duration, element, facts, moment, number } from "./dom.js";
import { showError } from "./errors.js";
import { PlotSet } from "./plots.js";

const fileAddress = (name) => `/recordings/${encodeURIComponent(name)}`;

// "loop_area_um_kV_per_mm" -> "loop area [µm kV/mm]": in a report the unit ends the name.
const unitWords = new Set(["A", "C", "decade", "Hz", "J", "kV", "m", "m2", "m3", "mm", "MPa", "N", "Pa", "per", "percent", "s", "uC", "um", "V"]);
const shownAs = { percent: "%", um: "µm", uC: "µC", m2: "m²", m3: "m³" };
function named(key) {
  const words = key.split("_");
  let at = words.length;
  while (at > 1 && unitWords.has(words[at - 1])) --at;
  const [above, ...below] = words.slice(at).map((w) => shownAs[w] ?? w).join(" ").split(" per ");
  return { key, name: words.slice(0, at).join(" "), unit: [above, ...below.map((w) => w.replaceAll(" ", "/"))].join("/") };
}

// JSON has no order of keys: what has no unit tells the rows apart and comes first.
const columnsOf = (rows) =>
  [...new Set(rows.flatMap(Object.keys))].map(named).sort((a, b) => (a.unit !== "") - (b.unit !== ""));

function reportTable({ title, rows = [], notes = [] }) {
  const columns = columnsOf(rows);
  const kind = ({ key }) => ({ class: rows.some((row) => typeof row[key] === "string") ? "" : "number" });
  const cell = (value) => (typeof value === "number" ? number(value) : value ?? "");
  return element("div", {},
    element("h3", {}, title),
    element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": title }, element("table", {},
      element("thead", {}, element("tr", {}, ...columns.map((c) =>
        element("th", { scope: "col", ...kind(c) }, c.unit ? `${c.name} [${c.unit}]` : c.name)))),
      element("tbody", {}, ...rows.map((row) =>
        element("tr", {}, ...columns.map((c) => element("td", kind(c), cell(row[c.key])))))))),
    ...notes.map((note) => element("p", { class: "note" }, note)));
}

export class Recordings {
  constructor(rpc) {
    this.rpc = rpc;
    this.shown = null;
  }

  async refresh() {
    try {
      const { recordings } = await this.rpc.call("recording.list");
      byId("recording-none").hidden = recordings.length > 0;
      byId("recording-list").replaceChildren(...recordings.map((r) => this.#item(r)));
      this.#markShown();
    } catch (error) {
      showError("The list of recordings could not be read.", error);
    }
  }

  #item(r) {
    const about = r.title || r.name;
    return element("li", { "data-name": r.name },
      element("div", { class: "about" }, element("strong", {}, about),
        element("p", { class: "note" }, r.rows ? `${moment(r.start_time)}, ${duration(r.duration_s)}, ${count(r.rows)} samples, ` : "",
          element("span", { class: r.status === "complete" ? "" : "wrong" }, r.reason ? `${r.status}: ${r.reason}` : r.status))),
      element("button", { type: "button", "aria-label": `Report of ${about}, ${moment(r.start_time)}`, onclick: () => this.show(r.name) }, "Report"),
      element("a", { href: fileAddress(r.name), download: `${r.name}.h5`, "aria-label": `Download ${r.name}` }, "Download"));
  }

  #markShown() {
    for (const item of byId("recording-list").children) {
      if (item.dataset.name === this.shown) item.setAttribute("aria-current", "true");
      else item.removeAttribute("aria-current");
    }
  }

  async show(name) {
    try {
      const [answer, data] = await Promise.all([
        this.rpc.call("recording.report", { name, format: "json" }),
        this.rpc.call("recording.read", { name, max_points: 3000 }),
      ]);
      this.shown = name;
      this.#markShown();
      this.#render(name, answer, data);
    } catch (error) {
      showError(`The report of ${name} could not be made.`, error);
    }
  }

  #render(name, report, data) {
    const place = byId("report");
    const plots = element("div", { class: "plots" });
    const { title, facts: known = {}, ...tables } = report;
    const list = element("dl", { class: "facts" });
    facts(list, Object.entries(known));
    place.replaceChildren(
      element("div", { class: "report-head" }, element("h2", { id: "report-title" }, title),
        element("button", { type: "button", onclick: () => this.#saveReport(name) }, "Save as HTML"),
        element("button", { type: "button", onclick: () => this.#close() }, "Close")),
      list, plots, ...Object.values(tables).map(reportTable));
    place.hidden = false;
    new PlotSet(plots).set(data);
    place.focus();
  }

  async #saveReport(name) {
    try {
      const { content } = await this.rpc.call("recording.report", { name, format: "html" });
      const address = URL.createObjectURL(new Blob([content], { type: "text/html" }));
      element("a", { href: address, download: `${name}.html` }).click();
      setTimeout(() => URL.revokeObjectURL(address), 10000);
    } catch (error) {
      showError("The report could not be saved.", error);
    }
  }

  #close() {
    byId("report").hidden = true;
    this.shown = null;
    this.#markShown();
  }
}
