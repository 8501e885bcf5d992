// The sampled loop of any gains, and its slew, from the poles and residues of the modal plant: tfarm.dsp.plant, loop, simulate.
"use strict";
const MOST_STEPS = 2000, ENTERS = [0.05, 0.02]; // of a search of the delay; where a pole begins that came from z = 0
const FAINT = 0.2; // a pole nearer to z = 0 decides nothing, and where many gather there none is distinct
const doubles = packed => new Float64Array(Uint8Array.from(atob(packed), c => c.charCodeAt(0)).buffer);
const exp = a => times(Math.exp(a[0]), [Math.cos(a[1]), Math.sin(a[1])]), pair = (v, i) => [v[2 * i], v[2 * i + 1]];
// (e^{pt} - 1)/p, without loss where p t is small
function held(p, t) {
  const [x, y] = times(t, p), half = Math.sin(y / 2);
  return p[0] || p[1] ? div([Math.expm1(x) * Math.cos(y) - 2 * half * half, Math.exp(x) * Math.sin(y)], p) : [t, 0];
}

class SampledLoop {
  constructor(data) {
    Object.assign(this, data);
    const p = doubles(data.eigenvalues), r = doubles(data.residues), m = p.length / 2;
    this.p = [...Array(m).keys()].map(i => pair(p, i)).concat([[0, 0]]); // s = 0 is the last one
    this.b = this.p.map(each => exp(times(this.period, each)));
    this.residues = this.rigid.map(([, once], o) => [...r.slice(2 * m * o, 2 * m * (o + 1)), once, 0]);
    const a = this.smoothing, plain = { g: 1, zeros: [], poles: [] }, rate = a === null ? { row: 1 } : { row: 0, g: (1 - a) / this.period, zeros: [[0, 0]], poles: [[a - 1, 0]] };
    this.columns ||= [{ ...plain, name: "Kp", row: 0 }, { ...plain, name: "K2", row: 2 }, { ...plain, name: "K1", ...rate }];
    this.names = this.columns.map(column => column.name);
    this.hold(this.delay, this.fraction);
  }

  // A zero-order hold that acts `delay` samples and the share f of another one late
  hold(delay, f) {
    const T = this.period, early = this.p.map(each => held(each, (1 - f) * T)), late = this.p.map(each => mul(exp(times((1 - f) * T, each)), held(each, f * T)));
    const flat = { b: this.b.flat(), early: early.flat(), late: late.flat() };
    return Object.assign(this, { delay, fraction: f, early, late, flat, ramps: [(1 - f) ** 2 * T * T / 2, f * (1 - f / 2) * T * T] });
  }

  later(samples) {
    const total = this.delay + this.fraction + samples;
    return Object.create(this).hold(Math.floor(total), total % 1);
  }
  // The least further delay [samples] that destabilises a stable loop of these poles: tfarm.loop.edges.delay_margin.
  // `is_bound` where none up to `most` does; NaN where its poles are not determined.  It yields before each step
  *delayMargin(law, poles, most) {
    const worst = poles => Math.max(...poles.map(({ growth }) => growth)), step = this.delayStep(law), end = Math.min(most, MOST_STEPS * step);
    for (let low = 0, near = poles, k = 1; low < end; k++) {
      yield;
      const high = Math.min(k * step, end), later = this.later(high).poles(law, near, 1e-5);
      if (!later) return { samples: NaN };
      const growth = more => { const found = this.later(more).poles(law, near, 1e-5); return found ? worst(found) : NaN; };
      if (worst(later) >= 0) return { samples: zeroOf(growth, low, worst(near), high, worst(later)) };
      [low, near] = [high, later];
    }
    return { samples: end, is_bound: true };
  }
  // A tenth of a sample, or the twelfth of a turn of the fastest mode that the feedback may destabilise
  delayStep(law) {
    const T = this.period, at = this.p.map(([, y]) => minus(exp([0, y * T]), [1, 0]));
    const push = i => this.columns.reduce((sum, { name, row, g, zeros, poles }) => sum + size(times(law[name] * g, mul(this.filtered({ zeros, poles }, at[i])[0], pair(this.residues[row], i)))), 0);
    const fastest = this.p.reduce((most, p, i) => p[1] > 0 && 4 * push(i) * size(held(p, T)) > -p[0] * T ? Math.max(most, p[1] * T) : most, Math.PI / 4);
    return Math.min(0.1, 2 * Math.PI / fastest / 12);
  }

