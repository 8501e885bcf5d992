"""The arithmetic of an exported controller, number by number in the order of its C code.

All compiled functions of the exported controller are here.  A step refuses inputs that are not finite, and results that
are not: it holds the output and keeps the states.
"""

from typing import Any

import numpy as np

from tfarm.exact.compiled import compiled, inlined

INPUT_ERROR, OVERFLOW = 1, 2  # what a step returns, 0 for a sample without an error
NO_SIGNAL, ESTIMATE = -1, -2  # sources of a column
SOURCE, REFERENCE, SIGN = 0, 1, 2  # columns of a plan
WHOLE = 6755399441055744.0  # 1.5 2^52: a double less than 2^51 in size plus this is rounded to a whole number
EXACT = 2251799813685248.0  # 2^51
LARGEST = 2147483647  # of 32 bits


@inlined
def rounded(value: float, single: bool) -> float:
    """A number in float32 or float64."""
    return float(np.float32(value)) if single else value


@inlined
def total(row: Any, values: Any, start: float, single: bool) -> float:
    """start + row . values, each product and sum rounded."""
    for j in range(values.size):
        start = rounded(start + rounded(row[j] * values[j], single), single)
    return start


@inlined
def converted(u: float, step: float, low: float, high: float) -> float:
    """u on the steps of the DAC and within its limits."""
    if step > 0.0:
        n = u / step
        if -EXACT < n < EXACT:
            n = (n + WHOLE) - WHOLE
        u = n * step
    return low if u < low else high if u > high else u


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

    `plan` (columns, 3): index of signal and reference of each column, and the sign of the reference; `dac` step, lowest
    and highest output; `hub` index of the hub angle, pole and period of the estimated rate.
    """
    A, B, C, D = tables
    x, following, e, held = np.zeros(A.shape[0]), np.zeros(A.shape[0]), np.zeros(B.shape[1]), 0.0
    before, rate, is_first, angle, new_rate = 0.0, 0.0, True, 0.0, 0.0
    for k in range(inputs.shape[0]):
        row = inputs[k]
        status[k] = 0 if np.isfinite(row).all() else INPUT_ERROR
        if status[k] == 0:
            if hub[0] >= 0.0:
                angle = row[int(hub[0])]
                step = angle - (angle if is_first else before)
                new_rate = hub[1] * rate + (1.0 - hub[1]) * step / hub[2]
            for j in range(e.size):
                source, reference = plan[j, SOURCE], plan[j, REFERENCE]
                value = 0.0 if source == NO_SIGNAL else rounded(new_rate, single) if source == ESTIMATE else row[source]
                wanted = 0.0 if reference < 0 else plan[j, SIGN] * row[reference]
                e[j] = rounded(wanted - value, single)
            u = total(D[0], e, total(C[0], x, row[-1], single), single)
            for i in range(x.size):
                following[i] = total(B[i], e, total(A[i], x, 0.0, single), single)
            if np.isfinite(u) and np.isfinite(following).all():
                x[:] = following
                before, rate, is_first = angle, new_rate, False
                held = pushed(line, rounded(converted(u, dac[0], dac[1], dac[2]), single))
            else:
                status[k] = OVERFLOW
        outputs[k] = held


@inlined
def clipped(value: int, low: int, high: int) -> int:
    """A whole number within limits."""
    return low if value < low else high if value > high else value


@inlined
def shifted(value: int, shift: int) -> int:
    """value/2^shift, to the nearest whole number, halves upwards."""
    return (value + (1 << (shift - 1))) >> shift


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
        u = row[-1] << shifts[n]
        for i in range(n):
            u += C[0, i] * x[i]
        for j in range(e.size):
            u += D[0, j] * e[j]
        for i in range(n):
            following[i] = 0
            for j in range(n):
                following[i] += A[i, j] * x[j]
            for j in range(e.size):
                following[i] += B[i, j] * e[j]
            following[i] = clipped(shifted(following[i], shifts[i]), -LARGEST - 1, LARGEST)
        x[:] = following
        u = shifted(u, shifts[n])
        if dac[0] > 0:
            u = shifted(u, dac[0]) << dac[0]
        outputs[k] = pushed(line, clipped(u, dac[1], dac[2]))
