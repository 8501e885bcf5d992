"""Functional mock-up units of random loops against the simulation:

    python -m tests.exported.unit_loops SIZE SEED

Random arms (`tests.strategies`), laws (`tests.exported.laws`) and chains every 10 ms: delays of up to three samples,
analog filters, encoders, converters, limits of the actuator, float32.  Signals of 200 samples of a slew under a random
disturbance are compared with those of the simulator with as many modes, relative to the largest.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.exported.laws import some_law
from tests.exported.units import Unit, driven, inputs_of, modes_of_units
from tests.strategies import some_arm
from tests.survey import Finding, each_of
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Converters, Sampling, Simulator, scenario
from tfarm.errors import ConvergenceError, ParameterError

SAMPLES, EQUAL = 200, 1e-12


def some_chain(rng, arm):
    """A chain; each imperfection in about half of all cases, ranges about the torque of the slew."""

    def perhaps(value, ideal=None):
        return value if rng.random() < 0.5 else ideal

    size = abs(scenario("slew", arm, Chain(), 0.5).feedforward).max() * rng.uniform(0.5, 5.0)
    return Chain(
        sampling=Sampling(
            delay_samples=perhaps(rng.uniform(0, 3), 0.0),
            antialias_corner=perhaps(rng.uniform(50, 900), np.inf),
        ),
        converters=Converters(
            encoder_counts=perhaps(int(rng.integers(500, 9000))), hub_rate=perhaps("difference", "ideal"),
            rate_filter=perhaps(rng.uniform(20, 500), np.inf), moment_bits=perhaps(int(rng.integers(6, 16))),
            moment_range=float(size), torque_bits=perhaps(int(rng.integers(6, 16))), torque_range=float(size),
            arithmetic=perhaps("float32", "float64"),
        ),
        actuator=Actuator(torque_limit=perhaps(float(size * rng.uniform(0.3, 1.0)), np.inf)),
    )  # fmt: skip


def loops(rng):
    """The finding of one loop; None where there is no export."""
    try:
        arm = some_arm(rng)
        law, chain = replace(some_law(rng), delay=0.0), some_chain(rng, arm)
        with tempfile.TemporaryDirectory() as place, modes_of_units(3):
            tfarm.export(arm, law, what="loop", form="fmu", folder=place, chain=chain, anyway=True)
            unit = Unit(Path(place) / "loop.fmu", Path(place) / "unpacked")
        task = scenario("slew", arm, chain, SAMPLES * chain.sampling.period)
        task = replace(task, disturbance=0.1 * abs(task.feedforward).max() * rng.normal(size=task.t.size))
        truth = Simulator(Case(arm, law, chain), task, count=3).run()
    except (ParameterError, ConvergenceError):
        return None
    unit.start()
    found, n, is_stopped = driven(unit, inputs_of(task), task.t.size), truth.t.size, truth.stopped is not None
    off = np.inf
    if found["torque"].size == n + (not is_stopped):
        signals = [(found[name][:n], truth.at_samples.signal(name)) for name in truth.at_samples.names]
        off = max(float(abs(own - of).max() / max(abs(of).max(), 1e-300)) for own, of in signals)
    is_wrong = not off <= EQUAL
    outcome = "stopped" if is_stopped else "saturated" if any(truth.saturated.values()) else "ran"
    return Finding(outcome, f"{arm!r} {law!r} {chain!r}: {off:.3g}" if is_wrong else "", is_wrong, {"difference": off})


if __name__ == "__main__":
    survey.main(each_of(loops))
