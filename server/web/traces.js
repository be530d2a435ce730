// The charts of what was measured, against time and as loops, of one run or of several over each other, with zoom and cursors.
// What is drawn is thinned. Of a finished recording the rows are read of what is zoomed to, and of the place of a cursor, which
// stands on a measured row and shows its values. Elsewhere a cursor shows what the values lie between.
import { Chart, TimeGroup, colour, indexAt } from "./chart.js";
import { between, element, number, readNumber, shownChannels, timeAxis } from "./dom.js";
import { showError } from "./errors.js";

const most = 6000; // points of what is zoomed to: ten a pixel
const pause = 200; // ms: of several steps of a zoom the last one is read
const rowsOfACursor = 20000; // the most that are given at once
const digits = 9; // of a time: 10 µs of 10,000 s

const line = () => colour("--line");

// recording.read of some rows of a recording.
export const readerOf = (rpc, name) => (rows) => rpc.call("recording.read", { name, ...rows });

// Columns are {time, field: {first, min, max}, ..., row}; a channel may be missing.
export class RunCharts {
  #zoomed = null; // what `near` of the runs is of
  #asked = 0;
  #reading = 0; // rows of cursors that are being read

  constructor(series, loops, readings) {
    this.places = { series, loops };
    this.readings = readings;
    this.group = new TimeGroup(() => this.#changed());
    this.specimen = undefined;
    this.about = ""; // whose curves they are
    this.runs = [];
    this.inputs = {}; // of the cursors, where there are any
    this.#make();
  }

  #make() {
    const shown = shownChannels(this.specimen);
    const [field] = shown;
    const about = () => this.about;
    this.series = new Map(shown.map((c) => [c.key, new Chart(this.places.series, { title: c.title, x: timeAxis, y: c, group: this.group, height: 128, about })]));
    const against = (title, x, y) => new Chart(this.places.loops, { title, x, y, loop: true, height: 280, about });
    const [, charge, displacement, force] = shown;
    this.loops = [[field, charge], [field, displacement], [displacement, force]].map(([x, y]) =>
      ({ x, y, chart: against(`${y.title} against ${x.name}`, x, y) }));
  }

  // Another specimen may have another unit of its charge.
  setSpecimen(specimen) {
    const same = JSON.stringify(specimen) === JSON.stringify(this.specimen);
    if (same) return;
    this.specimen = specimen;
    for (const chart of [...this.series.values(), ...this.loops.map((l) => l.chart)]) chart.remove();
    this.group.charts.length = 0;
    this.#make();
  }

  // Of one run; read({first, rows, max_points}): more of its rows.
  draw(columns, read = null) {
    this.overlay([{ name: "", colour: line, columns, read }]);
  }

  // Of several, {name, colour, columns, read}.
  overlay(runs) {
    this.#take(runs);
    // Several have one legend, above all charts.
    if (runs.length > 1) for (const chart of [...this.series.values(), ...this.loops.map((l) => l.chart)]) chart.options.legend = false;
    this.#show((chart, curves) => chart.set(curves));
    this.#showLoops((chart, curves) => chart.set(curves));
    this.#changed();
  }

  // Of a run under way, whose first `drawn` points are drawn as they are.
  extend(columns, drawn) {
    this.#take([{ name: "", colour: line, columns, read: null }]);
    this.#show((chart, curves) => chart.extend(curves, drawn));
    this.#showLoops((chart, curves) => chart.extend(curves, drawn));
    this.#read();
  }

