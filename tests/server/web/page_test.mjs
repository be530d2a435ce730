// The page in a real browser against a real daemon, view by view. Pictures of every view and report go to the folder of
// FERROBENCH_SCREENSHOTS. FERROBENCH_WEB=FOLDER takes the page's files from there in place of those built into the program.
//
//   node page_test.mjs PROGRAM [STEP...]      starts `PROGRAM serve` in a folder of its own; all steps, or those named
//
// Ends with 77 (skipped) where there is no chromium.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { chromium } from "playwright-core";
import * as bench from "./bench_steps.mjs";
import { patience, shots } from "./browser.mjs";
import { Daemon } from "./daemon.mjs";
import * as experiment from "./experiment_steps.mjs";
import * as models from "./model_steps.mjs";
import * as queue from "./queue_steps.mjs";
import * as recordings from "./recording_steps.mjs";

const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const steps = [
  experiment.writesAnExperiment, experiment.saysWhatIsWrong, experiment.runsToTheEnd, experiment.refusesAProgram,
  recordings.opensTheRecording, recordings.importsAndOverlays, recordings.replays, recordings.drawsASweep, recordings.readsTheRows, recordings.readsCreep, recordings.averagesARepeat,
  models.simulatesAModel, models.fitsAModel, models.findsWhatIsMissing, models.findsTheNextExperiment,
  recordings.followsAddresses, recordings.givesReports, queue.queuesRuns,
  experiment.abortsARun, bench.drawsAtTheFullRate, bench.watchesWithAnother, bench.seesSilence, bench.survivesADeadDaemon,
];

async function test(daemon) {
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"],
  });
  try {
    const page = await (await browser.newContext({ viewport: { width: 1280, height: 900 } })).newPage();
    page.setDefaultTimeout(patience);
    const complaints = [];
    let dead = false; // while its daemon is killed, the browser itself complains of it
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && !dead && complaints.push(message.text()));
    page.on("pageerror", (error) => complaints.push(error.stack));
    page.on("request", (request) => new URL(request.url()).origin === daemon.address || /^(blob|data):/.test(request.url()) || complaints.push(`fetched ${request.url()}`));
    if (process.env.FERROBENCH_WEB)
      await page.context().route(/\/([a-z]+\.(js|css|html))?(\?.*)?$/, async (route) => {
        const path = join(process.env.FERROBENCH_WEB, new URL(route.request().url()).pathname.replace(/\/$/, "/index.html"));
        if (route.request().method() !== "GET" || route.request().url().includes("token=") || !existsSync(path)) return route.fallback();
        return route.fulfill({ response: await route.fetch(), status: 200, path }); // not 304, which has nothing to show
      });
    await page.goto(`${daemon.address}/?token=${daemon.token}`);
    assert.ok(!page.url().includes(daemon.token), "the token has left the address");
    await page.waitForSelector('#connection[data-open="true"]');
    const known = { page, browser, daemon, reports: {} };
    for (const step of steps.filter(({ name }) => !wanted.length || wanted.includes(name))) {
      dead = step === bench.survivesADeadDaemon;
      const since = Date.now();
      await step(known).catch(async (error) => {
        if (shots) await page.screenshot({ path: `${shots}/failed.png`, fullPage: true }).catch(() => {});
        const shown = await page.locator("#errors, #state").allInnerTexts().catch(() => []);
        throw new Error(`${step.name}: ${error.message}\nthe page says: ${complaints.join("\n")}\nit shows: ${shown.join("\n")}`, { cause: error });
      });
      console.log(`ok ${step.name} (${((Date.now() - since) / 1000).toFixed(1)} s)`);
    }
    assert.deepEqual(complaints, [], "nothing on the console, nothing from elsewhere");
  } finally {
    await browser.close();
  }
}

if (!existsSync(executablePath)) {
  console.log(`skipped: there is no ${executablePath}`);
  process.exit(77);
}
const [program, ...wanted] = process.argv.slice(2);
assert.ok(program, "usage: page_test.mjs PROGRAM [STEP...]");
const daemon = new Daemon(program);
await daemon.start();
try {
  await test(daemon);
} finally {
  await daemon.stop();
}
