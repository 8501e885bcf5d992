"""The verbs of the sampled loop.  Rooms are imported inside them."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, TAKEN_OFF
from tfarm.cli.app import ArmName, Json, app, emit, give, load_arm, say_written, tell, whole_number
from tfarm.cli.inputs import Given, under_a_law
from tfarm.columns import Column, Table
from tfarm.files import write_file
from tfarm.tables.files import write_csv

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
    if controller is None:
        from tfarm.dsp.results import simulated_answer

        subject, law, said = given.loop()
        answer = said | simulated_answer(subject, law, chain, scenario, duration, **how)
    else:
        from tfarm.tuner.trial import load_tuner
        from tfarm.tuner.tuning import controlled_answer

        saved = load_tuner(controller)
        answer = controlled_answer(load_arm(arm, given.theory), saved, chain, scenario, duration, **how)
    if csv is not None:
        _write_signals(answer, csv)
    if mat is not None:
        _write_mat(answer, mat)
    if answer["stopped_at_s"] is not None:
        what = f"mode {answer['growing_mode']}" if answer["growing_mode"] else "the hub"
        tell(f"unstable: stopped at {answer['stopped_at_s']:.6g} s, {what} grows")
    if say_written(csv, mat) or json:
        give(answer, json, _print_simulation)
        if not json and csv is None and mat is None:
            print("--json, --csv or --mat give the signals")


def _print_simulation(answer: dict[str, Any]) -> None:
    """What the simulation comes to."""
    if "rule_in_words" in answer:
        print(f"{answer['law']}, order {answer['law_order']}, {answer['rule_in_words']}: {answer['sign_convention']}")
    print(f"{answer['arm']}, {answer['scenario_in_words']}: {len(answer['t'])} samples of {answer['period_s']:g} s")
    change, known = answer["modes_change"], "as asked"
    if change is not None:
        known = f"half of them change the signals by {change:.2g} of their largest"
    print(f"{answer['modes_used']} flexible modes{', ' if change is None else ': '}{known}")
    print(f"residual root moment, less the rigid arm's: {_residual(answer)}")
    settled = answer["settling_time_s"]
    print(f"not settled within {answer['t'][-1]:.4g} s" if settled is None else f"settled (5 %) at: {settled:.4g} s")
    print(f"saturated samples: {', '.join(f'{k} {n}' for k, n in answer['saturated_samples'].items())}")
    if answer["limit_cycle"] is not None:
        cycle = answer["limit_cycle"]
        at = cycle["frequency_rad_s"]
        size = f"root moment +-{cycle['root_moment_amplitude']:.4g} N m at {at:.4g} rad/s"
        print(f"limit cycle, kept up by {cycle['kept_up_by']}: {size}")


def _residual(answer: dict[str, Any]) -> str:
    """What is left after the slew, or why that was not computed."""
    residual, stopped = answer["residual_moment_rms"], answer["stopped_at_s"]
    if residual is not None:
        return f"{residual:.6g} N m rms"
    ends = "the record ends before the slew" if stopped is None else f"the run stops at {stopped:.6g} s"
    return f"not computed, as {ends}"


def _write_signals(answer: dict[str, Any], path: Path) -> None:
    """The signals as a table in the order of time, written beside and then renamed.

    Rows between the samples leave empty what changes at the samples only: torque, gain and volts.
    """
    finer = answer.get("between", {"t": []})
    empty, order = [""] * len(finer["t"]), np.argsort([*answer["t"], *finer["t"]], kind="stable")
    columns = []
    for column in _present(answer):
        values = [*answer[column.key], *finer.get(column.key, empty)]
        columns.append(replace(column, of=[values[i] for i in order]))
    write_csv(Table(columns=tuple(columns)), path)


def _write_mat(answer: dict[str, Any], path: Path) -> None:
    """The signals at the samples, and those between them, as a MATLAB file (level 5)."""
    from scipy.io import savemat

    signals: dict[str, Any] = {_variable(each.key): np.array(answer[each.key]) for each in _present(answer)}
    if "between" in answer:
        signals["between"] = {_variable(name): np.array(values) for name, values in answer["between"].items()}
    data = io.BytesIO()
    savemat(data, signals, oned_as="column")  # type: ignore[arg-type]  # a stream will do
    content = data.getvalue()
    header = b"MATLAB 5.0 MAT-file, tfarm".ljust(116)  # scipy writes the date here
    write_file(path, header + content[116:], key="--mat")


def _variable(name: str) -> str:
    """A signal's name as MATLAB takes it: strain_0_05 of strain@0.05."""
    return re.sub(r"\W", "_", name)


def _present(answer: dict[str, Any]) -> list[Column]:
    """The columns of the signals that there are."""
    from tfarm.dsp.results import AT_SAMPLES_COLUMNS, traced_columns

    units, columns = {"torque": answer["torque_unit"]}, (*traced_columns(answer["outputs"]), *AT_SAMPLES_COLUMNS)
    return [replace(each, unit=units.get(each.key, each.unit)) for each in columns if answer.get(each.key)]


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
