"""The compiled heart of the simulation: exact steps of the modal amplitudes between the samples, and the linear law.

All compiled functions are in this one file, for numba's cache does not notice an edited callee elsewhere.  They share
named tuples: a `SampleModel` of the arm, its `State`, the `Forcing` of a scenario and the `Electronics` of a chain.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm.chain import Sampling
from tfarm.arm.stages import Consumer
from tfarm.arrays import Complex, Real, Whole
from tfarm.dsp.plant import Plant
from tfarm.dsp.pulse import held_amplitude
from tfarm.exact.compiled import compiled, inlined

CONSUMER = Consumer(
    "simulate",
    acts=(
        "reference",
        "shaper",
        "anti-alias filter",
        "encoder",
        "hub rate",
        "amplifier steps",
        "amplifier range",
        "law",
        "arithmetic",
        "DAC steps",
        "DAC range",
        "torque limit",
        "hold",
        "delay",
        "hub damping",
        "plant",
        "volts",
    ),
)

# row of the root moment among the outputs, which begin with `tfarm.arm.FED_BACK`
MOMENT = 2
# rows of the quantisers, and places in `saturated`
ENCODER = 0
AMPLIFIER = 1
DAC = 2


class Integral(IntEnum):
    """Integrals of the torque in `rigid`, and the columns of their weights in `rates`."""

    DOUBLE = 0
    SINGLE = 1


class SampleModel(NamedTuple):
    """The arm between the samples: outputs = Re(weights amplitude) + rates rigid + static torque.

    Under a held torque an amplitude circles its rest position, -`rest` torque, `rest` (m,) being 1/p.

    `turn`, `push` (pieces, m) are e^{p dt} and (e^{p dt} - 1)/p of each piece of a sample between two switches or
    records, `piece` (pieces, 3) its properties; `weights` (outputs, m), `rates` (outputs, 2), `static` (outputs,);
    `hub` is the row of the hub angle.
    """

    rest: Complex
    turn: Complex
    push: Complex
    piece: Real
    weights: Complex
    rates: Real
    static: Real
    hub: int


def model_of(plant: Plant, kept: Whole, sampling: Sampling, between: int, hub: int) -> SampleModel:
    """Return the model of a plant's poles `kept` with `between` records in each sample.

    `hub` is the row of the hub angle.
    """
    p = plant.poles[kept]
    T = sampling.period
    f = sampling.fraction
    records = T * (np.arange(between) + 1) / (between + 1)
    ends = np.unique(np.r_[records, [f * T] if f else [], T])
    starts = np.r_[0.0, ends[:-1]]
    return SampleModel(
        rest=1 / p,
        turn=np.exp(p * (ends - starts)[:, None]),
        push=np.array([held_amplitude(p, float(each)) for each in ends - starts]),
        piece=np.c_[ends - starts, starts >= f * T, np.isin(ends, records)].astype(float),
        weights=np.ascontiguousarray(plant.residues[:, kept] * np.where(p.imag > 0, 2.0, 1.0)),
        # in one layout: the compiled loop is compiled anew for each
        rates=np.array(plant.rigid),
        static=np.array(plant.static),
        hub=hub,
    )


class State(NamedTuple):
    """State and record of a simulation.

    `amplitude` (m,) one a pole with Im p > 0 or real, a' = p a + u; `rigid` (2,) double integral and integral of the
    torque; `held` a ring of the last delay + 2 torques; `work` (2,) [J]; `circle` (m,) the square of the largest circle
    of each amplitude.  Filled sample by sample: `record` (n, outputs), `torque` (n,), `fine` (n, records, outputs) and
    `saturated` (n, 3).
    """

    amplitude: Complex
    rigid: Real
    held: Real
    work: Real
    circle: Real
    record: Real
    torque: Real
    fine: Real
    saturated: NDArray[np.bool_]


def rest(model: SampleModel, count: int, delay: int) -> State:
    """Return the state at rest, with room for a number of samples, under a delay of whole samples."""
    outputs, poles = model.weights.shape
    records = int(model.piece[:, -1].sum())
    return State(
        amplitude=np.zeros(poles, complex),
        rigid=np.zeros(2),
        held=np.zeros(delay + 2),
        work=np.zeros(2),
        circle=np.zeros(poles),
        record=np.zeros((count, outputs)),
        torque=np.zeros(count),
        fine=np.zeros((count, records, outputs)),
        saturated=np.zeros((count, 3), np.bool_),
    )


class Forcing(NamedTuple):
    """Torque fed forward and disturbance torque [N m] at each sample (n,), and an impulse [N m s] after the first."""

    feedforward: Real
    disturbance: Real
    impulse: float


class Electronics(NamedTuple):
    """A chain for the kernels.

    `quantisers` (3, 3): step, lowest and highest of encoder, amplifier and DAC; `is_differenced`, `pole` and `period`
    [s] of the hub rate's estimate; `delay` whole samples; `is_single` where every step is rounded to float32; `bound`
    [N m] of the root moment, beyond which a simulation stops.
    """

    quantisers: Real
    is_differenced: bool
    pole: float
    period: float
    delay: int
    is_single: bool
    bound: float


@inlined
def dynamic_output(o: int, model: Any, state: Any) -> float:
    """Return output o without its static remainder."""
    double = model.rates[o, Integral.DOUBLE] * state.rigid[Integral.DOUBLE]
    single = model.rates[o, Integral.SINGLE] * state.rigid[Integral.SINGLE]
    value = double + single
    for i in range(state.amplitude.size):
        weight = model.weights[o, i]
        amplitude = state.amplitude[i]
        value += weight.real * amplitude.real - weight.imag * amplitude.imag
    return value


@compiled
def read_outputs(model: Any, state: Any, torque: float, out: Any) -> None:
    """Read the outputs under the torque that acts now into `out`."""
    for o in range(out.size):
        out[o] = dynamic_output(o, model, state) + model.static[o] * torque


@compiled
def advance_state(k: int, model: Any, state: Any, old: float, new: float, push_on: float) -> None:
    """Advance by sample k: `old` torque up to the switch, `new` after it, `push_on` (a disturbance) throughout.

    Fills a row of `fine` at each record, and adds to the work.
    """
    # of a piece of a sample: its length [s], whether the new torque acts, a record
    duration = 0
    is_new = 1
    is_record = 2
    # of `work` [J]: done on the hub, and the sum of its absolute values
    net = 0
    moved = 1
    row = 0
    before = dynamic_output(model.hub, model, state)
    for s in range(model.piece.shape[0]):
        torque = (new if model.piece[s, is_new] != 0.0 else old) + push_on
        dt = model.piece[s, duration]
        for i in range(state.amplitude.size):
            about = state.amplitude[i] + model.rest[i] * torque
            state.circle[i] = max(state.circle[i], about.real * about.real + about.imag * about.imag)
            state.amplitude[i] = model.turn[s, i] * state.amplitude[i] + model.push[s, i] * torque
        state.rigid[Integral.DOUBLE] += dt * state.rigid[Integral.SINGLE] + 0.5 * dt * dt * torque
        state.rigid[Integral.SINGLE] += dt * torque
        after = dynamic_output(model.hub, model, state)
        done = torque * (after - before)
        state.work[net] += done
        state.work[moved] += abs(done)
        before = after
        if model.piece[s, is_record] != 0.0 and row < state.fine.shape[1]:
            read_outputs(model, state, torque, state.fine[k, row])
            row += 1


@compiled
def quantise(value: float, row: Any, saturated: Any, which: int) -> float:
    """Return a value on the steps of a converter, clipped to its range; mark a clipped one in `saturated` (3,)."""
    # of a row of the quantisers
    step = 0
    lowest = 1
    highest = 2
    if row[step] > 0.0:
        value = np.rint(value / row[step]) * row[step]
    saturated[which] = value > row[highest] or value < row[lowest]
    return min(max(value, row[lowest]), row[highest])


@compiled
def estimate(
    angle: float, rate: float, memory: Any, is_differenced: bool, pole: float, period: float
) -> float:
    """Return the hub rate of the controller: a reading of its own, or the filtered difference of the encoder."""
    # memory of the estimate of the hub rate
    angle_before = 0
    rate_before = 1
    begun = 2
    if not is_differenced:
        return rate
    if memory[begun] == 0.0:
        memory[angle_before] = angle
        memory[begun] = 1.0
    step = angle - memory[angle_before]
    memory[rate_before] = pole * memory[rate_before] + (1.0 - pole) * step / period
    memory[angle_before] = angle
    return memory[rate_before]


def convert_outputs(record: Any, saturated: Any, memory: Any, of: Any) -> Any:
    """Return hub angle, hub rate and root moment of one sample's outputs, through the converters of `Electronics`."""
    # rows of the outputs
    angle_row = 0
    rate_row = 1
    angle = quantise(record[angle_row], of.quantisers[ENCODER], saturated, ENCODER)
    moment = quantise(record[MOMENT], of.quantisers[AMPLIFIER], saturated, AMPLIFIER)
    rate = estimate(angle, record[rate_row], memory, of.is_differenced, of.pole, of.period)
    return angle, rate, moment


