"""Exported tuners: C against Python bit for bit, the simulated slew against tfarm's own tuner, and the time of a step.

    python -m tests.exported.tuners SIZE SEED

SIZE random tuners in double and in float, 1e6 samples of C and Python in all; a compiler that is not installed is named
in a printed line.  A fifth as many slews of random arms, under a guard of their own.
"""

import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.survey import Finding
from tests.tuner.bounded import some_trial
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.exported.tuner_code import ExportedTuner
from tfarm.tuner import best_constant, find_guard
from tfarm.tuner.trial import FORMAT, SavedTuner, to_text

FLAGS = ("-ffp-contract=off", "-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
COMPILERS = ("gcc", "clang")
LEVELS = ("-O0", "-O2")
SAMPLES = 1_000_000  # of a survey
COMPILE_TIME, RUN_TIME = 120, 120  # s
SECTOR = (0.31, 0.63)  # proven on the laboratory arm with K1 = 0.3
DIFFERENCE = {"double": 1e-12, "float": 1e-5}  # of a slew's torque, over its largest: the stated bound
STEP_TIME = 500.0  # ns, for a network of 6-6-1
REAL = {np.float64: "double", np.float32: "float"}
DRIVER = """
#include "tuner.h"
#include <stdio.h>
#include <time.h>

int main(void)
{
    static REAL rows[MOST][N], torques[MOST];
    static unsigned char statuses[MOST];
    tuner_state state;
    tuner_input in;
    REAL *const fields[] = { FIELDS };
    size_t count = fread(rows, sizeof rows[0], MOST, stdin), k;
    int i;
    clock_t begun = clock();
    tuner_init(&state);
    for (k = 0; k < count; ++k) {
        for (i = 0; i < N; ++i) *fields[i] = rows[k][i];
        statuses[k] = (unsigned char)tuner_step(&state, &in, &torques[k]);
    }
    fprintf(stderr, "%g", (double)(clock() - begun) / CLOCKS_PER_SEC);
    fwrite(torques, sizeof torques[0], count, stdout);
    fwrite(statuses, 1, count, stdout);
    return 0;
}
"""


@cache
def has_compiler(name):
    """Whether a compiler is installed; a missing one is named once."""
    found = shutil.which(name) is not None
    if not found:
        print(f"{name} is not installed: its comparisons are left out")
    return found


def compiled_program(folder, compiler, *options, main="self_test.c"):
    """The program of an exported tuner and a main file."""
    program = folder / "program"
    command = [compiler, *FLAGS, *options, "tuner.c", main, "-o", str(program)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=COMPILE_TIME, check=False)
    assert done.returncode == 0, done.stderr
    return program


def run_in_c(folder, tuner, rows, compiler, *options):
    """Statuses and torques of rows of inputs, and the time of a step [ns]."""
    fields = ", ".join(f"&in.{each}" for each in tuner.inputs)
    macros = {"MOST": len(rows), "FIELDS": fields, "REAL": REAL[tuner.real], "N": len(tuner.inputs)}
    (folder / "driver.c").write_text(DRIVER, encoding="ascii")
    program = compiled_program(
        folder, compiler, *options, *(f"-D{name}={text}" for name, text in macros.items()), main="driver.c"
    )
    with np.errstate(over="ignore"):
        given = np.ascontiguousarray(rows, dtype=tuner.real).tobytes()
    done = subprocess.run([program], input=given, capture_output=True, timeout=RUN_TIME, check=True)
    torques = np.frombuffer(done.stdout, tuner.real, len(rows))
    return np.frombuffer(done.stdout[torques.nbytes :], np.uint8), torques, 1e9 * float(done.stderr) / len(rows)


def some_tuner(rng, **changed):
    """A random tuner: 6 or 7 inputs, 1 to 12 neurons, both readings, with a guard or without."""
    inputs, hidden, is_free = int(rng.choice([6, 7])), int(rng.integers(1, 13)), bool(rng.random() < 0.3)
    size = float(rng.choice([0.5, 5.0, 50.0]))
    return SavedTuner(
        format=FORMAT, arm="sasaki2012-lab", period=0.01, K1=0.3, Kp=float(rng.choice([0.0, 2.0])),
        signals=str(rng.choice(["vibration", "total"])), a=1.0, b=2.6,
        guard_kind="none" if is_free else "time-varying", guard=None if is_free else SECTOR,
        scales=(10 ** rng.uniform(-2, 2, inputs)).tolist(),
        W1=rng.normal(0, size, (hidden, inputs)).tolist(), w2=rng.normal(0, size, hidden).tolist(),
    ).model_copy(update=changed)  # fmt: skip


def some_inputs(rng, samples, width):
    """Inputs of all sizes: quantised and clipped as by converters, zeros, and one in 200 that has to be refused."""
    rows = rng.normal(size=(samples, width)) * 10 ** rng.uniform(-8, 3, (samples, 1))
    coarse = rng.random(samples) < 0.3
    rows[coarse] = np.clip(np.round(rows[coarse] * 64) / 64, -8.0, 8.0)
    rows[rng.random(rows.shape) < 0.05] = 0.0
    odd = rng.random(rows.shape) < 0.005 / width
    rows[odd] = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 3e38, 5e-324], odd.sum())
    return rows


def is_equal(folder, tuner, rows, compiler, *options):
    """Whether C and Python are equal to the last bit, and the time of a step [ns]."""
    tuner.reset()
    torques, statuses = tuner.run(rows)
    in_c, torques_in_c, time = run_in_c(folder, tuner, rows, compiler, *options)
    return bool((in_c == statuses).all() and torques_in_c.tobytes() == torques.tobytes()), time


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
    for precision in REAL.values():
        other = simulator.controller(ExportedTuner(saved, precision))
        found[precision] = float(abs(other.torque - own.torque).max() / abs(own.torque).max())
    return found


def bits(size, seed):
    """C against Python; `ns` is the time of a step of 6-6-1 at -O2."""
    rng = np.random.default_rng(seed)
    samples = SAMPLES // (2 * size)
    for n in range(size):
        saved = (
            some_tuner(rng, W1=rng.normal(size=(6, 6)).tolist(), w2=[0.3] * 6, scales=[1.0] * 6)
            if n == 0
            else some_tuner(rng)
        )
        for precision in REAL.values():
            with tempfile.TemporaryDirectory() as place:
                tuner = exported(Path(place), saved, precision, anyway=True)
                rows = some_inputs(rng, samples, len(tuner.inputs))
                for compiler in filter(has_compiler, COMPILERS):
                    for level in LEVELS:
                        equal, time = is_equal(Path(place), tuner, rows, compiler, level)
                        figures = {f"ns, {precision}": time} if n == 0 and level == "-O2" else {}
                        slow = any(each > STEP_TIME for each in figures.values())
                        words = "" if equal else f"{compiler} {level} {precision} {saved}"
                        yield Finding("equal" if equal else "differs", words, not equal or slow, figures)


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