  // What the law makes of each output: residues and static parts of their weighted sum, and apart those times a block of the law with
  // states, g prod(delta - zeros)/prod(delta - poles), delta = z - 1; the hub rate is such a one where it is a difference
  weighted(law) {
    const sum = of => Float64Array.from({ length: 2 * this.b.length }, (_, i) => of.reduce((total, K, o) => total + K * this.residues[o][i], 0));
    const real = (of, values) => of.reduce((total, K, o) => total + K * values[o], 0), twice = this.rigid.map(row => row[0]);
    const make = of => ({ r: sum(of), static: real(of, this.static), twice: real(of, twice) }), gains = this.rigid.map(() => 0), blocks = [];
    for (const { name, row, g, zeros, poles } of this.columns) {
      if (!zeros.length && !poles.length) gains[row] += law[name] * g;
      else if (law[name]) blocks.push({ ...make(this.rigid.map((_, o) => o === row ? law[name] * g : 0)), zeros, poles });
    }
    return [...(gains.some(K => K) || !blocks.length ? [{ ...make(gains), zeros: [], poles: [] }] : []), ...blocks];
  }

  // A block and its slope at delta
  filtered({ zeros, poles }, delta) {
    let value = [1, 0], slope = [0, 0];
    for (const zero of zeros) { const away = minus(delta, zero); slope = add(mul(slope, away), value); value = mul(value, away); }
    for (const pole of poles) { const away = minus(delta, pole); value = div(value, away); slope = div(minus(slope, value), away); }
    return [value, slope];
  }

  // H and H' of one weighted sum at z = b[base] + offset, the share of the pole `base` times the offset apart
  transfer({ r, static: rest, twice }, z, base, offset) {
    const inverse = div([1, 0], z), square = mul(inverse, inverse);
    const { b, early, late } = this.flat, [zr, zi] = z, [ur, ui] = inverse, [vr, vi] = square;
    let [xr, xi] = times(rest, inverse), [yr, yi] = times(-rest, square), own = [0, 0], ownSlope = [0, 0];
    for (let i = 0; i < r.length; i += 2) { // real numbers, for it is asked for thousands of times
      const pr = early[i] + late[i] * ur - late[i + 1] * ui, pi = early[i + 1] + late[i] * ui + late[i + 1] * ur;
      const tr = late[i + 1] * vi - late[i] * vr, ti = -late[i] * vi - late[i + 1] * vr;
      const ar = r[i] * pr - r[i + 1] * pi, ai = r[i] * pi + r[i + 1] * pr, cr = r[i] * tr - r[i + 1] * ti, ci = r[i] * ti + r[i + 1] * tr;
      if (i === 2 * base) { own = [ar, ai]; ownSlope = [cr, ci]; continue; }
      const dx = zr - b[i], dy = zi - b[i + 1], q = 1 / (dx * dx + dy * dy), gr = dx * q, gi = -dy * q;
      const sr = ar * gr - ai * gi, si = ar * gi + ai * gr, er = cr - sr, ei = ci - si;
      xr += sr; xi += si;
      yr += er * gr - ei * gi; yi += er * gi + ei * gr;
    }
    let value = [xr, xi], slope = [yr, yi];
    if (twice) { // T push/(z - 1)^2 + ramp/(z - 1), push and ramp of s = 0
      const i = this.b.length - 1, gap = div([1, 0], base === i ? offset : minus(z, [1, 0])), T = this.period;
      const push = add(times(T, this.early[i]), times(T, mul(this.late[i], inverse))), ramp = add([this.ramps[0], 0], times(this.ramps[1], inverse));
      const pushed = times(-T, mul(this.late[i], square)), ramped = times(-this.ramps[1], square), inner = add(mul(push, gap), ramp);
      value = add(value, times(twice, mul(inner, gap)));
      slope = add(slope, times(twice, minus(mul(add(minus(mul(pushed, gap), mul(push, mul(gap, gap))), ramped), gap), mul(inner, mul(gap, gap)))));
    }
    return [value, slope, own, ownSlope];
  }

