"""Steps of an exported controller over samples, operation by operation in the order of its C code."""

from enum import IntEnum
from typing import Any

import numpy as np

from tfarm.dsp.kernel import (
    DAC,
    add_row_product,
    calculate_back,
    estimate,
    law_step,
    quantise,
    to_precision,
)
from tfarm.exact.compiled import compiled, inlined


class Status(IntEnum):
    """What a step returns where it is not 0, by the names in C."""

    INPUT_ERROR = 1
    OVERFLOW = 2
    SATURATED = 3
    STATE_SATURATED = 4


def numbers_of(*statuses: Status) -> dict[str, int]:
    """Return the numbers of statuses by name, for a template."""
    return {each.name: each.value for each in statuses}


@compiled
def run_real(
    table: Any,
    plan: Any,
    inputs: Any,
    dac: Any,
    back: Any,
    hub: Any,
    lags: Any,
    sizes: Any,
    shaped: int,
    single: bool,
    outputs: Any,
    status: Any,
) -> None:
    """Fill outputs and status (n,) of inputs (n, k), the last of which is the feedforward; refused ones are left as 0.

    `table` is [A B; C D]; `plan` (columns, 2) has the two numbers whose difference is e of a column, by their places
    among the inputs, an estimated hub rate and 0; `dac` is a row of the quantisers; `back` is that of
    `tfarm.dsp.discretise.back_calculation`; `hub` index of the hub angle (-1: no estimate), pole and period of the
    estimated rate; `lags` and `sizes` the impulses that the last `shaped` inputs pass.
    """
    n = table.shape[0] - 1
    forward = inputs.shape[1] - 1
    known = np.zeros(forward + 3)
    z = np.zeros(table.shape[1])
    following = np.zeros(n + 1)
    memory = np.zeros(3)
    clipped = np.zeros(3, np.bool_)
    ring = np.zeros((shaped, lags.max() + 1 if lags.size else 1))
    place = 0
    for k in range(inputs.shape[0]):
        known[: forward + 1] = inputs[k]
        before = memory.copy()
        status[k] = Status.INPUT_ERROR
        if np.isfinite(inputs[k]).all():
            if hub[0] >= 0.0:
                rate = estimate(known[int(hub[0])], 0.0, memory, True, hub[1], hub[2])
                known[-2] = to_precision(rate, single)
            for i in range(shaped):
                ring[i, place] = known[forward - i]
                known[forward - i] = add_row_product(sizes, ring[i][place - lags], 0.0, single)
            for j in range(plan.shape[0]):
                e = known[plan[j, 0]] - known[plan[j, 1]]
                z[n + j] = to_precision(e, single)
            law_step(table, z, known[forward], single, following)
            calculate_back(following, back, single)
            if np.isfinite(following).all():
                z[:n] = following[:n]
                u = quantise(following[n], dac, clipped, DAC)
                outputs[k] = to_precision(u, single)
                status[k] = Status.SATURATED if clipped[DAC] else 0
                place = (place + 1) % ring.shape[1]
            else:
                memory[:] = before
                status[k] = Status.OVERFLOW


@inlined
def shift_right(value: int, shift: int) -> int:
    """Return value/2^shift, to the nearest whole number, halves upwards."""
    return (value + (1 << (shift - 1))) >> shift


@compiled
def run_fixed(
    table: Any,
    shifts: Any,
    plan: Any,
    inputs: Any,
    dac: Any,
    lags: Any,
    sizes: Any,
    shaped: int,
    shift: int,
    outputs: Any,
    status: Any,
) -> None:
    """Fill them in fixed point; `dac` is the shift of the step of the DAC, 0 for none, lowest and highest output.

    `shift` is that of the sizes of the impulses.
    """
    n = table.shape[0] - 1
    forward = inputs.shape[1] - 1
    known = np.zeros(forward + 3, np.int64)
    z = np.zeros(table.shape[1], np.int64)
    following = np.zeros(n + 1, np.int64)
    # of 32 bits
    largest = 2147483647
    ring = np.zeros((shaped, lags.max() + 1 if lags.size else 1), np.int64)
    for k in range(inputs.shape[0]):
        known[: forward + 1] = inputs[k]
        place = k % ring.shape[1]
        for i in range(shaped):
            ring[i, place] = known[forward - i]
            total = 0
            for j in range(lags.size):
                total += sizes[j] * ring[i, place - lags[j]]
            known[forward - i] = shift_right(total, shift)
        for j in range(plan.shape[0]):
            z[n + j] = known[plan[j, 0]] - known[plan[j, 1]]
        for i in range(n + 1):
            total = known[forward] << shifts[n] if i == n else 0
            for j in range(z.size):
                total += table[i, j] * z[j]
            following[i] = shift_right(total, shifts[i])
        u = shift_right(following[n], dac[0]) << dac[0] if dac[0] > 0 else following[n]
        outputs[k] = min(max(u, dac[1]), dac[2])
        status[k] = Status.SATURATED if outputs[k] != u else 0
        for i in range(n):
            z[i] = min(max(following[i], -largest - 1), largest)
            if z[i] != following[i]:
                status[k] = Status.STATE_SATURATED
