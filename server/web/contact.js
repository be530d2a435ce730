// Whether the daemon answers. It is asked twice a second; after a second and a half without anything from it the page says so,
// and claims nothing about the bench that it cannot know.
import { byId, number } from "./dom.js";

const ask_every = 500; // ms
const silent_after = 1500;
const stall = 400;

const seconds = (ms) => `${number(Math.max(0, ms) / 1000, ms < 10_000 ? 2 : 3)} s`;

export class Contact {
  #lastSample = null;
  #silent = null;
  #looked = performance.now();
  #stalled = -Infinity; // when this page itself last had no time to listen

  // asked(status, lease) with every answer; changed(silent) when the daemon falls silent or is heard again.
  constructor(rpc, asked, changed) {
    this.rpc = rpc;
    this.changed = changed;
    let waiting = false;
    setInterval(async () => {
      if (waiting || !rpc.open) return;
      waiting = true;
      try {
        asked(...(await Promise.all([rpc.call("run.status"), rpc.call("lease.status")])));
      } catch {
        // what it means is seen by the clock below
      } finally {
        waiting = false;
      }
    }, ask_every);
    setInterval(() => this.#look(), 100);
  }

  get silent() {
    return this.#silent === true;
  }

  sampled() {
    this.#lastSample = performance.now();
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
    const sample = this.#lastSample === null ? "no sample was seen" : `last sample ${seconds(now - this.#lastSample)} ago`;
    byId("state-reason").textContent =
      `${this.rpc.open ? "No answer" : "No connection"} for ${seconds(quiet)}, ${sample}. What the bench does is not known here; a run goes on without this page.${anew}`;
  }
}
