// A sensor along the arm: what it sees of each mode, and its zeros, at the positions that tfarm computed; none between.
"use strict";
function makeSensor(kinds, colours) {
  const $ = id => document.getElementById(id), far = ([re, im]) => Math.sqrt(re * re + im * im);
  let view = null;
  const held = () => kinds[$("sensor-kind").value], at = () => +$("sensor-at").value;
  const cell = (words, className = "") => Object.assign(document.createElement("td"), { textContent: words, className });
  const fill = (id, lines) => $(id).replaceChildren(...lines.map(cells => { const row = document.createElement("tr"); row.append(...cells); return row; }));

  const side = (re, im) => Math.abs(re) <= 1e-6 * far([re, im]) ? "on the axis" : re > 0 ? "right of the axis" : "left of the axis";
  function share(x) {
    const bar = cell("", "share"), inner = document.createElement("span");
    Object.assign(inner.style, { width: `${50 * Math.abs(x)}%`, left: `${x < 0 ? 50 - 50 * Math.abs(x) : 50}%`, background: x < 0 ? colours.orange : colours.blue });
    bar.append(inner);
    return bar;
  }
  function show() {
    $("sensor-at").max = held().x.length - 1; // an end where there is nothing to sense is left out
    const { x, modes, participation, zeros } = held(), i = at();
    $("sensor-x").textContent = `x = ${general(x[i], 5)} m`;
    fill("sensor-modes", modes.map((w, n) => [cell(n + 1), cell(general(w, 6)), cell(general(hertz(w), 5)), cell(participation[i][n].toFixed(3)), share(participation[i][n])]));
    fill("sensor-zeros", zeros[i].map(([re, im]) => [cell(general(re, 5)), cell(general(im, 5)), cell(general(hertz(far([re, im])), 5)), cell(side(re, im), "text")]));
    if (view) for (const [of, rows] of Object.entries(sets())) view.data(of, rows);
    view?.runAsync();
  }
  function sets() {
    const { x, modes, zeros, band } = held(), i = at();
    const rows = zeros.flatMap((list, k) => list.map(s => ({ x: x[k], w: far(s), re: s[0], im: s[1], kind: s[0] > 1e-6 * far(s) ? "zero right of it" : "zero on or left of the imaginary axis" })));
    return { zeros: rows.filter(row => row.w <= band), modes: modes.map((w, n) => ({ w, name: `mode ${n + 1}` })), here: [{ x: x[i] }] };
  }
  for (const id of ["sensor-kind", "sensor-at"]) $(id).addEventListener("input", show);
  show();
  return { sets, show, place: chart => { view = chart; } };
}
