// What the run under way has measured so far, thinned so that an hour costs no more than a minute.
import { Chart, TimeGroup, colour } from "./chart.js";
import { byId, element, number, shownChannels, timeAxis } from "./dom.js";
import { thinned } from "./thinning.js";

const most = 2000; // points: a picture is some 600 pixels wide
const channels = ["command", "field", "charge", "displacement", "force"];
const parts = ["first", "min", "max"];

const line = () => colour("--line");

// The charts of one run's columns {time, field: {first, min, max}, ...}; a channel may be missing.
export class RunCharts {
  constructor(series, loops, readings) {
    this.places = { series, loops };
    this.readings = readings;
    this.group = new TimeGroup(() => this.#read());
    this.specimen = undefined;
    this.columns = { time: [] };
    this.inputs = {}; // of the cursors, where there are any
    this.#make();
  }

  #make() {
    const shown = shownChannels(this.specimen);
    const [field] = shown;
    this.series = new Map(shown.map((c) => [c.key, new Chart(this.places.series, { title: c.title, x: timeAxis, y: c, group: this.group, height: 128 })]));
    const against = (title, x, y) => new Chart(this.places.loops, { title, x, y, loop: true, height: 280 });
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

  draw(columns) {
    this.#show(columns, (chart, curves) => chart.set(curves));
  }

  // Of a run under way, whose first `drawn` points are drawn as they are.
  extend(columns, drawn) {
    this.#show(columns, (chart, curves) => chart.extend(curves, drawn));
  }

  #show(columns, give) {
    this.columns = columns;
    for (const [key, chart] of this.series) {
      chart.figure.hidden = !columns[key];
      give(chart, columns[key] ? [{ colour: line, x: columns.time, low: columns[key].min, high: columns[key].max }] : []);
    }
    for (const { x, y, chart } of this.loops) {
      const there = columns[x.key] && columns[y.key];
      chart.figure.hidden = !there;
      give(chart, there ? [{ colour: line, dots: true, x: columns[x.key].first, y: columns[y.key].first }] : []);
    }
    this.#read();
  }

  // Exact curves of the loops in place of samples: cycle by cycle, in the colour of what tells them apart.
  drawLoop(k, curves) {
    const { chart } = this.loops[k];
    chart.figure.hidden = false;
    chart.set(curves);
  }

  // A and B: values and differences in a table, and their places in the loops.
  #read() {
    const { a, b } = this.group.cursors;
    for (const [name, input] of Object.entries(this.inputs)) {
      const at = this.group.cursors[name];
      if (document.activeElement !== input) input.value = at === null ? "" : number(at);
    }
    const near = (t) => this.columns.time.findLastIndex((v) => v <= t);
    for (const { x, y, chart } of this.loops)
      chart.mark([["A", a], ["B", b]].filter(([, t]) => t !== null && this.columns[x.key] && this.columns[y.key]).map(([name, t]) => {
        const i = near(t);
        return { name, x: (this.columns[x.key].first[i] ?? NaN) * x.factor, y: (this.columns[y.key].first[i] ?? NaN) * y.factor };
      }));
    if (!this.readings) return;
    this.readings.hidden = a === null && b === null;
    if (this.readings.hidden) return;
    const cell = (v) => element("td", { class: "number" }, number(v));
    const row = (name, unit, at) => {
      const [va, vb] = [a, b].map((t) => (t === null ? NaN : at(t)));
      return element("tr", {}, element("th", { scope: "row" }, `${name} [${unit}]`), cell(va), cell(vb), cell(vb - va));
    };
    this.readings.replaceChildren(
      element("thead", {}, element("tr", {}, ...["", "A", "B", "B − A"].map((t) => element("th", { scope: "col", class: "number" }, t)))),
      element("tbody", {}, row("time", "s", (t) => t),
        ...[...this.series.values()].filter((c) => !c.figure.hidden).map((c) => row(c.options.y.name, c.options.y.unit, (t) => c.at(t)))));
  }

  remove() {
    for (const chart of [...this.series.values(), ...this.loops.map((l) => l.chart)]) chart.remove();
  }
}

