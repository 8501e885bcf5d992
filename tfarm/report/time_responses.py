"""The slew in time, with and without moment feedback: the paper's Figures 4, 6, 8 and 9 in spirit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.columns import Column, Table
from tfarm.digits import kept_digits, plain, significant
from tfarm.dsp import Simulation, traces
from tfarm.dsp.results import residual_moment_rms, settling_time
from tfarm.dsp.traces import Slews
from tfarm.plots.motion import draw_responses

if TYPE_CHECKING:
    from tfarm.plots.style import Figure

CURVE_DIGITS = 7  # digits of a curve in its file: a hundredth of the width of a line is four


def draw_slews(data: Slews) -> Figure:
    """Root moment, tip and motor torque over time."""
    slew = data.with_moment.chain.slew
    travel = plain(slew.travel_of(data.arm.reach), 3)
    what = f"{travel} m of tip travel in {plain(slew.rise_time, 3)} s, {data.held}"
    return draw_responses(data.arm, data.each, what)


def what_slews_show(data: Slews) -> str:
    """The picture in numbers: what moment feedback does to what is left after the slew."""
    clipped = clipped_words(data.each)
    before, after = residual_moment_rms(data.without), residual_moment_rms(data.with_moment)
    if before is None or after is None:
        gone = [
            f"{name} at {significant(run.stopped.time, 3)} s"
            for name, run in (("without moment feedback", data.without), ("with it", data.with_moment))
            if run.stopped is not None
        ]
        return f"The loop runs away until the arm is folded up: {' and '.join(gone)}.{clipped}"
    settled = []
    for run in (data.without, data.with_moment):
        time = settling_time(run)
        stays = f"the moment stays within 5 % of its largest from {significant(time, 3)} s on"
        never = f"the moment is not settled within {plain(float(run.t[-1]), 4)} s"
        settled.append(stays if math.isfinite(time) else never)
    each = f"Without moment feedback {settled[0]}, with it {settled[1]}"
    both = f"With moment feedback or without it {settled[0]}" if settled[0] == settled[1] else each
    ratio = "" if before == 0 or after == 0 else f", {significant(before / after, 3)} times as much without as with it"
    return (
        f"Root moment left after the slew, less the rigid arm's: {significant(before, 3)} N m rms with "
        f"{MOMENT_GAIN} = 0, {significant(after, 3)} N m with {data.fed_back}{ratio}. "
        f"{both}.{clipped}"
    )


def seen_words(data: Slews) -> str:
    """What the moment feedback sees during the slew."""
    if data.with_moment.chain.slew.reading == "total":
        return "the whole moment"
    return "the moment less the rigid arm's (dashed)"


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


def slews_table(data: Slews, stem: str) -> Table:
    """The curves of the picture."""
    return responses_table(stem, "The slew in time", data.arm, {"without": data.without, "with": data.with_moment})


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
