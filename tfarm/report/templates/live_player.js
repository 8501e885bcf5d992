// The player: the arm over its slew, its deflection enlarged, with torque and root moment; still unless it is asked to play.
"use strict";
const ENLARGED = 0.2, EDGE = 18, BARS = 124; // of the length: how far the largest deflection is drawn; pixels around the arm, and of the bars

function slewSets(slew, found, between, width) {
  const { t, angle, moment, tip } = slew.traces(found, Math.min(between, Math.ceil(40_000 / found.n))), rows = y => shownOver(t, y, Math.max(width, 300));
  const torque = [...Array(found.n).keys()].map(k => ({ t: k * slew.period, torque: found.torque[k], reference: slew.ideal[5 * k + 1] }));
  return { angle: rows(angle), moment: rows(moment), tip: rows(tip), torque };
}

function makePlayer(slew, colours, first, moved) {
  const $ = id => document.getElementById(id), canvas = $("arm"), still = matchMedia("(prefers-reduced-motion: reduce)");
  const end = () => (found.n - 1) * slew.period, round = x => [1, 2, 5, 10].map(k => k * 10 ** Math.floor(Math.log10(x))).filter(k => k <= x * 1.0001).pop();
  let found = first, t = 0, playing = false, last = 0, factor = 1, box = null, most = { torque: 1, moment: 1 };

  // A place of the turned arm [m], and the least box around all places of a run
  const turned = (along, across, angle) => [along * Math.cos(angle) - across * Math.sin(angle), along * Math.sin(angle) + across * Math.cos(angle)];
  const boxOf = (...places) => places.reduce(([a, b, c, d], [x, y]) => [Math.min(a, x), Math.max(b, x), Math.min(c, y), Math.max(d, y)], [0, 0, 0, 0]);

  // Another run: how much its deflection is enlarged, and how long its bars are at most
  function show(run) {
    found = run;
    const figures = slew.figures(run), bent = run.tip.reduce((top, x, k) => Math.max(top, Math.abs(x - slew.reach * run.angle[k])), 0);
    factor = bent > 0 ? Math.max(1, round(ENLARGED * slew.length / bent)) : 1;
    box = boxOf([0, 0], ...run.angle.flatMap((angle, k) => [turned(slew.reach, 0, slew.ideal[5 * k + 1]), turned(slew.reach, factor * (run.tip[k] - slew.reach * angle), angle)]));
    most = { torque: figures.torque || 1, moment: figures.moment || 1 };
    go(Math.min(t, end()));
  }
  function go(time) {
    t = clip(time, 0, end());
    $("scrub").value = end() ? t / end() : 0;
    const state = slew.at(found, t), { angle, deflection } = slew.shape(state), moment = slew.read(5, state.a, state.rigid, state.u);
    paint(angle, deflection, state.u, moment, slew.ideal[5 * state.k + 1]);
    $("frame").textContent = `t = ${t.toFixed(3)} s: hub ${angle.toFixed(4)} rad, ${slew.drive} ${general(state.u, 3)} ${slew.unit}, root moment ${general(moment, 3)} N m, tip deflection ${general(deflection[deflection.length - 1], 3)} m, ${factor > 1 ? `drawn × ${factor}` : "to scale"}`;
  }

  // The arm from above: hub, its line, where the reference has it, and the arm as it is bent
  function paint(angle, deflection, torque, moment, reference) {
    const { draw, width, height } = cleared(canvas), [left, right, low, high] = box;
    const scale = Math.min((width - BARS - 2 * EDGE) / (right - left), (height - 2 * EDGE) / (high - low));
    const at = (...place) => { const [x, y] = turned(...place); return [(width - BARS) / 2 + scale * (x - (left + right) / 2), height / 2 - scale * (y - (low + high) / 2)]; };
    const line = (points, colour, thick, dash = []) => {
      draw.beginPath();
      points.forEach(([x, y], i) => i ? draw.lineTo(x, y) : draw.moveTo(x, y));
      Object.assign(draw, { strokeStyle: colour, lineWidth: thick, lineJoin: "round" });
      draw.setLineDash(dash);
      draw.stroke();
    };
    line([at(0, 0, reference), at(slew.reach, 0, reference)], colours.grey, 1, [5, 4]);
    line([at(0, 0, angle), at(slew.reach, 0, angle)], colours.faint, 1);
    const bent = slew.x.map((x, i) => at(x + slew.offset, factor * deflection[i], angle));
    line([at(0, 0, angle), ...bent], colours.blue, 4);
    for (const [point, radius, colour] of [[at(0, 0, angle), 14, colours.grey], [bent[bent.length - 1], 6, colours.blue]]) {
      draw.beginPath();
      draw.arc(...point, radius, 0, 2 * Math.PI);
      draw.fillStyle = colour;
      draw.fill();
    }
    bar(draw, width - 92, height, torque / most.torque, slew.drive, colours.orange);
    bar(draw, width - 40, height, moment / most.moment, "moment", colours.blue);
  }
  function bar(draw, x, height, share, name, colour) {
    const middle = height / 2, half = height / 2 - 34;
    draw.fillStyle = colours.faint;
    draw.fillRect(x - 1, middle - half, 2, 2 * half);
    draw.fillRect(x - 14, middle - 1, 28, 2);
    draw.fillStyle = colour;
    draw.fillRect(x - 7, Math.min(middle, middle - share * half), 14, Math.abs(share) * half);
    Object.assign(draw, { fillStyle: colours.ink, font: "12px system-ui, sans-serif", textAlign: "center" });
    draw.fillText(name, x, height - 10);
  }

  function step(time) {
    if (!playing) return;
    const next = t + (time - last) / 1000 * +$("speed").value;
    last = time;
    go(next);
    moved();
    if (next >= end()) pause(); else requestAnimationFrame(step);
  }
  function play() {
    if (t >= end()) go(0);
    playing = true;
    $("play").textContent = "pause";
    requestAnimationFrame(time => { last = time; step(time); });
  }
  function pause() {
    playing = false;
    $("play").textContent = "play";
  }
  function heed() {
    if (still.matches) pause();
    $("play").hidden = still.matches;
    $("still").hidden = !still.matches;
  }
  $("play").addEventListener("click", () => playing ? pause() : play());
  $("scrub").addEventListener("input", event => { pause(); go(+event.target.value * end()); moved(); });
  still.addEventListener("change", heed);
  addEventListener("resize", () => go(t));
  heed();
  t = 0.4 * slew.rise; // a bent arm shows more than one at rest
  show(first);
  return { show, go, play, pause, get time() { return t; }, get playing() { return playing; } };
}
