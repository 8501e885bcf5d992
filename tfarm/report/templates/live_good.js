// The gains of the grade good: at the other numbers of a law, what each frequency excludes of one number k.  L = c + k b is a line over k.
"use strict";
const FINER = 4, CLOSE = 0.2, INSIDE = 0.005; // frequencies for each of the margins'; of a gap: nearer ends are refined, and how far from an end it is tried
const ratioOf = at => w => { const [a, b, c, d] = at(w), q = a * a + b * b; return [(a * c + b * d) / q, (a * d - b * c) / q]; };
// The two k with |c + k b| = r, NaN where there are none
function onCircle(cr, ci, br, bi, r) {
  const n = br * br + bi * bi, middle = -(cr * br + ci * bi) / n, half = Math.sqrt(n * r * r - (cr * bi - ci * br) ** 2) / n;
  return [middle - half, middle + half];
}
// Rules give [least k, greatest k, inside] of a line, excluded where inside > 0; `late` [s] is the least delay margin in continuous time
function exclusions({ gain: [least], phase: [angle], peak: [Ms] }, late) {
  const factor = 10 ** (least / 20), turn = angle * Math.PI / 180;
  const crossing = (side, late) => (w, cr, ci, br, bi) => { // |L| = 1, and the angle to -1 or the delay to it too small
    const k = onCircle(cr, ci, br, bi, 1)[side], a = Math.atan2(-ci - k * bi, -cr - k * br);
    return [k, k, Math.max(turn - Math.abs(a), late * w - (a + 2 * Math.PI) % (2 * Math.PI))];
  };
  const axis = (_, cr, ci, br, bi) => { const k = -ci / bi, x = cr + k * br; return [k, k, Math.min(x + factor, -1 / factor - x)]; }; // L < 0, the factor to -1 too small
  const disc = (_, cr, ci, br, bi) => { const [low, high] = onCircle(cr + 1, ci, br, bi, 1 / Ms); return [low, high, high - low]; };
  return { rules: of => [crossing(0, of ? 0 : late), crossing(1, of ? 0 : late), axis, disc], factors: [factor, 1 / factor] };
}

