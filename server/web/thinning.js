// Fewer points of what is drawn against time, by the rule of recordings/analysis/thinning.h.

function cut(time, rows, duration) {
  const begins = [];
  const pauseBefore = (i) => time[i] - time[i - 1] > duration;
  for (let i = 0; i < time.length; ++i) {
    const begin = begins.at(-1);
    if (i === 0 || i - begin >= rows || time[i] - time[begin] > duration || pauseBefore(i - 1) || pauseBefore(i + 1)) begins.push(i);
  }
  return begins;
}

// The first rows of at most `most` stretches: none is longer than a share of the rows or of the duration, and a row beside a
// longer pause stands alone.
export function stretches(time, most) {
  for (let shares = most; shares > 1; shares -= Math.ceil(shares / 4)) {
    const begins = cut(time, Math.ceil(time.length / shares), (time.at(-1) - time[0]) / shares);
    if (begins.length <= most) return begins;
  }
  return time.length ? [0] : [];
}

const either = (pick) => (a, b) => (a === null || b === null ? a ?? b : pick(a, b)); // null: nothing was measured
const joins = { first: (a) => a, min: either(Math.min), max: either(Math.max) };

// Columns {time, field: {first, min, max}, ...} with neighbours joined to at most `most` stretches; nothing else of them.
export function thinned(columns, most) {
  const begins = stretches(columns.time, most);
  const joined = (values, join) => begins.map((begin, k) => values.slice(begin, begins[k + 1]).reduce(join));
  const out = { time: joined(columns.time, joins.first) };
  for (const [name, column] of Object.entries(columns))
    if (column.first) out[name] = Object.fromEntries(Object.entries(joins).map(([part, join]) => [part, joined(column[part], join)]));
  return out;
}
