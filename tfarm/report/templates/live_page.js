// The live page: gains from sliders, fields, keys, the map and the link; numbers by LiveLoop, SampledLoop and Slew; charts by `paint`.
"use strict";
(() => {
  const data = JSON.parse($("live-data").textContent), { names } = data, [across, up] = data.plane || [];
  const loop = new LiveLoop(data), discrete = data.sampled_loop && new SampledLoop(data.sampled_loop), slew = data.slew && new Slew(data.slew);
  const damped = data.graded && new LiveLoop({ ...data, ...data.graded }), dampedZ = damped && discrete && new SampledLoop(data.graded.sampled_loop); // that margins are graded with
  const card = makeCard(data, loop, discrete, slew);
  const REST = 200, UNDOS = 100, PRECISE = 0.25, MOVING = 1, law = { ...data.start }; // ms without a move until everything is drawn in full; states that are kept; pixels of a chord at rest and in a move
  const state = { plane: "poles", loop: "nyquist", vary: up || names[0], shown: "3", ratio: "0" }, usual = { ...state }, past = [], colours = {};
  function dress() { // colours of the screen, light or dark
    const style = getComputedStyle(document.documentElement);
    for (const [name, of] of Object.entries({ ink: "ink", grey: "grey", faint: "line", link: "link", stable: "stable", marginal: "marginal", unstable: "unstable", good: "good", low: "low", poor: "poor" })) colours[name] = style.getPropertyValue(`--${of}`).trim();
    Object.assign(colours, { blue: colours.link, orange: colours.ink });
  }
  dress();

  // ---------------------------------------------------------------- numbers of these gains

  let now = null, view = null; // of the gains last moved to; those whose axes are held in a drag
  const slowest = poles => Math.max(...poles.map(s => s[0])), constant = x => x < 0 ? -1 / x : Infinity; // of a stable loop
  const ratio = poles => Math.min(...poles.filter(s => s[1] > 0).map(s => -s[0] / size(s)));
  const word = growths => growths.length && Math.max(...growths) > 0 ? "unstable" : Math.max(...growths) < 0 ? "stable" : "marginal";
  function continuousNumbers(law) {
    const is_known = loop.kind === "reactive" && loop.verdict(law, [])[0] === "stable"; // without poles: those of the chart are enough
    const poles = loop.poles(law, now?.poles, Infinity, is_known ? 12 : Infinity), [verdict, why] = loop.verdict(law, poles);
    const seen = damped || loop, own = damped ? damped.poles(law, now?.own) : poles, curve = seen.dense(own, law);
    const stable = verdict.startsWith("stable"), grows = verdict === "unstable" || poles.some(s => s[0] > 1e-9 * size(s));
    const is_seen = damped ? !grows && damped.verdict(law, own)[0].startsWith("stable") : stable;
    return { poles, own, verdict, why, stable, grows, curve, margins: is_seen ? seen.margins(law, curve, false) : null };
  }
  function frameOf(near) {
    const top = 1.08 * Math.max(...near.map(s => s[1]), 1), left = 1.15 * Math.min(...near.map(s => s[0]), -1e-4 * top), right = Math.max(-0.05 * left, 1.3 * Math.max(...near.map(s => s[0])));
    return { x: [left, right], y: [0, top] };
  }
  function numbers(gains) {
    const law = { ...gains }, found = continuousNumbers(law), { poles, own, grows, margins, curve } = found, near = poles.slice(0, +state.shown), shownPoles = damped && !grows ? own : poles;
    const from = view?.from || Math.min(loop.places[0] / 50, ...(margins ? margins.crossed.map(row => row.w / 3) : [])), drawn = {};
    return {
      ...found, law, near, frame: view?.frame || frameOf(near), ...sampledNumbers(law, discrete && discrete.poles(law, now?.z)),
      ratio: ratio(shownPoles), constant: constant(slowest(shownPoles)), run: slew && slew.run(law), from, curve: () => drawn[sharp()] ||= curveOf(curve, ...pixels(), from),
      ...(now && names.every(name => name === across || name === up || now.law[name] === law[name]) ? { areas: now.areas, edge: now.edge, good: now.good } : { areas: areas(law), edge: null, good: null }),
    };
  }
  function sampledNumbers(law, z) {
    if (!z) return { z, zword: "not computed", zmargins: null };
    const zword = word(z.map(each => each.growth)), of = zword === "unstable" || !dampedZ ? discrete : dampedZ, own = of === discrete ? z : of.poles(law, now?.zown);
    if (!own) return { z, zword, zmargins: null };
    const curve = of.curve(law, own), T = of.period, is_stable = word(own.map(each => each.growth)) === "stable";
    const late = most => of.delayMargin(law, own, most), margins = () => ({ ...of.margins(law, curve, loop.restOf(law)), delay: delayed(T, ended(late(data.limits.periods[0]))) });
    const scaled = { ...curve, w: curve.w.map(q => q / T), at: w => curve.at(w * T) };
    return {
      z, zword, zown: of === discrete ? null : own, zmargins: is_stable ? margins() : null, late, zratio: ratio(of.unaliased(own)),
      zconstant: T * constant(Math.max(...own.map(each => each.growth))), zcurve: from => curveOf(scaled, ...pixels(), from),
    };
  }

  // The delay margin of the sampled loop, while gains move as far as it is good; `furtherDelay` goes on at rest
  const delayed = (T, { samples, is_bound }) => ({ value: T * samples, is_bound });
  function* furtherDelay(of) {
    const { zmargins, late } = of, { longest_delay, period } = data;
    if (zmargins?.delay.is_bound) zmargins.delay = delayed(period, yield* late(longest_delay / period));
    return true;
  }

  const isGood = law => isGoodBy(continuousNumbers(law).margins, data) && isGoodBy(sampledNumbers(law, discrete.poles(law)).zmargins, data);
  function show() {
    const { law } = now;
    card.show(now);
    $("scaled").hidden = !data.default || !names.every(name => law[name] === data.default[name]);
    names.forEach(name => { $(`slider-${name}`).value = place(data.axes[name], law[name]); if (document.activeElement !== $(name)) $(name).value = law[name]; });
    const held = law.Kp ? ["no sampled region at this Kp"] : [across, up].map(name => `${name} = ${general(law[name], 4)}`);
    text("map-note", `${held.join(", ")}.${discrete ? ` Grade good: both loops, sampled one of ${discrete.modes} modes; ends solved for, joined by lines.` : ""}`);
    if ($("more").open) card.tables(now);
  }

  // ---------------------------------------------------------------- charts

  const scales = {}, pointed = {};
  let zoom = 1;
  const area = (list, part) => list.map(row => ({ ...row, part: `${part}${row.part}` })), sampledAreas = data.sampled_map ? data.sampled_map.areas : [];
  // The regions where they are known at once: the sampled one is known at Kp = 0 alone, and Kp > 0 moves no edge of a lossless loop
  const areas = ({ Kp }) => data.continuous && (!Kp || loop.kind === "reactive") ? area(data.continuous, "c") : null;
  const proven = data.lyapunov ? [[0, data.axes.K2.low], [0, 1], [data.axes.K1.high, 1]].map(([K1, K2]) => ({ K1, K2 })) : [];
  function gainAxis(name) {
    const { low, high, linear } = data.axes[name], unit = data.units[name], sizes = linear === null ? [] : [...Array(16).keys()].map(k => linear * 10 ** k).filter(x => x <= Math.max(high, -low));
    const shown = sizes.filter((_, i) => sizes.length < 5 || (sizes.length - 1 - i) % 2 === 0); // 0 and powers of ten, each second one where they are many
    const values = linear === null ? undefined : [0, ...shown, ...shown.map(x => -x)].filter(x => low <= x && x <= high);
    return { low, high, label: unit === "1" ? name : `${name} [${unit}]`, values, ...(linear === null ? {} : { kind: "symlog", constant: linear }) };
  }
  const plane = up && { x: gainAxis(across), y: gainAxis(up) }, limited = (margins, of) => margins ? [margins.phase, margins.peak_sensitivity][of] : null;
  const kindOf = x => x < 0 ? "stable" : x > 0 ? "unstable" : "marginal", shapes = { stable: CROSS, marginal: BOX, unstable: RING };
  const polePoints = (list, x, y, sign) => ({ points: list, x, y, shape: row => shapes[kindOf(sign(row))], colour: row => colours[kindOf(sign(row))] });
  const chosenPole = name => ({ points: chosen?.name === name ? [chosen.at] : [], x: 0, y: 1, shape: RING, radius: 9, colour: colours.link });
  function phaseMargin() {
    const at = limited(now.margins, 0);
    return at && at.at ? { w: at.at, low: -180, high: at.value - 180, colour: colours[grade(Math.abs(at.value), data.limits.phase)] } : null;
  }
  function gainStems() {
    if (!now.margins) return [];
    return now.margins.gain.flatMap(factor => now.margins.crossovers.filter(row => row.w > 0 && Math.abs(row.factor / factor - 1) < 1e-6).map(({ w }) => ({ w, size: decibels(factor), low: Math.max(-dB(factor), -60), high: 0, colour: colours[grade(decibels(factor), data.limits.gain)] })));
  }
  const forbidden = forbiddenOf(data.limits), shaded = (bars, x, y) => bars.map(bar => ({ bar, x, y, colour: colours.poor }));
  // At the crossovers of either loop: where |L| = 1 the angles, where L < 0 the sizes
  const barsAt = (rows, ends) => shaded(rows.map(({ w }) => ends.map(y => ({ w, y }))), "w", "y"), both = key => [...(now.margins ? now.margins[key] : []), ...(now.zmargins ? now.zmargins[key].map(({ w }) => ({ w: w / discrete.period })) : [])].filter(row => row.w > 0);
  const turned = list => list.map(row => ({ ...row, angle: row.angle - 180 })), cursor = () => pointed.bode ? [{ rule: pointed.bode.w, along: "x", dash: [3, 3] }] : [];
  const sampledCurve = () => now.zcurve ? (now.zrows ||= {})[sharp()] ||= turned(now.zcurve(now.from)) : [], own = () => (now.rows ||= {})[sharp()] ||= turned(now.curve());
  const charts = {
    map: () => [{ ...plane, marks: [
      { area: now.areas || [], x: across, low: "low", high: "high", by: "part", fill: colours.stable },
      { area: now.good || [], x: across, low: "low", high: "high", by: "part", fill: colours.good },
      { area: now.law.Kp ? [] : sampledAreas, x: "K1", low: "low", high: "high", by: "part", hatch: colours.stable, dash: [5, 3] },
      { line: now.edge || [], x: across, y: up, by: "piece", colour: colours.stable, width: 1 }, { line: proven, x: "K1", y: "K2", colour: colours.ink, dash: [2, 3] },
      { rule: now.law[across], along: "x" }, { rule: now.law[up] }, { points: [now.law], x: across, y: up, shape: DOT, colour: colours.ink },
    ] }],
    poles: () => [{
      x: { low: now.frame.x[0], high: now.frame.x[1], label: "Re s [1/s]" }, y: { low: now.frame.y[0], high: now.frame.y[1], label: "Im s [rad/s]" }, marks: [
        { zone: undampedIn(now.frame, +state.ratio / 100), x: "re", y: "im", fill: colours.poor },
        { line: rays(now.frame), x: "re", y: "im", by: "ratio", colour: colours.grey, dash: [4, 3], width: 0.8 }, { words: rays(now.frame).filter(row => row.end), x: "re", y: "im", text: "ratio", colour: colours.grey },
        { rule: 0, along: "x" }, { line: now.locus || [], x: "re", y: "im", by: "piece", colour: colours.link, width: 1 }, { points: pointed.poles ? [pointed.poles] : [], x: "re", y: "im", shape: DOT, colour: colours.link },
        polePoints(now.near, 0, 1, s => s[0]), chosenPole("poles"),
      ],
    }],
    zplane: () => {
      const [wide, high] = equal("zplane", 1.25);
      return [{ x: { low: -wide, high: wide, label: "Re z" }, y: { low: -high, high, label: "Im z" }, marks: [
        { zone: undampedOutside(wide, high, +state.ratio / 100), x: "re", y: "im", fill: colours.poor },
        { line: spirals(), x: "re", y: "im", by: "ratio", colour: colours.grey, dash: [4, 3], width: 0.8 }, { line: circle(0, 1), x: "x", y: "y", colour: colours.grey },
        { line: now.discs || [], x: "re", y: "im", by: "piece", colour: colours.link, width: 1 }, { points: pointed.zplane ? [pointed.zplane] : [], x: "re", y: "im", shape: DOT, colour: colours.link },
        polePoints((now.z || []).map(({ z, growth }) => ({ re: z[0], im: z[1], growth })), "re", "im", row => row.growth), chosenPole("zplane"),
      ] }];
    },
    bode: () => {
      const x = { low: now.from, high: (damped || loop).band, kind: "log", label: "frequency [rad/s]" }, phase = phaseMargin(), crossed = now.margins ? now.margins.crossed : [];
      return [
        { x, y: { low: -60, high: 40, label: "|L| [dB]" }, marks: [
          ...barsAt(both("crossovers"), forbidden.gain.map(row => row.dB)), { rule: 0 }, ...cursor(), { line: sampledCurve(), x: "w", y: "dB", colour: colours.grey, dash: [5, 3] }, { line: own(), x: "w", y: "dB", colour: colours.ink },
          ...gainStems().map(each => ({ stems: [each], colour: each.colour })), { points: crossed.map(({ w }) => ({ w, y: 0 })), x: "w", y: "y", shape: RING, radius: 3, colour: colours.ink },
        ] },
        { x, y: { low: -360, high: 0, label: "angle of L [deg]", values: [-360, -270, -180, -90, 0] }, marks: [
          ...barsAt(both("crossed"), [forbidden.phase[0].angle, forbidden.phase[forbidden.phase.length - 1].angle]), { rule: -180 }, ...cursor(), { line: sampledCurve(), x: "w", y: "angle", by: "branch", colour: colours.grey, dash: [5, 3] }, { line: own(), x: "w", y: "angle", by: "branch", colour: colours.ink },
          ...(phase ? [{ stems: [phase], colour: phase.colour }] : []),
        ] },
      ];
    },
    nyquist: (_, of = state.loop) => {
      const here = pointed.bode ? turned([pointed.bode]) : [], [wide, high] = equal("nyquist", 2.5 * zoom);
      if (of === "sensitivity") return [{ x: { low: now.from, high: (damped || loop).band, kind: "log", label: "frequency [rad/s]" }, y: { low: -50, high: 30, label: "|S|, |T| [dB]" }, marks: [
        { rule: 0 }, { rule: 6, dash: [2, 3] }, ...cursor(), { line: own(), x: "w", y: "T", colour: colours.link }, { line: own(), x: "w", y: "S", colour: colours.ink, width: 1.8 },
      ] }];
      const nichols = of === "nichols", [x, y] = nichols ? ["angle", "dB"] : ["x", "y"], by = nichols ? "branch" : undefined;
      const axes = nichols ? { x: { low: -360, high: 0, label: "angle of L [deg]", values: [-360, -270, -180, -90, 0] }, y: { low: -40 * zoom, high: 40 * zoom, label: "|L| [dB]" } }
        : { x: { low: -wide, high: wide, label: "Re L" }, y: { low: -high, high, label: "Im L" } };
      return [{ ...axes, marks: [
        { zone: [forbidden.disc], x, y, fill: colours.poor }, ...shaded([forbidden.phase, forbidden.gain], x, y),
        ...(nichols ? [{ rule: 0 }, { rule: -180, along: "x" }] : [{ line: circle(0, 1), x: "x", y: "y", colour: colours.grey, width: 1 }]),
        { line: sampledCurve(), x, y, by, colour: colours.grey, dash: [5, 3] }, { line: own(), x, y, by, colour: colours.ink },
        { points: [nichols ? { angle: -180, dB: 0 } : { x: -1, y: 0 }], x, y, shape: CROSS, colour: colours.ink }, { points: here, x, y, shape: DOT, colour: colours.link },
      ] }];
    },
    side: () => charts.nyquist(true, "sensitivity"), // where there is no slew
    slew: fine => {
      const found = slewSets(slew, now.run, fine ? Math.ceil(20 * slew.fastest(now.run) * slew.period / (2 * Math.PI)) : 0, $("slew").clientWidth);
      const x = { low: 0, high: (slew.n - 1) * slew.period, label: "time [s]" }, at = player ? [{ rule: player.time, along: "x" }] : [];
      return [["angle", "y", "hub [rad]", [{ line: found.torque, x: "t", y: "reference", colour: colours.grey, dash: [5, 3] }]], ["torque", "torque", `${slew.drive.slice(0, 7)} [${slew.unit}]`], ["moment", "y", "root [N m]", settling(x.high)], ["tip", "y", "tip [m]"]].map(([name, key, label, more = []]) => {
        const values = found[name].map(row => row[key]), low = Math.min(...values), high = Math.max(...values), room = 0.06 * (high - low) || 1;
        return { x, y: { low: low - room, high: high + room, label }, marks: [...more, { line: found[name], x: "t", y: key, colour: colours.ink, width: 1.2 }, ...at] };
      });
    },
    sensor: () => sensor.plots(),
  };
  // After the slew, farther from the final moment than its band
  function settling(last) {
    const { final, band } = now.figures ||= slew.figures(now.run), far = 1e3 * band, box = (low, high) => [[slew.rise, low], [last, low], [last, high], [slew.rise, high]].map(([t, y]) => ({ t, y }));
    return band > 0 ? [{ zone: [box(final + band, final + far), box(final - far, final - band)], x: "t", y: "y", fill: colours.poor }] : [];
  }
  // Half of each axis where both have one scale, the shorter one `least`
  function equal(name, least) {
    const [wide, high] = room(name);
    return [least * Math.max(1, wide / high), least * Math.max(1, high / wide)];
  }
  // Of the Nyquist plot: how far a chord is off at most, also relative to L, and the largest |L| of its frame
  function pixels() {
    const [wide, high] = equal("nyquist", 2.5 * zoom);
    return [chord * 2 * wide / room("nyquist")[0], RELATIVE * chord / PRECISE, Math.hypot(wide, high)];
  }
  const canvasOf = name => $(name).querySelector("canvas");
  function draw(name, fine = true) {
    if ($(name) && $(name).offsetParent && $(name).clientHeight > 80) scales[name] = paint(canvasOf(name), charts[name](fine), colours);
  }
  const drawAll = fine => ["map", "poles", "zplane", "bode", "nyquist", "side", "slew"].forEach(name => draw(name, fine));
  const room = name => [canvasOf(name).clientWidth - LEFT - RIGHT, canvasOf(name).clientHeight - TOP - BELOW];
  function notes() {
    const { margins } = now, gain = margins && gainStems().map(({ w, size }) => `gain margin ${general(size, 4)} dB at ${general(w, 4)} rad/s`), phase = limited(margins, 0), peak = limited(margins, 1);
    text("reading", margins ? [...gain, phase.at ? `phase margin ${general(Math.abs(phase.value), 4)}° ${phase.value < 0 ? "(lead)" : "(lag)"} at ${general(phase.at, 4)} rad/s` : ""].filter(Boolean).join("; ") : "An unstable loop has no margins.");
    const { gain: [least], phase: [angle], peak: [Ms] } = data.limits, shades = `Shaded: not good (${least} dB, ${angle}°, Ms ${Ms}).`;
    const circles = { nyquist: `Unit circle. ${shades} Shift and the wheel zoom.`, nichols: `Cross: −1. ${shades} Shift and the wheel zoom.`, sensitivity: "Thick: S; thin: T; dotted: 6 dB." };
    text("loop-note", `${margins && peak.at ? `Ms ${general(peak.value, 4)} at ${general(peak.at, 4)} rad/s. ` : ""}${circles[state.loop]}`);
  }

  // ---------------------------------------------------------------- moves: gains change here alone, a frame draws the last of them

  let waiting = false, resting = 0, chord = PRECISE;
  const sharp = () => `${zoom} ${chord}`; // by which curves are kept
  // A gain beyond the samples of this page is not run: its limit is, and `range` names both
  function take(changes) {
    const beyond = [];
    for (const [name, value] of Object.entries(changes)) {
      if (!(name in law)) { state[name] = value; continue; }
      const { low, high } = data.axes[name];
      if (Number.isFinite(value)) law[name] = clip(value, low, high);
      if (Math.abs(law[name] - value) <= 1e-3 * Math.abs(law[name])) continue; // of a slider: rounding
      beyond.push(`${name} = ${Number.isFinite(value) ? value : "no number"} is not run, but ${general(law[name], 6)}: this page has ${general(low, 4)} to ${general(high, 4)}.`);
    }
    $("range").hidden = !beyond.length;
    text("range", beyond.join(" "));
  }
  function set(changes, pole = null, is_held = !!pole) { // and of a move of a pole that one; what is dragged is held by the axes as they are
    if (Object.keys(changes).length) take(changes);
    view = is_held ? now : null;
    chosen = pole;
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; move(); });
  }
  function move() {
    const start = performance.now();
    clearTimeout(resting);
    chord = MOVING;
    now = numbers(law);
    dressed();
    drawAll(false); // first: what is written changes the layout, which a chart would wait for
    player?.show(now.run);
    show();
    notes();
    resting = setTimeout(rest, REST, now);
    window.live.moves.push(performance.now() - start);
  }
  function dressed() { // what is chosen
    for (const [id, key] of [["plane", "plane"], ["loop", "loop"]]) for (const button of $(id).children) button.setAttribute("aria-pressed", button.value === state[key]);
    for (const id of ["vary", "shown", "ratio"]) $(id).value = state[id];
    for (const id of ["poles", "zplane"]) $(id).hidden = id !== state.plane;
  }
  // All points, and then the curve of gains on the axis, the region and the locus, a few gains at a time; link and undo keep this state
  async function rest(of) {
    if (of.resting) return;
    of.resting = true;
    keep();
    chord = PRECISE;
    drawAll(true);
    if (!await inSlices(furtherDelay(of), of)) return;
    show();
    window.live.delayed = of.law;
    const work = [...(up ? [["map", "edge", onAxis], ["map", "areas", inPlane]] : []), state.plane === "poles" ? ["poles", "locus", inS] : ["zplane", "discs", inZ], ...(up && discrete ? [["map", "good", inGood]] : [])];
    for (const [name, key, make] of work) {
      const found = of[key] || await inSlices(make(), of);
      if (!found) return;
      of[key] = found;
      draw(name);
    }
    of.resting = false;
    window.live.rested = of.law;
  }
  const along = gain => [share => gainAt(data.axes[gain], share, 8), K => ({ ...now.law, [gain]: K })];
  function* onAxis() {
    yield;
    return loop.kind === "reactive" ? [] : edgeOf(w => loop.boundary(w, now.law), [...loop.base.w], data.plane, data.axes);
  }
  function* inPlane() {
    const { law } = now, { low, high } = data.axes[up];
    return area(yield* regionOf(function* (K) { return loop.intervals({ ...law, [across]: K }, low, high); }, data.plane, data.axes), "c");
  }
  // The gains of the grade good: their ends are those of a requirement, exact; between two of them the card decides, which alone has delays within a sample
  let lines = null;
  function* inGood() {
    const { law } = now, { low, high } = data.axes[up], { limits, period } = data, [delay] = limits.periods, is_reactive = loop.kind === "reactive";
    if (!lines) {
      const made = [];
      for (const each of [damped || loop, dampedZ || discrete, (dampedZ || discrete).later(delay), ...(damped ? [discrete, ...(is_reactive ? [] : [loop])] : [])]) made.push(yield* linesOf(each));
      lines = made;
    }
    const { rules, factors } = exclusions(limits, delay * period), moments = is_reactive ? loop.moments.map(k => exactly(k, k)) : [];
    return area(yield* regionOf(function* (K) {
      const here = { ...law, [across]: K }, [s, z, ...others] = lines.map(each => columnOf(each, here, up));
      const excluded = [s, z].flatMap((column, i) => [...rules(i).flatMap(rule => excludedBy(rule, column, [low, high])), ...excludedStill(factors, column.at(i * Math.PI))]);
      return yield* goodParts(leftOf([...excluded, ...others.flatMap(edgesOf), ...moments], low, high), k => isGood({ ...here, [up]: k }));
    }, data.plane, data.axes, 0.02), "g");
  }
  function inS() {
    const [gain, law] = along(state.vary), { frame } = now;
    return locus((K, before) => { const found = loop.poles(law(K), before?.found, frame.y[1]); return { points: [...found], found }; }, gain, frame, room("poles"));
  }
  function inZ() {
    const [gain, law] = along(state.vary), view = { x: [-1.25, 1.25], y: [-1.25, 1.25] };
    return locus((K, before) => { const found = discrete.poles(law(K), before?.found, 1e-6); return { points: (found || []).filter(each => size(each.z) > FAINT).map(each => each.z), found }; }, gain, view, room("zplane"));
  }
  async function inSlices(work, of) {
    for (;;) {
      for (const start = performance.now(); performance.now() - start < 12;) {
        const { done, value } = work.next();
        if (done) return value;
      }
      await new Promise(done => setTimeout(done));
      if (of !== now) return null;
    }
  }

  // ---------------------------------------------------------------- states: link, undo, file

  let written = location.hash.slice(1);
  const stateNow = () => ({ ...Object.fromEntries(names.map(name => [name, law[name]])), ...state });
  function link() {
    const shown = Object.entries(stateNow()).filter(([name, value]) => name in law ? value !== data.start[name] : value !== usual[name]);
    return shown.map(([name, value]) => `${name}=${value}`).join("&");
  }
  function linked() {
    const pairs = new URLSearchParams(location.hash.slice(1)), found = { ...data.start, ...usual };
    const choices = { plane: discrete ? ["poles", "zplane"] : ["poles"], loop: ["nyquist", "nichols", "sensitivity"], vary: names, shown: ["3", "5", "8", "12"], ratio: [...$("ratio").options].map(each => each.value) };
    for (const [name, value] of pairs) if (Object.hasOwn(law, name) && value && Number.isFinite(+value)) found[name] = +value; else if (Object.hasOwn(choices, name) && choices[name].includes(value)) found[name] = value;
    return found;
  }
  function keep() {
    if (written !== link()) location.replace(`#${written = link()}`); // from the disk too, where the history is closed
    const here = stateNow(), last = past[past.length - 1];
    $("undo").disabled = past.length < 2;
    if (last && Object.keys(here).every(key => here[key] === last[key])) return;
    past.push(here);
    if (past.length > UNDOS) past.shift();
    $("undo").disabled = past.length < 2;
  }
  function undo() {
    keep();
    if (past.length < 2) return;
    past.pop();
    set(past[past.length - 1]);
  }
  // The table of `tfarm.arm.writing.law_toml`
  function lawFile() {
    if (data.of_law) return `${data.of_law.head}\n` + data.of_law.parts.map(({ name, signal, num, den }) => `\n[law."${signal}"]\nnum = [${num.map(x => +(x * law[name]).toPrecision(15)).join(", ")}]\nden = [${den.join(", ")}]\n`).join("");
    const used = ["Kp", "K1", "K2"].filter(name => law[name]), number = x => /[.e]/.test(String(x)) ? String(x) : `${x}.0`;
    const signals = (used.length ? used : ["K1"]).map(name => `\n[law.${data.outputs[name]}]\ngain = ${number(law[name])}\n`);
    return `[law]\nname = "gains at the hub"\nreferences = [${used.map(name => `"${data.outputs[name]}"`).join(", ")}]\n${signals.join("")}`;
  }
  function save() {
    const at = Object.assign(document.createElement("a"), { href: URL.createObjectURL(new Blob([lawFile()], { type: "application/toml" })), download: `${data.name.replace(/[^\w.-]+/g, "_")}-law.toml` });
    at.click();
    setTimeout(() => URL.revokeObjectURL(at.href), 1000);
  }
  async function copy() {
    keep();
    try { await navigator.clipboard.writeText(location.href); text("copy", "Copied"); } catch { text("copy", "Copy the address"); }
    setTimeout(() => text("copy", "Copy link"), 1500);
  }

  // ---------------------------------------------------------------- pointing and keys

  const NEAR = 16; // pixels from the pointer to what it takes
  let drag = null, chosen = null; // what follows the pointer; the pole that moves, {name of its chart, at}
  function pointing(name, follow) {
    canvasOf(name).addEventListener("pointermove", event => { const box = canvasOf(name).getBoundingClientRect(); follow(event.clientX - box.left, event.clientY - box.top, event); });
  }
  // `taken(x, y)` is what follows a pointer that goes down there, or null
  function draggable(name, taken) {
    const canvas = canvasOf(name);
    canvas.addEventListener("pointerdown", event => {
      if (!(drag = taken(event.offsetX, event.offsetY))) return;
      canvas.setPointerCapture(event.pointerId);
      pointed[name] = null; // what was read stays behind
      drag(event.offsetX, event.offsetY);
    });
    canvas.addEventListener("touchstart", event => { if (drag) event.preventDefault(); }, { passive: false }); // else a finger scrolls
    pointing(name, (x, y) => { if (drag) drag(x, y); else canvas.classList.toggle("taken", !!taken(x, y)); });
  }
  for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => { drag = null; });
  if (up) draggable("map", () => (x, y) => { const [plot] = scales.map; set({ [across]: +plot.x.back(x).toPrecision(4), [up]: +plot.y.back(y).toPrecision(4) }); });

  // A pole goes to `at` with both gains of the map, or on the real axis with that of the locus; exact, as the loop is linear in its gains
  const polesOf = name => name === "poles" ? now.near : (now.z || []).map(({ z }) => z).filter(z => size(z) > FAINT);
  function movePole(name, at) {
    const { rest, ...terms } = (name === "poles" ? loop : discrete).terms(at), free = up && at[1] ? [across, up] : [state.vary];
    const P = names.filter(each => !free.includes(each)).reduce((sum, each) => add(sum, times(law[each], terms[each])), rest), found = Object.entries(gainsOf(P, free.map(each => [each, terms[each]])));
    if (!found.every(([, gain]) => Number.isFinite(gain))) return;
    set(Object.fromEntries(found.map(([each, gain]) => [each, +gain.toPrecision(7)])), { name, at });
    text("poles-reading", `${complex({ re: at[0], im: at[1] })}: ${free.map(each => `${each} = ${general(law[each], 5)}`).join(", ")}`);
  }
  const POLE_KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] };
  for (const name of discrete ? ["poles", "zplane"] : ["poles"]) {
    const onAxis = ([x, y], other) => [x, other[1] ? y : 0];
    draggable(name, (x, y) => {
      const [plot] = scales[name], pixel = Math.abs(plot.y.back(1) - plot.y.back(0)), off = ([re, im]) => Math.hypot(plot.x.at(re) - x, plot.y.at(im) - y);
      const pole = polesOf(name).reduce((best, each) => off(each) < off(best) ? each : best, [Infinity, 0]);
      return off(pole) > NEAR ? null : (x, y) => movePole(name, onAxis([plot.x.back(x), name === "poles" ? Math.max(plot.y.back(y), pixel) : plot.y.back(y)], pole));
    });
    $(name).addEventListener("keydown", event => {
      const poles = polesOf(name), i = chosen?.name === name ? poles.reduce((best, each, k) => size(minus(each, chosen.at)) < size(minus(poles[best], chosen.at)) ? k : best, 0) : -1, way = POLE_KEYS[event.key];
      if (!(way || event.key === "n") || !poles.length) return;
      event.preventDefault();
      if (event.key === "n" || i < 0) { set({}, { name, at: poles[(i + 1) % poles.length] }); return; }
      const [{ x, y }] = scales[name], pixels = event.shiftKey ? 1 : 5, [re, im] = poles[i];
      movePole(name, onAxis([x.back(x.at(re) + pixels * way[0]), y.back(y.at(im) - pixels * way[1])], poles[i]));
    });
  }
  // All gains times a factor, as far as each of them has its range
  function scale(from, factor) {
    const ends = names.filter(name => from[name]).map(name => [data.axes[name].low / from[name], data.axes[name].high / from[name]].sort((a, b) => a - b));
    const by = clip(factor, Math.max(0, ...ends.map(([low]) => low)), Math.min(...ends.map(([, high]) => high)));
    set(Object.fromEntries(names.map(name => [name, +(from[name] * by).toPrecision(7)])), null, !!drag);
  }
  draggable("bode", (x, y) => {
    const [plot] = scales.bode, from = { ...law }, off = (a, b) => {
      const [u, v] = [a, b].map(row => [plot.x.at(row.w) - x, plot.y.at(row.dB) - y]), d = minus(v, u), share = clip(-(u[0] * d[0] + u[1] * d[1]) / (d[0] * d[0] + d[1] * d[1] || 1), 0, 1);
      return size(add(u, times(share, d)));
    };
    const is_near = [own(), sampledCurve()].some(rows => rows.some((row, i) => i && off(rows[i - 1], row) < NEAR));
    return y < plot.y.from && is_near ? (_, to) => scale(from, 10 ** ((plot.y.back(to) - plot.y.back(y)) / 20)) : null;
  });
  $("bode").addEventListener("keydown", event => {
    const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!way) return;
    event.preventDefault();
    scale({ ...law }, 10 ** (way * (event.shiftKey ? 0.05 : 0.5) / 20));
  });
  $("map")?.addEventListener("keydown", event => {
    const ways = { ArrowLeft: [across, -1], ArrowRight: [across, 1], ArrowDown: [up, -1], ArrowUp: [up, 1] }, way = ways[event.key];
    if (!way) return;
    event.preventDefault();
    const [name, side] = way, axis = data.axes[name];
    set({ [name]: gainAt(axis, clip(place(axis, law[name]) + side * (event.shiftKey ? 0.001 : 0.01), 0, 1)) });
  });
  addEventListener("keydown", event => {
    const typing = event.target.type === "number";
    if (event.key === "z" && (event.ctrlKey || event.metaKey || !typing)) { event.preventDefault(); undo(); }
  });
  // What the curves are under the pointer, in words
  pointing("bode", x => {
    if (drag) return;
    const w = scales.bode[0].x.back(x), curve = now.curve(), row = curve.find(each => each.w >= w);
    if (!row) return;
    pointed.bode = row;
    text("reading", `${general(row.w, 5)} rad/s = ${general(hertz(row.w), 5)} Hz: L ${general(row.dB, 4)} dB, ${general(row.angle - 180, 4)}°, S ${general(row.S, 4)} dB, T ${general(row.T, 4)} dB`);
    draw("bode");
    draw("nyquist");
  });
  canvasOf("bode").addEventListener("pointerleave", () => { pointed.bode = null; notes(); draw("bode"); draw("nyquist"); });
  canvasOf("nyquist").addEventListener("wheel", event => { if (event.shiftKey) { event.preventDefault(); zoom = clip(zoom * 1.002 ** (event.deltaY || event.deltaX), 0.02, 50); draw("nyquist"); } }, { passive: false });
  // The gain at the place of a locus that is nearest to the pointer
  function readLocus(name, key, words) {
    pointing(name, (x, y) => {
      if (drag) return;
      const [{ x: across, y: up }] = scales[name];
      let best = null, gap = 30 ** 2;
      for (const row of now[key] || []) { const far = (across.at(row.re) - x) ** 2 + (up.at(row.im) - y) ** 2; if (far < gap) [best, gap] = [row, far]; }
      text("poles-reading", best ? `${state.vary} = ${general(best.gain, 5)}: ${words(best)}` : READ);
      pointed[name] = best;
      draw(name);
    });
  }
  const READ = $("poles-reading").textContent, complex = ({ re, im }) => `${general(re, 5)} ${im < 0 ? "−" : "+"} ${general(Math.abs(im), 5)}i`;
  readLocus("poles", "locus", row => `s = ${complex(row)} 1/s, ${general(hertz(row.im), 4)} Hz${row.im ? `, damping ratio ${dampingRatio([row.re, row.im])}` : ""}`);
  readLocus("zplane", "discs", row => `z = ${complex(row)}, |z| = ${general(size([row.re, row.im]), 5)}`);

  for (const name of names) {
    $(`slider-${name}`).addEventListener("input", event => set({ [name]: gainAt(data.axes[name], +event.target.value) }));
    $(name).addEventListener("change", event => { set({ [name]: event.target.value ? +event.target.value : NaN }); event.target.value = law[name]; });
  }
  for (const [id, act] of Object.entries({ reset: () => set({ ...data.start, ...usual }), recommend: () => set({ ...data.recommended }), undo, copy, save })) $(id)?.addEventListener("click", act);
  for (const id of ["plane", "loop"]) $(id).addEventListener("click", event => { if (event.target.value) set({ [id]: event.target.value }); });
  for (const id of ["vary", "shown", "ratio"]) $(id).addEventListener("change", event => { now.locus = now.discs = null; set({ [id]: event.target.value }); });
  $("more").addEventListener("toggle", () => { if ($("more").open) { card.tables(now); draw("sensor"); } });
  addEventListener("hashchange", () => { if (location.hash.slice(1) !== written) { written = location.hash.slice(1); set(linked()); } });
  addEventListener("resize", () => { set({}); draw("sensor"); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { dress(); set({}); draw("sensor"); });
  take(linked());
  now = numbers(law);
  const sensor = data.sensor && makeSensor(data.sensor, colours, () => draw("sensor")), player = slew && makePlayer(slew, colours, now.run, () => draw("slew", false));
  window.live = { loop, discrete, scales, slew, law, player, sensor, moves: [], set, room, lawFile, past, link, get now() { return now; }, rested: null };
  move();
  window.live.ready = performance.now();
  document.body.dataset.ready = "yes";
})();
