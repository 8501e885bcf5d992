"""The commands on measured data.  Packages are imported inside them: `tfarm --help` needs none."""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

import tfarm
from tfarm.cli.app import add_command
from tfarm.cli.options import (
    ArmName,
    File,
    Png,
    SignalTexts,
    TheoryName,
    chain_of_options,
    load_arm,
    name_and,
    numbers,
    read_arm,
    record_of_options,
    refuse,
    runs_of_options,
    together_of_options,
)
from tfarm.cli.output import emit, emit_record
from tfarm.cli.progress import advance, print_line
from tfarm.errors import require
from tfarm.files import write_file

measuring_command = partial(add_command, "Measure")
RecordName = Annotated[
    Path,
    typer.Argument(
        metavar="RECORD",
        exists=True,
        help="CSV, .mat, HDF5, Parquet or UFF file: t [s] and signals",
        show_default=False,
    ),
]
pair = name_and(numbers("KEY=NUMBER,NUMBER", 2))


def conditions_of_runs(
    *,
    initial: Annotated[
        str | None,
        typer.Option(
            "--initial",
            metavar="rest|free",
            help="motion of the runs at their first sample; by default free",
        ),
    ] = None,
    disturbed: Annotated[
        bool,
        typer.Option(
            "--disturbed",
            help="a torque disturbs the runs, or a controller that is not known answers: prediction errors",
        ),
    ] = False,
) -> dict[str, Any]:
    """Return the conditions of runs in a fit, as `RigRun` has them."""
    return {"initial": initial or "free", "is_disturbed": disturbed}


@measuring_command(
    epilog="fit rig.toml --data tip_acceleration/hub_angle=sweep.csv --free link.youngs_modulus,delay --json"
)
def fit(
    *,
    arm: ArmName,
    data: Annotated[list[str] | None, typer.Option(metavar="OUTPUT/INPUT=FILE")] = None,
    free: Annotated[str, typer.Option(metavar="KEY,KEY")] = "",
    start: Annotated[
        list[Any] | None, typer.Option(metavar="KEY=VALUE", parser=name_and(numbers("KEY=NUMBER", 1)))
    ] = None,
    bounds: Annotated[list[Any] | None, typer.Option(metavar="KEY=LO,HI", parser=pair)] = None,
    prior: Annotated[list[Any] | None, typer.Option(metavar="KEY=MEAN,STD", parser=pair)] = None,
    mode: Annotated[list[str] | None, typer.Option(metavar="N=HZ,RATIO")] = None,
    how: Any = conditions_of_runs,
    covariance: bool = False,
    read: Any = runs_of_options,
    together: Any = together_of_options,
    chain: Any = chain_of_options,
    save: File = None,
    png: Png = None,
    report: bool = False,
    out: Annotated[Path, typer.Option(metavar="FOLDER")] = Path("reports"),
    theory: TheoryName = None,
    show: Any = emit_record,
) -> None:
    """Fit of an arm's numbers to responses, runs and ring-downs.

    Each number has its confidence interval.  The runs are those of the exact sampled plant, through the chain of the
    arm's file or of --dsp.

    Options:
    data: measured response; may be repeated
    free: keys of the arm's file, such as link.youngs_modulus; gain, delay; of runs drive.gain, drive.delay, gain:SIGNAL
    start: first value, if not the arm's
    bounds: bounds of a number
    prior: prior mean and deviation
    mode: mode of a ring-down: 1=2.52hz,0.006, with standard deviations 1=2.52hz~0.01,0.006~0.001
    covariance: intervals by the covariance alone, without profiles
    save: write the fitted arm to this TOML file, with the chain of its runs
    report: write the pages of the fitted arm
    out: the folder of the pages
    """
    from tfarm.fitting import model, ratio
    from tfarm.fitting.data import data_of
    from tfarm.fitting.fit import save_fit

    subject = load_arm(arm, theory)
    measured = [data_of(text) for text in data or []]
    runs = [replace(each, **how()) for each in read(subject)]
    page = None
    if not runs:
        refuse({**how.keywords, **chain.keywords}, "is of runs: give --run too")
    for each in measured:
        ratio.check_unit(subject, each)
    others, more, shared = together(read, theory)
    keys = [key.strip() for key in free.split(",") if key.strip()]
    of: Any = {
        "chain": chain(arm),
        "profile": not covariance,
        "progress": advance,
        "start": {key: value for key, (value,) in start or []},
        "bounds": dict(bounds or []),
        "priors": dict(prior or []),
    }
    if others:
        refuse({"data": data, "mode": mode, "report": report}, "is of one arm: leave it out, or --with")
        more = [[replace(each, **how()) for each in own] for own in more]
        found = tfarm.fit_together([subject, *others], keys, runs=[runs, *more], shared=shared, **of)
    else:
        rings = [model.mode_of(text) for text in mode or []]
        found = tfarm.fit(subject, measured, keys, runs=runs, rings=rings, **of)
    if save is not None:
        save_fit(found, save)
    if report:
        from tfarm.report import write

        page = write([found.arm], out, fits=[found], progress=advance, notice=print_line)
    emit(found, png=png, also=(save, page), show=show)
    if not found.converged or found.misses:
        raise typer.Exit(3)


