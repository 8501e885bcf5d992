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
A DAC adds half of its step to the rounding of u.  Limits of u keep every bound, as clipping separates no two numbers.
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
from tfarm.dsp.discretise import system_matrix, with_estimate
from tfarm.errors import ParameterError, require
from tfarm.exact.rationals import exact_matrix
from tfarm.loop.sampled import Sampled
from tfarm.schema import Quantity

# of a sum of squares: its last terms
SUMMED = 1e-9
# of the largest singular value: below it a state is not controllable or not observable
LEAST_SHARE = 1e-12
GIVEN = "law as given"
SECTIONS = "second-order sections"
BALANCED = "balanced state space"
# samples of a sum without a bound on all others, and of one step
MOST_SUMMED = 20_000
BLOCK = 32
# of a number in fixed point
FRACTION_BITS = 31
# of the range of a number: its largest rounding
HALF_STEP = 2.0 ** -(FRACTION_BITS + 1)
# fixed point; names of u and of r among ranges
FIXED = "q31"
OUTPUT = "output"
FEEDFORWARD = "feedforward"
RATE = "hub_rate"
ANGLE = "hub_angle"
# roundoff
FLOATS: dict[str, tuple[Any, float]] = {"double": (np.float64, 2.0**-53), "float": (np.float32, 2.0**-24)}


class NoiseGain(NamedTuple):
    """A realisation and its noise gain."""

    realisation: Annotated[str, Quantity("realisation", help="structure of the states of the controller")]
    gain: Annotated[
        float | None,
        Quantity(
            "noise gain",
            "",
            5,
            help="variance of the output by roundings, for states of unit variance, in the closed loop",
        ),
    ]


class WordLengthBounds(NamedTuple):
    """Bounds on the states as exported, on the error of the returned u, and on u of the law, for inputs within ranges.

    `is_whole` where they are over all samples.
    """

    states: Real
    is_whole: bool
    error: float
    output: float


class StateSpaceLoop(NamedTuple):
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


def with_system_matrix(law: Law, S: Real) -> Law:
    """The law with another state space of all its columns, and the sign of v = -sum."""
    columns = (*law.signals, *law.wanted)
    n = S.shape[1] - len(columns)
    part = Part(columns, StateSpace(S[:n, :n], S[:n, n:], S[n:, :n], S[n:, n:]))
    return replace(law, parts=(part,), sign=-1)


def close_state_space(
    A: Real, B: Real, C: Real, a: Real, b: Real, c: Real, d: Real
) -> tuple[Real, Real, Real]:
    """Matrix, rows of y and row of u of the loop of x' = A x + B u, y = C x and k' = a k + b y, u = c k + d y."""
    y = np.pad(C, ((0, 0), (0, len(a))))
    u = np.c_[d @ C, c]
    return block_diag(A, a) + np.r_[B @ u, b @ y], y, u


def close_around_law(law: Law, loop: Sampled) -> StateSpaceLoop:
    """The closed loop of `Sampled.matrix`, around a law of one state space."""
    A, B, C = loop.pulse.matrices()
    own, Bk, Ck, Dk = with_estimate(law, loop.chain).matrices(loop.in_z.signals)
    matrix, reads, output = close_state_space(A, B[:, None], C, own, Bk, -Ck, -Dk)
    states = slice(len(A), len(A) + law.order)
    push = np.r_[B, np.zeros(len(own))]
    return StateSpaceLoop(
        matrix=matrix,
        of_signals=np.r_[np.outer(B, -Dk[0]), Bk],
        of_rounding=np.c_[np.eye(len(matrix))[:, states], push],
        output=output[0],
        reads=reads,
        states=states,
    )


def gramian_sum(M: Real, Q: Real, rows: slice) -> Real | None:
    """Q + M Q M^T + M^2 Q M^2^T + ...; None where the sum of these rows does not converge."""
    # of the samples that a sum has: 1e12 of them
    most_doublings = 40
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(most_doublings):
            more = M @ Q @ M.T
            Q = Q + more
            M = M @ M
            if abs(more[rows, rows]).max() <= SUMMED * abs(Q[rows, rows]).max() < np.inf:
                return Q
    return None


