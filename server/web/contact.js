// Whether the daemon answers. It is asked twice a second; after a second and a half without anything from it the page says so,
// and claims nothing about the bench that it cannot know. The age of a sample counts from the moment at which it was measured,
// by the daemon's clock, which the page compares with its own.
import { byId, number } from "./dom.js";

const ask_every = 500; // ms
const silent_after = 1500;
const stall = 400;
const compare_every = 10_000;
const drift = 1e-3; // of a clock, more than any has: a comparison that is so much older may have been so much better

const seconds = (ms) => `${number(Math.max(0, ms) / 1000, ms < 10_000 ? 2 : 3)} s`;

export class Contact {
  #lastSample = null; // ms, by the daemon's clock
  #clock = null; // {ahead, took, at}, ms: how far the daemon's clock is ahead, from a call that took so long
  #silent = null;
  #looked = performance.now();
  #stalled = -Infinity; // when this page itself last had no time to listen

  // told: what takes the answers, by method; changed(silent) when the daemon falls silent or is heard again.
  constructor(rpc, told, changed) {
    this.rpc = rpc;
    this.changed = changed;
    for (const [method, take] of Object.entries(told)) this.#ask(method, take);
    setInterval(() => rpc.open && this.compare().catch(() => {}), compare_every);
    setInterval(() => this.#look(), 100);
  }

  // Each by itself: run.status is answered at once, others wait for what the page has asked before.
  #ask(method, take) {
    let waiting = false;
    setInterval(async () => {
      if (waiting || !this.rpc.open) return;
      waiting = true;
      try {
        take(await this.rpc.call(method));
      } catch {
        // what it means is seen by the clock below
      } finally {
        waiting = false;
      }
    }, ask_every);
  }

  // What the daemon says of itself.
  async compare() {
    const sent = performance.now();
    const info = await this.rpc.call("system.info");
    const at = performance.now();
    const took = at - sent;
    const before = this.#clock;
    if (!before || took <= before.took + drift * (at - before.at)) this.#clock = { ahead: Date.parse(info.time) - sent - took / 2, took, at };
    return info;
  }

  get silent() {
    return this.#silent === true;
  }

  sampled(measured) {
    this.#lastSample = Date.parse(measured);
  }

  // ms since the newest sample that came was measured.
  get sampleAge() {
    return this.#lastSample === null || !this.#clock ? null : performance.now() + this.#clock.ahead - this.#lastSample;
  }

  #look() {
    const now = performance.now();
    if (now - this.#looked > stall) this.#stalled = now;
    this.#looked = now;
    const quiet = now - this.rpc.heard;
    const silent = !this.rpc.open || (quiet > silent_after && now - this.#stalled > stall);
    if (silent !== this.#silent) {
      this.#silent = silent;
      this.changed(silent);
    }
    if (!silent) return;
    const anew = !this.rpc.open && quiet > 5000 ? " If the daemon was started anew, open the address that it printed." : "";
    const age = this.sampleAge;
    const sample = age === null ? "no sample was seen" : `last sample ${seconds(age)} ago`;
    byId("state-reason").textContent =
      `${this.rpc.open ? "No answer" : "No connection"} for ${seconds(quiet)}, ${sample}. What the bench does is not known here; a run goes on without this page.${anew}`;
  }
}
