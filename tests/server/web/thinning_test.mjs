// What the page keeps of a run under way: rows unevenly spaced stay where they were.
import assert from "node:assert/strict";
import { stretches, thinned } from "../../../server/web/thinning.js";

const hold = 600; // s
const levels = [1.2, 0.4];
const columns = { time: [], field: { first: [], min: [], max: [] }, force: { first: [], min: [], max: [] }, rows: 1, segments: [] };
const add = (t, value) => {
  columns.time.push(t);
  for (const part of ["first", "min", "max"]) {
    columns.field[part].push(value);
    columns.force[part].push(null);
  }
};
// Two holds with 20 readings a decade, and 30 pulses at 1 kHz, which have nearly all of the rows.
for (const [k, level] of levels.entries()) {
  for (let i = 0; i < 24; ++i) add(k * hold + i * 1e-3, level + (k ? 0.8 : -1.2) * (1 - i / 24));
  for (let since = 0.024; since < hold; since *= 10 ** 0.05) add(k * hold + since, level);
  add((k + 1) * hold - 1e-3, level);
}
for (let i = 0; i < 30 * 440; ++i) add(2 * hold + i * 1e-3, i % 440 < 220 ? 1 : 0);

const most = 1000;
const kept = thinned(columns, most);
assert.deepEqual(Object.keys(kept), ["time", "field", "force"]);
assert.ok(kept.time.length <= most && kept.time.length > most / 4, `${kept.time.length} stretches`);
assert.ok(Math.abs(Math.max(...kept.field.max) - 1.2) < 1e-9, "extremes stay");
assert.ok(kept.force.min.every((v) => v === null), "what was not measured stays so");
const beside = (4 * columns.time.at(-1)) / most;
for (const [k, level] of levels.entries())
  for (let i = 0; i + 1 < kept.time.length; ++i)
    for (const t of [kept.time[i], (kept.time[i] + kept.time[i + 1]) / 2])
      if (t > k * hold + beside && t < (k + 1) * hold - beside)
        for (const part of ["min", "max"]) {
          const share = (t - kept.time[i]) / (kept.time[i + 1] - kept.time[i]);
          const drawn = kept.field[part][i] + share * (kept.field[part][i + 1] - kept.field[part][i]);
          assert.ok(Math.abs(drawn - level) < 1e-9, `${part} ${drawn} at ${t} s of a hold at ${level}`);
        }

assert.equal(stretches(Array.from({ length: 10000 }, (_, i) => i * 1e-3), 1000).length, 1000, "as many as asked for where rows are even");
assert.deepEqual(stretches([], 10), []);
