"""Laws and chains of exported controllers, and the parts of an export that tests compare."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import tfarm
from tfarm.arm.law_tables import load_law
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Converters, ReferenceShaping, Sampling, load_chain
from tfarm.dsp.kernel import AMPLIFIER, ENCODER
from tfarm.dsp.simulate import quantisers
from tfarm.exported.controller import controller_of, in_z
from tfarm.exported.realisations import least_noise
from tfarm.exported.result import ExportTask

LAB = tfarm.load("sasaki2012-lab")
RIG = Path(__file__).parents[1] / "data" / "quanser-2dsfl"
GAINS = tfarm.HubFeedback(K1=0.3, K2=0.3)
PI = tfarm.Law(  # an integral of the hub angle, a filtered moment, whole samples of delay
    {"hub_angle": ([0.3, 1.0, 0.2], [0.02, 1.0, 0.0]), "hub_rate": 0.3, "root_moment": ([0.2], [0.01, 1.0])},
    references=("hub_angle", "hub_rate"), delay=0.02, name="PI */ \\ of the hub",
)  # fmt: skip
NOTCH = tfarm.Law(
    {"hub_rate": ([0.2 * 1, 0.2 * 2, 0.2 * 5000], [1.0, 80.0, 5000.0]), "root_moment": 0.2}, references=("hub_rate",)
)
IDEAL = Chain(sampling=Sampling(period=0.01))
REAL = Chain(
    sampling=Sampling(period=0.01), actuator=Actuator(torque_limit=1.5),
    converters=Converters(encoder_counts=8192, hub_rate="difference", rate_filter=200.0, moment_bits=12,
                          moment_range=2.0, torque_bits=12, torque_range=2.0),
)  # fmt: skip
RANGES = {"hub_angle": 3.0, "hub_rate": 10.0, "root_moment": 2.0, "output": 2.0}
CASES = {  # arm, law, chain
    "gains": (LAB, GAINS, IDEAL),
    "integral": (LAB, PI, IDEAL),
    "notch": (LAB, NOTCH, replace(REAL, converters=replace(REAL.converters, hub_rate="ideal"))),
    "estimate": (LAB, GAINS, REAL),
    "shaped": (LAB, PI, replace(IDEAL, reference=ReferenceShaping(shaper="EI"))),
    "windup": (LAB, replace(PI, anti_windup=0.5), replace(IDEAL, actuator=Actuator(torque_limit=0.5))),
}


def task_of(case, precision="double", **others):
    """The task of a case of `CASES`, or of an arm, a law and a chain."""
    case = Case(*(CASES[case] if isinstance(case, str) else case))
    ranges = others.pop("ranges", {})
    if precision == "q31":
        names = (*case.law.signals, "output", "feedforward")
        ranges = {name: size for name, size in (RANGES | ranges).items() if name in names}
    return ExportTask(case=case, what="controller", form="c", precision=precision, ranges=ranges, **others)


def hinf():
    """The H-infinity controller of the rig, its arm, and its chain."""
    return tfarm.load(RIG / "rig.toml"), load_law(RIG / "hinf.toml"), load_chain(RIG / "chain.toml")


def realised(task):
    """The realised controller of a task, and its exact sampled loop."""
    case = task.case
    loop = tfarm.sampled(case.arm, case.law, case.chain).verdict.loop
    return controller_of(least_noise(in_z(case), loop)[0], task), loop


def on_steps(values, chain, row):
    """Values on the steps and in the range of a quantiser."""
    step, low, high = quantisers(chain)[row]
    near = np.rint(values / step) * step if step else values
    return np.clip(near, low, high)


def readings(truth):
    """Hub angle, hub rate and root moment behind the converters (n,)."""
    chain = truth.chain
    angle, rate, moment = truth.measured.T
    angle, moment = on_steps(angle, chain, ENCODER), on_steps(moment, chain, AMPLIFIER)
    if chain.converters.hub_rate == "difference":
        T, a, found = chain.sampling.period, np.exp(-chain.converters.rate_filter * chain.sampling.period), [0.0]
        for step in np.diff(angle) / T:
            found.append(a * found[-1] + (1 - a) * step)
        rate = np.array(found)
    return {"hub_angle": angle, "hub_rate": rate, "root_moment": moment}
