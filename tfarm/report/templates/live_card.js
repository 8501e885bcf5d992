// The card and the tables below the charts: the numbers of some gains in words, as tfarm.assessment.card and `tfarm margins` have them.
"use strict";
const $ = id => document.getElementById(id);
const text = (id, words) => { const at = $(id); if (at && at.textContent !== words) at.textContent = words; };
const grade = (size, [good, low]) => { const way = good > low ? 1 : -1; return way * size >= way * good ? "good" : way * size >= way * low ? "low" : "poor"; };
const infinite = x => Number.isFinite(x) ? general(x, 4) : "no limit", decibels = factor => factor > 1e-9 && factor < 1e9 ? Math.abs(dB(factor)) : Infinity;
// The margins of a loop with their limits, as the card has them
function cellsOf(margins, { limits, period }) {
  return margins ? {
    up: [decibels(margins.gain[1]), limits.gain], down: [decibels(margins.gain[0]), limits.gain], phase: [Math.abs(margins.phase.value), limits.phase],
    delay: [1e3 * margins.delay.value, limits.periods.map(x => 1e3 * x * period), margins.delay.is_bound], peak: [margins.peak_sensitivity.value, limits.peak],
  } : {};
}
const isGoodBy = (margins, data) => !!margins && Object.values(cellsOf(margins, data)).every(([value, limit]) => grade(value, limit) === "good");
const reliable = x => Number.isFinite(x) ? +x.toPrecision(9) : x; // to the digits that hold, as `tfarm margins` has it
function rows(id, cells) {
  $(id).replaceChildren(...cells.map(row => {
    const line = document.createElement("tr");
    line.append(...row.map(cell => Object.assign(document.createElement("td"), { textContent: cell })));
    return line;
  }));
}

function makeCard(data, loop, discrete, slew) {
  function card(of, id, kind, margins) {
    const cells = cellsOf(margins, data), grades = {};
    for (const name of Object.keys(data.margin_names)) {
      const [value = NaN, limit, is_bound] = cells[name] || [], found = grades[name] = Number.isNaN(value) ? "" : grade(value, limit);
      text(`${of}-${name}`, found ? is_bound ? `≥ ${infinite(value)}` : infinite(value) : "-");
      text(`${of}-${name}-grade`, found);
      $(`${of}-${name}-grade`).className = `grade ${found}`;
    }
    const worst = ["poor", "low", "good"].find(each => Object.values(grades).includes(each)), own = Object.keys(grades).filter(name => grades[name] === worst);
    text(id, kind);
    $(id).className = `pill ${worst || kind}`; // a stable loop has the colour of its grade
    text(`${of}-limits`, worst && worst !== "good" ? `${worst}: ${own.map(name => data.margin_names[name]).join(", ")}` : "");
  }
  function show(now) {
    const { verdict, why, margins, zmargins, zword } = now;
    card("s", "verdict", now.grows ? "unstable" : now.stable ? "stable" : "marginal", margins);
    card("z", "sampled", zword, zmargins);
    text("why", `${why}.`);
    text("s-ratio", Number.isFinite(now.ratio) ? general(100 * now.ratio, 4) : "-");
    text("z-ratio", Number.isFinite(now.zratio) ? general(100 * now.zratio, 4) : "-");
    text("s-constant", Number.isFinite(now.constant) ? general(now.constant, 4) : "-");
    text("z-constant", Number.isFinite(now.zconstant) ? general(now.zconstant, 4) : "-");
    if (slew) { now.figures ||= slew.figures(now.run); const { settled } = now.figures; text("slew-settled", zword === "unstable" ? "unstable" : Number.isFinite(settled) ? general(settled, 5) : `not settled within ${general((now.run.n - 1) * slew.period, 5)} s`); }
    rows("pole-rows", now.poles.slice(0, 5).map(s => [general(s[0], 5), general(s[1], 6), general(hertz(s[1]), 5), dampingRatio(s)]));
  }
  // What is below the dashboard: the loop as it is, with every margin and crossing
  function tables(now) {
    const { law, z } = now, margins = now.stable ? loop.margins(law, loop.dense(now.poles, law)) : null, gains = data.of_law ? `${data.command_name} --law FILE` : `${data.command_name} --K1 ${law.K1} --K2 ${law.K2} --Kp ${law.Kp}`;
    for (const id of ["margins", "crossovers", "turnings"]) $(id).hidden = !margins;
    $("no-margins").hidden = !!margins;
    text("command", `tfarm margins ${gains}`);
    if (margins) {
      text("m-gain", `${general(margins.gain[0], 8)} to ${general(margins.gain[1], 8)}`);
      for (const name of ["phase", "phase_lag", "phase_lead", "delay", "disk", "peak_sensitivity", "peak_complementary"]) {
        const { value, at } = margins[name];
        text(`m-${name}`, general(reliable(value), 6));
        text(`at-${name}`, at ? `${general(at, 6)} rad/s = ${general(hertz(at), 5)} Hz` : "");
      }
      text("whole", whole(law));
      rows("gain-crossovers", margins.crossed.map(({ w, angle }) => [general(w, 7), general(hertz(w), 5), general(angle, 6)]));
      rows("phase-crossovers", margins.crossovers.map(({ w, factor }) => [general(w, 7), general(hertz(w), 5), general(factor, 6)]));
    }
    const most = z && Math.max(...z.map(each => each.growth));
    text("sampled-note", z ? `Dominant pole: ln|z| = ${general(most, 3)} per sample; spectral radius ${general(Math.exp(most), 12)}, of the first ${discrete.modes} mode${discrete.modes > 1 ? "s" : ""}.` : "Not all sampled poles of these gains were found: not determined.");
    text("sampled-command", discrete ? `tfarm sampled ${gains}` : "");
    rows("z-rows", (z || []).filter(({ z }) => z[1] > -1e-14).sort((a, b) => b.growth - a.growth).slice(0, 8).map(({ z, growth }) => [general(z[0], 5), general(Math.abs(z[1]) > 1e-14 ? z[1] : 0, 5), general(Math.exp(growth), 7), general(growth, 4)]));
    if (!slew) return;
    const { moment, torque, residual } = now.figures, { stopped } = now.run;
    text("slew-torque", general(torque, 5));
    text("slew-moment", general(moment, 5));
    text("slew-residual", residual === null ? "not computed" : general(residual, 5));
    text("slew-stopped", stopped === null ? "" : `Unstable: simulation stopped at ${general(stopped, 4)} s (deflection limit).`);
    text("slew-command", `tfarm simulate ${gains} --duration ${general(slew.n * slew.period - slew.period, 6)} --modes ${slew.modes}`);
  }
  // What the margins up to the band say of the whole infinite-dimensional loop: `tfarm.loop.margins.margins`
  function whole(law) {
    if (loop.kind === "quiet") return "Beyond the frequency range L is no nearer to −1: these margins are those of the whole loop.";
    if (loop.kind !== "reactive" || !loop.by_sign) return "Of the whole loop they are not known.";
    return law.K2 ? "Of the whole loop, whose undamped modes have no end, delay and disk margin are 0 and the peaks infinite." : "Of the whole loop, whose undamped modes have no end, the delay margin is 0; the others hold.";
  }
  return { show, tables };
}