def read_before(k: int, model: Any, state: Any, forcing: Any, of: Any) -> bool:
    """Read the outputs just before sample k; return whether the root moment is within its bound."""
    torque = state.held[(k - of.delay - 1) % state.held.size] + (forcing.disturbance[k - 1] if k > 0 else 0.0)
    read_outputs(model, state, torque, state.record[k])
    return abs(state.record[k, MOMENT]) <= of.bound


def advance_after(k: int, u: float, model: Any, state: Any, forcing: Any, of: Any) -> None:
    """Pass the torque u at sample k through the DAC, where it is held and acts a delay later; advance by one sample."""
    ring = state.held.size
    old = state.held[(k - of.delay - 1) % ring]
    state.held[k % ring] = state.torque[k] = quantise(u, of.quantisers[DAC], state.saturated[k], DAC)
    # the impulse: every amplitude jumps by it
    if k == 0:
        for i in range(state.amplitude.size):
            state.amplitude[i] += forcing.impulse
        state.rigid[Integral.SINGLE] += forcing.impulse
    advance_state(k, model, state, old, state.held[(k - of.delay) % ring], forcing.disturbance[k])


# those of Python loops are plain
_read_before = inlined(read_before)
_convert_outputs = inlined(convert_outputs)
_advance_after = inlined(advance_after)


