"""A trained tuner as C99: header, source and self-test, and the same tuner as a controller of simulations.

Its arithmetic in Python is that of its C code, operation by operation in the same order:

    u = servo (+ r),   x = moment (- rigid moment),   K = network(u, u1, e1, e2, x, x1 (, K1)),   e = u - K x

    torque = r + servo - K x,   servo = Kp (angle reference - hub angle) + K1 (rate reference - hub rate)

with r the feedforward torque, counted in u under the reading "total", where no rigid moment is subtracted.  Numbers 1
and 2 are those of one and two samples before.  Where an input, or u, e, x, K or the torque, is NaN, infinite or beyond
`largest`, a step returns the kind of the error, holds the torque of the step before and keeps its state.  Below
`largest` no sum of the network overflows, so that a kept state refuses no later sample.

exp of its activation:

    e^x = 2^k e^r,   k = x/ln 2 to the nearest whole number,   r = (x - k h) - k l,   |r| <= ln(2)/2

with ln 2 = h + l, h of so few bits that k h is exact (Cody and Waite, Software Manual for the Elementary Functions,
1980), e^r by Taylor's polynomial, coefficients 1/n! rounded to the precision, and 2^k as a product of powers of 1/2.
What the polynomial leaves out is below a tenth of half a unit in the last place; the largest error is 1.5 of these
units.  A tuner without a guard, whose gain has no upper end and no certificate, is not exported.

Every number has one precision: literals of Python would make doubles of single-precision operands.
"""

import hashlib
import math
from enum import IntEnum
from fractions import Fraction
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import HubFeedback
from tfarm.arm.stages import Consumer
from tfarm.arrays import Real, Whole
from tfarm.dsp import Measurement
from tfarm.errors import MISSING, ParameterError, must_be_known, require
from tfarm.exact.compiled import compiled, inlined
from tfarm.exported.controller import REAL, Port, self_test_values
from tfarm.exported.kernel import Status, numbers_of
from tfarm.exported.result import ANYWAY, Export, ExportTask, names_of
from tfarm.exported.texts import literal, name_in_c, render_source
from tfarm.exported.word_length import FEEDFORWARD, FLOATS
from tfarm.loop.sampled import sampled_loop
from tfarm.tuner.guard import sector_guard
from tfarm.tuner.trial import TRIAL_MODES, SavedTuner, load_tuner

CONSUMER = Consumer(
    "export c of a tuner",
    acts=("anti-alias filter", "hub rate", "law", "hold", "delay", "hub damping", "plant"),
    named=(
        "encoder",
        "amplifier steps",
        "amplifier range",
        "DAC steps",
        "DAC range",
        "torque limit",
        "arithmetic",
    ),
    none=("reference", "volts"),
)

# exact, and of either precision with another number
ZERO, ONE = np.array([0.0, 1.0], np.float32)


class InputPlace(IntEnum):
    """Places of the inputs; the feedforward is the last one."""

    ANGLE = 0
    RATE = 1
    MOMENT = 2
    WANTED_ANGLE = 3
    WANTED_RATE = 4
    WANTED_MOMENT = 5


class StatePlace(IntEnum):
    """Places of the state: the last sample, and e of the one before."""

    U = 0
    E = 1
    X = 2
    K = 3
    E_BEFORE = 4
    TORQUE = 5


class TunerConstants(NamedTuple):
    """Numbers of a tuner in one precision.

    e^x is 0 up to `lowest`; adding and subtracting `shift` rounds to a whole number; `inverse` is 1/ln 2, ln 2 = `high`
    + `low`; `taylor` in ascending order.  Then network, servo and guard, as in `tfarm.tuner.kernel`.
    """

    half: float
    lowest: float
    shift: float
    inverse: float
    high: float
    low: float
    taylor: Real
    W1: Real
    w2: Real
    scales: Real
    K1: float
    Kp: float
    lo: float
    hi: float
    largest: float
    is_total: bool