// Inputs for the two cursors and the zoom, so that they need no mouse.
export function chartTools(charts, ...more) {
  const cursor = (name) => {
    charts.inputs[name] = element("input", {
      inputmode: "decimal", size: 7, "aria-label": `Cursor ${name.toUpperCase()} [s]`,
      onchange: (e) => charts.group.setCursor(name, e.target.value.trim() === "" || Number.isNaN(Number(e.target.value)) ? null : Number(e.target.value)),
    });
    return element("label", {}, name.toUpperCase(), " ", charts.inputs[name], " s");
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

export class Live {
  #columns = { time: [] };
  #shown = 0; // of its points; 0 where what was shown is not what they begin with
  #drawn = true;
  #measured = ""; // the moment of the newest sample
  #next = 0; // when it is drawn again at the earliest, ms
  #before = null; // messages that came while what was measured before is read

  constructor() {
    this.charts = new RunCharts(byId("live-series"), byId("live-loops"), byId("live-readings"));
    this.frozen = false;
    const freeze = element("button", { type: "button", id: "freeze", "aria-pressed": "false", onclick: () => this.#freeze(freeze) }, "Freeze");
    byId("live").querySelector(".card-head").append(chartTools(this.charts, freeze));
    this.charts.draw(this.#columns);
  }

  #freeze(control) {
    this.frozen = !this.frozen;
    control.setAttribute("aria-pressed", this.frozen);
    control.textContent = this.frozen ? "Go on" : "Freeze";
    if (!this.frozen) this.#draw();
  }

  describe({ title, protocol }, before) {
    byId("live-note").textContent = `${before}${title || protocol || "a program"}.`;
  }

  get run() {
    return this.id;
  }

  // From now on this run; what comes is kept until what was measured before is there.
  begin(run) {
    if (this.id === run) return;
    this.id = run;
    this.#columns = { time: [] };
    this.#shown = 0;
    this.#before = [];
    this.charts.group.range = null;
    this.#draw();
  }

  // What was measured before this page looked, from the recording under way.
  seed(run, columns) {
    if (this.id !== run) return;
    const late = this.#before ?? [];
    this.#before = null;
    if (columns?.time) this.#columns = columns;
    this.#shown = 0;
    const last = this.#columns.time.at(-1) ?? -Infinity;
    for (const message of late) if (message.time[0] > last) this.#append(message);
    this.#draw();
  }

  // The whole run in place of what was seen of it, unless another one has begun.
  show(run, columns) {
    if (this.id && this.id !== run) return;
    this.id = run;
    this.#before = null;
    this.#columns = columns;
    this.#shown = 0;
    if (!this.frozen) this.charts.draw(columns);
    this.#say();
  }

  add({ run, measured, columns }) {
    if (run !== this.id) return; // what came before begin() is read from the recording
    this.#measured = measured;
    if (this.#before) return this.#before.push(columns);
    this.#append(columns);
    this.#draw();
  }

  #append(columns) {
    this.#columns.time.push(...columns.time);
    for (const name of channels) {
      if (!columns[name]) continue;
      const column = (this.#columns[name] ??= { first: [], min: [], max: [] });
      for (const part of parts) column[part].push(...columns[name][part]);
    }
    if (this.#columns.time.length <= most) return;
    this.#columns = thinned(this.#columns, most / 2);
    this.#shown = 0;
  }

  // How many points are drawn, the time of the last one, and when that was measured.
  #say() {
    const { dataset } = byId("live");
    dataset.measured = this.#measured;
    dataset.points = this.#columns.time.length;
    dataset.newest = this.#columns.time.at(-1) ?? "";
  }

  // What is new is drawn to what is there. Takes half of the page's time at most, painting included: whatever else the page is
  // asked for, a stop above all, gets its turn on a slow machine, too.
  #draw() {
    if (!this.#drawn || this.frozen) return;
    this.#drawn = false;
    const draw = () => {
      const begin = performance.now();
      this.#drawn = true;
      this.charts.extend(this.#columns, this.#shown);
      this.#shown = this.#columns.time.length;
      this.#say();
      setTimeout(() => (this.#next = 2 * performance.now() - begin));
    };
    setTimeout(() => requestAnimationFrame(draw), Math.max(0, this.#next - performance.now()));
  }
}
