// A sensor along the arm: what it sees of each mode, and its zeros, at the positions that tfarm computed; none between.
"use strict";
function makeSensor(kinds, colours, redraw) {
  const $ = id => document.getElementById(id), far = ([re, im]) => Math.sqrt(re * re + im * im);
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
    redraw();
  }
  function plots() {
    const { x, modes, zeros, band } = held(), own = zeros.flatMap((list, k) => list.map(s => ({ x: x[k], w: far(s), right: s[0] > 1e-6 * far(s) }))).filter(row => row.w <= band);
    const all = [...own.map(row => row.w), ...modes].filter(w => w > 0), low = Math.min(...all) / 1.3, high = Math.max(...all) * 1.3;
    return [{ x: { low: 0, high: Math.max(...x), label: "sensor at x [m] from the clamp" }, y: { low, high, kind: "log", label: "frequency [rad/s]" }, marks: [
      ...modes.map(w => ({ rule: w, colour: colours.link, dash: [5, 3] })), { rule: x[at()], along: "x" },
      { points: own, x: "x", y: "w", radius: 3, shape: row => row.right ? DOT : RING, colour: colours.ink },
    ] }];
  }
  for (const id of ["sensor-kind", "sensor-at"]) $(id).addEventListener("input", show);
  queueMicrotask(show);
  return { plots, show };
}
