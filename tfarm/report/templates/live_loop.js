// Arithmetic of the live page: the loop of any gains from exact samples of its parts.  Complex numbers are [re, im].
// Each formula is one of tfarm.loop (panels, margins, lines, regions); tests hold the two together.
"use strict";
const POINTS = 24, AT_POLE = 1e-9, LOWEST_DIPS = 6;
const X = [...Array(POINTS).keys()].map(j => Math.cos(Math.PI * (j + 0.5) / POINTS));
const C = X.map((_, j) => (-1) ** j * Math.sin(Math.PI * (j + 0.5) / POINTS));
const add = (a, b) => [a[0] + b[0], a[1] + b[1]], minus = (a, b) => [a[0] - b[0], a[1] - b[1]];
const mul = (a, b) => [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]], times = (k, a) => [k * a[0], k * a[1]];
const size = a => Math.sqrt(a[0] * a[0] + a[1] * a[1]), conj = a => [a[0], -a[1]];
const div = (a, b) => times(1 / (b[0] * b[0] + b[1] * b[1]), mul(a, conj(b)));
const geometric = (a, b, n) => [...Array(n).keys()].map(i => a * (b / a) ** (i / (n - 1)));
const SERIES = X.map((_, k) => X.map((_, j) => (k ? 2 : 1) / POINTS * Math.cos(k * Math.PI * (j + 0.5) / POINTS)));
const AWAY = geometric(0.05, 20, 12); // of the distance of a pole from the axis: where a curve has points near it
const WEIGHTS = new Float64Array(POINTS), degrees = a => Math.atan2(a[1], a[0]) * 180 / Math.PI;

// The zero of f between a and b, where its values fa and fb have opposite signs: Chandrupatla (1997)
function zeroOf(f, a, fa, b, fb) {
  for (let k = 0, t = 0.5, c, fc; k < 120; k++) {
    const x = a + t * (b - a), fx = f(x);
    if (fx > 0 === fa > 0) [c, fc] = [a, fa]; else [c, fc, b, fb] = [b, fb, a, fa];
    [a, fa] = [x, fx];
    const best = Math.abs(fa) < Math.abs(fb) ? a : b, least = 4e-16 * Math.abs(best) / Math.abs(b - c);
    if (!fx || !(least < 0.5)) return best;
    const xi = (a - b) / (c - b), phi = (fa - fb) / (fc - fb), curved = phi * phi < xi && (1 - phi) ** 2 < 1 - xi;
    t = curved ? fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb) : 0.5;
    t = Math.min(Math.max(t, least), 1 - least) || 0.5;
  }
  return (a + b) / 2;
}

// Zeros of f(re D, im D, re N, im N) along a curve of L = N/D: its frequencies w, values at them, and `at` any frequency
function zerosOn({ w, D, N, at }, f) {
  const found = [], value = q => f(...at(q));
  let last = 0, before = f(D[0], D[1], N[0], N[1]);
  for (let i = 1; i < w.length; i++) {
    const after = f(D[2 * i], D[2 * i + 1], N[2 * i], N[2 * i + 1]);
    if (after === 0) continue; // a zero on a point is between its neighbours
    if (before * after < 0) found.push({ w: zeroOf(value, w[last], before, w[i], after), change: before > 0 ? 2 : -2 });
    [before, last] = [after, i];
  }
  return found;
}

// The least value of f between a, where it is finite, and b, by the golden section
function lowestBetween(f, a, b, rounds = 34) {
  const share = (Math.sqrt(5) - 1) / 2;
  let c = b - share * (b - a), d = a + share * (b - a), fc = f(c), fd = f(d);
  for (let k = 0; k < rounds; k++) {
    if (fc <= fd) { b = d; d = c; fd = fc; c = b - share * (b - a); fc = f(c); }
    else { a = c; c = d; fc = fd; d = a + share * (b - a); fd = f(d); }
  }
  return fc < fd ? { value: fc, at: c } : { value: fd, at: d };
}
// The least value of f and where; its lowest dips are refined
function lowestOn({ w, D, N, at }, f) {
  const values = Float64Array.from(w, (_, i) => f(D[2 * i], D[2 * i + 1], N[2 * i], N[2 * i + 1])), dips = [];
  let best = { value: Infinity, at: 0 };
  values.forEach((value, i) => {
    if (value < best.value) best = { value, at: w[i] };
    if (i && i < w.length - 1 && value <= values[i - 1] && value <= values[i + 1]) dips.push(i);
  });
  for (const i of dips.sort((a, b) => values[a] - values[b]).slice(0, LOWEST_DIPS)) {
    const found = lowestBetween(q => f(...at(q)), w[i - 1], w[i + 1]);
    if (found.value < best.value) best = found;
  }
  return best;
}

