"""The arithmetic of an exported controller, number by number as its C code and the simulation have it.

All compiled functions of the exported controller are here.  A step refuses inputs that are not finite, and results that
are not: it holds the output and keeps the states.
"""

from typing import Any

import numpy as np

from tfarm.dsp.kernel import DAC, estimate, product, quantise, rounded
from tfarm.exact.compiled import compiled, inlined

INPUT_ERROR, OVERFLOW = 1, 2  # what a step returns, 0 for a sample without an error
MINUEND, SUBTRAHEND = 0, 1  # columns of a plan
LARGEST = 2147483647  # of 32 bits


@compiled
def run_real(table: Any, plan: Any, inputs: Any, dac: Any, hub: Any, single: bool, outputs: Any, status: Any) -> None:
    """Fill outputs and status (n,) of inputs (n, k), the last of which is the feedforward; refused ones are left as 0.

    `table` is [A B; C D]; `plan` (columns, 2) has the two numbers whose difference is e of a column, by their places
    among the inputs, an estimated hub rate and 0; `dac` is a row of the quantisers; `hub` index of the hub angle (-1:
    no estimate), pole and period of the estimated rate.
    """
    n, forward = table.shape[0] - 1, inputs.shape[1] - 1
    known, z, following = np.zeros(forward + 3), np.zeros(table.shape[1]), np.zeros(n + 1)
    memory, clipped = np.zeros(3), np.zeros(3, np.bool_)
    for k in range(inputs.shape[0]):
        known[: forward + 1], before = inputs[k], memory.copy()
        status[k] = INPUT_ERROR
        if np.isfinite(inputs[k]).all():
            if hub[0] >= 0.0:
                known[-2] = rounded(estimate(known[int(hub[0])], 0.0, memory, True, hub[1], hub[2]), single)
            for j in range(plan.shape[0]):
                z[n + j] = rounded(known[plan[j, MINUEND]] - known[plan[j, SUBTRAHEND]], single)
            for i in range(n + 1):
                following[i] = product(table[i], z, known[forward] if i == n else 0.0, single)
            status[k] = 0 if np.isfinite(following).all() else OVERFLOW
            if status[k] == 0:
                z[:n] = following[:n]
                outputs[k] = rounded(quantise(following[n], dac, clipped, DAC), single)
            else:
                memory[:] = before


@inlined
def shifted(value: int, shift: int) -> int:
    """value/2^shift, to the nearest whole number, halves upwards."""
    return (value + (1 << (shift - 1))) >> shift


@compiled
def run_fixed(table: Any, shifts: Any, plan: Any, inputs: Any, dac: Any, outputs: Any) -> None:
    """The same in fixed point; `dac` is the shift of the step of the DAC, 0 for none, lowest and highest output."""
    n, forward = table.shape[0] - 1, inputs.shape[1] - 1
    known, z = np.zeros(forward + 3, np.int64), np.zeros(table.shape[1], np.int64)
    following = np.zeros(n + 1, np.int64)
    for k in range(inputs.shape[0]):
        known[: forward + 1] = inputs[k]
        for j in range(plan.shape[0]):
            z[n + j] = known[plan[j, MINUEND]] - known[plan[j, SUBTRAHEND]]
        for i in range(n + 1):
            total = known[forward] << shifts[n] if i == n else 0
            for j in range(z.size):
                total += table[i, j] * z[j]
            following[i] = shifted(total, shifts[i])
        for i in range(n):
            z[i] = min(max(following[i], -LARGEST - 1), LARGEST)
        u = shifted(following[n], dac[0]) << dac[0] if dac[0] > 0 else following[n]
        outputs[k] = min(max(u, dac[1]), dac[2])
