"""The smallest lossless model: the band's own modes exactly, all modes above it by a few poles from AAA in s^2.

At C = 0 every output over a power of s is a real function of S = s^2.  What is left of it after the modes of the band
is the share of the modes above, smooth over the band, and for the hub angle a Stieltjes function: a sum of
b^2 S/(S + w^2) with b^2 > 0, so that its rational interpolants have poles on the negative axis and residues of one sign
(Baker and Graves-Morris, Pade Approximants, 1996, ch. 5).  AAA (Nakatsukasa, Sete and Trefethen 2018), here for several
functions with common poles (Lietaert et al. 2022), finds such poles to near the smallest error; S = 0 is always a
support point, so rigid body and statics stay exact.  Rounding can add poles that mean nothing (Froissart doublets):
every pole is checked to be real and above the band, every residue of the hub angle to be positive, or it is left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.errors import ParameterError
from tfarm.exact.series import expansions_at_zero
from tfarm.response import TransferFunction, Wanted, transfer
from tfarm.spectrum import modes_below

from .modal import MOST_MODELLED, modal_model
from .partial_fractions import PartialFractions, distance, frequencies_around, norm

BEYOND_BAND = 1.02  # modes up to so much above the band's end are taken exactly: a pole nearer to the band would show
REMAINDER_POINTS = 300  # of the band, denser towards its end, where poles above it show most
REMAINDER_FROM = 0.01  # of the band's end: below, the point S = 0 says all there is to say
BESIDE_POLE = 1e-9  # of its frequency: no sample is nearer to a pole of the arm
INFINITE_BELOW = 1e-13  # of the numerator: an eigenvalue with a smaller denominator is infinite but for rounding
SHARING_ROUNDS = 4  # in which pairs that AAA did not need are given to modes
REAL_SQUARE = 1e-10  # relative; a pole whose imaginary part is below it is real
PATIENCE = 3  # degrees without progress, after which rounding rules
ERRORS_ALIKE = 5e-14  # errors below this are all alike
ERROR_FLOOR = 1e-14  # a weighted error below this is rounding; more poles would fit noise


@dataclass(frozen=True)
class _Remainders:
    """What the exact modes leave, F (outputs, S), zero at S = 0; weights that make it |dG|/(|G| + |w G'|).

    `by_S` (outputs,) tells which outputs are multiplied by S; the hub's own, rate or (locked) moment, comes first.
    Poles lie above `beyond` [rad/s].
    """

    S: Real
    F: Real
    weight: Real
    by_S: NDArray[np.bool_]
    beyond: float


def modes_in(arm: Arm, high: float) -> int:
    """How many modes a model for frequencies up to `high` [rad/s] takes exactly.  Raises ParameterError over 1000."""
    count = modes_below(arm, BEYOND_BAND * high)
    if count > MOST_MODELLED:
        remedy = f"{count} modes lie below it, over {MOST_MODELLED}; lower it"
        raise ParameterError(key="band", value=high, remedy=remedy)
    return count


def rational_model(arm: Arm, outputs: Wanted, pairs: int, high: float, x: float | None = None) -> PartialFractions:
    """The lossless model of so many pairs of poles: every mode below `high` [rad/s] exactly, the rest by AAA.

    Where more poles bring nothing but rounding, further modes are taken exactly instead; fewer pairs come out where too
    few poles pass the checks.  Raises ParameterError at C > 0, where poles do not lie on one line in s^2, and where
    `pairs` does not exceed the modes below `high`.
    """
    if not arm.is_undamped or arm.input_lags:
        raise ParameterError(key="method", value="aaa", remedy="AAA in s^2 is for C = 0; take modal, which has C")
    exact = modes_in(arm, high)
    if pairs <= exact:
        remedy = f"{exact} modes lie in the band: AAA wants more pairs of poles than that; take modal"
        raise ParameterError(key="pairs", value=pairs, remedy=remedy)
    rows = transfer(arm, outputs, x=x).rows
    hub = "root_moment" if arm.is_locked else "hub_rate"
    G = transfer(arm, (hub, *rows), x=x)
    frequencies = frequencies_around(arm, high)
    found: list[tuple[tuple[float, int], PartialFractions]] = []
    for _ in range(SHARING_ROUNDS):  # first with all the poles asked for, then with those that helped
        inside = modal_model(arm, G.rows, exact, x)
        rest = _remainders(G, inside, high, frequencies)
        poles, shares, error = _best_poles(rest, pairs - exact)
        found.append(((max(error, ERRORS_ALIKE), -exact - poles.size), _assembled(inside, rest, poles, shares)))
        if exact + poles.size == pairs:
            break
        exact = pairs - poles.size
    return min(found, key=lambda entry: entry[0])[1]


def _remainders(G: TransferFunction, inside: PartialFractions, high: float, frequencies: Real) -> _Remainders:
    """Samples over the band.  Below high/100 the point S = 0 says all there is to say."""
    w = high * np.sin(np.linspace(REMAINDER_FROM, np.pi / 2, REMAINDER_POINTS))
    w = w[distance(w, frequencies) > BESIDE_POLE * w]
    S, power = -(w**2), np.array([[each.power] for each in G.rows])
    bases = [each.base for each in G.rows]
    at_zero = np.array(expansions_at_zero(G.system, bases, G.share))
    by_S = ((at_zero[:, 0] != 0) | (power[:, 0] > 0))[:, None]
    square = inside.natural_frequency**2
    p = inside.eigenvalues[:, 0]
    r = (inside.residues[..., 0] * 2 * p / p**power).real  # of each output over its power of s, in the variable S
    values = G(1j * w)
    base = (values / (1j * w) ** power).real
    shared = 1 / (S + square[:, None])
    F = np.where(by_S, base * S - at_zero[:, :1] - (r @ shared) * S, base - at_zero[:, 2:3] + (r / square @ shared) * S)
    size = norm(G, w, values)
    weight = np.divide(w**power, size, out=np.zeros_like(size), where=size > 0) / np.where(by_S, abs(S), 1.0)
    kinds = [(each.quantity, each.place, kind) for each, kind in zip(bases, by_S[:, 0], strict=True)]
    for kind in set(kinds):  # a power of s apart: one fit for both, or the rate would not be that of the angle
        same = [row for row, other in enumerate(kinds) if other == kind]
        F[same], weight[same] = F[same[0]], weight[same].max(axis=0)
    beyond = max(high, inside.natural_frequency.max(initial=0.0))
    return _Remainders(S, F, weight, by_S[:, 0], beyond)


def _best_poles(rest: _Remainders, most: int) -> tuple[Real, Real, float]:
    """Frequencies of up to so many poles that pass the checks, their shares a of F ~ sum of a S/(S + w^2), the error.

    Of the degrees tried the one with the smallest error, or the first at which only rounding is left.
    """
    best = np.empty(0), np.empty((len(rest.F), 0))
    least, idle = float((abs(rest.F) * rest.weight).max()), 0
    for square in aaa_poles(rest.S, rest.F, rest.weight, most):
        square, shares = _checked(rest, square[square > rest.beyond**2])
        error = float((abs(shares @ _basis(rest, square).T - rest.F) * rest.weight).max())
        idle += 1
        if error < least:
            best, least, idle = (np.sqrt(square), shares), error, 0
        if least < ERROR_FLOOR or idle == PATIENCE:
            break
    return *best, least


def _checked(rest: _Remainders, square: Real) -> tuple[Real, Real]:
    """The poles without those whose residue in the hub's own output has the wrong sign, and the shares of the rest.

    Shares (outputs, poles) by weighted least squares for each output.
    """
    sign = 1.0 if rest.by_S[0] else -1.0
    while True:
        basis, shares = _basis(rest, square), np.empty((len(rest.F), square.size))
        for row, (F, weight) in enumerate(zip(rest.F, rest.weight, strict=True)):
            columns = basis * weight[:, None]
            size = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
            shares[row] = np.linalg.lstsq(columns / size, F * weight)[0] / size
        wrong = np.flatnonzero(sign * shares[0] < 0)
        if not wrong.size:
            return square, shares
        square = np.delete(square, wrong[-1])


def _basis(rest: _Remainders, square: Real) -> Real:
    return rest.S[:, None] / (rest.S[:, None] + square)


def aaa_poles(S: Real, F: Real, weight: Real, degree: int) -> Iterator[Real]:
    """-S at the real negative poles, ascending, of the AAA approximants of degree 1, 2, ... to all rows of F.

    F (functions, S) vanishes at S = 0, which is the first support point; the others are taken where the weighted error
    is largest, and their weights minimise the linearised one (smallest singular vector of the Loewner matrix).
    """
    unit = abs(S).max()
    S, F = np.r_[0.0, S / unit], np.c_[np.zeros(len(F)), F]
    weight = np.c_[np.zeros(len(F)), weight]
    support, error = [0], abs(F) * weight
    for _ in range(degree):
        support.append(int(error.max(axis=0).argmax()))
        others = np.setdiff1d(np.arange(S.size), support)
        cauchy = 1 / (S[others, None] - S[support])
        loewner = (F[:, others, None] - F[:, None, support]) * cauchy * weight[:, others, None]
        (triangle,) = scipy.linalg.qr(loewner.reshape(-1, len(support)), mode="r")
        w = scipy.linalg.svd(triangle[: len(support)])[2][-1]
        fit = ((w * F[:, support]) @ cauchy.T) / (cauchy @ w)
        error = np.zeros_like(F)
        error[:, others] = abs(fit - F[:, others]) * weight[:, others]
        poles = -_zeros_of_denominator(S[support], w) * unit
        yield np.sort(poles.real[(abs(poles.imag) <= REAL_SQUARE * abs(poles)) & (poles.real > 0)])


def _zeros_of_denominator(nodes: Real, weights: Real) -> NDArray[Any]:
    """Zeros of sum w_j/(S - S_j): the finite eigenvalues of an arrowhead pencil."""
    n = nodes.size
    arrow = np.zeros((n + 1, n + 1))
    arrow[0, 1:], arrow[1:, 0] = weights, 1.0
    arrow[1:, 1:] = np.diag(nodes)
    mass = np.eye(n + 1)
    mass[0, 0] = 0.0
    numerator, denominator = scipy.linalg.eigvals(arrow, mass, homogeneous_eigvals=True)
    finite = abs(denominator) > INFINITE_BELOW * abs(numerator)
    return numerator[finite] / denominator[finite]


def _assembled(inside: PartialFractions, rest: _Remainders, poles: Real, shares: Real) -> PartialFractions:
    """The exact modes and the poles above them as one model, without the hub's own output."""
    power = np.array([[each.power] for each in inside.rows])
    s = 1j * poles
    in_S = np.where(rest.by_S[:, None], shares, -shares * poles**2)
    upper = in_S * s**power / (2 * s)
    added = np.stack([upper, upper.conj()], axis=2)
    ends = np.stack([s, s.conj()], axis=1)
    static = inside.static + (added / ends).real.sum(axis=(1, 2))
    strict = rest.by_S & (power[:, 0] < 2)  # no static remainder: the poles above the band stand for it
    return PartialFractions(
        arm=inside.arm,
        rows=inside.rows[1:],
        x=inside.x,
        index=np.r_[inside.index, np.zeros(poles.size, dtype=np.int64)],
        natural_frequency=np.r_[inside.natural_frequency, poles],
        eigenvalues=np.concatenate([inside.eigenvalues, ends]),
        residues=np.concatenate([inside.residues, added], axis=1)[1:],
        rigid=inside.rigid[1:],
        static=np.where(strict, 0.0, static)[1:],
        participation=np.r_[inside.participation, np.sqrt(abs(in_S[0]))],
    )
