"""The commands on the continuous-time loop and on the sampled one."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

import tfarm
from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, AnyLaw, Arm
from tfarm.arm.reading import ArmFile
from tfarm.cli.app import add_command
from tfarm.cli.options import (
    AngleGain,
    ArmName,
    File,
    LawFile,
    TheoryName,
    WeightEntries,
    chain_of_options,
    interval,
    law_of_options,
    load_arm,
    load_driven_loop,
    load_loop,
    name_and,
    refuse,
    without_none,
)
from tfarm.cli.output import emit, emit_loop, emit_record, has_options
from tfarm.cli.progress import print_line
from tfarm.errors import require
from tfarm.files import mat_content, write_file

command = partial(add_command, "Loop")
ModelOrder = Annotated[
    int | None,
    typer.Option("--modes", min=1, max=400, help="flexible modes; by default as many as the result takes"),
]


@command(epilog="poles sasaki2012-lab --K1 0.3 --K2 0.3 --count 8")
def poles(
    *,
    arm: ArmName,
    count: Annotated[int | None, typer.Option(min=1, max=1000)] = None,
    certify: bool = False,
    loop: Any = load_driven_loop,
    show: Any = emit_record,
) -> None:
    """Closed-loop poles of the exact arm, complete in a printed box.

    Options:
    count: poles with Im s >= 0; by default ten, or those below the shear cut-off
    certify: prove each, and that none is missing
    """
    case, defaults = loop(arm)
    found = case.poles(count)
    show(found.with_discs() if certify else found, defaults)


@command(epilog="margins sasaki2012-lab --K1 0.3 --K2 0.3")
def margins(*, arm: ArmName, loop: Any = load_driven_loop, show: Any = emit_record) -> None:
    """Stability, stability interval of each gain, and margins.

    The result card is first.  The margins are those of the exact loop function.
    """
    case, defaults = loop(arm)
    found = case.margins()
    show(found, defaults, summary=case.card(continuous=found))


@command(epilog="nyquist sasaki2012-lab --K1 0.3 --K2 0.3 --png nyquist.png")
def nyquist(*, arm: ArmName, disc: bool = False, loop: Any = load_driven_loop, show: Any = emit) -> None:
    """Nyquist plot of the exact loop, with encirclements of -1.

    Their number is compared with the unstable poles found in a box.

    Options:
    disc: picture of the whole contour in a disc whose rim is infinity, in place of the linear plot with a zoom at -1
    """
    case, defaults = loop(arm)
    show(case.nyquist(), defaults, picture="disc" if disc else "nyquist")


@command(epilog="nichols sasaki2012-lab --K1 0.3 --K2 0.3 --png nichols.png")
def nichols(*, arm: ArmName, loop: Any = load_loop, chain: Any = chain_of_options, show: Any = emit) -> None:
    """Nichols chart of the loop function, with its margins.

    Contours are those of the closed loop.  With --period, --delay-samples or --dsp of the sampled loop too.
    """
    emit_loop("nichols", arm, loop, chain, show)


@command(epilog="sensitivity sasaki2012-lab --K1 0.3 --K2 0.3 --png sensitivity.png")
def sensitivity(
    *, arm: ArmName, loop: Any = load_loop, chain: Any = chain_of_options, show: Any = emit
) -> None:
    """Sensitivity S, complementary sensitivity T, peaks Ms and Mt.

    S = 1/(1 + L) and T = L/(1 + L).  With --period, --delay-samples or --dsp of the sampled loop too.
    """
    emit_loop("sensitivity", arm, loop, chain, show)


@command(epilog="spill sasaki2012-lab --K1 0.3 --K2 -2")
def spill(
    *,
    arm: ArmName,
    modes: Annotated[int, typer.Option(min=1, max=60)] = 20,
    loop: Any = load_driven_loop,
    show: Any = emit_record,
) -> None:
    """Spillover into the modes that a design model leaves out.

    The exact loop is compared with models of 1, 2, 3 ... modes.

    Options:
    modes: modes of the largest model
    """
    case, defaults = loop(arm)
    show(case.spill(modes), defaults)


@command(epilog="locus sasaki2012-lab --vary K2 --from 0 --to 2 --png locus.png")
def locus(
    *,
    arm: ArmName,
    vary: str,
    start: Annotated[float, typer.Option("--from")],
    stop: Annotated[float, typer.Option("--to")],
    points: Annotated[int | None, typer.Option(min=2, max=100_000)] = None,
    branches: Annotated[int, typer.Option(min=1, max=200)] = 10,
    loop: Any = load_driven_loop,
    show: Any = emit,
) -> None:
    """Root locus along a gain or a parameter, with its crossings.

    Poles are those of the exact arm, crossings those of the imaginary axis.

    Options:
    vary: K1, K2, Kp, all (a factor on these), payload_mass, payload_inertia, hub_inertia, length or damping; or gain (a
        factor on the law), delay, SIGNAL, SIGNAL.num.N or SIGNAL.den.N
    start: first value
    stop: last value
    points: values, equally spaced; by default 500, of a number of a law 100
    branches: branches; all flexible modes below the last are listed
    """
    from tfarm.loop.loci import Loci, reduced_of

    case, defaults = loop(arm)
    found = case.locus(vary, start, stop, points, branches)
    show(Loci(found, reduced_of(found)), defaults)


def map_plane(
    file: ArmFile,
    arm: Arm,
    *,
    k1: Annotated[Any, typer.Option(f"--{RATE_GAIN}", parser=interval, metavar="LO,HI")] = None,
    k2: Annotated[Any, typer.Option(f"--{MOMENT_GAIN}", parser=interval, metavar="LO,HI")] = None,
    kp: AngleGain = 0.0,
    points: Annotated[int | None, typer.Option(min=2, max=2000)] = None,
    law: LawFile = None,
    vary: Annotated[list[Any] | None, typer.Option(parser=name_and(interval), metavar="NAME=LO,HI")] = None,
) -> tuple[AnyLaw, dict[str, Any]]:
    """Return the law of a map, and the values of two of its numbers, by name.

    Options:
    k1: range of K1; by default -1,3 on the paper's arm, -3.33 to 10 times the default on a rig
    k2: range of K2; by default -2,2, on a rig times its input of 1 N m
    points: grid points along each; by default 101, of a law 60
    vary: twice: two numbers of a law and their ranges; gain (a factor on the law), delay, SIGNAL, SIGNAL.num.N or
        SIGNAL.den.N
    """
    from tfarm.loop.plane_axes import cell_middles, ranges_of

    controller: AnyLaw
    typed = {RATE_GAIN: k1, MOMENT_GAIN: k2}
    if vary or law:
        remedy = "leave it out: of a law the map is over two of its own numbers, --vary NAME=LO,HI twice"
        refuse({**typed, ANGLE_GAIN: kp or None}, remedy)
        ranges = dict(vary or [])
        remedy = "give two numbers of the law, such as --vary hub_angle=0,10 --vary delay=0,0.02"
        require(len(ranges) == 2, "--vary", [name for name, _ in vary or []], remedy)
        controller, _ = law_of_options(file, arm, {}, law)
    else:
        ranges = {name: typed[name] or usual for name, usual in zip(PLANE, ranges_of(arm), strict=True)}
        controller = tfarm.default_gains(arm).with_number(ANGLE_GAIN, kp)
    number = points or (60 if vary or law else 101)
    return controller, {name: cell_middles(low, high, number) for name, (low, high) in ranges.items()}


@command(epilog="map sasaki2012-lab --K1 -1,3 --K2 -2,2 --png map.png", name="map")
def gain_map(
    *,
    arm: ArmName,
    plane: Any = map_plane,
    theory: TheoryName = None,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Stability region in the plane of two gains, with its boundary.

    The number of unstable poles over two gains, or two numbers of a law; the boundary is exact.
    With --period, --delay-samples or --dsp of the sampled loop.
    """
    from tfarm.dsp.plant import arm_under_chain
    from tfarm.loop.circle_crossings import sampled_map
    from tfarm.loop.sampled_verdict import sampled_verdict

    subject = load_arm(arm, theory)
    controller, axes = plane(arm, subject)
    names: Any = tuple(axes)
    x, y = axes.values()
    if has_options(chain):
        loop = sampled_verdict(tfarm.Case(subject, controller, chain(arm))).full
        found: Any = sampled_map(loop, x, y, vary=names)
    else:
        found = tfarm.map(arm_under_chain(subject, chain(arm))[0], x, y, law=controller, vary=names)
    show(found)