// Crossings and margins of L but that of the gain; `all`: disk and peak of T too, which the card does not have
const DISTANCES = {
  S: (a, b, c, d) => ((a + c) ** 2 + (b + d) ** 2) / Math.max(a * a + b * b, 1e-300),
  T: (a, b, c, d) => ((a + c) ** 2 + (b + d) ** 2) / Math.max(c * c + d * d, 1e-300),
  disk: (a, b, c, d) => ((a + c) ** 2 + (b + d) ** 2) / Math.max((a - c) ** 2 + (b - d) ** 2, 1e-300),
};
function marginsOn(curve, all) {
  const far = name => { const { value, at } = lowestOn(curve, DISTANCES[name]); return { value: Math.sqrt(value), at }; };
  const minus = ([a, b, c, d]) => degrees([-(a * c + b * d), b * c - a * d]), factor = ([a, b, c, d]) => -(a * c + b * d) / (c * c + d * d);
  const crossed = zerosOn(curve, (a, b, c, d) => Math.log((c * c + d * d) / (a * a + b * b))).map(({ w }) => ({ w, angle: minus(curve.at(w)) }));
  const factors = zerosOn(curve, (a, b, c, d) => b * c - a * d).map(({ w }) => ({ w, factor: factor(curve.at(w)) }));
  const least = (rows, value) => rows.reduce((best, row) => Math.abs(value(row)) < Math.abs(best.value) ? { value: value(row), at: row.w } : best, { value: Infinity, at: 0 });
  const S = far("S"), found = {
    crossed, factors, crossovers: factors.filter(row => row.factor > AT_POLE && row.factor < 1 / AT_POLE),
    phase: least(crossed, row => row.angle), delay: least(crossed, row => (row.angle + 360) % 360 * Math.PI / 180 / row.w),
    peak_sensitivity: { value: Math.max(1, 1 / S.value), at: S.at },
  };
  if (!all) return found;
  const disk = far("disk"), T = far("T"), lead = crossed.filter(row => row.angle < 0);
  return {
    ...found, disk: { value: 2 * disk.value, at: disk.at }, peak_complementary: { value: 1 / T.value, at: T.at },
    phase_lag: least(crossed.filter(row => row.angle > 0), row => row.angle), phase_lead: least(lead, row => -row.angle),
  };
}

// A curve on fixed frequencies w with parts D and rows of N for each gain, and on more of them
function curveOn({ w, D, rows }, gains, more, at) {
  const extra = Float64Array.from(more).sort(), n = w.length + extra.length, curve = { w: new Float64Array(n), D: new Float64Array(2 * n), N: new Float64Array(2 * n), at };
  for (let i = 0, j = 0, k = 0; k < n; k++) {
    if (i < w.length && !(extra[j] < w[i])) {
      curve.w[k] = w[i];
      for (const c of [0, 1]) {
        curve.D[2 * k + c] = D[2 * i + c];
        for (let r = 0; r < gains.length; r++) curve.N[2 * k + c] += gains[r] * rows[r][2 * i + c];
      }
      i += 1;
    } else {
      const found = at(extra[j]);
      curve.w[k] = extra[j++];
      for (const c of [0, 1]) { curve.D[2 * k + c] = found[c]; curve.N[2 * k + c] = found[2 + c]; }
    }
  }
  return curve;
}

class LiveLoop {
  constructor(data) {
    Object.assign(this, data);
    const bytes = Uint8Array.from(atob(data.samples), c => c.charCodeAt(0));
    this.values = new Float64Array(bytes.buffer); // panel, part, point, re and im
    this.count_of_parts = this.values.length / (2 * POINTS * this.low.length);
    this.units_of_law = this.names.map(one => this.unit(one));
    const base = this.grid().map(w => this.at(w)), units = this.units_of_law;
    const all = (part, law) => Float64Array.from(base.flatMap(point => this.parts(point, law)[part]));
    this.base = { w: Float64Array.from(base, point => point.w), D: all(0, units[0]), rows: units.map(unit => all(1, unit)) };
    this.series = []; // by how many zeros at s = 0 are divided out
    this.moments = [data.moments[0] ?? -Infinity, data.moments[1] ?? Infinity];
  }

