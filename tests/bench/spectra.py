"""Natural frequencies: a hundred by tfarm, a few by cxroots."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator

import numpy as np

import tfarm
from tfarm import Arm

from .paper import characteristic
from .reference import Complex, frequency_errors
from .rows import Row, Target
from .timing import interleaved, once

GROUP = "Natural frequencies"
LIMIT = 25.0  # ms for a hundred modes
FEW = 10  # modes for cxroots


def modes_rows() -> Iterator[Row]:
    """A hundred modes, both presets; errors against 40-digit roots of the paper's determinant."""
    for name in ("sasaki2012", "stocky-steel"):
        arm = tfarm.load(name)
        seconds = interleaved({"tfarm": lambda arm=arm: tfarm.modes(arm, 100).natural_frequency}, 50).median("tfarm")
        found = tfarm.modes(arm, 100)
        error = frequency_errors(arm, found.natural_frequency[found.index > 0]).max()
        yield Row(
            group=GROUP, what=f"tfarm: {name}", n=100, each="mode", seconds=seconds / 100, error=error,
            target=Target(measured=1e3 * seconds, limit=LIMIT, unit="ms for all"),
        )  # fmt: skip


def cxroots_row() -> Row:
    """The first modes as all roots of the paper's determinant in a rectangle, by cxroots' contour integrals.

    It gets a function without artefacts, in the variable q = sqrt(w/unit) in which the roots are evenly spaced, and
    times e^{-q}, without which it grows by thirteen orders of magnitude over the ten modes.
    """
    import cxroots

    arm = tfarm.load("sasaki2012")
    unit = math.sqrt(arm.link.EI / arm.link.rhoA) / arm.link.length**2
    modes = interleaved({"tfarm": lambda: tfarm.modes(arm, FEW).natural_frequency}, 50)
    ours = modes.median("tfarm")
    corner = math.sqrt(tfarm.modes(arm, FEW + 1).natural_frequency[-2:].mean() / unit)
    with warnings.catch_warnings(), once() as watch:
        warnings.simplefilter("ignore")
        result = cxroots.Rectangle([1.0, corner], [-0.5, 0.5]).roots(lambda q: _scaled(arm, unit, q))
    found = np.sort(unit * np.array(result.roots).real ** 2)
    return Row(
        group=GROUP, what="cxroots: sasaki2012", n=found.size, each="mode", seconds=watch.seconds / found.size,
        ratio=watch.seconds / ours, to="tfarm", to_seconds=ours / FEW, error=frequency_errors(arm, found).max(),
        note="cxroots: one run, on the paper's determinant freed of its artefacts and scaled, in q ~ sqrt(w): "
        f"real part 1 to {corner:.1f}, imaginary part -0.5 to 0.5.",
    )  # fmt: skip


def _scaled(arm: Arm, unit: float, q: Complex) -> Complex:
    s = 1j * unit * np.asarray(q, dtype=complex) ** 2
    return characteristic(arm, s, number=float, sqrt=np.sqrt, exp=np.exp) * np.exp(-q)
