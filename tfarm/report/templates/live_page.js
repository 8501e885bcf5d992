// The live page: gains from sliders, fields and the map; numbers by LiveLoop; charts by Vega.
"use strict";
(() => {
  const $ = id => document.getElementById(id), read = id => JSON.parse($(id).textContent);
  const data = read("live-data"), loop = new LiveLoop(data), law = { ...data.start }, views = {}, names = ["K1", "K2", "Kp"];
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const colours = dark
    ? { ink: "#f2f2f2", grey: "#a8adb3", faint: "#3a3f45", blue: "#6db3f2", orange: "#f0a05a", green: "#5fc79a" }
    : { ink: "#1a1a1a", grey: "#5a5a5a", faint: "#d9d9d9", blue: "#0060a8", orange: "#c2571a", green: "#00785a" };
  const dB = x => 20 * Math.log10(x), hertz = w => w / (2 * Math.PI), clip = (x, a, b) => Math.min(Math.max(x, a), b);
  const text = (id, words) => { $(id).textContent = words; };

  // Where a gain is along its axis, 0 to 1, and back: logarithmic away from 0
  const stretched = ({ linear }, x) => linear === null ? x : Math.sign(x) * Math.log1p(Math.abs(x) / linear);
  const place = (axis, x) => (stretched(axis, x) - stretched(axis, axis.low)) / (stretched(axis, axis.high) - stretched(axis, axis.low));
  const gainAt = (axis, share) => {
    const y = stretched(axis, axis.low) + share * (stretched(axis, axis.high) - stretched(axis, axis.low));
    return +(axis.linear === null ? y : Math.sign(y) * axis.linear * Math.expm1(Math.abs(y))).toPrecision(4);
  };

  // A chart in the colours of the screen, the map with this arm's axes
  function spec(name) {
    const found = JSON.parse(JSON.stringify(LIVE_CHARTS[name]).replace(/"@(\w+)"/g, (_, colour) => JSON.stringify(colours[colour])));
    if (name === "map") for (const [scale, gain] of [["x", "K1"], ["y", "K2"]]) {
      const { low, high, linear } = data.axes[gain], axis = found.axes.find(each => each.scale === scale), unit = data.units[gain];
      const kind = linear === null ? {} : { type: "symlog", constant: linear };
      Object.assign(found.scales.find(each => each.name === scale), { domain: [low, high], ...kind });
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
  // A chart as wide as the room that the page leaves, with its first data in it
  async function draw(name, sets) {
    const made = spec(name), [width, height] = room(name);
    made.width = width;
    if (height) made.height = height;
    for (const each of made.data) if (sets[each.name]) each.values = sets[each.name];
    views[name] = (await vegaEmbed(`#${name}`, made, { mode: "vega", actions: false, renderer: "canvas" })).view;
  }
  function room(name) {
    const wide = Math.max($(name).clientWidth - 70, 200);
    return name === "bode" ? [wide, 0] : [Math.min(wide, 420), Math.min(wide, 340)];
  }
  function fit(name) {
    const [width, height] = room(name);
    views[name].width(width);
    if (height) views[name].height(height);
  }

  // Verdict and tables of these gains; what the charts draw of them
  function show(law) {
    const poles = loop.poles(law), [verdict, why] = loop.verdict(law, poles), points = loop.dense(poles, law);
    const stable = verdict.startsWith("stable"), margins = stable ? loop.margins(law, points) : null;
    text("verdict", verdict);
    $("verdict").className = `verdict ${stable ? "ok" : "corrected"}`;
    text("why", why);
    const [sampled, note] = loop.sampled(law);
    text("sampled", sampled);
    text("sampled-note", note);
    names.forEach(name => { $(`slider-${name}`).value = place(data.axes[name], law[name]); if (document.activeElement !== $(name)) $(name).value = law[name]; });
    text("command", `tfarm margins ${data.command_name} --K1 ${law.K1} --K2 ${law.K2} --Kp ${law.Kp}`);
    $("map-note").hidden = !law.Kp;
    table(margins);
    poleTable(poles);
    return datasets(law, points, margins, poles);
  }

  function table(margins) {
    $("margins").hidden = !margins;
    $("no-margins").hidden = !!margins;
    $("crossovers").hidden = !margins;
    if (!margins) return;
    text("m-gain", `${general(margins.gain[0], 8)} to ${general(margins.gain[1], 8)}`);
    for (const name of ["phase", "phase_lag", "phase_lead", "delay", "disk", "peak_sensitivity", "peak_complementary"]) {
      const { value, at } = margins[name];
      text(`m-${name}`, general(held(value), 6));
      text(`at-${name}`, at ? `${general(at, 6)} rad/s = ${general(hertz(at), 5)} Hz` : "");
    }
    text("whole", whole());
    rows("gain-crossovers", margins.crossed.map(({ w, angle }) => [general(w, 7), general(hertz(w), 5), general(angle, 6)]));
    rows("phase-crossovers", margins.crossovers.map(({ w, factor }) => [general(w, 7), general(hertz(w), 5), general(factor, 6)]));
  }
  const held = x => Number.isFinite(x) ? +x.toPrecision(9) : x; // to the digits that hold, as `tfarm margins` has it
  function rows(id, cells) {
    $(id).replaceChildren(...cells.map(row => {
      const line = document.createElement("tr");
      line.append(...row.map(cell => Object.assign(document.createElement("td"), { textContent: cell })));
      return line;
    }));
  }
  // What the margins up to the band say of the whole infinite-dimensional loop: `tfarm.loop.margins.margins`
  function whole() {
    if (loop.kind === "quiet") return "Beyond the band nothing comes nearer to −1: these margins are those of the whole loop.";
    if (loop.kind !== "reactive" || !loop.told) return "Of the whole loop they are not known.";
    return law.K2 ? "Of the whole loop, whose undamped modes have no end, delay and disk margin are 0 and the peaks infinite." : "Of the whole loop, whose undamped modes have no end, the delay margin is 0; the others hold.";
  }
  const ratio = ([re, im]) => im ? general(-re / Math.hypot(re, im), 4) : "";
  function poleTable(poles) {
    rows("pole-rows", poles.slice(0, 8).map(s => [general(s[0], 6), general(s[1], 7), general(hertz(s[1]), 5), ratio(s)]));
  }

  let curve = [];
  function datasets(law, points, margins, poles) {
    curve = drawn(law, points);
    const near = poles.slice(0, 10), top = Math.max(...near.map(s => s[1]), 1);
    return {
      bode: { curve, stems: [...none(curve[0].w), ...(margins ? stems(margins) : [])], cursor_at: curve.slice(0, 1) },
      nyquist: { curve: curve.filter(row => row.abs < 50), rings: rings(margins), cursor_at: [] },
      poles: {
        poles: near.map(([re, im]) => ({ re, im, Hz: general(hertz(im), 5), "damping ratio": ratio([re, im]) })),
        rays: rays(Math.min(...near.map(s => s[0]), -1e-3 * top), top),
      },
      map: { here: [{ K1: law.K1, K2: law.K2 }], edge: mapped === law.Kp ? [] : edge(law), areas: law.Kp ? [] : areas(), proven: proven() },
    };
  }
  // The curve over w: points that would not be told apart left out, others put in where L turns
  function drawn(law, points) {
    const rows = [], small = L => times(1 / (1 + size(L)), L);
    let branch = 0, last = null;
    const push = point => {
      const [D, N] = point.both || loop.parts(point, law), L = div(N, D), abs = Math.max(size(L), 1e-12), angle = degrees(times(-1, L));
      if (last && Math.abs(angle - last.angle) > 180) branch += 1;
      const sum = Math.max(size(add(D, N)), 1e-300);
      last = { w: point.w, x: L[0], y: L[1], abs, dB: dB(abs), angle, branch, S: dB(size(D) / sum), T: dB(Math.max(size(N) / sum, 1e-12)) };
      rows.push(last);
    };
    for (const point of points) {
      if (point.w < loop.places[0] / 200 || (last && point.w < last.w * (1 + 2e-5))) continue;
      if (last) {
        const [D, N] = point.both, from = last.w;
        const steps = Math.min(12, Math.ceil(size(minus(small(div(N, D)), small([last.x, last.y]))) / 0.03));
        for (let k = 1; k < steps; k++) push(loop.at(from + (point.w - from) * k / steps));
      }
      push(point);
    }
    return rows;
  }
  const proven = () => data.lyapunov ? [[0, data.axes.K2.low], [0, 1], [data.axes.K1.high, 1]].map(([K1, K2], t) => ({ K1, K2, t })) : [];
  // Of each kind one without length: Vega asks every set for its range
  const none = w => ["gain", "phase", "peak"].map(kind => ({ w, kind, low: 0, high: 0 }));
  function stems(margins) {
    const gain = margins.crossovers.filter(row => row.w > 0).map(({ w, factor }) => ({ w, kind: "gain", low: Math.max(-dB(factor), -80), high: 0 }));
    const phase = margins.crossed.map(({ w, angle }) => ({ w, kind: "phase", low: 0, high: angle }));
    const peak = [margins.peak_sensitivity, margins.peak_complementary].map(({ value, at }) => ({ w: at, kind: "peak", low: 0, high: dB(value) }));
    return [...gain, ...phase, ...peak.filter(row => row.w > 0 && Number.isFinite(row.high))];
  }
  function rings(margins) {
    const circle = (ring, centre, radius) => [...Array(121).keys()].map(t => ({ t, ring, x: centre + radius * Math.cos(t * Math.PI / 60), y: radius * Math.sin(t * Math.PI / 60) }));
    const a = margins ? margins.disk.value / 2 : 1; // no L within |1 + L| = a |1 - L|
    const disk = a < 0.9 ? circle("disk margin", -(1 + a * a) / (1 - a * a), 2 * a / (1 - a * a)) : [];
    return [...circle("unit circle", 0, 1), ...disk];
  }
  function rays(left, top) {
    const found = [];
    for (const each of [0.01, 0.02, 0.05, 0.1, 0.2, 0.5]) {
      const slope = each / Math.sqrt(1 - each * each), im = Math.min(top, -left / slope);
      found.push({ ratio: each, re: 0, im: 0, end: false }, { ratio: each, re: -slope * im, im, end: true });
    }
    return found;
  }
  function areas() {
    const rows = (what, list) => list.map(row => ({ ...row, what, part: `${what}${row.part}` }));
    return [...rows("stable, continuous", data.continuous), ...rows("stable, sampled", data.sampled_map ? data.sampled_map.areas : [])];
  }
  // The curve of gains with a pole on the axis, halved where it is coarse, cut where it leaves the map
  function edge(law) {
    if (loop.kind === "reactive") return [];
    const at = w => loop.boundary(loop.at(w), law), found = [], { K1, K2 } = data.axes;
    const placed = row => [place(K1, row.K1), place(K2, row.K2)], seen = ([x, y]) => x > -0.1 && x < 1.1 && y > -0.1 && y < 1.1;
    let piece = 0;
    const trace = (a, b, depth) => {
      const [p, q] = [placed(a), placed(b)], long = size(minus(p, q));
      if (!(seen(p) || seen(q))) return;
      if (long > 0.02 && depth) {
        const middle = at((a.w + b.w) / 2);
        trace(a, middle, depth - 1);
        trace(middle, b, depth - 1);
      } else if (long < 0.2) {
        if (!found.length || found[found.length - 1].w !== a.w) found.push({ ...a, piece: ++piece });
        found.push({ ...b, piece });
      }
    };
    const rows = loop.base.map(point => loop.boundary(point, law));
    rows.slice(1).forEach((row, i) => trace(rows[i], row, 8));
    return found;
  }

  // Gains change here alone; a frame draws the last of them
  let waiting = false;
  function set(changes) {
    for (const [name, value] of Object.entries(changes)) if (Number.isFinite(value)) law[name] = clip(value, data.axes[name].low, data.axes[name].high);
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; move(law); });
  }
  let mapped = null; // of which Kp the map shows the curve
  async function move(gains) {
    const start = performance.now(), sets = show(gains);
    for (const [name, view] of Object.entries(views)) for (const [of, rows] of Object.entries(sets[name])) {
      if (name !== "map" || of === "here" || mapped !== gains.Kp) view.data(of, rows);
    }
    mapped = gains.Kp;
    await Promise.all(Object.values(views).map(view => view.runAsync()));
    window.live.moves.push(performance.now() - start);
  }
  function drag() {
    const view = views.map;
    let going = false;
    const follow = event => {
      const box = view.container().querySelector("canvas").getBoundingClientRect(), [left, top] = view.origin();
      const x = view.scale("x").invert(event.clientX - box.left - left), y = view.scale("y").invert(event.clientY - box.top - top);
      set({ K1: +x.toPrecision(4), K2: +y.toPrecision(4) });
    };
    view.container().addEventListener("pointerdown", event => { going = true; follow(event); });
    window.addEventListener("pointermove", event => { if (going) follow(event); });
    window.addEventListener("pointerup", () => { going = false; });
    view.container().style.touchAction = "none";
  }
  // What the curves are under the pointer, in words
  function hover() {
    const view = views.bode, group = () => view.scenegraph().root.items[0].items.find(mark => mark.marktype === "group").items[0];
    view.container().addEventListener("pointermove", event => {
      const box = view.container().querySelector("canvas").getBoundingClientRect();
      const w = view.scale("x").invert(event.clientX - box.left - view.origin()[0] - group().x);
      let low = 0, high = curve.length - 1;
      while (high - low > 1) { const middle = (low + high) >> 1; if (curve[middle].w < w) low = middle; else high = middle; }
      const row = curve[high];
      if (!row) return;
      const both = x => `${general(x, 4)} dB (${general(10 ** (x / 20), 4)})`;
      text("reading", `${general(row.w, 5)} rad/s = ${general(hertz(row.w), 5)} Hz: L ${both(row.dB)}, angle of −L ${general(row.angle, 4)}°, S ${both(row.S)}, T ${both(row.T)}`);
      view.data("cursor_at", [row]).runAsync();
      views.nyquist.data("cursor_at", [row]).runAsync();
    });
  }

  for (const name of names) {
    $(`slider-${name}`).addEventListener("input", event => set({ [name]: gainAt(data.axes[name], +event.target.value) }));
    $(name).addEventListener("change", event => set({ [name]: +event.target.value }));
  }
  $("reset").addEventListener("click", () => set(data.start));
  addEventListener("resize", () => { Object.keys(views).forEach(fit); set({}); });
  window.live = { loop, law, moves: [], set, move: gains => { Object.assign(law, gains); return move(law); } };
  const sets = show(law);
  Promise.all(["map", "bode", "nyquist", "poles"].map(name => draw(name, sets[name]))).then(() => {
    mapped = law.Kp;
    drag();
    hover();
    window.live.ready = performance.now();
    document.body.dataset.ready = "yes";
  });
})();
