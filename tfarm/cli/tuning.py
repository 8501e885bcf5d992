"""The verb of the neural gain tuner.  Rooms are imported inside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, RATE_GAIN
from tfarm.cli.app import ArmName, Json, TheoryName, app, emit, load_arm, progress, tell, whole_number
from tfarm.cli.inputs import HELP_ON_GAINS, Given, asked_gains, with_options
from tfarm.cli.sampling import Delay, DspFile, Period, asked_chain

if TYPE_CHECKING:
    from tfarm.arm import Arm
    from tfarm.dsp import Chain
    from tfarm.tuner import Plan

HELP_ON_ANGLE_GAIN = f"hub angle gain: the reference is tracked, {RATE_GAIN} damps that by 0.71 if not given"


PLAN: dict[str, tuple[Any, Any]] = {  # of each option of a plan its type and what it is if not given
    "trials": (Annotated[str, typer.Option("--trials", metavar="N", help="slews to learn from")], "100"),
    "mode": (Annotated[str, typer.Option("--mode", help="trial: learn after each slew; online: at every sample")],
             "trial"),
    "signals": (Annotated[str | None, typer.Option("--signals", help="vibration or total: what x and u contain; as "
                                                   "[slew] of the file says if not given")], None),
    "seed": (Annotated[str, typer.Option("--seed", metavar="N", help="of the initial weights")], "0"),
    "curves": (Annotated[str, typer.Option("--curves", metavar="N", help="add learning curves over N seeds "
                                           "(the paper's Figure 5)")], "0"),
    "guard": (Annotated[str, typer.Option("--guard", help="time-varying (proven), frozen or none")], "time-varying"),
    "rule": (Annotated[str, typer.Option("--rule", help="dynamic, clipped or plain: how (21) is made robust")],
             "dynamic"),
    "sensitivity": (
        Annotated[str, typer.Option("--sensitivity", help="of the plant, online: one-step (the paper's) or whole")],
        "one-step",
    ),
    "eta": (Annotated[float, typer.Option("--eta", help="learning rate")], 0.8),
    "alpha": (Annotated[float, typer.Option("--alpha", help="momentum, in [0, 1)")], 0.6),
    "a": (Annotated[float, typer.Option("--a", help="weight of the root moment in the cost, in the arm's unit")], 1.0),
    "b": (Annotated[float, typer.Option("--b", help="weight of the control signal in the cost, likewise")], 2.6),
    "on_rate": (Annotated[float | None, typer.Option(f"--{RATE_GAIN}", help=HELP_ON_GAINS[RATE_GAIN])], None),
    "on_angle": (Annotated[float, typer.Option(f"--{ANGLE_GAIN}", help=HELP_ON_ANGLE_GAIN)], 0.0),
    "duration": (Annotated[float | None, typer.Option("--duration", help="of a trial [s]; three slews if not given")],
                 None),
    "enough": (Annotated[float, typer.Option("--enough", help="stop once the rms of x is below this [N m]")], 0.0),
    "hidden": (Annotated[str, typer.Option("--hidden", metavar="N", help="hidden neurons")], "6"),
    "seventh_input": (Annotated[bool, typer.Option("--seventh-input", help="feed K(t-1) to the network too")], False),
    "modes": (Annotated[str, typer.Option("--modes", metavar="N", help="flexible modes")], "6"),
}  # fmt: skip
WHOLE = {  # whole numbers, and their ranges
    "trials": (1, 1_000_000),
    "seed": (0, 2**53),
    "curves": (0, 10_000),
    "hidden": (1, 1000),
    "modes": (1, 48),
}
OF_LEARNING, AS_TYPED = (
    ("mode", "rule", "sensitivity", "eta", "alpha", "enough"),
    ("signals", "guard", "duration", "seventh_input"),
)


@app.command()
@with_options(
    {name: kind for name, (kind, _) in PLAN.items()}, "arm", defaults={name: usual for name, (_, usual) in PLAN.items()}
)
def tune(
    arm: ArmName,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    compare: Annotated[bool, typer.Option("--compare", help="with converters, delay, and on other arms too")] = False,
    save: Annotated[Path | None, typer.Option("--save", help="write the tuner to this JSON file")] = None,
    theory: TheoryName = None,
    json: Json = False,
    *,
    typed: dict[str, Any],
) -> None:
    """Train the network that sets the moment gain during a slew, and hold it against simpler remedies."""
    whole = {name: whole_number(f"--{name}", typed[name], *limits) for name, limits in WHOLE.items()}
    subject, chain = load_arm(arm, theory), asked_chain(dsp or arm, period, delay_samples)
    from tfarm import tuner

    plan, said = _plan(subject, chain, typed, whole)
    tuning = tuner.tune(subject, plan, chain)
    curves = comparison = None
    if whole["curves"]:
        with progress() as advance:
            curves = tuner.learning_curves(tuning, whole["curves"], advance)
    if compare:
        comparison = tuner.compare_controllers(tuning.trial, tuning.gain(), tuning.training.guard)
    if save is not None:
        tuner.save_tuner(tuning.saved(), save)
    found = tuner.TuningResult(tuning, curves, comparison)
    if found.stopped is not None:
        tell(f"{found.stopped}; the tuner is that of the trial before")
    emit(found, json, said, also=(save,))


def _plan(subject: Arm, chain: Chain, typed: dict[str, Any], whole: dict[str, int]) -> tuple[Plan, dict[str, Any]]:
    """The plan that is typed, and what the answer says of a rate gain that was not."""
    from tfarm import tuner
    from tfarm.tuner.tuning import usual_plan

    servo, said = _servo_gains(subject, typed["on_rate"], typed["on_angle"])
    plan = replace(
        usual_plan(subject, chain),
        cost=tuner.Cost(a=typed["a"], b=typed["b"]),
        learning=tuner.Learning(**{name: typed[name] for name in OF_LEARNING}),
        trials=whole["trials"],
        seed=whole["seed"],
        count=whole["modes"],
        hidden=whole["hidden"],
        **{name: typed[name] for name in AS_TYPED if typed[name] is not None},
        **servo,
    )
    return plan, said


def _servo_gains(subject: Arm, on_rate: float | None, on_angle: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """The gains of the servo, and what the answer says of a rate gain that was not given: it damps a held angle."""
    from tfarm.tuner.trial import usual_rate_gain

    if on_rate is not None or on_angle == 0.0:
        law, said = asked_gains(subject, Given({RATE_GAIN: on_rate, MOMENT_GAIN: 0.0}))
        return {RATE_GAIN: law[RATE_GAIN], ANGLE_GAIN: on_angle}, said
    usual = usual_rate_gain(subject, on_angle)
    words = f"{RATE_GAIN} = {usual:.4g}, which damps the rigid arm under {ANGLE_GAIN} by 0.71 of critical"
    said = {"default_gains": [RATE_GAIN], "default_gains_in_words": words}
    return {RATE_GAIN: usual, ANGLE_GAIN: on_angle}, said
