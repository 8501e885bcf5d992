"""Numbers as text: significant digits, a true minus sign, powers of ten."""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

# of a decimal number that a double preserves
DOUBLE_DIGITS = 15
# from the values of a column to its cells
CellsOf = Callable[[Sequence[Any]], Sequence[str]]


def singly(how: Callable[..., str], *digits: int) -> CellsOf:
    """Return a format of each number by itself, `how(value, *digits)`; texts are unchanged."""
    return lambda values: [value if isinstance(value, str) else how(value, *digits) for value in values]


def column_format(digits: int, least: int) -> CellsOf:
    """Return a format of a column by `align_decimals`."""
    return partial(align_decimals, digits=digits, least=least)


# words and whole numbers as they are
TEXTS = singly(str)


def general(x: float, digits: int) -> str:
    """Return `x` with at most `digits` significant digits: 71.5057, 1.8e-09, inf."""
    return f"{x:.{digits}g}"


def significant(x: float, digits: int) -> str:
    """Return `x` with exactly `digits` significant digits: 71.505682, 1.800 × 10⁻⁹."""
    # outside, numbers have powers of ten
    least_plain = 1e-3
    most_plain = 1e7
    if not x:
        return "0"
    if not least_plain <= abs(x) < most_plain:
        return scientific(x, digits)
    decimals = max(0, digits - 1 - _exponent(x, digits))
    return _typeset(f"{x:.{decimals}f}")


def plain(x: float, digits: int = 10) -> str:
    """Return `x` without trailing zeros: 2766.7, 6.8944 × 10¹⁰."""
    number, times, power = significant(x, digits).partition(" ×")
    if "." in number:
        number = number.rstrip("0").rstrip(".")
    return f"{number}{times}{power}"


def scientific(x: float, digits: int) -> str:
    """Return `x` as a power of ten: 5.7456 × 10⁶."""
    return _typeset(f"{x:.{digits - 1}e}") if x else "0"


def align_decimals(values: Iterable[float], digits: int, *, least: int = 6) -> tuple[str, ...]:
    """Return a column with a common number of decimals: the largest with `digits` digits, the smallest with `least`.

    Where that needs too many decimals, each number has `digits` digits of its own (`significant`).
    """
    column = list(values)
    sizes = [abs(x) for x in column if x and math.isfinite(x)] or [1.0]
    top = _exponent(max(sizes), digits)
    decimals = max(0, digits - 1 - top, least - 1 - _exponent(min(sizes), least))
    # two more digits of the largest number than asked for, and seven decimals
    if top + decimals > digits + 1 or decimals > 7 or top > 7:
        return tuple(significant(x, digits) for x in column)
    return tuple(_typeset(f"{x:.{decimals}f}") if x else "0" for x in column)


def fix_decimals(values: Iterable[float], decimals: int) -> tuple[str, ...]:
    """Return a column with that many decimals; zero has no sign."""
    return tuple(_typeset(f"{x:.{decimals}f}") for x in values)


def kept_digits(values: Iterable[float], digits: int) -> list[float]:
    """Return numbers rounded to `digits` significant digits, independent of the processor."""
    return [float(f"{value:.{digits - 1}e}") for value in values]


def round_to_error(value: float, error: float, most: int) -> str:
    """Return a number with the digits above an absolute error, at most `most`; without any, 0 and the error."""
    if value == 0:
        return "0"
    digits = math.floor(math.log10(abs(value) / error))
    if digits > 0:
        return general(value, min(digits, most))
    return f"0 (+-{error:.0e})"


def how_many(count: float, what: str) -> str:
    """Return a number and its noun: no poles, 1 pole, 2 poles."""
    number = plain(count) if count else "no"
    return f"{number} {what}{'s' * (count != 1)}"


def join_words(words: Sequence[str]) -> str:
    """Return words with commas and an "and" before the last."""
    if len(words) == 1:
        return words[0]
    return f"{', '.join(words[:-1])} and {words[-1]}"


def powers(text: str) -> str:
    """Return a text with powers of ten: 1.8 × 10⁻⁹ for 1.8e-9."""
    number = r"(?<![\w.])(\d(?:\.\d+)?)e([-+]?\d{1,3})(?!\w|\.\d)"
    return re.sub(number, lambda found: f"{found[1]} × 10{_superscript(str(int(found[2])))}", text)


def unit(text: str) -> str:
    """Return a unit with exponents: m² for m^2."""
    return re.sub(r"\^(-?\d)", lambda power: _superscript(power[1]), text)


def _superscript(text: str) -> str:
    """Return a whole number as an exponent."""
    return text.translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _exponent(x: float, digits: int) -> int:
    """Return the power of ten of `x` rounded to `digits` digits."""
    return int(f"{x:.{digits - 1}e}".partition("e")[2])


def _typeset(text: str) -> str:
    """Return a number with a true minus sign, none of zero, and a power of ten."""
    if not text.strip("-0."):
        text = text.lstrip("-")
    return powers(text).replace("-", "−").replace("inf", "∞")