  #take(runs) {
    this.runs = runs.map((run) => ({ ...run, near: null, rows: {} }));
    this.#zoomed = null;
  }

  #show(give) {
    for (const [key, chart] of this.series) {
      const there = this.runs.filter((run) => run.columns[key]);
      chart.figure.hidden = there.length === 0;
      give(chart, there.map((run) => {
        const { time, [key]: { min, max } } = run.near ?? run.columns;
        return { name: run.name, colour: run.colour, x: time, low: min, high: max };
      }));
    }
  }

  #showLoops(give) {
    for (const { x, y, chart } of this.loops) {
      const there = this.runs.filter(({ columns }) => columns[x.key] && columns[y.key]);
      chart.figure.hidden = there.length === 0;
      give(chart, there.map(({ name, colour: own, columns }) => ({ name, colour: own, dots: true, x: columns[x.key].first, y: columns[y.key].first })));
    }
  }

  // Exact curves of the loops in place of samples: cycle by cycle, in the colour of what tells them apart.
  drawLoop(k, curves) {
    const { chart } = this.loops[k];
    chart.figure.hidden = false;
    chart.set(curves);
  }

  // The zoom or a cursor.
  #changed() {
    if (this.group.range !== this.#zoomed) this.#zoom(this.group.range);
    for (const run of this.runs) for (const name of Object.keys(this.group.cursors)) this.#measure(run, name);
    this.#read();
  }

  async #zoom(range) {
    this.#zoomed = range;
    const asked = ++this.#asked;
    const covers = ({ time }) => range && time[0] <= range[0] && time.at(-1) >= range[1];
    for (const run of this.runs) if (run.near && !covers(run.near)) run.near = null;
    const draw = () => this.#show((chart, curves) => chart.set(curves));
    draw();
    try {
      if (!range) return;
      this.places.series.setAttribute("aria-busy", "true");
      await new Promise((later) => setTimeout(later, pause));
      if (asked !== this.#asked) return;
      const near = await Promise.all(this.runs.map(({ columns, read }) => {
        if (!read || !columns.row || columns.row.length === columns.rows) return null;
        const first = columns.row[indexAt(columns.time, range[0])];
        const end = columns.row[indexAt(columns.time, range[1]) + 2] ?? columns.rows;
        return read({ first, rows: end - first, max_points: most });
      }));
      if (asked !== this.#asked) return;
      near.forEach((columns, k) => (this.runs[k].near = columns));
      draw();
      this.#read();
    } catch (error) {
      showError("The rows could not be read.", error);
    } finally {
      if (asked === this.#asked) this.places.series.removeAttribute("aria-busy");
    }
  }

  // The measured row of a run that is nearest to a cursor.
  async #measure(run, name) {
    const at = this.group.cursors[name];
    if (run.rows[name]?.at === at) return;
    const row = (run.rows[name] = { at, values: null });
    const known = [run.near, run.columns].find((c) => c?.row && at >= c.time[0] && at <= c.time.at(-1));
    if (at === null || !run.read || !known) return;
    this.#busy(1);
    try {
      const first = known.row[indexAt(known.time, at)];
      const end = known.row[indexAt(known.time, at) + 1] ?? known.row[0] + known.rows;
      // With the first row of the next stretch, which may be nearer.
      const near = known.row.length === known.rows ? known
        : await run.read({ first, rows: Math.min(end + 1, known.row[0] + known.rows) - first, max_points: rowsOfACursor });
      if (run.rows[name] !== row) return;
      const k = indexAt(near.time, at);
      const nearest = near.time[k + 1] - at < at - near.time[k] ? k + 1 : k;
      row.values = Object.fromEntries(Object.entries(near).filter(([, column]) => column.first).map(([key, { first: values }]) => [key, values[nearest]]));
      if (this.runs.length === 1) {
        row.at = near.time[nearest];
        this.group.setCursor(name, row.at);
      } else {
        this.#read();
      }
    } catch (error) {
      showError("The row could not be read.", error);
    } finally {
      this.#busy(-1);
    }
  }

  #busy(more) {
    this.#reading += more;
    if (this.#reading) this.readings?.setAttribute("aria-busy", "true");
    else this.readings?.removeAttribute("aria-busy");
  }

  // What a channel of a run lies between at a cursor, in SI; null where nothing is known.
  #at(run, name, key) {
    const at = this.group.cursors[name];
    const row = run.rows[name];
    if (at === null || !run.columns[key]) return null;
    if (row?.values) return [row.values[key] ?? NaN, row.values[key] ?? NaN];
    const { time, [key]: { min, max } } = run.near ?? run.columns;
    if (!(at >= time[0] && at <= time.at(-1))) return null;
    const i = indexAt(time, at);
    return [min[i] ?? NaN, max[i] ?? NaN];
  }

  // A and B: values and differences in a table, and their places in the loops.
  #read() {
    const { a, b } = this.group.cursors;
    for (const [name, input] of Object.entries(this.inputs)) {
      const at = this.group.cursors[name];
      if (!("edited" in input.dataset)) input.value = at === null ? "" : number(at, digits);
    }
    const set = Object.keys(this.group.cursors).filter((name) => this.group.cursors[name] !== null);
    for (const { x, y, chart } of this.loops)
      chart.mark(this.runs.flatMap((run) => set.map((name) => {
        const [[left], [bottom]] = [x, y].map(({ key }) => this.#at(run, name, key) ?? [NaN]);
        return { name: name.toUpperCase(), x: left * x.factor, y: bottom * y.factor };
      })));
    if (!this.readings) return;
    this.readings.hidden = set.length === 0;
    if (this.readings.hidden) return;
    const cell = (text) => element("td", { class: "number" }, text);
    const heading = (text, columns = 1) => element("th", { scope: columns > 1 ? "colgroup" : "col", class: "number", colspan: columns }, text);
    const values = (run, { key, factor }) => {
      const [va, vb] = ["a", "b"].map((name) => this.#at(run, name, key)?.map((v) => v * factor));
      return [va, vb, va && vb ? [vb[0] - va[1], vb[1] - va[0]] : null].map((v) => cell(between(v)));
    };
    const times = [a, b, a === null || b === null ? null : b - a].map((t) => number(t, digits));
    const row = (name, unit, cells) => element("tr", {}, element("th", { scope: "row" }, `${name} [${unit}]`), ...cells);
    const shown = [...this.series.values()].filter((c) => !c.figure.hidden).map((c) => c.options.y);
    this.readings.replaceChildren(
      element("thead", {}, this.runs.length > 1 ? element("tr", {}, heading(""), ...this.runs.map(({ name }) => heading(name, 3))) : null,
        element("tr", {}, heading(""), ...this.runs.flatMap(() => ["A", "B", "B − A"].map((t) => heading(t))))),
      element("tbody", {}, row("time", "s", this.runs.flatMap(() => times.map(cell))),
        ...shown.map((y) => row(y.name, y.unit, this.runs.flatMap((run) => values(run, y))))));
  }

  remove() {
    for (const chart of [...this.series.values(), ...this.loops.map((l) => l.chart)]) chart.remove();
  }
}

