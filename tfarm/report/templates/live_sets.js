// What the charts of the live page draw: rows of numbers by LiveLoop and SampledLoop.
"use strict";
const dB = x => 20 * Math.log10(x), hertz = w => w / (2 * Math.PI), clip = (x, a, b) => Math.min(Math.max(x, a), b);
const RATIOS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5], DISC_RATIOS = [0.02, 0.1, 0.3, 0.6], CROWDED = 0.05; // of the height: lower rays lie on each other
const dampingRatio = ([re, im]) => im ? general(-re / Math.sqrt(re * re + im * im), 4) : "";

// What a generator returns, run without a pause
function ended(work) { for (;;) { const { done, value } = work.next(); if (done) return value; } }

// Where a gain is along its axis, 0 to 1, and back: logarithmic away from 0
const stretched = ({ linear }, x) => linear === null ? x : Math.sign(x) * Math.log1p(Math.abs(x) / linear);
const place = (axis, x) => (stretched(axis, x) - stretched(axis, axis.low)) / (stretched(axis, axis.high) - stretched(axis, axis.low));
function gainAt(axis, share, digits = 4) {
  const y = stretched(axis, axis.low) + share * (stretched(axis, axis.high) - stretched(axis, axis.low));
  return +(axis.linear === null ? y : Math.sign(y) * axis.linear * Math.expm1(Math.abs(y))).toPrecision(digits);
}

// Points of L over w from the frequency `from`: more where a chord is off its curve by more than `pixel` of a plot that ends at |L| = `end`,
// or by more than a pixel of dB and degrees of L or 1 + L; fewer where all of them are nearer
const HALVINGS = 8, RELATIVE = 0.015, UNSEEN = 1e-3; // 0.13 dB or 0.9 degrees; below every plot of dB
function curveOf({ w, D, N, at }, pixel, relative, end, from) {
  const rows = [];
  let branch = 0, last = null;
  const place = (w, a, b, c, d) => { const q = a * a + b * b; return { w, x: (a * c + b * d) / q, y: (a * d - b * c) / q }; };
  const allowed = (x, y) => { const abs = Math.sqrt(x * x + y * y); return Math.max(UNSEEN * relative, Math.min(pixel * Math.max(1, abs / end) ** 2, relative * Math.min(abs, Math.sqrt((1 + x) ** 2 + y * y)))); };
  const far = (a, b, x, y) => (a - x) ** 2 + (b - y) ** 2 > allowed(x, y) ** 2;
  const outside = ({ x, y }) => x * x + y * y > 2 * end * end; // seen in plots of dB alone, where a piece of a hundredth of its frequency has no width
  const push = ({ w, x, y }) => {
    const n = Math.sqrt(x * x + y * y), sum = Math.max(Math.sqrt((1 + x) ** 2 + y * y), 1e-300), abs = Math.max(n, 1e-12), angle = degrees([-x, -y]);
    if (last && Math.abs(angle - last.angle) > 180) branch += 1;
    rows.push(last = { w, x, y, abs, dB: dB(abs), angle, S: -dB(sum), T: dB(Math.max(n / sum, 1e-12)), branch });
  };
  const between = (a, b, halvings) => {
    if (!halvings || !far(a.x, a.y, b.x, b.y)) return;
    const q = (a.w + b.w) / 2, middle = place(q, ...at(q));
    if (!far((a.x + b.x) / 2, (a.y + b.y) / 2, middle.x, middle.y) || (b.w < 1.01 * a.w && [a, middle, b].every(outside))) return;
    between(a, middle, halvings - 1);
    push(middle);
    between(middle, b, halvings - 1);
  };
  for (let i = 0; i < w.length; i++) {
    if (w[i] < from) continue;
    const next = place(w[i], D[2 * i], D[2 * i + 1], N[2 * i], N[2 * i + 1]);
    if (last && w[i] < last.w * (1 + 1e-3) && !far(last.x, last.y, next.x, next.y)) continue;
    if (last) between(last, next, HALVINGS);
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

// What the requirements forbid: of L around -1, the disc of Ms, the angles at |L| = 1 and the sizes where L < 0; of poles a damping ratio below the least one
function forbiddenOf({ gain: [least], phase: [angle], peak: [Ms] }) {
  const turn = a => a * Math.PI / 180, angles = [...Array(19).keys()].map(k => -180 + angle * (k - 9) / 9), decibels = [-least, least];
  return {
    disc: circle(-1, 1 / Ms).map(({ x, y }) => ({ x, y, angle: degrees([-x, -y]) - 180, dB: dB(Math.hypot(x, y)) })),
    phase: angles.map(a => ({ x: Math.cos(turn(a)), y: Math.sin(turn(a)), angle: a, dB: 0 })), gain: decibels.map(d => ({ x: -(10 ** (d / 20)), y: 0, angle: -180, dB: d })),
  };
}
function undampedIn({ x, y }, ratio) {
  const slope = ratio / Math.sqrt(1 - ratio * ratio);
  return [[{ re: 0, im: 0 }, { re: -slope * y[1], im: y[1] }, { re: Math.max(x[1], 0), im: y[1] }, { re: Math.max(x[1], 0), im: 0 }]];
}
function undampedOutside(wide, high, ratio) {
  const half = [...Array(49).keys()].map(k => { const q = Math.PI * k / 48, r = Math.exp(-ratio / Math.sqrt(1 - ratio * ratio) * q); return { re: r * Math.cos(q), im: r * Math.sin(q) }; });
  return [[[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => ({ re: a * wide, im: b * high })), [...half, ...half.map(({ re, im }) => ({ re, im: -im })).reverse()]];
}

// The curve of gains with a pole on the axis, or on the unit circle: `at(w)` is a point of it; halved where it is coarse, cut where it leaves the map
function edgeOf(at, frequencies, [across, up], axes) {
  const found = [], placed = row => [place(axes[across], row[across]), place(axes[up], row[up])], seen = ([x, y]) => x > -0.1 && x < 1.1 && y > -0.1 && y < 1.1;
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

// A region of two numbers, by a generator `intervals(x)` of the second at values x of the first, which are halved where a part begins or ends, or an end goes
// farther than `step` of its axis: a generator that yields before each
const SLICES = 80, CLOSER = 5; // values, and halvings between two of them
function* regionOf(intervals, [across, up], axes, step = 1) {
  function* column(share) { yield; const gain = gainAt(axes[across], share, 12); return { share, gain, rows: yield* intervals(gain) }; }
  const goesOn = (a, b) => a.rows.length === b.rows.length && a.rows.every(([low, high], i) => low < b.rows[i][1] && b.rows[i][0] < high);
  const isNear = (a, b) => a.rows.every((row, i) => row.every((end, j) => Math.abs(place(axes[up], end) - place(axes[up], b.rows[i][j])) <= step));
  const found = [];
  function* between(a, b, depth) {
    if (!depth || (goesOn(a, b) && isNear(a, b))) return;
    const middle = yield* column((a.share + b.share) / 2);
    yield* between(a, middle, depth - 1);
    found.push(middle);
    yield* between(middle, b, depth - 1);
  }
  for (let k = 0, last = null; k <= SLICES; k++) {
    const next = yield* column((k + 0.003) / (SLICES + 0.006)); // 0 may be an edge
    if (last) yield* between(last, next, CLOSER);
    found.push(next);
    last = next;
  }
  let part = 0;
  return found.flatMap((each, k) => {
    if (k && !goesOn(found[k - 1], each)) part += 1000;
    return each.rows.map(([low, high], i) => ({ part: part + i, [across]: each.gain, low, high }));
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