@command(epilog="sampled sasaki2012-lab --K1 0.3 --K2 0.3 --period 0.01")
def sampled(
    *,
    arm: ArmName,
    modes: ModelOrder = None,
    loop: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit_record,
) -> None:
    """Stability, intervals, modes and margins of the sampled loop.

    A law of a file acts with its own period, which has to be that of the chain; one in s is made discrete by its rule.
    """
    case, defaults = loop(arm)
    case = case.through(chain(arm))
    found = case.sampled(count=modes)
    show(found, defaults, summary=case.card(at_samples=found))


@command(epilog="norm sasaki2012-lab --K1 3 --K2 0.15 --weight S=0.5,2/1,0.02 --weight KS=0.1")
def norm(
    *,
    arm: ArmName,
    weight: WeightEntries = None,
    loop: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit_record,
) -> None:
    """H-infinity norms of weighted S, K S and T, with upper bounds.

    They are those of the sampled loop, and the bounds hold between frequencies too.  The weights are those of
    [weights] in the controller's file, else in the arm's; without any S and T have the weight 1.
    """
    from tfarm.arm.law_tables import load_weights

    law = loop.keywords["law"]
    wanted: Any = dict(weight or ()) or (law and load_weights(law)) or load_weights(arm)
    case, defaults = loop(arm)
    show(case.through(chain(arm)).norm(weights=wanted), defaults)


