"""The sampled loop of the exact arm: hold, delay, converters, verdicts and simulations at 10 ms or any other period."""

from tfarm.dsp.chain import Actuator, Chain, Converters, Sampling, Slew, load_chain
from tfarm.dsp.crossings import GainMap, sampled_map, stable_windows
from tfarm.dsp.edges import delay_margin, required_damping
from tfarm.dsp.plant import PulseTransfer, pulse_transfer
from tfarm.dsp.sampled import Sampled, sampled_loop
from tfarm.dsp.scenarios import Scenario, scenario
from tfarm.dsp.simulate import Measurement, Simulation, Simulator
from tfarm.dsp.verdict import Analysis, Verdict, sampled_verdict

__all__ = [
    "Actuator",
    "Analysis",
    "Chain",
    "Converters",
    "GainMap",
    "Measurement",
    "PulseTransfer",
    "Sampled",
    "Sampling",
    "Scenario",
    "Simulation",
    "Simulator",
    "Slew",
    "Verdict",
    "delay_margin",
    "load_chain",
    "pulse_transfer",
    "required_damping",
    "sampled_loop",
    "sampled_map",
    "sampled_verdict",
    "scenario",
    "stable_windows",
]
