// Elements and numbers. Whatever comes from the daemon goes into the page as text, never as markup.

export const byId = (id) => document.getElementById(id);

// element("a", {href: "/", class: "x", onclick: fn}, "text", otherElement)
export function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== undefined && value !== null) node.setAttribute(name, value);
  }
  node.append(...children.flat().filter((c) => c !== null && c !== undefined).map((c) => (c instanceof Node ? c : String(c))));
  return node;
}

export const button = (text, onclick, attributes = {}) => element("button", { type: "button", onclick, ...attributes }, text);

// Four significant digits, without an exponent where people would not write one.
export function number(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-3 || size >= 1e6) return value.toExponential(digits - 1).replace(/\.?0*e\+?/, "e").replaceAll("-", "−");
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

// So many that the ends of an interval are told apart.
export function digitsOf([low, high]) {
  const apart = Math.max(Math.abs(low), Math.abs(high)) / (high - low);
  return apart > 0 && Number.isFinite(apart) ? Math.min(Math.max(Math.ceil(Math.log10(apart)) + 2, 4), 15) : 4;
}

export function interval([low, high]) {
  const digits = digitsOf([low, high]);
  return `${number(low, digits)} to ${number(high, digits)}`;
}

// One value, or what it lies between; null: none is known.
export function between(range) {
  if (!range) return number(NaN);
  const [low, high] = range.map((v) => number(v));
  return low === high ? low : `${low} … ${high}`;
}

// "41.59(4)": with the standard uncertainty in units of the last digit, two digits of it where the first is 1 or 2.
export function withUncertainty(value, uncertainty) {
  if (!Number.isFinite(value) || !(uncertainty > 0)) return number(value);
  let place = Math.floor(Math.log10(uncertainty));
  if (uncertainty < 2.95 * 10 ** place) place -= 1;
  const size = Math.max(Math.abs(value), uncertainty);
  const power = size >= 1e5 || size < 1e-3 ? Math.floor(Math.log10(size)) : 0;
  const unit = 10 ** place;
  const round = (x) => Math.round(x / unit) * unit;
  const text = power === 0 && place >= 0 // 1230(50), not 123(5) tens
    ? `${round(value)}(${round(uncertainty)})`
    : `${(value / 10 ** power).toFixed(power - place)}(${Math.round(uncertainty / unit)})${power === 0 ? "" : `e${power}`}`;
  return text.replaceAll("-", "−");
}

export function duration(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  if (seconds < 100) return `${number(seconds, 3)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 100) return `${minutes} min`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

export function bytes(count) {
  const step = count < 1e3 ? [1, "B"] : count < 1e6 ? [1e3, "kB"] : count < 1e9 ? [1e6, "MB"] : [1e9, "GB"];
  return `${number(count / step[0], 3)} ${step[1]}`;
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

// Of a recording's load, or of its row in the list.
export const loadText = ({ prestress_Pa: prestress, spring_stiffness_N_per_m: spring }) =>
  (typeof prestress === "number" ? `prestress ${quantity(prestress, "Pa")}, spring ${quantity(spring, "N/m")}` : "");

// The number in an input: undefined if empty, the text if it is none, so that the daemon can say so. A decimal
// comma is taken as well.
export function readNumber(input, factor = 1) {
  const text = input.value.trim().replace(",", ".").replace("−", "-");
  if (text === "") return undefined;
  return Number.isNaN(Number(text)) ? input.value : Number((Number(text) * factor).toPrecision(15));
}

export const facts = (list, rows) =>
  list.replaceChildren(...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));

// The channels of a recording as they are drawn: [{key, title, name, unit, factor}]. Charge counts by electrode area where the
// specimen is known.
export function shownChannels(specimen) {
  const area = specimen?.area_m2 * (specimen?.layer_count ?? 1);
  return [
    { key: "field", title: "Field", name: "field", unit: "kV/mm", factor: 1e-6 },
    area > 0
      ? { key: "charge", title: "Polarization", name: "polarization", unit: "C/m²", factor: 1 / area }
      : { key: "charge", title: "Charge", name: "charge", unit: "µC", factor: 1e6 },
    { key: "displacement", title: "Displacement", name: "displacement", unit: "µm", factor: 1e6 },
    { key: "force", title: "Force", name: "force", unit: "N", factor: 1 },
  ];
}

export const timeAxis = { name: "time", unit: "s", factor: 1 };
