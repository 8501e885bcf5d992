"""A trained tuner in C99, and the same arithmetic in Python, operation by operation.

    u = servo (+ r),   x = moment (- rigid moment),   K = network(u, u1, e1, e2, x, x1 (, K1)),   e = u - K x

    torque = r + servo - K x,   servo = Kp (angle reference - hub angle) + K1 (rate reference - hub rate)

with r the feedforward torque, counted in u under the reading "total", where no rigid moment is subtracted.  Numbers 1
and 2 are those of one and two samples before.  Where an input, or u, e, x, K or the torque, is NaN, infinite or beyond
`largest`, a step returns 1, or 2, holds the torque of the step before and keeps its state.  Below `largest` no sum of
the network overflows, so that a kept state refuses no later sample.
"""

import hashlib
import math
from importlib.metadata import version
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.dsp import Measurement
from tfarm.errors import MISSING, ParameterError, must_be_known, require
from tfarm.exact.compiled import compiled
from tfarm.exported.activation import ULPS, Activation, activation, sigmoid, softplus
from tfarm.exported.result import ANYWAY, Export, ExportTask, names_of
from tfarm.exported.texts import identifiers, render
from tfarm.schema import Quantity
from tfarm.tuner.guard import sector_guard
from tfarm.tuner.kernel import K_BEFORE
from tfarm.tuner.trial import SavedTuner, Trial, load_tuner, slew_trial

RECORDED_SAMPLES = 1000  # of the self-test
LONGEST_NAME = 20  # characters of a name, which others are appended to
REALS = {"double": np.float64, "float": np.float32}
INPUTS = {  # the field of a `Measurement` of each input, in the order of the C source
    "y_hub_angle": "hub_angle",
    "y_hub_rate": "hub_rate",
    "y_root_moment": "root_moment",
    "r_hub_angle": "angle_reference",
    "r_hub_rate": "rate_reference",
    "r_root_moment": "rigid_moment",
    "feedforward": "feedforward",
}
ANGLE, RATE, MOMENT, WANTED_ANGLE, WANTED_RATE, WANTED_MOMENT, FORWARD = 0, 1, 2, 3, 4, 5, -1
INPUT_ERROR, OVERFLOW = 1, 2
U, E, X, K, E_BEFORE, TORQUE = range(6)  # places of the state: the last sample, and e of the one before


class Weights(NamedTuple):
    """Numbers of a tuner in one precision: network, servo and guard, as in `tfarm.tuner.kernel`."""

    activation: Activation
    W1: Real
    w2: Real
    scales: Real
    K1: float
    Kp: float
    lo: float
    hi: float
    span: float
    largest: float
    is_total: bool
    is_free: bool


@compiled
def network_gain(of: Weights, row: Real) -> float:
    """K of a row of inputs."""
    z = of.activation.zero
    for j in range(of.w2.size):
        net = of.activation.zero
        for i in range(row.size):
            net += of.W1[j, i] * (row[i] / of.scales[i])
        z += of.w2[j] * sigmoid(net, of.activation)
    if of.is_free:
        return softplus(z, of.activation)
    gain = of.lo + of.span * sigmoid(z, of.activation)
    gain = of.lo if gain < of.lo else gain
    return of.hi if gain > of.hi else gain


@compiled
def step(of: Weights, state: Real, row: Real, inputs: Real) -> int:
    """Advance by one sample; return 0, or the kind of an error.  `row` is for the inputs of the network."""
    for value in inputs:
        if not -of.largest <= value <= of.largest:
            return INPUT_ERROR
    x = inputs[MOMENT] if of.is_total else inputs[MOMENT] - inputs[WANTED_MOMENT]
    servo = of.Kp * (inputs[WANTED_ANGLE] - inputs[ANGLE]) + of.K1 * (inputs[WANTED_RATE] - inputs[RATE])
    u = servo + inputs[FORWARD] if of.is_total else servo
    row[0], row[1], row[2], row[3], row[4], row[5] = u, state[U], state[E], state[E_BEFORE], x, state[X]
    if row.size > K_BEFORE:
        row[K_BEFORE] = state[K]
    gain = network_gain(of, row)
    e, torque = u - gain * x, (inputs[FORWARD] + servo) - gain * x
    for value in (u, e, x, gain, torque):
        if not -of.largest <= value <= of.largest:
            return OVERFLOW
    state[E_BEFORE] = state[E]
    state[U], state[E], state[X], state[K], state[TORQUE] = u, e, x, gain, torque
    return 0


