// Elements and numbers. Whatever comes from the daemon goes into the page as text, never as markup.

export const byId = (id) => document.getElementById(id);

// element("a", {href: "/", class: "x", onclick: fn}, "text", otherElement)
export function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children.map((child) => (child instanceof Node ? child : String(child ?? ""))));
  return node;
}

// Four significant digits, without an exponent where people would not write one.
export function number(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-3 || size >= 1e6) return value.toExponential(digits - 1).replace(/\.?0*e\+?/, "e").replaceAll("-", "−");
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

export function duration(seconds) {
  if (seconds === null || !Number.isFinite(seconds)) return "–";
  if (seconds < 100) return `${number(seconds, 3)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 100) return `${minutes} min`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

export const count = (value) => Number(value).toLocaleString("en").replaceAll(",", "\u202f");

export const moment = (iso) => {
  const date = new Date(iso);
  return Number.isNaN(date.getTime()) ? String(iso ?? "") : date.toLocaleString("sv");
};

// What people read in place of SI.
const scales = {
  "V/m": [1e-6, "kV/mm"], "V/m/s": [1e-6, "kV/mm/s"], C: [1e6, "µC"], m: [1e6, "µm"], Pa: [1e-6, "MPa"],
  "N/m": [1e-6, "N/µm"],
};

export const scaleOf = (unit) => scales[unit] ?? [1, unit ?? ""];

export function quantity(value, unit) {
  const [factor, name] = scaleOf(unit);
  return typeof value === "number" ? `${number(value * factor)} ${name}`.trim() : String(value);
}

// The number in an input: undefined if empty, the text if it is none, so that the daemon can say so. A decimal
// comma is taken as well.
export function readNumber(input, factor = 1) {
  const text = input.value.trim().replace(",", ".").replace("−", "-");
  if (text === "") return undefined;
  return Number.isNaN(Number(text)) ? input.value : Number((Number(text) * factor).toPrecision(15));
}

export const facts = (list, rows) =>
  list.replaceChildren(...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));
