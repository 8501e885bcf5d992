"""Mode shapes of the arm, and the arm over time.

Root moment, tip and motor are lines or, where these ring too fast for a page, bands.  Measured runs on a rig are drawn
with their predictions.  Of the tuner its gain and its guard on the map and over time, and
its learning curves.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.patches import Rectangle

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.arrays import Real
from tfarm.assessment.step import Step
from tfarm.digits import how_many, plain, significant
from tfarm.dsp import Simulation, traces
from tfarm.dsp.results import Run
from tfarm.exact.outputs import OUTPUTS, signal_words
from tfarm.fitting.experiment import Experiment
from tfarm.fitting.prediction import Prediction
from tfarm.loop.circle_crossings import GainMap
from tfarm.loop.plane import Plane
from tfarm.plots.frequency import along_hertz
from tfarm.plots.regions import gain_regions
from tfarm.plots.style import (
    BLUE,
    COLOURS,
    DASHED,
    DOTTED,
    FAINT,
    FIGURES,
    GREY,
    INK,
    LONG_DASHED,
    MARGINAL,
    ORANGE,
    REGIONS,
    STABLE,
    UNSTABLE,
    Axes,
    Figure,
    by_name,
    first_of,
    picture,
    safe,
    zero_line,
)
from tfarm.schema import text
from tfarm.spectrum import Modes
from tfarm.tuner import LearningCurves, Tuning

ALONG = "distance from the hub, x [m]"
DISPLACEMENT = "displacement w(x), largest = 1 [−]"
# colour, mark
OF_STABILITY = {"stable": (STABLE, "o"), "marginal": (MARGINAL, "s"), "unstable": (UNSTABLE, "x")}


def scaled_shapes(found: Modes, count: int) -> tuple[Real, dict[int, Real]]:
    """Return places x even along the arm, and w(x) of the first `count` flexible modes by their number.

    Each is scaled to a largest displacement of one, the tip's side positive.
    """
    # about one to a pixel of a picture
    x = np.linspace(0.0, found.arm.length, 401)
    rows = zip(found.index.tolist(), found.shape(x), strict=True)
    return x, {number: w / (float(abs(w).max()) or 1.0) for number, w in rows if 0 < number <= count}


def _flexible(found: Modes) -> int:
    """Return the number of modes that bend."""
    return int((found.index > 0).sum())


def _rows(found: Modes) -> int:
    return math.ceil(_flexible(found) / 2)


def _grid(figure: Figure, found: Modes) -> None:
    axes = figure.subplots(_rows(found), 2, sharey=True).ravel()
    for ax in axes[_flexible(found) :]:
        ax.remove()
    figure.supxlabel(ALONG, fontsize=10.0, color=INK)
    figure.supylabel(DISPLACEMENT, fontsize=10.0, color=INK)


@picture(
    (Modes, "tfarm.modes returns"),
    size=lambda found: (9.0, 0.8 + 1.9 * _rows(found)),
    grid=_grid,
    title=lambda found: f"{found.arm.name}: mode shapes",
)
def modes(found: Modes, *, ax: Sequence[Axes]) -> None:
    """Draw the shapes of flexible modes (from `tfarm.modes`), an axes each, in those given or in new ones; these.

    Displacement along the arm [m], largest 1, with the places of the nodes [m].  Of more modes than axes the first are
    drawn.
    """
    payload = found.arm.payload
    length = found.arm.length
    # width of the hub, as a share of the length
    hub = 0.06 * length
    rows = found.index.tolist()
    x, shapes = scaled_shapes(found, len(ax))
    for one, (number, w) in zip(ax, shapes.items(), strict=False):
        row = rows.index(number)
        nodes = found.nodes[row]
        zero_line(one, 0.8)
        one.plot(x, w, color=BLUE, lw=1.8)
        one.add_patch(Rectangle((-hub, -0.25), hub, 0.5, fc=GREY, ec="none", zorder=3))
        if payload.mass > 0 or payload.inertia > 0:
            one.plot(length, w[-1], "s", ms=8.0, mfc=GREY, mec="none", zorder=3)
        one.plot(nodes, 0 * nodes, "o", ms=5.5, mfc="white", mec=INK, mew=1.3, zorder=4)
        one.set(xlim=(-0.085 * length, 1.11 * length), ylim=(-1.28, 1.28), yticks=[-1, 0, 1])
        one.locator_params(axis="x", nbins=5)
        omega = significant(float(found.natural_frequency[row]), 7)
        hertz = significant(float(found.natural_frequency_hz[row]), 7)
        places = ", ".join(plain(node, 3) for node in nodes.tolist()) or "none"
        one.set_title(f"Mode {number}:  {omega} rad/s  ({hertz} Hz)\nnodes [m]: {places}", fontsize=9.5)
        if not one.figure.get_supylabel():
            one.set(xlabel=ALONG, ylabel=DISPLACEMENT)


# ------------------------------------------------------------ over time


def over_time(ax: Axes, t: Real, label: str) -> None:
    """Make axes of a quantity over time, to its end."""
    ax.set(xlim=(0.0, float(t[-1])), xlabel="time [s]", ylabel=label)


def _mark_end(ax: Axes, t: float) -> None:
    """Draw an upright line where the reference comes to rest."""
    ax.axvline(t, color=INK, lw=0.8, ls=DOTTED)


@picture(
    (Arm, "tfarm.load returns"),
    (Simulation, "tfarm.simulate returns"),
    size=(9.0, 7.0),
    rows=(1.35, 1.0, 1.0),
    title=lambda arm, runs, what="": f"{arm.name}: {what or first_of(runs).scenario.name}",
)
def slew(
    arm: Arm, runs: Simulation | Mapping[str, Simulation], what: str = "", *, ax: Sequence[Axes]
) -> None:
    """Draw simulations of one scenario (from `tfarm.simulate`; several by name) in three axes, given or new; these.

    Root moment [N m], tip less a rigid arm's on its reference [mm], and the torque of the motor [N m], or its input.
    A note above them names records with too few points for the fastest mode that shows.  `what` is their headline.
    """
    each = by_name(runs)
    first = first_of(each)
    scenario = first.scenario
    moment, tip, motor = ax
    t = scenario.t - scenario.period
    rigid = scenario.rigid_moment
    moment.step(t, rigid, where="post", color=GREY, lw=1.0, ls=DASHED, label="rigid arm")
    colours: Sequence[str] = (INK,)
    if len(each) > 1:
        # several begin with one without feedback: no colours of stability
        colours = ("#a3a3a3", INK, "#0b7f93", "#8a6d3b")
    for (name, run), colour in zip(each.items(), cycle(colours), strict=False):
        _draw_curve(traces.curve_of(run, "root_moment"), moment, colour, label=name or None)
        _draw_curve(traces.tip_deviation(arm, run), tip, colour, scale=1e3)
        values = run.torque if run.volts is None else run.volts
        _draw_curve(traces.curve(run.t, values), motor, colour, drawstyle="steps-post")
    driven = _input_label(arm) if first.volts is None else "motor [V]"
    labels = ("root moment [N m]", "tip − reference [mm]", driven)
    for axes, label in zip(ax, labels, strict=True):
        _mark_end(axes, scenario.busy_until)
        zero_line(axes)
        over_time(axes, scenario.t, label)
    points, finer = min(traces.points_a_period(arm, run) for run in each.values())
    enough = traces.POINTS_A_PERIOD
    if points < enough:
        coarse = (
            f"{plain(points, 2)} points a period of the fastest mode shown; between={finer} gives {enough}"
        )
        moment.set_title(coarse, loc="right", fontsize=8.0, color=GREY)


def _draw_curve(curve: traces.TimeCurve, ax: Axes, colour: str, *, scale: float = 1.0, **looks: Any) -> None:
    """Draw the line, or the band."""
    low = scale * curve.low
    high = scale * curve.high
    if not curve.is_band:
        ax.plot(curve.t, low, color=colour, lw=1.3, **looks)
        return
    own: dict[str, Any] = {"color": colour, "alpha": 0.55}
    if looks.get("ls") == DASHED:
        # that of a sampled loop
        own = {"fc": "none", "ec": colour, "hatch": "/////"}
    ax.fill_between(curve.t, low, high, lw=0.8, label=looks.get("label"), **own)


def _draw_signal(ax: Axes, t: Real, y: Real, looks: tuple[str, str], every: int = 0, **how: Any) -> None:
    """Draw a signal at even times; of a sampled loop one of `every` is a sample, marked where these are few."""
    colour, mark = looks
    # rises from point to point that are seen; a line with more turns is a band
    rises = np.diff(y)
    rises = rises[abs(rises) > np.ptp(y) / 3000]
    step = 1
    if np.count_nonzero(np.diff(np.signbit(rises))) <= 400:
        step = math.ceil(t.size / traces.MOST_LINE)
    ls = DASHED if every else "-"
    _draw_curve(traces.curve(t[::step], y[::step]), ax, colour, ls=ls, **how)
    if every and t.size <= 60 * every:
        ax.plot(t[::every], y[::every], mark, color=colour, ms=3.0, mew=1.0)


@picture(
    (Step, "tfarm.step returns"),
    size=(9.0, 10.0),
    rows=(1.0, 1.0, 1.0, 1.0),
    title=lambda found: f"{found.arm.name}: {found.scenario_in_words}",
)
def step(found: Step, *, ax: Sequence[Axes]) -> None:
    """Draw time responses (from `tfarm.step`) in four axes, given or new; these: hub, tip, root moment [N m], input.

    The continuous-time loop is solid, the sampled one dashed; references are grey, with the settling band.  Of an
    unstable loop the part within the range of a stable one is drawn.
    """
    outputs = [OUTPUTS[name.partition("@")[0]] for name in found.names[:-1]]
    labels = [f"{of.label.replace('at x', 'of the tip')} [{of.unit}]" for of in outputs]
    labels.append(_input_label(found.arm))
    t = found.t[found.t <= _end_of_view(found)]
    every = round(found.period / found.t[1])
    for one, name, label in zip(ax, found.names, labels, strict=True):
        zero_line(one)
        over_time(one, t, label)
        reference = found.reference.get(name)
        if reference is not None:
            final = reference[-1]
            low, high = sorted((final * (1 - found.settling_band), final * (1 + found.settling_band)))
            one.axhspan(low, high, color=FAINT, lw=0, alpha=0.6, zorder=0)
            label = f"reference, {text(found.settling_band)}"
            one.plot(t, reference[: t.size], color=GREY, lw=0.8, label=label)
        for loop, each in found.loops.items():
            y = each.signals[name][: t.size]
            label = f"{loop}, {each.stability}"
            samples = every if each is found.sampled else 0
            _draw_signal(one, t[: y.size], y, OF_STABILITY[each.stability], samples, label=label)
        stable = [each.signals[name] for each in found.loops.values() if each.hub]
        if 0 < len(stable) < len(found.loops):
            low = stable[0].min()
            high = stable[0].max()
            # beyond a stable response, of its height
            room = 0.3 * (high - low)
            one.set_ylim(low - room, high + room)


def _end_of_view(found: Step) -> float:
    """Return some time after every signal of a stable loop has settled; infinity where one does not."""
    ends: list[float] = []
    for loop in found.loops.values():
        for signal in (loop.hub, loop.tip, loop.root_moment, loop.torque):
            if signal:
                settled = signal.at_rest_after
                ends.append(math.inf if settled is None else 1.5 * settled)
    return max(ends, default=math.inf)


def _input_label(arm: Arm) -> str:
    if arm.input_unit == "N m":
        return "motor torque [N m]"
    return f"motor [{arm.input_unit}]"


FIGURES.update({Run: lambda run: slew.figure(run.arm, run.simulation, run.scenario_in_words)})


def _signal_names(each: Mapping[str, Prediction]) -> tuple[str, ...]:
    """Return the measured signals of some runs."""
    return tuple(dict.fromkeys(name for found in each.values() for name in found.run.names))


@picture(
    size=lambda each: (max(4.7 * len(each), 6.0), 0.6 + 2.7 * len(_signal_names(each))),
    title=lambda _: "Measured runs, and their predictions",
    grid=lambda figure, each: figure.subplots(
        len(_signal_names(each)), len(each), sharex="col", sharey="row", squeeze=False
    ),
)
def draw_measured_runs(each: Mapping[str, Prediction], *, ax: Sequence[Axes]) -> None:
    """Draw a column a run, in it a signal below the other: reference, measured, predicted with its band."""
    names = _signal_names(each)
    axes = np.reshape(np.array(ax), (-1, len(each)))
    for column, (title, found) in zip(axes.T, each.items(), strict=True):
        for one, name in zip(column, names, strict=True):
            if name in found.run.names:
                _draw_prediction(one, found, name)
            one.label_outer()
        column[0].set_title(safe(title))


@picture(
    (Prediction, "tfarm.predict returns"),
    size=lambda found: (9.0, 0.6 + 2.7 * len(found.run.names)),
    title=lambda found: f"{found.arm_name}: a run, and its prediction",
    grid=lambda figure, found: figure.subplots(len(found.run.names), 1, sharex=True, squeeze=False),
)
def prediction(found: Prediction, *, ax: Sequence[Axes]) -> None:
    """Draw a run and its prediction (from `tfarm.predict`), an axes a signal, in those given or new ones: these."""
    for one, name in zip(np.ravel(np.array(ax)), found.run.names, strict=True):
        _draw_prediction(one, found, name)
        one.label_outer()


def _draw_prediction(ax: Axes, found: Prediction, name: str) -> None:
    """Draw one signal of a run with its prediction; angles in degrees."""
    place = found.run.names.index(name)
    of = OUTPUTS[name.partition("@")[0]]
    unit = of.unit
    scale = 1.0
    if unit == "rad":
        unit = "deg"
        scale = math.degrees(1.0)
    over_time(ax, found.t, f"{of.label} [{unit}]")
    reference = found.run.references.get(name)
    if reference is not None:
        ax.plot(found.t, scale * reference, color=GREY, lw=1.0, ls=DASHED, label="reference")
    ax.plot(found.t, scale * found.measured[place], color=ORANGE, label="measured")
    values = scale * found.predicted[place]
    half = found.halves[place]
    if half is not None:
        reach = scale * half
        label = "95 % of possible arms, with noise"
        ax.fill_between(found.t, values - reach, values + reach, color=BLUE, alpha=0.2, lw=0, label=label)
    ax.plot(found.t, values, color=BLUE, lw=1.2, label="predicted")


@picture(
    (Experiment, "tfarm.experiment returns"),
    size=(9.0, 7.0),
    title=lambda found: f"{found.arm.name}: {found.best}",
    grid=lambda figure, _: figure.subplots(3),
)
def draw_experiment(found: Experiment, *, ax: Sequence[Axes]) -> None:
    """Draw the best excitation, the signals under it over their noise, and its spectrum with the arm's frequencies."""
    upper, middle, lower = ax
    over_time(upper, found.t, _input_label(found.arm))
    upper.step(found.t, found.input, where="post", color=INK, lw=0.8)
    over_time(middle, found.t, "signal over its noise [−]")
    for (name, sigma), colour in zip(found.noise.items(), cycle(COLOURS), strict=False):
        values = found.outputs[name] / sigma
        middle.plot(found.t, values, color=colour, lw=1.0, label=signal_words(name)[0])
    sizes = 2 * abs(np.fft.rfft(found.input)) / found.input.size
    lower.plot(np.fft.rfftfreq(found.input.size, found.period), sizes, color=BLUE, lw=1.0)
    for omega in found.frequencies.tolist():
        lower.axvline(omega / (2 * math.pi), color=INK, lw=0.8, ls=DOTTED)
    amplitude = f"amplitude [{found.arm.input_unit}]"
    along_hertz(lower, "linear", xlim=(0.0, 0.5 / found.period), ylabel=amplitude)


