"""The blocks of a law: from one signal to the input as a ratio of polynomials, or from several as a state space.

Both have numerators and one denominator, polynomials in s [1/s], or in z for a discrete-time law.  So the
characteristic function of a loop has no pole at a pole of its controller.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tfarm.arm.checks import number
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError, require
from tfarm.records import frozen

Matrices = tuple[Real, Real, Real, Real]

# of one part: beyond it rounding of the coefficients moves the roots
MOST_DEGREE = 60


@dataclass(frozen=True, slots=True)
class Rational:
    """num(s)/den(s), coefficients in descending powers.  Raises ParameterError for other values, or den = 0."""

    num: tuple[float, ...]
    den: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        num = _polynomial("num", self.num)
        den = _polynomial("den", self.den)
        require(any(den), "den", list(den), "a denominator that is not 0 everywhere")
        object.__setattr__(self, "num", num)
        object.__setattr__(self, "den", den)

    @classmethod
    def of_roots(cls, zeros: ArrayLike, poles: ArrayLike, gain: float) -> Rational:
        """Build gain prod(s - zeros)/prod(s - poles), complex roots in conjugate pairs."""
        gain = number("gain", gain, "a finite number")
        return cls(tuple(gain * _of_roots("zeros", zeros)), tuple(_of_roots("poles", poles)))

    @property
    def signals(self) -> int:
        """The number of its signals."""
        return 1

    @property
    def order(self) -> int:
        """The number of its states, where it is proper."""
        return len(self.den) - 1

    @property
    def is_constant(self) -> bool:
        """Whether it is a number."""
        return len(self.num) == len(self.den) == 1

    @property
    def excess(self) -> int:
        """Degree of the numerator minus that of the denominator: above 0 it differentiates."""
        return len(self.num) - len(self.den)

    @property
    def poles(self) -> Complex:
        """The zeros of the denominator."""
        return np.roots(self.den).astype(complex)

    @property
    def zeros(self) -> Complex:
        """The zeros of the numerator."""
        return np.roots(self.num).astype(complex)

    def denominator(self, s: Complex) -> Complex:
        """Return den(s)."""
        return np.asarray(np.polyval(np.array(self.den), s))

    def numerators(self, s: Complex) -> Complex:
        """Return num(s) (1, n)."""
        return np.asarray(np.polyval(np.array(self.num), s))[None]

    def zeros_at_origin(self, signal: int) -> int | None:
        """Return the order of the numerator's zero at 0; None where it is 0 everywhere."""
        assert signal == 0
        return next((n for n, each in enumerate(reversed(self.num)) if each), None)

    def times(self, factor: float) -> Rational:
        """Return the block times a number."""
        return Rational(tuple(factor * each for each in self.num), self.den)

    def matrices(self) -> Matrices:
        """Return a state space (controllable form, balanced).  Raises ParameterError where it is not proper."""
        remedy = "of a higher degree than its denominator: it has no state space; add a pole"
        require(self.excess <= 0, "num", list(self.num), remedy)
        den = np.array(self.den) / self.den[0]
        num = np.r_[np.zeros(-self.excess), np.array(self.num) / self.den[0]]
        A = np.eye(self.order, k=-1)
        A[:1] = -den[1:]
        C = num[1:] - num[0] * den[1:]
        return balance_states(A, np.eye(self.order, 1), C[None], num[:1, None])


