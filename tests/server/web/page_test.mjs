// The page in a real browser against a real daemon: a run is started, watched to its end, its recording opened; a
// wrong parameter is explained; Stop stops.
//
//   node page_test.mjs PROGRAM      starts `PROGRAM serve` in a folder of its own
//   node page_test.mjs URL TOKEN    uses a daemon that runs already
//
// Ends with 77 (skipped) where there is no chromium.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { chromium } from "playwright-core";
import { startDaemon } from "./daemon.mjs";

const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const patience = 60_000;

// A name that would be markup if the page did not escape it.
const title = 'A short <img src="x" alt="program">';
const program = {
  format: "ferrobench-protocol", version: 1, name: "page-test", title, unit: "kV/mm", sample_rate_Hz: 200,
  parameters: { rate: 1 }, start: 1,
  segments: [{ kind: "ramp", to: -0.5, rate: "$rate" }, { kind: "hold", time: 20 }, { kind: "ramp", to: 1, rate: "$rate" }],
};

const state = (page, ...names) =>
  page.waitForSelector(names.map((name) => `#state[data-state="${name}"]`).join(", "), { timeout: patience });
const points = (page, plot) => page.locator(`${plot} .frame`).first().evaluate((frame) => Number(frame.dataset.points ?? 0));

// Whether anything but the background was drawn.
const drawn = (page, plot) =>
  page.locator(`${plot} canvas`).first().evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.some((value) => value !== 0);
  });

async function useOwnProgram(page) {
  await page.locator("#edit summary").click();
  await page.fill("#protocol-text", JSON.stringify(program));
  await page.click("#use-text");
  await page.waitForFunction((text) => document.querySelector("#preview-facts")?.textContent.includes(text), "23 s");
  assert.ok(await drawn(page, "#preview-plot"), "the preview is drawn");
}

async function saysWhatIsWrong(page) {
  const error = page.locator("#errors .error");
  await page.fill('[data-set="rate"]', "quick");
  await error.waitFor();
  assert.match(await error.innerText(), /\/set\/rate.*given\s+quick/s);
  assert.equal(await page.getAttribute('[data-set="rate"]', "aria-invalid"), "true");
  await page.fill('[data-set="rate"]', "1");
  await error.waitFor({ state: "detached" });
}

async function runsToTheEnd(page) {
  const before = await page.locator("#recording-list li").count();
  await page.check("#fast");
  await page.click("#start");
  await state(page, "complete");
  assert.equal(await page.innerText("#output"), "0 kV/mm");
  await page.waitForFunction((n) => document.querySelectorAll("#recording-list li").length === n + 1, before);
  assert.ok((await points(page, "#live-plots")) > 10, "the live plots have points");
  assert.ok(await drawn(page, "#live-plots"), "the live plots are drawn");
  const newest = page.locator("#recording-list li").first();
  assert.ok((await newest.innerText()).includes(title), "the title stands there as text");
  assert.match(await newest.innerText(), /complete/);
}

async function opensTheReport(page) {
  const newest = page.locator("#recording-list li").first();
  await newest.getByRole("button").click();
  await page.waitForSelector("#report:not([hidden]) table");
  assert.match(await page.innerText("#report"), /stroke/i);
  assert.ok((await points(page, "#report")) > 10, "the recording is plotted");
  const [file] = await Promise.all([page.waitForEvent("download"), newest.getByRole("link").click()]);
  const chunks = [];
  for await (const chunk of await file.createReadStream()) chunks.push(chunk);
  assert.equal(Buffer.concat(chunks).subarray(1, 4).toString(), "HDF", "the download is the HDF5 file");
}

async function stops(page) {
  await page.uncheck("#fast");
  await page.click("#start");
  await state(page, "running");
  await page.click("#pause");
  await state(page, "pausing", "paused");
  await page.click("#stop");
  await state(page, "aborted");
  assert.match(await page.innerText("#state-reason"), /stopped/i);
}

async function fitsNarrowScreens(page) {
  await page.setViewportSize({ width: 400, height: 800 });
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= 400), "nothing sticks out at 400 px");
  assert.ok(await page.locator("#stop").isVisible());
}

async function test(address, token) {
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"],
  });
  try {
    const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
    page.setDefaultTimeout(patience);
    const complaints = [];
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && complaints.push(message.text()));
    page.on("pageerror", (error) => complaints.push(error.stack));
    await page.goto(`${address}/?token=${token}`);
    assert.ok(!page.url().includes(token), "the token has left the address");
    await page.waitForSelector('#connection[data-open="true"]');
    for (const step of [useOwnProgram, saysWhatIsWrong, runsToTheEnd, opensTheReport, stops, fitsNarrowScreens]) {
      await step(page).catch((error) => {
        throw new Error(`${step.name}: ${error.message}\nthe page says: ${complaints.join("\n")}`, { cause: error });
      });
      console.log(`ok ${step.name}`);
    }
    assert.deepEqual(complaints, [], "nothing on the console");
  } finally {
    await browser.close();
  }
}

if (!existsSync(executablePath)) {
  console.log(`skipped: there is no ${executablePath}`);
  process.exit(77);
}
const [first, token] = process.argv.slice(2);
assert.ok(first, "usage: page_test.mjs PROGRAM | page_test.mjs URL TOKEN");
if (token) {
  await test(first.replace(/\/$/, ""), token);
} else {
  const daemon = await startDaemon(first);
  try {
    await test(daemon.address, daemon.token);
  } finally {
    await daemon.stop();
  }
}
