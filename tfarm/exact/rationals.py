"""Doubles as exact rational numbers (FLINT): definite matrices, and blocks of a law as polynomials in s and in z.

Zeros and poles in z of a block are in delta = z - 1:

    tustin   s - r = (c - r)(delta - 2 r/(c - r))/(delta + 2), and s - c = -2 c/(delta + 2)
    matched  delta = e^{rT} - 1, with the same value at rest
    zoh      poles so; zeros of C(z): det(z - Phi + Gamma C) + (D - 1) det(z - Phi), in balls
    none     a block in z: roots of num(1 + delta) and den(1 + delta)
    s        a block in s as it is, with the roots themselves

Each has an error of some last bits of delta, also in a cluster, and one at z = 1 is 0.
"""

from collections.abc import Sequence
from typing import Any

import flint
import numpy as np

from tfarm.arm.blocks import LawBlock, Rational
from tfarm.arrays import Complex, Real
from tfarm.exact.balls import exact_middle, fraction, precision

# flint.fmpq_mat or flint.fmpz_mat, which come without types
Matrix = Any


def exact_matrix(matrix: Real) -> Matrix:
    """Return a matrix of doubles over the rationals."""
    rows, columns = matrix.shape
    return flint.fmpq_mat(rows, columns, [fraction(each) for each in matrix.ravel().tolist()])


def is_positive_definite(matrix: Matrix) -> bool:
    """Whether a symmetric matrix of integers has only positive leading minors, the pivots of Bareiss' elimination."""
    permutation, _, _, upper = matrix.fflu()
    return permutation.is_one() and all(upper[k, k] > 0 for k in range(matrix.nrows()))


def falls(P: Matrix, A: Real) -> bool:
    """Whether P - A^T P A > 0, P of integers."""
    numbers, unit = exact_matrix(A).numer_denom()
    return is_positive_definite(P * unit**2 - numbers.transpose() * P * numbers)


# delta of z = -1, the image of s = infinity under Tustin's rule
AT_MINUS_ONE = -2.0

# g and the zeros of g prod(delta - zeros)
Gained = tuple[float, Complex]


def block_factors(block: LawBlock, rule: str, T: float, c: float) -> tuple[Complex, list[Gained]]:
    """Return the poles of a block in z, and the factor and the zeros of each of its signals, all as delta.

    `rule` is that of its discretisation with the period `T` [s], "none" of one in z; `c` [1/s] is Tustin's 2/T.
    With the rule "s" they are the roots in s.
    """
    nums, den = polynomials(block)
    if rule in ("none", "s"):
        shift = flint.fmpq_poly([int(rule == "none"), 1])
        return _roots(den(shift)), [(_leading_ratio(num, den), _roots(num(shift))) for num in nums]
    s = _roots(den)
    if rule == "tustin":
        most = max(each.degree() for each in (den, *nums))
        poles = np.r_[2 * s / (c - s), np.full(most - s.size, AT_MINUS_ONE)]
        return poles, [_tustin_zeros(num, den, c, most) for num in nums]
    if rule == "matched" or not block.order:
        return np.expm1(s * T), [_matched_zeros(num, den, T) for num in nums]
    return np.expm1(s * T), _held_zeros(nums, den, T)


# ------------------------------------------------------------ polynomials over the rationals


def polynomials(block: LawBlock) -> tuple[list[Any], Any]:
    """Return the numerator of each signal j and the denominator of a block, over the rationals (`flint.fmpq_poly`).

    Those of matrices are det(s - A + B_j C) + (D_j - 1) det(s - A) and det(s - A).
    """
    if isinstance(block, Rational):
        return [_polynomial(block.num)], _polynomial(block.den)
    matrices = block.matrices()
    A, _, C, D = map(exact_matrix, matrices)
    den = A.charpoly()
    nums = []
    for j, column in enumerate(matrices[1].T):
        B_j = exact_matrix(column[:, None])
        nums.append((A - B_j * C).charpoly() + (D[0, j] - 1) * den)
    return nums, den


def _polynomial(coefficients: Sequence[float]) -> Any:
    """Return the polynomial over the rationals with these coefficients, the leading one first."""
    return flint.fmpq_poly([fraction(each) for each in reversed(coefficients)])


def _zeros_at_0(polynomial: Any) -> int:
    """Return the order of the zero at 0 of a polynomial other than 0."""
    return next(n for n, each in enumerate(polynomial.coeffs()) if each)


