"""A trained tuner as C99: header, source and self-test, and the same tuner as a controller of simulations."""

import hashlib
import math
from importlib.metadata import version
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import HubFeedback
from tfarm.arrays import Real, Whole
from tfarm.dsp import Measurement, sampled_loop
from tfarm.errors import MISSING, ParameterError, must_be_known, require
from tfarm.exported.controller import FEEDFORWARD, Field, recorded
from tfarm.exported.result import ANYWAY, Export, ExportTask, Name, names_of
from tfarm.exported.texts import facts_of, literal, name_in_c, render
from tfarm.exported.tuner_twin import ULPS, Weights, activation, run
from tfarm.exported.word_length import FLOATS
from tfarm.schema import Quantity
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


def weights_of(saved: SavedTuner, real: Any) -> Weights:
    """The numbers of a tuner in np.float64 or np.float32, the guard rounded inwards.

    Raises ParameterError for a number beyond the range of the precision.
    """
    limits = saved.gain().guard
    with np.errstate(over="ignore", under="ignore"):
        of = {name: np.array(getattr(saved, name), dtype=real) for name in ("W1", "w2", "scales", "K1", "Kp")}
        lo, hi = real(limits.lo), real(limits.hi)
    lo = np.nextafter(lo, real(math.inf)) if float(lo) < limits.lo else lo
    hi = np.nextafter(hi, real(0.0)) if float(hi) > limits.hi else hi
    remedy = "is beyond the range of float: export it in double"
    for name, rounded in of.items():
        is_odd = ~np.isfinite(rounded) | (rounded == 0 if name == "scales" else False)
        for value in np.asarray(getattr(saved, name))[is_odd].tolist():
            raise ParameterError(key=name, value=value, remedy=remedy)
    require(lo < hi, "guard", saved.guard, remedy)
    steepest = 2 * of["scales"].size * max(1.0, float(abs(of["W1"]).max()))
    largest = real(min(1.0, float(of["scales"].min()) / steepest) * float(np.finfo(real).max))
    is_total = saved.signals == "total"
    return Weights(
        activation(real), of["W1"], of["w2"], of["scales"], real(of["K1"]), real(of["Kp"]),
        lo, hi, hi - lo, largest, is_total, saved.guard is None,
    )  # fmt: skip


