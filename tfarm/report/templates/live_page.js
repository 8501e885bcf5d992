// The live page: gains from sliders, fields and the map; numbers by LiveLoop, SampledLoop and Slew; charts by Vega.
"use strict";
(() => {
  const $ = id => document.getElementById(id), read = id => JSON.parse($(id).textContent);
  const data = read("live-data"), loop = new LiveLoop(data), law = { ...data.start }, names = ["K1", "K2", "Kp"];
  const discrete = data.sampled_loop && new SampledLoop(data.sampled_loop), slew = data.slew && new Slew(data.slew);
  const dark = matchMedia("(prefers-color-scheme: dark)").matches, REST = 200; // ms without a move until everything is drawn in full
  const colours = dark
    ? { ink: "#f2f2f2", grey: "#a8adb3", faint: "#3a3f45", blue: "#6db3f2", orange: "#f0a05a", green: "#5fc79a" }
    : { ink: "#1a1a1a", grey: "#5a5a5a", faint: "#d9d9d9", blue: "#0060a8", orange: "#c2571a", green: "#00785a" };
  const text = (id, words) => { $(id).textContent = words; };

  // ---------------------------------------------------------------- charts: made when they come into view, and then kept up

  const views = {}, inView = new Set(), charts = {
    map: (now, fine) => ({
      here: [{ K1: now.law.K1, K2: now.law.K2 }],
      ...(views.map && mapped === now.law.Kp ? {} : { edge: loop.kind === "reactive" ? [] : edgeOf(w => loop.boundary(loop.at(w), now.law), loop.base.map(point => point.w), data.axes), areas: now.areas || [], stale: stale(now.law), proven: proven() }),
    }),
    poles: now => ({ poles: now.near.map(([re, im]) => ({ re, im, Hz: general(hertz(im), 5), "damping ratio": dampingRatio([re, im]) })), rays: rays(now.frame), locus: now.locus || [], pointed: [] }),
    zplane: now => ({
      poles: (now.z || []).map(({ z, growth }) => ({ re: z[0], im: z[1], inside: growth < 0, growth: general(growth, 4) })),
      circle: unitCircle(), rays: spirals(), locus: now.discs || [], pointed: [],
    }),
    bode: (now, fine) => ({ curve: now.curve(fine), stems: stems(now.margins, now.curve(fine)[0].w), cursor_at: now.curve(fine).slice(0, 1) }),
    nyquist: (now, fine) => ({ curve: now.curve(fine).filter(row => row.abs < 50), rings: rings(now.margins), cursor_at: [] }),
    slew: (now, fine) => slewSets(slew, now.run, fine ? Math.ceil(20 * slew.fastest(now.run) * slew.period / (2 * Math.PI)) : 0, $("slew").clientWidth),
  };
  if (data.sensor) charts.sensor = () => sensor.sets();
  const made = name => name !== "slew" && name !== "zplane" || (name === "slew" ? slew : discrete);

  // A chart in the colours of the screen, with this arm's axes
  const given = { ...colours, drive: slew ? `${slew.drive} [${slew.unit}]` : "" };
  function spec(name) {
    const found = JSON.parse(JSON.stringify(LIVE_CHARTS[name]).replace(/"@(\w+)"/g, (_, name) => JSON.stringify(given[name])));
    const scale = of => found.scales.find(each => each.name === of);
    if (name === "poles") for (const of of ["x", "y"]) {
      found.signals = [...(found.signals || []), { name: `framed_${of}`, value: now.frame[of] }];
      scale(of).domain = { signal: `framed_${of}` };
    }
    if (name === "map") for (const [of, gain] of [["x", "K1"], ["y", "K2"]]) {
      const { low, high, linear } = data.axes[gain], axis = found.axes.find(each => each.scale === of), unit = data.units[gain];
      Object.assign(scale(of), { domain: [low, high], ...(linear === null ? {} : { type: "symlog", constant: linear }) });
      axis.title = unit === "1" ? gain : `${gain} [${unit}]`;
      if (linear !== null) axis.values = ticks(low, high, linear);
    }
    return found;
  }
  // 0 and powers of ten, each second one where they are many
  function ticks(low, high, linear) {
    const sizes = [...Array(16).keys()].map(k => linear * 10 ** k).filter(x => x <= Math.max(high, -low));
    const shown = sizes.filter((_, i) => sizes.length < 5 || (sizes.length - 1 - i) % 2 === 0);
    return [0, ...shown, ...shown.map(x => -x)].filter(x => low <= x && x <= high);
  }
  async function draw(name) {
    const drawn = spec(name), [width, height] = room(name), sets = charts[name](now, true);
    drawn.width = width;
    if (height) drawn.height = height;
    for (const each of drawn.data) if (sets[each.name]) each.values = sets[each.name];
    views[name] = (await vegaEmbed(`#${name}`, drawn, { mode: "vega", actions: false, renderer: "canvas" })).view;
    if (name === "map") mapped = now.law.Kp;
    begun[name]?.();
  }
  const STACKED = { bode: 580, slew: 520 }; // pixels of charts that are several, one below the other
  function room(name) {
    const wide = Math.max($(name).clientWidth - 70, 200);
    if (name === "sensor") return [Math.min(wide - 40, 420), Math.min(wide, 340)]; // names are at its side
    return STACKED[name] ? [wide, 0] : name === "zplane" ? [Math.min(wide, 340), Math.min(wide, 340)] : [Math.min(wide, 420), Math.min(wide, 340)];
  }
  function fit(name) {
    const [width, height] = room(name);
    views[name].width(width);
    if (height) views[name].height(height);
  }
  const area = (what, list) => list.map(row => ({ ...row, what, part: `${what}${row.part}` })), sampledArea = () => data.sampled_map ? data.sampled_map.areas : [];
  const continuousArea = list => area("stable, continuous", list);
  // The regions where they are known at once: the sampled one is known at Kp = 0 alone, and Kp > 0 moves no edge of a lossless loop
  const areas = ({ Kp }) => !Kp ? [...continuousArea(data.continuous), ...area("stable, sampled", sampledArea())] : loop.kind === "reactive" ? continuousArea(data.continuous) : null;
  const stale = ({ Kp }) => Kp ? area("of Kp = 0", sampledArea()) : [];
  const proven = () => data.lyapunov ? [[0, data.axes.K2.low], [0, 1], [data.axes.K1.high, 1]].map(([K1, K2], t) => ({ K1, K2, t })) : [];
  let mapped = null; // of which Kp the map shows the curve

  // ---------------------------------------------------------------- numbers of these gains

  let now = null; // of the gains last moved to
  now = numbers(law);
  function numbers(gains) {
    const law = { ...gains }, poles = loop.poles(law, now?.poles), [verdict, why] = loop.verdict(law, poles), points = loop.dense(poles, law);
    const margins = verdict.startsWith("stable") ? loop.margins(law, points) : null, near = poles.slice(0, +$("shown").value), top = 1.08 * Math.max(...near.map(s => s[1]), 1), drawn = {};
    const lowest = Math.min(loop.places[0] / 200, ...(margins ? margins.crossed.map(row => row.w / 3) : []));
    const left = 1.15 * Math.min(...near.map(s => s[0]), -1e-4 * top), right = Math.max(-0.05 * left, 1.3 * Math.max(...near.map(s => s[0])));
    return {
      law, poles, verdict, why, margins, near, areas: now?.law.Kp === law.Kp ? now.areas : areas(law), frame: { x: [left, right], y: [0, top] },
      z: discrete && discrete.poles(law, now?.z), run: slew && slew.run(law), curve: fine => drawn[fine] ||= curveOf(loop, law, points, fine, lowest),
    };
  }
  function show() {
    const { law, verdict, why, margins } = now;
    text("verdict", verdict);
    $("verdict").className = `verdict ${verdict.startsWith("stable") ? "ok" : "corrected"}`;
    text("why", why);
    names.forEach(name => { $(`slider-${name}`).value = place(data.axes[name], law[name]); if (document.activeElement !== $(name)) $(name).value = law[name]; });
    const gains = `${data.command_name} --K1 ${law.K1} --K2 ${law.K2} --Kp ${law.Kp}`;
    text("command", `tfarm margins ${gains}`);
    $("map-note").hidden = !law.Kp;
    table(margins);
    rows("pole-rows", now.poles.slice(0, 8).map(s => [general(s[0], 6), general(s[1], 7), general(hertz(s[1]), 5), dampingRatio(s)]));
    showSampled(gains);
    if (slew) showSlew(gains);
  }
  function showSampled(gains) {
    const most = now.z && Math.max(...now.z.map(each => each.growth));
    const word = most > 0 ? "unstable" : most < 0 ? "stable" : "marginal";
    text("sampled", now.z ? word : "not computed");
    $("sampled").className = `verdict ${now.z && most < 0 ? "ok" : "corrected"}`;
    text("sampled-note", now.z ? `dominant pole: ln|z| = ${general(most, 3)} per sample; spectral radius ${general(Math.exp(most), 12)}, of the first ${discrete.modes} mode${discrete.modes > 1 ? "s" : ""}` : "not all sampled poles of these gains were found: not determined");
    text("sampled-command", discrete ? `tfarm sampled ${gains}` : "");
    rows("z-rows", (now.z || []).filter(({ z }) => z[1] > -1e-14).sort((a, b) => b.growth - a.growth).slice(0, 8).map(({ z, growth }) => [general(z[0], 5), general(Math.abs(z[1]) > 1e-14 ? z[1] : 0, 5), general(Math.exp(growth), 7), general(growth, 4)]));
  }
  function showSlew(gains) {
    const { moment, torque, residual, settled } = slew.figures(now.run), stopped = now.run.stopped;
    text("slew-torque", general(torque, 5));
    text("slew-moment", general(moment, 5));
    text("slew-residual", residual === null ? "not computed" : general(residual, 5));
    text("slew-settled", Number.isFinite(settled) ? general(settled, 5) : `not settled within ${general((now.run.n - 1) * slew.period, 5)} s`);
    text("slew-stopped", stopped === null ? "" : `Unstable: simulation stopped at ${general(stopped, 4)} s (deflection limit).`);
    text("slew-command", `tfarm simulate ${gains} --duration ${general(slew.n * slew.period - slew.period, 6)} --modes ${slew.modes}`);
  }
  function table(margins) {
    $("margins").hidden = !margins;
    $("no-margins").hidden = !!margins;
    $("crossovers").hidden = !margins;
    if (!margins) return;
    text("m-gain", `${general(margins.gain[0], 8)} to ${general(margins.gain[1], 8)}`);
    for (const name of ["phase", "phase_lag", "phase_lead", "delay", "disk", "peak_sensitivity", "peak_complementary"]) {
      const { value, at } = margins[name];
      text(`m-${name}`, general(reliable(value), 6));
      text(`at-${name}`, at ? `${general(at, 6)} rad/s = ${general(hertz(at), 5)} Hz` : "");
    }
    text("whole", whole());
    rows("gain-crossovers", margins.crossed.map(({ w, angle }) => [general(w, 7), general(hertz(w), 5), general(angle, 6)]));
    rows("phase-crossovers", margins.crossovers.map(({ w, factor }) => [general(w, 7), general(hertz(w), 5), general(factor, 6)]));
  }
  const reliable = x => Number.isFinite(x) ? +x.toPrecision(9) : x; // to the digits that hold, as `tfarm margins` has it
  function rows(id, cells) {
    $(id).replaceChildren(...cells.map(row => {
      const line = document.createElement("tr");
      line.append(...row.map(cell => Object.assign(document.createElement("td"), { textContent: cell })));
      return line;
    }));
  }
  // What the margins up to the band say of the whole infinite-dimensional loop: `tfarm.loop.margins.margins`
  function whole() {
    if (loop.kind === "quiet") return "Beyond the frequency range L is no nearer to −1: these margins are those of the whole loop.";
    if (loop.kind !== "reactive" || !loop.by_sign) return "Of the whole loop they are not known.";
    return law.K2 ? "Of the whole loop, whose undamped modes have no end, delay and disk margin are 0 and the peaks infinite." : "Of the whole loop, whose undamped modes have no end, the delay margin is 0; the others hold.";
  }

  // ---------------------------------------------------------------- moves: gains change here alone, a frame draws the last of them

  let waiting = false, resting = 0;
  function set(changes) {
    for (const [name, value] of Object.entries(changes)) if (Number.isFinite(value)) law[name] = clip(value, data.axes[name].low, data.axes[name].high);
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; move(); });
  }
  async function move() {
    const start = performance.now();
    clearTimeout(resting);
    now = numbers(law);
    show();
    await keepUp(false);
    player?.show(now.run);
    resting = setTimeout(rest, REST, now);
    window.live.moves.push(performance.now() - start);
  }
  async function keepUp(fine) {
    await Promise.all([...inView].filter(name => views[name] && name !== "sensor").map(name => update(name, fine)));
  }
  function update(name, fine) {
    const view = views[name];
    for (const [of, rows] of Object.entries(charts[name](now, fine))) view.data(of, rows);
    if (name === "poles") view.signal("framed_x", now.frame.x).signal("framed_y", now.frame.y);
    if (name === "map") mapped = now.law.Kp;
    return view.runAsync();
  }
  // All points, and then the region and the loci of the charts in view, a few gains at a time
  const WORK = [["map", "areas", inPlane, "areas"], ["poles", "locus", inS, "locus"], ["zplane", "discs", inZ, "locus"]];
  async function rest(of) {
    if (of.resting) return;
    of.resting = true;
    await keepUp(true);
    for (let next; (next = WORK.find(([name, key]) => views[name] && (name === "poles" || inView.has(name)) && !of[key]));) {
      const [name, key, work, set] = next, found = await inSlices(work(), of);
      if (!found) return;
      of[key] = found;
      await views[name].data(set, found).runAsync();
    }
    of.resting = false;
    window.live.rested = of.law;
  }
  const along = gain => [share => gainAt(data.axes[gain], share, 8), K => ({ ...now.law, [gain]: K })];
  function* inPlane() {
    return continuousArea(yield* regionOf(loop, now.law.Kp, data.axes));
  }
  function inS() {
    const [gain, law] = along($("vary").value), { frame } = now;
    return locus((K, before) => { const found = loop.poles(law(K), before?.found, frame.y[1]); return { points: [...found], found }; }, gain, frame, room("poles"));
  }
  function inZ() {
    const [gain, law] = along($("vary").value), view = { x: [-1.25, 1.25], y: [-1.25, 1.25] };
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

  // ---------------------------------------------------------------- pointing

  const canvas = view => view.container().querySelector("canvas").getBoundingClientRect();
  function drag() {
    const view = views.map;
    let going = false;
    const follow = event => {
      const box = canvas(view), [left, top] = view.origin();
      const x = view.scale("x").invert(event.clientX - box.left - left), y = view.scale("y").invert(event.clientY - box.top - top);
      set({ K1: +x.toPrecision(4), K2: +y.toPrecision(4) });
    };
    view.container().addEventListener("pointerdown", event => { going = true; follow(event); });
    window.addEventListener("pointermove", event => { if (going) follow(event); });
    window.addEventListener("pointerup", () => { going = false; });
    view.container().style.touchAction = "none";
  }
  // What the curves are under the pointer, in words
  function readCurves() {
    const view = views.bode, group = () => view.scenegraph().root.items[0].items.find(mark => mark.marktype === "group").items[0];
    view.container().addEventListener("pointermove", event => {
      const w = view.scale("x").invert(event.clientX - canvas(view).left - view.origin()[0] - group().x), curve = now.curve(true);
      let low = 0, high = curve.length - 1;
      while (high - low > 1) { const middle = (low + high) >> 1; if (curve[middle].w < w) low = middle; else high = middle; }
      const row = curve[high];
      if (!row) return;
      const both = x => `${general(x, 4)} dB (${general(10 ** (x / 20), 4)})`;
      text("reading", `${general(row.w, 5)} rad/s = ${general(hertz(row.w), 5)} Hz: L ${both(row.dB)}, angle of −L ${general(row.angle, 4)}°, S ${both(row.S)}, T ${both(row.T)}`);
      for (const name of ["bode", "nyquist"]) views[name]?.data("cursor_at", [row]).runAsync();
    });
  }
  // The gain at the place of a locus that is nearest to the pointer
  function readLocus(name, key, words) {
    const view = views[name];
    view.container().addEventListener("pointermove", event => {
      const box = canvas(view), x = event.clientX - box.left - view.origin()[0], y = event.clientY - box.top - view.origin()[1], [sx, sy] = [view.scale("x"), view.scale("y")];
      let best = null, gap = 30 ** 2;
      for (const row of now[key] || []) { const far = (sx(row.re) - x) ** 2 + (sy(row.im) - y) ** 2; if (far < gap) [best, gap] = [row, far]; }
      if (best) text(`${name}-reading`, `${$("vary").value} = ${general(best.gain, 5)}: ${words(best)}`);
      view.data("pointed", best ? [best] : []).runAsync();
    });
  }
  const complex = ({ re, im }) => `${general(re, 5)} ${im < 0 ? "−" : "+"} ${general(Math.abs(im), 5)}i`;
  const begun = {
    map: drag,
    bode: readCurves,
    poles: () => readLocus("poles", "locus", row => `s = ${complex(row)} 1/s, ${general(hertz(row.im), 4)} Hz${row.im ? `, damping ratio ${dampingRatio([row.re, row.im])}` : ""}`),
    zplane: () => readLocus("zplane", "discs", row => `z = ${complex(row)}, |z| = ${general(size([row.re, row.im]), 5)}`),
    slew: () => player?.place(views.slew),
    sensor: () => sensor.place(views.sensor),
  };

  for (const name of names) {
    $(`slider-${name}`).addEventListener("input", event => set({ [name]: gainAt(data.axes[name], +event.target.value) }));
    $(name).addEventListener("change", event => set({ [name]: +event.target.value }));
  }
  $("reset").addEventListener("click", () => set(data.start));
  for (const id of ["vary", "shown"]) $(id).addEventListener("change", () => set({}));
  addEventListener("resize", () => { Object.keys(views).forEach(fit); set({}); });
  const sensor = data.sensor && makeSensor(data.sensor, colours), player = slew && makePlayer(slew, colours, now.run);
  window.live = { loop, discrete, slew, law, player, sensor, moves: [], set, room, get now() { return now; }, rested: null };
  show();
  const watcher = new IntersectionObserver(entries => {
    const came = entries.filter(each => each.isIntersecting).map(each => each.target.id);
    entries.forEach(each => inView[each.isIntersecting ? "add" : "delete"](each.target.id));
    Promise.all(came.map(name => views[name] ? update(name, true) : draw(name))).then(() => {
      window.live.ready ??= performance.now();
      document.body.dataset.ready = "yes";
      clearTimeout(resting);
      resting = setTimeout(rest, REST, now);
    });
  }, { rootMargin: "100px" });
  for (const name of Object.keys(charts).filter(made)) {
    $(name).style.minHeight = `${STACKED[name] || room(name)[1] + 60}px`;
    watcher.observe($(name));
  }
})();
