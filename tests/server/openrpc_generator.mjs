// Does the generator of the OpenRPC project make a client of what rpc.discover returns?   node openrpc_generator.mjs URL TOKEN
// The client is TypeScript, which nothing here compiles: looked at are its methods and the types of their parameters and results.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const [url, token] = process.argv.slice(2);
const reply = await fetch(url, {
  method: "POST",
  headers: { "Content-Type": "application/json-rpc", Authorization: `Bearer ${token}` },
  body: JSON.stringify({ jsonrpc: "2.0", method: "rpc.discover", id: 1 }),
});
const document = (await reply.json()).result;

const folder = mkdtempSync(join(tmpdir(), "ferrobench-"));
let source;
try {
  writeFileSync(join(folder, "openrpc.json"), JSON.stringify(document));
  const program = join(dirname(fileURLToPath(import.meta.url)), "node_modules/.bin/open-rpc-generator");
  execFileSync(program, ["generate", "-t", "client", "-l", "typescript", "-n", "bench", "-d", join(folder, "openrpc.json"), "-o", folder]);
  source = readFileSync(join(folder, "client/typescript/src/index.ts"), "utf8");
} finally {
  rmSync(folder, { recursive: true });
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
console.log(`a client of ${document.methods.length} methods and ${types.size} types`);
