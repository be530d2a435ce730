// The limits in force. Their names, units and meanings are those of the daemon's own description.
import { byId, element, quantity } from "./dom.js";

export async function showLimits(rpc) {
  const [limits, document] = await Promise.all([rpc.call("limits.get"), rpc.call("rpc.discover")]);
  const schema = document.methods.find((m) => m.name === "limits.get")?.result.schema.properties ?? {};
  byId("limits").replaceChildren(...Object.entries(limits).map(([name, value]) =>
    element("tr", {}, element("th", { scope: "row" }, name.replaceAll("_", " "),
      element("p", { class: "note" }, schema[name]?.description)),
      element("td", { class: "number" }, quantity(value, schema[name]?.["x-unit"])))));
}