  unit(one) {
    return Object.fromEntries(this.names.map(name => [name, +(name === one)]));
  }
  sample(panel, part, j) {
    const i = 2 * ((panel * this.count_of_parts + part) * POINTS + j);
    return [this.values[i], this.values[i + 1]];
  }

  // The parts at a real frequency w [rad/s], by the barycentric formula: d, theta and m, or under a law d and what each of its factors adds
  at(w) {
    const p = this.panelOf(w), x = (2 * w - this.low[p] - this.high[p]) / (this.high[p] - this.low[p]), v = this.values;
    let weights = 0, i = 2 * this.count_of_parts * p * POINTS;
    for (let j = 0; j < POINTS; j++) weights += WEIGHTS[j] = C[j] / (x - X[j] || 1e-300);
    const values = [];
    for (let part = 0; part < this.count_of_parts; part++) {
      let re = 0, im = 0;
      for (let j = 0; j < POINTS; j++, i += 2) { re += WEIGHTS[j] * v[i]; im += WEIGHTS[j] * v[i + 1]; }
      values.push([re / weights, im / weights]);
    }
    return { w, values };
  }

  panelOf(w) {
    const p = this.high.findIndex(high => w <= high);
    return p < 0 ? this.high.length - 1 : p;
  }

  // drive s^n d and the sum of each number of the law times its row, a part times a power of s, at s = i w
  parts({ w, values }, law) {
    const raised = ([x, y], power) => power > 1 ? raised([-w * w * x, -w * w * y], power - 2) : power ? [-w * y, w * x] : [x, y];
    let re = 0, im = 0;
    this.names.forEach((name, r) => { const [part, power] = this.rows[r], [x, y] = raised(values[part], power); re += law[name] * x; im += law[name] * y; });
    return [raised(values[0], this.order), [re, im]];
  }

  // Steep places closely, evenly between, slowly below: `tfarm.loop.loop.grid`
  grid() {
    const { places, band } = this, lowest = 1e-6 * Math.min(band, places[0]), below = places.filter(w => w < band);
    const corners = [lowest, ...below, band], away = geometric(1e-10, 0.06, 14);
    const close = places.flatMap(w => away.flatMap(x => [w * (1 - x), w * (1 + x)]));
    const even = corners.slice(1).flatMap((b, i) => [...Array(24).keys()].map(k => corners[i] + (b - corners[i]) * k / 24));
    const all = [...close, ...even, ...geometric(lowest, corners[1], 60)];
    return [...new Set([...all.filter(w => w < band), band])].sort((a, b) => a - b);
  }

  // D and N at w as four numbers
  both(w, law) {
    const [D, N] = this.parts(this.at(w), law);
    return [...D, ...N];
  }
  curve(law, more = []) {
    return curveOn(this.base, this.names.map(name => law[name]), more, w => this.both(w, law));
  }

  // Unstable poles of the band: those of the reference and what crosses the axis on the way, first with Kp = 0
  count(law) {
    if (this.of_law) return this.reference_count + this.crossed(this.reference, law) + this.rests(this.reference, law);
    const from = { ...this.reference, Kp: 0 }, corner = { ...law, Kp: 0 }, loss = this.rate_loss;
    let n = this.reference_count + this.crossed(from, corner) + this.crossed(corner, law);
    const way = corner.K1 - from.K1, t = -(from.K1 + loss) / way;
    if (way && t > 0 && t < 1) n -= Math.sign(way * (this.inertia - (from.K2 + t * (law.K2 - from.K2)) * this.gauged));
    return n + (law.Kp * (law.K1 + loss) < 0 ? 1 : 0);
  }

  // 1 where a real pole becomes unstable at s = 0 on the straight way between two laws, -1 where one becomes stable
  rests(from, to) {
    const [a, , c] = this.both(0, from), [, , e] = this.both(0, to), t = (a + c) / (c - e), near = this.base.w[0];
    if (!(t > 0 && t < 1)) return 0;
    const [, d, , m] = this.both(near, this.between(from, to, t));
    return Math.sign((c - e) * (d + m));
  }
  between(from, to, t) {
    return Object.fromEntries(this.names.map(name => [name, from[name] + t * (to[name] - from[name])]));
  }

  crossed(from, to) {
    return this.crossings(from, to).reduce((n, each) => n + each.change, 0);
  }

