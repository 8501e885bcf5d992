"""Frequency responses: three outputs in one pass, against two exponentials a point and against mpmath.

The times are those of a transfer function that is made already (some 0.1 ms): of a point, not of a call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import mpmath
import numpy as np

import tfarm
from tfarm import Arm

from .paper import appendix
from .reference import OUTPUTS, Complex, ExactResponse
from .rows import Row, Target
from .timing import interleaved, once

GROUP = "Frequency response: hub angle, root moment and tip displacement in one pass, 0.1 to 1e4 rad/s"
LIMIT = 5.0  # times two complex exponentials
CHECKED = 100  # points of each response whose error is measured
ROUNDS = {1_000: 100, 1_000_000: 11}
NOTE = (
    "floor: numpy.exp of the arm's own two waves, e^{-l1 L} and e^{-l2 L}, into arrays that exist already. At C = 0 "
    "their exponents are purely real and imaginary, which is faster than general complex ones.  "
    "largest error: |error/G| / (1 + |s G'/G|) over three outputs at a hundred of the points, against ball arithmetic."
)
GRIDS: dict[str, Callable[..., Any]] = {"log": np.geomspace, "linear": np.linspace}


def response_rows() -> Iterator[Row]:
    """tfarm beside its floor: both presets, both grids, a thousand and a million points."""
    for name in ("sasaki2012", "sasaki2012-lab"):
        arm = tfarm.load(name)
        for grid, points in GRIDS.items():
            for n, rounds in ROUNDS.items():
                yield _against_floor(arm, grid, 1j * points(0.1, 1e4, n), rounds)


def _against_floor(arm: Arm, grid: str, s: Complex, rounds: int) -> Row:
    G = tfarm.transfer(arm, list(OUTPUTS))
    times = interleaved({"floor": floor(arm, s), "tfarm": lambda: G(s)}, rounds, warm=True)
    some = np.linspace(0, s.size - 1, CHECKED).astype(int)
    ratio = times.ratio("tfarm", "floor")
    return Row(
        group=GROUP, what=f"tfarm: {arm.name} (C = {arm.link.damping:g} s), {grid} grid", n=s.size, each="point",
        seconds=times.median("tfarm") / s.size, ratio=ratio, to="floor", to_seconds=times.median("floor") / s.size,
        warm=True, error=ExactResponse(arm, s[some]).error(G(s)[:, some]), note=NOTE,
        target=Target(measured=ratio, limit=LIMIT, unit="floors"),
    )  # fmt: skip


def floor(arm: Arm, s: Complex) -> Callable[[], object]:
    """Two NumPy complex exponentials a point: those of the arm's two waves, which no exact solution can do without."""
    waves = appendix(arm, s, number=float, sqrt=np.lib.scimath.sqrt, exp=np.zeros_like).waves
    exponents = [-x * arm.link.length * np.where(x.real < 0, -1, 1) for x, _, _ in waves[:2]]
    result = np.empty_like(s)

    def exponentials() -> None:
        for exponent in exponents:
            np.exp(exponent, out=result)

    return exponentials


def mpmath_rows() -> Iterator[Row]:
    """The paper's 4x4 system solved by mpmath, point by point, at 15 and at 30 digits."""
    arm = tfarm.load("sasaki2012-lab")
    s = 1j * np.geomspace(0.1, 1e4, CHECKED)
    thousand = 1j * np.geomspace(0.1, 1e4, 1000)
    G = tfarm.transfer(arm, list(OUTPUTS))
    ours = interleaved({"tfarm": lambda: G(thousand)}, 50, warm=True).median("tfarm") / thousand.size
    for digits in (15, 30):
        with once() as watch:
            values = [solve(arm, complex(each), digits) for each in s]
        seconds = watch.seconds / s.size
        right = [i for i, value in enumerate(values) if value is not None]
        error = ExactResponse(arm, s[right]).error(np.array([values[i] for i in right]).T)
        refused = f"; refuses {s.size - len(right)} points as numerically singular" if len(right) < s.size else ""
        yield Row(
            group=GROUP, what=f"mpmath lu_solve, {digits} digits: {arm.name}, log grid{refused}", n=s.size,
            each="point", seconds=seconds, ratio=seconds / ours, to="tfarm, warm", to_seconds=ours, error=error,
        )  # fmt: skip


def solve(arm: Arm, s: complex, digits: int) -> list[mpmath.mpc] | None:
    """The three outputs from the appendix's a_ij k_j = (0, 0, 0, 1), or None where lu_solve gives up."""
    with mpmath.workdps(digits):
        a = appendix(arm, mpmath.mpmathify(s), number=mpmath.mpf, sqrt=mpmath.sqrt, exp=mpmath.exp)
        try:
            k = mpmath.lu_solve(mpmath.matrix(a.rows), mpmath.matrix([0, 0, 0, 1]))
        except ZeroDivisionError:
            return None
        terms = list(zip(k, a.waves, strict=True))
        angle = mpmath.fsum(k * g for k, (_, g, _) in terms)
        moment = a.EI * mpmath.fsum(k * g * x for k, (x, g, _) in terms)
        return [angle, moment, mpmath.fsum(k * e for k, (_, _, e) in terms)]