// What each number of a law adds to L, on more frequencies than for margins
function* linesOf(loop) {
  const { w } = loop.base, fine = Float64Array.from({ length: FINER * (w.length - 1) + 1 }, (_, i) => { const k = Math.floor(i / FINER), share = i % FINER / FINER; return share ? w[k] + share * (w[k + 1] - w[k]) : w[k]; });
  const rows = [];
  for (const name of loop.names) {
    const at = ratioOf(loop.curve(loop.unit(name), []).at), values = new Float64Array(2 * fine.length);
    for (let i = 0; i < fine.length; i++) { if (i % 100 === 0) yield; values.set(at(fine[i]), 2 * i); }
    rows.push({ name, at, values });
  }
  return { w: fine, rows };
}
// The lines over its number `up` at the others of a law
function columnOf({ w, rows }, law, up) {
  const way = rows.find(({ name }) => name === up), rest = rows.filter(({ name }) => name !== up && law[name]), c = new Float64Array(2 * w.length), b = way.values;
  for (const { name, values } of rest) for (let i = 0; i < c.length; i++) c[i] += law[name] * values[i];
  return { w, row: i => [c[2 * i], c[2 * i + 1], b[2 * i], b[2 * i + 1]], at: w => [...rest.reduce((sum, { name, at }) => add(sum, times(law[name], at(w))), [0, 0]), ...way.at(w)] };
}
// An interval of k for each run of frequencies at which a rule excludes some
function excludedBy(rule, column, [least, most]) {
  const found = [], room = most - least, { w } = column, at = w => rule(w, ...column.at(w));
  const edge = (a, b) => [0, 1].map(end => a[end] + (b[end] - a[end]) * a[2] / (a[2] - b[2])); // where a requirement is met just so
  let run = null, last = [NaN, NaN, NaN];
  const widen = ([low, high], i) => { if (low < run.low) [run.low, run.first] = [low, i]; if (high > run.high) [run.high, run.last] = [high, i]; };
  for (let i = 0; i < w.length; i++) {
    const here = rule(w[i], ...column.row(i));
    if (here[2] > 0 && here[1] > least - room && here[0] < most + room) {
      if (run && Math.abs(here[1] - last[1]) > room / 2) run = null; // through infinity
      if (!run) { found.push(run = { low: Infinity, high: -Infinity, w, at }); if (last[2] <= 0) widen(edge(last, here), i); }
      widen(here, i);
    } else if (run) {
      if (here[2] <= 0) widen(edge(last, here), i - 1);
      run = null;
    }
    last = here;
  }
  return found;
}
const exactly = (low, high) => ({ low, high, exact: { low: true, high: true } });
// At a frequency where L is real for every k
function excludedStill(factors, [x, , y]) {
  const [low, high] = factors.map(factor => -(factor + x) / y).sort((a, b) => a - b);
  return Number.isFinite(low + high) ? [exactly(low, high)] : [];
}
// The k with a pole on the axis or the circle, as runs without width
function edgesOf({ w, row, at }) {
  const across = (cr, ci, br, bi) => (1 + cr) * bi - ci * br, f = w => across(...at(w)), found = [];
  for (let i = 1, before = across(...row(0)); i < w.length; i++) {
    const after = across(...row(i));
    if (before * after < 0) {
      const [cr, ci, br, bi] = at(zeroOf(f, w[i - 1], before, w[i], after)), k = -((1 + cr) * br + ci * bi) / (br * br + bi * bi);
      found.push(exactly(k, k));
    }
    before = after;
  }
  return found;
}
// The end "low" or "high" of a run to rounding, between its point and the next ones; false where it is already
function refined(run, key) {
  const exact = run.exact ||= {}, side = key === "low" ? 0 : 1, i = side ? run.last : run.first, sign = side ? -1 : 1;
  if (exact[key]) return false;
  const value = w => { const found = run.at(w); return found[2] > 0 ? sign * found[side] : Infinity; };
  run[key] = sign * Math.min(...[i - 1, i + 1].filter(k => k in run.w).map(k => lowestBetween(value, run.w[i], run.w[k], 26).value));
  return exact[key] = true;
}
// What all runs leave from low to high
function leftOf(runs, low, high) {
  for (;;) {
    const found = [];
    let from = low;
    for (const run of runs.sort((a, b) => a.low - b.low)) {
      if (run.low > from) found.push([from, Math.min(run.low, high)]);
      from = Math.max(from, run.high);
      if (from >= high) break;
    }
    if (from < high) found.push([from, high]);
    const near = (end, [a, b]) => end > a - CLOSE * (b - a) && end < b + CLOSE * (b - a), changed = found.flatMap(gap => runs.flatMap(run => ["low", "high"].filter(key => near(run[key], gap) && refined(run, key))));
    if (!changed.length) return found;
  }
}
// The good parts of gaps: those with a good middle as far as they are good, and across an end that turns out to be none; it yields before each test
function* goodParts(gaps, isGood) {
  function* is(k) { yield; return isGood(k); }
  function* last(good, bad) { for (let k = 0; k < 12; k++) { const tried = (good + bad) / 2; if (yield* is(tried)) good = tried; else bad = tried; } return good; }
  const middle = ([low, high]) => (low + high) / 2, inside = (gap, end) => end + INSIDE * (middle(gap) - end), parts = [], others = [];
  for (const gap of gaps) {
    if (!(yield* is(middle(gap)))) { others.push(gap); continue; }
    const part = [...gap], before = parts[parts.length - 1];
    for (const side of [0, 1]) if (!(yield* is(inside(gap, gap[side])))) part[side] = yield* last(middle(gap), inside(gap, gap[side]));
    if (before?.[1] === part[0]) before[1] = part[1]; else parts.push(part);
  }
  for (const part of parts) for (const gap of others) for (const side of [0, 1]) {
    if (gap[1 - side] === part[side] && (yield* is(inside(gap, part[side])))) part[side] = yield* last(inside(gap, part[side]), middle(gap));
  }
  return parts;
}
