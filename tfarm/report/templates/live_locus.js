// The locus of one gain: poles followed along it, the gain halved until no line turns by more than 5 degrees and every pole is distinct.
"use strict";
const STEPS = 24, FINEST = 1 / (STEPS * 4096), MOST = 600; // of the gain: its first steps, the shortest, as a share of its way, and values at most
const LONG = 16, PIXEL = 1, TURN = 5 * Math.PI / 180; // pixels: a pole goes no further at a step; what is shorter has no corner that is seen

// `polesAt(gain, before)` gives {points: [[x, y], ...], ...}; `gainAt(share)` the gain, share from 0 to 1; `view` is {x, y} from and to, drawn
// on `wide` by `high` pixels.  It yields before each further gain, so that a page is not held up
function* locus(polesAt, gainAt, view, [wide, high]) {
  const across = wide / (view.x[1] - view.x[0]), up = high / (view.y[1] - view.y[0]);
  const way = ([a, b], [c, d]) => [(c - a) * across, (d - b) * up], outside = (x, [a, b]) => x < 1.1 * a - 0.1 * b || x > 1.1 * b - 0.1 * a;
  const seen = ([x, y]) => !outside(x, view.x) && !outside(y, view.y), at = (share, before) => ({ share, gain: gainAt(share), ...polesAt(gainAt(share), before) });
  let found = [at(0, null)];
  for (let k = 1; k <= STEPS; k++) { yield; found.push(at(k / STEPS, found[k - 1])); }
  for (;;) {
    const wanted = yield* loose(found, way, seen), next = [found[0]];
    for (let k = 1; k < found.length; k++) {
      const [a, b] = [found[k - 1], found[k]];
      if (wanted.has(k) && b.share - a.share > FINEST && found.length < MOST) { yield; next.push(at((a.share + b.share) / 2, a)); }
      next.push(b);
    }
    if (next.length === found.length) return linked(found, way, seen);
    found = next;
  }
}

// The poles at the next gain that those here go on to, -1 where one is nearest to none or to another's, and whether one that is seen
// is left alone by more than a pixel
function partners(here, next, way, seen) {
  if (here.next === next) return here;
  const nearest = (point, list) => list.reduce((best, each, i) => { const gap = size(way(point, each)); return gap < best.gap ? { i, gap } : best; }, { i: -1, gap: Infinity });
  const forth = here.points.map(point => nearest(point, next.points)), back = next.points.map(point => nearest(point, here.points));
  here.next = next;
  here.to = forth.map(({ i, gap }, n) => gap <= LONG && back[i].i === n ? i : -1);
  const alone = (points, there, mutual) => there.some(({ gap }, n) => seen(points[n]) && gap > PIXEL && !mutual(n));
  here.lost = !!here.points.length && !!next.points.length && (alone(here.points, forth, n => here.to[n] >= 0) || alone(next.points, back, n => here.to.includes(n)));
  return here;
}

// Between which gains another one is needed, by the number of the latter: a pole is lost, or its line turns there
function* loose(found, way, seen) {
  const wanted = new Set();
  for (let k = 1; k < found.length; k++) {
    yield;
    const [before, here, after] = [found[k - 1], found[k], found[k + 1]];
    if (partners(before, here, way, seen).lost) wanted.add(k);
    if (after) before.to.forEach((q, p) => {
      const r = q < 0 ? -1 : partners(here, after, way, seen).to[q];
      if (r < 0 || !seen(here.points[q])) return;
      const u = way(before.points[p], here.points[q]), v = way(here.points[q], after.points[r]);
      if (Math.abs(Math.atan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1])) <= TURN) return;
      if (size(u) > PIXEL) wanted.add(k);
      if (size(v) > PIXEL) wanted.add(k + 1);
    });
  }
  return wanted;
}

// Points of one branch have one number
function linked(found, way, seen) {
  const rows = [];
  let count = 0, pieces = found[0].points.map(() => ++count);
  found.forEach((here, k) => {
    if (k) { const { to } = partners(found[k - 1], here, way, seen), before = pieces; pieces = here.points.map((_, i) => to.includes(i) ? before[to.indexOf(i)] : ++count); }
    here.points.forEach((p, i) => { if (seen(p)) rows.push({ re: p[0], im: p[1], gain: here.gain, piece: pieces[i] }); });
  });
  return rows.sort((a, b) => a.piece - b.piece); // one line after the other, each along the gain
}
if (typeof window !== "undefined") window.locus = locus;
