"""What is said of simulations, and their curves in a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from tfarm.arm import Arm
from tfarm.columns import Column, Table
from tfarm.digits import kept_digits, significant
from tfarm.dsp import Simulation, traces

CURVE_DIGITS = 7  # digits of a curve in its file: a hundredth of the width of a line is four


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
