// Failures, as the daemon explains them: what was wrong, where, what was given, what is allowed, what to do.
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

function problemItem(problem) {
  const item = element("li");
  if (problem.path) item.append(element("code", {}, problem.path), " ");
  item.append(problem.message ?? "");
  const rows = [];
  if (problem.given !== undefined && problem.given !== null)
    rows.push(["given", shown(problem.given) + (problem.unit ? ` ${problem.unit}` : "")]);
  if (problem.allowed !== undefined && problem.allowed !== null) rows.push(["allowed", allowedNode(problem)]);
  if (problem.hint) rows.push(["hint", problem.hint]);
  if (rows.length)
    item.append(element("dl", { class: "facts" },
      ...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)])));
  return item;
}

// The inputs that the problems point to are marked.
function mark(problems, label) {
  for (const input of document.querySelectorAll("[data-path], [data-set]")) {
    const path = input.dataset.path ?? `/set/${input.dataset.set}`;
    const wrong = problems.some((p) => p.path === path) || (label === "bad_protocol" && path === "/protocol");
    if (wrong) input.setAttribute("aria-invalid", "true");
    else input.removeAttribute("aria-invalid");
  }
}

// `what`: the sentence that says what did not happen.
export function showError(what, error) {
  if (!error.problems) console.warn(error);
  const problems = error.problems ?? [];
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
