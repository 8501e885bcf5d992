// Charts on a canvas: plots below each other, each with axes x and y {low, high, kind, constant, label, values} and marks over them.
"use strict";
const FORM = { linear: x => x, log: x => Math.log10(Math.max(x, 1e-300)) };
const SHADE = 0.2; // of forbidden regions
const CROSS = "cross", DOT = "dot", RING = "ring", BOX = "box", LEFT = 58, RIGHT = 10, TOP = 8, BELOW = 34, BETWEEN = 12; // pixels around the plots
const formOf = ({ kind = "linear", constant }) => kind === "symlog" ? x => Math.sign(x) * Math.log1p(Math.abs(x) / constant) : FORM[kind];

// From a value to a pixel, and back
function scaleOf(axis, from, to) {
  const form = formOf(axis), a = form(axis.low), b = form(axis.high), at = x => from + (form(x) - a) / (b - a) * (to - from);
  const back = pixel => { const y = a + (pixel - from) / (to - from) * (b - a); return axis.kind === "log" ? 10 ** y : axis.kind === "symlog" ? Math.sign(y) * axis.constant * Math.expm1(Math.abs(y)) : y; };
  return { at, back, from, to };
}
// Round numbers along an axis, about `most` of them, two at least
function ticksOf({ low, high, kind, values }, most) {
  if (values) return values;
  if (kind === "log") {
    const a = Math.ceil(Math.log10(low) - 1e-9), b = Math.floor(Math.log10(high) + 1e-9), step = Math.max(1, Math.ceil((b - a) / most));
    const tens = [...Array(Math.max(0, b - a + 1)).keys()].map(k => a + k).filter(k => (k - a) % step === 0).map(k => 10 ** k);
    return tens.length > 2 ? tens : [...Array(b - a + 2).keys()].flatMap(k => [1, 2, 5].map(x => x * 10 ** (a - 1 + k))).filter(x => x >= low && x <= high);
  }
  const rough = (high - low) / most, ten = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].map(k => k * ten).find(k => k >= rough) || 10 * ten;
  const found = [...Array(Math.floor(high / step + 1e-9) - Math.ceil(low / step - 1e-9) + 1).keys()].map(k => (Math.ceil(low / step - 1e-9) + k) * step);
  return found.length < 2 && most < 9 ? ticksOf({ low, high }, most + 1) : found;
}
// A number at a tick; powers of ten as such
function label(x, kind) {
  const words = general(Math.abs(x) < 1e-12 ? 0 : x, Math.abs(x) > 9999 && !kind ? 6 : 4).replace("-", "−"), ten = /^(−?)1e([+-])0*(\d+)$/.exec(words);
  return ten && kind ? `${ten[1]}10${ten[2] === "-" ? "⁻" : ""}${[...ten[3]].map(k => "⁰¹²³⁴⁵⁶⁷⁸⁹"[k]).join("")}` : words;
}

