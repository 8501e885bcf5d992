"""One tuning of the gain tuner on an arm, and what it is compared with: baselines, slews and learning curves."""

from collections.abc import Mapping
from dataclasses import dataclass

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.dsp import Chain, Simulation, results, traces
from tfarm.records import record
from tfarm.studies.cases import learning_curves
from tfarm.tuner import LearningCurves, Tuning, compare_controllers, tried_loops, tune
from tfarm.tuner.baselines import Outcomes, quantised_chain
from tfarm.tuner.tuning import usual_plan

WITHOUT = f"without moment feedback, {MOMENT_GAIN} = 0"
CURVE_SAMPLES = 80_000_000  # that the trials of learning curves may have together, some 35 s of one core
LONG_TRIAL = 16_000  # samples: the comparison of a longer one is of the arm itself alone


@dataclass(frozen=True)
@record
class TunerNumbers:
    """One tuning and what is compared with it.

    `slews` and `coarse` hold two simulations each, without and with the tuner.
    """

    arm: Arm
    tuning: Tuning
    slews: Mapping[str, Simulation]
    coarse: Mapping[str, Simulation]
    curves: LearningCurves
    rows: tuple[Outcomes, ...]


def tuner_numbers(arm: Arm, chain: Chain) -> TunerNumbers:
    """Train with the paper's figures, through the arm's own chain with its converters ideal, and measure.

    Raises ParameterError for an arm without a loop or a slew, CertificationError where no range of gains is proven.
    """
    plan = usual_plan(arm, chain)
    own = results.ideal_chain(chain)
    tuning = tune(arm, plan, own)
    trial = tuning.trial
    # the first are those of the arm itself, of which the last is quantised and late
    late = 3
    listed = tried_loops(arm, trial.loop.chain, quantised_chain(arm, chain))
    rows = compare_controllers(
        trial,
        tuning.gain(),
        tuning.training.guard,
        listed[: late + 1 if trial.n > LONG_TRIAL else None],
        tuning.best_constant.gain,
    )
    return TunerNumbers(
        arm=arm,
        tuning=tuning,
        slews=_simulated(tuning, trial.loop.chain),
        coarse=_simulated(tuning, listed[late].chain),
        curves=learning_curves(arm, plan, own, curve_seeds(plan.trials * trial.n)),
        rows=tuple(rows),
    )


def curve_seeds(samples: int) -> int:
    """Return the number of seeds of the learning curves, at most 20, for trainings of that length."""
    return min(20, max(1, CURVE_SAMPLES // samples))


def _simulated(tuning: Tuning, chain: Chain) -> dict[str, Simulation]:
    without, tuned = traces.resolved(
        tuning.trial.simulator(chain=chain),
        tuning.trial.arm,
        lambda each: each.linear(tuning.gain().servo),
        lambda each: tuning.gain().run(each),
    )
    return {WITHOUT: without, "with the tuner": tuned}
