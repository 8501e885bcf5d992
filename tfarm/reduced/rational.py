"""The smallest lossless model: the modes of a frequency range exactly, those above it by a few poles from AAA in s^2.

At C = 0 every output over a power of s is a real function of S = s^2.  Without the modes of the range it is the sum of
the modes above, smooth over the range.  For the hub angle that is a Stieltjes function, a sum of b^2 S/(S + w^2) with
b^2 > 0: its rational interpolants have poles on the negative axis and residues of one sign (Baker and Graves-Morris,
Pade Approximants, 1996, ch. 5).  AAA (Nakatsukasa, Sete and Trefethen 2018), here for several functions with common
poles (Lietaert et al. 2022), finds such poles near the smallest error.  S = 0 is always a support point, so rigid body
and statics stay exact.  Rounding can add spurious poles (Froissart doublets): only poles that are real, above the range
and with a positive residue of the hub angle are used.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.errors import require
from tfarm.exact.series import expansion_at_zero
from tfarm.reduced.modal import MOST_MODELLED, modal_model, powers_of
from tfarm.reduced.partial_fractions import (
    PartialFractions,
    frequencies_around,
    is_clear_of,
    sum_at_rest,
    values_and_norm,
)
from tfarm.response import TransferFunction, Wanted, transfer
from tfarm.spectrum import modes_below


@dataclass(frozen=True)
class _Remainders:
    """The remainders F (outputs, S) of the exact modes, zero at S = 0; with the weights it is |dG|/(|G| + |w G'|).

    `by_S` (outputs,) is whether an output is multiplied by S; that of the hub, rate or (locked) moment, comes first.
    Poles are above `beyond` [rad/s].
    """

    S: Real
    F: Real
    weight: Real
    by_S: NDArray[np.bool_]
    beyond: float


def modes_in(arm: Arm, high: float) -> int:
    """Return the number of exact modes of a model up to `high` [rad/s].  Raises ParameterError over 1000."""
    # 1.02 times the end of the range: up to there modes are exact
    count = modes_below(arm, 1.02 * high)
    require(
        count <= MOST_MODELLED, "band", high, f"{count} modes lie below it, over {MOST_MODELLED}; lower it"
    )
    return count


def has_rational(arm: Arm) -> bool:
    """Whether the poles are on one line in s^2."""
    return arm.is_undamped and not arm.input_lags


def rational_model(
    arm: Arm, outputs: Wanted, pairs: int, high: float, x: float | None = None
) -> PartialFractions:
    """Return the lossless model of `pairs` pairs of poles: modes below `high` [rad/s] exactly, the rest by AAA.

    Pairs that would fit rounding become more exact modes.  There are fewer pairs where too few poles pass the checks.
    Raises ParameterError at C > 0, where poles are not on one line in s^2, and for too few pairs.
    """
    require(has_rational(arm), "method", "aaa", "AAA in s^2 is for C = 0; use modal")
    exact = modes_in(arm, high)
    remedy = f"{exact} modes lie in the range, and AAA needs more pairs of poles; use modal"
    require(pairs > exact, "pairs", pairs, remedy)
    rows = transfer(arm, outputs, x=x).rows
    hub = "root_moment" if arm.is_locked else "hub_rate"
    G = transfer(arm, (hub, *rows), x=x)
    frequencies = frequencies_around(arm, high)
    best = np.inf, 0
    # four times, first with all poles, then with the used ones: unused pairs of AAA become modes
    for _ in range(4):
        inside = modal_model(arm, G.rows, exact, x)
        rest = _remainders(G, inside, high, frequencies)
        poles, shares, error = _best_poles(rest, pairs - exact)
        found = exact + poles.size
        # 5e-14: errors below this are equal
        rank = max(error, 5e-14), -found
        if rank < best:
            best = rank
            model = _join_models(inside, rest, poles, shares)
        if found == pairs:
            break
        exact = pairs - poles.size
    return model


def _remainders(G: TransferFunction, inside: PartialFractions, high: float, frequencies: Real) -> _Remainders:
    """Return the remainders at samples of the range."""
    # denser towards the end of the range, where poles above have most effect; below 1 % of it S = 0 is enough
    w = high * np.sin(np.linspace(0.01, np.pi / 2, 300))
    # none next to a pole of the arm
    w = w[is_clear_of(w, frequencies, 1e-9)]
    S = -(w**2)
    power = powers_of(G.rows)
    bases = [each.base for each in G.rows]
    at_zero = np.array([expansion_at_zero(G.system, base, G.share) for base in bases])
    by_S = (at_zero[:, :1] != 0) | (power > 0)
    square = inside.natural_frequency**2
    p = inside.eigenvalues[:, 0]
    # of each output over its power of s, in the variable S
    r = (inside.residues[..., 0] * 2 * p / p**power).real
    values, size = values_and_norm(G, w)
    base = (values / (1j * w) ** power).real
    shared = 1 / (S + square[:, None])
    # of an output times S, and of another
    of_S = base * S - at_zero[:, :1] - (r @ shared) * S
    of_1 = base - at_zero[:, 2:3] + (r / square @ shared) * S
    F = np.where(by_S, of_S, of_1)
    unit = np.divide(w**power, size, out=np.zeros_like(size), where=size > 0)
    weight = unit / np.where(by_S, abs(S), 1.0)
    kinds = [(each.quantity, each.place, kind) for each, kind in zip(bases, by_S.ravel(), strict=True)]
    # one fit for powers of s of one quantity: the rate stays that of the angle
    for kind in set(kinds):
        same = [row for row, other in enumerate(kinds) if other == kind]
        F[same] = F[same[0]]
        weight[same] = weight[same].max(axis=0)
    beyond = max(high, inside.natural_frequency.max(initial=0.0))
    return _Remainders(S, F, weight, by_S.ravel(), beyond)


def _best_poles(rest: _Remainders, most: int) -> tuple[Real, Real, float]:
    """Return frequencies w of up to `most` poles, their shares a of F ~ sum of a S/(S + w^2), and the error.

    Their degree is that with the smallest error, or the first with an error of rounding alone.
    """
    best = np.empty(0), np.empty((len(rest.F), 0))
    least = float((abs(rest.F) * rest.weight).max())
    idle = 0
    for square in aaa_poles(rest.S, rest.F, rest.weight, most):
        square, shares, error = _fit_shares(rest, square[square > rest.beyond**2])
        idle += 1
        if error < least:
            best = (np.sqrt(square), shares)
            least = error
            idle = 0
        # 1e-14: a weighted error below this is rounding; more poles would fit noise, as after three without progress
        if least < 1e-14 or idle == 3:
            break
    return *best, least


def _fit_shares(rest: _Remainders, square: Real) -> tuple[Real, Real, float]:
    """Return the poles with the right sign of their residue in the hub's output, their shares, and the error.

    Shares (outputs, poles) are those of weighted least squares for each output.
    """
    sign = 1.0 if rest.by_S[0] else -1.0
    while True:
        S = rest.S[:, None]
        basis = S / (S + square)
        shares = np.empty((len(rest.F), square.size))
        for row, (F, weight) in enumerate(zip(rest.F, rest.weight, strict=True)):
            columns = basis * weight[:, None]
            size = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
            shares[row] = np.linalg.lstsq(columns / size, F * weight)[0] / size
        wrong = np.flatnonzero(sign * shares[0] < 0)
        if not wrong.size:
            errors = abs(shares @ basis.T - rest.F) * rest.weight
            return square, shares, float(errors.max())
        square = np.delete(square, wrong[-1])


def aaa_poles(S: Real, F: Real, weight: Real, degree: int) -> Iterator[Real]:
    """Yield -S at the real negative poles, ascending, of the AAA approximants of degree 1, 2, ... to all rows of F.

    F (functions, S) vanishes at S = 0, which is the first support point; the others are taken where the weighted error
    is largest, and their weights minimise the linearised one (smallest singular vector of the Loewner matrix).
    """
    unit = abs(S).max()
    S = np.r_[0.0, S / unit]
    F, weight = (np.pad(each, ((0, 0), (1, 0))) for each in (F, weight))
    support = [0]
    error = abs(F) * weight
    for _ in range(degree):
        support.append(int(error.max(axis=0).argmax()))
        others = np.setdiff1d(np.arange(S.size), support)
        F_others = F[:, others]
        F_support = F[:, support]
        weight_others = weight[:, others]
        cauchy = 1 / (S[others, None] - S[support])
        loewner = (F_others[..., None] - F_support[:, None]) * cauchy * weight_others[..., None]
        (triangle,) = scipy.linalg.qr(loewner.reshape(-1, len(support)), mode="r")
        w = scipy.linalg.svd(triangle[: len(support)])[2][-1]
        fit = ((w * F_support) @ cauchy.T) / (cauchy @ w)
        error = np.zeros_like(F)
        error[:, others] = abs(fit - F_others) * weight_others
        # its finite eigenvalues are the zeros of sum w_j/(S - S_j)
        arrow = np.diag(np.r_[0.0, S[support]])
        arrow[0, 1:] = w
        arrow[1:, 0] = 1.0
        mass = np.diag(np.r_[0.0, np.ones(len(support))])
        numerator, denominator = scipy.linalg.eigvals(arrow, mass, homogeneous_eigvals=True)
        # 1e-13 of the numerator: an eigenvalue with a smaller denominator is infinite
        finite = abs(denominator) > 1e-13 * abs(numerator)
        poles = -numerator[finite] / denominator[finite] * unit
        # 1e-10: relative; a pole whose imaginary part is below it is real
        is_real = abs(poles.imag) <= 1e-10 * abs(poles)
        yield np.sort(poles.real[is_real & (poles.real > 0)])


def _join_models(inside: PartialFractions, rest: _Remainders, poles: Real, shares: Real) -> PartialFractions:
    """Return the exact modes and the poles above them as one model, without the hub's own output."""
    power = powers_of(inside.rows)
    s = 1j * poles
    in_S = np.where(rest.by_S[:, None], shares, -shares * poles**2)
    upper = in_S * s**power / (2 * s)
    added = np.stack([upper, upper.conj()], axis=2)
    ends = np.stack([s, s.conj()], axis=1)
    static = inside.static + sum_at_rest(added, ends)
    # the poles above replace the static remainder
    strict = rest.by_S & (power.ravel() < 2)
    model = inside.with_pairs(ends, added, np.where(strict, 0.0, static), np.sqrt(abs(in_S[0])))
    of_outputs = ("rows", "residues", "rigid", "static", "single_residues")
    return replace(model, **{name: getattr(model, name)[1:] for name in of_outputs})
