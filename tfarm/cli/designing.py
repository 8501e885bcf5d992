"""The commands that choose a law, compare, and study uncertain arms."""

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, cast

import typer

import tfarm
from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, RATE_GAIN, TWO_GAINS, Arm
from tfarm.arm.reading import ArmFile
from tfarm.cli.app import add_command
from tfarm.cli.options import (
    CONTROLLER,
    AngleGain,
    ArmName,
    File,
    LawFiles,
    ModeCount,
    Png,
    TheoryName,
    WeightEntries,
    chain_of_options,
    gains_of_options,
    interval,
    law_of_options,
    load_arm,
    load_loop,
    name_and,
    numbers,
    preset_names,
    read_arms,
    refuse,
)
from tfarm.cli.output import emit, emit_record
from tfarm.cli.progress import advance, print_line
from tfarm.files import is_standard_output

command = partial(add_command, "Design")
study_command = partial(add_command, "Study")


@command(epilog="design sasaki2012-lab --structure PD+notch --save notch.toml")
def design(
    *,
    arm: ArmName,
    objective: Annotated[list[str] | None, typer.Option("--minimise", "--objective", metavar="<str>")] = None,
    require: Annotated[list[str] | None, typer.Option("--require", metavar="LIST")] = None,
    structure: Annotated[
        str,
        typer.Option("--structure", help="form of the law, such as PD+notch; any other word lists them all"),
    ] = TWO_GAINS,
    k1: Annotated[
        Any, typer.Option(f"--{RATE_GAIN}", parser=interval, metavar="LO,HI", help=f"bounds of {RATE_GAIN}")
    ] = None,
    k2: Annotated[
        Any,
        typer.Option(f"--{MOMENT_GAIN}", parser=interval, metavar="LO,HI", help=f"bounds of {MOMENT_GAIN}"),
    ] = None,
    kp: AngleGain = 0.0,
    modes: ModeCount = 2,
    continuous: bool = False,
    also: Annotated[list[Any] | None, typer.Option(metavar="ARM", parser=str, callback=read_arms)] = None,
    over: Annotated[
        list[Any] | None, typer.Option("--range", parser=name_and(interval), metavar="KEY=LO,HI")
    ] = None,
    study: Annotated[Path | None, typer.Option("--study", metavar="FILE", exists=True)] = None,
    posterior: Annotated[Path | None, typer.Option("--posterior", metavar="FILE", exists=True)] = None,
    fresh: int | None = None,
    weight: WeightEntries = None,
    trade_off: Annotated[bool, typer.Option("--trade-off")] = False,
    save: File = None,
    theory: TheoryName = None,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Law that meets requirements, with the least settling time.

    Requirements are those of --require, of the file's table [requirements], or else the limits of the grade good.
    The sampling period is that of the file, or else 10 ms.

    Options:
    objective: quantity that is minimised under requirements: settling, time-constant, overshoot, residual, torque, Ms,
        norm, bandwidth^-1 ...; or one without requirements: damping, margin, sensitivity, delay, residual or cost (of
        the tuner)
    require: requirements such as "GM>=6, PM>=45, Ms<=2, delay>=1, damping>=2%, torque<=5, settling<=1.5";
        may be repeated
    study: file of a study: requirements hold on the worst arms of a pool drawn from it
    posterior: posterior of a fit, likewise
    fresh: further arms drawn, on which the law is examined; by default 64
    trade_off: the front of speed against robustness instead: 12 designs; --save FILE writes each to FILE-01.toml ...
    continuous: for the continuous-time loop
    also: further arm; the objective is the worst of all; may be repeated
    over: range of a number of the arm, such as payload.mass=0.1,0.5; up to four: corners, and a search inside
    save: write the law to this TOML file, for --law
    """
    from tfarm.arm.law_tables import load_weights
    from tfarm.arm.writing import save_law
    from tfarm.synthesis.requirements import load_requirements

    first = objective[0] if objective else None
    others = ", ".join((objective or [])[1:])
    refuse({"minimise": others or None}, f"{first} is minimised already: require the others")
    if study is None and posterior is None:
        refuse({"fresh": fresh}, "goes with --study or --posterior")
    subject = load_arm(arm, theory)
    options: dict[str, Any] = {
        "require": ", ".join(require) if require else load_requirements(arm),
        "structure": structure,
        "modes": modes,
        "chain": chain(arm),
        "progress": partial(advance, 0, 0),
        "also": [load_arm(file, theory) for file in also or []],
        RATE_GAIN: k1,
        MOMENT_GAIN: k2,
        ANGLE_GAIN: kp,
        "weights": dict(weight or ()) or load_weights(arm),
    }
    if trade_off:
        unfit = {"range": over, "study": study, "posterior": posterior, "continuous": continuous}
        refuse(unfit, "the front is of given arms and both loops")
        _emit_front(subject, first, options, save, show)
        return
    refuse({name: show.keywords[name] for name in ("csv", "png")}, "goes with --trade-off alone")
    found = tfarm.design(
        subject,
        first,
        continuous=continuous,
        ranges=dict(over or []),
        study=study,
        posterior=posterior,
        fresh=64 if fresh is None else fresh,
        **options,
    )
    case = tfarm.Case(subject, found.law, options["chain"])
    if save is not None:
        save_law(case.law, save)
    show(found, also=(save,), summary=case.card())


def _emit_front(
    arm: Arm, objective: str | None, options: Mapping[str, Any], save: Path | None, show: Any
) -> None:
    """Emit the front of speed against robustness, and write its laws to numbered files."""
    from tfarm.arm.writing import save_law

    is_stream = save is not None and is_standard_output(save)
    refuse({"save": save if is_stream else None}, "a front has several laws; give the name of a file")
    front = tfarm.trade_off(arm, objective, **options)
    files = []
    for n, each in enumerate(front.laws, 1):
        if save is not None:
            files.append(save.with_stem(f"{save.stem}-{n:02}"))
            save_law(tfarm.Case(arm, each).law, files[-1])
    show(front, also=files)


@command(epilog="export sasaki2012-lab --what controller --as c --out firmware")
def export(
    *,
    arm: ArmName,
    what: Annotated[str, typer.Option("--what", help="controller, tuner, plant or loop")],
    form: Annotated[
        str, typer.Option("--as", help="c (C99), fmu, mat (MATLAB, Octave) or py (python-control)")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="folder of the files")],
    tuned: Annotated[Path | None, typer.Option("--tuned", metavar="FILE", exists=True)] = None,
    precision: str = "double",
    ranges: Annotated[
        list[Any] | None,
        typer.Option("--range", parser=name_and(numbers("SIGNAL=VALUE", 1)), metavar="SIGNAL=VALUE"),
    ] = None,
    name: str = "",
    anyway: Annotated[bool, typer.Option("--anyway")] = False,
    loop: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit_record,
) -> None:
    """C code, FMU, MATLAB or Python files of controller, plant, loop.

    An FMU is a functional mock-up unit; the Python file is one for python-control.
    The loop is judged with the numbers as they are rounded in the files.

    Options:
    tuned: trained tuner, written by tune --save
    precision: double, float or q31 (fixed point), of a controller in C
    ranges: largest absolute value of an input or of the output, in SI units; may be repeated
    name: beginning of the identifiers in C
    anyway: also where the loop is not certified stable
    """
    case, defaults = loop(arm)
    found = case.export(
        what=cast("Any", what),
        form=cast("Any", form),
        folder=out,
        chain=chain(arm),
        tuned=tuned,
        precision=cast("Any", precision),
        ranges={signal: size for signal, (size,) in ranges or []},
        name=name,
        anyway=anyway,
    )
    show(found, defaults, also=[out / each for each in found.files])


LearningWord = Annotated[str, typer.Option(rich_help_panel="Learning")]
LearningNumber = Annotated[float, typer.Option(rich_help_panel="Learning")]
CostWeight = Annotated[float, typer.Option(rich_help_panel="Cost")]


def tuner_plan(
    usual: Any,
    gains: dict[str, float],
    *,
    trials: Annotated[int, typer.Option(min=1, max=1_000_000)] = 100,
    signals: str | None = None,
    guard: str = "time-varying",
    duration: float | None = None,
    hidden: Annotated[int, typer.Option(min=1, max=1000)] = 6,
    seventh_input: bool = False,
    modes: Annotated[int, typer.Option(min=1, max=48)] = 6,
    mode: LearningWord = "trial",
    seed: Annotated[int, typer.Option(min=0, max=2**53, rich_help_panel="Learning")] = 0,
    rule: LearningWord = "dynamic",
    sensitivity: LearningWord = "one-step",
    eta: LearningNumber = 0.8,
    alpha: LearningNumber = 0.6,
    enough: LearningNumber = 0.0,
    a: CostWeight = 1.0,
    b: CostWeight = 2.6,
) -> Any:
    """Return the plan of a tuning with these gains, and of the usual one what is None.

    Options:
    trials: slews to learn from
    signals: vibration or total, in x and u; by default that of [slew]
    guard: time-varying (proven), frozen or none
    duration: duration of a trial [s]; by default three slews
    hidden: hidden neurons
    seventh_input: feed K(t-1) to the network too
    modes: flexible modes
    mode: trial: after each slew; online: at every sample
    seed: of the initial weights
    rule: dynamic, clipped or plain: form of (21)
    sensitivity: of the plant, online: one-step (the paper's) or whole
    eta: learning rate
    alpha: momentum, in [0, 1)
    enough: stop once the rms of x is below this [N m]
    a: weight of the root moment, in the arm's unit
    b: weight of the control signal, likewise
    """
    from tfarm import tuner

    named: Any = {"mode": mode, "rule": rule, "sensitivity": sensitivity}
    given = {
        name: value for name, value in (("signals", signals), ("duration", duration)) if value is not None
    }
    return replace(
        usual,
        cost=tuner.Cost(a=a, b=b),
        learning=tuner.Learning(**named, eta=eta, alpha=alpha, enough=enough),
        trials=trials,
        seed=seed,
        count=modes,
        hidden=hidden,
        guard=guard,
        seventh_input=seventh_input,
        **gains,
        **given,
    )


@command(epilog="tune sasaki2012-lab --trials 100 --save tuned.json")
def tune(
    *,
    arm: ArmName,
    k1: Annotated[float | None, typer.Option(f"--{RATE_GAIN}", rich_help_panel=CONTROLLER)] = None,
    kp: AngleGain = 0.0,
    curves: Annotated[int, typer.Option(min=0, max=10_000)] = 0,
    compare: bool = False,
    save: File = None,
    theory: TheoryName = None,
    plan: Any = tuner_plan,
    chain: Any = chain_of_options,
    show: Any = emit_record,
) -> None:
    """Neural tuner of the moment gain, compared with baselines.

    The motion is a slew, and the baselines are simpler controllers.

    Options:
    k1: hub rate gain [N m s/rad]; by default 0.00642 J w1, 0.71 damping with Kp
    curves: learning curves over N seeds (the paper's Figure 5)
    compare: with converters, delay, and on other arms too
    save: write the tuner to this JSON file
    """
    from tfarm import tuner
    from tfarm.studies.candidates import learning_curves
    from tfarm.tuner import trial, tuning

    subject = load_arm(arm, theory)
    sampling = chain(arm)
    typed = {MOMENT_GAIN: 0.0} if k1 is None else {RATE_GAIN: k1, MOMENT_GAIN: 0.0}
    law, defaults = law_of_options(arm, subject, typed)
    rate = cast("tfarm.HubFeedback", law)[RATE_GAIN]
    if k1 is None and kp:
        rate = trial.usual_rate_gain(subject, kp)
        defaults = {
            "default_gains": [RATE_GAIN],
            "default_gains_in_words": f"{RATE_GAIN} = {rate:.4g} (damping ratio 0.71 of the rigid arm under Kp)",
        }
    tuned = tuner.tune(
        subject, plan(tuning.usual_plan(subject, sampling), {RATE_GAIN: rate, ANGLE_GAIN: kp}), sampling
    )
    drawn = learning_curves(subject, tuned.plan, sampling, curves, advance) if curves else None
    compared = tuner.compare_controllers(tuned.trial, tuned.gain(), tuned.training.guard) if compare else None
    if save is not None:
        tuner.save_tuner(tuned.saved(), save)
    found = tuner.TuningResult(tuned, drawn, compared)
    if found.stopped is not None:
        print_line(f"{found.stopped}; the tuner is that of the trial before")
    show(found, defaults, also=(save,))


@study_command(epilog="compare sasaki2012 sasaki2012-lab --png both.png")
def compare(
    *,
    arms: Annotated[
        list[Any],
        typer.Argument(
            metavar="ARM [ARM]",
            help="presets or TOML files",
            parser=str,
            callback=read_arms,
            autocompletion=preset_names,
            show_default=False,
        ),
    ],
    law: LawFiles = None,
    modes: ModeCount = 10,
    output: str = "root_moment",
    theory: TheoryName = None,
    png: Png = None,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER")] = None,
    gains: Any = gains_of_options,
    chain: Any = chain_of_options,
    show: Any = emit_record,
) -> None:
    """Two arms, or two laws on one arm: modes, poles, margins.

    Verdicts are compared too.  Of one arm give --law twice; of two arms once for both, or once for each.

    Options:
    output: output of the Bode plot of two arms
    out: write a page, compare.html, to this folder
    """
    subjects = [load_arm(file, theory) for file in arms]
    files = read_arms(law or [])
    if files:
        laws = [law_of_options(arms[0], subjects[0], gains(), file)[0] for file in files]
    else:
        laws = [
            law_of_options(file, subject, gains())[0] for file, subject in zip(arms, subjects, strict=True)
        ]
    stems = [Path(each.name).stem for each in files]
    candidates = ([each.name for each in subjects], stems, [each.name for each in files])
    names = next((each for each in candidates if len(set(each)) == 2), ())
    found = tfarm.compare(subjects, laws, names=names, modes=modes, output=output, chain=chain(arms[0]))
    page = None
    if out is not None:
        from tfarm.report.writing import write_comparison

        page = write_comparison(found, out)
    emit(found, png=png, also=(page,), show=show)


# ------------------------------------------------------------ studies of uncertain arms


def parse_distribution(text: str) -> dict[str, list[float]]:
    """Return the kind and the numbers of KIND:NUMBER,NUMBER."""
    kind, _, values = text.partition(":")
    form = "KIND:NUMBERS, such as uniform:0,0.2, normal:0.1,0.01, grid:0,1,11 or values:0.1,0.2"
    return {kind: list(numbers(form)(values))}


def announce(done: int, total: int, text: str) -> None:
    """Set the line of progress, and print one without a number of tasks: the cost of Sobol' indices."""
    advance(done, total, text)
    if not total:
        print_line(text)


def study_arguments(
    file: ArmFile, typed: Mapping[str, Any], loop: Callable[..., Any], chain: Callable[..., Any]
) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """Return the arguments of a study, and JSON's part of default gains: those of its file, or those that are typed.

    Raises ParameterError for both.
    """
    from tfarm.ensemble.declaration import load_study

    # an arm's file names no arm
    if "arm" in file.tables:
        refuse(typed, f"the study is that of {file.name}; leave this out")
        return load_study(file), None
    case, defaults = loop(file)
    known = {key: value for key, value in typed.items() if value is not None}
    return {"arm": case.arm, "law": case.law, "chain": chain(file), **known}, defaults


@study_command(
    epilog="study sasaki2012-lab --over payload.mass=uniform:0,0.2 --ask card --draws 100 --out study"
)
def study(
    *,
    arm: ArmName,
    out: Annotated[Path, typer.Option(metavar="DIR", show_default=False)],
    over: Annotated[
        list[Any] | None, typer.Option(metavar="KEY=KIND:NUMBERS", parser=name_and(parse_distribution))
    ] = None,
    ask: Annotated[str | None, typer.Option(metavar="QUANTITY,...")] = None,
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
    loop: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Many uncertain arms: stable share, distributions, worst arm.

    The stable share has a confidence interval, and each quantity its drivers.
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
    from tfarm.studies.running import cluster
    from tfarm.studies.study import study as run

    typed = {
        "over": dict(over or []) or None,
        "ask": ask and ask.split(","),
        "draws": draws,
        "seed": seed,
        "rows": rows,
        "posterior": posterior,
        "worst": worst,
        "sobol": sobol,
    }
    arguments, defaults = study_arguments(arm, typed, loop, chain)
    with nullcontext() if scheduler is None else cluster(scheduler) as client:
        found = run(
            **arguments, out=out, workers=workers, stop_after=stop_after, progress=announce, client=client
        )
    page = None
    if report:
        from tfarm.report.study_page import write_study

        page = write_study(found)
    varies_law = any(key.startswith("law.") for key, _ in over or [])
    show(found, None if varies_law else defaults, also=(page,))