@frozen
class StateSpace:
    """x' = A x + B y, v = C x + D y from m signals y to the input v; for a discrete-time law x' is the next x.

    A (n, n), B (n, m), C (1, n), D (1, m).  Raises ParameterError for other shapes and numbers that are not finite.
    """

    A: Real
    B: Real
    C: Real
    D: Real
    # a name of Rational's, though without states it may be
    is_constant = False

    def __post_init__(self) -> None:
        for name in "ABCD":
            try:
                found = np.array(getattr(self, name), dtype=float, ndmin=2)
            except (TypeError, ValueError):
                raise ParameterError(key=name, value="matrix", remedy="rows of numbers") from None
            require(found.ndim == 2 and np.isfinite(found).all(), name, "matrix", "rows of finite numbers")
            object.__setattr__(self, name, found)
        m = self.signals
        # without states
        if not self.A.size:
            object.__setattr__(self, "A", np.empty((0, 0)))
            object.__setattr__(self, "B", np.empty((0, m)))
        n = self.order
        for name, shape in {"A": (n, n), "B": (n, m), "C": (1, n), "D": (1, m)}.items():
            own = getattr(self, name).shape
            remedy = f"{own}, expected {shape}: A (n, n), B (n, m), C (1, n), D (1, m)"
            require(own == shape, name, "matrix", remedy)
        require(n <= MOST_DEGREE, "A", n, f"at most {MOST_DEGREE} states are read")

    @property
    def signals(self) -> int:
        """The number of its signals."""
        return int(self.D.shape[1])

    @property
    def order(self) -> int:
        """The number of its states."""
        return len(self.A)

    @property
    def excess(self) -> int:
        """0 with a direct feedthrough, -1 without."""
        return 0 if self.D.any() else -1

    @cached_property
    def poles(self) -> Complex:
        """The eigenvalues of A."""
        return np.linalg.eigvals(self.A).astype(complex)

    def denominator(self, s: Complex) -> Complex:
        """Return det(s - A)."""
        return np.asarray(np.prod(s[..., None] - self.poles, axis=-1))

    def numerators(self, s: Complex) -> Complex:
        """Return det[[s - A, B_j], [-C, D_j]] (m, n): the transfer function from each signal j times det(s - A)."""
        n = self.order
        bordered = np.zeros((*np.shape(s), n + 1, n + 1), complex)
        bordered[..., :n, :n] = s[..., None, None] * np.eye(n) - self.A
        bordered[..., n, :n] = -self.C
        found = np.zeros((self.signals, *np.shape(s)), complex)
        # an empty column has 0
        for j in np.flatnonzero(self.B.any(axis=0) | self.D.any(axis=0)):
            bordered[..., :n, n] = self.B[:, j]
            bordered[..., n, n] = self.D[0, j]
            found[j] = np.linalg.det(bordered)
        return found

    def zeros_at_origin(self, signal: int) -> int | None:
        """Return the order of a numerator's zero at 0, from its growth between two tiny arguments.

        None where it is 0 at one of them.
        """
        # 1/s: there the numerator grows as its lowest power of s
        near = 1e-6 + 0j
        nearer = 1e-9 + 0j
        first, second = abs(self.numerators(np.array([near, nearer]))[signal])
        if not (first and second):
            return None
        return max(0, round(math.log(first / second) / math.log(abs(near / nearer))))

    def times(self, factor: float) -> StateSpace:
        """Return the block times a number."""
        return StateSpace(self.A, self.B, factor * self.C, factor * self.D)

    def matrices(self) -> Matrices:
        """Return A, B, C, D."""
        return self.A, self.B, self.C, self.D


LawBlock = Rational | StateSpace


