// The locus of one gain: poles followed along it, the gain halved until every line is straight between its points.
"use strict";
const STEPS = 24, HALVINGS = 6, STRAIGHT = 0.004, LONG = 0.04; // of the view

// `polesAt(gain, before)` gives {points: [[x, y], ...], ...}; `gainAt(share)` the gain, share from 0 to 1; `view` is {x, y} from and to
// It yields before each further gain, so that a page is not held up
function* locus(polesAt, gainAt, view) {
  const width = view.x[1] - view.x[0], height = view.y[1] - view.y[0];
  const away = ([a, b], [c, d]) => Math.sqrt(((a - c) / width) ** 2 + ((b - d) / height) ** 2);
  const seen = ([x, y]) => x > view.x[0] - 0.1 * width && x < view.x[1] + 0.1 * width && y > view.y[0] - 0.1 * height && y < view.y[1] + 0.1 * height;
  const nearest = (point, list) => list.reduce((best, each, i) => away(point, each) < best.gap ? { i, gap: away(point, each) } : best, { i: -1, gap: Infinity });
  const at = (share, before) => ({ share, gain: gainAt(share), ...polesAt(gainAt(share), before) });
  const found = [];
  function* follow(a, b, depth) {
    yield;
    const middle = at((a.share + b.share) / 2, a), bent = p => {
      const { i, gap } = nearest(p, b.points);
      return gap > LONG || nearest([(p[0] + b.points[i][0]) / 2, (p[1] + b.points[i][1]) / 2], middle.points).gap > STRAIGHT;
    };
    if (depth && a.points.some(p => seen(p) && bent(p))) { yield* follow(a, middle, depth - 1); yield* follow(middle, b, depth - 1); } else found.push(middle, b);
  }
  let last = at(0, null);
  found.push(last);
  for (let k = 1; k <= STEPS; k++) {
    const next = at(k / STEPS, last);
    yield* follow(last, next, HALVINGS);
    last = next;
  }
  return linked(found, nearest, seen);
}

// Points of one branch have one number: each goes on to the one that is nearest, if that comes from it alone
function linked(found, nearest, seen) {
  const rows = [];
  let count = 0, before = null, pieces = [];
  for (const here of found) {
    const now = here.points.map((p, i) => {
      const from = before ? nearest(p, before.points) : { i: -1, gap: Infinity };
      return from.gap < LONG && nearest(before.points[from.i], here.points).i === i ? pieces[from.i] : ++count;
    });
    here.points.forEach((p, i) => { if (seen(p)) rows.push({ re: p[0], im: p[1], gain: here.gain, piece: now[i] }); });
    [before, pieces] = [here, now];
  }
  return rows;
}
if (typeof window !== "undefined") window.locus = locus;
