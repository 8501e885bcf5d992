"""The arithmetic of an exported controller, number by number as its C code and the simulation have it.

All compiled functions of the exported controller are here.  A step refuses inputs that are not finite, and results that
are not: it holds the output and keeps the states.
"""

from typing import Any

import numpy as np

from tfarm.dsp.kernel import DAC, estimate, product, quantise, rounded
from tfarm.exact.compiled import compiled, inlined

INPUT_ERROR, OVERFLOW = 1, 2  # what a step returns, 0 for a sample without an error
NO_SIGNAL, ESTIMATE = -1, -2  # sources of a column
SOURCE, REFERENCE, SIGN = 0, 1, 2  # columns of a plan
LARGEST = 2147483647  # of 32 bits


@inlined
def pushed(line: Any, u: Any) -> Any:
    """The output of a delay line, a sample for each entry; the line is moved by one."""
    if line.size == 0:
        return u
    out = line[0]
    line[:-1] = line[1:]
    line[-1] = u
    return out


@compiled
def run_real(
    tables: Any, plan: Any, inputs: Any, dac: Any, hub: Any, line: Any, single: bool, outputs: Any, status: Any
) -> None:
    """Fill outputs and status (n,) of inputs (n, k), the last of which is the feedforward.

    `plan` (columns, 3): index of signal and reference of each column, and the sign of the reference; `dac` a row of the
    quantisers; `hub` index of the hub angle (-1: no estimate), pole and period of the estimated rate.
    """
    A, B, C, D = tables
    x, following, e, held = np.zeros(A.shape[0]), np.zeros(A.shape[0]), np.zeros(B.shape[1]), 0.0
    memory, clipped, rate = np.zeros(3), np.zeros(3, np.bool_), 0.0
    for k in range(inputs.shape[0]):
        row, before = inputs[k], memory.copy()
        status[k] = INPUT_ERROR
        if np.isfinite(row).all():
            if hub[0] >= 0.0:
                rate = estimate(row[int(hub[0])], 0.0, memory, True, hub[1], hub[2])
            for j in range(e.size):
                source, reference = plan[j, SOURCE], plan[j, REFERENCE]
                value = 0.0 if source == NO_SIGNAL else rounded(rate, single) if source == ESTIMATE else row[source]
                e[j] = rounded((0.0 if reference < 0 else plan[j, SIGN] * row[reference]) - value, single)
            u = product(D[0], e, product(C[0], x, row[-1], single), single)
            for i in range(x.size):
                following[i] = product(B[i], e, product(A[i], x, 0.0, single), single)
            status[k] = 0 if np.isfinite(u) and np.isfinite(following).all() else OVERFLOW
            if status[k] == 0:
                x[:] = following
                held = pushed(line, rounded(quantise(u, dac, clipped, DAC), single))
            else:
                memory[:] = before
        outputs[k] = held


@inlined
def shifted(value: int, shift: int) -> int:
    """value/2^shift, to the nearest whole number, halves upwards."""
    return (value + (1 << (shift - 1))) >> shift


@inlined
def whole_product(row: Any, values: Any, start: int) -> int:
    """start + row . values, exactly."""
    for j in range(values.size):
        start += row[j] * values[j]
    return start


@compiled
def run_fixed(tables: Any, shifts: Any, plan: Any, inputs: Any, dac: Any, line: Any, outputs: Any) -> None:
    """The same in fixed point; `dac` is the shift of the step of the DAC, 0 for none, lowest and highest output."""
    A, B, C, D = tables
    n = A.shape[0]
    x, following, e = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(B.shape[1], np.int64)
    for k in range(inputs.shape[0]):
        row = inputs[k]
        for j in range(e.size):
            source, reference = plan[j, SOURCE], plan[j, REFERENCE]
            e[j] = (0 if reference < 0 else plan[j, SIGN] * row[reference]) - (0 if source < 0 else row[source])
        u = shifted(whole_product(D[0], e, whole_product(C[0], x, row[-1] << shifts[n])), shifts[n])
        for i in range(n):
            total = shifted(whole_product(B[i], e, whole_product(A[i], x, 0)), shifts[i])
            following[i] = min(max(total, -LARGEST - 1), LARGEST)
        x[:] = following
        u = shifted(u, dac[0]) << dac[0] if dac[0] > 0 else u
        outputs[k] = pushed(line, min(max(u, dac[1]), dac[2]))