// A canvas with as many dots as its place has, empty
function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight, draw = canvas.getContext("2d"), dots = [width, height].map(x => Math.round(x * ratio));
  if (canvas.width !== dots[0] || canvas.height !== dots[1]) [canvas.width, canvas.height] = dots;
  draw.setTransform(ratio, 0, 0, ratio, 0, 0);
  draw.clearRect(0, 0, width, height);
  return { draw, width, height };
}
// Draw plots, {x, y, marks, share of the height}, and return the scales of each; what a plot below has too is not lettered above
function paint(canvas, plots, colours) {
  const { draw, width, height } = cleared(canvas);
  draw.font = "11px system-ui, sans-serif";
  const free = height - TOP - BELOW - BETWEEN * (plots.length - 1), whole = plots.reduce((sum, plot) => sum + (plot.share || 1), 0);
  let top = TOP;
  return plots.map((plot, i) => {
    const high = free * (plot.share || 1) / whole, x = scaleOf(plot.x, LEFT, width - RIGHT), y = scaleOf(plot.y, top + high, top), is_last = i === plots.length - 1;
    frame(draw, plot, x, y, top, high, width, is_last, colours);
    draw.save();
    draw.beginPath();
    draw.rect(x.from, top, x.to - x.from, high);
    draw.clip();
    for (const mark of plot.marks) for (const kind of Object.keys(MARKS)) if (mark[kind] !== undefined) MARKS[kind](draw, mark, x, y, top, high, colours);
    draw.restore();
    top += high + BETWEEN;
    return { x, y };
  });
}
function frame(draw, plot, x, y, top, high, width, is_last, colours) {
  Object.assign(draw, { strokeStyle: colours.faint, fillStyle: colours.grey, lineWidth: 1, textBaseline: "middle" });
  draw.setLineDash([]);
  draw.strokeRect(x.from + 0.5, top + 0.5, x.to - x.from, high);
  draw.textAlign = "right";
  let last = Infinity;
  for (const value of ticksOf(plot.y, Math.max(2, Math.floor(high / 34)))) {
    const at = y.at(value);
    if (!(at >= top - 1 && at <= top + high + 1)) continue;
    line(draw, [[x.from, at], [x.to, at]]);
    if (Math.abs(last - at) > 11) { draw.fillText(label(value, plot.y.kind), x.from - 5, at); last = at; }
  }
  draw.textAlign = "center";
  let end = -Infinity;
  for (const value of ticksOf(plot.x, Math.max(3, Math.floor((x.to - x.from) / 55))).sort((a, b) => a - b)) {
    const at = x.at(value), words = label(value, plot.x.kind), half = draw.measureText(words).width / 2;
    if (!(at >= x.from - 1 && at <= x.to + 1)) continue;
    line(draw, [[at, top], [at, top + high]]);
    const middle = Math.min(Math.max(at, x.from), width - half);
    if (is_last && middle - half > end + 6) { draw.fillText(words, middle, top + high + 9); end = middle + half; }
  }
  if (is_last) draw.fillText(plot.x.label, (x.from + x.to) / 2, top + high + 25);
  draw.save();
  draw.translate(7, top + high / 2);
  draw.rotate(-Math.PI / 2);
  draw.fillText(plot.y.label, 0, 0);
  draw.restore();
}
function line(draw, points) {
  draw.beginPath();
  points.forEach(([x, y], i) => i ? draw.lineTo(x, y) : draw.moveTo(x, y));
  draw.stroke();
}
// Rows one after the other that have the same `by`
function groups(rows, by) {
  const found = [];
  rows.forEach((row, i) => { if (i && (!by || row[by] === rows[i - 1][by])) found[found.length - 1].push(row); else found.push([row]); });
  return found;
}
function hatched(draw, colour) {
  const tile = document.createElement("canvas"), on = tile.getContext("2d");
  tile.width = tile.height = 8;
  Object.assign(on, { strokeStyle: colour, lineWidth: 1.2 });
  for (const k of [-8, 0, 8]) line(on, [[k, 8], [k + 8, 0]]);
  return draw.createPattern(tile, "repeat");
}
const MARKS = {
  area(draw, { area, x: of, low, high, by, fill, hatch, dash = [] }, x, y) { // between two curves
    Object.assign(draw, { fillStyle: hatch ? hatched(draw, hatch) : fill, strokeStyle: hatch || fill, lineWidth: 1.3 });
    draw.setLineDash(dash);
    for (const rows of groups(area, by)) {
      draw.beginPath();
      rows.forEach(row => draw.lineTo(x.at(row[of]), y.at(row[low])));
      [...rows].reverse().forEach(row => draw.lineTo(x.at(row[of]), y.at(row[high])));
      draw.closePath();
      draw.globalAlpha = hatch ? 0.9 : 0.3;
      draw.fill();
      draw.globalAlpha = 1;
      draw.stroke();
    }
  },
  zone(draw, { zone, x: of, y: on, fill }, x, y) { // polygons, with holes where one lies in another
    draw.beginPath();
    for (const rows of zone) { rows.forEach((row, i) => { const at = [x.at(row[of]), clip(y.at(row[on]), -1e4, 1e4)]; if (i) draw.lineTo(...at); else draw.moveTo(...at); }); draw.closePath(); }
    Object.assign(draw, { fillStyle: fill, globalAlpha: SHADE });
    draw.fill("evenodd");
    draw.globalAlpha = 1;
  },
  bar(draw, { bar, x: of, y: on, colour }, x, y) { // a broad line that a curve must not cross
    Object.assign(draw, { strokeStyle: colour, lineWidth: 9, globalAlpha: 2 * SHADE });
    draw.setLineDash([]);
    line(draw, bar.map(row => [x.at(row[of]), y.at(row[on])]));
    draw.globalAlpha = 1;
  },
  line(draw, { line: rows, x: of, y: on, by, colour, dash = [], width = 1.4 }, x, y) {
    Object.assign(draw, { strokeStyle: colour, lineWidth: width, lineJoin: "round" });
    draw.setLineDash(dash);
    for (const each of groups(rows, by)) line(draw, each.map(row => [x.at(row[of]), clip(y.at(row[on]), -1e4, 1e4)]));
  },
  stems(draw, { stems, colour }, x, y) { // upright pieces {w, low, high}
    Object.assign(draw, { strokeStyle: colour, lineWidth: 2 });
    draw.setLineDash([]);
    for (const { w, low, high } of stems) line(draw, [[x.at(w), y.at(low)], [x.at(w), y.at(high)]]);
  },
  rule(draw, { rule, along = "y", colour, dash = [] }, x, y, top, high, colours) { // a line at one value of an axis
    Object.assign(draw, { strokeStyle: colour || colours.grey, lineWidth: 1 });
    draw.setLineDash(dash);
    line(draw, along === "y" ? [[x.from, y.at(rule)], [x.to, y.at(rule)]] : [[x.at(rule), top], [x.at(rule), top + high]]);
  },
  points(draw, { points, x: of, y: on, shape, colour, radius = 5 }, x, y) {
    draw.setLineDash([]);
    for (const row of points) {
      const a = x.at(row[of]), b = y.at(row[on]), form = typeof shape === "function" ? shape(row) : shape, r = radius;
      Object.assign(draw, { strokeStyle: typeof colour === "function" ? colour(row) : colour, fillStyle: typeof colour === "function" ? colour(row) : colour, lineWidth: 1.8 });
      if (form === CROSS) { line(draw, [[a - r, b - r], [a + r, b + r]]); line(draw, [[a - r, b + r], [a + r, b - r]]); continue; }
      draw.beginPath();
      if (form === BOX) draw.rect(a - r, b - r, 2 * r, 2 * r); else draw.arc(a, b, r, 0, 2 * Math.PI);
      if (form === DOT) draw.fill(); else draw.stroke();
    }
  },
  words(draw, { words, x: of, y: on, text, colour }, x, y) {
    Object.assign(draw, { fillStyle: colour, textAlign: "left", textBaseline: "middle" });
    for (const row of words) draw.fillText(row[text], Math.min(x.at(row[of]) + 4, x.to - draw.measureText(row[text]).width - 2), Math.max(y.at(row[on]), y.to + 8));
  },
};
