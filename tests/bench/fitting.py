"""A fit of five numbers to three responses, and their profile intervals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import tfarm
from tests.fitting.planted import elements_response
from tfarm import Arm, Measured
from tfarm.fitting.fit import fit

from .rows import Row, Target
from .timing import interleaved

GROUP = "A fit: five numbers, 1,000 frequencies, three responses, noise of 1 % (data by finite elements of degree 8)"
FREE = ("link.youngs_modulus", "hub.inertia", "link.damping", "payload.mass", "payload.inertia")
OFF = (1.2, 0.8, 1.3, 0.75, 1.25)
PAIRS = (("tip_acceleration", "hub_angle"), ("root_moment", "hub_torque"), ("hub_rate", "hub_torque"))
POINTS, ROUNDS, SECONDS = 1_000, 3, 0.5


def fit_rows() -> Iterator[Row]:
    """The whole fit, and its profiles."""
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


def measured(arm: Arm) -> list[Measured]:
    """The responses with noise."""
    rng, omega, found = np.random.default_rng(14), np.geomspace(5, 2000, POINTS), []
    for (output, under), H in zip(PAIRS, elements_response(arm, omega, PAIRS), strict=True):
        sigma = 0.01 * abs(H) + 1e-3 * np.median(abs(H))
        noise = sigma * (rng.standard_normal(POINTS) + 1j * rng.standard_normal(POINTS))
        found.append(Measured(output=output, input=under, omega=omega, values=H + noise, sigma=sigma))
    return found


def _value(arm: Arm, key: str) -> float:
    room, name = key.split(".")
    return float(getattr(getattr(arm, room), name))
