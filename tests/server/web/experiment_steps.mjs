// The view Experiment: a program is written in the editor, kept, refused, run.
import assert from "node:assert/strict";
import { call, isAccessible, keepPictures, newest, open, openRecording, state } from "./browser.mjs";

// A name that would be markup if the page did not escape it.
export const title = 'A short <img src="x" alt="program">';
const program = {
  format: "ferrobench-protocol", version: 1, name: "page-test", title, unit: "kV/mm", sample_rate_Hz: 200,
  parameters: { rate: 1 }, start: 1,
  segments: [{ kind: "ramp", to: -0.5, rate: "$rate" }, { kind: "hold", time: 20 }, { kind: "ramp", to: 1, rate: "$rate" }],
};

// Whether anything but the background was drawn.
export const drawn = (page, plot) =>
  page.locator(`${plot} figure:visible canvas`).first().evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.some((value) => value !== 0);
  });

const points = (page, plot) => page.locator(`${plot} figure:visible .frame`).evaluateAll((frames) => frames.map((f) => Number(f.dataset.points ?? 0)));
const takes = (page, text) => page.waitForFunction((t) => document.querySelector("#preview-facts")?.textContent.includes(t), text);

export async function useProgram(page, text) {
  await open(page, "experiment");
  if (!(await page.locator("#protocol-text").isVisible())) await page.locator("#edit summary").click();
  await page.fill("#protocol-text", text);
  await page.click("#use-text");
}

