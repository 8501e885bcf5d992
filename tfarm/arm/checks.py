"""The checks of a single number, each made once, where a record is built.

Everywhere `key` is the name as in the TOML file and `meaning` says, in the language of physics, what
would be right.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from numbers import Integral, Real

from tfarm.errors import ParameterError

SMALLEST_NUMBER = 1e-40  # far outside any arm, yet no product of a few such numbers underflows
LARGEST_NUMBER = 1e40  # nor overflows


def number(key: str, value: object, meaning: str) -> float:
    """`value` as a float; a bool, a text or nan is refused."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ParameterError(key=key, value=value, remedy=f"{meaning}; write a plain number, no text or true")
    try:
        x = float(value)
    except OverflowError:
        raise _too_far(key, value) from None
    if math.isnan(x):
        raise ParameterError(key=key, value=value, remedy=f"{meaning}; nan is none")
    return x


def whole(key: str, value: object, least: int, most: float, remedy: str) -> int:
    """A whole number from `least` to `most`; NumPy's are welcome, a bool or a text is none.

    `remedy` says all of what would be right.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= int(value) <= most:
        raise ParameterError(key=key, value=value, remedy=remedy)
    return int(value)


def positive(key: str, value: object, meaning: str) -> float:
    """A number above zero, finite and of a sane magnitude."""
    x = number(key, value, meaning)
    if x <= 0.0 or math.isinf(x):
        raise ParameterError(key=key, value=x, remedy=meaning)
    if not SMALLEST_NUMBER <= x <= LARGEST_NUMBER:
        raise _too_far(key, x)
    return x


def not_negative(key: str, value: object, meaning: str) -> float:
    """Zero, or a positive number."""
    x = number(key, value, meaning)
    return 0.0 if x == 0.0 else positive(key, x, meaning)


def signed(key: str, value: object, meaning: str) -> float:
    """Zero, or a finite number of either sign."""
    x = number(key, value, meaning)
    if math.isinf(x):
        raise ParameterError(key=key, value=x, remedy=meaning)
    if x != 0.0 and not SMALLEST_NUMBER <= abs(x) <= LARGEST_NUMBER:
        raise _too_far(key, x)
    return x + 0.0  # -0.0 becomes 0.0


def extended(key: str, value: object, meaning: str) -> float:
    """Zero, a positive number, or inf."""
    x = number(key, value, meaning)
    return x if x == math.inf else not_negative(key, x, meaning)


def check_fields(
    record: object, kind: str, check: Callable[[str, object, str], float], meanings: Mapping[str, str]
) -> None:
    """Each of these fields of a frozen record as one of the checks above leaves it, under the key `kind.field`."""
    for name, meaning in meanings.items():
        key = f"{kind}.{name}" if kind else name
        object.__setattr__(record, name, check(key, getattr(record, name), meaning))


def _too_far(key: str, value: object) -> ParameterError:
    remedy = f"beyond any arm ({SMALLEST_NUMBER:g} to {LARGEST_NUMBER:g}); check the unit: m, kg, s, Pa throughout"
    return ParameterError(key=key, value=value, remedy=remedy)
