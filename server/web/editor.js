// The protocol as a table of segments: kinds, fields and their units are those of the daemon's schema. Every change can be undone.
import { button, element } from "./dom.js";

const most_steps = 100;
// As the daemon's schema has them: which of the two is the protocol's own "unit".
const level_unit = "kV/mm or V";
const rate_unit = "kV/mm/s or V/s";

// What stands at a JSON pointer.
const parts = (path) => path.split("/").slice(1).map((p) => p.replaceAll("~1", "/").replaceAll("~0", "~"));
const lookup = (json, path) => parts(path).reduce((at, key) => at?.[key], json);

// "0, -0.45, $low": numbers as numbers, a parameter's name as it stands; pairs by semicolons.
const readScalar = (text) => (text.trim() === "" || Number.isNaN(Number(text.trim().replace("−", "-"))) ? text.trim() : Number(text.trim().replace("−", "-")));
const readList = (text) => (text.includes(";")
  ? text.split(";").filter((t) => t.trim()).map((pair) => pair.split(",").map(readScalar))
  : text.split(",").filter((t) => t.trim()).map(readScalar));
const showList = (list) => (list.some(Array.isArray) ? list.map((pair) => (Array.isArray(pair) ? pair.join(", ") : pair)).join("; ") : list.join(", "));

export class Editor {
  #undo = [];
  #redo = [];

  // changed(protocol) after each change; chosen(path) when a row is chosen
  constructor(rpc, place, changed, chosen) {
    Object.assign(this, { rpc, place, changed, chosen });
    this.kinds = new Map();
    this.head = element("div", { class: "tools" });
    this.rows = element("div", { class: "segments" });
    place.append(this.head, this.rows);
    this.undoButton = button("Undo", () => this.#step(this.#undo, this.#redo), { id: "undo", disabled: true });
    this.redoButton = button("Redo", () => this.#step(this.#redo, this.#undo), { id: "redo", disabled: true });
    place.addEventListener("keydown", (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
      event.preventDefault();
      if (event.shiftKey) this.#step(this.#redo, this.#undo);
      else this.#step(this.#undo, this.#redo);
    });
  }

  async load() {
    if (this.kinds.size) return;
    const schema = await this.rpc.call("protocol.schema");
    for (const kind of schema.$defs.segment.properties.kind.enum) this.kinds.set(kind, schema.$defs[kind]);
  }

  show(protocol) {
    this.protocol = structuredClone(protocol);
    this.#undo = [];
    this.#redo = [];
    this.path = null;
    this.#draw();
  }

  at(path) {
    return path ? lookup(this.protocol, path) : undefined;
  }

  setLevel(path, level) {
    this.#change((p) => (lookup(p, path).to = level));
  }

  choose(path) {
    this.path = path;
    for (const row of this.rows.querySelectorAll("[data-segment]")) {
      const mine = row.dataset.segment === path;
      if (mine) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
      if (mine) row.scrollIntoView({ block: "nearest" });
    }
    this.chosen(path);
  }

  #unit(info) {
    const levels = this.protocol?.unit ?? "kV/mm";
    const unit = info?.["x-unit"] ?? "";
    return unit === level_unit ? levels : unit === rate_unit ? `${levels}/s` : unit;
  }

  // Of a parameter: that of the first field which it stands for.
  unitOf(name) {
    const search = (segments) => {
      for (const s of segments ?? []) {
        for (const [key, value] of Object.entries(s))
          if (value === `$${name}` || (Array.isArray(value) && value.includes(`$${name}`))) return this.#unit(this.kinds.get(s.kind)?.properties[key]);
        const inside = s.segments && search(s.segments);
        if (inside) return inside;
      }
      return "";
    };
    return search(this.protocol?.segments);
  }

  #change(what) {
    this.#undo.push(JSON.stringify(this.protocol));
    if (this.#undo.length > most_steps) this.#undo.shift();
    this.#redo = [];
    what(this.protocol);
    this.#draw();
    this.changed(structuredClone(this.protocol));
  }

  #step(from, to) {
    if (!from.length) return;
    to.push(JSON.stringify(this.protocol));
    this.protocol = JSON.parse(from.pop());
    this.#draw();
    this.changed(structuredClone(this.protocol));
  }

