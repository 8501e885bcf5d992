"""Natural frequencies: a hundred by tfarm, a few by cxroots."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator

import numpy as np

import tfarm
from tfarm import Arm, Link

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
    """The first modes as all zeros of the characteristic function in a rectangle, by cxroots' contour integrals.

    It gets that function without artefacts, in the variable q = sqrt(w/unit) in which the roots are evenly spaced, and
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
        result = cxroots.Rectangle([1.0, corner], [-0.5, 0.5]).roots(lambda q: _characteristic(arm, q))
    found = np.sort(unit * np.array(result.roots).real ** 2)
    return Row(
        group=GROUP, what="cxroots: sasaki2012", n=found.size, each="mode", seconds=watch.seconds / found.size,
        ratio=watch.seconds / ours, to="tfarm", to_seconds=ours / FEW, error=frequency_errors(arm, found).max(),
        note="cxroots: one run, on the closed form, freed of artefacts and scaled, in q ~ sqrt(w): "
        f"real part 1 to {corner:.1f}, imaginary part -0.5 to 0.5.",
    )  # fmt: skip


def _characteristic(arm: Arm, q: Complex) -> Complex:
    """What `paper.characteristic` is, times e^{-q}, in the closed form that takes half the time.  m = I_c = 0."""
    link, L = arm.link, arm.link.length
    unit = math.sqrt(link.EI / link.rhoA) / L**2
    S = -((unit * np.asarray(q, dtype=complex) ** 2) ** 2)
    bend, turn, rest = link.density / link.youngs_modulus, link.rhoA / link.kGA, link.EI * link.rhoA * S
    mean, spread = (bend + turn) * S / 2, np.sqrt(((bend - turn) * S) ** 2 / 4 - link.rhoA * S / link.EI)
    l1, l2 = np.sqrt(mean + spread), np.sqrt(mean - spread)
    (g1, So1, Se1, Mo1, Me1), (g2, So2, Se2, Mo2, Me2) = (_wave(link, S, x) for x in (l1, l2))
    N1, N2 = Me1 * So2 - Se1 * Mo2 - g2 * rest, So1 * Me2 - Mo1 * Se2 - g1 * rest
    gap = link.EI * (g1 * l1 - g2 * l2)
    value = gap * (So1 * Mo2 - So2 * Mo1) - arm.hub.inertia * S * (N1 * g1 + N2 * g2)
    return value * l1 * l2 / (rest * (l1**2 - l2**2) ** 2) * np.exp(-q)


def _wave(link: Link, S: Complex, x: Complex) -> tuple[Complex, ...]:
    """gamma, then what the free tip makes of one wave x: force and moment of its odd and its even part."""
    g, cosh, sinh = x - link.rhoA / link.kGA * S / x, np.cosh(x * link.length), np.sinh(x * link.length)
    force, moment = link.rhoA * S / x, g * link.EI * x
    return g, force * cosh, force * sinh, moment * sinh, moment * cosh
