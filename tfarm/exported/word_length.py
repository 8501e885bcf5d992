"""A sampled law in the word length of a target: its coefficients, and bounds.

    [x_{k+1}; u_k - r_k] = [A B; C D] [x_k; e_k],      e = reference - signal of each column

In fixed point (Q31) a signal of range R is a whole number of steps R/2^31, a state one of its bound; each row of
coefficients has one shift f, so that the sum of all products is below 2^63 and is rounded once:

    x_i = (sum_j a_ij x_j + sum_j b_ij e_j + 2^(f-1)) >> f

Bounds are sums of absolute values of responses over all samples, the l1 norm (Dahleh and Diaz-Bobillo, Control of
Uncertain Systems, 1995).  Where the law itself is not stable, as with an integral, they are over `MOST_SUMMED` samples.
A DAC adds half of its step to the rounding of u.  Limits of u keep every bound, as clipping separates no two numbers.

A shaper makes r_k = c_1 r'_{k-l_1} + c_2 r'_{k-l_2} + ... of references and feedforward r' within R: r is within gain
times R, and its rounding within error times R.  In fixed point the sizes c are whole numbers over a power of 2, their
sum.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import Law
from tfarm.arm.law import REFERENCE
from tfarm.arrays import Real, Whole
from tfarm.dsp.discretise import system_matrix
from tfarm.errors import ParameterError, require
from tfarm.exported.realisations import close_around_law, with_system_matrix
from tfarm.loop.sampled import Sampled

# samples of a sum without a bound on all others
MOST_SUMMED = 20_000
# of the range of a number in fixed point, which has 31 bits: its largest rounding
HALF_STEP = 2.0**-32
# fixed point; names of u and of r among ranges
FIXED = "q31"
OUTPUT = "output"
FEEDFORWARD = "feedforward"
RATE = "hub_rate"
ANGLE = "hub_angle"
# roundoff
FLOATS: dict[str, tuple[Any, float]] = {"double": (np.float64, 2.0**-53), "float": (np.float32, 2.0**-24)}


class WordLengthBounds(NamedTuple):
    """Bounds on the states as exported, on the error of the returned u, and on u of the law, for inputs within ranges.

    `is_whole` where they are over all samples.
    """

    states: Real
    is_whole: bool
    error: float
    output: float


class ShaperCode(NamedTuple):
    """Impulses that are not 0: samples ago, sizes as exported, their `shift` in fixed point; gain and error of r.

    Without any nothing is shaped.
    """

    lags: Whole
    sizes: Any
    shift: int
    gain: float
    error: float


def shaper_code(impulses: Real, precision: str) -> ShaperCode:
    """Return impulses (m,) in the numbers of a target; a single one is left out."""
    if impulses.size == 1:
        return ShaperCode(np.zeros(0, int), np.zeros(0, int if precision == FIXED else float), 0, 1.0, 0.0)
    lags = np.flatnonzero(impulses)
    sizes = impulses[lags]
    # all together are 1
    gain = 1.0 + 2.0 * float(abs(sizes[sizes < 0]).sum())
    if precision != FIXED:
        kind, unit = FLOATS[precision]
        # of a size, of its product, and of the sums
        terms = lags.size + 3
        error = terms * unit / (1 - terms * unit) * gain
        return ShaperCode(lags, sizes.astype(kind).astype(float), 0, gain, error)
    shift = 30 - math.ceil(math.log2(gain))
    whole = np.rint(np.ldexp(sizes, shift)).astype(np.int64)
    whole[abs(whole).argmax()] += 2**shift - whole.sum()
    return ShaperCode(lags, whole, shift, gain, HALF_STEP + math.ldexp(float(lags.size), -shift))


def absolute_sum(M: Real, left: Real, right: Real, most: int = MOST_SUMMED) -> tuple[Real, bool]:
    """Return a bound on sum_k |left M^k right|, entry by entry, and whether it is over all samples.

    If not, it is over the `most` first.

    With G = sum_{k<n} |left M^k|, sum_k |left M^k| <= G (I - |M^n|)^-1 once the row sums of |M^n| are below 1.
    """
    # samples of one step
    size = 32
    G = np.zeros(left.shape)
    S = np.zeros((len(left), right.shape[1]))
    # of a matrix that grows
    with np.errstate(over="ignore", invalid="ignore"):
        block = np.array([left @ np.linalg.matrix_power(M, k) for k in range(size)])
        step = last = np.linalg.matrix_power(M, size)
        for _ in range(most // size):
            G = G + abs(block).sum(axis=0)
            S = S + abs(block @ right).sum(axis=0)
            # all later samples are bounded from here
            if abs(last).sum(axis=1).max(initial=0.0) <= 1e-3:
                rest = np.linalg.solve(np.eye(len(M)) - abs(last).T, G.T).T
                return S + rest @ abs(last @ right), True
            block = block @ step
            last = last @ step
    return np.nan_to_num(S, nan=np.inf), False


@dataclass(frozen=True)
class Word:
    """A realised law in z of one state space, in the numbers of a target.

    `sizes` bounds e of each column, and `slips` the error of an estimate or a shaper in it; `feedforward` bounds r and
    its error, and `step` is that of the DAC.  In fixed point `ranges` are the scales of e, that of each state is 1, and
    `output` is that of u.  `table` is [A B; C D] as exported, whole numbers in fixed point, and `shifts` those of its
    rows.
    """

    law: Law
    precision: str
    sizes: Real
    ranges: Real
    output: float
    feedforward: tuple[float, float]
    step: float
    slips: Real
    table: Any
    shifts: Any = None

    @cached_property
    def rounded_law(self) -> Law:
        """The law with the coefficients as exported, in SI units."""
        S = np.asarray(self.table, dtype=float)
        if self.precision == FIXED:
            one = np.ones(self.law.order)
            S = np.ldexp(S, -self.shifts[:, None])
            S = S * np.r_[one, self.output][:, None] / np.r_[one, self.ranges]
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
        rounded = system_matrix(self.rounded_law)
        n = self.law.order
        relative, absolute = self.errors
        unit = FLOATS["double"][1]
        # the coefficients of both are rounded in double, those of fixed point by their units
        relative += (3 if self.precision == FIXED else 1) * unit
        V = abs(rounded - exact) + relative * abs(rounded)
        A = exact[:n, :n]
        left = np.vstack([np.eye(n), exact[n, :n]])
        right = np.hstack([np.eye(n), exact[:n, n:]])
        sums, is_whole = absolute_sum(A, left, right)
        # share of a sum that the roundings of its powers in double can change
        lost = math.inf
        if np.isfinite(sums[:n, :n]).all():
            lost = n * unit * spectral_radius(abs(A) @ sums[:n, :n])
        if lost > 1e-3:
            return WordLengthBounds(np.full(n, np.inf), False, math.inf, math.inf)
        S, X = np.hsplit(sums * (1 + lost), [n])
        largest = X @ self.sizes
        output = float(largest[n] + abs(exact[n, n:]) @ self.sizes + self.feedforward[0])
        # the sum itself is rounded
        output *= 1 + (n + self.sizes.size + 3) * unit
        rest = V[:, n:] @ self.sizes + abs(rounded[:, n:]) @ self.slips + absolute
        states = least_solution(S[:n] @ V[:n, :n], largest[:n] + S[:n] @ rest[:n])
        if self.precision == FIXED:
            states = np.minimum(states, 1.0)
        if not np.isfinite(states).all():
            return WordLengthBounds(states, is_whole, math.inf, output)
        w = V[:, :n] @ states + rest
        forward, slip = self.feedforward
        error = S[n] @ w[:n] + w[n] + relative * forward + (1 + relative) * slip
        return WordLengthBounds(states, is_whole, float(error), output)

    def limit_cycle(self, loop: Sampled) -> float | None:
        """Return the bound on u in a limit cycle that roundings sustain in a loop at rest; None where none was found.

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
        of = close_around_law(self.rounded_law, loop)
        at = [read.index(name) for name in signals]
        left = np.vstack([np.eye(len(of.matrix))[of.states], of.reads[at], of.output])
        right = np.c_[of.of_rounding, of.of_signals[:, at]]
        S, is_whole = absolute_sum(observable_part(of.matrix, left), left, right)
        if not is_whole:
            return None
        # references are at rest
        Q = abs(system_matrix(self.rounded_law))[:, : n + len(at)]
        # u itself
        S[-1, n:] += np.r_[1.0, Q[n, n:]]
        relative, absolute = self.errors
        loops = relative * S[:, : n + 1] @ Q
        of_signals = HALF_STEP * self.ranges[: len(at)] * (self.precision == FIXED)
        rest = S @ np.r_[absolute, of_signals]
        bound = float(rest[-1] + loops[-1] @ least_solution(loops[:-1], rest[:-1]))
        return bound if bound < math.inf else None