  #draw() {
    const focused = document.activeElement?.dataset?.path;
    this.undoButton.disabled = !this.#undo.length;
    this.redoButton.disabled = !this.#redo.length;
    const unit = element("select", { "aria-label": "Unit of levels", id: "level-unit", onchange: (e) => this.#convert(e.target.value) },
      ...["kV/mm", "V"].map((u) => element("option", { value: u }, u)));
    unit.value = this.protocol.unit ?? "kV/mm";
    const start = this.#input(this.protocol.start, "/protocol/start", (v) => this.#change((p) => (v === undefined ? delete p.start : (p.start = v))), { size: 6 });
    this.head.replaceChildren(this.undoButton, this.redoButton,
      element("label", {}, "Levels in ", unit), element("label", {}, `Start [${this.protocol.unit ?? "kV/mm"}] `, start));
    this.rows.replaceChildren(...this.#list(this.protocol.segments ?? [], "/segments"), this.#add("/segments"));
    if (this.path) this.choose(this.path);
    if (focused) this.place.querySelector(`[data-path="${CSS.escape(focused)}"]`)?.focus();
  }

  #input(value, path, done, attributes = {}) {
    return element("input", { value: value ?? "", "data-path": path, onchange: (e) => done(e.target.value.trim() === "" ? undefined : readScalar(e.target.value.replace(",", "."))), ...attributes });
  }

  #list(segments, path) {
    return segments.map((s, i) => this.#row(s, `${path}/${i}`, path, i, segments.length));
  }

