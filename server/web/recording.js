// One recording, or several over each other: time with its segments, loops cycle by cycle, creep by hold, the report's tables,
// published values beside, events, provenance; and what can be done with it.
import { Chart, colour, download, kindColour, orderColour } from "./chart.js";
import { button, count, duration, element, facts, loadText, moment, quantity, shownChannels } from "./dom.js";
import { clearErrors, showError } from "./errors.js";
import { factsOf, reportTable, tablesOf } from "./tables.js";
import { RunCharts, chartTools, readerOf } from "./traces.js";

const loops = [["field", "charge"], ["field", "displacement"], ["displacement", "force"]];
const most_others = 20; // of what differs beside samples: a protocol or a model may differ everywhere
const fileAddress = (name) => `/recordings/${encodeURIComponent(name)}`;

// The daemon's curves of a loop, in the colours of their order; what lies outside of every cycle is grey.
function inColour(answer, prefix) {
  const measure = { cycle: (c) => c.cycle, rate: (c) => Math.log(c.rate), frequency: (c) => Math.log(c.frequency_Hz) }[answer.told_by];
  const cycles = answer.curves.filter((c) => c.cycle !== null);
  const places = cycles.map(measure);
  const [low, high] = [Math.min(...places), Math.max(...places)];
  const outside = answer.curves.filter((c) => c.cycle === null)
    .map((c) => ({ x: c.x, y: c.y, colour: () => colour("--faint"), thin: true }));
  return [...outside, ...cycles.map((c) => ({ ...c, place: high > low ? (measure(c) - low) / (high - low) : 0 }))
    .sort((a, b) => a.place - b.place)
    .map((c) => ({ name: prefix + c.label, x: c.x, y: c.y, colour: () => orderColour(c.place) }))];
}

const oneColour = (answer, name, k) => answer.curves.map((c, i) => ({ name: i ? "" : name, x: c.x, y: c.y, colour: () => kindColour(k) }));

// What tells things apart of which each has several texts: of those that are not the same for all, as few as do.
export function toldApart(things) {
  const differ = things[0].map((_, i) => i).filter((i) => things.some((t) => t[i] !== things[0][i]));
  for (let n = 1; n <= differ.length; ++n) {
    const labels = things.map((t) => differ.slice(0, n).map((i) => t[i]).join(", "));
    if (new Set(labels).size === things.length) return labels;
  }
  return things.map((_, k) => String(k + 1));
}

const curvesOf = (rpc, name, axes) => rpc.call("recording.read", { name, axes, max_points: 20000 });

// The loops of one recording, cycle by cycle, into its charts.
export const drawLoops = (rpc, name, charts, columns, current = () => true) =>
  Promise.all(loops.map(async (axes, k) => {
    if (!axes.every((a) => columns[a])) return;
    const answer = await curvesOf(rpc, name, axes);
    if (current()) charts.drawLoop(k, inColour(answer, ""));
  }));

export class RecordingView {
  // list(): all recordings; started(status) with a replay, removed() after one is deleted
  constructor(rpc, place, { list, started, removed }) {
    Object.assign(this, { rpc, place, list, started, removed });
    this.asked = 0;
    this.charts = [];
  }

