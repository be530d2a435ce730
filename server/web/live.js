// What the run under way has measured so far, thinned so that an hour costs no more than a minute.
import { byId, element } from "./dom.js";
import { thinned } from "./thinning.js";
import { RunCharts, chartTools } from "./traces.js";

const most = 2000; // points: a picture is some 600 pixels wide
const channels = ["command", "field", "charge", "displacement", "force"];
const parts = ["first", "min", "max"];

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

  // The whole run in place of what was seen of it, unless another one has begun; `read`: of its rows.
  show(run, columns, read) {
    if (this.id && this.id !== run) return;
    this.id = run;
    this.#before = null;
    this.#columns = columns;
    this.#shown = 0;
    if (!this.frozen) this.charts.draw(columns, read);
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