def gramians(of: StateSpaceLoop) -> tuple[Real, Real] | None:
    """K over the variance of u, and W, of the states of the law; None where their sums do not converge."""
    rows = of.states
    K = gramian_sum(of.matrix, of.of_signals @ of.of_signals.T, rows)
    W = gramian_sum(of.matrix.T, np.outer(of.output, of.output), rows)
    if K is None or W is None:
        return None
    return (K[rows, rows] / (of.output @ K @ of.output), W[rows, rows])


def balancing_transform(K: Real, W: Real) -> Real | None:
    """T with T^-1 K T^-T = T^T W T = diag(sigma); None where a state is not controllable or not observable."""
    size, vectors = np.linalg.eigh(K)
    root = vectors * np.sqrt(np.maximum(size, 0.0))
    square, turned = np.linalg.eigh(root.T @ W @ root)
    is_minimal = size[0] > LEAST_SHARE * size[-1] and square[0] > LEAST_SHARE**2 * square[-1]
    return root @ turned / square**0.25 if is_minimal else None


def second_order_sections(A: Real, K: Real, W: Real) -> Real | None:
    """T of second-order sections, a pair of poles each, and first-order ones, each balanced; None of multiple poles."""
    poles, vectors = np.linalg.eig(A)
    _, modal = cdf2rdf(poles, vectors)
    # poles are not separated
    if np.linalg.cond(modal / np.linalg.norm(modal, axis=0)) > 1e8:
        return None
    # of a section, after the first
    begins = np.flatnonzero(poles.imag >= 0)[1:]
    blocks = np.split(modal, begins, axis=1)
    duals = np.split(np.linalg.inv(modal), begins)
    own = [
        balancing_transform(dual @ K @ dual.T, block.T @ W @ block)
        for block, dual in zip(blocks, duals, strict=True)
    ]
    known = [each for each in own if each is not None]
    return modal @ block_diag(*known) if len(known) == len(own) else None


def candidates(law: Law, loop: Sampled) -> list[tuple[NoiseGain, Real]]:
    """The realisations [A B; C D] of a law in z of one state space, that of the law as given first."""
    S = system_matrix(law)
    n = law.order
    found = gramians(close_around_law(law, loop)) if n else None
    if found is None:
        return [(NoiseGain(GIVEN, None if n else 0.0), S)]
    K, W = found
    changes = {
        GIVEN: np.eye(n),
        SECTIONS: second_order_sections(S[:n, :n], K, W),
        BALANCED: balancing_transform(K, W),
    }
    known = [(name, T, np.linalg.inv(T)) for name, T in changes.items() if T is not None]
    gains = [abs(float(np.diag(inverse @ K @ inverse.T) @ np.diag(T.T @ W @ T))) for _, T, inverse in known]
    return [(NoiseGain(name, gain), similar(S, T)) for gain, (name, T, _) in zip(gains, known, strict=True)]


def similar(S: Real, T: Real) -> Real:
    """[A B; C D] of the states T^-1 x, each coefficient rounded once: rational numbers."""
    change = exact_matrix(block_diag(T, np.eye(S.shape[1] - len(T))))
    back = exact_matrix(block_diag(T, np.eye(1))).inv()
    exact = back * exact_matrix(S) * change
    return np.array([[int(each.p) / int(each.q) for each in row] for row in exact.tolist()])


def least_noise(law: Law, loop: Sampled) -> tuple[Law, str, list[NoiseGain]]:
    """The law in the realisation of least noise, as given if that has hardly more; its name, and all noise gains."""
    found = candidates(law, loop)
    # for a hundredth less a law keeps its states, and an integral its pole z = 1
    best, S = min(
        found, key=lambda each: (each[0].gain or 0.0) * (1.01 if each[0].realisation != GIVEN else 1.0)
    )
    return with_system_matrix(law, S), best.realisation, [gain for gain, _ in found]


