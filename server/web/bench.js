// Who controls the bench, its device, and its limits. Names, units and meanings are those of the daemon's own description.
import { byId, button, element, facts, number, quantity } from "./dom.js";
import { clearErrors, showError } from "./errors.js";

const held_for = 60; // s; renewed as long as the page is open

export class LeasePanel {
  // changed(): after whether this page may control has changed
  constructor(rpc, changed) {
    this.rpc = rpc;
    this.changed = changed;
    this.mine = "";
    this.status = { holder: "" };
    byId("lease-take").addEventListener("click", () => this.#take());
    byId("lease-release").addEventListener("click", () => this.#release());
    setInterval(() => this.mine && rpc.open && rpc.call("lease.renew", { duration_s: held_for }).catch(() => this.#lose()), 20_000);
  }

  get blocked() {
    return Boolean(this.status.holder) && !this.mine;
  }

  show(status) {
    this.status = status;
    if (this.mine && !status.holder) this.mine = "";
    const words = this.mine ? "This page controls the bench. Others may watch, and stop it."
      : status.holder ? `${status.holder} controls the bench for another ${number(status.expires_in_s, 2)} s, unless that is renewed. This page may watch, and stop it.`
        : "Nobody has taken control: whoever is here may start a run.";
    byId("lease-text").textContent = words;
    byId("lease-take").hidden = Boolean(status.holder) || Boolean(this.mine);
    byId("lease-release").hidden = !this.mine;
    this.changed();
  }

  setSilent(silent) {
    if (!silent) return this.show(this.status);
    byId("lease-text").textContent = "Not known: the daemon does not answer.";
    byId("lease-take").hidden = byId("lease-release").hidden = true;
  }

  // A connection that is new has the lease only after it has shown it.
  async reconnected() {
    if (!this.mine) return;
    await this.rpc.call("lease.present", { lease: this.mine }).catch(() => this.#lose());
  }

  #lose() {
    this.mine = "";
    this.changed();
  }

  async #take() {
    try {
      clearErrors();
      const status = await this.rpc.call("lease.acquire", { duration_s: held_for });
      this.mine = status.lease;
      this.show(status);
    } catch (error) {
      showError("Control was not taken.", error);
    }
  }

  async #release() {
    try {
      clearErrors();
      await this.rpc.call("lease.release");
      this.mine = "";
      this.show({ holder: "" });
    } catch (error) {
      showError("Control was not given back.", error);
    }
  }
}

export async function showLimits(rpc) {
  const [limits, document] = await Promise.all([rpc.call("limits.get"), rpc.call("rpc.discover")]);
  const schema = document.methods.find((m) => m.name === "limits.get")?.result.schema.properties ?? {};
  byId("limits").replaceChildren(...Object.entries(limits).map(([name, value]) =>
    element("tr", {}, element("th", { scope: "row", title: schema[name]?.description }, name.replaceAll("_", " ")),
      element("td", { class: "number" }, quantity(value, schema[name]?.["x-unit"])))));
  return limits;
}

export class DevicePanel {
  constructor(rpc) {
    this.rpc = rpc;
  }

  async load() {
    const list = await this.rpc.call("device.list");
    const usb = list.usb_problem || (list.usb?.length ? `${list.usb.length} attached` : "none attached");
    facts(byId("device-facts"), [["Kinds", list.kinds.map((k) => k.name).join(", ")], ["Open", list.open.join(", ") || "none"], ["USB units", usb]]);
    byId("device-open").replaceChildren(...list.open.map((id) => this.#open(id)));
    return list;
  }

  #open(id) {
    const place = element("dl", { class: "facts" });
    this.rpc.call("device.info", { device: id }).then(({ info }) => facts(place, Object.entries(info)
      .filter(([, v]) => typeof v !== "object").map(([k, v]) => [k.replaceAll("_", " "), String(v)]))).catch(() => {});
    return element("div", {}, element("h4", {}, id, " ", button("Close", () => this.#close(id), { class: "small", "aria-label": `Close ${id}` })), place);
  }

  async #close(id) {
    try {
      clearErrors();
      await this.rpc.call("device.close", { device: id });
      await this.load();
    } catch (error) {
      showError(`${id} was not closed.`, error);
    }
  }
}