  // g = offset F and g' at z = b[base] + offset, F = 1 + gains . H, without loss however small the offset
  characteristic(weights, z, base, offset) {
    let value = [0, 0], slope = [0, 0], own = [0, 0], ownSlope = [0, 0];
    for (const each of weights) {
      const [h, hs, o, os] = this.transfer(each, z, base, offset), [c, steep] = this.filtered(each, base === this.b.length - 1 ? offset : minus(z, [1, 0]));
      [value, slope] = [add(value, mul(h, c)), add(slope, add(mul(hs, c), mul(h, steep)))];
      [own, ownSlope] = [add(own, mul(o, c)), add(ownSlope, add(mul(os, c), mul(o, steep)))];
    }
    const late = this.delay ? exp(times(-this.delay, [Math.log(size(z)), Math.atan2(z[1], z[0])])) : [1, 0], n = times(-this.delay, div(late, z));
    [slope, ownSlope] = [add(mul(slope, late), mul(value, n)), add(mul(ownSlope, late), mul(own, n))];
    [value, own] = [mul(value, late), mul(own, late)];
    const whole = add([1, 0], value);
    return [add(mul(offset, whole), own), add(add(whole, mul(offset, slope)), ownSlope)];
  }

  // Every closed-loop pole with ln|z|, z = 1 of a free angle left out, `near` being those of gains close by; null if not all are had
  poles(law, near = null, exact = 1e-13) {
    return (near && (this.iterated(law, near, 0, exact) || this.iterated(law, near, 0.02, exact))) || this.iterated(law, null, 0.02, exact) || this.iterated(law, null, 0.3, exact);
  }

  // Aberth's iteration (1973) on F times its poles, from `near` or from all poles of the plant, moved by `away`
  iterated(law, near, away, exact) {
    const last = this.b.length - 1, ones = this.ones ?? Math.max(0, this.states - (law.Kp ? 0 : 1)), weights = this.weighted(law);
    const at = this.b.map((b, i) => ({ b, n: i === last ? ones : 1 })).filter(each => each.n > 0);
    const others = [{ b: [0, 0], n: this.delay + 1 }, ...weights.flatMap(each => each.poles.map(pole => ({ b: add([1, 0], pole), n: 1 }))).filter(({ b }) => size(b))];
    const plant = [...at, ...others].flatMap(({ b, n }) => Array(n).fill(b)), gone = near ? plant.length - near.length : 0;
    if (gone < 0 || gone > 1) return null;
    const starts = near ? [...near.map(each => each.z), ...Array(gone).fill(ENTERS)] : plant; // a pole more where the delay is a sample more
    const z = starts.map((b, i) => add(b, times(away, [Math.cos(2.4 * i), Math.sin(2.4 * i)])));
    const roots = z.map(each => this.based(each));
    const settled = roots.map(() => false), all = [...at, ...others];
    const total = this.sumOfPoles(law, all), isWhole = () => size(minus(roots.reduce((sum, root) => add(sum, root.z), [0, 0]), total)) <= FAINT / 4;
    const waits = () => roots.some((root, i) => !settled[i] && size(root.z) > FAINT) || !isWhole();
    for (let round = 0; round < 120 && settled.includes(false) && (waits() || (!near && round < 30)); round++) roots.forEach((root, i) => {
      if (settled[i]) return;
      if (size(root.z) < 1e-6) { settled[i] = true; return; } // it decides nothing
      const [g, slope] = this.characteristic(weights, root.z, root.base, root.offset);
      if (!(g[0] || g[1])) { settled[i] = true; return; }
      const sum = div(slope, g), own = this.b[root.base];
      for (const { b, n } of all) {
        const mine = b === own ? n - 1 : n, x = b === own ? root.offset[0] : root.z[0] - b[0], y = b === own ? root.offset[1] : root.z[1] - b[1], q = mine / (x * x + y * y);
        if (mine) { sum[0] += x * q; sum[1] -= y * q; }
      }
      for (let k = 0; k < roots.length; k++) if (k !== i) {
        const other = roots[k], [u, v] = root.base === other.base ? [root.offset, other.offset] : [root.z, other.z];
        const x = u[0] - v[0], y = u[1] - v[1], q = x * x + y * y;
        if (q) { sum[0] -= x / q; sum[1] += y / q; }
      }
      const step = div([1, 0], sum);
      if (!Number.isFinite(step[0] + step[1])) { settled[i] = true; return; }
      settled[i] = size(step) < exact * size(root.offset) || size(step) < 1e-60;
      root.offset = minus(root.offset, step);
      root.z = add(this.b[root.base], root.offset);
      const better = this.based(root.z);
      if (better.base !== root.base && size(better.offset) < 0.5 * size(root.offset)) Object.assign(root, better);
    });
    const bright = roots.every((root, i) => settled[i] || size(root.z) < FAINT);
    if (!bright || !isWhole()) return null;
    return roots.map(({ z, base, offset }) => ({ z, growth: this.growth(base, offset, z) }));
  }

