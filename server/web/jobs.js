// Something long that the daemon does: its stage and progress are shown, it can be cancelled, its result is waited for.
import { button, duration, element } from "./dom.js";
import { showError } from "./errors.js";

export class Jobs {
  #changed = new Map();

  constructor(rpc) {
    this.rpc = rpc;
    rpc.on("job", (status) => this.#changed.get(status.job)?.(status));
  }

  // The status in the end, shown meanwhile in `place`. Throws what the job failed with.
  async follow(started, place) {
    const bar = element("progress", { max: 1, "aria-label": "Progress of the job" });
    const stage = element("span", { role: "status" });
    const cancel = button("Cancel", () => this.rpc.call("job.cancel", { job: started.job }).catch((e) => showError("The job was not cancelled.", e)));
    place.replaceChildren(element("div", { class: "progress job" }, bar, stage, cancel));
    const show = (s) => {
      bar.value = s.progress ?? 0;
      stage.textContent = `${s.stage || s.state}, ${Math.floor((s.progress ?? 0) * 100)} %${s.time_left_s > 0 ? `, ${duration(s.time_left_s)} left` : ""}`;
    };
    show(started);
    try {
      await new Promise((resolve) => {
        const over = (s) => (show(s), s.state !== "running" && resolve());
        this.#changed.set(started.job, over);
        // A notification may be missed, or have come before the answer.
        const ask = async () => {
          if (!this.#changed.has(started.job)) return;
          try {
            over(await this.rpc.call("job.status", { job: started.job }));
          } catch {
            // asked again when the daemon is there
          }
          setTimeout(ask, 2000);
        };
        ask();
      });
    } finally {
      this.#changed.delete(started.job);
    }
    const end = await this.rpc.call("job.status", { job: started.job });
    place.replaceChildren();
    if (end.state !== "complete" && !end.result) {
      const error = new Error(end.error?.message ?? end.state);
      error.problems = end.error?.problems ?? [];
      error.label = end.error?.name ?? end.state;
      throw error;
    }
    return end;
  }
}