// The table of segments and the drawing follow each other, a change can be undone, the program is kept under a name.
export async function writesAnExperiment({ page }) {
  await open(page, "experiment");
  await page.waitForSelector("#library .protocol");
  // The one that is loaded first has come, or it would come between the keys of what is written.
  await page.waitForFunction(() => document.querySelector("#preview-facts").textContent);
  assert.ok((await page.locator("#library .protocol").count()) >= 16);
  await useProgram(page, JSON.stringify(program));
  await takes(page, "23 s");
  assert.ok(await drawn(page, "#preview-plot"), "the preview is drawn");
  assert.match(await page.innerText("#parameters"), /rate \[kV\/mm\/s\]/, "a parameter has the unit of its use");
  const hold = page.locator('[data-path="/protocol/segments/1/time"]');
  await hold.fill("10");
  await hold.press("Enter");
  await takes(page, "13 s");
  await page.click("#undo");
  await takes(page, "23 s");
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

export async function saysWhatIsWrong({ page }) {
  const error = page.locator("#errors .error");
  await page.fill('[data-set="rate"]', "quick");
  await error.waitFor();
  assert.match(await error.innerText(), /\/set\/rate.*given\s+quick/s);
  assert.equal(await page.getAttribute('[data-set="rate"]', "aria-invalid"), "true");
  assert.match(await page.locator("#parameters .field-error").innerText(), /number/);
  await page.fill('[data-set="rate"]', "1");
  await error.waitFor({ state: "detached" });
  for (const [field, value, said] of [["prestress", "8e6", /Prestress \[MPa\].*given\s+8000000 MPa.*to 10000 MPa/s], ["spring", "-1", /Spring \[N\/µm\].*given\s+-1 N\/µm/s]]) {
    await page.fill(`#${field}`, value);
    await page.click("#start");
    await error.waitFor();
    assert.match(await error.innerText(), said, "in the unit of the field");
    await page.fill(`#${field}`, "");
    await error.waitFor({ state: "detached" });
  }
  const to = page.locator('[data-path="/protocol/segments/0/to"]');
  await to.fill("-5");
  await to.press("Enter");
  await error.waitFor();
  assert.match(await error.innerText(), /guard would refuse.*ferrobench limits set/s);
  await page.click("#start");
  await page.waitForFunction(() => document.querySelector("#errors")?.textContent.includes("was not started"));
  await page.click("#undo");
  await error.waitFor({ state: "detached" });
  await keepPictures(page, "experiment");
}

// A refused program: what is wrong stands beside its text and in the bar, nothing is recorded, the program before it stays.
export async function refusesAProgram({ page }) {
  const { recordings } = await call(page, "recording.list");
  const error = page.locator("#errors .error");
  await useProgram(page, "{ \"name\": ");
  await error.waitFor();
  assert.match(await error.innerText(), /not JSON/);
  const wrong = structuredClone(program);
  wrong.segments[1] = { kind: "hold", tyme: 20 };
  await useProgram(page, JSON.stringify(wrong));
  await page.waitForFunction(() => /tyme/.test(document.querySelector("#errors")?.textContent));
  const said = await error.innerText();
  assert.match(said, /\/segments\/1\b/, "the place in the user's own text");
  assert.match(said, /time/, "what is allowed");
  assert.match(await page.innerText("#edit .field-error"), /^\/segments\/1\/tyme/, "beside the text, with its place");
  assert.equal(await page.locator("#errors li").count(), 1, "one typo is one problem");
  await isAccessible(page, "refused");
  await page.click("#start");
  await page.waitForFunction(() => document.querySelector("#errors")?.textContent.includes("was not started"));
  assert.equal(await page.innerText("#state-word"), "Complete", "the run before it still stands there");
  assert.equal((await call(page, "recording.list")).recordings.length, recordings.length, "nothing was recorded");
  await page.locator('#library [data-name="my-own"]').click();
  await error.waitFor({ state: "detached" });
  await takes(page, "23 s");
}

export async function runsToTheEnd({ page }) {
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
  await page.waitForSelector("#live-readings:not([aria-busy])"); // the cursors stand on measured rows
  assert.match(await page.innerText("#live-readings"), /polarization \[C\/m²\]/, "charge counts by area");
  const times = await page.locator("#live-readings tbody tr").first().locator("td").allInnerTexts();
  assert.ok(times.every((t) => Number(t) > 0), `A, B and their difference: ${times}`);
  assert.equal(await page.inputValue('#live [aria-label="Cursor A [s]"]'), times[0], "the field of a cursor says where it is");
  assert.equal(await page.locator("#live-readings tbody tr").count(), 5);
  await isAccessible(page, "bench");
}

// What the list of recordings says of each that it shows.
const statuses = (page) => page.$$eval("#recording-list li", (rows) => rows.map((row) => row.querySelector(".wrong")?.textContent ?? "complete"));

// Stop, by the one who started it: zero, its reason on the page, a recording that says so and can be looked at.
export async function abortsARun({ page }) {
  await open(page, "recordings");
  await page.selectOption("#recording-status", "aborted");
  const before = (await statuses(page)).length;
  await page.selectOption("#recording-status", "");
  await open(page, "experiment");
  await page.uncheck("#fast");
  await page.click("#start");
  await state(page, "running");
  await page.waitForFunction(() => Number(document.querySelector("#live").dataset.points) > 5);
  await page.click("#stop");
  await state(page, "aborted");
  assert.match(await page.innerText("#state-reason"), /stopped/i);
  assert.equal(await page.innerText("#output"), "0 kV/mm");
  await open(page, "recordings");
  await page.selectOption("#recording-status", "aborted");
  // The list is read again a moment after the run has ended.
  await page.waitForFunction((count) => document.querySelectorAll("#recording-list li").length === count, before + 1);
  const shown = await statuses(page);
  assert.ok(shown.every((status) => status.startsWith("aborted")), `only what was aborted is shown, not: ${shown}`);
  await page.selectOption("#recording-status", "");
  const name = await newest(page).getAttribute("data-name");
  await openRecording(page, name);
  assert.match(await page.innerText("#recording"), /aborted: .*stopped/i);
  assert.ok(await drawn(page, "#recording .series-charts"), "what was measured until then is drawn");
  await keepPictures(page, "aborted");
}
