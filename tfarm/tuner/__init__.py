"""Neural gain tuner: a network sets the moment gain during a slew, within a guard that is certified stable.

kernel     compiled trial forward, and its gradient backward; the network
guard      sectors of gains that may vary arbitrarily, with their proof
trial      the slew of an arm under the network, its cost, and the file of a tuner
training   compiled learning rules, and learning curves
baselines  best constant gain, input shaping and the linear-quadratic bound
tuning     guard, training and baselines in one call, and their record
"""

from tfarm.dsp.shaping import extra_insensitive, zero_vibration
from tfarm.tuner.baselines import (
    BestConstant,
    best_constant,
    compare_controllers,
    lq_bound,
    shaped_trial,
    tried_loops,
)
from tfarm.tuner.guard import Guard, find_guard
from tfarm.tuner.kernel import Network, initial_network
from tfarm.tuner.training import Learning, LearningCurves, Stopped, Training, train
from tfarm.tuner.trial import (
    Cost,
    Record,
    SavedTuner,
    Trial,
    TunedGain,
    load_tuner,
    residual_rms,
    save_tuner,
    slew_trial,
)
from tfarm.tuner.tuning import Plan, Tuning, TuningResult, tune

__all__ = [
    "BestConstant",
    "Cost",
    "Guard",
    "Learning",
    "LearningCurves",
    "Network",
    "Plan",
    "Record",
    "SavedTuner",
    "Stopped",
    "Training",
    "Trial",
    "TunedGain",
    "Tuning",
    "TuningResult",
    "best_constant",
    "compare_controllers",
    "extra_insensitive",
    "find_guard",
    "initial_network",
    "load_tuner",
    "lq_bound",
    "residual_rms",
    "save_tuner",
    "shaped_trial",
    "slew_trial",
    "train",
    "tried_loops",
    "tune",
    "zero_vibration",
]
