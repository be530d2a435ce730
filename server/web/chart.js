// One chart: uPlot draws axes and the drag rectangle, the curves are drawn here, as loops go back and forth.
import { between, digitsOf, element, number } from "./dom.js";
import { pictureScale, withHead } from "./picture.js";

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
    colours.clear();
    for (const chart of charts) chart.recolour();
  });
  return true;
}

// Of the style sheet, each read once: to ask for one makes the browser work out all styles that have changed.
const colours = new Map();
export function colour(name) {
  if (!colours.get(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return colours.get(name);
}

// Of the k-th of several things that have no order.
export const kindColour = (k) => colour(`--c${(k % 6) + 1}`);

// From blue over violet to orange, as in a report; place: 0 to 1.
export function orderColour(place) {
  const mix = (from, to) => Math.round(from + place * (to - from));
  return `rgb(${mix(0x2f, 0xe0)} ${mix(0x7f, 0x70)} ${mix(0xd8, 0x20)})`;
}

function extent(values, out) {
  for (const v of values) {
    if (v < out[0]) out[0] = v;
    if (v > out[1]) out[1] = v;
  }
  return out;
}

// A little room around the data; something to see where it is constant or missing.
function padded([low, high], share = 0.05) {
  if (!(low <= high)) return [0, 1];
  const room = (high - low) * share || Math.abs(high) * 0.1 || 1;
  return [low - room, high + room];
}

// A scale of what still grows: the one before while it holds the data and they fill half of it, else one with room ahead, so
// that few pictures of a run need new axes.
const holds = (scale, [low, high]) => scale && low >= scale[0] && high <= scale[1] && 2 * (high - low) >= scale[1] - scale[0];
const growth = 0.25;

function scaled(column, factor) {
  const out = new Float64Array(column.length);
  for (let i = 0; i < out.length; ++i) out[i] = (column[i] ?? NaN) * factor;
  return out;
}

// The index of the last value of a rising column that is not above x.
export function indexAt(column, x) {
  let from = 0;
  let to = column.length;
  while (from < to) {
    const middle = (from + to) >> 1;
    if (column[middle] <= x) from = middle + 1;
    else to = middle;
  }
  return Math.max(0, from - 1);
}

// Of a curve with many points: its lowest and highest value in each column of pixels, which is all that can be seen. A point
// beside an empty column stands alone, so that a line to it ends where it is.
function perPixel(c, px) {
  const out = { x: [], low: [], high: [] };
  const columns = c.x.map((x) => Math.round(px(x)));
  const alone = (i) => columns[i] - columns[i - 1] > 1 || columns[i + 1] - columns[i] > 1;
  for (let i = 0; i < c.x.length; ++i) {
    const last = out.x.length - 1;
    if (columns[i] !== columns[i - 1] || alone(i) || alone(i - 1) || Number.isNaN(c.low[i] + out.low[last])) {
      out.x.push(c.x[i]);
      out.low.push(c.low[i]);
      out.high.push(c.high[i]);
    } else {
      out.low[last] = Math.min(out.low[last], c.low[i]);
      out.high[last] = Math.max(out.high[last], c.high[i]);
    }
  }
  return 2 * out.x.length < c.x.length ? out : c;
}

// Scales are set by redraw() alone.
const asTold = (_, low, high) => [low ?? 1, high ?? 2];

// Grid lines of a logarithmic axis: 1, 2, ... 9 of every decade. uPlot's own begin at the axis's end, wherever that is.
function decades(u, axis, low, high) {
  const out = [];
  for (let decade = Math.floor(Math.log10(low)); 10 ** decade <= high; ++decade)
    for (let digit = 1; digit < 10; ++digit) out.push(Number(`${digit}e${decade}`));
  return out.filter((value) => value >= low && value <= high);
}

export class Chart {
  #frame;
  #legend = element("span", { class: "legend" });
  #reading = element("span", { class: "reading" });
  #zoom = { x: null, y: null };
  #scale = null; // {x, y} of what is drawn
  #described = -Infinity; // ms
  #pointer = null;

  // {title, x: {name, unit, factor}, y: likewise, height, loop, log, group, about}; a group shares its time axis and cursors,
  // about() says whose curves they are. Units are those shown, and factors lead to them from SI. `scale`: of all sizes.
  constructor(parent, options) {
    this.options = options;
    this.curves = [];
    this.stretches = [];
    this.lines = [];
    this.dots = [];
    const { title, x, y, width = 300, height = 150, loop = false, log = false, group, scale = 1 } = options;
    this.#frame = element("div", { class: "frame", role: "img" });
    const save = element("button", { type: "button", class: "small", title: `Save "${title}" as PNG`, "aria-label": `Save ${title} as PNG`, onclick: () => this.savePng() }, "PNG");
    this.figure = element("figure", { class: loop ? "loop" : "series" },
      element("figcaption", {}, element("strong", {}, title), this.#legend, this.#reading, save), this.#frame);
    parent.append(this.figure);
    if (!uPlot) return;
    const axis = (label, size) => ({
      label, size: size * scale, labelSize: 18 * scale, labelGap: 0, gap: 4 * scale, labelFont: `${12 * scale}px system-ui`, font: `${11 * scale}px system-ui`,
      stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid"), width: scale }, ticks: { show: false },
      values: (_, at) => at.map((v) => (v === null ? "" : number(v, 8))),
    });
    const label = ({ name, unit }) => (unit ? `${name} [${unit}]` : name);
    this.u = new uPlot({
      width: width * scale, height: height * scale, legend: { show: false }, padding: [8, 14, 0, 0].map((side) => side * scale),
      cursor: {
        points: { show: false }, y: loop, drag: { x: true, y: loop, setScale: false, uni: loop ? 12 : undefined },
        bind: { dblclick: () => () => this.zoomTo(null, null) },
      },
      scales: { x: { time: false, auto: false, range: asTold, distr: log ? 3 : 1 }, y: { auto: false, range: asTold } },
      axes: [{ ...axis(label(x), 22), ...(log ? { splits: decades } : {}), space: 50 * scale }, { ...axis(height < 180 ? y.unit : label(y), 58), space: (height < 180 ? 18 : 30) * scale }],
      series: [{}, { paths: () => null, points: { show: false } }],
      hooks: { draw: [(u) => this.#draw(u)], setSelect: [(u) => this.#selected(u)], setCursor: [(u) => this.#pointed(u)] },
    }, [[0, 1], [0, 1]], this.#frame);
    if (group) this.#clicks(group);
    new ResizeObserver(([entry]) => {
      const width = Math.floor(entry.contentRect.width);
      if (width > 0) this.u.setSize({ width, height });
    }).observe(this.#frame);
    charts.add(this);
    group?.join(this);
  }

  // A click, not the end of a drag.
  #clicks(group) {
    let from = null;
    this.u.over.addEventListener("mousedown", (event) => (from = [event.offsetX, event.offsetY]), true);
    this.u.over.addEventListener("mouseup", (event) => {
      const moved = from ? Math.hypot(event.offsetX - from[0], event.offsetY - from[1]) : Infinity;
      from = null;
      const x = this.u.posToVal(event.offsetX, "x");
      if (moved < 4 && event.button === 0) group.click(Number(x.toPrecision(this.#digits(x))), event.shiftKey);
    }, true);
  }

  // Curves in SI: {name, colour: () => text, x, y} or {.., x, low, high}; dots: true marks each point, and joins near ones alone.
  set(curves) {
    this.#take(curves);
    this.recolour();
  }

  // The same of a run under way: of each curve the first `drawn` points are as they were last time, and drawn already.
  extend(curves, drawn) {
    this.#take(curves);
    if (drawn === 0) this.#name();
    this.#redraw(true, drawn);
  }

  #take(curves) {
    const { x, y } = this.options;
    this.curves = curves.map((c) => {
      const xs = scaled(c.x, x.factor);
      const low = scaled(c.low ?? c.y, y.factor);
      return { ...c, x: xs, low, high: c.high && c.high !== c.low ? scaled(c.high, y.factor) : low };
    });
    this.#frame.dataset.points = this.curves.reduce((n, c) => n + c.x.length, 0);
  }

  recolour() {
    this.#name();
    this.redraw();
  }

  #name() {
    const named = this.curves.filter((c) => c.name);
    this.#legend.replaceChildren(...(this.options.legend ?? named.length > 1 ? this.#keys(named) : []));
  }

  // Of many in order the first and the last tell the scale.
  #keys(named) {
    const shown = named.length > 8 ? [named[0], named.at(-1)] : named;
    return shown.map((c, k) => {
      const chip = element("span", { class: "chip", "aria-hidden": "true" });
      chip.style.background = c.colour();
      return element("span", { class: "key" }, chip, k === 1 && shown.length < named.length ? `to ${c.name}` : c.name);
    });
  }

  // [from, to] in the units shown; null: all.
  zoomTo(x, y) {
    if (this.options.group) this.options.group.zoom(x);
    else this.view(x, y);
  }

  view(x, y) {
    this.#zoom = { x, y };
    this.redraw();
  }

  extents() {
    const xs = [Infinity, -Infinity];
    for (const c of this.curves) extent(c.x, xs);
    return xs;
  }

  // Points [{name, x, y}] in the units shown.
  mark(dots) {
    if (JSON.stringify(dots) === JSON.stringify(this.dots)) return;
    this.dots = dots;
    this.redraw();
  }

  redraw() {
    this.#redraw(false, 0);
  }

  #redraw(grows, drawn) {
    const { loop, log } = this.options;
    const before = grows ? this.#scale : null;
    let x = this.#zoom.x;
    if (!x) {
      x = this.options.group ? this.options.group.extents() : this.extents();
      if (holds(before?.x, x)) x = before.x;
      else if (loop) x = padded(x);
      else if (log) x = x[0] > 0 && x[1] > x[0] ? x : [1, 10];
      else if (x[1] > x[0]) x = grows ? [x[0], x[1] + growth * (x[1] - x[0])] : x;
      else x = [x[0] <= x[1] ? x[0] : 0, (x[0] <= x[1] ? x[0] : 0) + 1];
    }
    const ys = [Infinity, -Infinity];
    for (const c of this.curves)
      for (let i = 0; i < c.x.length; ++i) {
        if (!loop && (c.x[i] < x[0] || c.x[i] > x[1])) continue;
        if (c.low[i] < ys[0]) ys[0] = c.low[i];
        if (c.high[i] > ys[1]) ys[1] = c.high[i];
      }
    for (const { y, always } of this.lines) if (always) extent([y], ys);
    const y = this.#zoom.y ?? (holds(before?.y, ys) ? before.y : padded(ys));
    this.#describe(ys, drawn > 0);
    if (!this.u) return;
    this.#scale = { x, y };
    if (drawn > 0 && before?.x === x && before.y === y) return this.#clipped(this.u, (px, py, ratio) => this.#drawCurves(this.u.ctx, px, py, ratio, drawn));
    // Each only asks for a drawing: there is one, once all is set.
    this.u.setScale("x", { min: x[0], max: x[1] });
    this.u.setScale("y", { min: y[0], max: y[1] });
    this.u.redraw(false);
  }

  // In words; of what is drawn on, twice a second: new text is new layout.
  #describe([low, high], drawnOn) {
    const now = performance.now();
    if (drawnOn && now - this.#described < 500) return;
    this.#described = now;
    const { title, y } = this.options;
    this.range = low <= high ? `${number(low)} to ${number(high)} ${y.unit}` : "";
    this.#frame.setAttribute("aria-label", `${title}: ${this.range || "nothing yet"}`);
    if (!this.#pointer) this.#reading.textContent = this.range;
  }

  // What the values of a curve lie between at x, in the units shown; null outside of it.
  #at(x, { x: xs, low, high }) {
    if (!(x >= xs[0] && x <= xs.at(-1))) return null;
    const i = indexAt(xs, x);
    return [low[i], high[i]];
  }

  // Of an x that someone points at: neighbouring pixels are told apart.
  #digits(x) {
    return digitsOf([x, x + (this.u.scales.x.max - this.u.scales.x.min) / this.u.over.clientWidth]) - 1;
  }

  #pointed(u) {
    const { left, top } = u.cursor;
    const { x, y, loop } = this.options;
    this.#pointer = left >= 0 ? left : null;
    if (this.#pointer === null) return (this.#reading.textContent = this.range ?? "");
    const at = u.posToVal(left, "x");
    const several = this.curves.length > 1;
    const values = loop ? number(u.posToVal(top, "y"))
      : this.curves.map((c) => (several ? `${c.name}: ` : "") + between(this.#at(at, c))).join("; ");
    this.#reading.textContent = `${values} ${y.unit} at ${number(at, this.#digits(at))} ${x.unit}`;
  }

  #selected(u) {
    const { left, top, width, height } = u.select;
    if (!(width > 3 || height > 3)) return;
    const x = width > 3 ? [u.posToVal(left, "x"), u.posToVal(left + width, "x")] : this.#zoom.x;
    const y = this.options.loop && height > 3 ? [u.posToVal(top + height, "y"), u.posToVal(top, "y")] : null;
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.zoomTo(x, y);
  }

  #draw(u) {
    this.#clipped(u, (px, py, ratio) => {
      const { left, top, width, height } = u.bbox;
      this.#drawStretches(u.ctx, px, top, height);
      this.#drawCurves(u.ctx, px, py, ratio, 0);
      this.#drawLines(u.ctx, u, px, py, ratio);
    });
    this.#drawPoints(u, this.#ratio());
  }

  // Pixels of the canvas for one that is meant.
  #ratio() {
    return devicePixelRatio * (this.options.scale ?? 1);
  }

  #clipped(u, draw) {
    const { ctx } = u;
    const { left, top, width, height } = u.bbox;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    draw((x) => u.valToPos(x, "x", true), (y) => u.valToPos(y, "y", true), this.#ratio());
    ctx.restore();
  }

  // What comes after the first `drawn` points of each, joined to the last of those.
  #drawCurves(ctx, px, py, ratio, drawn) {
    ctx.lineJoin = "bevel"; // round ones, of thousands of points, took most of the time, and cannot be seen
    for (const whole of this.curves) {
      const from = (values) => values.subarray(Math.max(0, drawn - 1));
      const c = drawn > 0 ? { ...whole, x: from(whole.x), low: from(whole.low), high: whole.high === whole.low ? from(whole.low) : from(whole.high) } : whole;
      ctx.strokeStyle = c.colour();
      ctx.fillStyle = c.colour();
      ctx.lineWidth = (c.thin ? 1 : 1.5) * ratio;
      ctx.setLineDash(c.dashed ? [5 * ratio, 4 * ratio] : []);
      if (c.dots) this.#drawDots(ctx, c, px, py, ratio);
      else this.#drawCurve(ctx, c, px, py);
    }
  }

  #drawCurve(ctx, curve, px, py) {
    const c = this.options.group ? perPixel(curve, px) : curve;
    const n = c.x.length;
    const band = c.high !== c.low;
    for (let i = 0; i < n; ) {
      while (i < n && Number.isNaN(c.low[i] + c.x[i])) ++i;
      const first = i;
      while (i < n && !Number.isNaN(c.low[i] + c.x[i])) ++i;
      if (first === i) break;
      ctx.beginPath();
      for (let k = first; k < i; ++k) ctx.lineTo(px(c.x[k]), py(c.high[k]));
      if (band) {
        for (let k = i - 1; k >= first; --k) ctx.lineTo(px(c.x[k]), py(c.low[k]));
        ctx.closePath();
        ctx.globalAlpha = 0.35;
        ctx.fill();
        ctx.globalAlpha = 1;
      }
      ctx.stroke();
    }
  }

  // What was thinned in time is drawn as what it is, samples: a line only between those that lie close together.
  #drawDots(ctx, c, px, py, ratio) {
    const near = 14 * ratio;
    const size = 2 * ratio;
    let x = NaN;
    let y = NaN;
    ctx.beginPath();
    for (let i = 0; i < c.x.length; ++i) {
      const [a, b] = [px(c.x[i]), py(c.low[i])];
      const step = Math.hypot(a - x, b - y);
      if (step < 0.5 * ratio) continue; // there is a dot already
      if (step < near) ctx.lineTo(a, b);
      else ctx.moveTo(a, b);
      [x, y] = [a, b];
      ctx.fillRect(a - size / 2, b - size / 2, size, size);
    }
    ctx.stroke();
  }

  #drawStretches(ctx, px, top, height) {
    this.stretches.forEach(({ from, to, chosen }, k) => {
      ctx.fillStyle = colour(chosen ? "--chosen" : "--grid");
      ctx.globalAlpha = chosen ? 0.6 : 0.45;
      if (chosen || k % 2) ctx.fillRect(px(from), top, px(to) - px(from), height);
    });
    ctx.globalAlpha = 1;
  }

  #drawLines(ctx, u, px, py, ratio) {
    const { left, top, width, height } = u.bbox;
    ctx.font = `${11 * ratio}px system-ui`;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.setLineDash([4 * ratio, 3 * ratio]);
    ctx.lineWidth = ratio;
    for (const { y, text } of this.lines) {
      ctx.strokeStyle = ctx.fillStyle = colour("--bad");
      ctx.beginPath();
      ctx.moveTo(left, py(y));
      ctx.lineTo(left + width, py(y));
      ctx.stroke();
      const above = py(y) - 4 * ratio;
      ctx.fillText(text, left + 6 * ratio, above < top + 10 * ratio ? py(y) + 12 * ratio : above);
    }
    const cursors = this.options.group?.cursors ?? {};
    ctx.strokeStyle = ctx.fillStyle = colour("--ink");
    for (const [name, x] of Object.entries(cursors)) {
      if (x === null) continue;
      ctx.beginPath();
      ctx.moveTo(px(x), top);
      ctx.lineTo(px(x), top + height);
      ctx.stroke();
      ctx.fillText(name.toUpperCase(), px(x) + 3 * ratio, top + 11 * ratio);
    }
    ctx.setLineDash([]);
  }

  // Whole where they lie on the edge.
  #drawPoints(u, ratio) {
    const { ctx } = u;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = colour("--ink");
    ctx.lineWidth = ratio;
    ctx.font = `${11 * ratio}px system-ui`;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    for (const { x, y, name } of this.dots) {
      const within = ({ min, max }, v) => v >= min && v <= max;
      if (!within(u.scales.x, x) || !within(u.scales.y, y)) continue;
      const [left, top] = [u.valToPos(x, "x", true), u.valToPos(y, "y", true)];
      ctx.beginPath();
      ctx.arc(left, top, 4 * ratio, 0, 2 * Math.PI);
      ctx.stroke();
      if (name) ctx.fillText(name, left + 6 * ratio, top - 5 * ratio);
    }
    ctx.restore();
  }

  // Drawn anew in a size of its own, with whose it is and what its colours mean.
  async savePng() {
    if (!this.u) return;
    const { group, loop, log, title, about } = this.options;
    const size = loop || log ? [640, 480] : [900, 300];
    const scale = pictureScale / devicePixelRatio;
    const copy = new Chart(element("div"), { ...this.options, width: size[0], height: size[1], scale,
      group: group && { cursors: group.cursors, extents: () => group.extents(), join: () => {} } });
    const { curves, stretches, lines, dots } = this;
    Object.assign(copy, { curves, stretches, lines, dots }).view(this.#zoom.x, this.#zoom.y);
    await new Promise((drawn) => setTimeout(drawn)); // uPlot draws once what asks for it is over
    const whose = about?.() ?? "";
    const canvas = withHead(copy.u.ctx.canvas, { title, whose, curves: curves.filter((c) => c.name), ink: colour("--ink"), back: colour("--card") });
    copy.remove();
    canvas.toBlob((blob) => download(blob, `${[whose, title].filter(Boolean).join(" ").replaceAll(/[^\p{L}\p{N}._+-]+/gu, "-")}.png`));
  }

  remove() {
    charts.delete(this);
    this.u?.destroy();
    this.figure.remove();
  }
}

export function download(blob, name) {
  const address = URL.createObjectURL(blob);
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

// Charts above each other with one time axis, two cursors and one zoom.
export class TimeGroup {
  constructor(changed = () => {}) {
    this.charts = [];
    this.cursors = { a: null, b: null };
    this.range = null;
    this.changed = changed;
  }

  join(chart) {
    this.charts.push(chart);
  }

  extents() {
    const out = [Infinity, -Infinity];
    for (const chart of this.charts) if (!chart.figure.hidden) extent(chart.extents(), out);
    return out;
  }

  zoom(x) {
    this.range = x;
    for (const chart of this.charts) chart.view(x, null);
    this.changed();
  }

  // A click sets A, with Shift B.
  click(x, second) {
    this.setCursor(second ? "b" : "a", x);
  }

  setCursor(name, x) {
    this.cursors[name] = x;
    for (const chart of this.charts) chart.redraw();
    this.changed();
  }
}
