// Failures, as the daemon explains them: what was wrong, where, what was given, what is allowed, what to do.
import { byId, element } from "./dom.js";

const shown = (value) => (typeof value === "string" ? value : JSON.stringify(value));

function allowedText({ allowed, unit }) {
  if (Array.isArray(allowed)) return allowed.map(shown).join(", ");
  if (allowed && typeof allowed === "object")
    return Object.entries(allowed).map(([name, value]) => `${name} ${shown(value)}`).join(", ") + (unit ? ` ${unit}` : "");
  return shown(allowed) + (unit ? ` ${unit}` : "");
}

function problemItem(problem) {
  const item = element("li");
  if (problem.path) item.append(element("code", {}, problem.path), " ");
  item.append(problem.message ?? "");
  const rows = [];
  if (problem.given !== undefined && problem.given !== null)
    rows.push(["given", shown(problem.given) + (problem.unit ? ` ${problem.unit}` : "")]);
  if (problem.allowed !== undefined && problem.allowed !== null) rows.push(["allowed", allowedText(problem)]);
  if (problem.hint) rows.push(["hint", problem.hint]);
  if (rows.length)
    item.append(element("dl", { class: "facts" },
      ...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)])));
  return item;
}

// The inputs that the problems point to are marked; a problem inside the protocol marks the protocol.
function mark(problems) {
  for (const input of document.querySelectorAll("[data-path], [data-set]")) {
    const path = input.dataset.path ?? `/set/${input.dataset.set}`;
    const wrong = problems.some((p) => p.path === path || p.path?.startsWith(path + "/"));
    if (wrong) input.setAttribute("aria-invalid", "true");
    else input.removeAttribute("aria-invalid");
  }
}

// `what`: the sentence that says what did not happen.
export function showError(what, error) {
  if (!error.problems) console.warn(error);
  const problems = error.problems ?? [];
  mark(problems);
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
