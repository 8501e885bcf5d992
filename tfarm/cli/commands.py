"""The commands on an arm and on measured data.  Packages are imported inside them: `tfarm --help` needs none."""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
import typer

import tfarm
from tfarm.cli.app import add_command
from tfarm.cli.options import (
    ArmName,
    File,
    InputName,
    Png,
    SignalTexts,
    TheoryName,
    chain_of_options,
    interval,
    load_arm,
    load_loop,
    name_and,
    numbers,
    outputs_on,
    read_arm,
    record_of_options,
    refuse,
    runs_of_options,
    together_of_options,
)
from tfarm.cli.output import emit, emit_loop, emit_record
from tfarm.cli.progress import advance, print_line
from tfarm.errors import require

command = partial(add_command, "Arm")
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
OWN_TABLE = "--compare prints a table of its own: ask for one of them"


def check_method(
    number: int,
    *,
    method: Annotated[
        str, typer.Option("--method", help="closed-form, balls, or appendix (the paper's determinant)")
    ] = "closed-form",
    compare: Annotated[
        bool, typer.Option("--compare", help="all three methods and their differences")
    ] = False,
    digits: Annotated[
        int | None, typer.Option("--digits", min=1, max=1000, help="certified digits; texts in JSON above 15")
    ] = None,
) -> tuple[Any, bool, int | None]:
    """Return method, comparison and digits of an answer at that number of points.

    Raises ParameterError for digits, or too many points, by one of the slow methods.
    """
    if method != "closed-form" or compare:
        refuse(
            {"digits": digits}, "they are certified by balls in any case: leave --method and --compare out"
        )
        remedy = "at most 2000 by balls or the appendix, which take milliseconds for each"
        require(number <= 2000, "points", number, remedy)
    return method, compare, digits


@command(epilog="modes sasaki2012-lab --count 5")
def modes(
    *,
    arm: ArmName,
    count: Annotated[int, typer.Option(min=1, max=1000)] = 10,
    certify: bool = False,
    theory: TheoryName = None,
    how: Any = check_method,
    show: Any = emit_record,
) -> None:
    """Natural frequencies, damping ratios and modes, none missing.

    Options:
    count: flexible modes
    certify: prove each bracket, and that no mode is missing
    """
    from tfarm.response.transfer import ByMethods
    from tfarm.spectrum.listing import listed_modes

    found = tfarm.modes(load_arm(arm, theory), count)
    method, is_compared, digits = how(len(found))
    if is_compared:
        refuse({"certify": certify}, OWN_TABLE)
        show(
            ByMethods(found.arm.name, "natural_frequency", "rad/s", found.index.tolist(), found.by_methods())
        )
        return
    listed = listed_modes(found, digits, certify, method)
    show(listed)
    if listed.damped_failure:
        print_line(listed.damped_failure)
        # as where nothing could be solved
        raise typer.Exit(3)


@command(epilog="response sasaki2012-lab --from 1 --to 100 --csv root.csv")
def response(
    *,
    arm: ArmName,
    output: str | None = None,
    s: Annotated[
        Any,
        typer.Option(
            metavar="S,S",
            parser=numbers(
                "numbers in 1/s such as 0.3+57.1j,10j", kind=lambda text: complex(text.replace("i", "j"))
            ),
        ),
    ] = None,
    omega: Annotated[
        Any, typer.Option(metavar="W,W", parser=numbers("frequencies in rad/s such as 1,10,100"))
    ] = None,
    start: Annotated[float, typer.Option("--from")] = 0.1,
    stop: Annotated[float, typer.Option("--to")] = 1000.0,
    points: Annotated[int, typer.Option(min=2, max=1_000_000)] = 500,
    driven: InputName = None,
    measured: Annotated[str | None, typer.Option(metavar="OUTPUT/INPUT=FILE")] = None,
    theory: TheoryName = None,
    along: Any = outputs_on,
    how: Any = check_method,
    show: Any = emit,
) -> None:
    """Exact frequency response of an output, or values at points s.

    The input is the hub torque unless the arm's file names another, and the hub angle of a locked hub.
    With --measured tip_acceleration/hub_angle=sweep.csv it is compared with that response.

    Options:
    output: output, such as tip_displacement; by default root_moment
    s: points s [1/s]: 0.3+57.1j,10j
    omega: frequencies [rad/s]: 1,10,100
    start: lowest frequency [rad/s]
    stop: highest frequency [rad/s]
    points: number of frequencies, logarithmically spaced
    measured: compare with a measured response
    """
    if measured is not None:
        from tfarm.fitting.data import data_of

        own = {"s": s, "omega": omega, "output": output, **along.keywords, "digits": how.keywords["digits"]}
        remedy = "a measured response has its own outputs and frequencies; leave this out"
        refuse(own, remedy)
        show(tfarm.overlay(load_arm(arm, theory), data_of(measured, "--measured")))
        return
    refuse({"png": show.keywords["png"]}, "a picture needs --measured; tfarm bode draws the exact response")
    from tfarm.response.transfer import ByMethods, values_at

    (wanted,), x = along(["root_moment" if output is None else output])
    method = how.keywords["method"]
    G = tfarm.transfer(load_arm(arm, theory, driven), wanted, x=x, method=method, input=driven)
    at = places_of(s, omega, (start, stop), points)
    _, is_compared, digits = how(at.size)
    if is_compared:
        refuse({"csv": show.keywords["csv"], "input": driven if G.load else None}, OWN_TABLE)
        show(ByMethods(G.arm.name, G.outputs[0], G.units[0], at.tolist(), G.by_methods(at)))
        return
    show(values_at(G, at, digits), rows=True)


