"""The tuner on a page: its numbers, and the sentences on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, RATE_GAIN, Arm
from tfarm.digits import significant
from tfarm.dsp import Chain, Simulation
from tfarm.dsp.results import ideal_chain
from tfarm.dsp.traces import away, resolved
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.records import record
from tfarm.report.sections import Fact
from tfarm.report.words import typeset
from tfarm.spectrum.table import first_frequency
from tfarm.tuner import LearningCurves, Plan, Tuning, compare_controllers, learning_curves, tried_loops, tune
from tfarm.tuner.baselines import Outcomes, quantised_chain
from tfarm.tuner.training import QUARTILES
from tfarm.tuner.tuning import tip_errors, usual_plan

WITHOUT = f"without moment feedback, {MOMENT_GAIN} = 0"
CURVE_SEEDS = 20  # of the learning curves
CURVE_SAMPLES = 80_000_000  # that their trials may have together, some 35 s of one core
LONG_TRIAL = 16_000  # samples: the comparison of a longer one is of the arm itself alone
LONGEST_TRIAL = 70_000  # samples: a page has no longer one
AS_TRAINED, QUANTISED_AND_LATE = 0, 3  # rows of the comparison, which begins with those of the arm itself
SERVO_SPEED = 1 / 20  # of the first frequency: the servo's angle loop is so slow that it leaves the mode alone
SERVO_TURN = 0.03  # rad a sample, where that is slower
SERVO_GAINS = (ANGLE_GAIN, RATE_GAIN)
ON_TARGET = 1e-10  # of the tip's travel: no slew ends nearer its target than rounding tells
MUCH_MORE = 3.0  # times as far off its target is more, and no coincidence
SAME_COST = 1e-4  # relative difference of two costs below which they are called the same


@dataclass(frozen=True)
@record
class TunerNumbers:
    """One tuning and what is compared with it.

    `slews` and `coarse` hold two simulations each, without and with the tuner; `constant` is the slew with the best
    constant gain; `servo` the tuning with the angle held, None where no range of gains is proven there.
    """

    arm: Arm
    tuning: Tuning
    slews: Mapping[str, Simulation]
    constant: Simulation
    coarse: Mapping[str, Simulation]
    curves: LearningCurves
    rows: tuple[Outcomes, ...]
    servo: Tuning | None


def tuner_numbers(arm: Arm, chain: Chain) -> TunerNumbers:
    """Train with the paper's figures, through the arm's own chain with its converters ideal, and measure.

    Raises ParameterError for an arm without a loop or a slew, CertificationError where no range of gains is proven.
    """
    plan = usual_plan(arm, chain)
    tuning = tune(arm, plan, ideal_chain(chain))
    ideal = tuning.trial.loop.chain
    conditions = QUANTISED_AND_LATE + 1 if tuning.trial.n > LONG_TRIAL else None
    listed = tried_loops(arm, ideal, quantised_chain(arm, chain))[:conditions]
    rows = compare_controllers(tuning.trial, tuning.gain(), tuning.training.guard, listed, tuning.best_constant.gain)
    return TunerNumbers(
        arm=arm,
        tuning=tuning,
        slews=_simulated(tuning, ideal),
        constant=tuning.trial.simulator(chain=ideal).linear(tuning.constant),
        coarse=_simulated(tuning, listed[QUANTISED_AND_LATE].chain),
        curves=learning_curves(tuning, curve_seeds(plan.trials * tuning.trial.n)),
        rows=tuple(rows),
        servo=_servo_tuning(arm, plan, ideal),
    )


def curve_seeds(samples: int) -> int:
    """Number of seeds of the learning curves, for trainings of so many samples."""
    return min(CURVE_SEEDS, max(1, CURVE_SAMPLES // samples))


def trial_samples(arm: Arm, chain: Chain) -> int:
    """Number of samples of each trial."""
    return 1 + round(usual_plan(arm, chain).duration / chain.sampling.period)


def _servo_tuning(arm: Arm, plan: Plan, chain: Chain) -> Tuning | None:
    """The same tuning with an angle loop a twentieth as fast as the first mode, or slower at a long period."""
    speed = min(SERVO_SPEED * first_frequency(arm), SERVO_TURN / chain.sampling.period)
    on_angle = float(f"{arm.turned_inertia * speed**2:.2g}")
    try:
        return tune(arm, plan.holding(arm, on_angle), chain)
    except (CertificationError, ConvergenceError):
        return None


def _simulated(tuning: Tuning, chain: Chain) -> dict[str, Simulation]:
    without, tuned = resolved(
        tuning.trial.simulator(chain=chain),
        tuning.trial.arm,
        lambda each: each.linear(tuning.gain().servo),
        lambda each: tuning.gain().run(each),
    )
    return {WITHOUT: without, "with the tuner": tuned}


# ------------------------------------------------------------ in words


def tuner_in_short(data: TunerNumbers) -> str:
    """How much the tuner gains over the best constant gain, and what that does by itself."""
    tuning, final, median = data.tuning, data.curves.final, data.curves.final_quantile(0.5)
    constant, best, without = tuning.best_constant.gain, tuning.best_constant.cost, tuning.without.cost
    below = int((final < best).sum())
    gain = 100 * (1 - median / best)
    lead = "A little" if 100 * SAME_COST < gain < 15 else "Yes" if gain >= 15 else "No"
    by_itself, again = f"No constant {MOMENT_GAIN} takes anything off the cost of a slew", ""
    costs = f"{significant(without, 3)} without it"
    if best < (1 - SAME_COST) * without:
        off, again = significant(100 * (1 - best / without), 2), "another "
        by_itself = (
            f"A constant {MOMENT_GAIN} of {significant(constant, 3)} already takes {off} % off the cost of a slew"
        )
        costs = f"{significant(without, 3)} without moment feedback, {significant(best, 3)} with it"
    verb = {"below": f"lowers it by {again}", "above": "raises it by "}.get(_side(median, best), "")
    moves = f"{verb}{significant(abs(gain), 2)} %, to" if verb else "leaves it as it is, at"
    return (
        f"{lead}. {by_itself} ({costs}); a gain that tunes itself {moves} "
        f"{significant(median, 3)} in the median of {final.size} seeds. {below} of {final.size} seeds end below the "
        "best constant gain."
    )


def _side(cost: float, yardstick: float) -> str:
    """Whether a cost is below or above another one, or the same."""
    if abs(cost - yardstick) <= SAME_COST * yardstick:
        return "the same"
    return "below" if cost < yardstick else "above"


def drift_words(data: TunerNumbers) -> str:
    """What the cost does not see: the angle that a moving gain leaves, as nothing regulates it."""
    tuned, constant = off_target(data)
    more = "a gain that moves leaves more of it than a constant one" if tuned > MUCH_MORE * constant else ""
    less = "here a gain that moves leaves no more of it than a constant one" if tuned <= constant else ""
    what = more or less or "here a gain that moves leaves about as much of it as a constant one"
    return (
        f"What the cost does not see: the arm ends off its target, the tip {significant(1e3 * tuned, 2)} mm with the "
        f"tuner and {significant(1e3 * constant, 2)} mm with the best constant gain. The law regulates the hub rate "
        f"alone, and the moment feedback's torque adds up to an angle of its integral over {RATE_GAIN}: {what}. A "
        f"tuner for use needs {ANGLE_GAIN} (tfarm tune --{ANGLE_GAIN})."
    )


def servo_words(data: TunerNumbers) -> str:
    """The same with the angle held: where the slew ends then, and what the tuner is worth beside its yardsticks."""
    if data.servo is None:
        return ""
    tuning, guard = data.servo, data.servo.training.guard
    law = tuning.plan.servo
    gains = " and ".join(law.told(name, lambda gain: significant(gain, 3), data.arm) for name in SERVO_GAINS)
    off = tip_errors(tuning)["tip_error_m"]
    end = "runs away" if off is None else f"ends {significant(1e3 * abs(off), 2)} mm off its target"
    if off is not None and abs(off) < ON_TARGET * data.arm.reach * float(abs(tuning.trial.task.hub_angle).max()):
        end = "ends on its target"
    proven = "proven" if guard.is_proven else "of the first modes alone"
    costs = {
        "no moment feedback": tuning.without.cost,
        "the best constant gain": tuning.best_constant.cost,
        "the tuner": tuning.training.result.cost,
        **{f"the shaper {kind}": cost for kind, cost in tuning.shaped_costs.items()},
        "the bound": tuning.bound.cost,
    }
    told = ", ".join(f"{name} {significant(cost, 3)}" for name, cost in costs.items())
    return (
        f"With the angle held, {gains}, the tuned slew {end}. The guard there is {MOMENT_GAIN} from "
        f"{significant(guard.lo, 3)} to {significant(guard.hi, 3)}, {proven} for any K(t). Costs of that slew: {told}."
    )


def off_target(data: TunerNumbers) -> tuple[float, float]:
    """How far off the tip ends [m], with the tuner and with the best constant gain."""
    runs = data.slews["with the tuner"], data.constant
    travel = data.arm.reach * float(abs(data.constant.scenario.hub_angle).max())
    tuned, constant = (abs(float(away(data.arm, each)[-1])) for each in runs)
    return tuned * (tuned > ON_TARGET * travel), constant * (constant > ON_TARGET * travel)


def shaping_words(data: TunerNumbers) -> str:
    """What input shaping does instead."""
    tuning, median = data.tuning, data.curves.final_quantile(0.5)
    costs, late = tuning.shaped_costs, tuning.shaped_delays
    if not any(late.values()):
        return (
            "Input shaping, which one would try first, has nothing to do here: no mode of the loop lies below half the "
            "sample rate, and a shaper would be shorter than a sample."
        )
    told = " and ".join(
        f"{kind} has {significant(costs[kind], 2)}, arriving {significant(1e3 * late[kind], 3)} ms later"
        for kind in costs
    )
    rival = min(median, tuning.best_constant.cost)
    verdicts = {"below": "is cheaper", "above": "is dearer here", "the same": "costs the same"}
    verdict = verdicts[_side(min(costs.values()), rival)]
    return (
        f"What one would try first {verdict}: shaping the reference, with no moment feedback at all, {told} (each "
        "judged by its own slew). Shaping cannot answer disturbances, which feedback can."
    )


def bound_words(data: TunerNumbers) -> str:
    """How far everything is from what is possible, and what is proven."""
    bound, guard = data.tuning.bound.cost, data.tuning.training.guard
    return (
        f"No controller of this slew gets below {significant(bound, 3)}, the linear-quadratic optimum that knows the "
        f"whole state and the slew beforehand. The tuner's gain stays in {typeset(guard.sentence)}."
    )


def tuner_facts(data: TunerNumbers) -> tuple[Fact, ...]:
    """The costs, from nothing to what is possible."""
    tuning, final = data.tuning, data.curves.final
    low, median, high = (data.curves.final_quantile(share) for share in QUARTILES)
    gain = 100 * (1 - median / tuning.best_constant.cost)
    guard = tuning.training.guard
    off, off_constant = (significant(1e3 * x, 2) for x in off_target(data))
    helps = f"by {significant(gain, 2)} %" if gain > 100 * SAME_COST else "no"
    held = "proven stable" if guard.is_proven else f"proven for the first {guard.modes_used} modes"
    half = f"half between {significant(low, 4)} and {significant(high, 4)}"
    shaped = min((cost, kind) for kind, cost in tuning.shaped_costs.items())
    how = f"{shaped[1]}, a later slew" if any(tuning.shaped_delays.values()) else "no mode slow enough to shape"
    K = f"{MOMENT_GAIN} = {significant(tuning.best_constant.gain, 3)}"
    return (
        Fact(label="does tuning beat a constant gain?", value=helps, beside=f"median of {final.size} seeds"),
        Fact(label="cost without moment feedback", value=significant(tuning.without.cost, 4)),
        Fact(label="best constant gain", value=significant(tuning.best_constant.cost, 4), beside=K),
        Fact(label="tuner", value=significant(median, 4), beside=half),
        Fact(label="nothing is below", value=significant(tuning.bound.cost, 4), beside="linear-quadratic optimum"),
        Fact(label="input shaping instead", value=significant(shaped[0], 3), beside=how),
        Fact(label="tip off its target at the end", value=off, unit="mm", beside=f"constant gain: {off_constant} mm"),
        Fact(label="guard", value=f"{guard.lo:.3f} … {guard.hi:.3f}", beside=f"any K(t) in it: {held}"),
    )
