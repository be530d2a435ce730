// The view Queue: runs of the form and a plan from a file, in another order, asked for and confirmed, stopped by Stop.
import assert from "node:assert/strict";
import { call, isAccessible, open, state } from "./browser.mjs";

const items = (page) => page.locator("#queue-items li").evaluateAll((rows) => rows.map((row) => `${row.dataset.item} ${row.dataset.state}`));
const says = (page, words) => page.waitForFunction((text) => document.querySelector("#queue-now").textContent.includes(text), words);
const has = (page, count) => page.waitForFunction((n) => document.querySelectorAll("#queue-items li").length === n, count);

export async function queuesRuns({ page }) {
  await open(page, "experiment");
  await page.locator('#library [data-name="my-own"]').click();
  await page.waitForSelector('#library [data-name="my-own"][aria-pressed="true"]');
  await page.check("#fast");
  await page.click("#enqueue-details summary");
  await page.fill("#sweep-set", "prestres_MPa");
  await page.fill("#sweep-values", "4 8");
  // The daemon says which settings there are. A preview under way takes an error away: asked once more then.
  await page.waitForFunction(() => {
    const said = document.querySelector("#sweep-values[aria-invalid]") && document.querySelector("#errors").textContent.includes("prestress_MPa");
    if (!said) document.querySelector("#enqueue").click();
    return said;
  }, null, { polling: 1000 });
  await page.fill("#sweep-set", "prestress_MPa");
  await page.fill("#sweep-confirm", "set the prestress to {} MPa");
  await page.click("#enqueue");
  await page.waitForFunction(() => document.querySelector("#enqueue-note").textContent.startsWith("2 runs added"));
  for (const id of ["#sweep-set", "#sweep-values", "#sweep-confirm"]) await page.fill(id, "");
  await page.selectOption("#wait-channel", "displacement");
  assert.equal(await page.inputValue("#wait-unit"), "um");
  for (const [id, value] of [["value", "0"], ["tolerance", "100"], ["for", "5"], ["timeout", "8"]]) await page.fill(`#wait-${id}`, value);
  await page.click("#enqueue");
  await page.waitForFunction(() => document.querySelector("#enqueue-note").textContent.startsWith("One run added"));

  await open(page, "queue");
  const program = { format: "ferrobench-protocol", version: 1, name: "long", unit: "kV/mm", segments: [{ kind: "ramp", to: 0.5, time: 0.5 }, { kind: "hold", time: 300 }] };
  const plan = { format: "ferrobench-plan", version: 1, name: "long", run: { protocol: program }, wait: { channel: "displacement", value: 0, tolerance: 100, unit: "um", for_s: 10 } };
  await page.setInputFiles("#plan-file", { name: "long.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(plan)) });
  await has(page, 4);
  const [first, second, third, last] = (await items(page)).map((row) => Number(row.split(" ")[0]));
  await page.click(`[aria-label="Move item ${third} to the front"]`);
  await page.waitForFunction((id) => document.querySelector("#queue-items li").dataset.item === String(id), third);
  await page.click(`[aria-label="Remove item ${second}"]`);
  await has(page, 3);
  assert.deepEqual(await items(page), [third, first, last].map((id) => `${id} waiting`));
  assert.notEqual((await call(page, "run.status")).state, "running", "nothing has started");
  await page.click("#queue-start");
  await says(page, "Waits for you");
  await says(page, "set the prestress to 4 MPa");
  await page.waitForSelector(`#queue-items li[data-item="${third}"][data-state="complete"]`);
  await isAccessible(page, "queue");
  await page.click("#queue-confirm");
  await says(page, "Waits: for displacement within 100 µm of 0 µm for 10 s");
  await page.waitForSelector(`#queue-items li[data-item="${last}"][data-state="running"]`);
  await state(page, "running");
  await page.click("#stop");
  await says(page, "Stopped: stopped by");
  await page.waitForSelector(`#queue-items li[data-item="${last}"][data-state="aborted"]`);
  assert.deepEqual(await items(page), [`${third} complete`, `${first} complete`, `${last} aborted`]);
  await page.locator(`#queue-items li[data-item="${first}"] a`).click();
  await page.waitForSelector("#recording:not([aria-busy]) #recording-title");
}
