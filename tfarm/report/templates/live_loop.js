// Arithmetic of the live page: the loop of any gains from exact samples of its parts.  Complex numbers are [re, im].
// Each formula is one of tfarm.loop (panels, margins, lines, regions); tests hold the two together.
"use strict";
const POINTS = 24, AT_POLE = 1e-9, LOWEST_DIPS = 6, SHOWN_POLES = 8;
const X = [...Array(POINTS).keys()].map(j => Math.cos(Math.PI * (j + 0.5) / POINTS));
const C = X.map((_, j) => (-1) ** j * Math.sin(Math.PI * (j + 0.5) / POINTS));
const add = (a, b) => [a[0] + b[0], a[1] + b[1]], minus = (a, b) => [a[0] - b[0], a[1] - b[1]];
const mul = (a, b) => [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]], times = (k, a) => [k * a[0], k * a[1]];
const size = a => Math.sqrt(a[0] * a[0] + a[1] * a[1]), conj = a => [a[0], -a[1]];
const div = (a, b) => times(1 / (b[0] * b[0] + b[1] * b[1]), mul(a, conj(b)));
const geometric = (a, b, n) => [...Array(n).keys()].map(i => a * (b / a) ** (i / (n - 1)));
const SERIES = X.map((_, k) => X.map((_, j) => (k ? 2 : 1) / POINTS * Math.cos(k * Math.PI * (j + 0.5) / POINTS)));
const degrees = a => Math.atan2(a[1], a[0]) * 180 / Math.PI;

class LiveLoop {
  constructor(data) {
    Object.assign(this, data);
    const bytes = Uint8Array.from(atob(data.samples), c => c.charCodeAt(0));
    this.values = new Float64Array(bytes.buffer); // panel, part, point, re and im
    this.base = this.grid().map(w => this.at(w));
    this.moments = [data.moments[0] ?? -Infinity, data.moments[1] ?? Infinity];
  }

  sample(panel, part, j) {
    const i = 2 * ((panel * 3 + part) * POINTS + j);
    return [this.values[i], this.values[i + 1]];
  }

  // d, theta and m at a real frequency w [rad/s], by the barycentric formula
  at(w) {
    let p = 0;
    while (p < this.low.length - 1 && w > this.high[p]) p += 1;
    const x = (2 * w - this.low[p] - this.high[p]) / (this.high[p] - this.low[p]), v = this.values;
    let weights = 0, d = 0, e = 0, f = 0, g = 0, h = 0, k = 0, i = 6 * p * POINTS; // one number each: it is asked for thousands of times
    for (let j = 0; j < POINTS; j++, i += 2) {
      const c = C[j] / (x - X[j] || 1e-300);
      weights += c;
      d += c * v[i];
      e += c * v[i + 1];
      f += c * v[i + 2 * POINTS];
      g += c * v[i + 2 * POINTS + 1];
      h += c * v[i + 4 * POINTS];
      k += c * v[i + 4 * POINTS + 1];
    }
    return { w, d: [d / weights, e / weights], theta: [f / weights, g / weights], m: [h / weights, k / weights] };
  }

