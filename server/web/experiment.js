// What to run: a protocol of the library or one's own, its parameters, the load, the model; shown before it starts.
import { byId, count, duration, element, facts, quantity, readNumber } from "./dom.js";
import { clearErrors, showError } from "./errors.js";
import { makePreview } from "./plots.js";

const own = "(own)";

export class Experiment {
  // started(status): called with the daemon's answer to run.start
  constructor(rpc, started) {
    this.rpc = rpc;
    this.started = started;
    this.protocol = null; // as JSON
    this.allowed = false;
    this.plot = makePreview(byId("preview-plot"));
    this.wait = null;
    this.choice = 0; // of a protocol, and of what to preview: an answer to an earlier one comes too late
    this.asked = 0;
    byId("protocol").addEventListener("change", () => this.#choose(byId("protocol").value));
    byId("use-text").addEventListener("click", () => this.#useText());
    byId("protocol-file").addEventListener("change", (event) => this.#useFile(event.target.files[0]));
    byId("start-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#start();
    });
    byId("start-form").addEventListener("input", (event) => {
      if (event.target.matches("input")) this.#previewSoon();
    });
    byId("model").addEventListener("change", () => this.#preview());
  }

  async load() {
    const [{ protocols }, { models, default: usual }] = await Promise.all([this.rpc.call("protocol.list"), this.rpc.call("model.list")]);
    const chosen = byId("protocol").value;
    const model = byId("model").value;
    byId("protocol").replaceChildren(...protocols.map((p) => element("option", { value: p.name }, p.title || p.name)));
    byId("model").replaceChildren(...models.filter((m) => !m.error).map((m) => element("option", { value: m.name }, m.title || m.name)));
    byId("model").value = model || usual;
    if (chosen === own) return this.#addOwn();
    if (protocols.some((p) => p.name === chosen)) byId("protocol").value = chosen;
    if (!this.protocol || chosen !== this.protocol.name) await this.#choose(byId("protocol").value);
  }

  allowStart(allowed) {
    this.allowed = allowed;
    byId("start").disabled = !allowed;
  }

  async #choose(name) {
    if (name === own) return;
    const choice = ++this.choice;
    try {
      const { protocol } = await this.rpc.call("protocol.get", { name });
      if (choice === this.choice) this.#take(protocol);
    } catch (error) {
      if (choice === this.choice) showError("The protocol could not be read.", error);
    }
  }

  #take(protocol) {
    clearErrors();
    this.protocol = protocol;
    byId("protocol-text").value = JSON.stringify(protocol, null, 2);
    byId("protocol-note").textContent = [protocol.source && `From ${protocol.source}.`, protocol.notes].filter(Boolean).join(" ");
    const { spring_stiffness_N_per_m: spring, prestress_Pa: prestress } = protocol.load ?? {};
    byId("spring").value = spring === undefined ? "" : Number((spring * 1e-6).toPrecision(12));
    byId("prestress").value = prestress === undefined ? "" : Number((prestress * 1e-6).toPrecision(12));
    byId("sample-rate").value = protocol.sample_rate_Hz ?? "";
    const parameters = Object.entries(protocol.parameters ?? {});
    const box = byId("parameters");
    box.hidden = parameters.length === 0;
    box.replaceChildren(element("legend", {}, "Parameters of the protocol"), ...parameters.map(([name, value]) =>
      element("label", {}, name, " ", element("input", { inputmode: "decimal", value, "data-set": name }))));
    return this.#preview();
  }

  #addOwn() {
    const list = byId("protocol");
    if (!list.querySelector(`option[value="${own}"]`))
      list.append(element("option", { value: own }, "Your own (below)"));
    list.value = own;
  }

  #useText() {
    let protocol;
    try {
      protocol = JSON.parse(byId("protocol-text").value);
    } catch (error) {
      return showError("The text is not JSON.", error);
    }
    ++this.choice;
    this.#addOwn();
    return this.#take(protocol);
  }

  async #useFile(file) {
    if (!file) return;
    byId("protocol-text").value = await file.text();
    await this.#useText();
  }

  // What the form says, for protocol.preview and run.start. An empty field leaves the choice to the daemon.
  #program() {
    const set = {};
    for (const input of document.querySelectorAll("[data-set]")) {
      const value = readNumber(input, Number(input.dataset.scale ?? 1));
      if (value !== undefined) set[input.dataset.set] = value;
    }
    const name = byId("protocol").value;
    return { protocol: name === own ? this.protocol : name, model: byId("model").value || undefined, set };
  }

  #previewSoon() {
    clearTimeout(this.wait);
    this.wait = setTimeout(() => this.#preview(), 300);
  }

  async #preview() {
    clearTimeout(this.wait);
    const asked = ++this.asked;
    try {
      const p = await this.rpc.call("protocol.preview", this.#program());
      if (asked !== this.asked) return;
      byId("preview").hidden = false;
      this.plot.set(p.time, p.min, p.max);
      facts(byId("preview-facts"), [["Takes", duration(p.duration_s)], ["Samples", `${count(p.samples)} at ${quantity(p.sample_rate_Hz, "Hz")}`],
        ["Field", `from ${quantity(p.field_min, "V/m")} to ${quantity(p.field_max, "V/m")}`], ["Steepest", quantity(p.max_slew, "V/m/s")]]);
      if (p.problems?.length) showError("The guard would refuse this program:", { message: "it goes beyond the limits in force.", problems: p.problems });
      else clearErrors();
    } catch (error) {
      if (asked !== this.asked) return;
      byId("preview").hidden = true;
      showError("This program cannot be run as it stands.", error);
    }
  }

  async #start() {
    if (!this.allowed) return;
    this.allowStart(false);
    try {
      clearErrors();
      this.started(await this.rpc.call("run.start", {
        ...this.#program(), fast: byId("fast").checked, seed: readNumber(byId("seed")), notes: byId("notes").value || undefined,
      }));
      byId("live").scrollIntoView();
    } catch (error) {
      this.allowStart(true);
      showError("The run was not started.", error);
    }
  }
}