def constants_of_tuner(saved: SavedTuner, real: Any) -> TunerConstants:
    """Return the numbers of a tuner in np.float64 or np.float32, the guard rounded inwards.

    Raises ParameterError for a number beyond the range of the precision, and for a tuner without a guard.
    """
    remedy = "a tuner without a guard has no certificate for its gain: train one with --guard time-varying"
    require(saved.guard is not None, "guard_kind", saved.guard_kind, remedy)
    # 35 digits: math.log(2) and its remainder
    ln_2 = Fraction(math.log(2.0)) + Fraction(2319046813846299558, 10**35)
    bits, lowest, terms = (42, -708.0, 14) if real is np.float64 else (16, -87.0, 9)
    high = Fraction(round(ln_2 * 2**bits), 2**bits)
    scalars = 0.5, lowest, 1.5 * 2 ** np.finfo(real).nmant, 1 / math.log(2.0), high, ln_2 - high
    taylor = np.array([1 / math.factorial(n) for n in range(terms)], dtype=real)
    limits = saved.gain().guard
    names = ("W1", "w2", "scales", "K1", "Kp")
    with np.errstate(over="ignore", under="ignore"):
        rounded = [np.array(getattr(saved, name), dtype=real) for name in names]
        lo, hi = map(real, limits)
    W1, w2, scales, K1, Kp = rounded
    if float(lo) < limits.lo:
        lo = np.nextafter(lo, real(math.inf))
    if float(hi) > limits.hi:
        hi = np.nextafter(hi, real(0.0))
    usable = [*(np.isfinite(each).all() for each in rounded), scales.all(), lo < hi]
    remedy = "beyond the range or the digits of float: export it in double"
    for name, is_usable in zip((*names, "scales", "guard"), usable, strict=True):
        require(is_usable, name, getattr(saved, name), remedy)
    share = float(scales.min()) / (2 * scales.size * max(1.0, float(abs(W1).max())))
    largest = real(min(1.0, share) * float(np.finfo(real).max))
    own = (taylor, W1, w2, scales, real(K1), real(Kp), lo, hi, largest)
    rounded_scalars = (real(float(each)) for each in scalars)
    return TunerConstants._make([*rounded_scalars, *own, saved.signals == "total"])


@inlined
def evaluate_polynomial(x: float, coefficients: Real) -> float:
    """Return the sum of coefficients[n] x^n, by Horner's rule."""
    total = coefficients[coefficients.size - 1]
    for n in range(coefficients.size - 2, -1, -1):
        total = total * x + coefficients[n]
    return total


@compiled
def exponential(x: float, of: TunerConstants) -> float:
    """Return e^x for x <= 0; 0 of NaN, which u, e or x then is too: the step is refused."""
    if not x > of.lowest:
        return ZERO
    k = (x * of.inverse + of.shift) - of.shift
    result = evaluate_polynomial((x - k * of.high) - k * of.low, of.taylor)
    power = of.half
    n = int(-k)
    # at most ten times
    while n > 0:
        if n % 2 == 1:
            result *= power
        power *= power
        n //= 2
    return result


@compiled
def sigmoid(z: float, of: TunerConstants) -> float:
    """Return 1/(1 + e^-z)."""
    small = exponential(-z if z > ZERO else z, of)
    return (ONE if z > ZERO else small) / (ONE + small)


@inlined
def network_output(of: TunerConstants, row: Real) -> float:
    """Return K of a row of inputs."""
    z = ZERO
    for j in range(of.w2.size):
        net = ZERO
        for i in range(of.scales.size):
            net += of.W1[j, i] * (row[i] / of.scales[i])
        z += of.w2[j] * sigmoid(net, of)
    # not below lo; above hi by rounding
    gain = of.lo + (of.hi - of.lo) * sigmoid(z, of)
    return of.hi if gain > of.hi else gain


@inlined
def advance_sample(of: TunerConstants, state: Real, inputs: Real) -> int:
    """Advance by one sample; return 0, or the kind of an error."""
    forward = -1
    for value in inputs:
        if not -of.largest <= value <= of.largest:
            return Status.INPUT_ERROR
    x = inputs[InputPlace.MOMENT]
    if not of.is_total:
        x = x - inputs[InputPlace.WANTED_MOMENT]
    angle = inputs[InputPlace.WANTED_ANGLE] - inputs[InputPlace.ANGLE]
    rate = inputs[InputPlace.WANTED_RATE] - inputs[InputPlace.RATE]
    servo = of.Kp * angle + of.K1 * rate
    u = servo + inputs[forward] if of.is_total else servo
    u1 = state[StatePlace.U]
    e1 = state[StatePlace.E]
    e2 = state[StatePlace.E_BEFORE]
    x1 = state[StatePlace.X]
    gain1 = state[StatePlace.K]
    row = np.array([u, u1, e1, e2, x, x1, gain1])
    gain = network_output(of, row)
    e = u - gain * x
    torque = (inputs[forward] + servo) - gain * x
    for value in (u, e, x, gain, torque):
        if not -of.largest <= value <= of.largest:
            return Status.OVERFLOW
    state[StatePlace.E_BEFORE] = e1
    state[StatePlace.U] = u
    state[StatePlace.E] = e
    state[StatePlace.X] = x
    state[StatePlace.K] = gain
    state[StatePlace.TORQUE] = torque
    return 0


@compiled
def advance_rows(of: TunerConstants, state: Real, inputs: Real, torque: Real, status: Whole) -> None:
    """Step over rows of inputs."""
    for k in range(status.size):
        status[k] = advance_sample(of, state, inputs[k])
        torque[k] = state[StatePlace.TORQUE]


