"""The command for studies of uncertain arms."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from tfarm.cli.app import (
    ArmName,
    Csv,
    Gains,
    Json,
    LawFile,
    Png,
    TheoryName,
    add_command,
    advance,
    emit,
    load_arm,
    load_chain,
    load_law,
    named,
    print_line,
    refuse,
)
from tfarm.errors import require

command = partial(add_command, "Design")


def varied(text: str) -> dict[str, list[float]]:
    """Return the kind and the numbers of KIND:NUMBER,NUMBER."""
    kind, _, numbers = text.partition(":")
    try:
        return {kind: [float(each) for each in numbers.split(",")]}
    except ValueError:
        words = "write KIND:NUMBERS, such as uniform:0,0.2, normal:0.1,0.01, grid:0,1,11 or values:0.1,0.2"
        raise typer.BadParameter(f"{text!r}: {words}") from None


Over = Annotated[
    list[Any] | None,
    typer.Option("--over", metavar="KEY=KIND:NUMBERS", parser=named(varied), help=""),
]
Words = Annotated[str | None, typer.Option("--ask", metavar="QUANTITY,...")]


def announce(done: int, total: int, text: str) -> None:
    """Set the line of progress, and print one without a number of tasks: the cost of Sobol' indices."""
    advance(done, total, text)
    if not total:
        print_line(text)


@command(epilog="study sasaki2012-lab --over payload.mass=uniform:0,0.2 --ask card --draws 100 --out study")
def study(
    arm: ArmName,
    out: Annotated[Path, typer.Option(metavar="DIR", show_default=False)],
    over: Over = None,
    ask: Words = None,
    draws: int | None = None,
    seed: int | None = None,
    rows: Annotated[Path | None, typer.Option("--list", metavar="FILE", exists=True)] = None,
    posterior: Annotated[Path | None, typer.Option(metavar="FILE", exists=True)] = None,
    worst: str | None = None,
    sobol: int | None = None,
    workers: Annotated[int | None, typer.Option(min=1)] = None,
    scheduler: str | None = None,
    stop_after: Annotated[float | None, typer.Option(min=0)] = None,
    report: Annotated[bool, typer.Option("--report")] = False,
    csv: Csv = None,
    png: Png = None,
    law: LawFile = None,
    chain: Any = load_chain,
    theory: TheoryName = None,
    json: Json = False,
    *,
    gains: Gains,
) -> None:
    """Many uncertain arms: stable share with its confidence, distributions, drivers, worst arm.

    ARM is an arm, or the TOML file of a study.  A study that was interrupted goes on when it is run again.

    Options:
    out: folder of the results
    over: varied number: uniform:LOW,HIGH, loguniform, normal:MEAN,DEVIATION, lognormal:MEDIAN,S, grid, values
    ask: card (default), modes, damped_modes, poles, step, tuner, or names of their quantities
    draws: independent draws; by default 1000
    seed: seed of the draws; by default 0
    rows: CSV or Parquet file with a column a key, in the place of draws
    posterior: file that `tfarm fit --save` writes with the fitted arm
    worst: quantity whose worst arm is searched, and written to worst.toml
    sobol: power of 2, size of a sample of its own for Sobol' indices
    workers: processes; by default one a processor
    scheduler: Dask scheduler, such as tcp://host:8786 (trusted networks only) or tls://host:8786
    stop_after: seconds after which no further part is begun
    report: write a page, index.html, to that folder
    """
    from tfarm.arm.reading import load_tables
    from tfarm.studies.running import cluster
    from tfarm.studies.study import load_study
    from tfarm.studies.study import study as run

    typed: dict[str, Any] = {
        "over": dict(over or []) or None, "ask": ask and ask.split(","), "draws": draws, "seed": seed, "rows": rows,
        "posterior": posterior, "worst": worst, "sobol": sobol,
    }  # fmt: skip
    keys = [key for key, _ in over or []]
    require(len(set(keys)) == len(keys), "--over", keys, "a key is varied twice")
    if "arm" in load_tables(arm)[0]:  # an arm's file names no arm
        refuse({f"--{key}": value for key, value in typed.items()}, f"the study is that of {arm}; leave this out")
        arguments, defaults = load_study(arm), None
    else:
        subject = load_arm(arm, theory)
        controller, defaults = load_law(subject, arm, gains, law)
        given = {key: value for key, value in typed.items() if value is not None}
        arguments = {"arm": subject, "law": controller, "chain": chain(arm), **given}
    arguments |= {"out": out, "workers": workers, "stop_after": stop_after, "progress": announce}
    with nullcontext() if scheduler is None else cluster(scheduler) as client:
        found = run(**arguments, client=client)
    page = None
    if report:
        from tfarm.report.writing import write_study

        page = write_study(found)
    emit(found, json, None if any(key.startswith("law.") for key in keys) else defaults, csv=csv, png=png, also=(page,))