  // drive s^n d and what the law makes of hub angle and gauge, at s = i w
  parts({ w, d, theta, m }, law) {
    const s = [0, w], s2 = [-w * w, 0];
    const drive = mul(this.order === 2 ? s2 : s, d);
    return [drive, add(mul([law.Kp, law.K1 * w], theta), mul(times(law.K2, s2), m))];
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

  // Zeros of f between neighbours of the points where it changes its sign
  zeros(points, f) {
    const found = [];
    let before = f(points[0]);
    for (let i = 1, last = 0; i < points.length; i++) {
      const after = f(points[i]);
      if (after === 0) continue; // a zero on a point is between its neighbours
      if (before * after < 0) {
        let a = points[last].w, b = points[i].w;
        for (let k = 0; k < 60 && b - a > 2e-16 * b; k++) {
          const middle = (a + b) / 2;
          if (f(this.at(middle)) * before > 0) a = middle; else b = middle;
        }
        found.push({ ...this.at((a + b) / 2), change: before > 0 ? 2 : -2 });
      }
      [before, last] = [after, i];
    }
    return found;
  }

  // Unstable poles of the band: those of the reference and what crosses the axis on the way, first with Kp = 0
  count(law) {
    const from = { ...this.reference, Kp: 0 }, corner = { ...law, Kp: 0 }, loss = this.rate_loss;
    let n = this.reference_count + this.crossed(from, corner) + this.crossed(corner, law);
    const way = corner.K1 - from.K1, t = -(from.K1 + loss) / way;
    if (way && t > 0 && t < 1) n -= Math.sign(way * (this.inertia - (from.K2 + t * (law.K2 - from.K2)) * this.gauged));
    return n + (law.Kp * (law.K1 + loss) < 0 ? 1 : 0);
  }

  crossed(from, to) {
    return this.crossings(from, to).reduce((n, each) => n + each.change, 0);
  }

  // Where on the straight way between two laws, 0 to 1, a pair of poles crosses the axis, and by how much it changes the count
  crossings(from, to) {
    const way = { K1: to.K1 - from.K1, K2: to.K2 - from.K2, Kp: to.Kp - from.Kp };
    if (!(way.K1 || way.K2 || way.Kp)) return [];
    const both = point => { const [drive, N] = this.parts(point, from); return [add(drive, N), this.parts(point, way)[1]]; };
    const h = point => { const [a, b] = both(point); return a[1] * b[0] - a[0] * b[1]; };
    return this.zeros(this.base, h).map(point => ({ t: -div(...both(point))[0], change: point.change })).filter(({ t }) => t > 0 && t < 1);
  }

  // The intervals of K2 from low to high in which no pole of the band is unstable, and beyond it not every mode is driven
  intervals(K1, Kp, low, high) {
    const at = t => low + t * (high - low), from = { K1, K2: low, Kp }, found = this.crossings(from, { K1, K2: high, Kp }).sort((a, b) => a.t - b.t);
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
    if (K1 + this.rate_loss === 0 && Kp === 0) return ["not stable", "nothing holds the hub: two poles at 0"];
    const seen = poles.filter(s => s[0] > 1e-9 * size(s)).reduce((n, s) => n + (s[1] ? 2 : 1), 0);
    const n = Math.max(this.count(law), seen); // poles that came from beyond the band are seen alone
    if (n > 0) return ["unstable", `${n} unstable pole${n > 1 ? "s" : ""} up to ${band}`];
    if (this.kind === "quiet") return ["stable", this.beyond];
    const takes = this.by_sign ? Math.sign(K1 + this.rate_loss) * Math.sign(1 - K2 / this.whole) : 0;
    if (takes < 0 && this.hub_alone) return ["unstable", "C = 0: every mode beyond the frequency range is driven"];
    return takes > 0 ? ["stable", this.beyond] : ["stable in the frequency range", `no unstable pole up to ${band}; not determined beyond`];
  }

  // The base points and more about each oscillating pole, as close as it is to the axis: `tfarm.loop.margins.dense`
  dense(poles, law) {
    const away = geometric(0.05, 20, 12), top = this.band, slow = this.rigidCrossings(law).filter(w => w < this.base[0].w);
    const close = poles.filter(s => s[1] > 0).flatMap(s => [0, ...away, ...away.map(x => -x)].map(x => s[1] + Math.abs(s[0]) * x));
    const more = [...close, ...slow.flatMap(w => [w / 2, w, 2 * w])].filter(w => w > 0 && w < top).map(w => this.at(w));
    const all = [...this.base, ...more].sort((a, b) => a.w - b.w);
    for (const point of all) point.both = this.parts(point, law); // asked for again and again
    return all;
  }

  // Where the rigid arm has |L| = 1: (1 - k^2) w^4 - (2 b k + a^2) w^2 - b^2 = 0, a = K1/J, b = Kp/J
  rigidCrossings(law) {
    const a = law.K1 / this.inertia, b = law.Kp / this.inertia, k = law.K2 * this.gauged / this.inertia;
    const A = 1 - k * k, B = 2 * b * k + a * a, root = Math.sqrt(B * B + 4 * A * b * b);
    return this.rate_loss ? [] : [(B + root) / (2 * A), (B - root) / (2 * A)].filter(q => q > 0).map(Math.sqrt);
  }

  margins(law, points) {
    const both = point => point.both || this.parts(point, law);
    const L = point => { const [D, N] = both(point); return div(N, D); };
    const logsize = point => { const [D, N] = both(point); return Math.log(size(N) / size(D)); };
    const crossed = this.zeros(points, logsize).map(point => ({ w: point.w, angle: degrees(times(-1, L(point))) }));
    const least = (rows, value) => rows.reduce((best, row) => Math.abs(value(row)) < Math.abs(best.value) ? { value: value(row), at: row.w } : best, { value: Infinity, at: 0 });
    const real = this.zeros(points, point => { const [D, N] = both(point); return D[1] * N[0] - D[0] * N[1]; });
    const factors = real.map(point => { const [D, N] = both(point); return { w: point.w, factor: -div(D, N)[0] }; });
    const ratio = (above, below) => point => { const [D, N] = both(point); return size(above(D, N)) / Math.max(size(below(D, N)), 1e-300); };
    const disk = this.lowest(points, ratio(add, minus)), S = this.lowest(points, ratio(add, D => D)), T = this.lowest(points, ratio(add, (_, N) => N));
    const crossovers = factors.filter(row => row.factor > AT_POLE && row.factor < 1 / AT_POLE);
    const [D, N] = both(points[0]), low = size(N) ? times(-1, div(D, N)) : [0, 0];
    if (low[0] > AT_POLE && Math.abs(low[1]) < 1e-3 * low[0]) crossovers.unshift({ w: 0, factor: low[0] });
    return {
      gain: this.gainMargin(law, factors.map(row => row.factor)), crossed, crossovers,
      phase: least(crossed, row => row.angle), phase_lag: least(crossed.filter(row => row.angle > 0), row => row.angle),
      phase_lead: least(crossed.filter(row => row.angle < 0), row => -row.angle),
      delay: least(crossed, row => (row.angle + 360) % 360 * Math.PI / 180 / row.w),
      disk: { value: 2 * disk.value, at: disk.at }, peak_sensitivity: { value: Math.max(1, 1 / S.value), at: S.at },
      peak_complementary: { value: 1 / T.value, at: T.at },
    };
  }

  // The factors on all gains, below and above 1, at which a pole reaches the axis
  gainMargin(law, factors) {
    const rest = law.Kp ? 0 : law.K1 ? -this.rate_loss / law.K1 : this.rate_loss ? NaN : this.inertia / this.gauged / law.K2;
    const edges = this.moments.filter(end => Number.isFinite(end) && law.K2 * end > 0).map(end => end / law.K2);
    const all = [...(this.kind === "reactive" ? edges : factors), rest];
    return [Math.max(0, ...all.filter(t => t >= 0 && t < 1)), Math.min(Infinity, ...all.filter(t => t > 1))];
  }

  // The least value of f and where; its lowest dips refined by the golden section
  lowest(points, f) {
    const values = points.map(f), dips = [];
    let best = { value: Infinity, at: 0 };
    values.forEach((value, i) => {
      if (value < best.value) best = { value, at: points[i].w };
      if (i && i < values.length - 1 && value <= values[i - 1] && value <= values[i + 1]) dips.push(i);
    });
    for (const i of dips.sort((a, b) => values[a] - values[b]).slice(0, LOWEST_DIPS)) {
      const share = (Math.sqrt(5) - 1) / 2;
      let a = points[i - 1].w, b = points[i + 1].w, c = b - share * (b - a), d = a + share * (b - a);
      let fc = f(this.at(c)), fd = f(this.at(d));
      for (let k = 0; k < 34; k++) {
        if (fc < fd) { b = d; d = c; fd = fc; c = b - share * (b - a); fc = f(this.at(c)); }
        else { a = c; c = d; fc = fd; d = a + share * (b - a); fd = f(this.at(d)); }
      }
      if (Math.min(fc, fd) < best.value) best = { value: Math.min(fc, fd), at: fc < fd ? c : d };
    }
    return best;
  }

  // Closed-loop poles s near the axis, up to `top`: every zero of each panel's Chebyshev series, those off its panel left
  // out.  `near`: those of gains close by, from which they are soon found
  poles(law, near = null, top = Infinity) {
    const found = [], zero = law.Kp ? 0 : law.K1 || this.rate_loss ? 1 : 2, zeros = [];
    this.low.forEach((low, p) => {
      if (low > top) return;
      const middle = (low + this.high[p]) / 2, half = (this.high[p] - low) / 2;
      const f = X.map((x, j) => {
        const w = middle + half * x, point = { w, d: this.sample(p, 0, j), theta: this.sample(p, 1, j), m: this.sample(p, 2, j) };
        let value = add(...this.parts(point, law));
        for (let k = 0; k < zero; k++) value = div(value, [0, w]);
        return value;
      });
      zeros[p] = zerosOfSeries(f, near && near.zeros[p]);
      for (const z of zeros[p]) {
        const s = [-half * z[1], middle + half * z[0]], inside = Math.abs(z[0]) <= 1 && (p > 0 || s[1] > -1e-9 * half);
        if (inside && Math.abs(z[1]) <= 1) found.push([s[0], Math.abs(s[1]) < 1e-9 * half ? 0 : s[1]]);
      }
    });
    const apart = found.sort((a, b) => a[1] - b[1] || b[0] - a[0]).filter((s, i, all) => !i || size(minus(s, all[i - 1])) > 1e-7 * size(s));
    return Object.assign(apart, { zeros });
  }

  // K1, K2 with poles at +- i w: the D-decomposition curve at this Kp
  boundary(point, law) {
    const cross = (a, b) => a[1] * b[0] - a[0] * b[1], [D, N] = this.parts(point, { K1: 0, K2: 0, Kp: law.Kp }), P = add(D, N);
    const a = this.parts(point, { K1: 1, K2: 0, Kp: 0 })[1], b = this.parts(point, { K1: 0, K2: 1, Kp: 0 })[1], det = cross(a, b);
    return { K1: -cross(P, b) / det, K2: cross(P, a) / det, w: point.w };
  }
}

// The zeros of the polynomial through f at X, by Aberth's iteration (1973) on its Chebyshev series, cut where it is rounding
function zerosOfSeries(f, near = null) {
  const a = X.map((_, k) => f.reduce((sum, value, j) => add(sum, times(SERIES[k][j], value)), [0, 0]));
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
