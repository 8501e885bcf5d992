"""Random rigs of every kind (`tests.rigs`) and plausible arms (`tests.plausible.arms`), in turn, under random laws.

Laws are of order 1 to 12 on one to three signals, with zeros and poles as in `tests.dsp.law_orders`, some with a delay;
periods are of 0.1 to 20 ms.
"""

from dataclasses import replace

import numpy as np

from tests.dsp.law_orders import some_roots
from tests.plausible.arms import draw, log
from tests.rigs import some_rig
from tfarm.arm import Law
from tfarm.dsp import Chain, Sampling
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.reduced.modal import closed, sensed_model
from tfarm.response.signals import Signals
from tfarm.spectrum.table import first_frequency

SIGNALS = ("hub_angle", "hub_rate", "hub_angle", "hub_rate", "root_moment", "tip_displacement", "tip_acceleration",
           "moment@")  # fmt: skip
MODES_OF_MODEL = 8  # of the model by which some laws are made weaker until they work
WEAKER = (1.0, 0.1, 0.01, 1e-3)  # times a law


def some_case(seed, number):
    """A rig, a law in s and the chain of a sampled loop; the next draw where a rig has no input, or reads nothing."""
    rng = np.random.default_rng([seed, number])
    while True:
        arm = plausible(seed, rng) if number % 2 else some_rig(rng)
        if arm.is_locked or arm.input == "hub_angle":
            continue
        try:
            law = some_law(rng, arm, first_frequency(arm))
        except (ConvergenceError, ParameterError):
            continue
        if law is not None:
            period = log(rng, 1e-4, 2e-2)
            return arm, law, Chain(sampling=Sampling(period=period, delay_samples=float(rng.choice([0.0, 0.0, 1.0]))))


def plausible(seed, rng):
    """One of the arms of `tests.plausible`, some with friction at the hub."""
    arm = draw(int(rng.integers(10_000)), seed).arm
    if rng.random() < 0.3:
        arm = replace(arm, hub=replace(arm.hub, friction=arm.hub.inertia * log(rng, 1e-2, 1e1)))
    return arm


def some_law(rng, arm, w1):
    """One to three entries of order 1 to 12 in all, each loop function of the order of 1 somewhere; None of a gain.

    Half of them are made to work: a proportional and derivative action on the hub's angle first, and all of it weaker
    and weaker until a modal model is stable, where it ever is.
    """
    left, entries, works = int(rng.integers(1, 13)), {}, rng.random() < 0.6
    names = [str(each) for each in rng.choice(SIGNALS, size=rng.integers(1, 4))]
    for name in dict.fromkeys(["hub_angle", *names[1:]] if works else names):
        if name == "root_moment" and arm.has_massless_hub:
            continue
        name = f"{name}{round(float(rng.uniform(0.1, 0.9)) * arm.length, 6)}" if name.endswith("@") else name
        order = left if len(entries) == 2 else int(rng.integers(1 if works and not entries else 0, left + 1))
        left -= order
        zeros, poles = some_roots(rng, order - 1 if works and not entries else order, w1)
        if works and not entries:
            zeros, poles = [*zeros, -w1 * log(rng, 0.05, 1)], [*poles, -w1 * log(rng, 3, 100)]
        at = 1j * w1 * log(rng, 0.1, 10)
        G = Signals(arm, (name,)).values(np.array([at]))[0, 0]
        size = abs(G * np.prod(at - np.array(zeros)) / np.prod(at - np.array(poles)))
        if 1e-100 < size < 1e100:
            gain = log(rng, 1e-2, 2) / size * (1e-2 if works and entries else 1.0)
            num, den = gain * np.atleast_1d(np.poly(zeros)).real, np.atleast_1d(np.poly(poles)).real
            unit = 10.0 ** -np.floor(np.log10(abs(den[den != 0])).mean())  # as a person would write it
            entries[name] = (tuple(unit * num), tuple(unit * den))
    if not entries:
        return None
    delay = log(rng, 1e-3, 0.3 if not works else 0.03) / w1 if rng.random() < 0.3 else 0.0
    law = Law(entries, delay=float(delay))
    if works:
        plant = sensed_model(arm, law.signals, MODES_OF_MODEL)
        law = next((each for each in map(law.times, WEAKER) if is_stable(plant, each)), law)
    return law if law.gains is None else None


def is_stable(plant, law):
    """Whether the loop of a modal model is, but for a pole or two at s = 0."""
    s = np.linalg.eigvals(closed(plant, law.matrices()))
    return (s.real < 1e-9 * abs(s).max()).all()