  // Where on the straight way between two laws, 0 to 1, a pair of poles crosses the axis, and by how much it changes the count
  crossings(from, to) {
    const way = Object.fromEntries(this.names.map(name => [name, to[name] - from[name]]));
    if (!this.names.some(name => way[name])) return [];
    const { w, D, N } = this.curve(from), along = this.curve(way).N, A = D.map((d, i) => d + N[i]);
    const at = q => { const [a, b, c, d] = this.both(q, from), [, , e, f] = this.both(q, way); return [a + c, b + d, e, f]; };
    const found = zerosOn({ w, D: A, N: along, at }, (a, b, c, d) => b * c - a * d);
    return found.map(each => { const [a, b, c, d] = at(each.w); return { t: -(a * c + b * d) / (c * c + d * d), change: each.change }; }).filter(({ t }) => t > 0 && t < 1);
  }

  // The intervals of the second number of the map from low to high in which no pole of the band is unstable, and beyond it not every mode is driven
  intervals(law, low, high) {
    const [, up] = this.plane, { K1 } = law, from = { ...law, [up]: low }, to = { ...law, [up]: high }, at = t => low + t * (high - low), found = this.crossings(from, to);
    if (this.of_law) { const [a, , c] = this.both(0, from), [, , e] = this.both(0, to), t = (a + c) / (c - e); if (t > 0 && t < 1) found.push({ t, change: this.rests(from, to) }); }
    found.sort((a, b) => a.t - b.t);
    const driven = this.by_sign && this.hub_alone && this.kind === "band", end = driven && K1 + this.rate_loss > 0 ? this.whole : Infinity;
    const rows = [];
    let n = this.count(from), begin = n ? null : 0;
    for (const { t, change } of [...found, { t: 1, change: 0 }]) {
      n += change;
      if (begin !== null && (n || t === 1)) { rows.push([at(begin), Math.min(at(t), end)]); begin = null; }
      else if (begin === null && !n) begin = t;
    }
    return driven && K1 + this.rate_loss < 0 ? [] : rows.filter(([a, b]) => a < b);
  }

  // [verdict, why]; never "stable" for what is not known
  verdict(law, poles) {
    const { K1, K2, Kp } = law, band = `${general(this.band, 5)} rad/s`;
    if (this.kind === "reactive") {
      if (K1 === 0) return ["not stable", "K1 = 0: nothing takes energy"];
      if (K1 < 0) return ["unstable", "C = 0 and K1 < 0: infinitely many modes are driven"];
      if (!(this.moments[0] < K2 && K2 < this.moments[1])) return ["not stable", `K2 is not below ${general(this.moments[1], 5)}`];
      return Kp >= 0 ? ["stable", this.beyond] : ["unstable", "Kp < 0: the hub falls from its angle"];
    }
    if (!this.of_law && K1 + this.rate_loss === 0 && Kp === 0) return ["not stable", "nothing holds the hub: two poles at 0"];
    const seen = poles.filter(s => s[0] > 1e-9 * size(s)).reduce((n, s) => n + (s[1] ? 2 : 1), 0);
    const n = Math.max(this.count(law), seen); // poles that came from beyond the band are seen alone
    if (n > 0) return ["unstable", `${n} unstable pole${n > 1 ? "s" : ""} up to ${band}`];
    if (this.kind === "quiet") return ["stable", this.beyond];
    const takes = this.by_sign ? Math.sign(K1 + this.rate_loss) * Math.sign(1 - K2 / this.whole) : 0;
    if (takes < 0 && this.hub_alone) return ["unstable", "C = 0: every mode beyond the frequency range is driven"];
    return takes > 0 ? ["stable", this.beyond] : ["stable in the frequency range", `no unstable pole up to ${band}; not determined beyond`];
  }

  // L at the base points and at more about each oscillating pole, as close as it is to the axis: `tfarm.loop.margins.dense`
  dense(poles, law) {
    const top = this.band, slow = this.rigidCrossings(law).filter(w => w < this.base.w[0]);
    const close = poles.filter(s => s[1] > 0).flatMap(s => [0, ...AWAY, ...AWAY.map(x => -x)].map(x => s[1] + Math.abs(s[0]) * x));
    return this.curve(law, [...close, ...slow.flatMap(w => [w / 2, w, 2 * w])].filter(w => w > 0 && w < top));
  }

