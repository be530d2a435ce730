// The page in a real browser against a real daemon, view by view. Screenshots go to the folder of FERROBENCH_SCREENSHOTS.
//
//   node page_test.mjs PROGRAM      starts `PROGRAM serve` in a folder of its own
//
// Ends with 77 (skipped) where there is no chromium.
import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { chromium } from "playwright-core";
import { startDaemon } from "./daemon.mjs";

const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const shots = process.env.FERROBENCH_SCREENSHOTS;
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const patience = 30_000;

// A name that would be markup if the page did not escape it.
const title = 'A short <img src="x" alt="program">';
const program = {
  format: "ferrobench-protocol", version: 1, name: "page-test", title, unit: "kV/mm", sample_rate_Hz: 200,
  parameters: { rate: 1 }, start: 1,
  segments: [{ kind: "ramp", to: -0.5, rate: "$rate" }, { kind: "hold", time: 20 }, { kind: "ramp", to: 1, rate: "$rate" }],
};
const table = "time_s;field_kV_per_mm;displacement_um\n" + Array.from({ length: 400 }, (_, i) => `${i * 0.01};${Math.sin(i / 30)};${5 * Math.sin(i / 30 - 0.2)}`).join("\n");

const state = (page, ...names) =>
  page.waitForSelector(names.map((name) => `#state[data-state="${name}"]`).join(", "), { timeout: patience });
const points = (page, plot) => page.locator(`${plot} figure:visible .frame`).evaluateAll((frames) => frames.map((f) => Number(f.dataset.points ?? 0)));
const open = async (page, address) => {
  await page.evaluate((hash) => (location.hash = hash), address);
  await page.waitForSelector(`nav a[href="#${address.split("/")[0]}"][aria-current]`);
};
const newest = (page) => page.locator("#recording-list li").first();
const call = (page, method, params = {}) => page.evaluate(async ([m, p]) => {
  const response = await fetch("/rpc", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ jsonrpc: "2.0", id: 1, method: m, params: p }) });
  return (await response.json()).result;
}, [method, params]);

// Whether anything but the background was drawn.
const drawn = (page, plot) =>
  page.locator(`${plot} figure:visible canvas`).first().evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.some((value) => value !== 0);
  });

// What axe-core finds wrong, at both widths and in both colour schemes; pictures of it are kept.
async function isAccessible(page, name) {
  for (const colorScheme of ["light", "dark"])
    for (const width of [1280, 390]) {
      await page.emulateMedia({ colorScheme });
      await page.setViewportSize({ width, height: 900 });
      await page.evaluate(() => scrollTo(0, 0));
      await page.waitForTimeout(150);
      const wide = await page.evaluate(() => document.documentElement.scrollWidth);
      const out = await page.evaluate((w) => [...document.querySelectorAll("body *")].filter((e) => e.getBoundingClientRect().right > w + 1 && e.offsetParent && !e.closest(".scroll, nav, pre")).slice(0, 4).map((e) => e.outerHTML.slice(0, 120)), width);
      assert.ok(wide <= width, `${name}: ${wide} px wide at ${width} px: ${out.join(" | ")}`);
      if (shots) await page.screenshot({ path: `${shots}/${name}-${width}-${colorScheme}.png`, fullPage: true });
      // The page's policy keeps scripts out; the debugger is not bound by it.
      await page.evaluate(axe);
      const { violations } = await page.evaluate(() => axe.run(document, { resultTypes: ["violations"] }));
      const serious = violations.filter((v) => ["serious", "critical"].includes(v.impact));
      assert.deepEqual(serious.map((v) => `${v.id}: ${v.nodes.slice(0, 3).map((n) => n.html.slice(0, 160)).join(" | ")}`), [], `${name}, ${width} px, ${colorScheme}`);
    }
  await page.emulateMedia({ colorScheme: "light" });
  await page.setViewportSize({ width: 1280, height: 900 });
}

