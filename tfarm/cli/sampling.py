"""The verbs of the sampled loop.  Rooms are imported inside them."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, TAKEN_OFF
from tfarm.cli.app import ArmName, Json, app, emit, load_arm, tell, whole_number
from tfarm.cli.inputs import Given, under_a_law
from tfarm.files import write_file

if TYPE_CHECKING:
    from tfarm.dsp import Chain
    from tfarm.dsp.results import Run

Period = Annotated[
    float | None, typer.Option("--period", help="sample period [s]; 0.01 unless the file says otherwise")
]
Delay = Annotated[float | None, typer.Option("--delay-samples", help="computational delay in samples, any fraction")]
DspFile = Annotated[
    str | None,
    typer.Option("--dsp", help="TOML file with [sampling], [converters], [actuator], [slew]; else the arm's own file"),
]
ModeCount = Annotated[
    str | None, typer.Option("--modes", metavar="N", help="flexible modes; as many as it takes if not said")
]
Outputs = Annotated[
    list[str] | None,
    typer.Option("--output", metavar="NAME", help="record this too, as tip_rotation or strain@0.05; once for each"),
]
HELP_ON_SAMPLED = f"""Is the loop u = -{TAKEN_OFF} stable when it is sampled?  Verdict, intervals, modes, margins.

A law of a file acts with its own period, which has to be that of the chain; one in s is made discrete by its rule.
"""
HELP_ON_CONTROLLER = f"a tuner from `tfarm tune --save`: it sets {MOMENT_GAIN}, with its own {RATE_GAIN}"


@app.command(help=HELP_ON_SAMPLED)
@under_a_law
def sampled(
    arm: ArmName,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    modes: ModeCount = None,
    json: Json = False,
    *,
    given: Given,
) -> None:
    """Verdict, intervals, modes and margins of the loop when it is sampled."""
    count = None if modes is None else whole_number("--modes", modes, 1, 400)
    subject, law, said = given.loop()
    chain = asked_chain(dsp or arm, period, delay_samples)
    from tfarm.dsp.verdict import sampled as analysed

    emit(analysed(subject, law, chain, count=count), json, said)


@app.command()
@under_a_law
def simulate(
    arm: ArmName,
    scenario: Annotated[str, typer.Option("--scenario", help="slew, step, decay or impulse")] = "slew",
    duration: Annotated[float, typer.Option("--duration", help="how long [s]")] = 3.0,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    modes: ModeCount = None,
    output: Outputs = None,
    between: Annotated[str, typer.Option("--between", metavar="N", help="records between two samples")] = "0",
    csv: Annotated[Path | None, typer.Option("--csv", help="write the signals to this file")] = None,
    mat: Annotated[Path | None, typer.Option("--mat", help="write the signals to this MATLAB file")] = None,
    controller: Annotated[Path | None, typer.Option("--controller", help=HELP_ON_CONTROLLER)] = None,
    json: Json = False,
    *,
    given: Given,
) -> None:
    """The sampled loop in time: hub angle, tip, root moment and torque, exact between the samples."""
    count = None if modes is None else whole_number("--modes", modes, 1, 400)
    how: Any = {"count": count, "between": whole_number("--between", between, 0, 1000), "outputs": output or ()}
    chain = asked_chain(dsp or arm, period, delay_samples)
    said: Any = None
    if controller is None:
        from tfarm.dsp.results import simulated_run

        subject, law, said = given.loop()
        found = simulated_run(subject, law, chain, scenario, duration, **how)
    else:
        from tfarm.tuner.trial import load_tuner
        from tfarm.tuner.tuning import controlled_run

        found = controlled_run(load_arm(arm, given.theory), load_tuner(controller), chain, scenario, duration, **how)
    if mat is not None:
        _write_mat(found, mat)
    if found.stopped_at is not None:
        grows = f"mode {found.growing_mode}" if found.growing_mode else "the hub"
        tell(f"unstable: stopped at {found.stopped_at:.6g} s, {grows} grows")
    emit(found, json, said, csv=csv, also=(mat,))


def _write_mat(found: Run, path: Path) -> None:
    """The signals at the samples, and those between them, as a MATLAB file (level 5)."""
    from scipy.io import savemat

    signals: dict[str, Any] = {_variable(name): values for name, values in found.signals.items() if len(values)}
    if found.between:
        signals["between"] = {_variable(name): values for name, values in found.between.items()}
    data = io.BytesIO()
    savemat(data, signals, oned_as="column")  # type: ignore[arg-type]  # a stream will do
    content = data.getvalue()
    header = b"MATLAB 5.0 MAT-file, tfarm".ljust(116)  # scipy writes the date here
    write_file(path, header + content[116:], key="--mat")


def _variable(name: str) -> str:
    """A signal's name as MATLAB takes it: strain_0_05 of strain@0.05."""
    return re.sub(r"\W", "_", name)


def asked_chain(source: str, period: float | None, delay_samples: float | None) -> Chain:
    """The chain of a file, with what the command line says instead."""
    from tfarm.dsp.chain import load_chain

    chain = load_chain(source)
    sampling = chain.sampling
    if period is not None:
        sampling = replace(sampling, period=period)
    if delay_samples is not None:
        sampling = replace(sampling, delay_samples=delay_samples)
    return replace(chain, sampling=sampling)
