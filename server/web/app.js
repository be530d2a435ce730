// Puts the parts of the page together: the connection, what the daemon tells, what people ask for.
import { byId } from "./dom.js";
import { showError } from "./errors.js";
import { addEvent } from "./events.js";
import { Experiment } from "./experiment.js";
import { showLimits } from "./limits.js";
import { Live } from "./live.js";
import { loadPlots } from "./plots.js";
import { Recordings } from "./recordings.js";
import { Rpc } from "./rpc.js";
import { RunPanel } from "./run.js";

const hasPlots = await loadPlots();
const rpc = new Rpc(connectionChanged);
const live = new Live();
const recordings = new Recordings(rpc);
const run = new RunPanel(rpc, runChanged);
const experiment = new Experiment(rpc, (status) => run.begin(status));

function runChanged(status, before) {
  const busy = run.busy();
  experiment.allowStart(!busy);
  if (busy || (status.run && status.run === live.run)) live.describe(status, busy);
  if (!busy && before && (before.busy || before.run !== status.run)) recordings.refresh();
}

async function greet() {
  const info = await rpc.call("system.info");
  byId("connection").textContent = `Connected, version ${info.version}`;
  for (const topic of ["run", "events", "job"]) await rpc.call("subscribe", { topic });
  await rpc.call("subscribe", { topic: "samples", max_rate_Hz: 20 });
  run.show(await rpc.call("run.status"));
  await Promise.all([experiment.load(), recordings.refresh(), showLimits(rpc)]);
}

function connectionChanged(open, retry) {
  const line = byId("connection");
  line.dataset.open = open;
  if (!open) {
    line.textContent = `Not connected; trying again in ${retry} s`;
    run.lost();
    experiment.allowStart(false);
    return;
  }
  greet().catch((error) => showError("The page could not read everything.", error));
}

rpc.on("run", (status) => run.show(status));
rpc.on("samples", (samples) => {
  live.add(samples);
  if (run.busy()) run.showOutput(samples.columns.command?.max.at(-1));
});
rpc.on("events", (event) => {
  addEvent(event);
  if (event.kind === "limits") showLimits(rpc).catch(() => {});
});
rpc.on("gap", ({ topic, lost }) => addEvent({ kind: "gap", message: `${lost} messages of "${topic}" were lost on the way to this page` }));

if (!hasPlots) byId("live-note").textContent = "This build has no plots: run npm ci in server/web and build again.";
byId("stop").addEventListener("click", () => run.stop());
rpc.connect();
