// The queue: what it does, what waits and what is over; start, stop, confirm, move, remove.
import { button, byId, element } from "./dom.js";
import { clearErrors, showError } from "./errors.js";

const pageSize = 50;
const kind = (state) => (state === "complete" ? "good" : ["waiting", "running"].includes(state) ? "" : "wrong");
const words = { stopped: "Stopped", running: "Running", asks: "Waits for you", waits: "Waits" };

export class QueueView {
  #first = 0;
  #asked = 0;
  #soon = null;

  constructor(rpc) {
    this.rpc = rpc;
    byId("queue-start").addEventListener("click", () => this.#do("queue.start", {}, "The queue was not started."));
    byId("queue-stop").addEventListener("click", () => this.#do("queue.stop", {}, "The queue was not stopped."));
    byId("queue-confirm").addEventListener("click", () => this.#do("queue.confirm", { item: this.queue.item }, "Nothing was confirmed."));
    byId("queue-before").addEventListener("click", () => this.#turn(-pageSize));
    byId("queue-after").addEventListener("click", () => this.#turn(pageSize));
    byId("queue-state").addEventListener("input", () => {
      this.#first = 0;
      this.refresh();
    });
    byId("plan-file").addEventListener("change", (event) => this.#addFile(event.target.files[0]));
    rpc.on("queue", () => this.#refreshSoon());
  }

  // Many runs may end within a second.
  #refreshSoon() {
    this.#soon ??= setTimeout(() => {
      this.#soon = null;
      this.refresh();
    }, 250);
  }

  #turn(by) {
    this.#first = Math.max(0, this.#first + by);
    this.refresh();
  }

  async refresh() {
    const asked = ++this.#asked;
    try {
      const listed = await this.rpc.call("queue.list", { first: this.#first, count: pageSize, state: byId("queue-state").value || undefined });
      if (asked === this.#asked) this.#show(listed);
    } catch (error) {
      if (asked === this.#asked) showError("The queue could not be read.", error);
    }
  }

  async #do(method, params, failure) {
    try {
      await this.rpc.call(method, params);
      clearErrors();
    } catch (error) {
      showError(failure, error);
    }
    return this.refresh();
  }

  async #addFile(file) {
    if (!file) return;
    byId("plan-file").value = "";
    try {
      const plan = JSON.parse(await file.text());
      await this.#do("queue.add", { plan }, `${file.name} was not added.`);
    } catch (error) {
      showError(`${file.name} is not JSON.`, { message: error.message, problems: [] });
    }
  }

  #show({ queue, items, total, counts }) {
    this.queue = queue;
    const what = queue.state === "running" || (queue.state === "stopped" && queue.item) ? `Item ${queue.item} is under way.` : "";
    byId("queue-now").textContent = [`${words[queue.state] ?? queue.state}${queue.reason ? `: ${queue.reason}` : ""}.`, queue.confirm && `${queue.confirm}.`, what].filter(Boolean).join(" ");
    byId("queue-now").dataset.state = queue.state;
    byId("queue-confirm").hidden = queue.state !== "asks";
    byId("queue-start").disabled = queue.state !== "stopped" || !counts.waiting;
    byId("queue-stop").disabled = queue.state === "stopped";
    byId("queue-count").textContent = Object.entries(counts).filter(([, n]) => n).map(([state, n]) => `${n} ${state.replace("_", " ")}`).join(", ");
    byId("queue-none").hidden = items.length > 0;
    byId("queue-items").replaceChildren(...items.map((item) => this.#item(item)));
    byId("queue-before").disabled = this.#first === 0;
    byId("queue-after").disabled = this.#first + items.length >= total;
    byId("queue-shown").textContent = items.length ? `${this.#first + 1} to ${this.#first + items.length} of ${total}` : "";
  }

  #item(item) {
    const values = Object.entries(item.values).map(([key, value]) => `${key} ${value}`);
    const about = [item.name, ...values, item.repeat > 1 && `repeat ${item.repeat}`].filter(Boolean).join(", ");
    const name = `item ${item.item}`;
    const waits = item.state === "waiting";
    const end = item.recording
      ? element("a", { href: `#recordings/${encodeURIComponent(item.recording)}` }, item.recording)
      : null;
    return element("li", { "data-item": item.item, "data-state": item.state },
      element("div", { class: "about" }, element("strong", {}, `${item.item}`), ` ${about}`,
        element("p", { class: "note" }, element("span", { class: kind(item.state) }, item.reason ? `${item.state}: ${item.reason}` : item.state), end && " · ", end)),
      button("First", () => this.#do("queue.move", { item: item.item, first: true }, "Nothing was moved."), { class: "small", hidden: !waits, "aria-label": `Move ${name} to the front` }),
      button("Last", () => this.#do("queue.move", { item: item.item }, "Nothing was moved."), { class: "small", hidden: !waits, "aria-label": `Move ${name} to the end` }),
      button("Remove", () => this.#do("queue.remove", { item: item.item }, "Nothing was removed."), { class: "small", hidden: item.state === "running", "aria-label": `Remove ${name}` }));
  }
}
