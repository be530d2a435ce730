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
  if (!before) return;
  const another = before.run !== status.run;
  if (another || before.state !== status.state)
    addEvent({ kind: status.state, message: [status.title || status.protocol, status.reason].filter(Boolean).join(": ") });
  if (busy && (another || !before.busy)) live.describe(status, "");
  if (!busy && (another || before.busy)) finished(status);
}

// What came by in passing was thinned; what was recorded shows the run as it was.
async function finished(status) {
  await recordings.refresh();
  live.describe(status, `The last run, ${status.state}: `);
  if (!status.recording) return;
  try {
    live.show(status.run, await rpc.call("recording.read", { name: status.recording, max_points: 3000 }));
  } catch (error) {
    showError("The recording could not be read.", error);
  }
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
