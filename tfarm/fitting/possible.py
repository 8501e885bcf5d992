"""Responses and stability over the arms that the data of a fit leave possible."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.fitting.fit import Fit
from tfarm.loop.plane import gain_map
from tfarm.response import transfer


class ResponseBand(NamedTuple):
    """Magnitudes of a response at `omega` [rad/s]: of the arm that fits best, least and largest of possible ones."""

    omega: Real
    best: Real
    low: Real
    high: Real


def response_band(fit: Fit, arms: Sequence[Arm], output: str) -> ResponseBand:
    """Return the band of a response over these arms, in the range of all measurements."""
    ends = [end for each in fit.responses for end in each.omega[[0, -1]]]
    # about one frequency to a pixel
    omega = np.geomspace(min(ends), max(ends), 800)
    best, *others = (abs(transfer(each, output)(1j * omega)) for each in (fit.arm, *arms))
    return ResponseBand(omega, best, np.min(others, axis=0), np.max(others, axis=0))


class ShareOfArms(NamedTuple):
    """The share (up, across) of arms that each pair of gains stabilises in continuous time."""

    across: Real
    up: Real
    share: Real


def stable_share(arms: Sequence[Arm], ranges: Sequence[tuple[float, float]]) -> ShareOfArms:
    """Return the share of these arms over the `ranges` of both gains."""
    across, up = (np.linspace(*ends, 60) for ends in ranges)
    return ShareOfArms(across, up, np.mean([gain_map(arm, across, up).unstable == 0 for arm in arms], axis=0))
