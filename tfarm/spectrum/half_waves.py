"""The waves of a uniform piece without damping, in real balls on the imaginary axis, and how many of them fit in it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import flint

Ball = Any


def real_waves(a: Ball, b: Ball, g: Ball, S: Ball) -> tuple[tuple[Ball, ...], tuple[Ball, ...]]:
    """c, sinh t / t, z, v and the scale of both waves at S = -omega^2; real, whether they decay or travel."""
    half, product = S * (a + b) / 2, S * (a * b * S + g)
    spread = (half * half - product).sqrt()
    return _functions(half + spread, b * S), _functions(half - spread, b * S)


def _functions(z: Ball, bS: Ball) -> tuple[Ball, ...]:
    if z < 0:
        k = (-z).sqrt()
        sine, cosine = k.sin_cos()
        return cosine, sine / k, z, z - bS, flint.arb(1)
    t = z.sqrt()
    e = (-t).exp()
    square = e * e
    return (1 + square) / 2, (1 - square) / (2 * t), z, z - bS, e


def pinned_count(squares: Iterable[Ball]) -> int | None:
    """The count for both ends pinned: half waves inside the length, and one above the cut-off; None if not certain."""
    number, travelling = 0, 0
    for z in squares:
        if z < 0:
            whole = ((-z).sqrt() / flint.arb.pi()).floor().unique_fmpz()
            if whole is None:
                return None
            number, travelling = number + int(whole), travelling + 1
        elif not z > 0:
            return None
    return number + (travelling == 2)
