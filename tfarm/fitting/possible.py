"""Curves of a fit as pictures have them: before and after, and over the arms that the data leave possible."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.fitting.fit import Fit
from tfarm.loop.plane import gain_map
from tfarm.response import transfer


def fitted_curves(fit: Fit) -> Iterator[tuple[Real, Complex, Complex]]:
    """Yield frequencies [rad/s] of each measured response, with its values at the start and at the fitted numbers."""
    for number, one in enumerate(fit.responses):
        omega = np.unique(np.r_[np.geomspace(one.omega[0], one.omega[-1], 1200), one.omega])
        problem = fit.problem.at(number, omega)
        yield omega, problem.computed(0 * fit.point)[0], problem.computed(fit.point)[0]


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