  // Where the rigid arm has |L| = 1: (1 - k^2) w^4 - (2 b k + a^2) w^2 - b^2 = 0, a = K1/J, b = Kp/J
  rigidCrossings(law) {
    const a = law.K1 / this.inertia, b = law.Kp / this.inertia, k = law.K2 * this.gauged / this.inertia;
    const A = 1 - k * k, B = 2 * b * k + a * a, root = Math.sqrt(B * B + 4 * A * b * b);
    return this.rate_loss || this.of_law ? [] : [(B + root) / (2 * A), (B - root) / (2 * A)].filter(q => q > 0).map(Math.sqrt);
  }

  margins(law, curve, all = true) {
    const found = marginsOn(curve, all), [a, b, c, d] = [...curve.D.slice(0, 2), ...curve.N.slice(0, 2)], low = c || d ? times(-1, div([a, b], [c, d])) : [0, 0];
    if (low[0] > AT_POLE && Math.abs(low[1]) < 1e-3 * low[0]) found.crossovers.unshift({ w: 0, factor: low[0] });
    return { ...found, gain: this.gainMargin(law, found.factors.map(row => row.factor)) };
  }

  // The factor on all gains at which a pole is at s = 0
  restOf(law) {
    if (this.of_law) { const [a, , c] = this.both(0, law); return -a / c; }
    return law.Kp ? 0 : law.K1 ? -this.rate_loss / law.K1 : this.rate_loss ? NaN : this.inertia / this.gauged / law.K2;
  }

  // The factors on all gains, below and above 1, at which a pole reaches the axis
  gainMargin(law, factors) {
    const rest = this.restOf(law);
    const edges = this.moments.filter(end => Number.isFinite(end) && law.K2 * end > 0).map(end => end / law.K2);
    const all = [...(this.kind === "reactive" ? edges : factors), rest];
    return [Math.max(0, ...all.filter(t => t >= 0 && t < 1)), Math.min(Infinity, ...all.filter(t => t > 1))];
  }

  // Closed-loop poles s near the axis, up to `top`: every zero of each panel's Chebyshev series, those off its panel left
  // out.  `near`: those of gains close by, from which they are soon found; `enough`: no further panel is searched where more are found
  poles(law, near = null, top = Infinity, enough = Infinity) {
    const found = [], zero = Math.min(this.order, ...this.rows.map(([, power], r) => law[this.names[r]] ? power : 2)), zeros = [];
    this.low.forEach((low, p) => {
      if (low > top || found.length > enough) return;
      const middle = (low + this.high[p]) / 2, half = (this.high[p] - low) / 2, [d, ...rows] = this.seriesOf(p, zero);
      const f = Float64Array.from(d, (x, i) => this.names.reduce((sum, name, r) => sum + law[name] * rows[r][i], x));
      zeros[p] = zerosOfSeries(f, near && near.zeros[p]);
      for (const z of zeros[p]) {
        const s = [-half * z[1], middle + half * z[0]], inside = Math.abs(z[0]) <= 1 && (p > 0 || s[1] > -1e-9 * half);
        if (inside && Math.abs(z[1]) <= 1) found.push([s[0], Math.abs(s[1]) < 1e-9 * half ? 0 : s[1]]);
      }
    });
    const apart = found.sort((a, b) => a[1] - b[1] || b[0] - a[0]).filter((s, i, all) => !i || size(minus(s, all[i - 1])) > 1e-7 * size(s));
    return Object.assign(apart, { zeros });
  }

  // The Chebyshev series of D and of what each gain adds to N, over s^zero, on panel p
  seriesOf(p, zero) {
    const known = this.series[zero] ||= [];
    return known[p] ||= [[0, 0], ...this.names.map((_, r) => [1, r])].map(([part, r]) => {
      const unit = this.units_of_law[r], middle = (this.low[p] + this.high[p]) / 2, half = (this.high[p] - this.low[p]) / 2;
      const f = X.map((x, j) => {
        const w = middle + half * x;
        let value = this.parts({ w, values: [...Array(this.count_of_parts).keys()].map(k => this.sample(p, k, j)) }, unit)[part];
        for (let k = 0; k < zero; k++) value = div(value, [0, w]);
        return value;
      });
      return Float64Array.from(X.flatMap((_, k) => f.reduce((sum, value, j) => add(sum, times(SERIES[k][j], value)), [0, 0])));
    });
  }

  // The two numbers of the map with poles at +- i w: the D-decomposition curve at these others
  boundary(w, law) {
    const point = this.at(w), [D, N] = this.parts(point, { ...law, ...Object.fromEntries(this.plane.map(name => [name, 0])) });
    return { ...gainsOf(add(D, N), this.plane.map(name => [name, this.parts(point, this.units_of_law[this.names.indexOf(name)])[1]])), w };
  }