def _roots(polynomial: Any) -> Complex:
    """Return the roots to the last bit, with multiplicity; none of 0."""
    if polynomial.degree() < 1:
        return np.empty(0, complex)
    found = [complex(root) for root, times in polynomial.complex_roots() for _ in range(times)]
    return np.array(found, dtype=complex)


def _leading_ratio(num: Any, den: Any) -> float:
    """Return the ratio of the leading coefficients, whose parts may be larger than any double."""
    if not num:
        return 0.0
    ratio = num.leading_coefficient() / den.leading_coefficient()
    return int(ratio.p) / int(ratio.q)


# ------------------------------------------------------------ rules


def _tustin_zeros(num: Any, den: Any, c: float, most: int) -> Gained:
    """Return gain and zeros of num/den with s = c delta/(delta + 2), both times (delta + 2)^most.

    A zero at s = c, which is at z = infinity, is the factor -2 c/(delta + 2).
    """
    zeros = _roots(num)
    poles = _roots(den)
    at_infinity = zeros == c
    # exact differences next to c
    of_zeros = np.where(at_infinity, -2.0, (c - zeros) / c)
    of_poles = (c - poles) / c
    gain = _leading_ratio(num, den) * np.prod(of_zeros) / np.prod(of_poles) * c ** (zeros.size - poles.size)
    finite = zeros[~at_infinity]
    images = 2 * finite / (c - finite)
    if num:
        images = np.r_[images, np.full(most - zeros.size, AT_MINUS_ONE)]
    return float(gain.real), images


def _matched_zeros(num: Any, den: Any, T: float) -> Gained:
    """Return gain and zeros with e^{rT} for every root r; at rest both agree, as powers of s and delta/T."""
    zeros = _roots(num)
    poles = _roots(den)

    def growth(roots: Complex) -> complex:
        """Return prod((e^{rT} - 1)/(r T)) of the roots other than 0."""
        x = roots[roots != 0] * T
        return complex(np.prod(np.expm1(x) / x))

    gain = _leading_ratio(num, den) * growth(poles) / growth(zeros) * T ** (poles.size - zeros.size)
    return float(gain.real), np.expm1(zeros * T)


def _held_zeros(nums: list[Any], den: Any, T: float) -> list[Gained]:
    """Return gain and zeros of each signal behind a zero-order hold."""
    # of the first precision of a held block, which is doubled
    bits_a_state = 64
    spare_states = 8
    with precision(bits_a_state * (den.degree() + spare_states)):
        held = [_held_numerator(num, den, fraction(T)) for num in nums]
    return [(_leading_ratio(each, flint.fmpq_poly([1])), _roots(each)) for each in held]


def _held_numerator(num: Any, den: Any, T: Any) -> Any:
    """Return the polynomial in delta of a signal, over the rationals, with coefficients of 80 bits.

    For a block without a value at rest it has a simple zero at delta = 0.
    """
    # more than a double
    enough_bits = 80
    # of the precision: a coefficient without digits by then is 0
    most_doublings = 5
    known = 0
    if num:
        known = min(_zeros_at_0(num), _zeros_at_0(den) + 1)
    for _ in range(most_doublings):
        balls = _held_coefficients(num, den, T)[known:]
        if not num or all(each.rel_accuracy_bits() >= enough_bits for each in balls):
            break
        flint.ctx.prec *= 2
    middles = [flint.fmpq(0) if each.contains(0) else exact_middle(each) for each in balls]
    leading = num[den.degree()] / den.leading_coefficient()
    return flint.fmpq_poly([*[0] * known, *middles, leading])


def _held_coefficients(num: Any, den: Any, T: Any) -> list[Any]:
    """Return those of delta^0 to delta^(n - 1), n the order, as balls, from num/den in controllable form."""
    n = den.degree()
    first = den.leading_coefficient()
    D = num[n] / first
    down = range(n - 1, -1, -1)
    C = [(num[k] - D * den[k]) / first for k in down]
    first_row = [*(-den[k] * T / first for k in down), T]
    chain = [[T if k == i else 0 for k in range(n + 1)] for i in range(n - 1)]
    both = flint.arb_mat([first_row, *chain, [0] * (n + 1)]).exp().tolist()
    less = flint.arb_mat([[both[i][k] - int(i == k) for k in range(n)] for i in range(n)])
    fed = flint.arb_mat([[both[i][n] * c for c in C] for i in range(n)])
    p = (less - fed).charpoly()
    q = less.charpoly()
    return [p[k] + (flint.arb(D) - 1) * q[k] for k in range(n)]
