"""Errors: bad input, a search without convergence, a failed certification."""

import difflib
import os
import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import accumulate
from typing import Any, Self

# the value of a missing key
MISSING = ...


class TfarmError(Exception):
    """Base of every error of tfarm."""


class ParameterError(TfarmError, ValueError):
    """Bad input.  Its text is one line: the file (if any), the key, the value and the remedy."""

    def __init__(
        self, *, key: str, value: object, remedy: str, file: str | os.PathLike[str] | None = None
    ) -> None:
        self.key = key
        self.value = value
        self.remedy = remedy
        self.file = None if file is None else os.fspath(file)
        super().__init__(str(self))

    def __str__(self) -> str:
        where = "" if self.file is None else f"{one_line(self.file, 240)}: "
        key = one_line(self.key, 80)
        what = f"{key} is missing" if self.value is MISSING else f"{key} = {short_text(self.value)}"
        return f"{where}{what}: {one_line(self.remedy, 480)}"

    def __reduce__(self) -> tuple[Any, ...]:
        again = partial(type(self), key=self.key, value=self.value, remedy=self.remedy, file=self.file)
        return again, ()

    def in_file(self, file: str | os.PathLike[str]) -> Self:
        """Return the same error with a file."""
        return type(self)(key=self.key, value=self.value, remedy=self.remedy, file=file)


def require(is_met: object, key: str, value: object, remedy: str, file: str | None = None) -> None:
    """Raise ParameterError unless a condition is met."""
    if not is_met:
        raise ParameterError(key=key, value=value, remedy=remedy, file=file)


@contextmanager
def name_file(file: str | os.PathLike[str]) -> Iterator[None]:
    """Add the name of a file to a ParameterError raised inside, unless it has one."""
    try:
        yield
    except ParameterError as error:
        if not error.file:
            error = error.in_file(file)
        raise error from None


class ConvergenceError(TfarmError):
    """A search without convergence, with the best value found and its residual."""

    def __init__(self, message: str, best: Any, residual: Any) -> None:
        super().__init__(message, best, residual)
        self.message = message
        self.best = best
        self.residual = residual

    def __str__(self) -> str:
        return self.message


class CertificationError(TfarmError):
    """A result that is not certified."""


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return the remedy for a misspelt word: the nearest choices (`close_to`), if any, and all of them."""
    known = list(choices)
    near = close_to(word, known)
    hint = ""
    if near:
        choice = " or ".join(f'"{each}"' for each in near)
        hint = f"did you mean {choice}? "
    return f"{hint}known are: {list_within(known, 400 - len(hint))}"


def list_within(words: Iterable[str], longest: int) -> str:
    """Return words with commas: the first that fit into `longest` characters, each whole, and the number of others."""
    known = list(words)
    ends = accumulate(len(word) + 2 for word in known)
    count = sum(end <= longest for end in ends)
    return ", ".join(known[:count]) + f" and {len(known) - count} more" * (count < len(known))


def unknown_key(word: str, known: Iterable[str]) -> str:
    """Return the remedy for an unknown key of a file: why its physics is not modelled, else the nearest of `known`."""
    not_modelled = {
        "gravity": "the arm moves in a horizontal plane",
        "coriolis|centrifugal": "the rotation is slow compared with the first mode",
        "torsion": "the arm bends in the plane of rotation alone",
        "backlash|hysteresis": "joints and gears are linear",
        "coulomb|breakaway|stiction|dry_friction": "friction is viscous, [hub] friction",
        "temperature": "all numbers are constant",
        "aerodynamic": "damping is that of the link, the joints and the hub",
    }
    for physics, reason in not_modelled.items():
        if re.search(physics, word.lower()):
            return f"not modelled: {reason}; leave it out"
    return f"unknown key; {did_you_mean(word, known)}"


def close_to(word: str, choices: Iterable[str]) -> list[str]:
    """Return the choice that is a word but for its capitals, else the nearest, else up to three that begin with it."""
    known = list(choices)
    same = [choice for choice in known if choice.lower() == word.lower()]
    if same:
        return same[:1]
    begun = [choice for choice in known if word and choice.startswith(word)][:3]
    return difflib.get_close_matches(word[:80], known, n=1) or begun


def must_be_known(key: str, value: object, choices: Collection[str]) -> None:
    """Raise ParameterError for a value that is none of the choices."""
    if value not in choices:
        raise ParameterError(key=key, value=value, remedy=did_you_mean(str(value), choices))


def one_line(text: str, longest: int) -> str:
    """Return `text` with unprintable characters escaped, cut in its middle to `longest` characters."""
    if len(text) > longest:
        half = (longest - 5) // 2
        text = f"{text[:half]} ... {text[-half:]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def short_text(value: object) -> str:
    """Return the text of a value, in at most 60 characters."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple) and all(isinstance(each, str) for each in value):
        return f"[{list_within((one_line(repr(each), 50) for each in value), 58)}]"
    try:
        return one_line(repr(value), 60)
    except (ValueError, RecursionError):
        # an integer of more than 4300 digits, a very deep table
        return f"<{type(value).__name__}>"
