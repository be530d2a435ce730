// What to run: a protocol of the library or one's own, drawn; its parameters, the load, the device, the model; shown before it
// starts, with the way from 0 to its first level and the limits in force.
import { Chart, colour } from "./chart.js";
import { bytes, byId, count, duration, element, facts, quantity, readNumber, timeAxis } from "./dom.js";
import { Editor } from "./editor.js";
import { clearErrors, showError } from "./errors.js";

const most_bytes_per_sample = 58; // time, five channels and five counts, before compression

// The protocol's outline: the level at both ends of each stretch.
function outline(p) {
  const x = [];
  const low = [];
  const high = [];
  p.time.forEach((t, i) => {
    x.push(t);
    low.push(p.min[i]);
    high.push(p.max[i]);
  });
  return { x, low, high };
}

// A small drawing without axes.
function thumbnail(canvas, p) {
  const [w, h] = [canvas.width, canvas.height];
  const ctx = canvas.getContext("2d");
  const low = Math.min(0, ...p.min);
  const high = Math.max(0, ...p.max);
  const x = (t) => 3 + (t / (p.duration_s || 1)) * (w - 6);
  const y = (v) => h - 4 - ((v - low) / (high - low || 1)) * (h - 8);
  ctx.clearRect(0, 0, w, h);
  ctx.strokeStyle = colour("--faint");
  ctx.beginPath();
  ctx.moveTo(0, y(0));
  ctx.lineTo(w, y(0));
  ctx.stroke();
  ctx.strokeStyle = colour("--line");
  ctx.lineWidth = 1.5;
  ctx.beginPath();
  p.time.forEach((t, i) => {
    const rising = i > 0 && p.max[i] > p.max[i - 1];
    ctx.lineTo(x(t), y(rising ? p.min[i] : p.max[i]));
    ctx.lineTo(x(t), y(rising ? p.max[i] : p.min[i]));
  });
  ctx.stroke();
}

export class Experiment {
  // started(status): called with the daemon's answer to run.start
  constructor(rpc, started) {
    this.rpc = rpc;
    this.started = started;
    this.protocol = null; // as JSON
    this.written = false; // whether somebody has begun a text of their own
    this.allowed = false;
    this.limits = null;
    this.wait = null;
    this.choice = 0; // of a protocol, and of what to preview: an answer to an earlier one comes too late
    this.asked = 0;
    this.plot = new Chart(byId("preview-plot"), { title: "Field program", x: timeAxis, y: { name: "field", unit: "kV/mm", factor: 1e-6 }, height: 300 });
    this.editor = new Editor(rpc, byId("editor"), (protocol) => this.#edited(protocol), (path) => this.#choosePath(path));
    this.plot.u?.over.addEventListener("click", (event) => this.#clicked(this.plot.u.posToVal(event.offsetX, "x")));
    this.#dragging();
    this.redraw = new Map(); // of the library, by name
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw.forEach((draw) => draw()));
    byId("protocol-search").addEventListener("input", () => this.#filter());
    byId("protocol-file").addEventListener("change", (event) => this.#useFile(event.target.files[0]));
    // What somebody writes is not replaced by a protocol that was still on its way.
    byId("protocol-text").addEventListener("input", () => {
      ++this.choice;
      this.written = true;
    });
    byId("use-text").addEventListener("click", () => this.#useText());
    byId("wait-channel").addEventListener("change", (event) => {
      byId("wait-unit").value = event.target.selectedOptions[0].dataset.unit ?? "";
    });
    byId("enqueue").addEventListener("click", () => this.#enqueue());
    byId("save-protocol").addEventListener("click", () => this.#save());
    byId("start-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#start();
    });
    byId("start-form").addEventListener("input", (event) => {
      if (event.target.matches("[data-set]")) this.#previewSoon();
    });
    byId("model").addEventListener("change", () => this.#preview());
    byId("device").addEventListener("change", () => this.#deviceChosen());
  }

  async load(limits, devices) {
    this.limits = limits;
    const { protocols } = await this.rpc.call("protocol.list");
    this.#cards(protocols);
    const kinds = devices.kinds.map((k) => k.name).filter((k) => k !== "replay");
    const chosen = byId("device").value;
    byId("device").replaceChildren(...[...kinds, ...devices.open].map((d) => element("option", { value: d }, devices.open.includes(d) ? `${d} (open)` : d)));
    if (chosen) byId("device").value = chosen;
    await this.editor.load();
    if (!this.protocol && !this.written) await this.choose(protocols.find((p) => p.name === "full-loops")?.name ?? protocols[0].name);
    else await this.#preview();
  }

  #cards(protocols) {
    const seen = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries)
        if (isIntersecting) {
          seen.unobserve(target);
          this.#draw(target);
        }
    });
    byId("library").replaceChildren(...protocols.map((p) => {
      const card = element("button", { type: "button", class: "protocol", "data-name": p.name, onclick: () => this.choose(p.name) },
        element("canvas", { width: 240, height: 72, "aria-hidden": "true" }), element("strong", {}, p.title || p.name),
        element("span", { class: "note" }, p.shipped ? p.source : "own"), element("span", { class: "note about" }));
      seen.observe(card);
      return card;
    }));
    this.#filter();
    this.#mark();
  }

  async #draw(card) {
    try {
      const p = await this.rpc.call("protocol.preview", { protocol: card.dataset.name, max_points: 300 });
      const draw = () => thumbnail(card.querySelector("canvas"), p);
      draw();
      this.redraw.set(card.dataset.name, draw);
      card.querySelector(".about").textContent = `${duration(p.duration_s)}, ${count(p.samples)} samples`;
    } catch (error) {
      card.querySelector(".about").textContent = error.message;
    }
  }

  #filter() {
    const words = byId("protocol-search").value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const card of byId("library").children) card.hidden = !words.every((w) => `${card.dataset.name} ${card.textContent}`.toLowerCase().includes(w));
  }

