// Puts the parts of the page together: the connection, the views, what the daemon tells, what people ask for.
import { DevicePanel, LeasePanel, showLimits } from "./bench.js";
import { loadPlots } from "./chart.js";
import { Contact } from "./contact.js";
import { byId } from "./dom.js";
import { showError } from "./errors.js";
import { addEvent } from "./events.js";
import { Experiment } from "./experiment.js";
import { Jobs } from "./jobs.js";
import { Live } from "./live.js";
import { ModelView } from "./model.js";
import { RecordingView, drawLoops } from "./recording.js";
import { QueueView } from "./queue.js";
import { Recordings } from "./recordings.js";
import { startRouter } from "./router.js";
import { Rpc } from "./rpc.js";
import { RunPanel } from "./run.js";
import { readerOf } from "./traces.js";

const hasPlots = await loadPlots();
const rpc = new Rpc(connectionChanged);
const live = new Live();
const jobs = new Jobs(rpc);
const run = new RunPanel(rpc, runChanged);
const lease = new LeasePanel(rpc, allowStart);
const device = new DevicePanel(rpc);
const experiment = new Experiment(rpc, (status) => run.begin(status));
const queue = new QueueView(rpc);
const recordings = new Recordings(rpc, (names) => (location.hash = `#recordings/${names.map(encodeURIComponent).join("+")}`), () => model.showRecordings());
const recording = new RecordingView(rpc, byId("recording"), {
  list: () => recordings.list,
  started: (status) => {
    location.hash = "#bench";
    run.begin(status);
  },
  removed: async () => {
    await recordings.refresh();
    location.hash = "#recordings";
  },
});
const model = new ModelView(rpc, jobs, {
  recordings: () => recordings.list,
  load: (protocol) => {
    location.hash = "#experiment";
    experiment.take(protocol).catch((error) => showError("The experiment could not be loaded.", error));
  },
});
const contact = new Contact(rpc, { "run.status": (status) => run.show(status), "lease.status": (held) => lease.show(held) }, silenceChanged);

let greeted = false;
let version = "";
let view = { name: "bench", part: "" };
let outputShown = 0; // ms

function allowStart() {
  const why = contact.silent ? "The daemon does not answer." : run.busy() ? "A run is under way." : lease.blocked ? `${lease.status.holder} controls the bench.` : "";
  experiment.allowStart(!why && greeted, why);
}

function silenceChanged(silent) {
  run.setSilent(silent);
  lease.setSilent(silent);
  if (rpc.open) showConnection();
  allowStart();
}

function runChanged(status, before) {
  const busy = run.busy();
  allowStart();
  if (busy && status.run !== live.run) follow(status);
  if (!before) return;
  const another = before.run !== status.run;
  if (another || before.state !== status.state)
    addEvent({ kind: status.state, message: [status.title || status.protocol, status.reason].filter(Boolean).join(": ") });
  if (!busy && (another || before.busy)) finished(status);
}

// What a run has measured before this page looked comes from its recording.
async function follow(status) {
  live.begin(status.run);
  live.describe(status, "");
  let columns = null;
  try {
    const name = status.recording;
    live.charts.about = name;
    const info = await rpc.call("recording.info", { name });
    live.charts.setSpecimen(info.specimen);
    columns = await rpc.call("recording.read", { name, max_points: 2000 });
  } catch {
    // nothing is recorded yet: all of it comes as it is measured
  }
  live.seed(status.run, columns);
}

// What came by in passing was thinned; what was recorded shows the run as it was.
async function finished(status) {
  await recordings.refresh();
  live.describe(status, `The last run, ${status.state}: `);
  if (!status.recording) return;
  try {
    const name = status.recording;
    const [info, columns] = await Promise.all([rpc.call("recording.info", { name }), rpc.call("recording.read", { name, max_points: 3000 })]);
    live.charts.about = name;
    live.charts.setSpecimen(info.specimen);
    live.show(status.run, columns, readerOf(rpc, name));
    await drawLoops(rpc, name, live.charts, columns, () => live.run === status.run);
    byId("live").dataset.recorded = name;
  } catch (error) {
    // What a wait of the queue has seen is not kept, and any recording may be deleted meanwhile.
    if (error.label !== "not_found") showError("The recording could not be read.", error);
  }
}

async function greet() {
  await lease.reconnected();
  version = (await contact.compare()).version;
  showConnection();
  for (const topic of ["run", "samples", "events", "job", "queue"]) await rpc.call("subscribe", { topic });
  run.show(await rpc.call("run.status"));
  const [limits, devices] = await Promise.all([showLimits(rpc), device.load(), recordings.refresh(), model.refresh(), queue.refresh()]);
  await experiment.load(limits, devices);
  await model.refresh();
  greeted = true;
  allowStart();
  show();
}

function showConnection() {
  byId("connection").dataset.open = !contact.silent;
  byId("connection").textContent = contact.silent ? "Connected, no answer" : `Connected, version ${version}`;
}

function connectionChanged(open, retry) {
  const line = byId("connection");
  line.dataset.open = open;
  if (open) line.textContent = "Connected …";
  if (!open) {
    line.textContent = `Not connected; trying again in ${retry} s`;
    greeted = false;
    allowStart();
    return;
  }
  greet().catch((error) => showError("The page could not read everything.", error));
}

function show() {
  if (!greeted) return;
  const { name, part } = view;
  if (name === "recordings") {
    const names = part ? part.split("+") : [];
    recordings.mark(names);
    if (names.length) recording.show(names);
    else recording.close();
  }
  if (name === "model") model.show(part);
}

rpc.on("run", (status) => run.show(status));
rpc.on("samples", (samples) => {
  contact.sampled(samples.measured);
  live.add(samples);
  const now = performance.now();
  if (!run.busy() || now - outputShown < 100) return; // nobody reads faster
  outputShown = now;
  run.showOutput(samples.columns.command?.first.at(-1));
});
rpc.on("events", (event) => {
  addEvent(event);
  if (event.kind === "limits") showLimits(rpc).then((limits) => (experiment.limits = limits)).catch(() => {});
  if (event.kind.startsWith("device")) device.load().catch(() => {});
});
rpc.on("gap", ({ topic, lost }) => addEvent({ kind: "gap", message: `${lost} messages of "${topic}" were lost on the way to this page` }));

if (!hasPlots) byId("live-note").textContent = "This build has no plots: run npm ci in server/web and build again.";
byId("stop").addEventListener("click", () => run.stop());
startRouter((name, part) => {
  view = { name, part };
  show();
});
rpc.connect();
