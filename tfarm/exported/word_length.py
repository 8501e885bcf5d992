"""A realised law in the word length of a target: rounded coefficients, bounds on states, errors and limit cycles.

In fixed point (Q31) a signal of range R is a whole number of steps R/2^31, a state one of its bound; each row of
coefficients has one shift f, so that the sum of all products is below 2^63 and is rounded once:

    x_i = (sum_j a_ij x_j + sum_j b_ij e_j + 2^(f-1)) >> f

Bounds are sums of absolute values of responses over all samples, the l1 norm (Dahleh and Diaz-Bobillo, Control of
Uncertain Systems, 1995).  Where the law itself is not stable, as with an integral, they are over `MOST_SUMMED` samples.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from tfarm.arm import Law
from tfarm.arm.blocks import Matrices, StateSpace
from tfarm.arm.law import REFERENCE, Part
from tfarm.arrays import Real
from tfarm.dsp.discretise import with_estimate
from tfarm.dsp.sampled import Sampled
from tfarm.errors import ParameterError, require
from tfarm.schema import Quantity

MOST_DOUBLINGS = 40  # of the samples that a sum has: 1e12 of them
SUMMED = 1e-9  # of a sum of squares: its last terms
LEAST_SHARE = 1e-12  # of the largest singular value: below it a state is not controllable or not observable
WORST_CONDITION = 1e8  # of the eigenvectors: beyond it poles are not separated
NEXT_TO = 1.01  # times the least noise gain: for less a law keeps its states, and an integral its pole z = 1
GIVEN, SECTIONS, BALANCED = "law as given", "second-order sections", "balanced state space"


class NoiseGain(NamedTuple):
    """A realisation and its noise gain."""

    realisation: Annotated[str, Quantity("realisation", help="structure of the states of the controller")]
    gain: Annotated[float | None, Quantity("noise gain", "", 5,
            help="variance of the output by roundings, for states of unit variance, in the closed loop")]  # fmt: skip


class Around(NamedTuple):
    """The closed loop around a law of one state space: matrix, input of each signal and of each rounding, output u.

    `of_signals` (n, signals), `of_rounding` (n, states + 1) (the last is a rounding of u), `output` (n,), `reads`
    (signals, n); the states of the law are the `states` last.
    """

    matrix: Real
    of_signals: Real
    of_rounding: Real
    output: Real
    reads: Real
    states: slice


def with_matrices(law: Law, matrices: Matrices) -> Law:
    """The law with another state space of all its columns, signals first, and the sign of v = -sum."""
    return replace(law, parts=(Part((*law.signals, *law.wanted), StateSpace(*matrices)),), sign=-1)


def matrices_of(law: Law) -> Matrices:
    """A, B, C, D of a law of all columns: u = r + C x + D e."""
    return law.matrices((*law.signals, *law.wanted))


def around(law: Law, loop: Sampled) -> Around:
    """The closed loop of `Sampled.matrix`, around a law of one state space."""
    A, B, C = loop.pulse.matrices()
    own, Bk, Ck, Dk = with_estimate(law, loop.chain).matrices(loop.in_z.signals)
    n, m, order = len(A), len(own), law.order
    output, push = -np.hstack([Dk @ C, Ck])[0], np.r_[B, np.zeros(m)]
    return Around(
        matrix=np.block([[A, np.zeros((n, m))], [Bk @ C, own]]) + np.outer(push, output),
        of_signals=np.vstack([np.outer(B, -Dk[0]), Bk]),
        of_rounding=np.c_[np.eye(n + m)[:, n : n + order], push],
        output=output,
        reads=np.hstack([C, np.zeros((len(C), m))]),
        states=slice(n, n + order),
    )


def gramians(of: Around) -> tuple[Real, Real] | None:
    """K over the variance of u, and W, of the states of the law; None where their sums do not converge."""
    M, K, W = of.matrix, of.of_signals @ of.of_signals.T, np.outer(of.output, of.output)
    rows = of.states
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(MOST_DOUBLINGS):
            more, seen = M @ K @ M.T, M.T @ W @ M
            K, W, M = K + more, W + seen, M @ M
            left = [(abs(a[rows, rows]).max(), abs(b[rows, rows]).max()) for a, b in ((more, K), (seen, W))]
            if all(last <= SUMMED * whole < np.inf for last, whole in left):
                return K[rows, rows] / (of.output @ K @ of.output), W[rows, rows]
    return None


def balancing(K: Real, W: Real) -> Real | None:
    """T with T^-1 K T^-T = T^T W T = diag(sigma); None where a state is not controllable or not observable."""
    size, vectors = np.linalg.eigh(K)
    root = vectors * np.sqrt(np.maximum(size, 0.0))
    square, turned = np.linalg.eigh(root.T @ W @ root)
    is_minimal = size[0] > LEAST_SHARE * size[-1] and square[0] > LEAST_SHARE**2 * square[-1]
    return root @ turned / square**0.25 if is_minimal else None


def sections(A: Real, K: Real, W: Real) -> Real | None:
    """T of second-order sections, a pair of poles each, and first-order ones, each balanced; None of multiple poles."""
    poles, vectors = np.linalg.eig(A)
    upper = np.flatnonzero(poles.imag >= 0)
    blocks = [np.c_[vectors[:, n].real, vectors[:, n].imag][:, : 1 + (poles[n].imag > 0)] for n in upper]
    modal = np.hstack(blocks)
    if modal.shape != A.shape or np.linalg.cond(modal / np.linalg.norm(modal, axis=0)) > WORST_CONDITION:
        return None
    duals = np.split(np.linalg.inv(modal), np.cumsum([block.shape[1] for block in blocks])[:-1])
    own = [balancing(dual @ K @ dual.T, block.T @ W @ block) for block, dual in zip(blocks, duals, strict=True)]
    known = [each for each in own if each is not None]
    return modal @ block_diag(*known) if len(known) == len(own) else None


def candidates(law: Law, loop: Sampled) -> list[tuple[NoiseGain, Matrices]]:
    """The realisations of a law in z of one state space, each with its noise gain; the law as given comes first."""
    A, B, C, D = matrices_of(law)
    found = gramians(around(law, loop)) if law.order else None
    if found is None:
        return [(NoiseGain(GIVEN, None if law.order else 0.0), (A, B, C, D))]
    K, W = found
    changes = {GIVEN: np.eye(law.order), SECTIONS: sections(A, K, W), BALANCED: balancing(K, W)}
    known = [(name, T, np.linalg.inv(T)) for name, T in changes.items() if T is not None]
    gains = [abs(float(np.diag(inverse @ K @ inverse.T) @ np.diag(T.T @ W @ T))) for _, T, inverse in known]
    return [
        (NoiseGain(name, gain), (inverse @ A @ T, inverse @ B, C @ T, D))
        for gain, (name, T, inverse) in zip(gains, known, strict=True)
    ]


def least_noise(law: Law, loop: Sampled) -> tuple[Law, str, list[NoiseGain]]:
    """The law in the realisation of least noise, as given if that has hardly more; its name, and all noise gains."""
    (given, own), *_ = found = candidates(law, loop)
    best, matrices = min(found, key=lambda each: each[0].gain or 0.0)
    if not NEXT_TO * (best.gain or 0.0) < (given.gain or 0.0):
        best, matrices = given, own
    return with_matrices(law, matrices), best.realisation, [gain for gain, _ in found]


MOST_SUMMED, BLOCK = 20_000, 32  # samples of a sum without a bound on all others, and of one step
DECAYED = 1e-3  # row sum of |M^n| from which all later samples are bounded
ON_CIRCLE, UNSEEN = 1e-9, 1e-8  # of 1: modulus of a pole on the unit circle; share of one that no output shows
FRACTION_BITS, MOST_SHIFT = 31, 62  # of a number in fixed point, and of a sum of products
HALF_STEP = 2.0 ** -(FRACTION_BITS + 1)  # of the range of a number: its largest rounding
HEADROOM, LEAST_SCALE = 1 + 2.0**-10, 2.0**-100  # of the range of a state: for roundings, and the least of all
OF_OUTPUT = 4.0  # ranges of u that a state without a bound reaches before it saturates
REFINED = 8  # steps to the bound of the errors
FIXED, OUTPUT = "q31", "output"  # fixed point; the name of the controller's output among ranges
FLOATS: dict[str, tuple[Any, float]] = {"double": (np.float64, 2.0**-53), "float": (np.float32, 2.0**-24)}  # roundoff


def absolute_sum(M: Real, left: Real, right: Real) -> tuple[Real, bool]:
    """Bound on sum_k |left M^k right|, entry by entry, and whether it is over all samples.

    With G = sum_{k<n} |left M^k|, sum_k |left M^k| <= G (I - |M^n|)^-1 once the row sums of |M^n| are below 1.
    """
    block = np.array([left @ np.linalg.matrix_power(M, k) for k in range(BLOCK)])
    step = last = np.linalg.matrix_power(M, BLOCK)
    G, S = np.zeros(left.shape), np.zeros((len(left), right.shape[1]))
    with np.errstate(over="ignore", invalid="ignore"):  # of a matrix that grows
        for _ in range(MOST_SUMMED // BLOCK):
            G, S = G + abs(block).sum(axis=0), S + abs(block @ right).sum(axis=0)
            if abs(last).sum(axis=1).max(initial=0.0) <= DECAYED:
                return S + np.linalg.solve(np.eye(len(M)) - abs(last).T, G.T).T @ abs(last @ right), True
            block, last = block @ step, last @ step
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
    tables: tuple[Any, ...]
    shifts: Any = None

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
        n, terms = self.law.order, self.law.order + self.sizes.size + 3
        if self.precision == FIXED:
            return 0.0, HALF_STEP * np.r_[np.ones(n), self.output]
        kind, unit = FLOATS[self.precision]
        return terms * unit / (1 - terms * unit), np.full(n + 1, terms * float(np.finfo(kind).smallest_subnormal))

    @cached_property
    def bounds(self) -> tuple[Real, bool, float]:
        """Bound on each state as exported, whether it is over all samples, and bound on the error of u.

        The error d of the states obeys d' = A d + w, w = |dA| X + |dB| E + roundings; X includes d.  Where a state may
        saturate, in fixed point, the error has no bound.
        """
        (A, B, C, D), E, one = matrices_of(self.law), self.sizes, np.eye(self.law.order)
        relative, absolute = self.errors
        pairs = zip(matrices_of(self.rounded), (A, B, C, D), strict=True)
        vA, vB, vC, vD = (abs(r - e) + relative * abs(r) for r, e in pairs)
        X, is_whole = absolute_sum(A, one, B)
        of_states, of_output = (absolute_sum(A, left, one)[0] for left in (one, C))
        largest = first = X @ E
        with np.errstate(over="ignore", invalid="ignore"):  # of a law that grows
            for _ in range(REFINED):  # to the least fixed point
                w = vA @ largest + vB @ E + absolute[:-1]
                largest = first + of_states @ w
            u = of_output @ w + vC @ largest + vD @ E + relative * self.output
        may_saturate = self.precision == FIXED and max(largest, default=0.0) >= 1
        return largest, is_whole, math.inf if may_saturate else float(u[0] + absolute[-1])

    def limit_cycle(self, loop: Sampled) -> float | None:
        """Bound on u in a limit cycle that roundings sustain in a loop at rest; None where none was found.

        A state and a signal z <= S (g Q z + a) + s b, with the responses S of the closed loop to a rounding and s to an
        error of a signal, the relative and absolute errors g and a of a sum, b of a signal in fixed point, and
        Q = |A B; C D|.  Where all eigenvalues of g S Q are below 1 that bounds z.
        """
        n, signals, read = self.law.order, self.law.signals, loop.in_z.signals
        if not set(signals) <= set(read):  # an estimated rate
            return None
        of, at = around(self.rounded, loop), [read.index(name) for name in signals]
        left = np.vstack([np.eye(len(of.matrix))[of.states], of.reads[at], of.output])
        S, is_whole = absolute_sum(observed(of.matrix, left), left, np.c_[of.of_rounding, of.of_signals[:, at]])
        A, B, C, D = (abs(each) for each in matrices_of(self.rounded))
        Q = np.block([[A, B[:, : len(at)]], [C, D[:, : len(at)]]])  # references are at rest
        S[-1, n:] += np.r_[1.0, D[0, : len(at)]]  # u itself
        relative, absolute = self.errors
        loops = relative * S[:, : n + 1] @ Q if is_whole else np.ones((1 + n + len(at), n + len(at)))
        if max(abs(np.linalg.eigvals(loops[:-1])), default=0.0) >= 1:
            return None
        rest = S @ np.r_[absolute, HALF_STEP * self.ranges[: len(at)] * (self.precision == FIXED)]
        return float(rest[-1] + loops[-1] @ np.linalg.solve(np.eye(n + len(at)) - loops[:-1], rest[:-1]))


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
    names = [name.removeprefix(REFERENCE) for name in (*law.signals, *law.wanted)]
    for name in (*names, OUTPUT):
        is_known = name in ranges or (name == OUTPUT and output) or precision != FIXED
        require(is_known, "range", name, f"q31 needs the largest absolute value: --range {name}=VALUE, in SI units")
    R = np.array([ranges.get(name, 1.0) for name in names])
    E = R * np.array([2.0 if name in law.references else 1.0 for name in (*law.signals, *law.wanted)])
    if precision == FIXED:
        return _fixed(law, E, R, float(output or 1.0))
    kind, tables = FLOATS[precision][0], matrices_of(law)
    with np.errstate(over="ignore"):
        found = tuple(each.astype(kind) for each in tables)
    for key, table, own in zip("ABCD", tables, found, strict=True):
        is_beyond = ~np.isfinite(own) | ((own == 0) & (table != 0))
        _check(key, table, is_beyond, f"beyond the numbers of {np.dtype(kind).name}")
    return Word(law, precision, E, R, output or 1.0, found)


def _check(key: str, table: Real, is_beyond: Any, problem: str) -> None:
    """Raise ParameterError for the first coefficient of a table that the target does not have."""
    for place in np.argwhere(is_beyond).tolist():
        name = f"{key}[{', '.join(map(str, place))}]"
        raise ParameterError(key=name, value=float(table[tuple(place)]), remedy=f"this coefficient is {problem}")


def _fixed(law: Law, E: Real, R: Real, U: float) -> Word:
    """A law in fixed point: the states scaled by powers of 2 beyond their bounds, or where there is none by u."""
    (A, B, C, D), n = matrices_of(law), law.order
    X, is_whole = absolute_sum(A, np.eye(n), B)
    of_output = np.divide(OF_OUTPUT * U, abs(C[0]), out=np.full(n, np.inf), where=C[0] != 0)
    size = np.maximum(X @ E if is_whole else np.minimum(X @ E, of_output), LEAST_SCALE)
    scale = np.exp2(np.ceil(np.log2(HEADROOM * size)))
    scaled = with_matrices(law, (A * scale / scale[:, None], B / scale[:, None], C * scale, D))
    A, B, C, D = matrices_of(scaled)
    table = np.block([[A, B * R], [C / U, D * R / U]])
    sums = abs(table) @ np.r_[np.ones(n), E / R] + np.r_[np.zeros(n), 1.0]  # of u with the feedforward
    most = 2.0**FRACTION_BITS - len(table) - R.size
    shifts = np.minimum(np.floor(np.log2(most / np.maximum(sums, LEAST_SCALE))).astype(int), MOST_SHIFT)
    is_largest = abs(table) == abs(table).max(axis=1)[:, None]
    _check("[A B; C D]", table, is_largest & (shifts < 1)[:, None], "beyond the numbers of q31 at these ranges")
    whole = np.rint(np.ldexp(table, shifts[:, None])).astype(np.int64)
    return Word(scaled, FIXED, E, R, U, (whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]), shifts)
