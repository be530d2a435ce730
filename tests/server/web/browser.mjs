// What all steps of the page's test use: waiting for the page, calls to the daemon, pictures, axe-core.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";

export const shots = process.env.FERROBENCH_SCREENSHOTS;
if (shots) mkdirSync(shots, { recursive: true });
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

export const patience = 180_000; // ms; it bounds a hang: a machine with other tests beside it takes its time

export const state = (page, ...names) => page.waitForSelector(names.map((name) => `#state[data-state="${name}"]`).join(", "));

export const open = async (page, address) => {
  await page.evaluate((hash) => (location.hash = hash), address);
  await page.waitForSelector(`nav a[href="#${address.split("/")[0]}"][aria-current]`);
};

// The address and the open recording, once it is drawn.
export const openRecording = async (page, name) => {
  await open(page, `recordings/${encodeURIComponent(name)}`);
  await page.waitForSelector("#recording:not([aria-busy]) #recording-title");
};

export const newest = (page) => page.locator("#recording-list li").first();

export const call = (page, method, params = {}) => page.evaluate(async ([m, p]) => {
  const response = await fetch("/rpc", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ jsonrpc: "2.0", id: 1, method: m, params: p }) });
  const { result, error } = await response.json();
  if (error) throw new Error(`${m}: ${JSON.stringify(error)}`);
  return result;
}, [method, params]);

// The name of the recording of a run that the daemon is asked for, not the page.
export async function record(page, protocol, more = {}) {
  const { run } = await call(page, "run.start", { protocol, fast: true, ...more });
  for (;;) {
    const { state: now, reason, recording } = await call(page, "run.status", { run });
    if (now === "complete") return recording;
    assert.notEqual(now, "aborted", reason);
    await page.waitForTimeout(100);
  }
}

export async function downloaded(page, what) {
  const [file] = await Promise.all([page.waitForEvent("download"), what()]);
  const chunks = [];
  for await (const chunk of await file.createReadStream()) chunks.push(chunk);
  return Buffer.concat(chunks);
}

// A column of a table of the page, by its heading; numbers have a minus that JavaScript reads.
export const column = (table, heading) => table.evaluate((t, h) => {
  const at = [...t.querySelectorAll("thead th")].findIndex((th) => th.textContent.startsWith(h));
  if (at < 0) throw new Error(`no column ${h}`);
  return [...t.querySelectorAll("tbody tr")].map((row) => row.children[at].textContent.replaceAll("−", "-"));
}, heading);

// What of a page reaches over its edge at this width.
const tooWide = (page, width) => page.evaluate((w) => {
  const wide = document.documentElement.scrollWidth;
  if (wide <= w) return "";
  const out = [...document.querySelectorAll("body *")].filter((e) => e.getBoundingClientRect().right > w + 1 && !e.closest(".scroll, nav, pre"));
  return `${wide} px wide: ${out.slice(0, 4).map((e) => e.outerHTML.slice(0, 120)).join(" | ")}`;
}, width);

async function looksAs(page, width, colorScheme) {
  await page.emulateMedia({ colorScheme });
  await page.setViewportSize({ width, height: 900 });
  await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
  await page.evaluate(() => scrollTo(0, 0));
}

// Of both widths in both colour schemes, and of how it is printed; where a folder for them is named.
export async function keepPictures(page, name) {
  if (!shots) return;
  for (const colorScheme of ["light", "dark"])
    for (const width of [390, 1280]) {
      await looksAs(page, width, colorScheme);
      await page.screenshot({ path: `${shots}/${name}-${width}-${colorScheme}.png`, fullPage: true });
    }
  await page.emulateMedia({ media: "print", colorScheme: "light" });
  await page.setViewportSize({ width: 794, height: 1123 }); // A4 at 96 dots per inch
  await page.screenshot({ path: `${shots}/${name}-print.png`, fullPage: true });
  await page.emulateMedia({ media: "screen" });
  await page.setViewportSize({ width: 1280, height: 900 });
}

// Each width and each colour scheme once: nothing reaches over the edge, and axe-core finds nothing serious.
export async function isAccessible(page, name) {
  await page.evaluate(`window.axe || (() => {${axe}})()`); // the page's policy keeps scripts out; the debugger is not bound by it
  for (const [width, colorScheme] of [[390, "dark"], [1280, "light"]]) {
    await looksAs(page, width, colorScheme);
    assert.equal(await tooWide(page, width), "", `${name} at ${width} px`);
    const { violations } = await page.evaluate(() => axe.run(document, { resultTypes: ["violations"] }));
    const serious = violations.filter((v) => ["serious", "critical"].includes(v.impact));
    assert.deepEqual(serious.map((v) => `${v.id}: ${v.nodes.slice(0, 3).map((n) => n.html.slice(0, 160)).join(" | ")}`), [], `${name}, ${width} px, ${colorScheme}`);
  }
  await keepPictures(page, name);
}