@command(epilog="step sasaki2012-lab --scenario slew --png slew.png")
def step(
    *,
    arm: ArmName,
    scenario: str = "reference",
    duration: float | None = None,
    output: Annotated[list[str] | None, typer.Option(metavar="NAME")] = None,
    settling_band: float = 0.02,
    loop: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Time response: rise, overshoot, settling, residual vibration.

    The loops are the continuous-time and the sampled one; peaks are printed too.

    Options:
    scenario: reference (unit step of the hub angle, or of the hub rate without its feedback), slew, pulse (of torque)
        or deflection (first mode released)
    duration: duration [s]; by default a slew and eight time constants of the dominant pole
    output: further signal of the CSV file, as strain@0.05; may be repeated
    settling_band: share of the travel within which a signal has settled
    """
    case, defaults = loop(arm)
    case = case.through(chain(arm))
    show(case.step(scenario, duration, outputs=output or (), settling_band=settling_band), defaults)


@command(epilog="reference sasaki2012-lab --shaper ZVD --figure reference.png")
def reference(
    *,
    arm: ArmName,
    shaper: str | None = None,
    profile: str | None = None,
    modes: Annotated[int | None, typer.Option("--modes", min=1, max=10)] = None,
    feedforward: str | None = None,
    error: float = 0.3,
    over: Annotated[
        list[Any] | None, typer.Option("--range", parser=name_and(interval), metavar="KEY=LO,HI")
    ] = None,
    loop: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Shaped reference of the slew: impulses, and residual vibration.

    The residual is that of the sampled loop over an error of its frequencies.

    Options:
    shaper: none, ZV, ZVD or EI; by default that of [reference] in the file
    profile: bang-bang, s-curve or polynomial; by default that of [reference]
    modes: the first flexible modes, which are shaped for; by default those of [reference], or two
    feedforward: rigid, inverse (of the exact arm at its hub) or none; by default that of [reference]
    error: largest error of the frequencies, as a share
    over: range of a number such as payload.mass or hub.inertia, over which the residual is bounded; may be repeated
    """
    case, defaults = loop(arm)
    own = chain(arm)
    typed: Any = without_none(
        {"shaper": shaper, "profile": profile, "modes": modes, "feedforward": feedforward}
    )
    if profile is not None:
        typed["file"] = None
    case = case.through(replace(own, reference=replace(own.reference, **typed)))
    show(case.reference(error=error, ranges=dict(over or [])), defaults)


@command(epilog="simulate sasaki2012-lab --scenario slew --output tip_rotation --csv slew.csv")
def simulate(
    *,
    arm: ArmName,
    scenario: str = "slew",
    duration: float = 3.0,
    modes: ModelOrder = None,
    output: Annotated[list[str] | None, typer.Option(metavar="NAME")] = None,
    between: Annotated[int, typer.Option(min=0, max=1000)] = 0,
    mat: File = None,
    animate: File = None,
    controller: Annotated[Path | None, typer.Option(metavar="FILE", exists=True)] = None,
    loop: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Time response of the sampled loop, exact between the samples.

    Its signals are hub angle, tip, root moment and torque.

    Options:
    scenario: slew, step, decay, impulse or pulse
    duration: duration [s]
    output: further signal, as strain@0.05; may be repeated
    between: records between two samples; with --png by default 15
    mat: write the signals to a MATLAB file
    animate: draw the arm in motion into this file, a GIF
    controller: tuner of `tfarm tune --save`: it sets K2, with its own K1
    """
    from tfarm.dsp.results import simulate_scenario

    if animate is not None:
        require(animate.suffix.lower() == ".gif", "--animate", str(animate), "give a name that ends in .gif")
    is_drawn = show.keywords["png"] is not None
    how: Any = {"count": modes, "between": between or 15 * is_drawn, "outputs": output or ()}
    defaults = None
    if controller is None:
        case, defaults = loop(arm)
        found = simulate_scenario(case.through(chain(arm)), scenario, duration, **how)
    else:
        from tfarm.tuner import load_tuner, tuning

        subject = load_arm(arm, loop.keywords["theory"])
        tuner = load_tuner(controller)
        found = tuning.simulate_tuner(subject, tuner, chain(arm), scenario, duration, **how)
    if mat is not None:
        write_file(mat, mat_content(matlab_signals(found), "column"), key="--mat")
    if animate is not None:
        tfarm.plots.animate(found.arm, found.simulation).save(animate)
    if found.stopped_at is not None:
        mode = f"mode {found.growing_mode}" if found.growing_mode else "the hub"
        print_line(f"unstable: stopped at {found.stopped_at:.6g} s, {mode} grows")
    show(found, defaults, also=(mat, animate))


def matlab_signals(found: Any) -> dict[str, Any]:
    """Return the signals of a run under MATLAB's names, strain_0_05 of strain@0.05; those between samples apart."""
    name = partial(re.sub, r"\W", "_")
    signals: dict[str, Any] = {name(key): values for key, values in found.signals.items() if len(values)}
    if found.between:
        signals["between"] = {name(key): values for key, values in found.between.items()}
    return signals
