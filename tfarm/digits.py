"""Numbers as a person reads them: sensible digits, a true minus sign, powers of ten, no NaN."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

POWER_OF_TEN = re.compile(r"(?<![\w.])(\d(?:\.\d+)?)e([-+]?\d{1,2})(?!\w|\.\d)")
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
DOUBLE_DIGITS = 15  # that a decimal number keeps on its way through a double
LEAST_PLAIN, MOST_PLAIN = 1e-3, 1e7  # outside, powers of ten read better
SPARE_DIGITS = 2  # digits beyond its own that the largest number of a column may have for the sake of the smallest
MOST_DECIMALS = 7  # of a column with one number of them; where more are needed each number has digits of its own
CellsOf = Callable[[Sequence[Any]], Sequence[str]]  # the values of a column to its cells


def singly(how: Callable[..., str], *digits: int) -> CellsOf:
    """Cells one by one: `how(value, *digits)` of each number; words stay as they are."""
    return lambda values: [value if isinstance(value, str) else how(value, *digits) for value in values]


def lined(digits: int, least: int) -> CellsOf:
    """Cells with one number of decimals, as `aligned` has them."""
    return partial(aligned, digits=digits, least=least)


TEXTS = singly(str)  # words and whole numbers as they are


def general(x: float, digits: int) -> str:
    """`x` as a terminal shows it, in at most so many significant digits: 71.5057, 1.8e-09, inf."""
    return f"{x:.{digits}g}"


def significant(x: float, digits: int) -> str:
    """`x` with exactly that many significant digits, e.g. 71.505682 or 1.800 × 10⁻⁹."""
    if x == 0 or math.isinf(x):
        return _special(x)
    if not LEAST_PLAIN <= abs(x) < MOST_PLAIN:
        return _power_of_ten(f"{x:.{digits - 1}e}")
    decimals = max(0, digits - 1 - _exponent(x, digits))
    return _signed(f"{x:.{decimals}f}")


def plain(x: float, digits: int = 10) -> str:
    """`x` as a person types it: no trailing zeros, e.g. 2766.7 or 6.8944 × 10¹⁰."""
    if x == 0 or math.isinf(x):
        return _special(x)
    if not LEAST_PLAIN <= abs(x) < MOST_PLAIN:
        return _power_of_ten(_bare(f"{x:.{digits - 1}e}"))
    return _signed(_bare(f"{x:.{max(0, digits - 1 - _exponent(x, digits))}f}"))


def aligned(values: Iterable[float], digits: int, *, least: int = 6) -> tuple[str, ...]:
    """A column with one number of decimals: the largest has `digits` digits, the smallest at least `least`.

    Where a small value asks for more decimals than the largest one has a use for, each has `digits` digits of its own,
    as a power of ten if that reads better.
    """
    column = [float(x) for x in values]
    finite = [abs(x) for x in column if x != 0 and math.isfinite(x)]
    if not finite:
        return tuple(_special(x) for x in column)
    top, bottom = _exponent(max(finite), digits), _exponent(min(finite), least)
    decimals = max(0, digits - 1 - top, least - 1 - bottom)
    if top + 1 + decimals > digits + SPARE_DIGITS or decimals > MOST_DECIMALS or top > 7:
        return tuple(significant(x, digits) for x in column)
    return tuple(_special(x) if x == 0 or math.isinf(x) else _signed(f"{x:.{decimals}f}") for x in column)


def fixed(values: Iterable[float], decimals: int) -> tuple[str, ...]:
    """A column with that many decimals; a value that rounds to zero keeps its sign off."""
    return tuple(_signed(f"{x:.{decimals}f}") for x in values)


def kept_digits(values: Iterable[float], digits: int) -> list[float]:
    """Numbers as a file has them whose last digits depend on the processor: rounded to so many significant digits."""
    return [float(f"{value:.{digits - 1}e}") for value in values]


def within(value: float, error: float, most: int) -> str:
    """A number in the digits that an absolute error leaves, at most so many; where it leaves none, 0 and the error."""
    if value == 0:
        return "0"
    digits = math.floor(math.log10(abs(value) / error))
    return general(value, min(digits, most)) if digits > 0 else f"0 (+-{error:.0e})"


def scientific(x: float, digits: int) -> str:
    """`x` as a power of ten, e.g. 5.7456 × 10⁶."""
    return _special(x) if x == 0 or math.isinf(x) else _power_of_ten(f"{x:.{digits - 1}e}")


def how_many(count: float, what: str) -> str:
    """How many of something: no poles, 1 pole, 2 poles."""
    return f"{plain(count) if count else 'no'} {what}{'s' * (count != 1)}"


def listed(words: Sequence[str]) -> str:
    """One, or several with commas and an "and" before the last."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def powers(text: str) -> str:
    """A text in which numbers as files have them are set: 1.8e-9 becomes 1.8 × 10⁻⁹."""
    return POWER_OF_TEN.sub(lambda number: f"{number[1]} × 10{str(int(number[2])).translate(SUPERSCRIPT)}", text)


def unit(text: str) -> str:
    """A unit with true exponents: m^2 becomes m²."""
    return re.sub(r"\^(-?\d)", lambda power: power[1].translate(SUPERSCRIPT), text)


def _exponent(x: float, digits: int) -> int:
    """The power of ten of `x` once it is rounded to `digits` digits."""
    return int(f"{x:.{digits - 1}e}".partition("e")[2])


def _special(x: float) -> str:
    return "0" if x == 0 else _signed("-∞" if x < 0 else "∞")


def _signed(text: str) -> str:
    is_zero = not text.strip("-0.")
    return text.lstrip("-") if is_zero else text.replace("-", "−")


def _bare(text: str) -> str:
    """Without trailing zeros."""
    mantissa, e, exponent = text.partition("e")
    return (mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa) + e + exponent


def _power_of_ten(text: str) -> str:
    mantissa, _, exponent = text.partition("e")
    return f"{_signed(mantissa)} × 10{str(int(exponent)).translate(SUPERSCRIPT)}"