  // L at z, delta = z - 1, far from poles of the plant
  at(z, delta, weights) {
    const value = weights.reduce((sum, each) => add(sum, mul(this.transfer(each, z, -1, z)[0], this.filtered(each, delta)[0])), [0, 0]), angle = -this.delay * Math.atan2(z[1], z[0]);
    return mul(value, times(size(z) ** -this.delay, [Math.cos(angle), Math.sin(angle)]));
  }
  // The same at z = e^{iq} as D and N, D = 1
  both(q, weights) {
    const z = [Math.cos(q), Math.sin(q)];
    return [1, 0, ...this.at(z, [-2 * Math.sin(q / 2) ** 2, z[1]], weights)];
  }
  // 1 + L at z as 1, and by name what each number of the law adds
  terms(z) {
    return { rest: [1, 0], ...Object.fromEntries(this.names.map(name => [name, this.at(z, minus(z, [1, 0]), this.weighted(this.unit(name)))])) };
  }
  unit(one) {
    return Object.fromEntries(this.names.map(name => [name, +(name === one)]));
  }
  // What each gain adds to L at angles q near every pole of the plant
  get base() {
    const close = this.p.flatMap(([x, y], i) => {
      const at = Math.abs(Math.atan2(this.b[i][1], this.b[i][0])), away = geometric(Math.max(-0.02 * x * this.period, 1e-6), Math.PI, 30);
      return y < 0 || size(this.b[i]) < 1e-2 ? [] : [at, ...away.flatMap(x => [at - x, at + x])];
    });
    const w = Float64Array.from(new Set([...close.filter(q => q > 1e-6 && q < Math.PI), Math.PI])).sort();
    const rows = this.names.map(one => {
      const weights = this.weighted(this.unit(one));
      return Float64Array.from([...w].flatMap(q => this.both(q, weights).slice(2)));
    });
    Object.defineProperty(this, "base", { value: { w, D: Float64Array.from([...w].flatMap(() => [1, 0])), rows } });
    return this.base;
  }
  curve(law, poles) {
    const weights = this.weighted(law), at = q => this.both(q, weights);
    const close = poles.flatMap(({ z, growth }) => z[1] > 0 ? [0, ...AWAY, ...AWAY.map(x => -x)].map(x => Math.atan2(z[1], z[0]) + Math.abs(growth) * x) : []);
    return curveOn(this.base, this.names.map(name => law[name]), close.filter(q => q > 1e-6 && q < Math.PI), at);
  }
  // Margins, w in rad/s; `rest` is the factor at which a pole at z = 1 ends stability
  margins(law, curve, rest) {
    const found = marginsOn(curve, false), [, , last] = curve.at(Math.PI), all = [...found.factors.map(row => row.factor), -1 / last, rest], T = this.period;
    const at = row => ({ ...row, at: row.at / T });
    return {
      ...found, phase: at(found.phase), peak_sensitivity: at(found.peak_sensitivity),
      gain: [Math.max(0, ...all.filter(t => t >= 0 && t < 1)), Math.min(Infinity, ...all.filter(t => t > 1))],
    };
  }

