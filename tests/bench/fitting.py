"""A fit of five numbers to three responses: whole, and its last search beside the same one with finite elements."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import tfarm
from tests.fitting.planted import elements_response
from tfarm import Arm, Measured
from tfarm.fitting.fit import fit
from tfarm.fitting.model import Problem
from tfarm.fitting.solve import nearest_minimum

from .reference import Complex
from .rows import Row, Target
from .timing import interleaved

GROUP = "A fit: five numbers, 1,000 frequencies, three responses, noise of 1 % (data by finite elements of degree 8)"
FREE = ("link.youngs_modulus", "hub.inertia", "link.damping", "payload.mass", "payload.inertia")
OFF = (1.2, 0.8, 1.3, 0.75, 1.25)
PAIRS = (("tip_acceleration", "hub_angle"), ("root_moment", "hub_torque"), ("hub_rate", "hub_torque"))
POINTS, ELEMENTS, ROUNDS = 1_000, 20, 3
SECONDS, FASTER = 0.5, 20.0
STEP = 1e-6  # of ln p: of forward differences
NEAR = 0.02  # of ln p: where the last search starts from


def fit_rows() -> Iterator[Row]:
    """The whole fit, its profiles, and the last search beside the same one with elements of two nodes."""
    arm = tfarm.load("sasaki2012-lab").having(payload_mass=0.3, payload_inertia=1e-3)
    data, start = measured(arm), dict(zip(FREE, OFF, strict=True))
    values = {key: factor * _value(arm, key) for key, factor in start.items()}
    found = fit(arm, data, free=FREE, start=values, profile=False)
    calls = {
        "fit": lambda: fit(arm, data, free=FREE, start=values, profile=False),
        "profiled": lambda: fit(arm, data, free=FREE, start=values),
    }
    times = interleaved(calls, ROUNDS)
    whole = times.median("fit")
    profiled = float(np.median(times.rounds["profiled"] - times.rounds["fit"]))
    yield Row(
        group=GROUP, what="tfarm: whole, from 20-30 % off", n=1, each="fit", seconds=whole,
        error=max(abs(_value(found.arm, key) / _value(arm, key) - 1) for key in FREE),
        target=Target(measured=whole, limit=SECONDS, unit="s"), note="largest error: of a number, by the noise.",
    )  # fmt: skip
    yield Row(
        group=GROUP, what="tfarm: profile intervals of all five", n=1, each="fit", seconds=profiled,
        target=Target(measured=profiled, limit=10.0, unit="s"),
    )  # fmt: skip
    own = found.solution.problem
    near, given = found.solution.point + NEAR, (own.family, own.parameters, own.responses)
    calls = {
        "exact": lambda: nearest_minimum(Problem(*given), near),
        "elements": lambda: nearest_minimum(ElementProblem(*given), near),
    }
    times = interleaved(calls, ROUNDS)
    ours, theirs, faster = times.median("exact"), times.median("elements"), times.ratio("elements", "exact")
    yield Row(
        group=GROUP, what=f"the last search, with {ELEMENTS} elements of two nodes", n=1, each="fit", seconds=theirs,
        ratio=faster, to="the last search, exact", to_seconds=ours,
        note="NumPy's batched solve at all frequencies, forward differences along the five numbers, the same loop.",
        target=Target(measured=FASTER, limit=faster, unit="times faster"),
    )  # fmt: skip


def measured(arm: Arm) -> list[Measured]:
    """The responses with noise."""
    rng, omega, found = np.random.default_rng(14), np.geomspace(5, 2000, POINTS), []
    for (output, under), H in zip(PAIRS, elements_response(arm, omega, PAIRS), strict=True):
        sigma = 0.01 * abs(H) + 1e-3 * np.median(abs(H))
        noise = sigma * (rng.standard_normal(POINTS) + 1j * rng.standard_normal(POINTS))
        found.append(Measured(output=output, input=under, omega=omega, values=H + noise, sigma=sigma))
    return found


class ElementProblem(Problem):
    """The same residuals with the responses of two-node Timoshenko elements (Przemieniecki 1968)."""

    def computed(self, point: Any) -> list[Complex]:
        arm, omega = self.arm(point), self.responses[0].data.omega
        motions = responses(arm, 1j * omega)
        return [motions[each.data.output] / motions[each.data.input] for each in self.responses]

    def slopes(self, point: Any, here: Any = None) -> list[tuple[Complex, Complex]]:
        base, slopes = self.computed(point), []
        for each in np.eye(point.size) * STEP:
            beyond = self.computed(point + each)
            slopes.append([(after - before) / STEP for after, before in zip(beyond, base, strict=True)])
        return [(H, np.array([row[n] for row in slopes])) for n, H in enumerate(base)]


def responses(arm: Arm, s: Complex) -> dict[str, Complex]:
    """Motions and root moment per torque."""
    link, h, nodes = arm.link, arm.length / ELEMENTS, ELEMENTS + 1
    bend, mass = np.zeros((2, 2 * nodes, 2 * nodes))
    phi = 12 * link.EI / (link.kGA * h**2)
    k = link.EI / (h**3 * (1 + phi)) * np.array([
        [12, 6 * h, -12, 6 * h], [6 * h, (4 + phi) * h**2, -6 * h, (2 - phi) * h**2],
        [-12, -6 * h, 12, -6 * h], [6 * h, (2 - phi) * h**2, -6 * h, (4 + phi) * h**2],
    ])  # fmt: skip
    m = link.rhoA * h / 420 * np.array([
        [156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
        [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
    ])  # fmt: skip
    for n in range(ELEMENTS):
        here = slice(2 * n, 2 * n + 4)
        bend[here, here] += k
        mass[here, here] += m
    mass[1, 1] += arm.hub.inertia
    mass[-2, -2] += arm.payload.mass
    mass[-1, -1] += arm.payload.inertia
    K, M = bend[1:, 1:], mass[1:, 1:]
    Z = K * (1 + link.damping * s)[:, None, None] + M * (s * s)[:, None, None]
    force = np.zeros((s.size, 2 * nodes - 1, 1))
    force[:, 0] = 1.0
    y = np.linalg.solve(Z, force)[:, :, 0]
    moment = arm.hub.inertia * s**2 * y[:, 0] - 1
    return {
        "hub_torque": np.ones(s.size), "hub_angle": y[:, 0], "hub_rate": s * y[:, 0],
        "tip_acceleration": s**2 * y[:, -2], "root_moment": moment / (1 + link.damping * s),
    }  # fmt: skip


def _value(arm: Arm, key: str) -> float:
    room, name = key.split(".")
    return float(getattr(getattr(arm, room), name))
