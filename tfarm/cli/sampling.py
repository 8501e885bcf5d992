"""The verbs of the sampled loop.  Rooms are imported inside them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, TAKEN_OFF
from tfarm.cli.app import ArmName, Json, app, give, load_arm, whole_number
from tfarm.cli.inputs import Given, asked_law, under_a_law

if TYPE_CHECKING:
    from tfarm.dsp import Chain

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
    subject, chain = load_arm(arm), asked_chain(dsp or arm, period, delay_samples)
    law, said = asked_law(subject, given)
    from tfarm.cli.sampling_tables import print_sampled, print_sampled_law
    from tfarm.dsp.verdict import sampled as analysed
    from tfarm.dsp.verdict import sampled_answer, sampled_law_answer

    found = analysed(subject, law, chain, count=count)
    if found.loop.is_of_gains:
        give(sampled_answer(found) | said, json, print_sampled)
    else:
        give(sampled_law_answer(found) | said, json, print_sampled_law)


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
    subject, chain = load_arm(arm), asked_chain(dsp or arm, period, delay_samples)
    from tfarm.dsp.results import simulated_answer

    if controller is None:
        law, said = asked_law(subject, given)
        answer = said | simulated_answer(subject, law, chain, scenario, duration, **how)
    else:
        from tfarm.tuner.trial import load_tuner
        from tfarm.tuner.tuning import controlled_answer

        saved = load_tuner(controller)
        answer = controlled_answer(subject, saved, chain, scenario, duration, **how)
    _show(answer, csv, mat, json)


def _show(answer: dict[str, Any], csv: Path | None, mat: Path | None, json: bool) -> None:
    """The signals to the files asked for, and to standard output as JSON or as a summary."""
    from tfarm.cli import sampling_tables
    from tfarm.cli.tables import say_written

    if csv is not None:
        sampling_tables.write_signals(answer, csv)
    if mat is not None:
        sampling_tables.write_mat(answer, mat)
    sampling_tables.warn_of_runaway(answer)
    if say_written(csv, mat) or json:
        give(answer, json, sampling_tables.print_simulation)
        if not json and csv is None and mat is None:
            print("--json, --csv or --mat give the signals")


def asked_chain(source: str, period: float | None, delay_samples: float | None) -> Chain:
    """The chain of a file, with what the command line says instead."""
    from dataclasses import replace

    from tfarm.dsp.chain import load_chain

    chain = load_chain(source)
    sampling = chain.sampling
    if period is not None:
        sampling = replace(sampling, period=period)
    if delay_samples is not None:
        sampling = replace(sampling, delay_samples=delay_samples)
    return replace(chain, sampling=sampling)