// Inputs for the two cursors and the zoom, so that they need no mouse.
export function chartTools(charts, ...more) {
  const cursor = (name) => {
    const input = (charts.inputs[name] = element("input", {
      inputmode: "decimal", size: 9, "aria-label": `Cursor ${name.toUpperCase()} [s]`,
      oninput: () => (input.dataset.edited = ""),
      onblur: () => delete input.dataset.edited,
      onchange: () => {
        const at = readNumber(input);
        const wrong = typeof at === "string";
        input.setAttribute("aria-invalid", wrong);
        if (wrong) return;
        delete input.dataset.edited;
        charts.group.setCursor(name, at ?? null);
      },
    }));
    return element("label", {}, name.toUpperCase(), " ", input, " s");
  };
  const zoom = (factor) => () => {
    const [low, high] = charts.group.range ?? charts.group.extents();
    const middle = charts.group.cursors.a ?? (low + high) / 2;
    charts.group.zoom([middle - (middle - low) * factor, middle + (high - middle) * factor]);
  };
  return element("div", { class: "tools" }, ...more,
    element("button", { type: "button", onclick: zoom(0.5) }, "Zoom in"),
    element("button", { type: "button", onclick: () => { charts.group.zoom(null); for (const l of charts.loops) l.chart.view(null, null); } }, "Show all"),
    cursor("a"), cursor("b"));
}

