"""Functions of a loop take gains at the hub and any other law alike, and say what to give where they get neither."""

import numpy as np
import pytest

import tfarm
from tfarm import HubFeedback, Law, ParameterError
from tfarm.loop.plane import Plane

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
GAINS = HubFeedback(K1=0.3, K2=0.3, Kp=2.0)
PLAIN = Law({"hub_rate": 0.3, "root_moment": 0.3, "hub_angle": 2.0})  # the same, as a law of signals
LAW = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_acceleration": ([0.05], [0.02, 1.0])}, delay=0.002)
ACROSS, UP = np.array([0.5, 2.0, 6.0]), np.array([0.001, 0.01, 0.03])


def test_a_map_of_gains_holds_the_angle_as_their_law_does():
    assert tfarm.map(LAB, ACROSS, UP, law=PLAIN) == tfarm.map(LAB, ACROSS, UP, 2.0)
    plane = tfarm.map(LAB, ACROSS, UP, law=GAINS, vary=("K1", "K2"))
    assert isinstance(plane, Plane)
    assert plane.Kp == 2.0
    turned = tfarm.map(LAB, np.array([0.2, 1.6]), np.array([0.2, 0.4]), law=GAINS, vary=("root_moment", "hub_rate"))
    assert turned.unstable[0].tolist() == [
        tfarm.closed_loop_poles(LAB, HubFeedback(K1=0.2, K2=K2, Kp=2.0), 9).unstable for K2 in (0.2, 1.6)
    ]


def test_spillover_of_gains_at_the_hub():
    """The exact loop's unstable poles are those of the gains, and the models those of a law that is written out."""
    gains = HubFeedback(K1=0.3, K2=1.4)
    found = tfarm.spill(LAB, gains, 4)
    poles = tfarm.closed_loop_poles(LAB, gains, 12).values
    assert found.driven == pytest.approx(poles[poles.real > 0], rel=1e-9)
    same = tfarm.spill(LAB, Law({"root_moment": 1.4, "hub_rate": 0.3}), 4)
    assert found.unstable.tolist() == same.unstable.tolist()
    assert found.rightmost == pytest.approx(same.rightmost, rel=1e-9)


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
        (lambda: tfarm.map(LAB, ACROSS, UP, 1.0, law=LAW, vary=("gain", "delay")), "give Kp in it"),
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
