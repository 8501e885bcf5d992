"""Exported controllers of random laws: equal to C bit for bit; `worst` has their bounds.  Units of random loops.

    python -m tests.exported.laws SIZE SEED

Laws of order 0 to 8 of one to three signals on the laboratory's arm: lags, notches, integrals, state spaces, in s under
each rule.  Each runs in float and in Q31 under random inputs, 5,000 samples, in Python and in C.

Functional mock-up units of as many random arms (`tests.strategies`), laws and chains every 10 ms: delays of up to three
samples, analog filters, encoders, converters, limits of the actuator, float32.  Signals of 200 samples of a slew under
a random disturbance are compared with those of the simulator with as many modes, relative to the largest.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.exported.cases import IDEAL, LAB, RANGES, realised, task_of
from tests.exported.compilers import random_inputs, stepped
from tests.exported.units import Unit, driven, inputs_of, modes_of_units
from tests.strategies import some_arm
from tests.survey import Finding, each_of
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Converters, Sampling, Simulator, scenario
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.exported.controller import source_files
from tfarm.exported.result import write_into

SIGNALS = ("hub_angle", "hub_rate", "root_moment")
SAMPLES = 5_000


def some_block(rng):
    """Numerator and denominator of order 0 to 4, poles from 0.3 to 200 rad/s, at times an integral."""
    den, num, order = np.ones(1), np.ones(1), int(rng.integers(0, 5))
    while den.size <= order:
        w = float(np.exp(rng.uniform(np.log(0.3), np.log(200.0))))
        if rng.random() < 0.5:
            den, num = np.polymul(den, [1 / w, 1.0]), np.polymul(num, [rng.uniform(0, 2) / w, 1.0])
        else:
            damping, depth = rng.uniform(0.05, 1.0, 2)
            den = np.polymul(den, [1 / w**2, 2 * damping / w, 1.0])
            num = np.polymul(num, [1 / w**2, 2 * depth * damping / w, 1.0])
    if rng.random() < 0.15:
        den, num = np.polymul(den, [1.0, 0.0]), np.polymul(num, [1.0, rng.uniform(0.0, 0.3)])
    return (0.3 * rng.uniform(0.1, 1.0) * num).tolist(), den.tolist()


def some_law(rng):
    """A law of some signals, some with a reference, or a state space of all three."""
    names = [str(each) for each in rng.permutation(SIGNALS)[: rng.integers(1, 4)]]
    wanted = tuple(name for name in names if rng.random() < 0.5)
    if rng.random() < 0.3:
        n, T = int(rng.integers(1, 9)), IDEAL.sampling.period
        q = np.linalg.qr(rng.normal(size=(n, n)))[0]
        A = q @ np.diag(rng.uniform(-0.5, 0.98, n)) @ q.T + 0.1 * np.triu(rng.normal(size=(n, n)), 1) / n
        A *= min(1.0, 0.99 / abs(np.linalg.eigvals(A)).max())
        B, C, D = rng.normal(size=(n, len(names))), 0.03 * rng.normal(size=(1, n)), rng.uniform(0, 0.3, (1, len(names)))
        return tfarm.Law.of_matrices(A, B, C, D, names, period=T, references=wanted)
    rule = str(rng.choice(["tustin", "zoh", "matched"]))
    return tfarm.Law({name: some_block(rng) for name in names}, references=wanted, rule=rule)


def judged(rng, kind, law, folder):
    """The finding of one law in one arithmetic; None where there is no export."""
    task = task_of((LAB, law, IDEAL), kind, anyway=True, ranges={name: RANGES[name] for name in law.signals})
    try:
        controller, _ = realised(task)
        write_into(folder, source_files(task, controller, [("arm", LAB.name)])[0])
    except (ParameterError, ConvergenceError):
        return None
    inputs = random_inputs(rng, controller, SAMPLES)
    outputs, status = controller.run(inputs)
    out, own = stepped(folder, controller, inputs, "gcc", "-O2")
    is_equal = out.astype(outputs.dtype).tobytes() == outputs.tobytes() and (own == status).all()
    return Finding(kind, "" if is_equal else f"{kind} {law!r}", not is_equal)


def laws(size, seed):
    """`size` laws in float and in fixed point."""
    rng, number = np.random.default_rng(seed), 0
    while number < size:
        law = some_law(rng)
        with tempfile.TemporaryDirectory() as place:
            found = [judged(rng, kind, law, Path(place)) for kind in ("float", "q31")]
        number += None not in found
        yield from (each for each in found if each is not None)


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


def unit(rng):
    """The finding of one functional mock-up unit; None where there is no export."""
    try:
        arm = some_arm(rng)
        law, chain = replace(some_law(rng), delay=0.0), some_chain(rng, arm)
        with tempfile.TemporaryDirectory() as place, modes_of_units(3):
            tfarm.export(arm, law, what="loop", form="fmu", folder=place, chain=chain, anyway=True)
            made = Unit(Path(place) / "loop.fmu", Path(place) / "unpacked")
        task = scenario("slew", arm, chain, 200 * chain.sampling.period)
        task = replace(task, disturbance=0.1 * abs(task.feedforward).max() * rng.normal(size=task.t.size))
        truth = Simulator(Case(arm, law, chain), task, count=3).run()
    except (ParameterError, ConvergenceError):
        return None
    made.start()
    found, n, is_stopped = driven(made, inputs_of(task), task.t.size), truth.t.size, truth.stopped is not None
    off = np.inf
    if found["torque"].size == n + (not is_stopped):
        signals = [(found[name][:n], truth.at_samples.signal(name)) for name in truth.at_samples.names]
        off = max(float(abs(own - of).max() / max(abs(of).max(), 1e-300)) for own, of in signals)
    is_wrong = not off <= 1e-12
    outcome = "stopped" if is_stopped else "saturated" if any(truth.saturated.values()) else "ran"
    return Finding(outcome, f"{arm!r} {law!r} {chain!r}: {off:.3g}" if is_wrong else "", is_wrong, {"difference": off})


units = each_of(unit)

if __name__ == "__main__":
    survey.main(laws, units)