  #row(s, path, parent, i, length) {
    const known = this.kinds.get(s.kind);
    const kind = element("select", { "aria-label": "Kind", "data-path": `/protocol${path}/kind`, onchange: (e) => this.#change((p) => (lookup(p, parent)[i] = this.#fresh(e.target.value))) },
      ...[...this.kinds.keys()].map((k) => element("option", { value: k }, k)));
    kind.value = s.kind;
    const move = (by) => () => this.#change((p) => {
      const list = lookup(p, parent);
      list.splice(i + by, 0, ...list.splice(i, 1));
    });
    const row = element("div", { class: "segment", "data-segment": path, onfocusin: () => this.path !== path && this.choose(path), onclick: () => this.path !== path && this.choose(path) },
      element("span", { class: "place" }, String(i + 1)), kind,
      element("div", { class: "segment-fields" }, ...this.#fields(s, known).map(([key, info]) => this.#field(s, path, key, info, known))),
      element("div", { class: "segment-tools" },
        button("↑", move(-1), { disabled: i === 0, "aria-label": "Move up" }), button("↓", move(1), { disabled: i + 1 === length, "aria-label": "Move down" }),
        button("+", () => this.#change((p) => lookup(p, parent).splice(i + 1, 0, structuredClone(s))), { "aria-label": "Repeat this row below" }),
        button("×", () => this.#change((p) => lookup(p, parent).splice(i, 1)), { disabled: length === 1, "aria-label": "Remove" })));
    if (!s.segments) return row;
    return element("div", { class: "nest" }, row, element("div", { class: "nested" }, ...this.#list(s.segments, `${path}/segments`), this.#add(`${path}/segments`)));
  }

  // What is given or must be first, what may be after it.
  #fields(s, known) {
    const unused = ([key]) => Number(s[key] === undefined && !known.then.required?.includes(key));
    return Object.entries(known?.properties ?? {}).filter(([key]) => !["kind", "segments"].includes(key)).sort((a, b) => unused(a) - unused(b));
  }

  #field(s, path, key, info, known) {
    const value = s[key];
    const wanted = known.then.required?.includes(key);
    const unit = this.#unit(info);
    const put = (v) => this.#change((p) => {
      const at = lookup(p, path);
      if (v === undefined) delete at[key];
      else at[key] = v;
    });
    const pointer = `/protocol${path}/${key}`;
    let input;
    if (info.enum) {
      input = element("select", { "data-path": pointer, onchange: (e) => put(e.target.value || undefined) }, ...["", ...info.enum].map((o) => element("option", { value: o }, o || "usual")));
      input.value = value ?? "";
    } else if (info.type === "boolean") {
      input = element("input", { type: "checkbox", checked: value === true, "data-path": pointer, onchange: (e) => put(e.target.checked || undefined) });
    } else if (Array.isArray(value) || info.type === "array") {
      input = element("input", { value: value ? showList(value) : "", "data-path": pointer, size: 26, onchange: (e) => put(e.target.value.trim() ? readList(e.target.value) : undefined) });
    } else {
      input = this.#input(value, pointer, put, { size: key === "label" || key === "csv" ? 12 : 6, inputmode: key === "label" ? "text" : "decimal" });
    }
    return element("label", { class: value === undefined && !wanted ? "unused" : undefined, title: info.description }, `${key.replace(/_Hz$/, "").replaceAll("_", " ")}${unit ? ` [${unit}]` : ""}`, " ", input);
  }

  // What a new segment of a kind begins with.
  #fresh(kind) {
    return { ramp: { kind, to: 0, rate: 1 }, hold: { kind, time: 1 }, triangle: { kind, low: -1, high: 1, rate: 1, cycles: 1 },
      sine: { kind, amplitude: 0.5, frequency: 1, cycles: 1 }, pund: { kind, amplitude: 1, width: 0.1, delay: 0.1, rate: 10 },
      small_signal: { kind, levels: [1, 0, -1], rate: 1, settle: 1, amplitude: 0.02, frequency: 10 },
      points: { kind, points: [[0, 0], [1, 1]] }, reversals: { kind, points: [0], rate: 1, back_to: 1 },
      repeat: { kind, count: 2, segments: [{ kind: "hold", time: 1 }] } }[kind] ?? { kind };
  }

  #add(path) {
    return element("div", {}, button("Add a segment", () => this.#change((p) => lookup(p, path).push(this.#fresh("hold"))), { class: "small" }));
  }

  // The same program in another unit; a volt's size is that of the specimen.
  async #convert(unit) {
    const ask = async (name) => (await this.rpc.call("protocol.preview", { protocol: { format: "ferrobench-protocol", version: 1, name: "unit", unit: name, start: 0, segments: [{ kind: "hold", time: 1 }] }, max_points: 2 })).unit_V_per_m;
    const factor = (await ask(this.protocol.unit ?? "kV/mm")) / (await ask(unit));
    const scaled = (v) => (typeof v === "number" ? Number((v * factor).toPrecision(12)) : v);
    const levels = (info) => [level_unit, rate_unit].includes(info?.["x-unit"]);
    const used = new Set();
    const walk = (segments) => segments.forEach((s) => {
      const known = this.kinds.get(s.kind)?.properties ?? {};
      for (const [key, value] of Object.entries(s)) {
        if (key === "segments") walk(value);
        else if (s.kind === "points" && key === "points") s[key] = value.map(([t, v]) => [t, scaled(v)]);
        else if (levels(known[key])) {
          if (typeof value === "string") used.add(value.slice(1));
          s[key] = Array.isArray(value) ? value.map(scaled) : scaled(value);
        }
      }
    });
    this.#change((p) => {
      p.unit = unit;
      if (p.start !== undefined) p.start = scaled(p.start);
      walk(p.segments);
      for (const name of used) if (p.parameters?.[name] !== undefined) p.parameters[name] = scaled(p.parameters[name]);
    });
  }
}