  #clear() {
    for (const chart of this.charts) chart.remove();
    this.charts = [];
    this.place.replaceChildren();
    this.place.hidden = true;
  }

  close() {
    ++this.asked;
    this.#clear();
  }

  async show(names) {
    const asked = ++this.asked;
    this.#clear();
    this.place.hidden = false;
    this.place.setAttribute("aria-busy", "true");
    this.place.append(element("p", { class: "note", role: "status" }, "Reading …"));
    try {
      if (names.length > 1) await this.#overlay(names, () => asked === this.asked);
      else await this.#one(names[0], () => asked === this.asked);
      if (asked !== this.asked) return;
      this.place.removeAttribute("aria-busy");
      this.place.focus({ preventScroll: true });
    } catch (error) {
      if (asked !== this.asked) return;
      this.#clear();
      showError(`${names.join(", ")} could not be shown.`, error);
    }
  }

  async #one(name, current) {
    const [info, report, columns, { tables: published }] = await Promise.all([
      this.rpc.call("recording.info", { name }),
      this.rpc.call("recording.report", { name, format: "json" }),
      this.rpc.call("recording.read", { name, max_points: 6000 }),
      this.rpc.call("table.list"),
    ]);
    if (!current()) return;
    const series = element("div", { class: "series-charts" });
    const loopPlace = element("div", { class: "plots" });
    const readings = element("table", { class: "readings", hidden: true });
    const list = element("dl", { class: "facts" });
    facts(list, factsOf(report));
    const tables = tablesOf(report);
    this.place.replaceChildren(
      this.#head(name, report.title, info), list,
      element("section", {}, element("h3", {}, "Against time"), element("div", { class: "tools-place" }), series, readings),
      element("section", {}, element("h3", {}, "Loops"), loopPlace),
      element("section", { class: "creep", hidden: true }, element("h3", {}, "Creep, hold by hold"), element("div", { class: "plots" })),
      ...tables.map(reportTable), this.#publishedPart(name, published), this.#provenance(info));
    const charts = new RunCharts(series, loopPlace, readings);
    this.charts.push(charts);
    charts.about = name;
    charts.setSpecimen(info.specimen);
    charts.draw(columns, readerOf(this.rpc, name));
    this.place.querySelector(".tools-place").append(chartTools(charts));
    const rows = columns.segments ?? [];
    for (const chart of charts.series.values()) {
      chart.stretches = rows.map((s) => ({ from: s.start_s, to: s.end_s }));
      chart.redraw();
    }
    await Promise.all([this.#creep(name, columns, info.specimen, current), drawLoops(this.rpc, name, charts, columns, current)]);
  }

  // Change since the start of each long hold, against the time since.
  async #creep(name, columns, specimen, current) {
    const section = this.place.querySelector(".creep");
    const channels = shownChannels(specimen).filter((c) => (c.key === "displacement" || c.key === "charge") && columns[c.key]);
    const answers = await Promise.all(channels.map((c) => curvesOf(this.rpc, name, ["time_in_hold", c.key])));
    if (!current()) return;
    for (const [i, channel] of channels.entries()) {
      const { curves } = answers[i];
      if (!curves.length) continue;
      section.hidden = false;
      const chart = new Chart(section.querySelector(".plots"), {
        title: `Creep of the ${channel.name}`, x: { name: "time since the start of the hold", unit: "s", factor: 1 },
        y: { ...channel, name: `${channel.name} change` }, height: 280, log: true, loop: false, legend: true, about: () => name });
      this.charts.push(chart);
      chart.set(curves.map((c, k) => ({ name: `${c.label || `hold ${k + 1}`}: ${quantity(c.level, "V/m")}`, x: c.x, y: c.y,
        colour: () => orderColour(curves.length > 1 ? k / (curves.length - 1) : 0) })));
    }
  }

  #head(name, title, info) {
    const write = element("input", { "aria-label": "Note to add", "data-path": "/text", placeholder: "a note" });
    const form = element("form", { class: "inline", onsubmit: (event) => {
      event.preventDefault();
      this.#act("The note was not added.", async () => {
        await this.rpc.call("recording.annotate", { name, text: write.value });
        await this.show([name]);
      });
    } }, write, element("button", {}, "Annotate"));
    const compare = element("select", { "aria-label": "Recording to compare with" }, element("option", { value: "" }, "compare with …"),
      ...this.list().filter((r) => r.name !== name).map((r) => element("option", { value: r.name }, [r.title || r.name, loadText(r), moment(r.start_time)].filter(Boolean).join(", "))));
    const result = element("div", { class: "comparison" });
    compare.addEventListener("change", () => compare.value && this.#act("They were not compared.", async () =>
      result.replaceChildren(this.#comparison(await this.rpc.call("recording.compare", { a: name, b: compare.value }), compare.value))));
    return element("div", {},
      element("div", { class: "report-head" }, element("h2", { id: "recording-title" }, title),
        element("a", { class: "button", href: "#recordings" }, "Close")),
      element("p", { class: "note" }, `${info.status}${info.reason ? `: ${info.reason}` : ""} · ${moment(info.start_time)} · ${duration(info.duration_s)} · ${count(info.rows)} samples`),
      element("div", { class: "actions" },
        button("Replay", () => this.#act("The replay was not started.", async () => this.started(await this.rpc.call("replay.start", { recording: name })))),
        button("Replay fast", () => this.#act("The replay was not started.", async () => this.started(await this.rpc.call("replay.start", { recording: name, fast: true })))),
        button("HTML", () => this.#saveReport(name)),
        (info.protocol?.segments ?? []).some((s) => s.average) ? button("Average", () => this.#act("It was not averaged.", async () => {
          const { recording: mean } = await this.rpc.call("recording.average", { name });
          await this.removed();
          location.hash = `#recordings/${encodeURIComponent(mean)}`;
        })) : null,
        button("CSV", () => this.#act("It was not exported.", async () => {
          const { name: file } = await this.rpc.call("recording.export", { name });
          element("a", { href: fileAddress(file), download: file }).click();
        })),
        element("a", { class: "button", href: fileAddress(name), download: `${name}.h5` }, "HDF5"),
        element("a", { class: "button", href: `#model/${encodeURIComponent(name)}` }, "Simulate"),
        button("Delete", () => confirm(`Delete ${name}? This cannot be undone.`) && this.#act("It was not deleted.", async () => {
          await this.rpc.call("recording.delete", { name });
          await this.removed();
        }), { class: "danger" }),
        compare, form), result);
  }

  async #act(failure, what) {
    try {
      clearErrors();
      await what();
    } catch (error) {
      showError(failure, error);
    }
  }

  #comparison({ same_samples: same, by_time: byTime, note, columns, tables, header }, other) {
    const column = (key, title) => ({ key, title, unit: "" });
    const figure = (value, unit) => (value === null ? "–" : quantity(value, unit));
    const text = (value) => (value === null ? "–" : typeof value === "string" ? value : JSON.stringify(value));
    // Each run has its own moment and identifier. Load and specimen come first: a device may differ in many places.
    const of = (v, ...places) => places.includes(v.place.split("/")[1]);
    const others = [...header.filter((v) => of(v, "load", "sample")),
      ...header.filter((v) => !of(v, "load", "sample", "start_time", "end_time", "entry_identifier")), ...tables];
    return element("div", {}, element("p", {}, same ? `The samples are those of ${other}, to the bit.` : `The samples differ from those of ${other}:`),
      note ? element("p", {}, note) : null,
      same ? null : reportTable({
        title: "Differences", notes: [],
        columns: [column("dataset", "column"), column("rms", "rms"), column("maximum", "maximum"), column("rows", "rows of both"), ...(byTime ? [] : [column("unequal", "rows that differ")])],
        rows: columns.map((c) => ({ dataset: c.dataset, rms: figure(c.rms, c.unit), maximum: figure(c.maximum, c.unit), rows: `${count(c.rows_a)} and ${count(c.rows_b)}`, unequal: count(c.unequal) })),
      }),
      others.length === 0 ? null : reportTable({
        title: "What else differs", columns: [column("place", "place in the file"), column("a", "this recording"), column("b", other)],
        notes: others.length > most_others ? [`and ${count(others.length - most_others)} more`] : [],
        rows: others.slice(0, most_others).map((v) => ({ place: v.place, a: text(v.a), b: text(v.b) })),
      }));
  }

  #publishedPart(name, published) {
    const place = element("div");
    const choose = element("select", { id: "published", "data-path": "/table" }, element("option", { value: "" }, "none"), ...published.map((t) => element("option", { value: t.name }, `${t.name}: ${t.title.replace(/^Table [\d.]+: /, "")}`)));
    choose.addEventListener("change", () => this.#act("The table was not compared.", async () =>
      place.replaceChildren(...(choose.value ? [reportTable(await this.rpc.call("table.compare", { table: choose.value, recordings: [name] }))] : []))));
    return element("section", { class: "beside" }, element("h3", {}, "Beside published values"), element("label", {}, "Table ", choose), place);
  }

  #provenance(info) {
    const json = (title, value) => (value ? element("details", {}, element("summary", {}, title), element("pre", { tabindex: "0" }, JSON.stringify(value, null, 2))) : null);
    const list = element("dl", { class: "facts" });
    facts(list, [["Identifier", info.identifier], ["File", info.path], ["Started", info.start_time], ["Ended", info.end_time || "–"], ["Seed", String(info.run_seed ?? "–")]]);
    return element("section", {}, element("h3", {}, "Provenance"), list, json("Protocol", info.protocol), json("Model", info.model), json("Device", info.device));
  }

  async #saveReport(name) {
    await this.#act("The report could not be saved.", async () => {
      const { content } = await this.rpc.call("recording.report", { name, format: "html" });
      download(new Blob([content], { type: "text/html" }), `${name}.html`);
    });
  }

  async #overlay(names, current) {
    const all = await Promise.all(names.map(async (name) => ({
      name, info: await this.rpc.call("recording.info", { name }), columns: await this.rpc.call("recording.read", { name, max_points: 3000 }) })));
    if (!current()) return;
    const series = element("div", { class: "series-charts" });
    const loopPlace = element("div", { class: "plots" });
    const readings = element("table", { class: "readings", hidden: true });
    const labels = toldApart(all.map(({ info }) => [info.title || info.name, loadText(info.load), moment(info.start_time), info.name]));
    this.place.replaceChildren(
      element("div", { class: "report-head" }, element("h2", { id: "recording-title" }, `${names.length} recordings over each other`), element("a", { class: "button", href: "#recordings" }, "Close")),
      element("ul", { class: "keys" }, ...all.map(({ name, info }, k) => {
        const chip = element("span", { class: "chip" });
        chip.style.background = `var(--c${(k % 6) + 1})`;
        return element("li", {}, chip, element("a", { href: `#recordings/${encodeURIComponent(name)}` }, info.title || name), ` · ${loadText(info.load)} · ${moment(info.start_time)}`);
      })), element("div", { class: "tools-place" }), series, element("div", { class: "scroll", tabindex: "0" }, readings), element("h3", {}, "Loops"), loopPlace);
    const charts = new RunCharts(series, loopPlace, readings);
    this.charts.push(charts);
    charts.about = names.length > 2 ? `${names[0]} and ${names.length - 1} more` : names.join(" and ");
    charts.setSpecimen(all[0].info.specimen);
    this.place.querySelector(".tools-place").append(chartTools(charts));
    // Charge counts by each specimen's own area.
    const own = (k, key) => {
      const factor = (info) => shownChannels(info.specimen).find((c) => c.key === key)?.factor ?? 1;
      return factor(all[k].info) / factor(all[0].info);
    };
    const times = (values, f) => (f === 1 ? values : values.map((v) => (v === null ? null : v * f)));
    const byOwnArea = (columns, k) => (columns.charge
      ? { ...columns, charge: Object.fromEntries(Object.entries(columns.charge).map(([part, values]) => [part, times(values, own(k, "charge"))])) }
      : columns);
    charts.overlay(all.map(({ name, columns }, k) => {
      const read = readerOf(this.rpc, name);
      return { name: labels[k], colour: () => kindColour(k), columns: byOwnArea(columns, k), read: async (rows) => byOwnArea(await read(rows), k) };
    }));
    for (const [k, axes] of loops.entries()) {
      const answers = await Promise.all(all.map((r) => (axes.every((a) => r.columns[a]) ? curvesOf(this.rpc, r.name, axes) : null)));
      if (!current()) return;
      if (answers.some(Boolean))
        charts.drawLoop(k, answers.flatMap((a, i) => (a ? oneColour(a, labels[i], i).map((c) => ({ ...c, y: times(c.y, own(i, axes[1])), x: times(c.x, own(i, axes[0])) })) : [])));
    }
  }
}
