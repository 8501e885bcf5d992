"""A realised law in the word length of a target: rounded coefficients, bounds on states, errors and limit cycles.

In fixed point (Q31) a signal of range R is a whole number of steps R/2^31, a state one of its bound; each row of
coefficients has one shift f, so that the sum of all products is below 2^63 and is rounded once:

    x_i = (sum_j a_ij x_j + sum_j b_ij e_j + 2^(f-1)) >> f

Bounds are sums of absolute values of responses over all samples, the l1 norm (Dahleh and Diaz-Bobillo, Control of
Uncertain Systems, 1995).  Where the law itself is not stable, as with an integral, they are over `MOST_SUMMED` samples.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tfarm.arm import Law
from tfarm.arm.blocks import Matrices
from tfarm.arm.law import REFERENCE
from tfarm.arrays import Real
from tfarm.dsp.sampled import Sampled
from tfarm.errors import ParameterError, require
from tfarm.exported.realisation import around, with_matrices

MOST_SUMMED, BLOCK = 20_000, 32  # samples of a sum without a bound on all others, and of one step
DECAYED = 1e-3  # row sum of |M^n| from which all later samples are bounded
ON_CIRCLE, UNSEEN = 1e-9, 1e-8  # of 1: modulus of a pole on the unit circle; share of one that no output shows
FRACTION_BITS, MOST_SHIFT = 31, 62  # of a number in fixed point, and of a sum of products
HEADROOM, LEAST_SCALE = 1 + 2.0**-10, 2.0**-100  # of the range of a state: for roundings, and the least of all
OF_OUTPUT = 4.0  # ranges of u that a state without a bound reaches before it saturates
REFINED = 8  # steps to the bound of the errors
FIXED, OUTPUT = "q31", "output"  # fixed point; the name of the controller's output among ranges
FLOATS: dict[str, tuple[Any, float]] = {"double": (np.float64, 2.0**-53), "float": (np.float32, 2.0**-24)}  # roundoff


def absolute_sum(M: Real, left: Real, right: Real) -> tuple[Real, bool]:
    """Bound on sum_k |left M^k right|, entry by entry, and whether it is over all samples.

    With G = sum_{k<n} |left M^k|, sum_k |left M^k| <= G (I - |M^n|)^-1 once the row sums of |M^n| are below 1.
    """
    power, rows = np.linalg.matrix_power(M, BLOCK), [left]
    for _ in range(BLOCK - 1):
        rows.append(rows[-1] @ M)
    block, G, S, n = np.array(rows), np.zeros(left.shape), np.zeros((len(left), right.shape[1])), 0
    with np.errstate(over="ignore", invalid="ignore"):
        while n < MOST_SUMMED:
            G, S, n = G + abs(block).sum(axis=0), S + abs(block @ right).sum(axis=0), n + BLOCK
            block = block @ power
            last = np.linalg.matrix_power(power, n // BLOCK) if (n // BLOCK) & (n // BLOCK - 1) == 0 else None
            if last is not None and abs(last).sum(axis=1).max(initial=0.0) <= DECAYED:
                whole = np.linalg.solve(np.eye(len(M)) - abs(last).T, G.T).T
                return S + whole @ abs(last @ right), True
    return np.nan_to_num(S, nan=np.inf), False


@dataclass(frozen=True)
class Word:
    """A realised law in z of one state space, in the numbers of a target.

    `sizes` bounds e of each column; in fixed point `ranges` are the scales of e, that of each state is 1, and `output`
    is that of u.  `tables` are A, B, C, D as exported, whole numbers in fixed point, and `shifts` those of each state
    and of u.
    """

    law: Law
    precision: str
    sizes: Real
    ranges: Real
    output: float
    tables: tuple[Any, Any, Any, Any]
    shifts: Any

    @cached_property
    def rounded(self) -> Law:
        """The law with the coefficients as exported, in SI units."""
        A, B, C, D = (np.asarray(each, dtype=float) for each in self.tables)
        if self.precision == FIXED:
            up, last = np.ldexp(1.0, -self.shifts[:-1])[:, None], math.ldexp(self.output, -int(self.shifts[-1]))
            A, B, C, D = A * up, B * up / self.ranges, C * last, D * last / self.ranges
        return with_matrices(self.law, (A, B, C, D))

    @cached_property
    def errors(self) -> tuple[float, Real]:
        """Relative and absolute rounding error of a sum: of each state, and of u last."""
        n, m = self.law.order, self.sizes.size
        if self.precision == FIXED:
            half = 2.0 ** -(FRACTION_BITS + 1)
            return 0.0, np.r_[np.full(n, half), half * self.output]
        kind, unit = FLOATS[self.precision]
        terms = n + m + 3
        return terms * unit / (1 - terms * unit), np.full(n + 1, terms * float(np.finfo(kind).smallest_subnormal))

    @cached_property
    def bounds(self) -> tuple[Real, bool, float]:
        """Bound on each state as exported, whether it is over all samples, and bound on the error of u.

        The error d of the states obeys d' = A d + w, w = |dA| X + |dB| E + roundings; X includes d.
        """
        (A, B, C, D), E, one = self.law.parts[0].block.matrices(), self.sizes, np.eye(self.law.order)
        rounded = self.rounded.parts[0].block.matrices()
        relative, absolute = self.errors
        vA, vB, vC, vD = (abs(r - e) + relative * abs(r) for r, e in zip(rounded, (A, B, C, D), strict=True))
        X, is_whole = absolute_sum(A, one, B)
        of_states, of_output = (absolute_sum(A, left, one)[0] for left in (one, C))
        largest = first = X @ E
        with np.errstate(over="ignore", invalid="ignore"):  # of a law that grows
            for _ in range(REFINED):  # to the least fixed point
                w = vA @ largest + vB @ E + absolute[:-1]
                largest = first + of_states @ w
            u = of_output @ w + vC @ largest + vD @ E + relative * self.output
        return largest, is_whole, float(u[0] + absolute[-1])

    def limit_cycle(self, loop: Sampled) -> float | None:
        """Bound on u in a limit cycle that roundings sustain in a loop at rest; None where none was found.

        A state and a signal z <= S (g Q z + a) + s b, with the responses S of the closed loop to a rounding and s to an
        error of a signal, the relative and absolute errors g and a of a sum, b of a signal in fixed point, and
        Q = |A B; C D|.  Where all eigenvalues of g S Q are below 1 that bounds z.
        """
        A, B, C, D = (abs(each) for each in self.rounded.parts[0].block.matrices())
        n, signals, read = len(A), self.law.signals, loop.in_z.signals
        if not set(signals) <= set(read):  # an estimated rate
            return None
        of, at = around(self.rounded, loop), [read.index(name) for name in signals]
        left = np.vstack([np.eye(len(of.matrix))[of.states], of.reads[at], of.output])
        right = np.c_[of.of_rounding, of.of_signals[:, at]]
        S, is_whole = absolute_sum(observed(of.matrix, left), left, right)
        if not is_whole:
            return None
        B, D = B[:, : len(at)], D[:, : len(at)]  # references are at rest
        S[-1, n:] += np.r_[1.0, D[0]]  # u itself
        (relative, absolute), Q = self.errors, np.block([[A, B], [C, D]])
        reading = 2.0 ** -(FRACTION_BITS + 1) * self.ranges[: len(at)] * (self.precision == FIXED)
        loops = relative * S[:-1, : n + 1] @ Q
        if max(abs(np.linalg.eigvals(loops)), default=0.0) >= 1:
            return None
        rest = S @ np.r_[absolute, reading]
        z = np.linalg.solve(np.eye(len(loops)) - loops, rest[:-1])
        return float(rest[-1] + relative * S[-1, : n + 1] @ Q @ z)


def observed(M: Real, left: Real) -> Real:
    """The matrix without poles on the unit circle that no row of `left` shows, such as z = 1 of a free hub angle."""
    poles, vectors = np.linalg.eig(M)
    seen = abs(left @ vectors).max(axis=0) / abs(left).max()
    gone = (abs(poles) >= 1 - ON_CIRCLE) & (seen <= UNSEEN)
    return M - np.real(vectors[:, gone] * poles[gone] @ np.linalg.pinv(vectors)[gone]) if gone.any() else M


def word_of(law: Law, precision: str, ranges: Mapping[str, float], output: float | None) -> Word:
    """A realised law in the numbers of a target, with the largest absolute values of its signals in SI units.

    Raises ParameterError, in fixed point for a signal or an output without a range, and for a coefficient that is
    beyond the numbers of the target.
    """
    columns = (*law.signals, *law.wanted)
    sizes, factors = [], []
    for name in columns:
        plain = name.removeprefix(REFERENCE)
        remedy = f"q31 needs the largest absolute value of this signal: --range {plain}=VALUE, in SI units"
        require(plain in ranges or precision != FIXED, "range", plain, remedy)
        sizes.append(ranges.get(plain, 1.0))
        factors.append(2.0 if name in law.references else 1.0)
    R, E = np.array(sizes), np.array(sizes) * factors
    if precision != FIXED:
        kind = FLOATS[precision][0]
        A, B, C, D = (_rounded(key, each, kind) for key, each in zip("ABCD", matrices_of(law), strict=True))
        return Word(law, precision, E, R, output or 1.0, (A, B, C, D), None)
    remedy = (
        "q31 needs the range of the output: a torque limit or a range of the DAC in the chain, or --range output=VALUE"
    )
    require(output is not None, "range", OUTPUT, remedy)
    U = float(output or 1.0)
    return _fixed(law, E, R, U)


def matrices_of(law: Law) -> Matrices:
    """A, B, C, D of a law of one state space: u = r + C x + D e."""
    return law.parts[0].block.matrices()


def _rounded(key: str, table: Real, kind: Any) -> Any:
    """A table in floating point.  Raises ParameterError for a coefficient that overflows, or underflows to 0."""
    with np.errstate(over="ignore"):
        found = table.astype(kind)
    for place in np.argwhere(~np.isfinite(found) | ((found == 0) & (table != 0))).tolist():
        _refuse(key, place, float(table[tuple(place)]), f"is beyond the numbers of {np.dtype(kind).name}")
    return found


def _refuse(key: str, place: Any, value: float, problem: str) -> None:
    """Raise ParameterError for one coefficient."""
    raise ParameterError(key=f"{key}[{', '.join(map(str, place))}]", value=value, remedy=f"this coefficient {problem}")


def _fixed(law: Law, E: Real, R: Real, U: float) -> Word:
    """A law in fixed point: the states scaled by powers of 2 beyond their bounds, or where there is none by u."""
    A, B, C, D = matrices_of(law)
    X, is_whole = absolute_sum(A, np.eye(len(A)), B)
    size = HEADROOM * (X @ E)
    if not is_whole:
        size = np.minimum(size, np.divide(OF_OUTPUT * U, abs(C[0]), out=np.full(len(A), np.inf), where=C[0] != 0))
    scale = np.exp2(np.ceil(np.log2(np.maximum(size, LEAST_SCALE))))
    scaled = with_matrices(law, (A * scale / scale[:, None], B / scale[:, None], C * scale, D))
    A, B, C, D = matrices_of(scaled)
    table = np.block([[A, B * R], [C / U, D * R / U]])
    sums = abs(table) @ np.r_[np.ones(len(A)), E / R] + np.r_[np.zeros(len(A)), 1.0]  # of u with the feedforward
    shifts = np.floor(np.log2((2.0**FRACTION_BITS - len(table) - 2) / np.maximum(sums, LEAST_SCALE))).astype(int)
    shifts = np.minimum(shifts, MOST_SHIFT)
    for row in np.flatnonzero(shifts < 1).tolist():
        column = int(np.argmax(abs(table[row])))
        name = ("A" if column < len(A) else "B") if row < len(A) else ("C" if column < len(A) else "D")
        at = [row % len(A) if row < len(A) else 0, column % max(1, len(A)) if column < len(A) else column - len(A)]
        _refuse(name, at, float(table[row, column]), "is beyond the numbers of q31 at these ranges")
    whole = np.rint(np.ldexp(table, shifts[:, None])).astype(np.int64)
    n = len(A)
    tables = whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]
    return Word(scaled, FIXED, E, R, U, tables, shifts)
