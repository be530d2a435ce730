// The whole job through npm's jayson, a JSON-RPC client that knows nothing of us.
//   node third_party_client.mjs http://127.0.0.1:PORT/rpc TOKEN [PROTOCOL]
import assert from "node:assert/strict";
import { setTimeout as sleep } from "node:timers/promises";
import jayson from "jayson/promise/index.js";

const [url, token, protocol = "stage-stroke-against-rate"] = process.argv.slice(2);
const { hostname, port, pathname } = new URL(url);
const client = jayson.Client.http({
  hostname, port, path: pathname,
  headers: { Authorization: `Bearer ${token}` },
});

async function call(method, params = {}) {
  const reply = await client.request(method, params);
  if (reply.error) throw new Error(`${method}: ${JSON.stringify(reply.error)}`);
  return reply.result;
}

const info = await call("system.info");
assert.equal(typeof info, "object");

const document = await call("rpc.discover");
assert.ok(document.methods.some((m) => m.name === "run.start"));

const listed = await call("protocol.list");
const protocols = (listed.protocols ?? listed).map((p) => p.name ?? p);
assert.ok(protocols.includes(protocol), `${protocol} is not among ${protocols}`);

const invalid = await call("protocol.validate", { protocol: { format: "ferrobench-protocol", version: 1, segments: 3 } });
assert.equal(invalid.valid, false);
assert.ok(invalid.problems.length > 0 && invalid.problems.every((p) => typeof p.path === "string"));

await call("run.start", { protocol, device: "virtual", fast: true });
let status;
for (let i = 0; i < 600; ++i) {
  status = await call("run.status");
  if (["complete", "aborted"].includes(status.state)) break;
  await sleep(100);
}
assert.equal(status.state, "complete", JSON.stringify(status));

const recorded = await call("recording.list");
const recordings = recorded.recordings ?? recorded;
assert.ok(recordings.length > 0);
const name = status.recording ?? recordings.at(-1).name;
const report = await call("recording.report", { name, format: "json" });
assert.ok(JSON.stringify(report).length > 100);

const batch = await client.request([
  client.request("system.info", {}, undefined, false),
  client.request("no.such.method", {}, undefined, false),
  client.request("run.status", {}, undefined, false),
  client.request("run.status", {}, null, false), // a notification: no reply
]);
assert.equal(batch.length, 3);
assert.equal(batch.filter((r) => r.result !== undefined).length, 2);
assert.equal(batch.find((r) => r.error).error.code, -32601);

console.log(`ran ${protocol}: ${name}`);
