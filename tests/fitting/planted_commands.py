"""Commands of planted rigs (`tests.fitting.planted_runs`): inputs of an open loop, laws and their references."""

import math

import numpy as np

from tfarm.arm import HubFeedback
from tfarm.arm.law import Law


def log(rng, low, high):
    return float(10 ** rng.uniform(low, high))


def levels(rng, count, length):
    """Random levels, each of about so many samples."""
    out = np.empty(0)
    while out.size < count:
        width = max(1, round(length * rng.uniform(0.5, 2)))
        out = np.r_[out, np.full(width, rng.uniform(-1, 1))]
    return out[:count]


def input_of(rng, count, period, w1):
    """A binary sequence, a multisine or steps, of a size of about 1, which leave a free hub about where it was."""
    kind, cycle = rng.choice(["binary", "multisine", "steps"]), 2 * math.pi / w1 / period
    if kind == "multisine":
        top = min(12 * w1, 0.8 * math.pi / period)
        lines = np.geomspace(0.15 * w1, top, int(rng.integers(8, 40)))
        phases = rng.uniform(0, 2 * math.pi, lines.size)
        t = period * np.arange(count)
        return np.cos(np.multiply.outer(t, lines) + phases).sum(axis=1) / math.sqrt(lines.size)
    quarter = -(-count // 4)
    if kind == "binary":
        held = max(1, round(cycle * rng.uniform(0.03, 0.4)))
        part = rng.choice([-1.0, 1.0], -(-quarter // held)).repeat(held)[:quarter]
    else:
        part = levels(rng, quarter, cycle)
    return np.r_[part, -part, -part, part][:count]


def some_law(rng, arm, w1, period, per_input):
    """A law's difference equations by signal, and the same law of tfarm."""
    J = arm.turned_inertia * per_input
    wc, zeta = w1 * log(rng, -1, -0.3), rng.uniform(0.6, 1.2)
    Kp, K1 = J * wc**2, 2 * zeta * wc * J
    kind = rng.choice(["rate", "moment", "filter"])
    if kind == "filter":
        pole = math.exp(-rng.uniform(4, 10) * wc * period)
        D = K1 / period * (1 - pole)
        entries = {"hub_angle": ([Kp + D, -Kp * pole - D], [1.0, -pole])}
        return entries, Law(entries, period=period, references=("hub_angle",))
    gains = {"hub_angle": Kp, "hub_rate": K1}
    if kind == "moment":
        gains["root_moment"] = rng.uniform(0.05, 0.4) * per_input
    law = HubFeedback(Kp=Kp, K1=K1, K2=gains.get("root_moment", 0.0))
    return {name: ([gain], [1.0]) for name, gain in gains.items()}, law


def references_of(rng, law, count, period, w1):
    """Steps of the hub's angle, smooth where its rate is led along."""
    cycle = 2 * math.pi / w1 / period
    angle = levels(rng, count, cycle * log(rng, 0, 0.7))
    if rng.random() < 0.5:
        width = max(2, round(cycle * rng.uniform(0.3, 1.5)))
        angle = np.convolve(np.r_[np.zeros(2 * width - 1), angle], np.convolve(*[np.ones(width) / width] * 2), "valid")
        angle = angle[:count]
        if "hub_rate" in law:
            return {"hub_angle": angle, "hub_rate": np.gradient(angle, period)}
    return {"hub_angle": angle}