  #mark() {
    for (const card of byId("library").children) card.setAttribute("aria-pressed", card.dataset.name === this.chosen);
  }

  allowStart(allowed, why = "") {
    this.allowed = allowed;
    byId("start").disabled = !allowed;
    byId("start-note").textContent = allowed ? "" : why;
  }

  async choose(name) {
    const choice = ++this.choice;
    try {
      const { protocol } = await this.rpc.call("protocol.get", { name });
      if (choice !== this.choice) return;
      this.chosen = name;
      this.take(protocol);
    } catch (error) {
      if (choice === this.choice) showError("The protocol could not be read.", error);
    }
  }

  // A protocol from elsewhere: a file, a text, what a search proposes.
  async take(protocol) {
    if (typeof protocol === "string") return this.choose(protocol);
    ++this.choice;
    clearErrors();
    if (protocol.name !== this.chosen) this.chosen = null;
    this.#mark();
    this.protocol = protocol;
    this.editor.show(protocol);
    this.#fill();
    return this.#preview();
  }

  #fill() {
    const { protocol } = this;
    byId("protocol-title").textContent = protocol.title || protocol.name || "Your own";
    byId("protocol-note").textContent = [protocol.source && `From ${protocol.source}.`, protocol.notes].filter(Boolean).join(" ");
    byId("protocol-text").value = JSON.stringify(protocol, null, 2);
    const { spring_stiffness_N_per_m: spring, prestress_Pa: prestress } = protocol.load ?? {};
    byId("spring").value = spring === undefined ? "" : Number((spring * 1e-6).toPrecision(12));
    byId("prestress").value = prestress === undefined ? "" : Number((prestress * 1e-6).toPrecision(12));
    byId("sample-rate").value = protocol.sample_rate_Hz ?? "";
    this.#parameters();
  }

  // A parameter has the unit of where it is used.
  #parameters() {
    const parameters = Object.entries(this.protocol.parameters ?? {});
    byId("sweep-settings").replaceChildren(...[...parameters.map(([name]) => name), "prestress_MPa"].map((name) => element("option", { value: name })));
    const box = byId("parameters");
    box.hidden = parameters.length === 0;
    box.replaceChildren(element("legend", {}, "Parameters of the protocol"), ...parameters.map(([name, value]) => {
      const unit = this.editor.unitOf(name);
      return element("label", {}, unit ? `${name} [${unit}]` : name, " ", element("input", { inputmode: "decimal", value, "data-set": name }));
    }));
  }

  // The editor's change: the drawing follows.
  #edited(protocol) {
    this.protocol = protocol;
    this.chosen = null;
    this.#mark();
    byId("protocol-text").value = JSON.stringify(protocol, null, 2);
    this.#parameters();
    this.#previewSoon();
  }

  #useText() {
    try {
      this.take(JSON.parse(byId("protocol-text").value));
    } catch (error) {
      showError("The text is not JSON.", { message: error.message, problems: [] });
    }
  }

  async #useFile(file) {
    if (!file) return;
    byId("protocol-text").value = await file.text();
    byId("protocol-file").value = "";
    this.#useText();
  }

  async #save() {
    const name = byId("save-name").value.trim();
    try {
      clearErrors();
      await this.rpc.call("protocol.put", { name, protocol: this.protocol });
      const { protocols } = await this.rpc.call("protocol.list");
      this.chosen = name;
      this.#cards(protocols);
    } catch (error) {
      showError("The protocol was not saved.", error);
    }
  }

  #deviceChosen() {
    const modelled = byId("device").value === "virtual";
    for (const id of ["model", "fast", "seed"]) byId(id).disabled = !modelled;
  }

  // What the form says, for protocol.preview and run.start. An empty field leaves the choice to the daemon.
  #program() {
    const set = {};
    for (const input of document.querySelectorAll("#start-form [data-set]")) {
      const value = readNumber(input, Number(input.dataset.scale ?? 1));
      if (value !== undefined) set[input.dataset.set] = value;
    }
    const modelled = byId("device").value === "virtual";
    return { protocol: this.chosen ?? this.protocol, model: modelled ? byId("model").value || undefined : undefined, set };
  }

  #previewSoon() {
    clearTimeout(this.wait);
    this.wait = setTimeout(() => this.#preview(), 250);
  }

  async #preview() {
    clearTimeout(this.wait);
    if (!this.protocol) return;
    const asked = ++this.asked;
    try {
      const p = await this.rpc.call("protocol.preview", { ...this.#program(), max_points: 2000 });
      if (asked !== this.asked) return;
      this.segments = p.segments ?? [];
      this.unitSize = p.unit_V_per_m;
      this.#show(p);
      if (p.problems?.length) showError("The guard would refuse this program:", { message: "it goes beyond the limits in force.", problems: p.problems });
      else clearErrors();
    } catch (error) {
      if (asked !== this.asked) return;
      this.segments = [];
      this.#markSegments();
      this.plot.dots = [];
      this.plot.set([]);
      facts(byId("preview-facts"), []);
      showError("This program cannot be run as it stands.", error);
    }
  }

  #show(p) {
    const { start } = this.protocol;
    const first = typeof start === "number" ? start * p.unit_V_per_m : (p.min[0] ?? 0);
    const slew = Math.min(this.limits?.stop_slew ?? 1e6, this.limits?.slew ?? 1e6);
    const way = Math.abs(first) / slew;
    const { x, low, high } = outline(p);
    const curves = [{ name: "program", colour: () => colour("--line"), x, low, high }];
    if (way > 0) curves.unshift({ name: "way from 0", colour: () => colour("--quiet"), dashed: true, x: [-way, 0], y: [0, first] });
    this.plot.lines = this.limits ? [["field_max", "largest field"], ["field_min", "lowest field"]].map(([key, text]) => ({ y: this.limits[key] * 1e-6, text: `${text}, ${quantity(this.limits[key], "V/m")}`, always: true })) : [];
    this.#markSegments();
    this.plot.dots = this.#handles();
    this.plot.set(curves);
    facts(byId("preview-facts"), [["Takes", duration(p.duration_s)], ["Samples", `${count(p.samples)} at ${quantity(p.sample_rate_Hz, "Hz")}`],
      ...(p.recorded_samples < p.samples ? [["Recorded", count(p.recorded_samples)]] : []),
      ["File", `up to ${bytes(p.recorded_samples * most_bytes_per_sample)}`],
      ["Field", `${quantity(p.field_min, "V/m")} to ${quantity(p.field_max, "V/m")}`], ["Steepest", quantity(p.max_slew, "V/m/s")]]);
  }

  // The row of the table and its part of the drawing are chosen together.
  #choosePath(path) {
    this.path = path;
    this.#markSegments();
    this.plot.dots = this.#handles();
    this.plot.redraw();
  }

  #markSegments() {
    this.plot.stretches = (this.segments ?? []).map((s) => ({ from: s.start_s, to: s.end_s, chosen: Boolean(this.path) && s.path === this.path }));
  }

  #clicked(time) {
    if (this.dragged) return;
    const segment = this.segments?.find((s) => s.start_s <= time && time <= s.end_s);
    if (segment) this.editor.choose(segment.path);
  }

  // The end of each ramp that stands in the table by itself can be dragged.
  #handles() {
    if (!this.protocol || (this.segments?.length ?? 0) > 200) return [];
    return (this.segments ?? []).filter((s) => typeof this.editor.at(s.path)?.to === "number").map((s) => ({ x: s.end_s, y: s.level * 1e-6, path: s.path }));
  }

  #dragging() {
    const { u } = this.plot;
    if (!u) return;
    let held = null;
    const near = (event) => this.plot.dots.find((d) => Math.hypot(u.valToPos(d.x, "x") - event.offsetX, u.valToPos(d.y, "y") - event.offsetY) < 10);
    u.over.addEventListener("mousedown", (event) => {
      held = near(event);
      this.dragged = Boolean(held);
      if (held) event.stopImmediatePropagation();
    }, true);
    u.over.addEventListener("mousemove", (event) => {
      u.over.style.cursor = held || near(event) ? "ns-resize" : "";
      if (!held) return;
      event.stopImmediatePropagation();
      held.y = u.posToVal(event.offsetY, "y");
      this.plot.redraw();
    }, true);
    addEventListener("mouseup", () => {
      if (!held) return;
      const level = Number(((held.y * 1e6) / this.unitSize).toPrecision(3));
      this.editor.setLevel(held.path, level);
      held = null;
    });
  }

  // What each run of a plan waits for.
  #wait() {
    const channel = byId("wait-channel").value;
    if (!channel) return undefined;
    const number = (id) => readNumber(byId(id));
    return { channel, value: number("wait-value"), tolerance: number("wait-tolerance"), unit: byId("wait-unit").value.trim(), for_s: number("wait-for"), timeout_s: number("wait-timeout") };
  }

  // What the form says, as a plan: with a setting that changes, several runs.
  async #enqueue() {
    const modelled = byId("device").value === "virtual";
    const set = byId("sweep-set").value.trim();
    const value = (text) => (Number.isNaN(Number(text)) ? text : Number(text));
    const values = byId("sweep-values").value.trim().split(/[\s;]+/).filter(Boolean).map(value);
    const plan = {
      run: {
        ...this.#program(), device: byId("device").value || "virtual", fast: modelled && byId("fast").checked ? true : undefined,
        seed: modelled ? readNumber(byId("seed")) : undefined, notes: byId("notes").value || undefined,
      },
      repeats: readNumber(byId("repeats")),
      wait: this.#wait(),
      sweeps: set || values.length ? [{ set, values, confirm: byId("sweep-confirm").value || undefined }] : undefined,
    };
    try {
      clearErrors();
      const added = await this.rpc.call("queue.add", { plan });
      byId("enqueue-note").textContent = `${added.count === 1 ? "One run" : `${added.count} runs`} added as plan ${added.plan}.`;
    } catch (error) {
      byId("enqueue-note").textContent = "";
      for (const problem of error.problems ?? []) problem.path = problem.path?.replace(/^\/plan(\/run)?/, "");
      showError("Nothing was put into the queue.", error);
    }
  }

  async #start() {
    if (!this.allowed) return;
    this.allowStart(false, "Starting …");
    const modelled = byId("device").value === "virtual";
    try {
      clearErrors();
      const status = await this.rpc.call("run.start", {
        ...this.#program(), device: byId("device").value || "virtual", fast: modelled && byId("fast").checked ? true : undefined,
        seed: modelled ? readNumber(byId("seed")) : undefined, notes: byId("notes").value || undefined,
      });
      location.hash = "#bench";
      this.started(status);
    } catch (error) {
      this.allowStart(true);
      showError("The run was not started.", error);
    }
  }
}
