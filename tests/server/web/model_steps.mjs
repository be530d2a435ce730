// The view Model: a model beside a recording, a fit, a search for what a model misses.
import assert from "node:assert/strict";
import { call, column, downloaded, isAccessible, keepPictures, open, patience, record } from "./browser.mjs";
import { title } from "./experiment_steps.mjs";

const base = { format: "ferrobench-protocol", version: 1, unit: "kV/mm", sample_rate_Hz: 500, start: 0 };
const loop = (high, rate, cycles = 1) => [{ kind: "triangle", low: -high, high, rate, cycles, first: "up" }];

export async function simulatesAModel({ page }) {
  await open(page, "model");
  const option = page.locator("#simulate-recording option", { hasText: title }).last();
  await option.waitFor({ state: "attached" });
  const measured = await option.getAttribute("value");
  await page.selectOption("#simulate-recording", measured);
  await page.click("#simulate-form > button");
  const table = page.locator("#simulate-result table");
  await table.waitFor();
  const shares = (await column(table, "share of the range")).map(Number);
  assert.equal(shares.length, 3);
  assert.ok(shares.every((s) => s >= 0 && s < 2), `its own model explains it: ${shares}`);
  const simulated = await page.locator("#simulate-result .note a").innerText();
  const { columns } = await call(page, "recording.compare", { a: measured, b: simulated });
  const rms = columns.find((c) => /displacement/.test(c.dataset)).rms * 1e6;
  assert.ok(Math.abs(Number((await column(table, "rms"))[1]) / rms - 1) < 1e-3, "the residual is that of all samples");
  await keepPictures(page, "simulated");
}

// A model whose piezoelectric constant is off by a tenth comes back to the bench's.
export async function fitsAModel({ page, reports }) {
  const { model } = await call(page, "model.get", { name: "nec-single-crystal" });
  const truth = model.material.piezoelectric_180;
  const off = structuredClone(model);
  off.material.piezoelectric_180 *= 1.1;
  await call(page, "model.put", { name: "off", model: { ...off, name: "off" } });
  const name = await record(page, { ...base, name: "for-the-fit", segments: loop(1.5, 1) }, { model: "nec-single-crystal" });
  await open(page, "bench");
  await open(page, "model"); // which reads the models anew
  await page.waitForSelector(`#fit-recordings option[value="${name}"]`, { state: "attached" });
  await page.waitForSelector('#fit-model option[value="off"]', { state: "attached" });
  await page.locator("#fit-recordings").selectOption([name]);
  await page.selectOption("#fit-model", "off");
  await page.fill("#fit-free", "material.piezoelectric");
  await page.click("#fit-form > button");
  await page.waitForFunction(() => /material.piezoelectric/.test(document.querySelector("#errors").textContent));
  await page.fill("#fit-free", "material.piezoelectric_180");
  await page.fill("#fit-name", "fitted");
  await page.click("#fit-form > button");
  const table = page.locator("#fit-result table").first();
  await table.waitFor();
  assert.deepEqual(await column(table, "parameter"), ["material.piezoelectric_180"]);
  const [from, to] = [Number((await column(table, "from"))[0]), Number((await column(table, "to"))[0])];
  assert.ok(Math.abs(from / truth - 1.1) < 1e-3, `it starts from what was given: ${from}`);
  assert.ok(Math.abs(to / truth - 1) < 1e-3, `it ends at the bench's: ${to} for ${truth}`);
  const rms = page.locator("#fit-result table").nth(1);
  for (const [k, before] of (await column(rms, "before")).entries()) assert.ok(Number(before) >= Number((await column(rms, "after"))[k]), "nothing becomes worse");
  await page.waitForSelector('#discover-model option[value="fitted"]', { state: "attached" });
  const kept = (await call(page, "model.get", { name: "fitted" })).model.material.piezoelectric_180;
  assert.ok(Math.abs(kept / truth - 1) < 1e-3, "the fitted model is kept");
  reports.fit = await downloaded(page, () => page.locator("#fit-result").getByRole("button", { name: "Report" }).click());
  await keepPictures(page, "fit");
}

async function searches(page, bench, programs, sample_rate_Hz = base.sample_rate_Hz) {
  const recorded = [];
  for (const [name, segments] of Object.entries(programs)) recorded.push(await record(page, { ...base, sample_rate_Hz, name, segments }, { model: bench }));
  await open(page, "bench");
  await open(page, "model"); // which reads the models anew
  await page.waitForSelector(`#discover-recordings option[value="${recorded.at(-1)}"]`, { state: "attached" });
  await page.locator("#discover-recordings").selectOption(recorded);
  await page.selectOption("#discover-model", "nec-single-crystal");
  await page.evaluate(() => document.querySelector("#discover-result").replaceChildren());
  await page.click("#discover-form > button");
  await page.waitForSelector("#discover-form .job progress");
  await page.waitForSelector("#discover-result h4", { timeout: 4 * patience });
}