@compiled
def run(of: Weights, state: Real, row: Real, inputs: Real, status: Any, torque: Real) -> None:
    """Step over rows of inputs."""
    for k in range(status.size):
        status[k] = step(of, state, row, inputs[k])
        torque[k] = state[TORQUE]


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
        must_be_known("precision", precision, REALS)
        self.real = REALS[precision]
        self.weights = weights_of(saved, self.real)
        self.inputs = {name: of for name, of in INPUTS.items() if not (self.weights.is_total and of == "rigid_moment")}
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first sample."""
        self.state, self._row = np.zeros(6, self.real), np.zeros(self.weights.scales.size, self.real)

    def run(self, inputs: Real) -> tuple[NDArray[np.int32], Real]:
        """Advance over rows of `inputs` (n, inputs); return statuses (n,) and torques (n,)."""
        status, torque = np.zeros(len(inputs), np.int32), np.zeros(len(inputs), self.real)
        with np.errstate(over="ignore"):
            run(self.weights, self.state, self._row, np.ascontiguousarray(inputs, dtype=self.real), status, torque)
        return status, torque

    def __call__(self, m: Measurement) -> float:
        """The torque of a sample; that of the sample before where a number is NaN, infinite or too large."""
        if m.k == 0:
            self.reset()
        return float(self.run(np.array([self.row(m)]))[1][0])

    def row(self, m: Measurement) -> list[float]:
        """The inputs at a sample."""
        return [getattr(m, name) for name in self.inputs.values()]


class TunerCode(NamedTuple):
    """Properties of a tuner in C."""

    network: Annotated[str, Quantity("network", help="inputs, hidden neurons and outputs")]
    precision: Annotated[str, Quantity("precision", help="double or float")]
    samples: Annotated[int, Quantity("samples of the self-test", help="samples of a simulated slew")]


def c_tuner(task: ExportTask) -> Export:
    """A trained tuner in C: source, header and self-test.

    Raises ParameterError without a tuner, for one of another sampling period, and, unless `anyway`, for one whose gain
    may not vary in its guard on this arm.
    """
    if task.tuned is None:
        raise ParameterError(key="tuned", value=MISSING, remedy="give the file of tfarm tune ARM --save FILE.json")
    saved, period = load_tuner(task.tuned), task.chain.sampling.period
    remedy = f"the tuner was trained every {saved.period!r} s: sample so, or train one at this period"
    require(saved.period == period, "sampling.period", period, remedy)
    tuner = ExportedTuner(saved, task.precision)
    of, unit = tuner.weights, task.arm.input_unit
    duration = max(RECORDED_SAMPLES * period, task.chain.slew.rise_time)
    trial = slew_trial(
        task.arm, task.chain, K1=float(of.K1), Kp=float(of.Kp), signals=saved.signals, duration=duration
    )
    guard = None if of.is_free else sector_guard(trial.loop, float(of.lo), float(of.hi))
    certainty = "not certified for a gain that varies" if guard is None else guard.sentence
    is_proven = guard is not None and guard.is_proven
    remedy = f"on this arm the gain is {certainty}; --anyway exports it"
    require(is_proven or task.anyway, "tuned", str(task.tuned), remedy)
    names = identifiers([task.name or "tuner"], "", LONGEST_NAME)
    (name,) = names.values()
    network = f"{of.scales.size}-{of.w2.size}-1"
    facts = {
        "arm": task.arm.name, "tuner": f"{network}, trained on {saved.arm}", "sampling period": f"{period!r} s",
        "moment gain": certainty, **({} if is_proven else {"warning": ANYWAY}),
        "SHA-256 of the tuner": hashlib.sha256(task.tuned.read_bytes()).hexdigest(),
        "SHA-256 of the inputs": task.sha256, "tfarm": version("tfarm"),
    }  # fmt: skip
    rows = recorded(tuner, trial)
    texts = {
        "name": name, "facts": facts, "of": of, "real": task.precision, "ulps": ULPS, "rows": rows,
        "inputs": {each: INPUTS[each].format(unit=unit) for each in tuner.inputs},
    }  # fmt: skip
    contents = {
        target: render(template, **texts)
        for target, template in (("tuner.h", "tuner.h"), ("tuner.c", "tuner.c"), ("self_test.c", "tuner_test.c"))
    }
    return Export(
        what=task.what, form=task.form, contents=contents, names=names_of(names), verdict=certainty,
        details=TunerCode(network, task.precision, len(rows)), sha256=task.sha256,
    )  # fmt: skip


def recorded(tuner: ExportedTuner, trial: Trial) -> Real:
    """Inputs and torque (samples, inputs + 1) of the first samples of a simulated slew."""
    rows: list[list[float]] = []

    def controller(m: Measurement) -> float:
        rows.append([*tuner.row(m), tuner(m)])
        return rows[-1][-1]

    trial.simulator().controller(controller)
    return np.array(rows[:RECORDED_SAMPLES], dtype=tuner.real)