// The table of segments and the drawing follow each other, a change can be undone, the program is kept under a name.
async function writesAnExperiment(page) {
  await open(page, "experiment");
  await page.waitForSelector("#library .protocol");
  assert.ok((await page.locator("#library .protocol").count()) >= 16);
  await page.locator("#edit summary").click();
  await page.fill("#protocol-text", JSON.stringify(program));
  await page.click("#use-text");
  const takes = (text) => page.waitForFunction((t) => document.querySelector("#preview-facts")?.textContent.includes(t), text);
  await takes("23 s");
  assert.ok(await drawn(page, "#preview-plot"), "the preview is drawn");
  assert.match(await page.innerText("#parameters"), /rate \[kV\/mm\/s\]/, "a parameter has the unit of its use");
  const hold = page.locator('[data-path="/protocol/segments/1/time"]');
  await hold.fill("10");
  await hold.press("Enter");
  await takes("13 s");
  await page.click("#undo");
  await takes("23 s");
  await page.locator('[data-segment="/segments/1"] .place').click();
  assert.equal(await page.getAttribute('[data-segment="/segments/1"]', "aria-current"), "true");
  await page.selectOption("#level-unit", "V");
  await page.waitForFunction(() => document.querySelector('[data-path="/protocol/segments/0/to"]')?.value === "-50");
  await page.click("#undo");
  await page.fill("#save-name", "my-own");
  await page.click("#save-protocol");
  await page.waitForSelector('#library [data-name="my-own"][aria-pressed="true"]');
  await page.fill("#protocol-search", "creep");
  assert.equal(await page.locator('#library [data-name="my-own"]').isVisible(), false);
  await page.fill("#protocol-search", "");
}

async function saysWhatIsWrong(page) {
  const error = page.locator("#errors .error");
  await page.fill('[data-set="rate"]', "quick");
  await error.waitFor();
  assert.match(await error.innerText(), /\/set\/rate.*given\s+quick/s);
  assert.equal(await page.getAttribute('[data-set="rate"]', "aria-invalid"), "true");
  assert.match(await page.locator("#parameters .field-error").innerText(), /number/);
  await page.fill('[data-set="rate"]', "1");
  await error.waitFor({ state: "detached" });
  const to = page.locator('[data-path="/protocol/segments/0/to"]');
  await to.fill("-5");
  await to.press("Enter");
  await error.waitFor();
  assert.match(await error.innerText(), /guard would refuse/);
  await page.click("#start");
  await page.waitForFunction(() => document.querySelector("#errors")?.textContent.includes("was not started"));
  await page.click("#undo");
  await error.waitFor({ state: "detached" });
  await isAccessible(page, "experiment");
}

async function runsToTheEnd(page) {
  const before = await page.locator("#recording-list li").count();
  await page.check("#fast");
  await page.click("#start");
  await page.waitForSelector('nav a[href="#bench"][aria-current]');
  await state(page, "complete");
  assert.equal(await page.innerText("#output"), "0 kV/mm");
  await page.waitForFunction((n) => document.querySelectorAll("#recording-list li").length === n + 1, before);
  await page.waitForSelector("#live[data-recorded]");
  assert.match(await page.innerText("#live-note"), /The last run, complete/);
  const counts = await points(page, "#live");
  assert.equal(counts.length, 7, "four channels and three loops");
  assert.ok(counts.every((n) => n > 10), "the plots have points");
  assert.ok(await drawn(page, "#live-series"), "the live plots are drawn");
  const [field] = await page.locator("#live-series .u-over").all();
  await field.click({ position: { x: 200, y: 40 } });
  await field.click({ position: { x: 400, y: 40 }, modifiers: ["Shift"] });
  assert.match(await page.innerText("#live-readings"), /polarization \[C\/m²\]/, "charge counts by area");
  const times = await page.locator("#live-readings tbody tr").first().locator("td").allInnerTexts();
  assert.ok(times.every((t) => Number(t) > 0), `A, B and their difference: ${times}`);
  assert.equal(await page.locator("#live-readings tbody tr").count(), 5);
  await isAccessible(page, "bench");
}

