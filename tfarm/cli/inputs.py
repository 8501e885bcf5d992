"""Arguments as people type them, turned into numbers; what cannot be is refused in one line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np
import typer
from numpy.typing import NDArray

from tfarm.cli.app import whole
from tfarm.errors import ParameterError

if TYPE_CHECKING:
    from tfarm.arm import Arm, HubFeedback

K1 = Annotated[
    float | None,
    typer.Option("--K1", help="hub rate gain [N m s/rad]; by default 0.00642 J w1, the paper's 0.3 on its arm"),
]
K2 = Annotated[
    float | None,
    typer.Option("--K2", help="root moment gain, u = ... - K2 E I phi'(0); 0.3 by default, 0 on a hub without inertia"),
]
Kp = Annotated[float, typer.Option("--Kp", help="hub angle gain [N m/rad]")]

MOST_POINTS = 1_000_000
_Number = TypeVar("_Number", float, complex)


def s_values(text: str) -> NDArray[np.complex128]:
    """Complex numbers separated by commas: "0.3+57.1j,10j"."""
    return np.array(
        [_number("--s", part, complex, "write numbers in 1/s such as 0.3+57.1j,10j") for part in text.split(",")]
    )


def omega_values(text: str) -> NDArray[np.complex128]:
    """s = i omega for frequencies in rad/s separated by commas."""
    parts = text.split(",")
    frequencies = [_number("--omega", part, float, "write frequencies in rad/s such as 1,10,100") for part in parts]
    return s_on_axis(np.array(frequencies))


def s_on_axis(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    """i omega."""
    return np.asarray(1j * omega, dtype=np.complex128)


def points_on(s: str | None, omega: str | None, start: float, stop: float, points: str) -> NDArray[np.complex128]:
    """The points s [1/s] of a response: those typed, s = i omega for frequencies typed, or a grid of them."""
    if s is not None and omega is not None:
        raise ParameterError(key="--omega", value=omega, remedy="give --s or --omega, not both")
    if s is not None:
        return s_values(s)
    return grid(start, stop, points) if omega is None else omega_values(omega)


def grid(start: float, stop: float, points: str) -> NDArray[np.complex128]:
    """s = i omega for logarithmically spaced frequencies from start to stop [rad/s]."""
    if not 0 < start < math.inf:
        raise ParameterError(key="--from", value=start, remedy="a positive frequency in rad/s")
    if not start < stop < math.inf:
        raise ParameterError(key="--to", value=stop, remedy=f"a frequency above --from, {start:g} rad/s")
    frequencies: NDArray[np.float64] = np.geomspace(start, stop, whole("--points", points, 2, MOST_POINTS))
    return s_on_axis(frequencies)


def gains_of(
    arm: Arm, K1: float | None, K2: float | None = None, Kp: float = 0.0
) -> tuple[HubFeedback, dict[str, Any]]:
    """The law of the command line, gains that were not given being the arm's default, and what its answer says of it.

    `default_gains` names the gains that were not given, `default_gains_in_words` says what they are and why.
    """
    from dataclasses import replace

    from tfarm.spectrum.scales import default_gains, default_words

    given = {name: gain for name, gain in (("K1", K1), ("K2", K2)) if gain is not None}
    missing = [name for name in ("K1", "K2") if name not in given]
    words = default_words(arm, missing) if missing else None
    return replace(default_gains(arm), Kp=Kp, **given), {
        "default_gains": missing,
        "default_gains_in_words": words,
    }


def say_defaults(answer: dict[str, Any]) -> None:
    """One line about the gains that were not given, where there are any."""
    if answer.get("default_gains"):
        print(f"by default {answer['default_gains_in_words']}")


def _number(key: str, text: str, kind: type[_Number], remedy: str) -> _Number:
    try:
        value = kind(text.strip().replace("i", "j") if kind is complex else text)
    except ValueError:
        raise ParameterError(key=key, value=text, remedy=remedy) from None
    if not np.isfinite(value):
        raise ParameterError(key=key, value=text, remedy=f"not finite; {remedy}")
    return value
