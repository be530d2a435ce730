// The view Recordings: opened, annotated, taken away as files, imported, overlaid, compared, replayed; and addresses.
import assert from "node:assert/strict";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { call, downloaded, isAccessible, keepPictures, newest, open, openRecording, patience, record, state } from "./browser.mjs";
import { title } from "./experiment_steps.mjs";

const table = "time_s;field_kV_per_mm;displacement_um\n" + Array.from({ length: 400 }, (_, i) => `${i * 0.01};${Math.sin(i / 30)};${5 * Math.sin(i / 30 - 0.2)}`).join("\n");

const html = (page) => downloaded(page, () => page.locator("#recording .actions").getByRole("button", { name: "HTML" }).click());

export async function opensTheRecording({ page }) {
  await open(page, "recordings");
  assert.ok((await newest(page).innerText()).includes(title), "the title stands there as text");
  assert.match(await newest(page).innerText(), /complete/);
  await newest(page).locator(".about a").click();
  await page.waitForSelector("#recording:not([aria-busy]) .report-table");
  assert.match(page.url(), /#recordings\/my-own|#recordings\/page-test/);
  const tables = await page.locator("#recording .report-table h3").allInnerTexts();
  assert.equal(tables[0], "Stroke per cycle and overall", "tables come in the report's order");
  assert.match(await page.innerText("#recording"), /stroke \[µm\]/);
  const stroke = page.locator("#recording .report-table").first();
  assert.match(await stroke.locator("tbody td").nth(5).innerText(), /^\d+\.\d+\(\d+\)$/, "a figure has its uncertainty");
  assert.match(await stroke.innerText(), /k = 2/);
  const curve = await page.locator("#recording .loop .frame").evaluateAll((frames) => frames.map((f) => Number(f.dataset.points)));
  assert.ok(curve.every((n) => n > 30 && n < 20000), `loops are curves: ${curve}`);
  await page.fill('[aria-label="Note to add"]', "seen <b>by</b> the page");
  await page.getByRole("button", { name: "Annotate" }).click();
  await page.waitForFunction(() => document.querySelector("#recording")?.textContent.includes("seen <b>by</b> the page"));
  const hdf5 = await downloaded(page, () => newest(page).getByRole("link", { name: "Download" }).click());
  assert.equal(hdf5.subarray(1, 4).toString(), "HDF", "the download is the HDF5 file");
  const csv = await downloaded(page, () => page.locator("#recording .actions").getByRole("button", { name: "CSV" }).click());
  assert.match(csv.toString(), /field/);
  await page.selectOption("#published", "3.11");
  await page.waitForFunction(() => [...document.querySelectorAll("#recording .report-table th")].some((th) => th.textContent === "published"));
  await isAccessible(page, "recording");
}

export async function importsAndOverlays({ page }) {
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
  await page.locator('#recording [aria-label="Cursor A [s]"]').fill("1");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#recording .readings:not([aria-busy])");
  const heads = await page.locator("#recording .readings th[scope=colgroup]").allInnerTexts();
  assert.equal(new Set(heads.filter(Boolean)).size, 2, `a cursor reads both, which are told apart: ${heads}`);
  const [png] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Save Field as PNG" }).last().click()]);
  assert.match(png.suggestedFilename(), /from-elsewhere.*-Field\.png$/, "a picture says whose it is");
  const picture = await readFile(await png.path());
  assert.ok(picture.readUInt32BE(16) > 2000 && picture.readUInt32BE(20) > 700, "wide enough for print");
  assert.match(await page.innerText("#recording .keys"), /prestress \d+ MPa, spring [\d.]+ N\/µm/);
  await isAccessible(page, "overlay");
  await page.fill("#recording-search", "elsewhere");
  assert.equal(await page.locator("#recording-list li").count(), 1);
  await page.fill("#recording-search", "");
}

// A recording is played again as it was measured, and compared with what comes out.
export async function replays({ page }) {
  await open(page, "recordings");
  const name = await page.locator("#recording-list li", { hasText: title }).first().getAttribute("data-name");
  const before = await page.locator("#recording-list li").count();
  await openRecording(page, name);
  await page.getByRole("button", { name: "Replay fast" }).click();
  await page.waitForSelector('nav a[href="#bench"][aria-current]');
  await page.waitForFunction((n) => document.querySelectorAll("#recording-list li").length === n + 1, before);
  await state(page, "complete");
  assert.match(await page.innerText("#run-facts"), /replay/i, "the device is a replay");
  const again = await newest(page).getAttribute("data-name");
  await openRecording(page, name);
  await page.selectOption('[aria-label="Recording to compare with"]', again);
  await page.waitForSelector("#recording .comparison p");
  assert.match(await page.innerText("#recording .comparison"), /to the bit/, "a replay gives the samples that were measured");
}

// The loops of a sweep from 0.1 to 100 Hz are curves: no chord across them, and each frequency has its colour.
export async function drawsASweep({ page, reports }) {
  const { slew } = await call(page, "limits.get");
  await call(page, "limits.set", { slew: 1e9 });
  const name = await record(page, { format: "ferrobench-protocol", version: 1, name: "sweep", title: "Sweep from 0.1 to 100 Hz", unit: "kV/mm", sample_rate_Hz: 10000,
    start: 0, segments: [0.1, 1, 10, 100].map((frequency) => ({ kind: "sine", amplitude: 1.2, frequency, cycles: 2 })) });
  await call(page, "limits.set", { slew });
  await openRecording(page, name);
  await page.waitForFunction(() => [...document.querySelectorAll("#recording .loop .frame")].every((f) => Number(f.dataset.points) > 100));
  const legend = await page.locator("#recording .loop .legend").first().innerText();
  for (const frequency of ["0.1", "100"]) assert.match(legend, new RegExp(`(^|\\s)${frequency.replace(".", "\\.")} Hz`), "frequencies are told by colour");
  // In half-pixel steps of the picture: no two neighbouring points of a curve are far apart where it bends.
  const { curves } = await call(page, "recording.read", { name, axes: ["field", "charge"], max_points: 20000 });
  const range = (key) => curves.reduce(([low, high], c) => [Math.min(low, ...c[key]), Math.max(high, ...c[key])], [Infinity, -Infinity]);
  const [x, y] = [range("x"), range("y")];
  for (const c of curves.filter((each) => each.cycle !== null)) {
    const at = (i) => [(c.x[i] - x[0]) / (x[1] - x[0]), (c.y[i] - y[0]) / (y[1] - y[0])];
    for (let i = 1; i + 1 < c.x.length; ++i) {
      const [p, q, r] = [at(i - 1), at(i), at(i + 1)];
      const [a, b] = [Math.hypot(q[0] - p[0], q[1] - p[1]), Math.hypot(r[0] - q[0], r[1] - q[1])];
      const turn = Math.abs(Math.atan2((q[0] - p[0]) * (r[1] - q[1]) - (q[1] - p[1]) * (r[0] - q[0]), (q[0] - p[0]) * (r[0] - q[0]) + (q[1] - p[1]) * (r[1] - q[1])));
      assert.ok(Math.min(a, b) < 0.05 || turn < 0.35, `${c.label}: a corner of ${turn} rad between legs of ${a} and ${b} of the picture`);
    }
  }
  await keepPictures(page, "sweep");
  reports.sweep = await html(page);
}

// A cursor stands on a measured row and shows its values; what is zoomed to is drawn from the rows themselves.
export async function readsTheRows({ page }) {
  const name = await record(page, { format: "ferrobench-protocol", version: 1, name: "rows", title: "Many rows", unit: "kV/mm", sample_rate_Hz: 20000,
    segments: [{ kind: "repeat", count: 7, segments: [{ kind: "triangle", low: -1, high: 1, rate: 10 }] }] });
  await openRecording(page, name);
  const points = () => page.locator("#recording .series-charts .frame").first().getAttribute("data-points").then(Number);
  const all = await points();
  const cursor = page.locator('#recording [aria-label="Cursor A [s]"]');
  await cursor.fill("1,2345");
  await cursor.press("Enter");
  await page.waitForSelector("#recording .readings:not([aria-busy])");
  assert.equal(await cursor.inputValue(), "1.2345", "with a decimal comma and all of its digits");
  const { time, field, displacement } = await call(page, "recording.read", { name, first: 24690, rows: 1 });
  assert.ok(Math.abs(time[0] - 1.2345) < 1e-9);
  const readings = page.locator("#recording .readings");
  const shown = async (channel) => Number((await readings.locator("tr", { hasText: channel }).locator("td").first().innerText()).replace("−", "-"));
  for (const [channel, measured] of [["field", field.first[0] * 1e-6], ["displacement", displacement.first[0] * 1e6]])
    assert.ok(Math.abs((await shown(channel)) - measured) < 1e-3 * Math.abs(measured), `${channel}: ${await shown(channel)}, measured ${measured}`);
  for (let i = 0; i < 8; ++i) await page.locator("#recording").getByRole("button", { name: "Zoom in" }).click();
  await page.waitForSelector("#recording .series-charts:not([aria-busy])");
  const rows = (20000 * 2.8) / 2 ** 8;
  const near = await points();
  assert.ok(near >= rows && near < 2 * rows, `${near} points of ${rows} rows in sight`);
  await page.locator("#recording").getByRole("button", { name: "Show all" }).click();
  assert.equal(await points(), all);
  await cursor.fill("here");
  await cursor.press("Enter");
  assert.equal(await cursor.getAttribute("aria-invalid"), "true");
  await call(page, "recording.delete", { name });
}

// Creep is drawn on logarithmic time, and read on it.
export async function readsCreep({ page, reports }) {
  await openRecording(page, await record(page, "creep-6-holds-fast", { set: { "device.domains": 16 } }));
  const readings = page.locator("#recording .report-table", { hasText: "Creep of the displacement" });
  const headings = await readings.locator("thead th").allInnerTexts();
  assert.match(headings.join(" "), /after 1 s.*after 2 s.*after 5 s.*after 10 s/, "evenly on logarithmic time");
  assert.equal(await readings.locator("tbody tr").count(), 6, "hold by hold");
  assert.equal(await page.locator("#recording .creep figure").count(), 2);
  await keepPictures(page, "creep");
  reports.creep = await html(page);
}

// A repeat is recorded whole, the report has its mean, and the page makes a recording of that.
export async function averagesARepeat({ page }) {
  const passes = { kind: "repeat", count: 4, average: true, segments: [{ kind: "triangle", low: -1, high: 1, rate: 10, sample_rate_Hz: 1000 }, { kind: "hold", time: 10, readings_per_decade: 20 }] };
  const name = await record(page, { format: "ferrobench-protocol", version: 1, name: "passes", title: "Passes", unit: "kV/mm", sample_rate_Hz: 100, segments: [passes] });
  await openRecording(page, name);
  assert.equal(await page.locator("#recording .report-table", { hasText: "Mean of passes 2 to 4" }).locator("tbody tr").count(), 1);
  await page.locator("#recording").getByRole("button", { name: "Average", exact: true }).click();
  await page.locator("#recording-title", { hasText: "Passes, mean of passes 2 to 4" }).waitFor();
  assert.equal(await page.locator("#recording").getByRole("button", { name: "Average", exact: true }).count(), 0, "a mean has no repeat");
  const mean = decodeURIComponent(new URL(page.url()).hash.split("/")[1]);
  const { rows, duration_s: length } = await call(page, "recording.info", { name: mean });
  assert.ok(Math.abs(length - 10.4) < 0.01, `${length} s`);
  assert.ok(rows > 440 && rows < 600, `${rows} samples of 10,401`);
  for (const each of [mean, name]) await call(page, "recording.delete", { name: each });
}

// Every view opens by its address, an address that leads nowhere is said to, and the way back leads back.
export async function followsAddresses({ page, daemon }) {
  await open(page, "recordings");
  await page.locator("#recording-list li").nth(1).waitFor();
  const [one, two] = await page.locator("#recording-list li").evaluateAll((all) => all.slice(0, 2).map((li) => li.dataset.name));
  const view = await page.context().newPage();
  view.setDefaultTimeout(patience);
  const shows = async (address, selector, state = "visible") => {
    await view.goto(`${daemon.address}/#${address}`);
    await view.reload();
    await view.waitForSelector(selector, { state });
    assert.equal(await view.locator("main > section:visible").count(), 1, `${address}: one view`);
  };
  await shows("experiment", '#library .protocol[aria-pressed="true"]');
  await shows("recordings", "#recording-list li");
  await shows(`recordings/${one}`, "#recording:not([aria-busy]) .report-table");
  await shows(`recordings/${one}+${two}`, '#recording:not([aria-busy]) .keys');
  await shows(`model/${two}`, `#simulate-recording option[value="${two}"]:checked`, "attached"); // an option of a closed list is never visible
  await shows("recordings/no-such-thing", "#errors .error");
  assert.match(await view.innerText("#errors"), /no-such-thing could not be shown/);
  await view.goBack();
  await view.waitForSelector('nav a[href="#model"][aria-current]');
  await shows("nowhere", 'nav a[href="#bench"][aria-current]');
  await view.close();
}

// Reports as files: by themselves, without a script, at both widths, in both colour schemes.
export async function givesReports({ page, browser, reports }) {
  await openRecording(page, await newest(page).getAttribute("data-name"));
  reports.recording = await html(page);
  const folder = await mkdtemp(join(tmpdir(), "ferrobench-reports-"));
  const view = await browser.newPage();
  const fetched = [];
  view.on("request", (request) => request.url().startsWith("file:") || request.url().startsWith("data:") || fetched.push(request.url()));
  try {
    for (const [name, html] of Object.entries(reports)) {
      const path = join(folder, `${name}.html`);
      await writeFile(path, html);
      await view.goto(`file://${path}`);
      assert.notEqual(await view.locator("h1").innerText(), "", `${name} has a title`);
      assert.equal(await view.locator("script").count(), 0, `${name} needs no script`);
      await isAccessible(view, `report-${name}`);
    }
    assert.deepEqual(fetched, [], "a report stands alone");
  } finally {
    await view.close();
    await rm(folder, { recursive: true });
  }
}