def places_of(s: Any, omega: Any, limits: tuple[float, float], points: int) -> Any:
    """Return the points s [1/s] that are given, or those at frequencies given or between limits [rad/s]."""
    refuse({"omega": omega if s else None}, "give --s or --omega, not both")
    if s:
        return np.array(s)
    if omega is None:
        check_range(*limits)
        omega = np.geomspace(*limits, points)
    return 1j * np.array(omega)


def check_range(start: float, stop: float) -> None:
    """Raise ParameterError for what is no frequency range [rad/s]."""
    require(0 < start < math.inf, "--from", start, "a positive frequency in rad/s")
    require(start < stop < math.inf, "--to", stop, f"a frequency above --from, {start:g} rad/s")


@command(epilog="bode sasaki2012-lab --output tip_displacement --png bode.png")
def bode(
    *,
    arm: ArmName,
    output: str | None = None,
    start: Annotated[float | None, typer.Option("--from")] = None,
    stop: Annotated[float | None, typer.Option("--to")] = None,
    driven: InputName = None,
    loop: bool = False,
    along: Any = outputs_on,
    under: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Bode plot of the exact response, or of the loop function.

    The response is that to the arm's input, with the poles and zeros of the output.
    With --loop of the loop function at the actuator, with its gain, phase and delay margin; with --period,
    --delay-samples or --dsp of the sampled loop too.

    Options:
    output: output, such as tip_displacement; by default root_moment
    start: lowest frequency [rad/s]
    stop: highest frequency [rad/s]; by default above ten flexible modes
    loop: loop function under the controller, in place of the response of an output
    """
    if loop:
        own = {"output": output, "from": start, "to": stop, **along.keywords, "input": driven}
        remedy = "the loop function has no output and its own frequencies; leave this out"
        refuse(own, remedy)
        emit_loop("loop", arm, under, chain, show)
        return
    from tfarm.response.frequency import resonant_band

    of_loop = {**under.keywords["gains"].keywords, "law": under.keywords["law"], **chain.keywords}
    refuse(
        of_loop,
        "the loop function: give --loop too",
    )
    subject = load_arm(arm, under.keywords["theory"], driven)
    (wanted,), x = along(["root_moment" if output is None else output])
    low, high = resonant_band(tfarm.transfer(subject, wanted, x=x, input=driven).arm)
    if start is not None:
        low = start
    if stop is not None:
        high = stop
    band = (low, high)
    check_range(*band)
    show(tfarm.bode(subject, wanted, band, x=x, input=driven))


@command(epilog="reduce sasaki2012 --outputs root_moment,hub_rate --order 14")
def reduce(
    *,
    arm: ArmName,
    outputs: str = "root_moment,hub_rate",
    order: Annotated[int | None, typer.Option(min=0)] = None,
    error: float | None = None,
    band: Annotated[Any, typer.Option(parser=interval, metavar="LOW,HIGH")] = "0.1,1000",
    method: str | None = None,
    mat: File = None,
    theory: TheoryName = None,
    along: Any = outputs_on,
    show: Any = emit_record,
) -> None:
    """Reduced state-space model, and its error over a range.

    The error is the largest one against the exact arm over the frequency range.

    Options:
    outputs: names separated by commas
    order: number of states; even where C = 0
    error: or the largest error allowed, such as 1e-6
    band: frequency range [rad/s]
    method: modal or aaa; by default that of the smaller error
    mat: write a MATLAB file, and a script of that name
    """
    from tfarm.exported.systems import save_mat

    wanted, x = along([name.strip() for name in outputs.split(",")])
    reduced = tfarm.reduce(
        load_arm(arm, theory), wanted, order=order, error=error, method=cast("Any", method), band=band, x=x
    )
    show(reduced, also=() if mat is None else save_mat(reduced, mat, key="--mat"))


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
    initial: Annotated[str | None, typer.Option(metavar="rest|free")] = None,
    disturbed: bool = False,
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
    initial: motion of the runs at their first sample; by default free
    disturbed: a torque disturbs the runs, or a controller that is not known answers: prediction errors
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
    how: Any = {"initial": initial or "free", "is_disturbed": disturbed}
    runs = [replace(each, **how) for each in read(subject)]
    page = None
    if not runs:
        own = {"initial": initial, "disturbed": disturbed or None}
        refuse({**own, **chain.keywords}, "is of runs: give --run too")
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
        more = [[replace(each, **how) for each in own] for own in more]
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