def absolute_sum(M: Real, left: Real, right: Real, most: int = MOST_SUMMED) -> tuple[Real, bool]:
    """Bound on sum_k |left M^k right|, entry by entry, and whether it is over all samples, or over the `most` first.

    With G = sum_{k<n} |left M^k|, sum_k |left M^k| <= G (I - |M^n|)^-1 once the row sums of |M^n| are below 1.
    """
    G = np.zeros(left.shape)
    S = np.zeros((len(left), right.shape[1]))
    # of a matrix that grows
    with np.errstate(over="ignore", invalid="ignore"):
        block = np.array([left @ np.linalg.matrix_power(M, k) for k in range(BLOCK)])
        step = last = np.linalg.matrix_power(M, BLOCK)
        for _ in range(most // BLOCK):
            G = G + abs(block).sum(axis=0)
            S = S + abs(block @ right).sum(axis=0)
            # all later samples are bounded from here
            if abs(last).sum(axis=1).max(initial=0.0) <= 1e-3:
                return S + np.linalg.solve(np.eye(len(M)) - abs(last).T, G.T).T @ abs(last @ right), True
            block = block @ step
            last = last @ step
    return np.nan_to_num(S, nan=np.inf), False


@dataclass(frozen=True)
class Word:
    """A realised law in z of one state space, in the numbers of a target.

    `sizes` bounds e of each column, and `slips` the error of an estimate in it; `feedforward` bounds r, and `step` is
    that of the DAC.  In fixed point `ranges` are the scales of e, that of each state is 1, and `output` is that of u.
    `table` is [A B; C D] as exported, whole numbers in fixed point, and `shifts` those of its rows.
    """

    law: Law
    precision: str
    sizes: Real
    ranges: Real
    output: float
    feedforward: float
    step: float
    slips: Real
    table: Any
    shifts: Any = None

    @cached_property
    def rounded(self) -> Law:
        """The law with the coefficients as exported, in SI units."""
        S = np.asarray(self.table, dtype=float)
        one = np.ones(self.law.order)
        if self.precision == FIXED:
            S = (
                np.ldexp(S, -self.shifts[:, None])
                * np.r_[one, self.output][:, None]
                / np.r_[one, self.ranges]
            )
        return with_system_matrix(self.law, S)

    @cached_property
    def errors(self) -> tuple[float, Real]:
        """Relative and absolute rounding error of a sum: of each state, and of u last."""
        n = self.law.order
        terms = n + self.sizes.size + (6 if self.step else 3)
        of_dac = np.r_[np.zeros(n), self.step / 2]
        if self.precision == FIXED:
            return 0.0, HALF_STEP * np.r_[np.ones(n), self.output] + of_dac
        kind, unit = FLOATS[self.precision]
        tiny = terms * float(np.finfo(kind).smallest_subnormal)
        return terms * unit / (1 - terms * unit), tiny + of_dac

    @cached_property
    def bounds(self) -> WordLengthBounds:
        """Bounds on what the code returns, against the law in exact arithmetic.

        The error d of the states obeys d' = A d + w, w = |dS| [X; E] + roundings; X includes d.  In fixed point a state
        is at most 1, and the bounds hold until one saturates.  Where the sums have no digits or X has no solution there
        are none.
        """
        exact = system_matrix(self.law)
        rounded = system_matrix(self.rounded)
        n = self.law.order
        relative, absolute = self.errors
        unit = FLOATS["double"][1]
        # the coefficients of both are rounded in double, those of fixed point by their units
        relative += (3 if self.precision == FIXED else 1) * unit
        V = abs(rounded - exact) + relative * abs(rounded)
        A = exact[:n, :n]
        sums, is_whole = absolute_sum(
            A, np.vstack([np.eye(n), exact[n, :n]]), np.hstack([np.eye(n), exact[:n, n:]])
        )
        # share of a sum that the roundings of its powers in double can change
        lost = math.inf
        if np.isfinite(sums[:n, :n]).all():
            lost = n * unit * max(abs(np.linalg.eigvals(abs(A) @ sums[:n, :n])), default=0.0)
        if lost > 1e-3:
            return WordLengthBounds(np.full(n, np.inf), False, math.inf, math.inf)
        S, X = np.hsplit(sums * (1 + lost), [n])
        largest = X @ self.sizes
        output = float(largest[n] + abs(exact[n, n:]) @ self.sizes + self.feedforward)
        # the sum itself is rounded
        output *= 1 + (n + self.sizes.size + 3) * unit
        rest = V[:, n:] @ self.sizes + abs(rounded[:, n:]) @ self.slips + absolute
        states = least_solution(S[:n] @ V[:n, :n], largest[:n] + S[:n] @ rest[:n])
        states = np.minimum(states, 1.0 if self.precision == FIXED else np.inf)
        if not np.isfinite(states).all():
            return WordLengthBounds(states, is_whole, math.inf, output)
        w = V[:, :n] @ states + rest
        return WordLengthBounds(
            states, is_whole, float(S[n] @ w[:n] + w[n] + relative * self.feedforward), output
        )

    def limit_cycle(self, loop: Sampled) -> float | None:
        """Bound on u in a limit cycle that roundings sustain in a loop at rest; None where none was found.

        A state and a signal z <= S (g Q z + a) + s b, with the responses S of the closed loop to a rounding and s to an
        error of a signal, the relative and absolute errors g and a of a sum, b of a signal in fixed point, and
        Q = |A B; C D|.  Where all eigenvalues of g S Q are below 1 that bounds z.
        """
        n = self.law.order
        signals = self.law.signals
        read = loop.in_z.signals
        # an estimated rate
        if not set(signals) <= set(read):
            return None
        of = close_around_law(self.rounded, loop)
        at = [read.index(name) for name in signals]
        left = np.vstack([np.eye(len(of.matrix))[of.states], of.reads[at], of.output])
        S, is_whole = absolute_sum(
            observable_part(of.matrix, left), left, np.c_[of.of_rounding, of.of_signals[:, at]]
        )
        if not is_whole:
            return None
        # references are at rest
        Q = abs(system_matrix(self.rounded))[:, : n + len(at)]
        # u itself
        S[-1, n:] += np.r_[1.0, Q[n, n:]]
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


def observable_part(M: Real, left: Real) -> Real:
    """The matrix without poles on the unit circle that no row of `left` shows, such as z = 1 of a free hub angle."""
    poles, vectors = np.linalg.eig(M)
    seen = abs(left @ vectors).max(axis=0) / abs(left).max()
    # on the unit circle, with a share that no row shows
    gone = (abs(poles) >= 1 - 1e-9) & (seen <= 1e-8)
    if gone.any():
        return M - np.real(vectors[:, gone] * poles[gone] @ np.linalg.pinv(vectors)[gone])
    return M


def word_of(
    law: Law,
    precision: str,
    ranges: Mapping[str, float],
    step: float = 0.0,
    hub: tuple[float, float] | None = None,
) -> Word:
    """A realised law in the numbers of a target, with the largest absolute values of its inputs and of u in SI units.

    `step` is that of the DAC, `hub` pole and period [s] of an estimated hub rate.  Raises ParameterError, in fixed
    point for a signal or an output without a range, and for a coefficient that is beyond the numbers of the target.
    """
    names = [name.removeprefix(REFERENCE) for name in (*law.signals, *law.wanted)]
    for name in (*names, OUTPUT):
        remedy = f"q31 needs the largest absolute value: --range {name}=VALUE, in SI units"
        require(name in ranges or precision != FIXED, "range", name, remedy)
    R = np.array([ranges.get(name, 1.0) for name in names])
    E = R.copy()
    slips = np.zeros(R.size)
    U = ranges.get(OUTPUT, 1.0)
    if hub:
        at = names.index(RATE)
        pole, period = hub
        # the l1 norm of (1 - p)/T (z - 1)/(z - p); of differences within RATE T the estimate is within RATE
        E[at] = min(2 * (1 - pole) / period * ranges.get(ANGLE, 1.0), ranges.get(RATE, math.inf))
        # of its operations, and of the pole
        of_double = (6 + 2 / (1 - pole)) * FLOATS["double"][1] / (1 - pole)
        slips[at] = E[at] * (FLOATS[precision][1] + of_double)
    E += R * np.array([name in law.references for name in (*law.signals, *law.wanted)])
    word = Word(law, precision, E, R, U, ranges.get(FEEDFORWARD, U), step, slips, system_matrix(law))
    if precision == FIXED:
        return _fixed(word)
    kind = FLOATS[precision][0]
    S = word.table
    with np.errstate(over="ignore"):
        own = S.astype(kind)
    _check(S, ~np.isfinite(own) | ((own == 0) & (S != 0)), np.dtype(kind).name)
    return replace(word, table=own)


def _check(S: Real, is_beyond: Any, kind: str) -> None:
    """Raise ParameterError for the first coefficient that the target does not have."""
    for place in np.argwhere(is_beyond).tolist():
        remedy = f"this coefficient is beyond the numbers of {kind}"
        raise ParameterError(key=coefficient(place), value=float(S[tuple(place)]), remedy=remedy)


def coefficient(place: Sequence[int]) -> str:
    """The name of a coefficient, in its table in the source in C."""
    return f"ABCD[{place[0]}][{place[1]}]"


def _fixed(word: Word) -> Word:
    """A law in fixed point: the states scaled by powers of 2 beyond their bounds, or where there is none by u.

    Raises ParameterError for a feedforward beyond the output, a state without a scale, and coefficients without digits.
    """
    # of the range of a state
    least_scale = 2.0**-100
    E = word.sizes
    R = word.ranges
    U = word.output
    law = word.law
    remedy = f"in fixed point feedforward is a fraction of the range of the output: at most {U!r}"
    require(word.feedforward <= U, "range.feedforward", word.feedforward, remedy)
    S = system_matrix(law)
    n = law.order
    A = S[:n, :n]
    B = S[:n, n:]
    one = np.ones(n)
    X, is_whole = absolute_sum(A, np.eye(n), B)
    reach = X @ E
    # a state without a bound saturates beyond four ranges of u
    with np.errstate(divide="ignore"):
        of_output = 4 * U / abs(S[n, :n])
    # a state whose sum still grows has the scale of u
    if not is_whole:
        earlier, _ = absolute_sum(A, np.eye(n), B, MOST_SUMMED // 2)
        of_output[np.isfinite(reach) & (reach <= (1 + SUMMED) * (earlier @ E))] = np.inf
    size = np.maximum(reach if is_whole else np.minimum(reach, of_output), least_scale)
    if not np.isfinite(size).all():
        poles, vectors = np.linalg.eig(A)
        remedy = (
            f"ill-conditioned or unstable in z: modulus of its poles up to {max(abs(poles)):.4g} in double, condition "
            f"number of their eigenvectors {np.linalg.cond(vectors):.2g}; q31 needs states with a bound: give the law "
            "in s, or in z as a state space of sections in cascade"
        )
        raise ParameterError(key="law", value=law.name, remedy=remedy)
    # with room for roundings
    scale = np.exp2(np.ceil(np.log2((1 + 2.0**-10) * size)))
    scaled = S * np.r_[scale, np.ones(R.size)] / np.r_[scale, 1.0][:, None]
    table = scaled * np.r_[one, R] / np.r_[one, U][:, None]
    # of u with the feedforward
    sums = abs(table) @ np.r_[one, E / R] + np.r_[np.zeros(n), 1.0]
    most = 2.0**FRACTION_BITS - len(table) - R.size
    # at most those of a sum of products
    shifts = np.minimum(np.floor(np.log2(most / np.maximum(sums, least_scale))).astype(int), 62)
    is_largest = abs(table) == abs(table).max(axis=1)[:, None]
    _check(table, is_largest & (shifts < 1)[:, None], "q31 at these ranges")
    whole = np.rint(np.ldexp(table, shifts[:, None])).astype(np.int64)
    return replace(word, law=with_system_matrix(law, scaled), table=whole, shifts=shifts)