# by identifier in C: the field of a `Measurement`, the meaning, and the unit ("": that of the arm's input)
INPUTS = {
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
        self.real, _ = FLOATS[precision]
        self.scale = saved.scales[0]
        self.numbers = constants_of_tuner(saved, self.real)
        self.inputs = dict(INPUTS)
        if self.numbers.is_total:
            del self.inputs["r_root_moment"]
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first sample."""
        self.state = np.zeros(len(StatePlace), self.real)

    def run(self, inputs: Real) -> tuple[Real, Whole]:
        """Advance over rows of `inputs` (n, inputs); return torques and status (n,), as the C code has them."""
        torque = np.zeros(len(inputs), self.real)
        status = np.zeros(len(inputs), np.int64)
        with np.errstate(over="ignore"):
            rows = np.ascontiguousarray(inputs, dtype=self.real)
        advance_rows(self.numbers, self.state, rows, torque, status)
        return torque, status

    def __call__(self, m: Measurement) -> float:
        """Return the torque of a sample; that of the sample before where a number is NaN, infinite or too large."""
        if m.k == 0:
            self.reset()
        row = np.array([getattr(m, name) for name, _, _ in self.inputs.values()])
        torque, _ = self.run(row[None])
        return float(torque[0])


def c_tuner(task: ExportTask) -> Export:
    """Return the files of a trained tuner in C99.

    Raises ParameterError without a tuner, for one of another sampling period, and, unless `anyway`, for one whose gain
    is not certified to vary in its guard on this arm.
    """
    if task.tuned is None:
        raise ParameterError(
            key="tuned", value=MISSING, remedy="give the file of tfarm tune ARM --save FILE.json"
        )
    case = task.case
    saved = load_tuner(task.tuned, "tuned")
    period = case.chain.sampling.period
    remedy = f"the tuner was trained every {saved.period!r} s: sample so, or train one at this period"
    require(saved.period == period, "sampling.period", period, remedy)
    tuner = ExportedTuner(saved, task.precision)
    of = tuner.numbers
    loop = sampled_loop(case.under(HubFeedback(K1=float(of.K1), K2=1.0, Kp=float(of.Kp))), count=TRIAL_MODES)
    guard = sector_guard(loop, float(of.lo), float(of.hi))
    certainty = "not certified for a gain that varies" if guard is None else guard.sentence
    is_proven = guard is not None and guard.is_proven
    remedy = f"on this arm the gain is {certainty}; --anyway exports it"
    require(is_proven or task.anyway, "tuned", str(task.tuned), remedy)
    facts = {
        "arm": case.arm.name,
        "tuner": f"trained on {saved.arm}",
        **({} if is_proven else {"warning": ANYWAY}),
        "sampling period": f"{period!r} s",
        "moment gain": certainty,
        "network": f"{of.scales.size}-{of.w2.size}-1, {task.precision}",
        "SHA-256 of the tuner": hashlib.sha256(task.tuned.read_bytes()).hexdigest(),
        "SHA-256 of the inputs": task.sha256,
        "tfarm": version("tfarm"),
    }
    name = name_in_c(task.name or "tuner")
    (own,) = name.values()
    return task.export_of(tuner_files(task, tuner, own, facts), names_of(name), certainty)


def tuner_files(task: ExportTask, tuner: ExportedTuner, name: str, facts: dict[str, str]) -> dict[str, bytes]:
    """Return the files by name; constants have the names of `TunerConstants`."""
    of = tuner.numbers
    real, suffix, _ = REAL[task.precision]
    kept: dict[str, Any] = of._asdict()
    ports = [
        Port(key, f"{meaning} [{unit or task.case.arm.input_unit}]", 1.0 if "rad" in unit else tuner.scale)
        for key, (_, meaning, unit) in tuner.inputs.items()
    ]
    values = {
        "name": name,
        "facts": list(facts.items()),
        "fixed": False,
        "real": real,
        "suffix": suffix,
        "header": "tuner.h",
        "bounds": (),
        "statuses": numbers_of(Status.INPUT_ERROR, Status.OVERFLOW),
        "fields": ports,
        "output": f"{task.case.arm.input} [{task.case.arm.input_unit}]",
        "of": of,
        "scalars": {key: literal(float(x), suffix) for key, x in kept.items() if isinstance(x, np.floating)},
        "tables": {
            key: [literal(x, suffix) for x in each.ravel().tolist()]
            for key, each in kept.items()
            if isinstance(each, np.ndarray)
        },
        **self_test_values(tuner.run, ports, task.precision),
    }
    return {file: render_source(file, **values) for file in ("tuner.h", "tuner.c", "self_test.c")}
