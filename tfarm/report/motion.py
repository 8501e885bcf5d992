"""Motion in time on an arm's page: slews, and steps that were measured with the exact sampled loop over them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from tfarm.arm import Arm
from tfarm.columns import Column, Table
from tfarm.digits import kept_digits, plain, significant, singly
from tfarm.dsp import Chain, Simulation, traces
from tfarm.dsp.results import drawn, residual_moment_rms, settling_time
from tfarm.dsp.traces import RECORD_LENGTH
from tfarm.errors import ParameterError
from tfarm.fitting.recording import RunComparison, compare_run, overshoot
from tfarm.plots.motion import draw_beside
from tfarm.plots.motion import slew as slew_plot
from tfarm.plots.style import safe
from tfarm.report.cases import LawOnArm
from tfarm.report.sections import Picture, residual_words, typeset, upper

SLEW_CAPTION = (
    "A bang-bang slew with the rigid arm's feedforward. Dotted line: its end. Tip: deviation from a rigid arm on its "
    "reference. "
)

CURVE_DIGITS = 7  # digits of a curve in its file: a hundredth of the width of a line is four
MEASURED_CAPTION = (
    "Grey: what the controller was led by. Orange: measured. Blue: the exact sampled loop, led by the same reference "
    "from rest, with the steps and limits of its chain; drawn from the first reference on. {sources} {assumed}"
)
ASSUMED_WORDS = (
    "The exact loop is linear but for that chain: no dry friction, which on a rig holds the hub off its reference at "
    "the end and at the beginning; the controller starts from rest, without what it had gathered before; nothing is "
    "fitted."
)
OVERSHOOT_CAPTION = (
    "Overshoot: how far the hub goes beyond the last reference, as a share of the whole step; below 0 it never gets "
    "there. Off at the end: hub angle less reference at the last sample. Apart: root mean square of computed less "
    "measured."
)


def clipped_words(each: Mapping[str, Simulation]) -> str:
    """A sentence for every signal that is clipped anywhere; empty where none is."""
    names = {"encoder": "The encoder", "moment": "The strain amplifier", "torque": "The motor or its converter"}
    told = [
        f" {names[signal]} is clipped at {count} of {run.t.size} samples ({name})."
        for name, run in each.items()
        for signal, count in run.saturated.items()
        if count
    ]
    return "".join(told)


def resolution_words(runs: Iterable[Simulation]) -> str:
    """A sentence where a curve is a band, and for how long each piece of it is; empty where all are lines."""
    bands = [one for one in map(traces.root_moment, runs) if one.is_band]
    if not bands:
        return ""
    ms = significant(1e3 * float(bands[0].t[1] - bands[0].t[0]), 2)
    return (
        f" The ringing is too fast to draw as a line: the bands lie between the smallest and the largest value in each "
        f"{ms} ms."
    )


def responses_table(stem: str, title: str, arm: Arm, each: Mapping[str, Simulation]) -> Table:
    """The curves of some simulations of one scenario as they are drawn: a row a point, or a piece of the bands.

    Torques and gains are those held at that time, the rigid arm's moment that of the sample after it.  Numbers have
    `CURVE_DIGITS` digits: a page's folder is no place for six thousand rows of eleven columns to the last bit.
    """
    found = [(key, traces.root_moment(run), traces.tip_deviation(arm, run), run) for key, run in each.items()]
    t = min((moment.t for _, moment, _, _ in found), key=len)
    task = found[0][3].scenario
    rigid = traces.held_at(found[0][3], np.r_[task.rigid_moment[1:], task.rigid_moment[-1:]], t)
    columns: list[Column] = [
        Column("t_s", "time", "s", of=t),
        Column("rigid_moment_N_m", "rigid arm", "N m", of=rigid),
    ]
    for key, moment, tip, run in found:
        columns += moment.at(t).columns(f"root_moment_{key}", "root moment", "N m")
        columns += traces.tip(run).at(t).columns(f"tip_{key}", "tip", "m")
        columns += tip.at(t).columns(f"tip_error_{key}", "tip less reference", "m")
        given = "torque" if arm.input_unit == "N m" else "input"
        name = f"{given}_{key}_{arm.input_unit.replace(' ', '_')}"
        columns.append(Column(name, given, arm.input_unit, of=traces.held_at(run, run.torque, t)))
        if run.gain is not None and np.ptp(run.gain):
            columns.append(Column(f"K_{key}", "gain", of=traces.held_at(run, run.gain, t)))
    columns = [replace(each, of=kept_digits(map(float, each.values), CURVE_DIGITS)) for each in columns]
    return Table(stem=stem, title=title, columns=tuple(columns))


def measured_blocks(named: Sequence[LawOnArm], chain: Chain) -> list[Picture | Table]:
    """Each measured run with the exact loop over it, and both in numbers."""
    runs = [(each, each.given.measured) for each in named if each.given.measured is not None]
    found = {each.name: compare_run(each.arm, each.law, chain, run) for each, run in runs}
    sources = " ".join(f"{name}: {it.measured.source}." for name, it in found.items() if it.measured.source)
    steps = ", ".join(f"{name} by {plain(math.degrees(it.measured.step), 3)} deg" for name, it in found.items())
    picture = Picture(
        stem="sampled-measured",
        title="Measured on the rig, and computed",
        caption=MEASURED_CAPTION.format(sources=sources, assumed=ASSUMED_WORDS),
        alt=f"Hub angle and root moment over time, measured and computed: {steps}.",
        figure=draw_beside("Measured steps, and the exact sampled loop", found),
        data=beside_table({each.key: found[each.name] for each, _ in runs}),
    )
    angles = {name: it for name, it in found.items() if it.measured.hub_angle.size}
    return [picture, *([overshoot_table(angles)] if angles else [])]


MEASURED_QUANTITIES = (  # key, title and unit, of the run and its signals: hub angle and root moment
    ("overshoot", "overshoot", "%", lambda it, angle, _: 100 * overshoot(angle, it.step, float(it.reference[-1]))),
    ("end", "off at the end", "deg", lambda it, angle, _: math.degrees(angle[-1] - it.reference[-1])),
    ("moment", "largest |moment|", "N m", lambda it, _, moment: float(abs(moment).max()) if moment.size else ""),
)
SIGNALS = (
    ("measured", lambda it: (it.measured.hub_angle, it.measured.root_moment)),
    ("computed", lambda it: (it.hub_angle, it.run.at_samples.root_moment)),
)


def overshoot_table(found: Mapping[str, RunComparison]) -> Table:
    """A row a law: overshoot, where it ends, and the greatest moment, measured and computed."""
    three = singly(significant, 3)
    columns = [Column("law", "law", of=list(found)),
               Column("step_deg", "step", "deg", of=[math.degrees(it.measured.step) for it in found.values()],
                      digits=singly(plain, 4))]  # fmt: skip
    for (key, title, unit, quantity), (which, signals) in product(MEASURED_QUANTITIES, SIGNALS):
        values = [quantity(it.measured, *signals(it)) for it in found.values()]
        name = f"{key}_{which}_{unit.replace('%', 'percent').replace(' ', '_')}"
        columns.append(Column(name, which, unit, of=values, digits=three, group=title))
    apart = [math.degrees(it.difference_rms) for it in found.values()]
    columns.append(Column("apart_rms_deg", "apart, rms", "deg", of=apart, digits=three))
    return Table(
        stem="sampled-overshoot",
        title="Measured and computed, in numbers",
        caption=OVERSHOOT_CAPTION,
        columns=tuple(columns),
    )


def beside_table(found: Mapping[str, RunComparison]) -> Table:
    """What the picture draws: a row a sample, measured values taken between their rows."""
    t = min((it.run.t for it in found.values()), key=len)
    columns = [Column("t_s", "time", "s", of=t)]
    for key, it in found.items():
        measured = it.measured
        columns.append(
            Column(f"reference_{key}_rad", "reference", "rad", of=np.interp(t, measured.t, measured.reference))
        )
        for name, unit, values, computed in (
            ("hub_angle", "rad", measured.hub_angle, it.hub_angle),
            ("root_moment", "N_m", measured.root_moment, it.run.at_samples.root_moment),
        ):
            if values.size:
                columns.append(Column(f"{name}_measured_{key}_{unit}", name, of=np.interp(t, measured.t, values)))
            columns.append(Column(f"{name}_computed_{key}_{unit}", name, of=computed[: t.size]))
    return Table(stem="sampled-measured-data", title="Measured and computed", columns=tuple(columns))


def slew(arm: Arm, chain: Chain, cases: Sequence[LawOnArm]) -> tuple[list[Picture | Table], list[str]]:
    """The slew of the chain under each case, and why one is not simulated."""
    runs: dict[str, Simulation] = {}
    words = []
    for each in cases:
        try:
            runs[each.name] = drawn(each.arm, each.law, chain, "slew", RECORD_LENGTH * chain.slew.rise_time)
        except ParameterError as error:
            words.append(f"No slew of {each.name} is simulated: {typeset(str(error))}.")
    simulated = [each for each in cases if each.name in runs]
    if not simulated:
        return [], words
    driven = simulated[0].arm
    if any(each.arm.input_unit != driven.input_unit for each in cases):
        return [], [*words, "The controllers drive inputs of different units: their slews are not drawn together."]
    what = f"{plain(chain.slew.travel_of(arm.reach), 3)} m of tip travel in {plain(chain.slew.rise_time, 3)} s"
    shown = {safe(name): run for name, run in runs.items()}
    figures = " ".join(slew_words(each, runs[each.name]) for each in simulated)
    picture = Picture(
        stem="sampled-slew",
        title="The slew",
        caption=f"{SLEW_CAPTION}{figures}{clipped_words(runs)}{resolution_words(runs.values())}",
        alt=f"Root moment, tip and motor in a slew of {what}. {figures}",
        figure=slew_plot.figure(driven, shown, what),
        data=responses_table("sampled-slew-data", "The slew in time", driven, {e.key: runs[e.name] for e in simulated}),
    )
    return [picture], words


def slew_words(each: LawOnArm, run: Simulation) -> str:
    """Residual moment, settling time and steady-state error of a slew."""
    if run.stopped is not None:
        return f"{upper(each.name)}: unstable; stopped at {significant(run.stopped.time, 3)} s, the arm folded up."
    time = settling_time(run)
    settled = f"settled at {significant(time, 3)} s" if math.isfinite(time) else "not settled within the record"
    end = math.degrees(run.at_samples.hub_angle[-1] - run.scenario.hub_angle[-1])
    return (
        f"{upper(each.name)}: residual root moment {residual_words(residual_moment_rms(run))}, {settled}, hub error at "
        f"the end {plain(end, 3)} deg."
    )
