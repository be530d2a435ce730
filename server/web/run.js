// The state of the run in plain words, its progress, and the buttons that act on it.
import { byId, count, duration, element, facts, moment, quantity } from "./dom.js";
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

// Only what changed is written, or a screen reader would say it again with every message.
function write(id, text) {
  if (byId(id).textContent !== text) byId(id).textContent = text;
}

export class RunPanel {
  // changed(status, before)
  constructor(rpc, changed) {
    this.rpc = rpc;
    this.changed = changed;
    this.status = null;
    this.silent = true;
    byId("pause").addEventListener("click", () => this.#ask("run.pause", "The run was not paused."));
    byId("resume").addEventListener("click", () => this.#ask("run.resume", "The run was not resumed."));
  }

  busy() {
    return active.includes(this.status?.state);
  }

  async stop() {
    clearErrors();
    const unanswered = setTimeout(() => showError("Stop was sent, and not answered yet.",
      { message: "If the output must be at zero now, switch the amplifier off.", problems: [] }), 1500);
    await this.#ask("run.abort", "Nothing was stopped.");
    clearTimeout(unanswered);
  }

  async #ask(method, failure) {
    try {
      await this.rpc.call(method); // what it changes comes as a notification
      clearErrors();
    } catch (error) {
      showError(failure, error);
    }
  }

  // While the daemon is silent the reason is the contact's business.
  setSilent(silent) {
    this.silent = silent;
    if (!silent) {
      if (this.status) this.show(this.status);
      return;
    }
    byId("state").dataset.state = "unknown";
    byId("state").dataset.danger = false;
    write("state-word", "No answer");
    for (const id of ["progress", "pause", "resume"]) byId(id).hidden = true;
    this.showOutput(null);
  }

  // The answer to run.start may come after the first notifications of that run, and is then out of date.
  begin(status) {
    if (this.status?.run !== status.run) this.show(status);
  }

  show(status) {
    if (!status?.state) return;
    // An answer that was asked for while the run went on, and comes after the notification of its end.
    if (status.run === this.status?.run && active.includes(status.state) && !this.busy()) return;
    const before = this.status && { ...this.status, busy: this.busy() };
    this.status = status;
    if (!this.silent) this.#write(status);
    this.changed(status, before);
  }

  #write(status) {
    const [word, explanation] = words[status.state] ?? [status.state, ""];
    byId("state").dataset.state = status.state;
    const what = status.protocol ? `${status.title || status.protocol}.` : "";
    const risen = !this.busy() && status.output_at_zero === false;
    const said = risen ? "The output may not be at zero: switch the amplifier off!" : explanation;
    byId("state").dataset.danger = risen || Boolean(status.warning);
    const reason = [status.reason && `${status.reason[0].toUpperCase()}${status.reason.slice(1)}.`, what, said, status.warning]
      .filter(Boolean).join(" ").replaceAll("..", ".");
    write("state-word", word);
    write("state-reason", reason);
    if (!this.busy()) this.showOutput(status.output_at_zero ? 0 : null);
    byId("pause").hidden = !["running", "pausing"].includes(status.state);
    byId("pause").disabled = status.state === "pausing";
    byId("resume").hidden = !["pausing", "paused"].includes(status.state);
    this.#progress(status);
    this.#facts(status);
  }

  // V/m, or null where it is not known
  showOutput(level) {
    byId("output").textContent = level === null || level === undefined || this.silent ? "unknown" : quantity(level, "V/m");
  }

  #progress({ progress, time_left_s: remaining }) {
    byId("progress").hidden = !this.busy();
    if (!this.busy()) return;
    byId("progress-bar").value = progress ?? 0;
    byId("progress-text").textContent = `${Math.floor((progress ?? 0) * 100)} %${remaining === undefined || remaining === null ? "" : `, ${duration(remaining)} left`}`;
  }

  #facts(s) {
    const recording = s.recording ? element("a", { href: `#recordings/${encodeURIComponent(s.recording)}` }, s.recording) : "none";
    facts(byId("run-facts"), s.run ? [
      ["Program", s.title || s.protocol || "–"], ["Device", s.device || "–"], ["Recording", recording],
      ["Samples", s.rows_expected ? `${count(s.rows)} of ${count(s.rows_expected)}` : count(s.rows ?? 0)],
      ["On disk", count(s.rows_on_disk ?? 0)], ["Rate", quantity(s.sample_rate_Hz, "Hz")],
      ["Takes", duration(s.duration_s)], ["Started", moment(s.started)],
    ] : [["Program", "none since the daemon started"]]);
  }
}
