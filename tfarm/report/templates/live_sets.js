// What the charts of the live page draw: rows of numbers by LiveLoop and SampledLoop.
"use strict";
const dB = x => 20 * Math.log10(x), hertz = w => w / (2 * Math.PI), clip = (x, a, b) => Math.min(Math.max(x, a), b);
const RATIOS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5], DISC_RATIOS = [0.02, 0.1, 0.3, 0.6], CROWDED = 0.05; // of the height: lower rays lie on each other
const dampingRatio = ([re, im]) => im ? general(-re / Math.sqrt(re * re + im * im), 4) : "";

// Where a gain is along its axis, 0 to 1, and back: logarithmic away from 0
const stretched = ({ linear }, x) => linear === null ? x : Math.sign(x) * Math.log1p(Math.abs(x) / linear);
const place = (axis, x) => (stretched(axis, x) - stretched(axis, axis.low)) / (stretched(axis, axis.high) - stretched(axis, axis.low));
function gainAt(axis, share, digits = 4) {
  const y = stretched(axis, axis.low) + share * (stretched(axis, axis.high) - stretched(axis, axis.low));
  return +(axis.linear === null ? y : Math.sign(y) * axis.linear * Math.expm1(Math.abs(y))).toPrecision(digits);
}

// Points of L over w: those too near to each other left out, others put in where L turns (`fine`); it begins at the frequency `from`
function curveOf({ w, D, N, at }, fine, from) {
  const rows = [], small = row => { const k = 1 / (1 + row.abs); return [k * row.x, k * row.y]; }, apart = fine ? 2e-5 : 1e-3;
  let branch = 0, last = null;
  const row = (w, a, b, c, d) => {
    const q = a * a + b * b, x = (a * c + b * d) / q, y = (a * d - b * c) / q, sum = Math.max(Math.hypot(a + c, b + d), 1e-300), n = Math.hypot(c, d);
    const abs = Math.max(n / Math.sqrt(q), 1e-12);
    return { w, x, y, abs, dB: dB(abs), angle: degrees([-x, -y]), S: dB(Math.sqrt(q) / sum), T: dB(Math.max(n / sum, 1e-12)) };
  };
  const push = each => {
    if (last && Math.abs(each.angle - last.angle) > 180) branch += 1;
    rows.push(last = Object.assign(each, { branch }));
  };
  for (let i = 0; i < w.length; i++) {
    if (w[i] < from || (last && w[i] < last.w * (1 + apart))) continue;
    const next = row(w[i], D[2 * i], D[2 * i + 1], N[2 * i], N[2 * i + 1]);
    if (last && fine) {
      const start = last.w, steps = Math.min(12, Math.ceil(size(minus(small(next), small(last))) / 0.03));
      for (let k = 1; k < steps; k++) { const q = start + (w[i] - start) * k / steps; push(row(q, ...at(q))); }
    }
    push(next);
  }
  return rows;
}

const circle = (x0, radius) => [...Array(121).keys()].map(t => ({ x: x0 + radius * Math.cos(t * Math.PI / 60), y: radius * Math.sin(t * Math.PI / 60) }));

// Lines of equal damping ratio, in s up to `top` and in z
function rays({ x, y }) {
  return RATIOS.flatMap(ratio => {
    const slope = ratio / Math.sqrt(1 - ratio * ratio), im = Math.min(y[1], -x[0] / slope);
    return im < CROWDED * y[1] ? [] : [{ ratio, re: 0, im: 0, at: 0, end: false }, { ratio, re: -slope * im, im, at: 1, end: true }];
  });
}
function spirals() {
  return DISC_RATIOS.flatMap(ratio => [-1, 1].flatMap(side => [...Array(49).keys()].map(k => {
    const q = Math.PI * k / 48, r = Math.exp(-ratio / Math.sqrt(1 - ratio * ratio) * q);
    return { ratio: side * ratio, re: r * Math.cos(q), im: side * r * Math.sin(q), at: k };
  })));
}

// The curve of gains with a pole on the axis, or on the unit circle: `at(w)` is a point of it; halved where it is coarse, cut where it leaves the map
function edgeOf(at, frequencies, { K1, K2 }) {
  const found = [], placed = row => [place(K1, row.K1), place(K2, row.K2)], seen = ([x, y]) => x > -0.1 && x < 1.1 && y > -0.1 && y < 1.1;
  let piece = 0;
  const trace = (a, b, depth) => {
    if (!a || !b) return;
    const [p, q] = [placed(a), placed(b)], long = size(minus(p, q));
    if (!(seen(p) || seen(q))) return;
    if (long > 0.02 && depth) {
      const middle = at((a.w + b.w) / 2);
      trace(a, middle, depth - 1);
      trace(middle, b, depth - 1);
    } else if (long < 0.2) {
      if (!found.length || found[found.length - 1].w !== a.w) found.push({ ...a, piece: ++piece });
      found.push({ ...b, piece });
    }
  };
  const rows = frequencies.map(at);
  rows.slice(1).forEach((row, i) => trace(rows[i], row, 8));
  return found;
}

// The stable region at one Kp, by intervals of K2 at values of K1 that are halved where a part begins or ends: a generator that yields before each
const SLICES = 80, CLOSER = 5; // values of K1, and halvings between two of them
function* regionOf(loop, Kp, { K1, K2 }) {
  const column = share => { const gain = gainAt(K1, share, 12); return { share, gain, rows: loop.intervals(gain, Kp, K2.low, K2.high) }; };
  const goesOn = (a, b) => a.rows.length === b.rows.length && a.rows.every(([low, high], i) => low < b.rows[i][1] && b.rows[i][0] < high);
  const found = [];
  function* between(a, b, depth) {
    if (!depth || goesOn(a, b)) return;
    yield;
    const middle = column((a.share + b.share) / 2);
    yield* between(a, middle, depth - 1);
    found.push(middle);
    yield* between(middle, b, depth - 1);
  }
  for (let k = 0, last = null; k <= SLICES; k++) {
    yield;
    const next = column((k + 0.003) / (SLICES + 0.006)); // K1 = 0 may be an edge
    if (last) yield* between(last, next, CLOSER);
    found.push(next);
    last = next;
  }
  let part = 0;
  return found.flatMap((each, k) => {
    if (k && !goesOn(found[k - 1], each)) part += 1000;
    return each.rows.map(([low, high], i) => ({ part: part + i, K1: each.gain, low, high }));
  });
}

// Rows of a signal over time: as it is where a screen can show that, else its least and largest value in each pixel
function shownOver(t, y, pixels) {
  if (t.length <= 2 * pixels) return t.map((each, i) => ({ t: each, y: y[i], i }));
  const rows = [], step = Math.ceil(t.length / pixels);
  for (let k = 0; k < t.length; k += step) {
    let low = k, high = k;
    for (let i = k; i < Math.min(k + step, t.length); i++) { if (y[i] < y[low]) low = i; if (y[i] > y[high]) high = i; }
    for (const i of [Math.min(low, high), Math.max(low, high)]) rows.push({ t: t[i], y: y[i], i: rows.length });
  }
  return rows;
}
