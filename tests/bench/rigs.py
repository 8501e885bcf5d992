"""A link of three segments: against the single link, a product of transfer matrices in NumPy, and finite elements."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import tfarm
from tfarm import Arm

from .elements import modal_sum
from .reference import OUTPUTS, Complex
from .rows import Row, Target
from .timing import interleaved

GROUP = "A link of three segments: hub angle, root moment and tip displacement in one pass, 0.1 to 1e4 rad/s"
POINTS, ROUNDS, ELEMENTS = 2_000, 25, 60
LIMIT = 5.0  # times the single link
MESH = (60, 8)  # elements and their degree, the best of `elements.MESHES`
CHAIN = "three equal pieces of the single link, which are a chain to it."
LUMPED = "lumped masses and massless Timoshenko fields, 4x4 complex products, all frequencies at once."
MODAL = "a hundred modes and the rigid body; the time includes assembly and eigenvalues."


def rig_rows() -> Iterator[Row]:
    """All three, with the error of each beside the same link undivided."""
    lab, s = tfarm.load("sasaki2012-lab"), 1j * np.geomspace(0.1, 1e4, POINTS)
    yield from _rows(lab, s, {
        "tfarm: three segments": (tfarm.transfer(in_three(lab), list(OUTPUTS)), LIMIT, CHAIN),
        f"{ELEMENTS} transfer matrices in NumPy": (partial(product, lab), None, LUMPED),
    }, warm=True)  # fmt: skip
    lossless = lab.having(damping=0.0)
    solve = partial(modal_sum, in_three(lossless), elements=MESH[0], degree=MESH[1])
    what = f"scikit-fem, {MESH[0]} elements of degree {MESH[1]}/{MESH[1] - 1}, modal sum: C = 0"
    yield from _rows(lossless, s, {what: (solve, None, MODAL)}, warm=False)


def in_three(arm: Arm) -> Arm:
    """The arm with its link in three equal segments."""
    third = replace(arm.link, length=arm.length / 3)
    return replace(arm, link=third, outer=(third, third))


def _rows(
    single: Arm,
    s: Complex,
    candidates: dict[str, tuple[Callable[[Complex], Complex], float | None, str]],
    *,
    warm: bool,
) -> Iterator[Row]:
    """A row a candidate, (what it calls, the ratio asked for, a note), beside the single link.

    `warm`: with transfer functions that are made already.
    """
    one = tfarm.transfer(single, list(OUTPUTS))
    calls = {what: partial(call, s) for what, (call, _, _) in candidates.items()}
    link = partial(one, s) if warm else lambda: tfarm.transfer(single, list(OUTPUTS))(s)
    times = interleaved({"one": link, **calls}, ROUNDS, warm=warm)
    exact = one(s)
    size = abs(exact) + abs(s * one.derivative(s))
    for what, (call, limit, note) in candidates.items():
        ratio = times.ratio(what, "one")
        yield Row(
            group=GROUP, what=what, n=POINTS, each="point", seconds=times.median(what) / POINTS, ratio=ratio,
            to="one link", to_seconds=times.median("one") / POINTS, error=float((abs(call(s) - exact) / size).max()),
            target=None if limit is None else Target(measured=ratio, limit=limit, unit="single links"),
            note=note, warm=warm,
        )  # fmt: skip


def product(arm: Arm, s: Complex) -> Complex:
    """Hub angle, root moment and tip displacement per torque by a chain of lumped elements, (3, n)."""
    link, h = arm.link, arm.length / ELEMENTS
    d = 1 + link.damping * s
    T = np.broadcast_to(np.eye(4, dtype=complex), (s.size, 4, 4))
    field, mass = np.zeros((2, s.size, 4, 4), complex)
    field[:, range(4), range(4)] = 1.0
    field[:, 0, 1], field[:, 0, 2], field[:, 0, 3] = (
        h,
        h**2 / (2 * link.EI * d),
        h / link.kGA - h**3 / (6 * link.EI * d),
    )
    field[:, 1, 2], field[:, 1, 3], field[:, 2, 3] = h / (link.EI * d), -(h**2) / (2 * link.EI * d), -h
    mass[:, range(4), range(4)] = 1.0
    mass[:, 2, 1], mass[:, 3, 0] = link.rhoI * h * s**2 / 2, link.rhoA * h * s**2 / 2
    element = mass @ field @ mass
    for _ in range(ELEMENTS):
        T = element @ T
    # at the tip M = Q = 0; at the root W = 0 and I_h s^2 Psi - M = 1
    rows = np.zeros((s.size, 4, 4), complex)
    rows[:, 0, 0] = 1.0
    rows[:, 1, 1], rows[:, 1, 2] = arm.hub.inertia * s**2, -1.0
    rows[:, 2:] = T[:, 2:]
    root = np.linalg.solve(rows, np.array([0, 1, 0, 0], complex)[:, None])[..., 0]
    return np.array([root[:, 1], root[:, 2] / d, np.einsum("ni,ni->n", T[:, 0], root)])
