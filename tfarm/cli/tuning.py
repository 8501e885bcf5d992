"""The verb of the neural gain tuner.  Rooms are imported inside it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, RATE_GAIN
from tfarm.cli.app import ArmName, Json, app, give, load_arm, whole_number
from tfarm.cli.inputs import HELP_ON_GAINS, Given, asked_gains
from tfarm.cli.sampling import Delay, DspFile, Period, asked_chain

if TYPE_CHECKING:
    from tfarm.arm import Arm

HELP_ON_ANGLE_GAIN = f"hub angle gain: the reference is tracked, {RATE_GAIN} damps that by 0.71 if not given"


@app.command()
def tune(
    arm: ArmName,
    trials: Annotated[str, typer.Option("--trials", metavar="N", help="slews to learn from")] = "100",
    mode: Annotated[
        str, typer.Option("--mode", help="trial: learn after each slew; online: at every sample")
    ] = "trial",
    signals: Annotated[str, typer.Option("--signals", help="vibration or total: what x and u contain")] = "vibration",
    seed: Annotated[str, typer.Option("--seed", metavar="N", help="of the initial weights")] = "0",
    guard: Annotated[str, typer.Option("--guard", help="time-varying (proven), frozen or none")] = "time-varying",
    rule: Annotated[str, typer.Option("--rule", help="dynamic, clipped or plain: how (21) is made robust")] = "dynamic",
    sensitivity: Annotated[
        str, typer.Option("--sensitivity", help="of the plant, online: one-step (the paper's) or whole")
    ] = "one-step",
    eta: Annotated[float, typer.Option("--eta", help="learning rate")] = 0.8,
    alpha: Annotated[float, typer.Option("--alpha", help="momentum, in [0, 1)")] = 0.6,
    a: Annotated[float, typer.Option("--a", help="weight of the root moment in the cost")] = 1.0,
    b: Annotated[float, typer.Option("--b", help="weight of the control signal in the cost")] = 2.6,
    on_rate: Annotated[float | None, typer.Option(f"--{RATE_GAIN}", help=HELP_ON_GAINS[RATE_GAIN])] = None,
    on_angle: Annotated[float, typer.Option(f"--{ANGLE_GAIN}", help=HELP_ON_ANGLE_GAIN)] = 0.0,
    duration: Annotated[float, typer.Option("--duration", help="of a trial [s]")] = 3.0,
    enough: Annotated[float, typer.Option("--enough", help="stop once the rms of x is below this [N m]")] = 0.0,
    hidden: Annotated[str, typer.Option("--hidden", metavar="N", help="hidden neurons")] = "6",
    seventh_input: Annotated[bool, typer.Option("--seventh-input", help="feed K(t-1) to the network too")] = False,
    modes: Annotated[str, typer.Option("--modes", metavar="N", help="flexible modes")] = "6",
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    compare: Annotated[bool, typer.Option("--compare", help="with converters, delay, and on other arms too")] = False,
    save: Annotated[Path | None, typer.Option("--save", help="write the tuner to this JSON file")] = None,
    json: Json = False,
) -> None:
    """Train the network that sets the moment gain during a slew, and hold it against simpler remedies."""
    slews, start = whole_number("--trials", trials, 1, 1_000_000), whole_number("--seed", seed, 0, 2**53)
    count, neurons = whole_number("--modes", modes, 1, 48), whole_number("--hidden", hidden, 1, 1000)
    subject, chain = load_arm(arm), asked_chain(dsp or arm, period, delay_samples)
    from tfarm import tuner
    from tfarm.tuner.tuning import outcomes_answer

    servo, said = _servo_gains(subject, on_rate, on_angle)

    learning = tuner.Learning(
        mode=cast("Any", mode), rule=cast("Any", rule), sensitivity=cast("Any", sensitivity), eta=eta, alpha=alpha,
        enough=enough,
    )  # fmt: skip
    plan = tuner.Plan(
        cost=tuner.Cost(a=a, b=b), learning=learning, signals=cast("Any", signals), guard=cast("Any", guard),
        trials=slews, seed=start, count=count, duration=duration, hidden=neurons,
        seventh_input=seventh_input, **servo,
    )  # fmt: skip
    tuning = tuner.tune(subject, plan, chain)
    answer = tuner.tune_answer(tuning) | said
    if compare:
        rows = tuner.compare_controllers(tuning.trial, tuning.gain(), tuning.training.guard)
        answer["comparison"] = outcomes_answer(rows)
    if save is not None:
        tuner.save_tuner(tuning.saved(), save)
    _show(answer, save, json)


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


def _show(answer: dict[str, Any], save: Path | None, json: bool) -> None:
    """The answer as JSON or as a summary; that a run has stopped is said either way."""
    from tfarm.cli import tuning_tables
    from tfarm.cli.tables import say_written

    tuning_tables.warn_of_divergence(answer)
    if say_written(save) or json:
        give(answer, json, tuning_tables.print_tuning)