def block_of(key: str, entry: Any) -> tuple[LawBlock, float | None]:
    """Return the block of an entry of a law, and its sampling period [s], None where it has none.

    An entry is a number; a pair (num, den); a mapping with zeros, poles and gain; python-control's TransferFunction or
    StateSpace with one output.  Raises ParameterError for anything else.
    """
    if isinstance(entry, Rational | StateSpace):
        return entry, None
    # python-control's: 0 of a continuous-time system, True of an unspecified period
    dt = getattr(entry, "dt", None)
    period = None if dt is None or dt is True or dt == 0 else float(dt)
    if all(hasattr(entry, name) for name in "ABCD"):
        system = StateSpace(entry.A, entry.B, entry.C, entry.D)
        # python-control's, with states of any size
        if hasattr(entry, "poles"):
            system = StateSpace(*balance_states(*system.matrices()))
        return system, period
    if hasattr(entry, "num") and hasattr(entry, "den"):
        remedy = "has several inputs or outputs; give one transfer function a signal, or matrices"
        require(len(entry.num) == len(entry.num[0]) == 1, key, type(entry).__name__, remedy)
        return Rational(_row(entry.num[0][0]), _row(entry.den[0][0])), period
    if isinstance(entry, dict):
        remedy = "a mapping holds gain, and zeros and poles where there are any"
        is_known = "gain" in entry and set(entry) <= {"zeros", "poles", "gain"}
        require(is_known, key, sorted(map(str, entry)), remedy)
        return Rational.of_roots(entry.get("zeros", ()), entry.get("poles", ()), entry["gain"]), None
    if isinstance(entry, tuple | list) and len(entry) == 2:
        try:
            return Rational(*map(_row, entry)), None
        except ParameterError as error:
            raise ParameterError(key=f"{key}.{error.key}", value=error.value, remedy=error.remedy) from None
    remedy = "a finite number, (num, den), a mapping with zeros, poles and gain, or a python-control system"
    return Rational((number(key, entry, remedy),)), None


def _row(part: ArrayLike) -> tuple[float, ...]:
    """Return the coefficients of a polynomial, also of a single number."""
    return tuple(np.atleast_1d(np.asarray(part, dtype=float)).tolist())


def balance_states(A: Real, B: Real, C: Real, D: Real) -> Matrices:
    """Return the same system with states of similar size: diagonal scaling by powers of 2."""
    if not len(A):
        return A, B, C, D
    from scipy.linalg import matrix_balance

    # SciPy also casts the scales to an unused permutation
    with np.errstate(invalid="ignore"):
        balanced_A, (scale, _) = matrix_balance(A, permute=False, separate=True)
    return np.asarray(balanced_A), B / scale[:, None], C * scale, D


def _polynomial(name: str, values: Any) -> tuple[float, ...]:
    """Return coefficients without leading zeros.  Raises ParameterError where one is not finite."""
    remedy = "numbers in descending powers, such as [1, 0.5]"
    is_row = isinstance(values, Sequence | np.ndarray) and not isinstance(values, str)
    require(is_row and len(values), name, values, remedy)
    found = [number(name, each, remedy) for each in values]
    # the square of one is still a double
    most = 1e150
    is_bounded = max(map(abs, found)) <= most
    require(is_bounded, name, found, f"finite numbers, at most {most:g} in size")
    while len(found) > 1 and found[0] == 0:
        found.pop(0)
    require(len(found) <= MOST_DEGREE + 1, name, len(found) - 1, f"a degree of at most {MOST_DEGREE}")
    return tuple(found)


def _of_roots(name: str, roots: ArrayLike) -> Real:
    """Return the monic real polynomial with these roots, (re, im) pairs or complex numbers, with their conjugates."""
    try:
        every: list[Any] = list(roots)  # type: ignore[arg-type]
        found = np.array(
            [complex(*each) if isinstance(each, tuple | list) else complex(each) for each in every]
        )
    except (TypeError, ValueError):
        remedy = "numbers, complex ones as [re, im], with their conjugates"
        raise ParameterError(key=name, value=roots, remedy=remedy) from None
    require(len(found) <= MOST_DEGREE, name, len(found), f"at most {MOST_DEGREE}")
    upper = np.sort_complex(found[found.imag > 0])
    lower = np.sort_complex(found[found.imag < 0].conj())
    is_paired = upper.size == lower.size and (abs(upper - lower) <= 1e-9 * abs(upper)).all()
    remedy = "a complex root without its conjugate: real coefficients need both"
    require(is_paired, name, [f"{each:g}" for each in found], remedy)
    return np.atleast_1d(np.poly(np.r_[upper, upper.conj(), found[found.imag == 0]]).real)
