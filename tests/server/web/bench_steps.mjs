// The view Bench: two pages and one lease, a late viewer, a daemon that falls silent, one that is killed.
import assert from "node:assert/strict";
import { call, open, openRecording, shots, state } from "./browser.mjs";

const signIn = async (page, { address, token }) => {
  await page.goto(`${address}/?token=${token}`);
  await page.waitForSelector('#connection[data-open="true"]');
};

async function holdsLong(page) {
  await open(page, "experiment");
  await page.locator('#library [data-name="my-own"]').click(); // another step may have loaded another program
  await page.waitForSelector('#library [data-name="my-own"][aria-pressed="true"]');
  await page.uncheck("#fast");
  const hold = page.locator('[data-path="/protocol/segments/1/time"]');
  // A program that is still being loaded takes the place of what is written meanwhile.
  for (let tries = 0; !(await page.innerText("#preview-facts")).includes("3 min"); ++tries) {
    assert.ok(tries < 60, "the hold of 200 s is not taken");
    await hold.fill("200");
    await hold.press("Enter");
    await page.waitForFunction(() => document.querySelector("#preview-facts").textContent.includes("3 min"), null, { timeout: 3000 }).catch(() => {});
  }
  await page.click("#start");
  await state(page, "running");
}

// Who comes late sees what was measured before, who watches sees who controls, and both may stop.
export async function watchesWithAnother({ page, browser, daemon }) {
  await open(page, "bench");
  await page.click("#lease-take");
  await page.waitForSelector("#lease-release:visible");
  await holdsLong(page);
  await page.waitForTimeout(2500);
  const other = await (await browser.newContext({ viewport: { width: 1280, height: 900 } })).newPage();
  const complaints = [];
  other.on("pageerror", (error) => complaints.push(error.stack));
  await signIn(other, daemon);
  await state(other, "running");
  await other.waitForFunction(() => Number(document.querySelector("#live").dataset.points) > 5);
  const first = await other.locator("#live-series figure:visible .frame").first().getAttribute("aria-label");
  assert.match(first, /to (1|1\.00\d*|0\.99\d*) kV\/mm/, `the late one sees the beginning, at 1 kV/mm: ${first}`);
  await other.waitForFunction(() => /controls the bench/.test(document.querySelector("#lease-text").textContent));
  assert.equal(await other.locator("#lease-take").isVisible(), false);
  await open(other, "experiment");
  assert.equal(await other.locator("#start").isDisabled(), true);
  await page.click("#pause");
  await state(page, "pausing", "paused");
  await other.click("#stop");
  await state(page, "aborted");
  assert.match(await page.innerText("#state-reason"), /stopped/i);
  assert.deepEqual(complaints, []);
  await other.context().close();
  await open(page, "bench");
  await page.click("#lease-release");
  await page.waitForSelector("#lease-take:visible");
}

// What is drawn of 500 kS/s (five channels at 100 kHz): how often, how late, and what that costs the page and the daemon.
// Figures to read: a machine with other tests beside it draws what it can. The costs are times of the processor, which other
// programs do not change much.
export async function drawsAtTheFullRate({ page, daemon }) {
  const program = { format: "ferrobench-protocol", version: 1, name: "full-rate", title: "Full rate", unit: "kV/mm", sample_rate_Hz: 1e5, start: 0,
    segments: [{ kind: "sine", amplitude: 0.5, frequency: 2, cycles: 12 }] };
  await open(page, "bench");
  const seen = page.evaluate(() => new Promise((resolve) => {
    const frames = [];
    let begun = false;
    const state = document.querySelector("#state"), live = document.querySelector("#live");
    const watch = new MutationObserver(() => {
      begun ||= state.dataset.state === "running";
      if (begun && ["complete", "aborted"].includes(state.dataset.state)) {
        watch.disconnect();
        resolve(frames);
      }
    });
    watch.observe(state, { attributes: true });
    let newest = "";
    new MutationObserver(() => {
      if (state.dataset.state !== "running" || live.dataset.newest === newest) return;
      newest = live.dataset.newest;
      const { measured } = live.dataset;
      // By the next one the browser has handed this one on to the screen. Page and daemon have one clock here.
      requestAnimationFrame(() => frames.push({ at: performance.now(), age: Date.now() - Date.parse(measured) }));
    }).observe(live, { attributes: true, attributeFilter: ["data-newest"] });
  }));
  const inspector = await page.context().newCDPSession(page);
  await inspector.send("Performance.enable", { timeDomain: "threadTicks" });
  const spent = async () => Object.fromEntries((await inspector.send("Performance.getMetrics")).metrics.map(({ name, value }) => [name, value]));
  const { run } = await call(page, "run.start", { protocol: program, set: { "device.domains": 16 } });
  await state(page, "running");
  const before = daemon.processorTime(), since = Date.now(), pageBefore = await spent();
  await page.waitForTimeout(4000);
  const seconds = (Date.now() - since) / 1000, pageAfter = await spent();
  const share = (daemon.processorTime() - before) / seconds;
  const frames = await seen;
  const { state: end, reason } = await call(page, "run.status", { run });
  assert.equal(end, "complete", reason);
  assert.ok(frames.length > 1, `${frames.length} pictures of 6 s`);
  const ages = frames.map((f) => f.age).sort((x, y) => x - y);
  const rate = (1000 * (frames.length - 1)) / (frames.at(-1).at - frames[0].at);
  const cost = (name) => ((1000 * (pageAfter[name] - pageBefore[name])) / (rate * seconds)).toFixed(1);
  console.log(`at 500 kS/s ${rate.toFixed(1)} pictures/s; the newest sample is on the screen after ${ages[ages.length >> 1]} ms, ` +
    `95 % within ${ages[Math.floor(0.95 * ages.length)]} ms; the page takes ${cost("TaskDuration")} ms of its main thread a picture ` +
    `(${cost("ScriptDuration")} ms script), the daemon ${(100 * share).toFixed(1)} % of a core`);
}