@measuring_command(epilog="predict rig.toml --run record.csv=law.toml --posterior rig.posterior.json")
def predict(
    *,
    arm: ArmName,
    runs: Any = runs_of_options,
    posterior: File = None,
    before: Annotated[str | None, typer.Option(metavar="ARM")] = None,
    without: Annotated[
        list[Any] | None, typer.Option(metavar="KEY=VALUE", parser=name_and(numbers("KEY=NUMBER", 1)))
    ] = None,
    gain: Annotated[
        list[Any] | None, typer.Option(metavar="SIGNAL=VALUE", parser=name_and(numbers("SIGNAL=NUMBER", 1)))
    ] = None,
    draws: Annotated[int, typer.Option(min=2, max=1000)] = 20,
    theory: TheoryName = None,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Prediction of a run that no fit has used, with null models.

    A prediction counts for a signal where it beats them all.

    Options:
    posterior: of the fit, for the band of the prediction
    before: preset or file of the arm before the fit, a null model
    without: number of the fit as it is without it, a null model; such as drive.gain=1 or drive.delay=0
    gain: gain of a sensor, as a fit has it: root_moment=1.02
    draws: number of arms drawn from the posterior
    """
    from tfarm.fitting.posterior import load_posterior

    subject = load_arm(arm, theory)
    found = runs(subject)
    require(len(found) == 1, "--run", len(found), "give one run, which no fit has used")
    earlier = None if before is None else read_arm(before)
    answer = tfarm.predict(
        subject,
        found[0],
        chain(arm),
        before=None if earlier is None else load_arm(earlier, theory),
        before_chain=None if earlier is None else chain(earlier),
        posterior=None if posterior is None else load_posterior(posterior),
        without={key: value for key, (value,) in without or []},
        gains={key: value for key, (value,) in gain or []},
        draws=draws,
    )
    show(answer)


@measuring_command(
    epilog="frf record.csv --input hub_torque --output tip_acceleration=acc1 --save measured.csv"
)
def frf(
    *,
    record: RecordName,
    input: str,
    output: str,
    estimator: str = "H1",
    window: str = "hann",
    segment: float | None = None,
    overlap: float | None = None,
    held: bool = False,
    signal: SignalTexts = None,
    read: Any = record_of_options,
    csv: Annotated[Path | None, typer.Option("--save", "--csv", metavar="FILE")] = None,
    show: Any = emit_record,
) -> None:
    """Frequency response and coherence of a record over time.

    The estimate is that of averaged cross-spectra.

    Options:
    input: such as hub_torque; or hub_torque=COLUMN of the record, as of --signal
    output: such as tip_acceleration; or tip_acceleration=COLUMN
    estimator: H1 (noise on the output), H2 (on the input) or Hv
    window: hann for random excitation, boxcar for whole sweeps
    segment: length of a segment [s]; by default an eighth of the record
    overlap: share of a segment; by default 0.5, or 0 with boxcar
    held: the input is held from each sample to the next, as by a DAC; not of a decimated record
    csv: write the response, for --measured and --data
    """
    from tfarm.fitting.signals import signal_of
    from tfarm.fitting.spectra import frequency_response

    if held and (by := read.keywords["decimate"]) > 1:
        refuse({"decimate": by}, "a filtered input is held no longer; leave --held out")
    signals = [signal_of(text) for text in signal or []]
    names = []
    for key, text in (("--output", output), ("--input", input)):
        own = signal_of(text, key)
        names.append(own.name)
        if text not in [each.name for each in signals]:
            signals.append(own)
    found = frequency_response(
        read(record, signals),
        *names,
        estimator=estimator,
        window=window,
        segment=segment,
        overlap=overlap,
        is_held=held,
    )
    emit(found, csv=csv, rows=True, show=show)


@measuring_command(epilog="ring record.csv --signal root_strain --from 2.5")
def ring(
    *,
    record: RecordName,
    signal: Annotated[list[str], typer.Option("--signal", metavar="NAME=COLUMN", show_default=False)],
    start: Annotated[float | None, typer.Option("--from")] = None,
    stop: Annotated[float | None, typer.Option("--to")] = None,
    modes: Annotated[int, typer.Option(min=1)] = 1,
    read: Any = record_of_options,
    show: Any = emit_record,
) -> None:
    """Frequencies and damping ratios of a decay.

    Each has its confidence interval.

    Options:
    signal: column of the record that decays, as of frf: root_strain, root_strain=gauge*2e-6; and t=COLUMN
    start: time [s] at which the excitation ends
    stop: last time [s]
    modes: number of oscillations
    """
    from tfarm.fitting import decays
    from tfarm.fitting.signals import TIMES, signal_of

    signals = [signal_of(text) for text in signal]
    names = [each.name for each in signals if each.name not in TIMES]
    require(len(names) == 1, "--signal", names, "one signal decays, and the other one is t")
    show(decays.fit_ringdown(read(record, signals), names[0], start=start, stop=stop, modes=modes))


@measuring_command(
    epilog="experiment sasaki2012-lab --free hub.inertia,link.damping --duration 5 --limit 1 --angle 0.5 "
    "--noise hub_angle=1e-3 --noise root_moment=0.01 --csv excitation.csv",
)
def experiment(
    *,
    arm: ArmName,
    free: Annotated[str, typer.Option(metavar="KEY,KEY")],
    duration: float,
    outputs: str = "hub_angle,root_moment",
    noise: Annotated[
        list[Any] | None, typer.Option(metavar="SIGNAL=STD", parser=name_and(numbers("SIGNAL=NUMBER", 1)))
    ] = None,
    limit: Annotated[float | None, typer.Option("--limit", "--torque")] = None,
    angle: float = math.inf,
    rate: float = math.inf,
    c: File = None,
    theory: TheoryName = None,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Excitation whose record determines free numbers best.

    Binary sequences, multisines, sweeps and double steps within the limits, ranked by the intervals to expect
    (D-optimal).  The record is in open loop, at the arm's own numbers.

    Options:
    free: numbers to be fitted: keys of the arm's file, drive.gain, drive.delay, gain:SIGNAL
    duration: length of the record [s]
    outputs: measured signals, separated by commas
    noise: standard deviation of a signal's noise in SI units, if not that of its converter; may be repeated
    limit: largest input, in its unit; by default the chain's
    angle: largest hub angle [rad]
    rate: largest hub rate [rad/s]
    c: write the samples as C
    """
    found = tfarm.experiment(
        load_arm(arm, theory),
        [key.strip() for key in free.split(",") if key.strip()],
        duration,
        limit=limit,
        angle=angle,
        rate=rate,
        outputs=[name.strip() for name in outputs.split(",") if name.strip()],
        noise={name: value for name, (value,) in noise or []},
        chain=chain(arm),
        progress=advance,
    )
    if c is not None:
        from tfarm.exported.excitation import excitation_code

        write_file(c, excitation_code(found), key="--c")
    show(found, also=(c,))
