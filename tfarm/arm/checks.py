"""Checks of single numbers and texts, and the inputs and beam theories that an arm's file names.

Each check runs once, where a record is built.  `key` is the name in the TOML file, `meaning` the legal values in words.
"""

import math
import re
from collections.abc import Callable
from functools import cache
from numbers import Integral, Real
from typing import Any, Literal, cast, get_args, get_type_hints

import numpy as np

from tfarm.arrays import Real as Reals
from tfarm.errors import ParameterError, require

# far outside any arm, yet no product of a few such numbers overflows, nor underflows one over it
LARGEST_NUMBER = 1e40
Input = Literal["hub_torque", "motor_voltage", "motor_current", "hub_angle"]
INPUTS: tuple[Input, ...] = get_args(Input)
INPUT_UNITS = {"hub_torque": "N m", "motor_voltage": "V", "motor_current": "A", "hub_angle": "rad"}
# of key, value and the legal values in words
Check = Callable[[str, object, str], float | None]
# of the beam
Theory = Literal["timoshenko", "shear", "rayleigh", "euler-bernoulli"]
THEORIES: tuple[Theory, ...] = get_args(Theory)
WITH_ROTARY_INERTIA: tuple[Theory, ...] = ("timoshenko", "rayleigh")
WITH_SHEAR: tuple[Theory, ...] = ("timoshenko", "shear")


def number(key: str, value: object, meaning: str) -> float:
    """Return `value` as a float.  Raises ParameterError for a bool, a text or nan."""
    if type(value) is float and value == value:
        return value
    is_number = not isinstance(value, bool) and isinstance(value, Real)
    require(is_number, key, value, f"{meaning}; write a plain number, no text or true")
    try:
        x = float(cast("float", value))
    except OverflowError:
        raise _out_of_range(key, value) from None
    require(not math.isnan(x), key, value, f"{meaning}; nan is none")
    return x


def _out_of_range(key: str, value: object) -> ParameterError:
    """Return the error of a number of a size that no arm has."""
    limits = f"{1 / LARGEST_NUMBER:g} to {LARGEST_NUMBER:g}"
    remedy = f"beyond any arm ({limits}); check the unit: m, kg, s, Pa throughout"
    return ParameterError(key=key, value=value, remedy=remedy)


def _check_size(key: str, x: float) -> None:
    """Raise ParameterError for a number of a size that no arm has."""
    if not 1 / LARGEST_NUMBER <= abs(x) <= LARGEST_NUMBER:
        raise _out_of_range(key, x)


def whole(key: str, value: object, least: int, most: float, remedy: str) -> int:
    """Return a whole number from `least` to `most`, of Python or NumPy.

    Raises ParameterError with the `remedy` for any other value, also for a bool or a text.
    """
    is_whole = not isinstance(value, bool) and isinstance(value, Integral) and least <= int(value) <= most
    require(is_whole, key, value, remedy)
    return int(cast("int", value))


def positive(key: str, value: object, meaning: str) -> float:
    """Return a finite number above zero, from 1e-40 to 1e40."""
    x = number(key, value, meaning)
    require(0.0 < x < math.inf, key, x, meaning)
    _check_size(key, x)
    return x


def not_negative(key: str, value: object, meaning: str) -> float:
    """Return zero or a positive number."""
    x = number(key, value, meaning)
    return 0.0 if x == 0.0 else positive(key, x, meaning)


def finite(key: str, value: object, meaning: str) -> float:
    """Return zero or a finite number of either sign."""
    x = number(key, value, meaning)
    require(not math.isinf(x), key, x, meaning)
    # also of -0.0
    if x == 0.0:
        return 0.0
    _check_size(key, x)
    return x


def not_negative_or_inf(key: str, value: object, meaning: str) -> float:
    """Return zero, a positive number or inf."""
    x = number(key, value, meaning)
    return x if x == math.inf else not_negative(key, x, meaning)


def above_zero(key: str, value: object, meaning: str) -> float:
    """Return a positive number or inf."""
    x = not_negative_or_inf(key, value, meaning)
    require(x, key, x, meaning)
    return x


def positive_if_given(key: str, value: object, meaning: str) -> float | None:
    """Return a finite number above zero, or None."""
    return None if value is None else positive(key, value, meaning)


def on_the_arm(key: str, x: Reals | float, length: float) -> Reals:
    """Return points x [m] of an arm of this length as an array.  Raises ParameterError for points off it and nan."""
    points = np.asarray(x, dtype=float)
    is_on_it = (points >= 0) & (points <= length)
    require(is_on_it.all(), key, x, f"a point of the arm lies between 0 and {length:g} m")
    return points


@cache
def _field_checks(kind: type) -> dict[str, tuple[Check, str]]:
    """Return check and meaning of each field of a class of records that ends its annotation with both."""
    hints = get_type_hints(kind, include_extras=True)
    marks: dict[str, Any] = {name: getattr(hint, "__metadata__", ()) for name, hint in hints.items()}
    return {name: own[-2:] for name, own in marks.items() if len(own) > 1}


def check_annotated(record: object, kind: str) -> None:
    """Replace each field of a frozen record that has a check in its annotation by its checked value."""
    for name, (check, meaning) in _field_checks(cast("Any", type(record))).items():
        key = f"{kind}.{name}" if kind else name
        object.__setattr__(record, name, check(key, getattr(record, name), meaning))


def plain_name(name: Any) -> str:
    """Return a name whose characters are those of a folder's name on every file system."""
    remedy = 'a name has 1 to 80 characters, begins with a letter or digit and has no / \\ : * ? " < > |'
    is_name = isinstance(name, str) and re.fullmatch(r'[^\W_]([^/\\:*?"<>|]{0,78}[^/\\:*?"<>| .])?', name)
    require(is_name and name.isprintable(), "name", name, remedy)
    # file systems stop at 255 bytes, and a temporary file's name is longer than its own
    size = len(name.encode())
    require(size <= 200, "name", name, f"{size} bytes; at most 200")
    return str(name)


def plain_texts(assumptions: Any) -> tuple[str, ...]:
    """Return the assumptions, each with single spaces between its words."""
    remedy = "assumptions are a list of plain texts"
    require(isinstance(assumptions, list | tuple), "assumptions", assumptions, remedy)
    texts = tuple(" ".join(text.split()) if isinstance(text, str) else text for text in assumptions)
    for text in texts:
        require(isinstance(text, str) and text.isprintable(), "assumptions", text, remedy)
    return texts