class ExportedTuner:
    """A tuner in the arithmetic of its C source: a controller of `Simulator.controller`.

    `precision` is "double" or "float".  Raises ParameterError for a number of the tuner beyond its range.
    """

    def __init__(self, saved: SavedTuner, precision: str = "double") -> None:
        must_be_known("precision", precision, FLOATS)
        self.real = FLOATS[precision][0]
        self.weights = weights_of(saved, self.real)
        self.scale = saved.scales[0]
        self.inputs = {key: of for key, of in INPUTS.items() if not (self.weights.is_total and key == "r_root_moment")}
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first sample."""
        self.state, self._row = np.zeros(6, self.real), np.zeros(self.weights.scales.size, self.real)

    def run(self, inputs: Real) -> tuple[Real, Whole]:
        """Advance over rows of `inputs` (n, inputs); return torques and status (n,), as the C code has them."""
        torque, status = np.zeros(len(inputs), self.real), np.zeros(len(inputs), np.int64)
        with np.errstate(over="ignore"):
            rows = np.ascontiguousarray(inputs, dtype=self.real)
        run(self.weights, self.state, self._row, rows, torque, status)
        return torque, status

    def __call__(self, m: Measurement) -> float:
        """The torque of a sample; that of the sample before where a number is NaN, infinite or too large."""
        if m.k == 0:
            self.reset()
        return float(self.run(np.array([self.row(m)]))[0][0])

    def row(self, m: Measurement) -> list[float]:
        """Inputs of a sample."""
        return [getattr(m, name) for name, _, _ in self.inputs.values()]


class TunerCode(NamedTuple):
    """Properties of a tuner in C."""

    network: Annotated[str, Quantity("network", help="inputs, hidden neurons and outputs")]
    precision: Annotated[str, Quantity("arithmetic", help="double or float")]
    exp_error: Annotated[float, Quantity("bound on the error of exp", "ulp", 2, "units in the last place")]
    log_error: Annotated[float, Quantity("bound on the error of log", "ulp", 2, "units in the last place")]


def c_tuner(task: ExportTask) -> Export:
    """The files of a trained tuner in C99.

    Raises ParameterError without a tuner, for one of another sampling period, and, unless `anyway`, for one whose gain
    is not certified to vary in its guard on this arm.
    """
    if task.tuned is None:
        raise ParameterError(key="tuned", value=MISSING, remedy="give the file of tfarm tune ARM --save FILE.json")
    saved, period = load_tuner(task.tuned), task.chain.sampling.period
    remedy = f"the tuner was trained every {saved.period!r} s: sample so, or train one at this period"
    require(saved.period == period, "sampling.period", period, remedy)
    tuner = ExportedTuner(saved, task.precision)
    of = tuner.weights
    servo = HubFeedback(K1=float(of.K1), K2=1.0, Kp=float(of.Kp))
    loop = sampled_loop(task.arm, servo, task.chain, count=TRIAL_MODES)
    guard = None if of.is_free else sector_guard(loop, float(of.lo), float(of.hi))
    certainty = "not certified for a gain that varies" if guard is None else guard.sentence
    is_proven = guard is not None and guard.is_proven
    remedy = f"on this arm the gain is {certainty}; --anyway exports it"
    require(is_proven or task.anyway, "tuned", str(task.tuned), remedy)
    details = TunerCode(f"{of.scales.size}-{of.w2.size}-1", task.precision, *ULPS.values())
    facts = {
        "arm": task.arm.name, "tuner": f"trained on {saved.arm}", **({} if is_proven else {"warning": ANYWAY}),
        "sampling period": f"{period!r} s", "moment gain": certainty,
        "SHA-256 of the tuner": hashlib.sha256(task.tuned.read_bytes()).hexdigest(),
        "SHA-256 of the inputs": task.sha256, "tfarm": version("tfarm"),
    }  # fmt: skip
    contents, names = written(task, tuner, [*facts.items(), *facts_of(details)])
    return Export(
        what=task.what, form=task.form, contents=contents, names=names, verdict=certainty, details=details,
        sha256=task.sha256,
    )  # fmt: skip


def written(
    task: ExportTask, tuner: ExportedTuner, facts: list[tuple[str, str]]
) -> tuple[dict[str, bytes], list[Name]]:
    """The files by name, and the identifiers of names."""
    weights, name = tuner.weights, name_in_c(task.name or "tuner")
    suffix = "f" if task.precision == "float" else ""
    numbers = {**weights.activation._asdict(), **weights._asdict()}
    unused = {"lo", "hi", "span"} if weights.is_free else {"two", "turn", "artanh"}
    tables = {key: np.ravel(each).tolist() for key, each in numbers.items() if isinstance(each, np.ndarray)}
    scalars = {key: float(each) for key, each in numbers.items() if isinstance(each, np.floating)}
    fields = [
        Field(of, key, f"{meaning} [{unit or task.arm.input_unit}]", 1.0 if "rad" in unit else tuner.scale)
        for key, (of, meaning, unit) in tuner.inputs.items()
    ]
    values = {
        "name": next(iter(name.values())), "facts": facts, "fixed": False, "real": task.precision, "header": "tuner.h",
        "fields": fields, "output": f"{task.arm.input} [{task.arm.input_unit}]", "of": weights, "ulps": ULPS,
        "scalars": {key: literal(each, suffix) for key, each in scalars.items() if key not in unused},
        "tables": {key: [literal(x, suffix) for x in each] for key, each in tables.items() if key not in unused},
        **recorded(tuner.run, [each.size for each in fields], task.precision),
    }  # fmt: skip
    return {file: render(file, **values) for file in ("tuner.h", "tuner.c", "self_test.c")}, names_of(name)
