"""The commands on the sampled loop."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Annotated, Any

import typer

import tfarm
from tfarm.arm import MOMENT_GAIN, RATE_GAIN, TAKEN_OFF
from tfarm.cli.app import (
    ArmName,
    Csv,
    Delay,
    DspFile,
    Gains,
    Json,
    LawFile,
    Period,
    TheoryName,
    emit,
    group,
    load_arm,
    load_chain,
    load_loop,
    print_line,
    with_gains,
)
from tfarm.files import write_file

command = group("Sampled loop")
ModeCount = Annotated[
    int | None, typer.Option("--modes", min=1, max=400, help="flexible modes; by default as many as the result takes")
]
SAMPLED_HELP = f"""Stability of the sampled loop u = -{TAKEN_OFF}: verdict, intervals, modes, margins.

A law of a file acts with its own period, which has to be that of the chain; one in s is made discrete by its rule.
"""


@command("sampled sasaki2012-lab --K1 0.3 --K2 0.3 --period 0.01", help=SAMPLED_HELP)
@with_gains
def sampled(
    arm: ArmName,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    modes: ModeCount = None,
    law: LawFile = None,
    theory: TheoryName = None,
    json: Json = False,
    *,
    gains: Gains,
) -> None:
    """Stability of the sampled loop: verdict, intervals, modes, margins."""
    subject, controller, defaults = load_loop(arm, theory, gains, law)
    chain = load_chain(dsp or arm, period, delay_samples)
    emit(tfarm.sampled(subject, controller, chain, count=modes), json, defaults)


@command("simulate sasaki2012-lab --scenario slew --output tip_rotation --csv slew.csv")
@with_gains
def simulate(
    arm: ArmName,
    scenario: Annotated[str, typer.Option("--scenario", help="slew, step, decay or impulse")] = "slew",
    duration: Annotated[float, typer.Option("--duration", help="duration [s]")] = 3.0,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    modes: ModeCount = None,
    output: Annotated[
        list[str] | None,
        typer.Option("--output", metavar="NAME", help="further signal, as strain@0.05; may be repeated"),
    ] = None,
    between: Annotated[int, typer.Option("--between", min=0, max=1000, help="records between two samples")] = 0,
    csv: Csv = None,
    mat: Annotated[
        Path | None, typer.Option("--mat", metavar="FILE", help="write the signals to a MATLAB file")
    ] = None,
    controller: Annotated[
        Path | None,
        typer.Option(
            "--controller",
            metavar="FILE",
            exists=True,
            help=f"tuner of `tfarm tune --save`: it sets {MOMENT_GAIN}, with its own {RATE_GAIN}",
        ),
    ] = None,
    law: LawFile = None,
    theory: TheoryName = None,
    json: Json = False,
    *,
    gains: Gains,
) -> None:
    """Time response of the sampled loop: hub angle, tip, root moment and torque, exact between the samples."""
    how: Any = {"count": modes, "between": between, "outputs": output or ()}
    chain, defaults = load_chain(dsp or arm, period, delay_samples), None
    if controller is None:
        from tfarm.dsp.results import simulated_run

        subject, control, defaults = load_loop(arm, theory, gains, law)
        found = simulated_run(subject, control, chain, scenario, duration, **how)
    else:
        from tfarm.tuner.trial import load_tuner
        from tfarm.tuner.tuning import controlled_run

        found = controlled_run(load_arm(arm, theory), load_tuner(controller), chain, scenario, duration, **how)
    if mat is not None:
        write_mat(found, mat)
    if found.stopped_at is not None:
        growing = f"mode {found.growing_mode}" if found.growing_mode else "the hub"
        print_line(f"unstable: stopped at {found.stopped_at:.6g} s, {growing} grows")
    emit(found, json, defaults, csv=csv, also=(mat,))


def write_mat(run: Any, path: Path) -> None:
    """Write the signals of a run, and those between its samples, to a MATLAB file (level 5).

    A name is one that MATLAB takes: strain_0_05 of strain@0.05.
    """
    from scipy.io import savemat

    sets = [run.signals, run.between or {}]
    signals, between = (
        {re.sub(r"\W", "_", name): values for name, values in each.items() if len(values)} for each in sets
    )
    data = io.BytesIO()
    savemat(data, signals | ({"between": between} if between else {}), oned_as="column")  # type: ignore[arg-type]
    header = b"MATLAB 5.0 MAT-file, tfarm".ljust(116)  # scipy writes the date here
    write_file(path, header + data.getvalue()[116:], key="--mat")
