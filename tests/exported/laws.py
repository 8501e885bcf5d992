"""Exported controllers of random laws: equal to C bit for bit, and within the stated bounds of their word length.

    python -m tests.exported.laws SIZE SEED

Laws of order 0 to 8 of one to three signals on the laboratory's arm: lags, notches, integrals, state spaces, in s under
each rule.  Each runs in float and in Q31 under random, slow and full-scale inputs, 5,000 samples, in Python and in C,
and its output is compared with that in double.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.exported.cases import IDEAL, LAB, RANGES, realised, task_of
from tests.exported.compilers import stepped
from tests.survey import Finding
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.exported.controller import controller_of, in_z, source_files
from tfarm.exported.result import write_into
from tfarm.exported.word_length import least_noise

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


def some_inputs(rng, controller, kind):
    """Inputs within their ranges [SI]: random, of random signs, and slow, in the kind of the arithmetic."""
    word, k = controller.word, controller.inputs
    sizes = dict(zip((*word.law.signals, *word.law.wanted), word.ranges.tolist(), strict=True))
    sizes = np.array([*(sizes[name] for name in (*controller.signals, *controller.references)), 0.0])
    share = np.concatenate([
        rng.uniform(-1, 1, (SAMPLES // 3, k)), rng.choice([-1.0, 1.0], (SAMPLES // 3, k)),
        np.repeat(rng.choice([-1.0, 1.0], (SAMPLES // 300, k)), 100, axis=0),
    ])  # fmt: skip
    if kind == "q31":
        whole = np.clip(np.rint(share * 2.0**31), -(2**31), 2**31 - 1)
        return whole.astype(np.int64), whole / 2.0**31 * np.r_[sizes[:-1], word.output]
    single = (share * sizes).astype(np.float32).astype(float)
    return single, single


def judged(rng, kind, law, folder):
    """The finding of one law in one arithmetic; None where there is no export."""
    task = task_of((LAB, law, IDEAL), kind, anyway=True, ranges={name: RANGES[name] for name in law.signals})
    try:
        controller, loop = realised(task)
        write_into(folder, source_files(task, controller, [("arm", LAB.name)])[0])
    except (ParameterError, ConvergenceError):
        return None
    exact = controller_of(least_noise(in_z(task.law, IDEAL), loop)[0], replace(task, precision="double"))
    inputs, signals = some_inputs(rng, controller, kind)
    outputs, status = controller.run(inputs)
    truth, _ = exact.run(signals)
    unit = controller.word.output / 2.0**31 if kind == "q31" else 1.0
    if kind == "q31":
        truth = np.clip(truth, -controller.word.output, controller.word.output - unit)
    bound = controller.word.bounds[2]
    with np.errstate(invalid="ignore"):  # of a law that grows: its bound is infinite
        share = float(np.nan_to_num(abs(outputs * unit - truth).max() / (bound + exact.word.bounds[2])))
    out, own = stepped(folder, controller, inputs, "gcc", "-O2")
    is_equal = out.astype(outputs.dtype).tobytes() == outputs.tobytes() and (own == status).all()
    is_wrong = not is_equal or share > 1
    words = f"{kind} {law!r}: {share:.3g} of the bound, equal {is_equal}" if is_wrong else ""
    outcome = f"{kind}, {'bounded' if np.isfinite(bound) else 'without a bound'}"
    return Finding(outcome, words, is_wrong, {f"error over bound, {kind}": share})


def laws(size, seed):
    """`size` laws in float and in fixed point."""
    rng, number = np.random.default_rng(seed), 0
    while number < size:
        law = some_law(rng)
        with tempfile.TemporaryDirectory() as place:
            found = [judged(rng, kind, law, Path(place)) for kind in ("float", "q31")]
        number += None not in found
        yield from (each for each in found if each is not None)


if __name__ == "__main__":
    survey.main(laws)
