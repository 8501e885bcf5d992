"""The sampled chain in time: hold, delay, converters, discretisation and simulation at 10 ms or any other period.

discretise  a law in s made discrete, and the factors of a law in z
plant       poles and residues of the modal plant, with analog filters
pulse       the plant from sample to sample, under a zero-order hold
sensed      the plant of each signal, and of all together
profiles    the motion of a slew from rest to rest
branches    poles along a number of a law, as branches
shaping     impulses that vanish at poles of the loop
scenarios   slew, step, decay, impulse and pulse
stages      the door of every result on a sampled loop: stages that it does not have are refused
kernel      compiled steps between the samples, and the linear law
simulate    the simulator of a case over a scenario
simulation  the record of a simulated loop, and figures of its signals
results     a simulated scenario with enough modes, and its limit cycle
traces      curves over time for pictures, and the motion for a film
"""

from tfarm.arm.chain import Actuator, Chain, Converters, ReferenceShaping, Sampling, Slew, load_chain
from tfarm.dsp.pulse import PulseTransfer, pulse_transfer
from tfarm.dsp.scenarios import Scenario, scenario
from tfarm.dsp.simulate import Measurement, Simulator
from tfarm.dsp.simulation import Simulation
from tfarm.moved import moved, moved_module

__all__ = [
    "Actuator",
    "Chain",
    "Converters",
    "Measurement",
    "PulseTransfer",
    "ReferenceShaping",
    "Sampling",
    "Scenario",
    "Simulation",
    "Simulator",
    "Slew",
    "load_chain",
    "pulse_transfer",
    "scenario",
]

# modules and names that this room had up to version 1.0, and where their names are
_OF_CHAIN = (
    "Actuator",
    "Chain",
    "Converters",
    "Sampling",
    "Slew",
    "chain_of_tables",
    "file_text",
    "load_chain",
)
chain = moved_module(f"{__name__}.chain", dict.fromkeys(_OF_CHAIN, "tfarm.arm.chain"))
sampled = moved_module(
    f"{__name__}.sampled", dict.fromkeys(("Sampled", "sampled_loop"), "tfarm.loop.sampled")
)
_MOVED = {
    "Analysis": "tfarm.loop.sampled_analysis",
    "GainMap": "tfarm.loop.circle_crossings",
    "Sampled": "tfarm.loop.sampled",
    "Verdict": "tfarm.loop.sampled_verdict",
    "delay_margin": "tfarm.loop.edges",
    "required_damping": "tfarm.loop.edges",
    "sampled_loop": "tfarm.loop.sampled",
    "sampled_map": "tfarm.loop.circle_crossings",
    "sampled_verdict": "tfarm.loop.sampled_verdict",
    "stable_windows": "tfarm.loop.circle_crossings",
}
__getattr__ = moved(__name__, _MOVED)