def spectral_radius(P: Real) -> float:
    """Return the largest absolute value of the eigenvalues of a matrix, 0 of none; infinite of one without a bound."""
    if np.isfinite(P).all():
        return float(max(abs(np.linalg.eigvals(P)), default=0.0))
    return math.inf


def least_solution(P: Real, q: Real) -> Real:
    """Return the least z = P z + q of entries that are not negative.

    Infinite where an eigenvalue of P is not below 1.
    """
    if spectral_radius(P) < 1:
        return np.asarray(np.linalg.solve(np.eye(q.size) - P, q))
    return np.full(q.size, np.inf)


def observable_part(M: Real, left: Real) -> Real:
    """Return the matrix without poles on the unit circle that no row of `left` shows (z = 1 of a free hub angle)."""
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
    shaper: ShaperCode | None = None,
) -> Word:
    """Return a realised law in the numbers of a target.

    `ranges` are the largest absolute values of its inputs and of u in SI units, `step` is that of the DAC, `hub` pole
    and period [s] of an estimated hub rate, `shaper` that of references and feedforward.  Raises ParameterError, in
    fixed point for a signal or an output without a range, and for a coefficient beyond the numbers of the target.
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
        norm = 2 * (1 - pole) / period
        E[at] = min(norm * ranges.get(ANGLE, 1.0), ranges.get(RATE, math.inf))
        # of its operations, and of the pole
        of_double = (6 + 2 / (1 - pole)) * FLOATS["double"][1] / (1 - pole)
        slips[at] = E[at] * (FLOATS[precision][1] + of_double)
    shaper = shaper or shaper_code(np.ones(1), precision)
    is_column = np.repeat([False, True], [len(law.signals), len(law.wanted)])
    wanted = R * (is_column | [name in law.references for name in (*law.signals, *law.wanted)])
    E += shaper.gain * wanted - R * is_column
    slips += shaper.error * wanted
    forward = ranges.get(FEEDFORWARD, U)
    feedforward = (shaper.gain * forward, shaper.error * forward)
    word = Word(law, precision, E, R, U, feedforward, step, slips, system_matrix(law))
    if precision == FIXED:
        return to_fixed_point(word)
    kind = FLOATS[precision][0]
    S = word.table
    with np.errstate(over="ignore"):
        own = S.astype(kind)
    is_lost = (own == 0) & (S != 0)
    must_be_in_range(S, ~np.isfinite(own) | is_lost, np.dtype(kind).name)
    return replace(word, table=own)


def must_be_in_range(S: Real, is_beyond: Any, kind: str) -> None:
    """Raise ParameterError for the first coefficient that the target does not have."""
    for place in np.argwhere(is_beyond).tolist():
        remedy = f"this coefficient is beyond the numbers of {kind}"
        raise ParameterError(key=coefficient(place), value=float(S[tuple(place)]), remedy=remedy)


def coefficient(place: Sequence[int]) -> str:
    """Return the name of a coefficient, in its table in the source in C."""
    return f"ABCD[{place[0]}][{place[1]}]"


def to_fixed_point(word: Word) -> Word:
    """Return a law in fixed point: the states scaled by powers of 2 beyond their bounds, or where there is none by u.

    Raises ParameterError for a feedforward beyond the output, a state without a scale, and coefficients without digits.
    """
    E = word.sizes
    R = word.ranges
    U = word.output
    remedy = f"in fixed point feedforward is a fraction of the range of the output: at most {U!r}"
    require(word.feedforward[0] <= U, "range.feedforward", word.feedforward[0], remedy)
    S = word.table
    n = word.law.order
    one = np.ones(n)
    scale = state_scales(word)
    scaled = S * np.r_[scale, np.ones(R.size)] / np.r_[scale, 1.0][:, None]
    table = scaled * np.r_[one, R] / np.r_[one, U][:, None]
    # of u with the feedforward
    sums = abs(table) @ np.r_[one, E / R] + np.r_[np.zeros(n), 1.0]
    most = 2.0**31 - len(table) - R.size
    # at most those of a sum of products
    shifts = np.minimum(np.floor(np.log2(most / np.maximum(sums, 2.0**-100))).astype(int), 62)
    is_largest = abs(table) == abs(table).max(axis=1)[:, None]
    must_be_in_range(table, is_largest & (shifts < 1)[:, None], "q31 at these ranges")
    whole = np.rint(np.ldexp(table, shifts[:, None])).astype(np.int64)
    return replace(word, law=with_system_matrix(word.law, scaled), table=whole, shifts=shifts)


def state_scales(word: Word) -> Real:
    """Return powers of 2 beyond the bounds of the states, or where there is none by u.

    Raises ParameterError for a state without a scale.
    """
    E = word.sizes
    S = word.table
    n = word.law.order
    A = S[:n, :n]
    B = S[:n, n:]
    X, is_whole = absolute_sum(A, np.eye(n), B)
    size = X @ E
    if not is_whole:
        # a state without a bound saturates beyond four ranges of u
        with np.errstate(divide="ignore"):
            of_output = 4 * word.output / abs(S[n, :n])
        # a state whose sum still grows has the scale of u
        earlier, _ = absolute_sum(A, np.eye(n), B, MOST_SUMMED // 2)
        is_bound = np.isfinite(size) & (size <= (1 + 1e-9) * (earlier @ E))
        of_output[is_bound] = np.inf
        size = np.minimum(size, of_output)
    if not np.isfinite(size).all():
        poles, vectors = np.linalg.eig(A)
        remedy = (
            f"ill-conditioned or unstable in z: modulus of its poles up to {max(abs(poles)):.4g} in double, condition "
            f"number of their eigenvectors {np.linalg.cond(vectors):.2g}; q31 needs states with a bound: give the law "
            "in s, or in z as a state space of sections in cascade"
        )
        raise ParameterError(key="law", value=word.law.name, remedy=remedy)
    # with room for roundings
    return np.asarray(np.exp2(np.ceil(np.log2((1 + 2.0**-10) * np.maximum(size, 2.0**-100)))))
