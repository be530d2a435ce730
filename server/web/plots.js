// Plots: a channel against time (the band from its lowest to its highest value), and loops against the field.
import { element, number, scaleOf } from "./dom.js";

const folder = "/node_modules/uplot/dist";
let uPlot = null;
const charts = new Set();

// False if the page was built without the plotting library.
export async function loadPlots() {
  try {
    uPlot = (await import(`${folder}/uPlot.esm.js`)).default;
  } catch {
    return false;
  }
  document.head.prepend(element("link", { rel: "stylesheet", href: `${folder}/uPlot.min.css` }));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const chart of charts) chart.redraw();
  });
  return true;
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A little room around the data; something to see where it is constant or missing.
function padded(low, high) {
  if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const room = (high - low) * 0.05 || Math.abs(high) * 0.1 || 1;
  return [low - room, high + room];
}

function extent(...columns) {
  let low = Infinity;
  let high = -Infinity;
  for (const column of columns)
    for (const value of column)
      if (Number.isFinite(value)) {
        if (value < low) low = value;
        if (value > high) high = value;
      }
  return low <= high ? [low, high] : [null, null];
}

const axis = (label, flat) => ({
  label, labelSize: 18, labelGap: 0, size: flat ? 20 : 52, labelFont: "12px system-ui", font: "11px system-ui",
  stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid"), width: 1 }, ticks: { show: false },
});

// Points joined in their own order, which uPlot's lines (sorted by x) cannot do.
function joined(u, index) {
  const [xs, ys] = u.data[index];
  const stroke = new Path2D();
  let down = false;
  for (let i = 0; i < xs.length; ++i) {
    if (!Number.isFinite(xs[i]) || !Number.isFinite(ys[i])) {
      down = false;
      continue;
    }
    const x = u.valToPos(xs[i], "x", true);
    const y = u.valToPos(ys[i], "y", true);
    if (down) stroke.lineTo(x, y);
    else stroke.moveTo(x, y);
    down = true;
  }
  return { stroke, fill: null, clip: null, flags: 1 };
}

class Chart {
  constructor(parent, { title, unit, x, xUnit, loop = false, height = 150, sync }) {
    [this.factor, this.unit] = scaleOf(unit);
    [this.xFactor, this.xUnit] = scaleOf(xUnit);
    this.reading = element("span", { class: "reading" });
    this.frame = element("div", { class: "frame", role: "img" });
    this.title = title;
    this.figure = element("figure", { class: loop ? "loop" : "series" },
      element("figcaption", {}, element("strong", {}, title), " ", this.reading), this.frame);
    parent.append(this.figure);
    if (!uPlot) return;
    const stroke = () => colour("--line");
    const line = { stroke, width: 1.5, points: { show: false } };
    const y = { auto: true, range: (_, low, high) => padded(low, high) };
    this.u = new uPlot({
      mode: loop ? 2 : 1,
      width: 300, height, legend: { show: false }, padding: [8, 8, 0, 0],
      cursor: { show: !loop, drag: { x: false, y: false }, points: { show: false }, sync: sync ? { key: sync } : undefined },
      scales: { x: { time: false, auto: true, range: (_, low, high) => (loop ? padded(low, high) : [low ?? 0, high > low ? high : (low ?? 0) + 1]) }, y },
      axes: [axis(`${x} [${this.xUnit}]`, true), axis(`${this.unit}`)],
      series: loop
        ? [{}, { ...line, paths: joined, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }] }]
        : [{}, line, line],
      bands: loop ? undefined : [{ series: [2, 1], fill: () => colour("--band") }],
      hooks: loop ? {} : { setCursor: [() => this.#read()] },
    }, loop ? [null, [[], []]] : [[], [], []], this.frame);
    new ResizeObserver(([entry]) => {
      const width = Math.floor(entry.contentRect.width);
      if (width > 0) this.u.setSize({ width, height });
    }).observe(this.frame);
    charts.add(this);
  }

  // SI in; `high` only where it differs from `low`.
  set(x, low, high = low) {
    const scaled = (column, factor) => Array.from(column, (v) => (Number.isFinite(v) ? v * factor : null));
    const xs = scaled(x, this.xFactor);
    this.low = scaled(low, this.factor);
    this.high = high === low ? this.low : scaled(high, this.factor);
    [this.bottom, this.top] = extent(this.low, this.high);
    this.u?.setData(this.u.mode === 2 ? [null, [xs, this.low]] : [xs, this.low, this.high]);
    this.frame.dataset.points = xs.length;
    this.#read();
  }

  #read() {
    if (!this.low?.length) return (this.reading.textContent = "");
    const at = this.u?.mode === 1 ? this.u.cursor.idx : null;
    const range = `from ${number(this.bottom)} to ${number(this.top)} ${this.unit}`;
    this.frame.setAttribute("aria-label", `${this.title}: ${range}`);
    this.reading.textContent = Number.isInteger(at)
      ? `${number(this.high[at])} ${this.unit} at ${number(this.u.data[0][at])} ${this.xUnit}` : range;
  }

  redraw() {
    this.u?.redraw(false);
  }
}

export const makePreview = (parent) =>
  new Chart(parent, { title: "Field program", unit: "V/m", x: "time", xUnit: "s", height: 320 });

const channels = [["field", "Field", "V/m"], ["charge", "Charge", "C"], ["displacement", "Displacement", "m"], ["force", "Force", "N"]];
let sets = 0;

// The six plots of a run: columns {time, field: {first, min, max}, ...}; a channel may be missing.
export class PlotSet {
  constructor(parent) {
    this.parent = parent;
    this.sync = `set${++sets}`;
    this.charts = new Map();
  }

  set(columns) {
    const present = channels.filter(([name]) => columns[name]);
    for (const chart of this.charts.values()) chart.figure.hidden = true;
    for (const [name, title, unit] of present)
      this.#chart(name, { title, unit, x: "time", xUnit: "s", sync: this.sync })
        .set(columns.time, columns[name].min, columns[name].max);
    for (const [name, title, unit] of present)
      if (name !== "field" && name !== "force" && columns.field)
        this.#chart(`${name} loop`, { title: `${title} against field`, unit, x: "field", xUnit: "V/m", loop: true, height: 280 })
          .set(columns.field.first, columns[name].first);
  }

  #chart(name, options) {
    if (!this.charts.has(name)) this.charts.set(name, new Chart(this.parent, options));
    const chart = this.charts.get(name);
    chart.figure.hidden = false;
    return chart;
  }
}