const hide = async (page, effects) => {
  const { model } = await call(page, "model.get", { name: "nec-single-crystal" });
  await call(page, "model.put", { name: "bench", model: { ...model, name: "bench", effects } });
};
const tableOf = (page, title) => page.locator("#discover-result .report-table", { has: page.getByRole("heading", { name: title }) }).locator("table");

// Four short runs on a bench whose displacement sensor lags, which the model in question knows nothing of.
export async function findsWhatIsMissing({ page, reports }) {
  const hidden = 0.05; // s
  await hide(page, [{ id: "displacement_lag", parameters: { time_constant: hidden } }]);
  const ramp = (to) => ({ kind: "ramp", to, rate: 5 });
  await searches(page, "bench", {
    slow: loop(1.5, 1), fast: loop(1.5, 10, 3),
    holds: [ramp(1.2), { kind: "hold", time: 1 }, ramp(-1), { kind: "hold", time: 1 }, ramp(1.2)],
    minor: [ramp(1.4), { kind: "reversals", points: [0.8, 0.2, -0.4], rate: 5, back_to: 1.4 }],
  });
  assert.match(await page.innerText("#discover-result dl.facts"), /Verdict\s+named/);
  assert.match(await page.innerText("#discover-result .findings"), /Missing in the model: displacement lag\. Probability/);
  const added = tableOf(page, "What was added");
  assert.match((await column(added, "term")).join(), /displacement lag/);
  assert.match((await column(added, "equation")).join(), /xm = lag\(x\)/, "its equation");
  const value = Number((await column(added, "value"))[0]);
  assert.ok(Math.abs(value / hidden - 1) < 0.1, `the time constant: ${value} s`);
  assert.equal((await column(added, "unit"))[0], "s");
  const gap = tableOf(page, "Residual over noise");
  const [on, channel, before, after] = await Promise.all(["on", "channel", "before", "after"].map((h) => column(gap, h)));
  const locked = on.findIndex((where, k) => where.startsWith("locked away: ") && channel[k] === "displacement");
  assert.ok(Number(before[locked]) > 10 && Number(after[locked]) < 2, `on a locked recording from ${before[locked]} to ${after[locked]} times the noise`);
  await page.fill('[aria-label="Name to keep the improved model under"]', "better");
  await page.getByRole("button", { name: "Keep the improved model" }).click();
  await page.waitForSelector('#fit-model option[value="better"]', { state: "attached" });
  const kept = (await call(page, "model.get", { name: "better" })).model.effects;
  assert.equal(kept[0].id, "displacement_lag", "the improved model has it");
  reports.discovery = await downloaded(page, () => page.locator("#discover-result").getByRole("button", { name: "Report" }).click());
  await isAccessible(page, "discovery");
}

// Loops that are too slow to tell a lag of the sensor from a delay: both are named, with the experiment that would decide.
export async function findsTheNextExperiment({ page }) {
  await hide(page, [{ id: "displacement_lag", parameters: { time_constant: 0.001 } }]);
  await searches(page, "bench", { a: loop(1.5, 0.3), b: loop(1.4, 0.3), c: loop(1.3, 0.3) }, 100);
  assert.match(await page.innerText("#discover-result dl.facts"), /Verdict\s+ambiguous/);
  const alternatives = tableOf(page, "Alternatives");
  const [names, odds] = [await column(alternatives, "explanation"), (await column(alternatives, "probability")).map(Number)];
  assert.deepEqual(names.slice(0, 2).sort(), ["displacement delay", "displacement lag"]);
  assert.ok(odds[0] + odds[1] > 90 && Math.min(odds[0], odds[1]) > 5, `neither is sure: ${odds}`);
  const wanted = (await page.locator("#discover-result .next").innerText()).split(": ").at(-1).trim();
  await keepPictures(page, "next-experiment");
  await page.getByRole("button", { name: "Load the next experiment" }).click();
  await page.waitForSelector('nav a[href="#experiment"][aria-current]');
  await page.waitForSelector(`#library [data-name="${wanted}"][aria-pressed="true"]`);
  const { protocol } = await call(page, "protocol.get", { name: wanted });
  assert.equal(await page.innerText("#protocol-title"), protocol.title);
  await page.waitForFunction((n) => document.querySelectorAll("#editor .segment").length >= n, protocol.segments.length);
}