@picture(
    (Tuning, "tfarm.tune returns"),
    size=(7.0, 4.4),
    title=lambda found: f"{found.trial.arm.name}: the tuner's gain, and where it is proven stable",
)
def tuned_gain(found: Tuning, *, ax: Axes) -> None:
    """Draw a tuned gain over time (from `tfarm.tune`) in its guard, in the axes given or new ones; the axes."""
    guard = found.training.guard
    result = found.training.result
    ax.axhspan(
        guard.lo, guard.hi, color=REGIONS[0], lw=0, zorder=0.5, label="guard: proven for any K(t) in it"
    )
    ax.step(result.t, result.K, where="post", color=INK, lw=1.4, label="the tuner's gain K(t)")
    best = found.best_constant.gain
    ax.axhline(best, color=GREY, lw=1.2, ls=LONG_DASHED, label=f"best constant gain, {significant(best, 3)}")
    _mark_end(ax, found.trial.task.busy_until)
    zero_line(ax, 0.7)
    over_time(ax, result.t, f"gain on the root moment, {MOMENT_GAIN} [−]")


@picture(
    size=(9.0, 5.2),
    title=lambda tuning, *_: f"{tuning.trial.arm.name}: the tuner's gain, and where it is proven stable",
    grid=lambda figure, *_: figure.subplots(1, 2, sharey=True, width_ratios=[1.0, 1.35]),
)
def draw_gain(tuning: Tuning, continuous: Plane, sampled: Sequence[GainMap], *, ax: Sequence[Axes]) -> None:
    """Draw left the map, with the guard and in it the gains of the tuner as bars, right the gain over time."""
    left, right = ax
    gain_regions(continuous, sampled, ax=left)
    left.set_title("", loc="right")
    # the mark of one controller: the bar is at its rate gain
    left.lines[-1].remove()
    guard = tuning.training.guard
    K = tuning.training.result.K
    at, _ = tuning.trial.loop.gains.point
    bar = partial(left.plot, [at, at], solid_capstyle="butt", zorder=6)
    bar((guard.lo, guard.hi), color=STABLE, lw=9, alpha=0.75)
    bar((K.min(), K.max()), color=INK, lw=2.4)
    tuned_gain(tuning, ax=right)
    # from 0 to the continuous loop's bound, 1, and a quarter to either side
    left.set_ylim(-0.25, 1.25)
    if right.get_shared_y_axes().joined(left, right):
        right.set_ylabel("")


