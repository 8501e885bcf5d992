"""A trained tuner as C99: header, source and self-test, and the same tuner as a controller of simulations."""

import hashlib
from importlib.metadata import version
from typing import Any

import numpy as np

from tfarm.arm import HubFeedback
from tfarm.arrays import Real, Whole
from tfarm.dsp import Measurement, sampled_loop
from tfarm.errors import MISSING, ParameterError, must_be_known, require
from tfarm.exported.controller import FEEDFORWARD, REAL, Port, recorded
from tfarm.exported.result import ANYWAY, Export, ExportTask, names_of
from tfarm.exported.texts import literal, name_in_c, render
from tfarm.exported.tuner_twin import ULPS, numbers_of, run
from tfarm.exported.word_length import FLOATS
from tfarm.tuner.guard import sector_guard
from tfarm.tuner.trial import TRIAL_MODES, SavedTuner, load_tuner

INPUTS = {  # by identifier in C: the field of a `Measurement`, the meaning, and the unit ("": that of the arm's input)
    "y_hub_angle": ("hub_angle", "hub angle", "rad"),
    "y_hub_rate": ("hub_rate", "hub rate", "rad/s"),
    "y_root_moment": ("root_moment", "root moment", "N m"),
    "r_hub_angle": ("angle_reference", "reference of the hub angle", "rad"),
    "r_hub_rate": ("rate_reference", "reference of the hub rate", "rad/s"),
    "r_root_moment": ("rigid_moment", "root moment of the rigid arm", "N m"),
    FEEDFORWARD: ("feedforward", "feedforward", ""),
}


class ExportedTuner:
    """A tuner in the arithmetic of its C source: a controller of `Simulator.controller`.

    `precision` is "double" or "float".  Raises ParameterError for a number of the tuner beyond its range.
    """

    def __init__(self, saved: SavedTuner, precision: str = "double") -> None:
        must_be_known("precision", precision, FLOATS)
        self.real, self.scale = FLOATS[precision][0], saved.scales[0]
        self.numbers = numbers_of(saved, self.real)
        self.inputs = {key: of for key, of in INPUTS.items() if not (self.numbers.is_total and key == "r_root_moment")}
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first sample."""
        self.state = np.zeros(6, self.real)

    def run(self, inputs: Real) -> tuple[Real, Whole]:
        """Advance over rows of `inputs` (n, inputs); return torques and status (n,), as the C code has them."""
        torque, status = np.zeros(len(inputs), self.real), np.zeros(len(inputs), np.int64)
        with np.errstate(over="ignore"):
            rows = np.ascontiguousarray(inputs, dtype=self.real)
        run(self.numbers, self.state, rows, torque, status)
        return torque, status

    def __call__(self, m: Measurement) -> float:
        """The torque of a sample; that of the sample before where a number is NaN, infinite or too large."""
        if m.k == 0:
            self.reset()
        return float(self.run(np.array([[getattr(m, name) for name, _, _ in self.inputs.values()]]))[0][0])


def c_tuner(task: ExportTask) -> Export:
    """The files of a trained tuner in C99.

    Raises ParameterError without a tuner, for one of another sampling period, and, unless `anyway`, for one whose gain
    is not certified to vary in its guard on this arm.
    """
    if task.tuned is None:
        raise ParameterError(key="tuned", value=MISSING, remedy="give the file of tfarm tune ARM --save FILE.json")
    saved, period = load_tuner(task.tuned, "tuned"), task.chain.sampling.period
    remedy = f"the tuner was trained every {saved.period!r} s: sample so, or train one at this period"
    require(saved.period == period, "sampling.period", period, remedy)
    tuner = ExportedTuner(saved, task.precision)
    of = tuner.numbers
    loop = sampled_loop(task.arm, HubFeedback(K1=float(of.K1), K2=1.0, Kp=float(of.Kp)), task.chain, count=TRIAL_MODES)
    guard = None if of.is_free else sector_guard(loop, float(of.lo), float(of.hi))
    certainty = "not certified for a gain that varies" if guard is None else guard.sentence
    is_proven = guard is not None and guard.is_proven
    remedy = f"on this arm the gain is {certainty}; --anyway exports it"
    require(is_proven or task.anyway, "tuned", str(task.tuned), remedy)
    facts = {
        "arm": task.arm.name, "tuner": f"trained on {saved.arm}", **({} if is_proven else {"warning": ANYWAY}),
        "sampling period": f"{period!r} s", "moment gain": certainty,
        "network": f"{of.scales.size}-{of.w2.size}-1, {task.precision}",
        "SHA-256 of the tuner": hashlib.sha256(task.tuned.read_bytes()).hexdigest(),
        "SHA-256 of the inputs": task.sha256, "tfarm": version("tfarm"),
    }  # fmt: skip
    name = name_in_c(task.name or "tuner")
    contents = written(task, tuner, next(iter(name.values())), facts)
    return Export(
        what=task.what, form=task.form, contents=contents, names=names_of(name), verdict=certainty, sha256=task.sha256
    )


def written(task: ExportTask, tuner: ExportedTuner, name: str, facts: dict[str, str]) -> dict[str, bytes]:
    """The files by name; constants have the names that they have in `tuner_twin`."""
    of, (real, suffix, _) = tuner.numbers, REAL[task.precision]
    unused = {"lo", "hi"} if of.is_free else {"two", "turn", "artanh"}
    kept: dict[str, Any] = {key: each for key, each in of._asdict().items() if key not in unused}
    ports = [
        Port(of_sample, key, f"{meaning} [{unit or task.arm.input_unit}]", 1.0 if "rad" in unit else tuner.scale)
        for key, (of_sample, meaning, unit) in tuner.inputs.items()
    ]
    values = {
        "name": name, "facts": list(facts.items()), "fixed": False, "real": real, "suffix": suffix, "header": "tuner.h",
        "fields": ports, "output": f"{task.arm.input} [{task.arm.input_unit}]", "of": of, "ulps": ULPS,
        "scalars": {key: literal(float(x), suffix) for key, x in kept.items() if isinstance(x, np.floating)},
        "tables": {
            key: [literal(x, suffix) for x in each.ravel().tolist()]
            for key, each in kept.items() if isinstance(each, np.ndarray)
        },
        **recorded(tuner.run, ports, task.precision),
    }  # fmt: skip
    return {file: render(file, **values) for file in ("tuner.h", "tuner.c", "self_test.c")}
