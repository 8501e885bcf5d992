"""The neural gain tuner: a network that sets the moment gain while the arm slews, kept where that is proven stable."""

from tfarm.tuner.comparison import compare_controllers, tried_loops
from tfarm.tuner.controller import TunedGain, simulated
from tfarm.tuner.guard import Guard, find_guard
from tfarm.tuner.network import Network, initial_network
from tfarm.tuner.saving import SavedTuner, load_tuner, save_tuner
from tfarm.tuner.shaping import extra_insensitive, shaped_trial, zero_vibration
from tfarm.tuner.training import Learning, Stopped, Training, train
from tfarm.tuner.trial import Cost, Record, Trial, residual_rms, slew_trial
from tfarm.tuner.tuning import Plan, Tuning, tune, tune_answer
from tfarm.tuner.yardsticks import BestConstant, best_constant, lq_bound

__all__ = [
    "BestConstant",
    "Cost",
    "Guard",
    "Learning",
    "Network",
    "Plan",
    "Record",
    "SavedTuner",
    "Stopped",
    "Training",
    "Trial",
    "TunedGain",
    "Tuning",
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
    "simulated",
    "slew_trial",
    "train",
    "tried_loops",
    "tune",
    "tune_answer",
    "zero_vibration",
]