  // The poles in s, each at the frequency nearest to that of the mode whose pole in z is nearest: tfarm.assessment.card
  unaliased(poles) {
    const oscillates = ([x, y]) => y > 1e-9 * Math.abs(x) || (x < 0 && y > 1e-9 * x); // a negative z at half the sampling rate
    return poles.filter(({ z }) => oscillates(z)).map(({ z, growth }) => {
      const q = Math.atan2(Math.abs(z[1]), z[0]), own = size(this.p[this.based(z).base]) * this.period || q;
      const [a, b] = [1, -1].map(side => Math.abs(side * q + 2 * Math.PI * Math.round((own - side * q) / (2 * Math.PI))));
      return [growth / this.period, (Math.abs(a - own) <= Math.abs(b - own) ? a : b) / this.period];
    });
  }

  // What all poles add up to, by the two highest powers of z in F times its poles: none is missing then
  sumOfPoles(law, all) {
    const sum = all.reduce((total, { b, n }) => add(total, times(n, b)), [0, 0]);
    if (this.delay) return sum;
    const first = this.rigid.map(([twice], o) => {
      const residues = this.residues[o];
      let total = this.static[o] + twice * this.ramps[0];
      for (let i = 0; i < this.b.length; i++) total += residues[2 * i] * this.early[i][0] - residues[2 * i + 1] * this.early[i][1];
      return total;
    });
    return minus(sum, [this.columns.reduce((total, { name, row, g, zeros, poles }) => total + (zeros.length === poles.length ? law[name] * g * first[row] : 0), 0), 0]);
  }

  // z as an offset from the pole of the plant that is nearest
  based(z) {
    let base = 0;
    this.b.forEach((b, i) => { if (size(minus(z, b)) < size(minus(z, this.b[base]))) base = i; });
    return { z, base, offset: minus(z, this.b[base]) };
  }

  // ln|z|, resolved below the last bit of 1
  growth(base, offset, z) {
    if (size(this.b[base]) < 0.2) return Math.log(Math.max(size(z), 1e-300));
    const ratio = div(offset, this.b[base]);
    return this.p[base][0] * this.period + Math.log1p(2 * ratio[0] + ratio[0] ** 2 + ratio[1] ** 2) / 2;
  }
}

// The slew under any gains, as `tfarm simulate` makes it: exact steps of the modal amplitudes, converters and all
class Slew {
  constructor(data) {
    Object.assign(this, data);
    const p = doubles(data.eigenvalues), m = p.length / 2;
    this.m = m;
    this.p = [...Array(m).keys()].map(i => pair(p, i));
    this.w = doubles(data.residues);
    this.ideal = doubles(data.ideal);
    this.n = this.ideal.length / 5;
    this.shapes = doubles(data.shapes);
    this.early = this.steps((1 - this.fraction) * this.period);
    this.late = this.steps(this.fraction * this.period);
  }

  // e^{pt} and (e^{pt} - 1)/p of every pole, one after the other
  steps(t) {
    const found = { t, turn: new Float64Array(2 * this.m), push: new Float64Array(2 * this.m) };
    this.p.forEach((p, i) => { found.turn.set(exp(times(t, p)), 2 * i); found.push.set(held(p, t), 2 * i); });
    return found;
  }

  advance(a, rigid, { t, turn, push }, u) {
    for (let i = 0; i < a.length; i += 2) {
      const re = turn[i] * a[i] - turn[i + 1] * a[i + 1] + push[i] * u, im = turn[i] * a[i + 1] + turn[i + 1] * a[i] + push[i + 1] * u;
      a[i] = re;
      a[i + 1] = im;
    }
    rigid[0] += t * rigid[1] + t * t * u / 2;
    rigid[1] += t * u;
  }

