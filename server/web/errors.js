// Failures, as the daemon explains them: what was wrong, where, what was given, what is allowed, what to do. They stand in the
// bar that is always visible, and beside the field that they are about.
import { byId, element } from "./dom.js";

const shown = (value) => (typeof value === "string" ? value : JSON.stringify(value));

function allowedText({ allowed, unit }) {
  const list = Array.isArray(allowed) ? allowed.map(shown)
    : allowed && typeof allowed === "object" ? Object.entries(allowed).map(([name, value]) => `${name} ${shown(value)}`) : [shown(allowed)];
  return list.join(", ") + (unit ? ` ${unit}` : "");
}

// A list too long to read at once is folded.
function allowedNode(problem) {
  const text = allowedText(problem);
  return text.length < 300 ? text : element("details", {}, element("summary", {}, `${problem.allowed.length ?? "many"} values`), text);
}

const told = (value) => value !== undefined && value !== null;

function problemItem(problem) {
  const item = element("li");
  if (problem.label) item.append(`${problem.label} `);
  else if (problem.path) item.append(element("code", {}, problem.path), " ");
  item.append(problem.message ?? "");
  const rows = [];
  if (told(problem.given)) rows.push(["given", shown(problem.given) + (problem.unit && typeof problem.given !== "string" ? ` ${problem.unit}` : "")]);
  if (told(problem.allowed)) rows.push(["allowed", allowedNode(problem)]);
  if (problem.hint) rows.push(["hint", problem.hint]);
  if (rows.length)
    item.append(element("dl", { class: "facts" },
      ...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)])));
  return item;
}

function besideField(problem, path = "") {
  const parts = [path && `${path} ${problem.message ?? ""}`.trim(), !path && problem.message, told(problem.allowed) && `allowed: ${allowedText(problem).slice(0, 120)}`, problem.hint];
  return parts.filter(Boolean).join("; ");
}

const inputs = () => [...document.querySelectorAll("[data-path], [data-set]")];
const pathOf = (input) => input.dataset.path ?? `/set/${input.dataset.set}`;
const isAbout = (problem, input) => [problem.path, `/protocol${problem.path}`].includes(pathOf(input));

// What an input takes in another unit than the daemon is told in the input's, under the words of its label.
function asTyped(problem) {
  const input = inputs().find((each) => each.dataset.unit && isAbout(problem, each));
  if (!input) return problem;
  const scale = Number(input.dataset.scale ?? 1);
  const typed = (value) => typeof value === "number" ? Number((value / scale).toPrecision(12))
    : value && typeof value === "object" && !Array.isArray(value) ? Object.fromEntries(Object.entries(value).map(([name, each]) => [name, typed(each)])) : value;
  return { ...problem, label: input.closest("label").firstChild.textContent.trim(), given: typed(problem.given), allowed: typed(problem.allowed), unit: input.dataset.unit };
}

let notes = 0;

// The inputs that the problems point to are marked, and the reason stands below them. Problems of a protocol have paths
// within it; those that no field stands for are told below its text.
function mark(problems, label) {
  for (const note of document.querySelectorAll(".field-error")) note.remove();
  const all = inputs();
  const left = new Set(problems);
  const note = (input, text) => {
    const id = `field-error-${++notes}`;
    input.setAttribute("aria-invalid", "true");
    input.setAttribute("aria-describedby", id);
    input.after(element("span", { class: "field-error", id }, text));
  };
  for (const input of all) {
    input.removeAttribute("aria-invalid");
    input.removeAttribute("aria-describedby");
    const problem = problems.find((p) => isAbout(p, input));
    if (!problem) continue;
    left.delete(problem);
    note(input, besideField(problem));
  }
  const text = all.find((input) => pathOf(input) === "/protocol");
  const [first] = left;
  if (text && first && label === "bad_protocol") note(text, besideField(first, first.path));
}

// `what`: the sentence that says what did not happen.
export function showError(what, error) {
  if (!error.problems) console.warn(error);
  const problems = (error.problems ?? []).map(asTyped);
  mark(problems, error.label);
  byId("errors").replaceChildren(
    element("div", { class: "error" },
      element("p", {}, element("strong", {}, what), " ", error.message, error.label ? ` (${error.label})` : ""),
      element("ul", {}, ...problems.map(problemItem)),
      element("button", { type: "button", onclick: clearErrors }, "Dismiss")));
}

export function clearErrors() {
  byId("errors").replaceChildren();
  mark([]);
}
