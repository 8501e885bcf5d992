"""The compiled heart of the simulation: exact steps of the modal amplitudes between the samples, and the linear law.

All compiled functions stand in this one file, for numba's cache does not notice an edited callee elsewhere.  Arrays:

    amplitude (m,) complex      one a pole with Im p > 0 or real, a' = p a + u
    rigid (2,)                  double integral and integral of the torque
    turn, push (segments, m)    e^{p dt}, (e^{p dt} - 1)/p of each piece of a sample between two switches or records
    piece (segments, 3)         its duration, 1 where the new torque acts already, 1 where it ends at a record
    weights (outputs, m)        outputs = Re(weights amplitude) + rates (outputs, 2) rigid + static (outputs,) torque
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tfarm.exact.compiled import compiled, inlined

ENCODER, AMPLIFIER, DAC = 0, 1, 2  # rows of the quantisers, and places in `saturated`


@compiled
def read_outputs(weights: Any, rates: Any, static: Any, amplitude: Any, rigid: Any, torque: float, out: Any) -> None:
    """The outputs under the torque that acts now."""
    for o in range(weights.shape[0]):
        value = rates[o, 0] * rigid[0] + rates[o, 1] * rigid[1] + static[o] * torque
        for i in range(amplitude.size):
            value += weights[o, i].real * amplitude[i].real - weights[o, i].imag * amplitude[i].imag
        out[o] = value


@compiled
def strike(amplitude: Any, rigid: Any, impulse: float) -> None:
    """An impulse of torque [N m s] on the hub: every amplitude jumps by it."""
    for i in range(amplitude.size):
        amplitude[i] += impulse
    rigid[1] += impulse


@compiled
def advance(
    tables: Any, amplitude: Any, rigid: Any, old: float, new: float, push_on: float, fine: Any, work: Any
) -> None:
    """One sample on: `old` torque up to the switch, `new` after it, `push_on` (a disturbance) throughout.

    Fills a row of `fine` at each record; adds the work done on the hub [J] to work[0] and its size to work[1].
    """
    turn, push, piece, weights, rates, static, hub = tables
    row = 0
    before = _angle(hub, amplitude, rigid)
    for s in range(piece.shape[0]):
        torque = (new if piece[s, 1] > 0.5 else old) + push_on
        dt = piece[s, 0]
        for i in range(amplitude.size):
            amplitude[i] = turn[s, i] * amplitude[i] + push[s, i] * torque
        rigid[0] += dt * rigid[1] + 0.5 * dt * dt * torque
        rigid[1] += dt * torque
        after = _angle(hub, amplitude, rigid)
        done = torque * (after - before)
        work[0] += done
        work[1] += abs(done)
        before = after
        if piece[s, 2] > 0.5 and row < fine.shape[0]:
            read_outputs(weights, rates, static, amplitude, rigid, torque, fine[row])
            row += 1


@compiled
def _angle(hub: Any, amplitude: Any, rigid: Any) -> float:
    """The hub angle of the modes at hand, without the static remainder."""
    value = hub[0].real * rigid[0] + hub[1].real * rigid[1]
    for i in range(amplitude.size):
        value += hub[i + 2].real * amplitude[i].real - hub[i + 2].imag * amplitude[i].imag
    return value


@compiled
def quantise(value: float, row: Any, saturated: Any, which: int) -> float:
    """`value` on the steps of a converter, clipped to its range; says so in `saturated` (3,) where it is clipped."""
    step, low, high = row[0], row[1], row[2]
    if step > 0.0:
        value = np.rint(value / step) * step
    if value > high:
        saturated[which] = True
        return high
    if value < low:
        saturated[which] = True
        return low
    return value


@compiled
def estimate(angle: float, rate: float, memory: Any, filter_: Any) -> float:
    """The hub rate as the controller knows it: its own reading, or the filtered difference of the encoder."""
    if filter_[0] < 0.5:
        return rate
    if memory[2] < 0.5:
        memory[0], memory[2] = angle, 1.0
    a = filter_[1]
    memory[1] = a * memory[1] + (1.0 - a) * (angle - memory[0]) / filter_[2]
    memory[0] = angle
    return memory[1]


@compiled
def converted(record: Any, rows: Any, saturated: Any, memory: Any, filter_: Any) -> Any:
    """Hub angle, hub rate and root moment as the controller has them, of the outputs of one sample."""
    angle = quantise(record[0], rows[ENCODER], saturated, ENCODER)
    moment = quantise(record[2], rows[AMPLIFIER], saturated, AMPLIFIER)
    return angle, estimate(angle, record[1], memory, filter_), moment


@compiled
def signal(kind: int, own: float, angle: float, rate: float, moment: float) -> float:
    """What a law reads of an output: itself (0), or what encoder (1), amplifier (2) or estimate (3) make of it."""
    if kind == 1:
        return angle
    if kind == 2:
        return moment
    return rate if kind == 3 else own


@inlined
def law(k: int, gains: Any, ideal: Any, references: Any, measured: Any, single: bool) -> float:
    """u = r + gains . (references - measured) at sample k, r the `ideal`; float64, or every step rounded to float32."""
    if single:
        rounded = np.float32(ideal[k])
        for j in range(measured.size):
            off = np.float32(references[k, j]) - np.float32(measured[j])
            rounded = np.float32(rounded + np.float32(gains[k, j]) * off)
        return float(rounded)
    u = ideal[k]
    for j in range(measured.size):
        u += gains[k, j] * (references[k, j] - measured[j])
    return u


@compiled
def run_gains(
    tables: Any, amplitude: Any, rigid: Any, held: Any, delay: int, gains: Any, references: Any, ideal: Any,
    disturbance: Any, impulse: float, rows: Any, filter_: Any, single: bool, bound: float, record: Any, torque: Any,
    fine: Any, saturated: Any, work: Any,
) -> int:  # fmt: skip
    """The linear law over all samples; returns how many were made before the root moment passed `bound`.

    `gains` and `references` (n, measured) are of the first outputs, which are measured: hub angle, hub rate and root
    moment through filters and converters, any more as they are.  The hub is struck by `impulse` [N m s] after the
    first sample.  `held` is a ring of the last delay + 2 torques.  `record` (n, outputs), `torque` (n,), `fine`
    (n, records, outputs) and `saturated` (n, 3) are filled.
    """
    weights, rates, static = tables[3], tables[4], tables[5]
    n, ring, memory, measured = torque.size, held.size, np.zeros(3), np.zeros(gains.shape[1])
    for k in range(n):
        acting = held[(k - delay - 1) % ring]
        extra = disturbance[k - 1] if k > 0 else 0.0
        read_outputs(weights, rates, static, amplitude, rigid, acting + extra, record[k])
        if not abs(record[k, 2]) <= bound:
            return k
        clipped = saturated[k]
        measured[0], measured[1], measured[2] = converted(record[k], rows, clipped, memory, filter_)
        for j in range(3, measured.size):
            measured[j] = record[k, j]
        u = quantise(law(k, gains, ideal, references, measured, single), rows[DAC], clipped, DAC)
        held[k % ring] = torque[k] = u
        if k == 0:
            strike(amplitude, rigid, impulse)
        advance(tables, amplitude, rigid, acting, held[(k - delay) % ring], disturbance[k], fine[k], work)
    return n


@compiled
def product(row: Any, values: Any, start: float, single: bool) -> float:
    """start + row . values, in float64, or every product and sum rounded to float32."""
    total = start
    for j in range(values.size):
        term = row[j] * values[j]
        if single:
            term = float(np.float32(term))
        total += term
        if single:
            total = float(np.float32(total))
    return total


@compiled
def run_law(
    tables: Any, amplitude: Any, rigid: Any, held: Any, delay: int, matrices: Any, kinds: Any, references: Any,
    ideal: Any, disturbance: Any, impulse: float, rows: Any, filter_: Any, single: bool, bound: float, record: Any,
    torque: Any, fine: Any, saturated: Any, work: Any,
) -> int:  # fmt: skip
    """As `run_gains`, under x_{k+1} = A x + B y, u = r - C x - D y, whose signals are the last outputs.

    `kinds` (signals,) says through what each goes: 0 nothing, 1 the encoder, 2 the strain amplifier, 3 the rate
    estimate; `references` (n, columns) is taken off, and is all there is of columns beyond the signals (y = 0 there).
    """
    weights, rates, static = tables[3], tables[4], tables[5]
    A, B, C, D = matrices
    n, ring, memory, first = torque.size, held.size, np.zeros(3), record.shape[1] - kinds.size
    x, after, y = np.zeros(A.shape[0]), np.zeros(A.shape[0]), np.zeros(B.shape[1])
    for k in range(n):
        acting = held[(k - delay - 1) % ring]
        extra = disturbance[k - 1] if k > 0 else 0.0
        read_outputs(weights, rates, static, amplitude, rigid, acting + extra, record[k])
        if not abs(record[k, 2]) <= bound:
            return k
        clipped = saturated[k]
        angle, rate, moment = converted(record[k], rows, clipped, memory, filter_)
        for j in range(y.size):
            value = signal(kinds[j], record[k, first + j], angle, rate, moment) if j < kinds.size else 0.0
            y[j] = value - references[k, j]
            if single:
                y[j] = float(np.float32(float(np.float32(value)) - float(np.float32(references[k, j]))))
        u = ideal[k] - product(D[0], y, product(C[0], x, 0.0, single), single)
        if single:
            u = float(np.float32(u))
        for i in range(x.size):
            after[i] = product(B[i], y, product(A[i], x, 0.0, single), single)
        x[:] = after
        u = quantise(u, rows[DAC], clipped, DAC)
        held[k % ring] = torque[k] = u
        if k == 0:
            strike(amplitude, rigid, impulse)
        advance(tables, amplitude, rigid, acting, held[(k - delay) % ring], disturbance[k], fine[k], work)
    return n