// A daemon that does not answer is seen within 2 s, and nothing is claimed that the page cannot know.
export async function seesSilence({ page, daemon }) {
  // How long the page itself had no time to look is the machine's business.
  await page.evaluate(() => {
    window.late = 0;
    let before = performance.now();
    setInterval(() => {
      const now = performance.now();
      window.late = Math.max(window.late, now - before - 50);
      before = now;
    }, 50);
  });
  daemon.signal("SIGSTOP");
  const since = Date.now();
  try {
    await state(page, "unknown");
    const took = Date.now() - since;
    const late = await page.evaluate(() => window.late);
    console.log(`silence was seen after ${took} ms; the page was late by ${Math.round(late)} ms`);
    assert.ok(took - late < 2000, `silence was seen after ${took} ms`);
    assert.equal(await page.innerText("#state-word"), "No answer");
    const [said, truth] = await page.evaluate(() => [document.querySelector("#state-reason").textContent, document.querySelector("#live").dataset.measured]);
    const age = (Date.now() - Date.parse(truth)) / 1000;
    const [, ago] = said.match(/No answer for [\d.]+ s, last sample ([\d.]+) s ago/) ?? [];
    assert.ok(Math.abs(age - ago) < 1 + late / 1000 + 0.005 * age, `${said} It was measured ${age} s ago.`);
    assert.doesNotMatch(await page.innerText(".bar"), /idle|complete|version/i);
    assert.equal(await page.innerText("#output"), "unknown");
    assert.match(await page.textContent("#lease-text"), /Not known/);
    await page.click("#stop");
    await page.waitForFunction(() => document.querySelector("#errors").textContent.includes("not answered yet"));
    if (shots) await page.screenshot({ path: `${shots}/silent.png` });
  } finally {
    daemon.signal("SIGCONT");
  }
  await state(page, "idle", "complete", "aborted");
}

// Killed with a run under way: the page claims nothing, and says what to do; the next daemon tells how the run ended.
export async function survivesADeadDaemon({ page, daemon }) {
  await open(page, "bench");
  await holdsLong(page);
  await page.waitForFunction(() => Number(document.querySelector("#live").dataset.points) > 5);
  const name = await page.locator("#run-facts a").innerText();
  await daemon.kill();
  await state(page, "unknown");
  await page.waitForFunction(() => /No connection for .*a run goes on without this page/.test(document.querySelector("#state-reason").textContent));
  assert.match(await page.innerText("#connection"), /Not connected/);
  assert.equal(await page.innerText("#output"), "unknown");
  assert.doesNotMatch(await page.innerText(".bar"), /idle|complete|running|pause/i);
  assert.match(await page.textContent("#lease-text"), /Not known/);
  await page.waitForFunction(() => /open the address that it printed/.test(document.querySelector("#state-reason").textContent));
  if (shots) await page.screenshot({ path: `${shots}/killed.png` });
  await daemon.start();
  await signIn(page, daemon);
  // The bench process holds the voltage: it stops safely when its daemon is gone, and the next one makes the file.
  await state(page, "aborted", "idle");
  assert.equal(await page.innerText("#output"), "0 kV/mm");
  const { status, reason } = await call(page, "recording.info", { name });
  assert.notEqual(status, "complete", "it did not come to its end");
  console.log(`the run of the killed daemon: ${status}, ${reason}`);
  await openRecording(page, name);
  assert.ok((await page.innerText("#recording")).includes(reason), "the page says why");
}