  // Output number o under the torque u that acts
  read(o, a, rigid, u) {
    let value = this.rigid[o][0] * rigid[0] + this.rigid[o][1] * rigid[1] + this.static[o] * u;
    for (let i = 0, k = 2 * o * this.m; i < a.length; i += 2) value += this.w[k + i] * a[i] - this.w[k + i + 1] * a[i + 1];
    return value;
  }

  quantise(x, row) {
    const [step, low, high] = this.converters[row], even = q => q - Math.floor(q) === 0.5 ? 2 * Math.round(q / 2) : Math.round(q);
    const near = step ? even(x / step) * step : x; // halves to the even step, as IEEE has it
    return Math.min(Math.max(near, low ?? -Infinity), high ?? Infinity);
  }

  // u = r + Kp (theta_ref - theta) + K1 (theta_t_ref - theta_t) - K2 (M - M_ref)
  torque({ K1, K2, Kp }, k, angle, rate, moment) {
    const f = this.single ? Math.fround : x => x, [r, theta, speed, wanted] = [0, 1, 2, 3].map(i => f(this.ideal[5 * k + i]));
    const servo = f(f(r + f(f(Kp) * f(theta - f(angle)))) + f(f(K1) * f(speed - f(rate))));
    return f(servo - f(f(K2) * f(f(moment) - wanted)));
  }

  // All samples: amplitudes, rigid motion and torques at each; it stops where the arm is folded up
  run(law) {
    const { n, m, delay } = this, a = new Float64Array(2 * m), rigid = [0, 0], u = new Float64Array(n), late = k => k < 0 ? 0 : u[k];
    const found = { amplitudes: new Float64Array(2 * m * n), rigid: [], torque: u, moment: [], angle: [], tip: [], n, stopped: null };
    let before = 0, rate = 0;
    for (let k = 0; k < n; k++) {
      const acting = late(k - delay - 1), [theta, speed, M] = [0, 1, 2].map(o => this.read(o, a, rigid, acting));
      if (!(Math.abs(M) <= this.bound)) { found.n = k; found.stopped = k * this.period; break; }
      found.amplitudes.set(a, 2 * m * k);
      found.rigid.push([...rigid]);
      [found.angle, found.moment, found.tip].forEach((list, i) => list.push(this.read([3, 5, 6][i], a, rigid, acting)));
      const angle = this.quantise(theta, 0), moment = this.quantise(M, 1), s = this.smoothing;
      rate = s === null ? speed : s * rate + (1 - s) * (angle - (k ? before : angle)) / this.period;
      before = angle;
      u[k] = this.quantise(this.torque(law, k, angle, rate, moment), 2);
      if (this.fraction) this.advance(a, rigid, this.late, acting);
      this.advance(a, rigid, this.early, late(k - delay));
    }
    return found;
  }

  // Root moment and torque at their largest, what rings on after the slew, and when it is settled: tfarm.dsp.results
  figures({ moment, torque, n, stopped }) {
    const largest = list => list.reduce((top, x) => Math.max(top, Math.abs(x)), 0), T = this.period, top = largest(moment);
    const after = moment.map((x, k) => x - this.ideal[5 * k + 4]).filter((_, k) => k * T >= this.rise * (1 - 1e-12));
    const tail = moment.slice(0, n).filter((_, k) => 10 * k >= 9 * (n - 1)), final = tail.reduce((sum, x) => sum + x, 0) / tail.length;
    const away = moment.slice(0, n).map(x => Math.abs(x - final)), band = 0.02 * largest(away);
    let last = n - 1;
    while (last >= 0 && !(away[last] > band)) last -= 1;
    const first = last + 1, settled = stopped !== null || (first > 0 && 10 * (n - 1 - first) < n - 1) ? Infinity : Math.max(0, first * T - this.rise);
    return { moment: top, torque: largest(torque.slice(0, n)), final, band, residual: stopped === null ? Math.sqrt(after.reduce((sum, x) => sum + x * x, 0) / after.length) : null, settled };
  }