@picture(
    size=(9.0, 4.4),
    title=lambda curves, tuning: f"{tuning.trial.arm.name}: learning, {how_many(len(curves.costs), 'seed')}",
)
def draw_learning(curves: LearningCurves, tuning: Tuning, *, ax: Axes) -> None:
    """Draw learning curves: each seed, median and quartiles, and baselines; diverged ones leave through the top."""
    trial = np.arange(1, curves.costs.shape[1] + 1)
    # higher costs are drawn at the top edge
    top = 1.25 * tuning.without.cost
    costs = np.minimum(curves.costs, 2 * top)
    low, middle, high = np.minimum([*curves.quartile_curves.values()], 2 * top)
    ax.plot(trial, costs.T, color="#b9b9b9", lw=0.6, zorder=1)
    half = "middle half of the seeds"
    ax.fill_between(trial, low, high, color=BLUE, alpha=0.22, lw=0, zorder=2, label=half)
    ax.plot(trial, middle, color=BLUE, lw=1.8, zorder=3, label="median")
    for cost, ls, label in (
        (tuning.without.cost, DOTTED, "no moment feedback"),
        (tuning.best_constant.cost, DASHED, "best constant gain"),
        (tuning.bound.cost, LONG_DASHED, "linear-quadratic optimum: lower bound"),
    ):
        ax.axhline(cost, color=INK, lw=1.2, ls=ls, zorder=2.5, label=f"{label}, {significant(cost, 3)}")
    ax.set(xlim=(1, max(2, trial[-1])), xlabel="trial number", ylim=(0.0, top), ylabel="cost of a trial [−]")
