"""A sampled law in the word length of a target: the realisation of least noise, its coefficients, and bounds.

    [x_{k+1}; u_k - r_k] = [A B; C D] [x_k; e_k],      e = reference - signal of each column

States T^-1 x have A T^-1 ... T.  With K the covariance of the states under white noise at the signals, and W the sum
of squares of the responses of u to a rounding of each state, both in the closed loop, the noise gain is

    g = sum_i K_ii W_ii / variance of u,

which no scaling of the states changes: where every state has unit variance, the variance of u by roundings, over that
of one of them and over that of u under the noise (Mullis and Roberts, IEEE Trans. Circuits and Systems 23, 1976).  It
is compared for the law as given, for second-order sections, each balanced, and for the balanced realisation,
K = W = diag(sigma).

In fixed point (Q31) a signal of range R is a whole number of steps R/2^31, a state one of its bound; each row of
coefficients has one shift f, so that the sum of all products is below 2^63 and is rounded once:

    x_i = (sum_j a_ij x_j + sum_j b_ij e_j + 2^(f-1)) >> f

Bounds are sums of absolute values of responses over all samples, the l1 norm (Dahleh and Diaz-Bobillo, Control of
Uncertain Systems, 1995).  Where the law itself is not stable, as with an integral, they are over `MOST_SUMMED` samples.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag, cdf2rdf

from tfarm.arm import Law
from tfarm.arm.blocks import StateSpace
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
MOST_SUMMED, BLOCK = 20_000, 32  # samples of a sum without a bound on all others, and of one step
DECAYED = 1e-3  # row sum of |M^n| from which all later samples are bounded
ON_CIRCLE, UNSEEN = 1e-9, 1e-8  # of 1: modulus of a pole on the unit circle; share of one that no output shows
FRACTION_BITS, MOST_SHIFT = 31, 62  # of a number in fixed point, and of a sum of products
HALF_STEP = 2.0 ** -(FRACTION_BITS + 1)  # of the range of a number: its largest rounding
HEADROOM, LEAST_SCALE = 1 + 2.0**-10, 2.0**-100  # of the range of a state: for roundings, and the least of all
OF_OUTPUT = 4.0  # ranges of u that a state without a bound reaches before it saturates
FIXED, OUTPUT = "q31", "output"  # fixed point; the name of the controller's output among ranges
FLOATS: dict[str, tuple[Any, float]] = {"double": (np.float64, 2.0**-53), "float": (np.float32, 2.0**-24)}  # roundoff


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


def system_matrix(law: Law) -> Real:
    """[A B; C D] of a law of all its columns, signals first."""
    A, B, C, D = law.matrices((*law.signals, *law.wanted))
    return np.block([[A, B], [C, D]])


def with_system_matrix(law: Law, S: Real) -> Law:
    """The law with another state space of all its columns, and the sign of v = -sum."""
    columns = (*law.signals, *law.wanted)
    n = S.shape[1] - len(columns)
    block = StateSpace(S[:n, :n], S[:n, n:], S[n:, :n], S[n:, n:])
    return replace(law, parts=(Part(columns, block),), sign=-1)


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
    _, modal = cdf2rdf(poles, vectors)
    if np.linalg.cond(modal / np.linalg.norm(modal, axis=0)) > WORST_CONDITION:
        return None
    begins = np.flatnonzero(poles.imag >= 0)[1:]  # of a section, after the first
    blocks, duals = np.split(modal, begins, axis=1), np.split(np.linalg.inv(modal), begins)
    own = [balancing(dual @ K @ dual.T, block.T @ W @ block) for block, dual in zip(blocks, duals, strict=True)]
    known = [each for each in own if each is not None]
    return modal @ block_diag(*known) if len(known) == len(own) else None


def candidates(law: Law, loop: Sampled) -> list[tuple[NoiseGain, Real]]:
    """The realisations [A B; C D] of a law in z of one state space, that of the law as given first."""
    S, n = system_matrix(law), law.order
    found = gramians(around(law, loop)) if n else None
    if found is None:
        return [(NoiseGain(GIVEN, None if n else 0.0), S)]
    K, W = found
    changes = {GIVEN: np.eye(n), SECTIONS: sections(S[:n, :n], K, W), BALANCED: balancing(K, W)}
    known = [(name, T, np.linalg.inv(T)) for name, T in changes.items() if T is not None]
    gains = [abs(float(np.diag(inverse @ K @ inverse.T) @ np.diag(T.T @ W @ T))) for _, T, inverse in known]
    return [
        (NoiseGain(name, gain), block_diag(inverse, np.eye(1)) @ S @ block_diag(T, np.eye(S.shape[1] - n)))
        for gain, (name, T, inverse) in zip(gains, known, strict=True)
    ]


def least_noise(law: Law, loop: Sampled) -> tuple[Law, str, list[NoiseGain]]:
    """The law in the realisation of least noise, as given if that has hardly more; its name, and all noise gains."""
    found = candidates(law, loop)
    best, S = min(found, key=lambda each: (each[0].gain or 0.0) * (NEXT_TO if each[0].realisation != GIVEN else 1.0))
    return with_system_matrix(law, S), best.realisation, [gain for gain, _ in found]


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
    is that of u.  `table` is [A B; C D] as exported, whole numbers in fixed point, and `shifts` those of its rows.
    """

    law: Law
    precision: str
    sizes: Real
    ranges: Real
    output: float
    table: Any
    shifts: Any = None

    @cached_property
    def rounded(self) -> Law:
        """The law with the coefficients as exported, in SI units."""
        S, one = np.asarray(self.table, dtype=float), np.ones(self.law.order)
        if self.precision == FIXED:
            S = np.ldexp(S, -self.shifts[:, None]) * np.r_[one, self.output][:, None] / np.r_[one, self.ranges]
        return with_system_matrix(self.law, S)

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

        The error d of the states obeys d' = A d + w, w = |dS| [X; E] + roundings; X includes d.  Where a state may
        saturate, in fixed point, and where that has no solution, the error has no bound.
        """
        exact, rounded, n = system_matrix(self.law), system_matrix(self.rounded), self.law.order
        relative, absolute = self.errors
        V, A = abs(rounded - exact) + relative * abs(rounded), exact[:n, :n]
        X, is_whole = absolute_sum(A, np.eye(n), exact[:n, n:])
        S, _ = absolute_sum(A, np.vstack([np.eye(n), exact[n, :n]]), np.eye(n))
        rest, error = V[:, n:] @ self.sizes + absolute, math.inf
        largest = least_solution(S[:n] @ V[:n, :n], X @ self.sizes + S[:n] @ rest[:n])
        if max(largest, default=0.0) < (1 if self.precision == FIXED else math.inf):
            w = V[:, :n] @ largest + rest
            error = float(S[n] @ w[:n] + w[n] + relative * self.output)
        return largest, is_whole, error

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
        if not is_whole:
            return None
        Q = abs(system_matrix(self.rounded))[:, : n + len(at)]  # references are at rest
        S[-1, n:] += np.r_[1.0, Q[n, n:]]  # u itself
        relative, absolute = self.errors
        loops = relative * S[:, : n + 1] @ Q
        rest = S @ np.r_[absolute, HALF_STEP * self.ranges[: len(at)] * (self.precision == FIXED)]
        bound = float(rest[-1] + loops[-1] @ least_solution(loops[:-1], rest[:-1]))
        return bound if bound < math.inf else None


def least_solution(P: Real, q: Real) -> Real:
    """The least z = P z + q of entries that are not negative; infinite where an eigenvalue of P is not below 1."""
    if np.isfinite(P).all() and max(abs(np.linalg.eigvals(P)), default=0.0) < 1:
        return np.asarray(np.linalg.solve(np.eye(q.size) - P, q))
    return np.full(q.size, np.inf)


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
    kind, S = FLOATS[precision][0], system_matrix(law)
    with np.errstate(over="ignore"):
        own = S.astype(kind)
    _check(S, ~np.isfinite(own) | ((own == 0) & (S != 0)), np.dtype(kind).name)
    return Word(law, precision, E, R, output or 1.0, own)


def _check(S: Real, is_beyond: Any, kind: str) -> None:
    """Raise ParameterError for the first coefficient that the target does not have."""
    for place in np.argwhere(is_beyond).tolist():
        remedy = f"this coefficient is beyond the numbers of {kind}"
        raise ParameterError(key=coefficient(place), value=float(S[tuple(place)]), remedy=remedy)


def coefficient(place: Sequence[int]) -> str:
    """The name of a coefficient, in its table in the source in C."""
    return f"ABCD[{place[0]}][{place[1]}]"


def _fixed(law: Law, E: Real, R: Real, U: float) -> Word:
    """A law in fixed point: the states scaled by powers of 2 beyond their bounds, or where there is none by u."""
    S, n, one = system_matrix(law), law.order, np.ones(law.order)
    X, is_whole = absolute_sum(S[:n, :n], np.eye(n), S[:n, n:])
    of_output = np.divide(OF_OUTPUT * U, abs(S[n, :n]), out=np.full(n, np.inf), where=S[n, :n] != 0)
    size = np.maximum(X @ E if is_whole else np.minimum(X @ E, of_output), LEAST_SCALE)
    scale = np.exp2(np.ceil(np.log2(HEADROOM * size)))
    scaled = with_system_matrix(law, S * np.r_[scale, np.ones(R.size)] / np.r_[scale, 1.0][:, None])
    table = system_matrix(scaled) * np.r_[one, R] / np.r_[one, U][:, None]
    sums = abs(table) @ np.r_[one, E / R] + np.r_[np.zeros(n), 1.0]  # of u with the feedforward
    most = 2.0**FRACTION_BITS - len(table) - R.size
    shifts = np.minimum(np.floor(np.log2(most / np.maximum(sums, LEAST_SCALE))).astype(int), MOST_SHIFT)
    is_largest = abs(table) == abs(table).max(axis=1)[:, None]
    _check(table, is_largest & (shifts < 1)[:, None], "q31 at these ranges")
    return Word(scaled, FIXED, E, R, U, np.rint(np.ldexp(table, shifts[:, None])).astype(np.int64), shifts)
