// Does the generator of the OpenRPC project make a client of what rpc.discover returns, and does TypeScript take it?
//
//     node openrpc_generator.mjs URL TOKEN [FOLDER]      the client goes into FOLDER, to be kept
//
// The generator (1.22) wants two things done for it. It gives a list of types one name where it writes it down and another where it
// uses it, so each becomes "oneOf". And it writes names with a dot or a dash as they are, which TypeScript wants in quotes.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const [url, token, kept] = process.argv.slice(2);
const modules = join(dirname(fileURLToPath(import.meta.url)), "node_modules");
const reply = await fetch(url, {
  method: "POST",
  headers: { "Content-Type": "application/json-rpc", Authorization: `Bearer ${token}` },
  body: JSON.stringify({ jsonrpc: "2.0", method: "rpc.discover", id: 1 }),
});
const document = (await reply.json()).result;

const about = ["description", "title", "default", "x-unit"];
const range = ["minimum", "maximum", "exclusiveMinimum"];
const own = { number: range, integer: range, string: ["enum"], array: ["items"], object: ["properties", "required", "additionalProperties"] };
function withoutLists(schema) {
  if (Array.isArray(schema)) return schema.map(withoutLists);
  if (schema === null || typeof schema !== "object") return schema;
  const out = Object.fromEntries(Object.entries(schema).map(([key, value]) => [key, withoutLists(value)]));
  if (!Array.isArray(out.type)) return out;
  const some = (keys) => Object.fromEntries(keys.filter((key) => key in out).map((key) => [key, out[key]]));
  return { ...some(about), oneOf: out.type.map((type) => ({ type, ...some(own[type] ?? []) })) };
}
for (const method of document.methods)
  for (const content of [...method.params, method.result]) content.schema = withoutLists(content.schema);

const folder = kept ?? mkdtempSync(join(tmpdir(), "ferrobench-"));
let source;
try {
  writeFileSync(join(folder, "openrpc.json"), JSON.stringify(document));
  const generator = join(modules, ".bin/open-rpc-generator");
  execFileSync(generator, ["generate", "-t", "client", "-l", "typescript", "-n", "bench", "-d", join(folder, "openrpc.json"), "-o", folder]);
  const client = join(folder, "client/typescript/src/index.ts");
  source = readFileSync(client, "utf8").replace(/^ {2}public (\w+(?:\.\w+)+): /gm, '  public "$1": ').replace(/^ {2}(\w+(?:-\w+)+)(\??): /gm, '  "$1"$2: ');
  writeFileSync(client, source);
  const options = { target: "es2020", module: "node16", strict: true, esModuleInterop: true, skipLibCheck: true, noEmit: true, types: [] };
  writeFileSync(join(folder, "tsconfig.json"), JSON.stringify({ compilerOptions: options, files: [client] }));
  symlinkSync(modules, join(folder, "node_modules"));
  execFileSync(process.execPath, [join(modules, "typescript/bin/tsc"), "--project", folder], { encoding: "utf8" });
} catch (failure) {
  throw new Error(`${failure.message}\n${failure.stdout ?? ""}`.slice(0, 4000));
} finally {
  rmSync(kept ? join(folder, "node_modules") : folder, { recursive: true, force: true });
}

const types = new Map([...source.matchAll(/^export (?:type|interface) (\w+)(?: = (.*);| \{)$/gm)].map((m) => [m[1], m[2] ?? "{"]));
const wrong = [];
for (const method of document.methods) {
  const named = method.name.split(/[._]/).map((part) => part[0].toUpperCase() + part.slice(1)).join("");
  if (!source.includes(`return this.request("${method.name}", params);`)) wrong.push(`${method.name} is missing`);
  const signature = types.get(named);
  const [, params, result] = signature?.match(/^\((.*)\) => Promise<(\w+)>$/) ?? [];
  if (result === undefined) {
    wrong.push(`${method.name} has no type: ${signature}`);
    continue;
  }
  if (params.split(",").filter(Boolean).length !== method.params.length) wrong.push(`${method.name} takes ${params}`);
  for (const type of [result, ...params.matchAll(/: (\w+)/g)].map((t) => (Array.isArray(t) ? t[1] : t)))
    if (type === "any" || types.get(type) === "any") wrong.push(`${method.name}: ${type} may be anything`);
}
if (wrong.length) throw new Error(wrong.join("\n"));
console.log(`a client of ${document.methods.length} methods and ${types.size} types, which compiles`);