  // The state at any time t [s]: amplitudes, rigid motion, and the torque that acts
  at(found, t) {
    const k = Math.min(Math.max(Math.floor(t / this.period), 0), found.n - 1), late = this.fraction * this.period, rest = t - k * this.period;
    const a = found.amplitudes.slice(2 * this.m * k, 2 * this.m * (k + 1)), rigid = [...found.rigid[k]], held = j => j < 0 ? 0 : found.torque[j];
    const before = Math.min(rest, late), after = rest - before;
    if (before > 0) this.advance(a, rigid, this.steps(before), held(k - this.delay - 1));
    if (after > 0) this.advance(a, rigid, this.steps(after), held(k - this.delay));
    return { a, rigid, u: rest > late ? held(k - this.delay) : held(k - this.delay - 1), k };
  }

  // The fastest mode [rad/s] that rings with a hundredth of the root moment's range: amplitudes about their rest u/p
  fastest({ amplitudes, torque, moment, n }) {
    const range = Math.max(...moment) - Math.min(...moment);
    let top = 0;
    this.p.forEach((p, j) => {
      const weight = size(pair(this.w, 5 * this.m + j));
      let ring = 0;
      for (let k = 0; k < n; k++) ring = Math.max(ring, size(add(pair(amplitudes, k * this.m + j), div([torque[k], 0], p))));
      if (p[1] > -p[0] && 2 * ring * weight > range / 100) top = Math.max(top, p[1]);
    });
    return top;
  }

  // Hub angle, root moment and tip (less that of a rigid arm at its reference) at the samples and `between` times in each
  traces(found, between) {
    const t = [], angle = [], moment = [], tip = [], pieces = [], T = this.period, late = this.fraction * T;
    const ends = [...Array(between).keys()].map(i => T * (i + 1) / (between + 1));
    for (const end of [...new Set([...ends, late])].filter(x => x > 0).sort((a, b) => a - b)) {
      const from = pieces.length ? pieces[pieces.length - 1].end : 0;
      pieces.push({ end, early: end > late, kept: ends.includes(end), step: this.steps(end - from) });
    }
    const push = (time, state) => {
      const row = 5 * Math.min(Math.floor(time / T + 1e-9), this.n - 1), rest = time - row / 5 * T;
      const slope = row + 7 < this.ideal.length ? (this.ideal[row + 7] - this.ideal[row + 2]) / T : 0;
      t.push(time);
      angle.push(this.read(3, ...state));
      moment.push(this.read(5, ...state));
      tip.push(this.read(6, ...state) - this.reach * (this.ideal[row + 1] + rest * (this.ideal[row + 2] + slope * rest / 2)));
    };
    for (let k = 0; k < found.n; k++) {
      const a = found.amplitudes.slice(2 * this.m * k, 2 * this.m * (k + 1)), rigid = [...found.rigid[k]], u = j => j < 0 ? 0 : found.torque[j];
      push(k * T, [a, rigid, u(k - this.delay - 1)]);
      if (k < found.n - 1) for (const { end, early, kept, step } of pieces) {
        const acting = u(k - this.delay - (early ? 0 : 1));
        this.advance(a, rigid, step, acting);
        if (kept) push(k * T + end, [a, rigid, acting]);
      }
    }
    return { t, angle, moment, tip };
  }

  // Hub angle [rad] and deflection [m] from the line that turns with it, at the stations along the arm
  shape({ a, rigid, u }) {
    const angle = this.read(3, a, rigid, u), k = 2 * 6 * this.m, turned = this.rigid[3][0] * rigid[0] + this.rigid[3][1] * rigid[1];
    const deflection = this.x.map((x, i) => {
      let total = (x + this.offset) * (turned - angle);
      for (let j = 0; j < this.m; j++) {
        const [re, im] = mul(pair(this.shapes, i * this.m + j), [this.w[k + 2 * j], this.w[k + 2 * j + 1]]);
        total += re * a[2 * j] - im * a[2 * j + 1];
      }
      return total;
    });
    return { angle, deflection };
  }
}
if (typeof window !== "undefined") Object.assign(window, { SampledLoop, Slew });