async function opensTheRecording(page) {
  await open(page, "recordings");
  assert.ok((await newest(page).innerText()).includes(title), "the title stands there as text");
  assert.match(await newest(page).innerText(), /complete/);
  await newest(page).locator(".about a").click();
  await page.waitForSelector("#recording:not([aria-busy]) .report-table");
  assert.match(page.url(), /#recordings\/my-own|#recordings\/page-test/);
  const tables = await page.locator("#recording .report-table h3").allInnerTexts();
  assert.equal(tables[0], "Stroke per cycle and overall", "tables come in the report's order");
  assert.match(await page.innerText("#recording"), /stroke \[µm\]/);
  const curve = await page.locator("#recording .loop .frame").evaluateAll((frames) => frames.map((f) => Number(f.dataset.points)));
  assert.ok(curve.every((n) => n > 30 && n < 20000), `loops are curves: ${curve}`);
  await page.fill('[aria-label="Note to add"]', "seen <b>by</b> the page");
  await page.getByRole("button", { name: "Annotate" }).click();
  await page.waitForFunction(() => document.querySelector("#recording")?.textContent.includes("seen <b>by</b> the page"));
  const [file] = await Promise.all([page.waitForEvent("download"), newest(page).getByRole("link", { name: "Download" }).click()]);
  const chunks = [];
  for await (const chunk of await file.createReadStream()) chunks.push(chunk);
  assert.equal(Buffer.concat(chunks).subarray(1, 4).toString(), "HDF", "the download is the HDF5 file");
  for (const name of ["HTML", "CSV"]) await Promise.all([page.waitForEvent("download"), page.locator("#recording .actions").getByRole("button", { name }).click()]);
  await page.selectOption("#published", "3.11");
  await page.waitForFunction(() => [...document.querySelectorAll("#recording .report-table th")].some((th) => th.textContent === "published"));
  await isAccessible(page, "recording");
}

async function importsAndOverlays(page) {
  await open(page, "recordings");
  await page.locator("#import-details summary").click();
  await page.locator('[data-import="area_m2"]').fill("25");
  await page.locator('[data-import="layer_thickness_m"]').fill("100");
  await page.locator('[data-import="length_m"]').fill("18");
  // As a browser drops it.
  await page.evaluate((text) => {
    const data = new DataTransfer();
    data.items.add(new File([text], "from elsewhere.csv"));
    document.querySelector("#recordings").dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
  }, table);
  await page.waitForSelector('#recording-list [data-name="from-elsewhere"][aria-current]');
  for (const box of (await page.locator("#recording-list input[type=checkbox]").all()).slice(0, 2)) await box.check();
  await page.click("#overlay");
  await page.waitForFunction(() => document.querySelector("#recording-title")?.textContent === "2 recordings over each other");
  await page.waitForSelector("#recording:not([aria-busy])");
  await isAccessible(page, "overlay");
  await page.fill("#recording-search", "elsewhere");
  assert.equal(await page.locator("#recording-list li").count(), 1);
  await page.fill("#recording-search", "");
}

async function simulatesAModel(page) {
  await open(page, "model");
  await page.waitForFunction(() => document.querySelectorAll("#simulate-recording option").length > 1);
  const measured = await page.locator("#simulate-recording option").evaluateAll((all) => all.map((o) => o.value).find((v) => v !== "from-elsewhere"));
  await page.selectOption("#simulate-recording", measured);
  await page.click("#simulate-form > button");
  await page.waitForSelector("#simulate-result table", { timeout: patience });
  const shares = await page.locator("#simulate-result tbody tr").evaluateAll((rows) => rows.map((r) => Number(r.lastElementChild.textContent)));
  assert.equal(shares.length, 3);
  assert.ok(shares.every((s) => s >= 0 && s < 2), `its own model explains it: ${shares}`);
  await isAccessible(page, "model");
}

// Four short runs on a bench whose displacement sensor lags, which the model in question knows nothing of.
async function findsWhatIsMissing(page) {
  const hidden = 0.05; // s
  const { model } = await call(page, "model.get", { name: "nec-single-crystal" });
  await call(page, "model.put", { name: "bench", model: { ...model, name: "bench", effects: [{ id: "displacement_lag", parameters: { time_constant: hidden } }] } });
  const base = { format: "ferrobench-protocol", version: 1, unit: "kV/mm", sample_rate_Hz: 500, start: 0 };
  const ramp = (to) => ({ kind: "ramp", to, rate: 5 });
  const programs = {
    slow: [{ kind: "triangle", low: -1.5, high: 1.5, rate: 1, cycles: 1, first: "up" }],
    fast: [{ kind: "triangle", low: -1.5, high: 1.5, rate: 10, cycles: 3, first: "up" }],
    holds: [ramp(1.2), { kind: "hold", time: 1 }, ramp(-1), { kind: "hold", time: 1 }, ramp(1.2)],
    minor: [ramp(1.4), { kind: "reversals", points: [0.8, 0.2, -0.4], rate: 5, back_to: 1.4 }],
  };
  const recorded = [];
  for (const [name, segments] of Object.entries(programs)) {
    const { run } = await call(page, "run.start", { protocol: { ...base, name, segments }, model: "bench", fast: true });
    let status;
    do {
      await page.waitForTimeout(100);
      status = await call(page, "run.status", { run });
    } while (!["complete", "aborted"].includes(status.state));
    assert.equal(status.state, "complete", status.reason);
    recorded.push(status.recording);
  }
  await open(page, "model");
  await page.waitForFunction((name) => [...document.querySelectorAll("#discover-recordings option")].some((o) => o.value === name), recorded.at(-1));
  await page.locator("#discover-recordings").selectOption(recorded);
  await page.selectOption("#discover-model", "nec-single-crystal");
  await page.click("#discover-form > button");
  await page.waitForSelector("#discover-form .job progress");
  await page.waitForSelector("#discover-result h4", { timeout: 4 * patience });
  const result = await page.innerText("#discover-result");
  assert.match(result, /displacement lag/);
  const value = Number(await page.locator("#discover-result .report-table").first().locator("tbody td").nth(2).innerText());
  assert.ok(Math.abs(value / hidden - 1) < 0.1, `the time constant: ${value} s`);
  assert.match(result, /locked away: /);
  await page.fill('[aria-label="Name to keep the improved model under"]', "better");
  await page.getByRole("button", { name: "Keep the improved model" }).click();
  await page.waitForSelector('#fit-model option[value="better"]', { state: "attached" });
  await isAccessible(page, "discovery");
}

// Who comes late sees what was measured before, who watches sees who controls, and both may stop.
async function watchesWithAnother(page, browser, address, token) {
  await open(page, "bench");
  await page.click("#lease-take");
  await page.waitForSelector("#lease-release:visible");
  await call(page, "limits.get");
  await open(page, "experiment");
  await page.uncheck("#fast");
  const hold = page.locator('[data-path="/protocol/segments/1/time"]');
  await hold.fill("200");
  await hold.press("Enter");
  await page.waitForFunction(() => document.querySelector("#preview-facts").textContent.includes("3 min"));
  await page.click("#start");
  await state(page, "running");
  await page.waitForTimeout(2500);
  const other = await (await browser.newContext({ viewport: { width: 1280, height: 900 } })).newPage();
  await other.goto(`${address}/?token=${token}`);
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
  await other.context().close();
  await open(page, "bench");
  await page.click("#lease-release");
  await page.waitForSelector("#lease-take:visible");
}

// A daemon that does not answer is seen within 2 s, and nothing is claimed that the page cannot know.
async function seesSilence(page, daemon) {
  daemon.signal("SIGSTOP");
  const since = Date.now();
  try {
    await state(page, "unknown");
    const took = Date.now() - since;
    console.log(`silence was seen after ${took} ms`);
    assert.ok(took < 2000, `silence was seen after ${took} ms`);
    assert.equal(await page.innerText("#state-word"), "No answer");
    assert.match(await page.innerText("#state-reason"), /No answer for [\d.]+ s, last sample [\d.]+ s ago/);
    assert.doesNotMatch(await page.innerText(".bar"), /idle|complete|version/i);
    assert.equal(await page.innerText("#output"), "unknown");
    await page.click("#stop");
    await page.waitForFunction(() => document.querySelector("#errors").textContent.includes("not answered yet"));
    if (shots) await page.screenshot({ path: `${shots}/silent.png` });
  } finally {
    daemon.signal("SIGCONT");
  }
  await state(page, "idle", "complete", "aborted");
}

async function test(daemon) {
  const { address, token } = daemon;
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"],
  });
  if (shots) mkdirSync(shots, { recursive: true });
  try {
    const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
    page.setDefaultTimeout(patience);
    const complaints = [];
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && complaints.push(message.text()));
    page.on("pageerror", (error) => complaints.push(error.stack));
    page.on("request", (request) => new URL(request.url()).origin === address || /^(blob|data):/.test(request.url()) || complaints.push(`fetched ${request.url()}`));
    await page.goto(`${address}/?token=${token}`);
    assert.ok(!page.url().includes(token), "the token has left the address");
    await page.waitForSelector('#connection[data-open="true"]');
    const steps = [writesAnExperiment, saysWhatIsWrong, runsToTheEnd, opensTheRecording, importsAndOverlays, simulatesAModel, findsWhatIsMissing, watchesWithAnother, seesSilence];
    for (const step of steps) {
      const more = step === watchesWithAnother ? [browser, address, token] : step === seesSilence ? [daemon] : [];
      await step(page, ...more).catch(async (error) => {
        if (shots) await page.screenshot({ path: `${shots}/failed.png`, fullPage: true });
        throw new Error(`${step.name}: ${error.message}\nthe page says: ${complaints.join("\n")}`, { cause: error });
      });
      console.log(`ok ${step.name}`);
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
const [program_path] = process.argv.slice(2);
assert.ok(program_path, "usage: page_test.mjs PROGRAM");
const daemon = await startDaemon(program_path);
try {
  await test(daemon);
} finally {
  await daemon.stop();
}
