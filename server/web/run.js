// The state of the run in plain words, its progress, and the buttons that act on it.
import { byId, duration, quantity } from "./dom.js";
import { clearErrors, showError } from "./errors.js";

const words = {
  idle: ["Idle", "Nothing runs; the output is at zero."],
  arming: ["Arming", "The program is checked and the output goes to its first level."],
  running: ["Running", ""],
  pausing: ["Pausing", "The program waits as soon as it is in a hold."],
  paused: ["Paused", "The output is held where it is; samples keep coming."],
  stopping: ["Stopping", "The output goes to zero."],
  complete: ["Complete", "The output is back at zero."],
  aborted: ["Aborted", "The output is back at zero."],
};
const active = ["arming", "running", "pausing", "paused", "stopping"];

export class RunPanel {
  // changed(status, before)
  constructor(rpc, changed) {
    this.rpc = rpc;
    this.changed = changed;
    this.status = null;
    byId("pause").addEventListener("click", () => this.#ask("run.pause", "The run was not paused."));
    byId("resume").addEventListener("click", () => this.#ask("run.resume", "The run was not resumed."));
  }

  busy() {
    return active.includes(this.status?.state);
  }

  stop() {
    return this.#ask("run.abort", "Nothing was stopped.");
  }

  async #ask(method, failure) {
    try {
      clearErrors();
      await this.rpc.call(method); // what it changes comes as a notification
    } catch (error) {
      showError(failure, error);
    }
  }

  lost() {
    byId("state").dataset.state = "unknown";
    byId("state-word").textContent = "Unknown";
    byId("state-reason").textContent = "The page has no connection to the daemon. A run goes on without it.";
    byId("progress").hidden = true;
    this.showOutput(null);
    this.status = null;
  }

  // The answer to run.start may come after the first notifications of that run, and is then out of date.
  begin(status) {
    if (this.status?.run !== status.run) this.show(status);
  }

  show(status) {
    if (!status?.state) return;
    const before = this.status && { ...this.status, busy: this.busy() };
    this.status = status;
    const [word, explanation] = words[status.state] ?? [status.state, ""];
    byId("state").dataset.state = status.state;
    const what = status.protocol ? `${status.title || status.protocol}.` : "";
    const risen = !this.busy() && status.output_at_zero === false;
    const said = risen ? "The output may not be at zero: switch the amplifier off!" : explanation;
    byId("state").dataset.danger = risen;
    const reason = [status.reason && `${status.reason[0].toUpperCase()}${status.reason.slice(1)}.`, what, said].filter(Boolean).join(" ").replaceAll("..", ".");
    // Only what changed is written, or a screen reader would say it again with every message.
    if (byId("state-word").textContent !== word) byId("state-word").textContent = word;
    if (byId("state-reason").textContent !== reason) byId("state-reason").textContent = reason;
    if (!this.busy()) this.showOutput(status.output_at_zero ? 0 : null);
    byId("pause").hidden = !["running", "pausing"].includes(status.state);
    byId("pause").disabled = status.state === "pausing";
    byId("resume").hidden = !["pausing", "paused"].includes(status.state);
    this.#progress(status);
    this.changed(status, before);
  }

  // V/m, or null where it is not known
  showOutput(level) {
    byId("output").textContent = level === null || level === undefined ? "unknown" : quantity(level, "V/m");
  }

  #progress({ progress, time_left_s: remaining }) {
    byId("progress").hidden = !this.busy();
    if (!this.busy()) return;
    byId("progress-bar").value = progress ?? 0;
    byId("progress-text").textContent = `${Math.floor((progress ?? 0) * 100)} %${remaining === undefined ? "" : `, ${duration(remaining)} left`}`;
  }
}
