"""A link of three segments: against the single link, and against a product of sixty transfer matrices in NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import tfarm
from tfarm import Arm

from .reference import OUTPUTS, Complex
from .rows import Row, Target
from .timing import interleaved

GROUP = "A link of three segments: hub angle, root moment and tip displacement in one pass, 0.1 to 1e4 rad/s"
POINTS, ROUNDS, ELEMENTS = 2_000, 25, 60
LIMIT = 5.0  # times the single link
NOTE = "elements: lumped masses and massless Timoshenko fields, 4x4 complex products, all frequencies at once."


def rig_rows() -> Iterator[Row]:
    """Both, with the error of each beside the same link undivided."""
    single = tfarm.load("sasaki2012-lab")
    third = replace(single.link, length=single.length / 3)
    three, s = replace(single, link=third, outer=(third, third)), 1j * np.geomspace(0.1, 1e4, POINTS)
    names = list(OUTPUTS)
    one, chain = tfarm.transfer(single, names), tfarm.transfer(three, names)
    times = interleaved(
        {"one": lambda: one(s), "three": lambda: chain(s), "product": lambda: product(single, s)}, ROUNDS
    )
    exact = one(s)
    size = abs(exact) + abs(s * one.derivative(s))
    for key, what, values, target in (
        ("three", "tfarm: three segments", chain(s), LIMIT),
        ("product", f"{ELEMENTS} transfer matrices in NumPy", product(single, s), None),
    ):
        ratio = times.ratio(key, "one")
        yield Row(
            group=GROUP, what=what, n=POINTS, each="point", seconds=times.median(key) / POINTS, ratio=ratio,
            to="one link", to_seconds=times.median("one") / POINTS, error=float((abs(values - exact) / size).max()),
            note=NOTE, target=None if target is None else Target(measured=ratio, limit=target, unit="single links"),
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
