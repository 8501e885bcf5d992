"""Exported tuners: C against Python bit for bit, and the simulated slew against tfarm's own tuner.

    python -m tests.exported.tuners SIZE SEED

SIZE random tuners in double and in float, 1e6 samples of C and Python in all; a compiler that is not installed is named
in a printed line.  A fifth as many slews of random arms, under a guard of their own.
"""

import shutil
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.exported.compilers import COMPILERS, pumped
from tests.survey import Finding
from tests.tuner.bounded import some_trial
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.exported.tuner_code import ExportedTuner
from tfarm.tuner import best_constant, find_guard
from tfarm.tuner.trial import SavedTuner, to_text

LEVELS = ("-O0", "-O2")
PRECISIONS = ("double", "float")
SAMPLES = 1_000_000  # of a survey
SECTOR = (0.31, 0.63)  # proven on the laboratory arm with K1 = 0.3
DIFFERENCE = {"double": 1e-13, "float": 1e-4}  # of a slew's torque, over its largest: the stated bound


@cache
def has_program(name):
    """Whether a program is installed; a missing one is named once."""
    found = shutil.which(name) is not None
    if not found:
        print(f"{name} is not installed: its comparisons are left out")
    return found


def some_tuner(rng, **changed):
    """A random tuner: 6 or 7 inputs, 1 to 12 neurons, both readings."""
    inputs, hidden = int(rng.choice([6, 7])), int(rng.integers(1, 13))
    size = float(rng.choice([0.5, 5.0, 50.0]))
    return SavedTuner(
        format="tfarm tuner 1", arm="sasaki2012-lab", period=0.01, K1=0.3, Kp=float(rng.choice([0.0, 2.0])),
        signals=str(rng.choice(["vibration", "total"])), a=1.0, b=2.6,
        guard_kind="time-varying", guard=SECTOR,
        scales=(10 ** rng.uniform(-2, 2, inputs)).tolist(),
        W1=rng.normal(0, size, (hidden, inputs)).tolist(), w2=rng.normal(0, size, hidden).tolist(),
    ).model_copy(update=changed)  # fmt: skip


def some_inputs(rng, samples, tuner):
    """Inputs of all sizes: quantised and clipped as by converters, zeros, and one in 200 that has to be refused."""
    width = len(tuner.inputs)
    rows = rng.normal(size=(samples, width)) * 10 ** rng.uniform(-8, 3, (samples, 1))
    coarse = rng.random(samples) < 0.3
    rows[coarse] = np.clip(np.round(rows[coarse] * 64) / 64, -8.0, 8.0)
    rows[rng.random(rows.shape) < 0.05] = 0.0
    odd = rng.random(rows.shape) < 0.005 / width
    rows[odd] = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 3e38, 5e-324], odd.sum())
    odd = rng.random(samples) < 0.002
    rows[odd] = rng.choice([-0.9, 0.9], (odd.sum(), width)) * float(tuner.numbers.largest)
    return rows


def is_equal(folder, tuner, rows, compiler, *options):
    """Whether C and Python are equal to the last bit."""
    tuner.reset()
    torques, statuses = tuner.run(rows)
    with np.errstate(over="ignore"):
        rows = rows.astype(tuner.real)
    torques_in_c, in_c = pumped(folder, "tuner", tuner.real, rows, compiler, *options)
    return bool((in_c == statuses).all() and torques_in_c.tobytes() == torques.tobytes())


def exported(folder, saved, precision="double", arm="sasaki2012-lab", **how):
    """The files of a tuner in a folder, and its twin in Python."""
    file = Path(folder) / "tuned.json"
    file.write_text(to_text(saved), encoding="utf-8")
    tfarm.export(
        tfarm.load(arm) if isinstance(arm, str) else arm, what="tuner", form="c", folder=folder, tuned=file,
        precision=precision, **how,
    )  # fmt: skip
    return ExportedTuner(saved, precision)


def differences(trial, saved):
    """Largest difference of the slew's torque under the exported tuner from tfarm's own, over its largest."""
    simulator = trial.simulator()
    own = saved.gain().run(simulator)
    found = {}
    for precision in PRECISIONS:
        other = simulator.controller(ExportedTuner(saved, precision))
        found[precision] = float(abs(other.torque - own.torque).max() / abs(own.torque).max())
    return found


def bits(size, seed):
    """C against Python."""
    rng = np.random.default_rng(seed)
    for _ in range(size):
        saved = some_tuner(rng)
        for precision in PRECISIONS:
            with tempfile.TemporaryDirectory() as place:
                folder = Path(place)
                tuner = exported(folder, saved, precision, anyway=True)
                rows = some_inputs(rng, SAMPLES // (2 * size), tuner)
                for compiler in filter(has_program, COMPILERS):
                    for level in LEVELS:
                        equal = is_equal(folder, tuner, rows, compiler, level)
                        words = "" if equal else f"{compiler} {level} {precision} {saved}"
                        yield Finding("equal" if equal else "differs", words, not equal)


def slews(size, seed):
    """The simulated slew of random arms: exported tuner against tfarm's own."""
    rng, made = np.random.default_rng(seed), 0
    while made < max(1, size // 5):
        trial = some_trial(rng)
        try:
            guard = find_guard(trial.loop, "time-varying", best_constant(trial).gain)
        except (CertificationError, ConvergenceError):
            continue
        made += 1
        servo = trial.loop.gains
        saved = some_tuner(
            rng, K1=servo.K1, Kp=servo.Kp, signals="vibration", period=trial.task.period,
            guard_kind="time-varying", guard=(guard.lo, guard.hi),
        )  # fmt: skip
        found = differences(trial, saved)
        wrong = [f"{name} {each:.2g}" for name, each in found.items() if not each <= DIFFERENCE[name]]
        yield Finding("slew", f"{wrong} {trial.arm}" if wrong else "", bool(wrong), found)


if __name__ == "__main__":
    survey.main(bits, slews, size=20, seed=0)
