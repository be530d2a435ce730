// Is what rpc.discover returns an OpenRPC document?   node openrpc_validate.mjs URL TOKEN   (or: FILE)
import { readFileSync } from "node:fs";
import Ajv from "ajv";
import openrpc from "@open-rpc/meta-schema";
import jsonSchema from "@json-schema-tools/meta-schema";

const [where, token] = process.argv.slice(2);

async function discover() {
  if (!where.startsWith("http")) return JSON.parse(readFileSync(where, "utf8"));
  const reply = await fetch(where, {
    method: "POST",
    headers: { "Content-Type": "application/json", Authorization: `Bearer ${token}` },
    body: JSON.stringify({ jsonrpc: "2.0", method: "rpc.discover", id: 1 }),
  });
  return (await reply.json()).result;
}

// The two meta-schemas name each other by address, with and without a slash at the end; here they are given by hand
// under one address, and nothing is fetched. Both are draft 7, whatever dialect they say they are written in.
function plain(module) {
  const schema = module.$id ? module : module.default;
  const text = JSON.stringify({ ...schema, $schema: undefined });
  return JSON.parse(text.replaceAll(/https:\/\/meta\.json-schema\.tools\/?(?=["#])/g, "https://meta.json-schema.tools/schema"));
}
const ajv = new Ajv({ strict: false, allErrors: true, validateFormats: false });
ajv.addSchema(plain(jsonSchema));
const validate = ajv.compile(plain(openrpc));

const document = await discover();
if (!validate(document)) {
  console.error(JSON.stringify(validate.errors.slice(0, 10), null, 1));
  process.exit(1);
}
const names = document.methods.map((m) => m.name);
if (new Set(names).size !== names.length) throw new Error("a method is listed twice");
for (const method of document.methods) {
  for (const part of [...method.params, method.result]) ajv.compile(part.schema);
  const order = method.params.map((p) => Boolean(p.required));
  if (order.lastIndexOf(true) > order.indexOf(false) && order.includes(false))
    throw new Error(`${method.name}: a required parameter follows an optional one`);
}
console.log(`OpenRPC ${document.openrpc}, ${names.length} methods: valid`);
