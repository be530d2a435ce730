// What the run under way has measured so far, thinned so that an hour costs no more than a minute.
import { byId } from "./dom.js";
import { PlotSet } from "./plots.js";

const most = 4000;
const channels = ["field", "charge", "displacement", "force"];
const parts = ["first", "min", "max"];

// Two neighbours become one: lowest and highest of both, first of the first.
const joined = (values, pick) => values.filter((_, i) => i % 2 === 0).map((v, i) => pick(v, values[2 * i + 1] ?? v));
const either = (pick) => (a, b) => (a === null || b === null ? a ?? b : pick(a, b)); // null: nothing was measured
const joins = { first: (a) => a, min: either(Math.min), max: either(Math.max) };

export class Live {
  #plots = new PlotSet(byId("live-plots"));
  #columns = { time: [] };
  #drawn = true;

  describe({ title, protocol }, before) {
    byId("live-note").textContent = `${before}${title || protocol || "a program"}.`;
  }

  // The whole run in place of what was seen of it, unless another one has begun.
  show(run, columns) {
    if (this.run && this.run !== run) return;
    this.#columns = columns;
    this.#draw();
  }

  add({ run, columns }) {
    if (run !== this.run) this.#columns = { time: [] };
    this.run = run;
    this.#columns.time.push(...columns.time);
    for (const name of channels) {
      if (!columns[name]) continue;
      const column = (this.#columns[name] ??= { first: [], min: [], max: [] });
      for (const part of parts) column[part].push(...columns[name][part]);
    }
    if (this.#columns.time.length > most) this.#thin();
    this.#draw();
  }

  #thin() {
    const thinned = { time: joined(this.#columns.time, joins.first) };
    for (const name of channels)
      if (this.#columns[name])
        thinned[name] = Object.fromEntries(parts.map((part) => [part, joined(this.#columns[name][part], joins[part])]));
    this.#columns = thinned;
  }

  #draw() {
    if (!this.#drawn) return;
    this.#drawn = false;
    requestAnimationFrame(() => {
      this.#drawn = true;
      this.#plots.set(this.#columns);
    });
  }
}