  // The characteristic function at any s near the axis, from its series: D, and by name what each number of the law adds
  terms([re, im]) {
    const p = this.panelOf(im), half = (this.high[p] - this.low[p]) / 2, z = [(im - this.low[p]) / half - 1, clip(-re / half, -1, 1)];
    const [rest, ...rows] = this.seriesOf(p, 0).map(f => {
      let b = [0, 0], c = [0, 0];
      for (let k = POINTS - 1; k > 0; k--) [b, c] = [add([f[2 * k], f[2 * k + 1]], minus(times(2, mul(z, b)), c)), b];
      return add([f[0], f[1]], minus(mul(z, b), c));
    });
    return { rest, ...Object.fromEntries(this.names.map((name, r) => [name, rows[r]])) };
  }
}

// The numbers k with P + sum k A = 0, by name from [[name, A], ...]: two of a complex equation, and of one number the nearest
function gainsOf(P, [[one, a], [two, b] = []]) {
  const cross = ([p, q], [r, s]) => q * r - p * s;
  return b ? { [one]: -cross(P, b) / cross(a, b), [two]: cross(P, a) / cross(a, b) } : { [one]: -(P[0] * a[0] + P[1] * a[1]) / (a[0] * a[0] + a[1] * a[1]) };
}

// The zeros of a Chebyshev series, cut where it is rounding, by Aberth's iteration (1973)
function zerosOfSeries(f, near = null) {
  const a = X.map((_, k) => [f[2 * k], f[2 * k + 1]]);
  const largest = Math.max(...a.map(size));
  while (a.length > 1 && size(a[a.length - 1]) < 1e-14 * largest) a.pop();
  const n = a.length - 1, warm = near && near.length === n, around = i => [1.25 * Math.cos(0.4 + 2 * Math.PI * i / n), 0.75 * Math.sin(0.4 + 2 * Math.PI * i / n)];
  const z = [...Array(n).keys()].map(i => warm ? near[i] : around(i));
  const settled = z.map(() => false);
  for (let round = 0; round < 80 && settled.includes(false); round++) {
    for (let i = 0; i < n; i++) {
      if (settled[i]) continue;
      const [x, y] = z[i];
      let br = 0, bi = 0, cr = 0, ci = 0, dr = 0, di = 0, er = 0, ei = 0; // b1, b2 and their slopes d1, d2 (Clenshaw)
      for (let k = n; k > 0; k--) {
        const nr = a[k][0] + 2 * (x * br - y * bi) - cr, ni = a[k][1] + 2 * (x * bi + y * br) - ci;
        const sr = 2 * br + 2 * (x * dr - y * di) - er, si = 2 * bi + 2 * (x * di + y * dr) - ei;
        cr = br; ci = bi; br = nr; bi = ni; er = dr; ei = di; dr = sr; di = si;
      }
      const value = [a[0][0] + x * br - y * bi - cr, a[0][1] + x * bi + y * br - ci];
      const slope = [br + x * dr - y * di - er, bi + x * di + y * dr - ei];
      let or = 0, oi = 0;
      for (let k = 0; k < n; k++) if (k !== i) {
        const u = x - z[k][0], v = y - z[k][1], square = u * u + v * v || 1e-300;
        or += u / square; oi -= v / square;
      }
      const step = div(value, minus(slope, mul(value, [or, oi])));
      if (!Number.isFinite(step[0] + step[1])) { settled[i] = true; continue; }
      z[i] = minus(z[i], step);
      settled[i] = size(step) < 1e-13 * (1 + size(z[i]));
    }
  }
  return warm && settled.includes(false) ? zerosOfSeries(f) : z;
}

// A number in a few digits at most, as `tfarm` prints it (Python's format %g)
function general(x, digits) {
  if (!Number.isFinite(x)) return x > 0 ? "inf" : x < 0 ? "-inf" : "nan";
  const power = x === 0 ? 0 : +x.toExponential(digits - 1).split("e")[1];
  if (power >= -4 && power < digits) return String(+x.toPrecision(digits));
  const [head, tail] = x.toExponential(digits - 1).split("e");
  return `${+head}e${tail[0]}${tail.slice(1).padStart(2, "0")}`;
}
if (typeof window !== "undefined") window.LiveLoop = LiveLoop;