@inlined
def to_precision(value: float, single: bool) -> float:
    """Return a number in the precision of the controller: float32 or float64."""
    return float(np.float32(value)) if single else value


@inlined
def add_row_product(row: Any, values: Any, start: float, single: bool) -> float:
    """Return start + row . values, every product and sum in the precision of the controller."""
    total = start
    for j in range(values.size):
        total = to_precision(total + to_precision(row[j] * values[j], single), single)
    return total


@inlined
def law_step(table: Any, z: Any, feedforward: float, single: bool, out: Any) -> None:
    """Set out = table z of z = [x; e]: the next states, and the output, which begins with the feedforward."""
    for i in range(out.size):
        out[i] = add_row_product(table[i], z, feedforward if i == out.size - 1 else 0.0, single)


@compiled
def law_outputs(table: Any, errors: Any) -> Any:
    """Return the outputs (n,) of a law [x_{k+1}; u] = table [x; e] from rest, of errors (n, columns)."""
    order = table.shape[0] - 1
    z = np.zeros(table.shape[1])
    following = np.zeros(order + 1)
    found = np.zeros(errors.shape[0])
    for k in range(found.size):
        z[order:] = errors[k]
        law_step(table, z, 0.0, False, following)
        z[:order] = following[:order]
        found[k] = following[order]
    return found


@inlined
def calculate_back(following: Any, back: Any, single: bool) -> None:
    """Add w (u within its limits - u) to the next states, u being last; `back` is [lowest, highest, w]."""
    u = following[following.size - 1]
    excess = to_precision(min(max(u, back[0]), back[1]) - u, single)
    if excess != 0.0:
        for i in range(back.size - 2):
            following[i] = to_precision(following[i] + to_precision(back[i + 2] * excess, single), single)


@compiled
def run_samples(
    model: Any,
    state: Any,
    forcing: Any,
    electronics: Any,
    table: Any,
    back: Any,
    sources: Any,
    references: Any,
) -> int:
    """Run a law over all samples; return their number before the root moment passes its bound.

    [x_{k+1}; u - r] = table [x; e] of the errors e = reference - signal, `references` (n, columns); `back` is that of
    `back_calculation`.  `sources`
    (columns,) are the outputs of the columns, hub angle, hub rate and root moment through their converters, or -1 for a
    reference alone.
    """
    single = electronics.is_single
    order = table.shape[0] - 1
    memory = np.zeros(3)
    known = np.zeros(3)
    z = np.zeros(table.shape[1])
    following = np.zeros(order + 1)
    for k in range(state.torque.size):
        if not _read_before(k, model, state, forcing, electronics):
            return k
        record = state.record[k]
        known[0], known[1], known[MOMENT] = _convert_outputs(record, state.saturated[k], memory, electronics)
        for j in range(sources.size):
            source = sources[j]
            if source < 0:
                value = 0.0
            elif source < known.size:
                value = known[source]
            else:
                value = record[source]
            z[order + j] = to_precision(
                to_precision(references[k, j], single) - to_precision(value, single), single
            )
        law_step(table, z, to_precision(forcing.feedforward[k], single), single, following)
        calculate_back(following, back, single)
        for i in range(order):
            z[i] = following[i]
        _advance_after(k, following[order], model, state, forcing, electronics)
    return state.torque.size
