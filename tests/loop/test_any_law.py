"""Functions of a loop take gains at the hub and any other law alike, and say what to give where they get neither."""

import numpy as np
import pytest

import tfarm
from tfarm import HubFeedback, Law, ParameterError

LAB = tfarm.load("sasaki2012-lab")
GAINS = HubFeedback(K1=0.3, K2=0.3, Kp=2.0)
LAW = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_acceleration": ([0.05], [0.02, 1.0])}, delay=0.002)
ACROSS, UP = np.array([0.5, 2.0, 6.0]), np.array([0.001, 0.01, 0.03])


PATHS = {
    "closed_loop_poles": lambda law: tfarm.closed_loop_poles(LAB, law, 3),
    "compare": lambda law: tfarm.compare(LAB, [law, law]),
    "locus": lambda law: tfarm.locus(LAB, law, "K2", 0.0, 1.0, 5, 2),
    "locus of all": lambda law: tfarm.locus(LAB, law, "all", 0.0, 1.0, 5, 2),
    "map": lambda law: tfarm.map(LAB, ACROSS, UP, law=law or 0, vary=("gain", "delay")),
    "margins": lambda law: tfarm.margins(LAB, law),
    "nyquist": lambda law: tfarm.nyquist(LAB, law),
    "sampled": lambda law: tfarm.sampled(LAB, law),
    "simulate": lambda law: tfarm.simulate(LAB, law, duration=0.1),
    "spill": lambda law: tfarm.spill(LAB, law, 2),
}


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("law", [None, 3, "law.toml", LAB], ids=["none", "number", "path", "arm"])
def test_what_is_no_law_is_refused_everywhere(name, law):
    with pytest.raises(ParameterError, match="give a HubFeedback or a Law"):
        PATHS[name](law)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: tfarm.tune(LAB, 3), "give a tfarm.tuner.Plan"),
        (lambda: tfarm.tune(LAB, GAINS), "give a tfarm.tuner.Plan"),
        (lambda: tfarm.tune("sasaki2012"), "give tfarm.load"),
        (lambda: tfarm.tune(LAB, None, 0.01), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.sampled(LAB, GAINS, 0.01), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.sampled(LAB, LAW, "lab.toml"), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.simulate(LAB, GAINS, 0.01, duration=0.1), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.compare(LAB, [GAINS, GAINS], chain=0.01), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.map(LAB, LAW, UP), "give the law as law="),
        (lambda: tfarm.map(LAB, "K1", UP), "an ascending range"),
        (lambda: tfarm.map(LAB, ACROSS, UP, law=LAW), "two numbers of the law"),
        (lambda: tfarm.map(LAB, ACROSS, UP, law=LAW, vary="gain"), "two numbers of the law"),
        (lambda: tfarm.map(LAB, ACROSS, UP, vary=("gain", "delay")), "whose numbers vary names"),
        (lambda: tfarm.map(LAB, ACROSS, UP, 1.0, law=LAW, vary=("gain", "delay")), "give Kp in the law"),
        (lambda: tfarm.locus(LAB, GAINS, "K3", 0.0, 1.0), "known are: K1, K2"),
        (lambda: tfarm.locus(LAB, GAINS, 2, 0.0, 1.0), "the name of what varies, such as K2"),
        (lambda: tfarm.locus(LAB, LAW, "K2", 0.0, 1.0), "known are: gain, delay, hub_angle"),
        (lambda: tfarm.default_gains("sasaki2012"), "give tfarm.load"),
        (lambda: tfarm.damped_modes(LAB), "give what tfarm.modes returns"),
        (lambda: tfarm.overlay(LAB, "sweep.csv"), "give what tfarm.read_measured returns"),
        (lambda: tfarm.fit(LAB, "sweep.csv", ["hub.inertia"]), "give what tfarm.read_measured returns"),
        (lambda: tfarm.transfer(LAB, 3), "the name of an output"),
        (lambda: tfarm.reduce(LAB, GAINS, order=4), "the name of an output"),
        (lambda: tfarm.plots.locus(LAB), "what tfarm.locus returns"),
        (lambda: tfarm.plots.gain_map(LAB), "what tfarm.map returns"),
    ],
)
def test_what_a_function_cannot_take_it_says_how_to_give(call, words):
    with pytest.raises(ParameterError, match=words):
        call()
