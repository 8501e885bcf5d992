"""Profiles of a slew from rest to rest: its angle and rate over the share of its rise time that has passed.

With x = t/rise in [0, 1] and the share y of the travel,

    bang-bang   y'' = 4, then -4                                  (of acceleration +-a, the shortest of a limited one)
    s-curve     y''' = 32, -32 from 1/4 on, 32 from 3/4 on        (of limited jerk; its largest y'' is 8)
    polynomial  y = 10 x^3 - 15 x^4 + 6 x^5                       (of least mean square jerk; its largest y'' is 5.77)
    file        the cubic spline through the points of a CSV file, at rest at both ends

(Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, ch. 2 and 3.)
"""

from typing import TYPE_CHECKING

import numpy as np

from tfarm.arm.chain import Chain
from tfarm.arm.reading import decode_text
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError, name_file, require
from tfarm.files import read_file

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

# the s-curve's steps of y''': shares of the rise time, and sizes; those of y'' of a bang-bang profile
JERK_STEPS = ((0.0, 0.25, 0.75, 1.0), (32.0, -64.0, 64.0, -32.0))
ACCELERATION_STEPS = ((0.0, 0.5, 1.0), (4.0, -8.0, 4.0))
# steps of derivatives of the profiles of limited jerk: the order of the derivative, shares of the rise time, and sizes
STEPS: dict[str, tuple[tuple[int, tuple[float, ...], tuple[float, ...]], ...]] = {
    "s-curve": ((3, *JERK_STEPS),),
    "polynomial": (
        (3, (0.0, 1.0), (60.0, -60.0)),
        (4, (0.0, 1.0), (-360.0, -360.0)),
        (5, (0.0, 1.0), (720.0, -720.0)),
    ),
}


def transform_of_profile(profile: str, s: Complex) -> Complex:
    """Return the Laplace transform of the share y at s (n,) of a profile of limited jerk, in the rise time 1."""
    found = 0 * s
    for order, shares, sizes in STEPS[profile]:
        found += np.exp(np.multiply.outer(s, -np.array(shares))) @ sizes / s ** (order + 1)
    return found


def motion_of_slew(chain: Chain, reach: float, t: Real) -> tuple[Real, Real]:
    """Return the hub rate [rad/s] at times (n,) of samples, and its means (n - 1,) between them."""
    slew = chain.slew
    profile = chain.reference.profile
    if profile == "bang-bang":
        rate = slew.acceleration(reach) * np.clip(np.minimum(t, slew.rise_time - t), 0.0, None)
        return rate, (rate[1:] + rate[:-1]) / 2
    x = np.clip(t / slew.rise_time, 0.0, 1.0)
    if profile == "s-curve":
        past = np.clip(x[:, None] - np.array(JERK_STEPS[0]), 0.0, None)
        share = past**3 @ JERK_STEPS[1] / 6
        slope = past**2 @ JERK_STEPS[1] / 2
    elif profile == "polynomial":
        share = x**3 * (10 - 15 * x + 6 * x**2)
        slope = 30 * x**2 * (1 - x) ** 2
    else:
        spline = profile_of_file(str(chain.reference.file))
        share = spline(x)
        slope = spline(x, 1)
    turn = slew.travel_of(reach) / reach
    return turn / slew.rise_time * slope, turn * np.diff(share) / np.diff(t)


def profile_of_file(path: str) -> "CubicSpline":
    """Return the spline of a CSV file with a line of names, then time and angle a line, both scaled to 0 .. 1.

    Raises ParameterError, naming the file, for fewer than four lines, times that do not increase and no travel.
    """
    # here, because it takes a while to load
    from scipy.interpolate import CubicSpline

    most_bytes = 16 * 1024**2
    text = decode_text(
        read_file(path, most_bytes, key="reference.file", what="a .csv file"), "save it as UTF-8"
    )
    with name_file(path):
        _, *lines = text.strip().splitlines() or [""]
        remedy = "a line of names, then a time and an angle, with a comma between them, a line"
        try:
            table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
        except ValueError:
            raise ParameterError(key="reference.file", value=lines[:1], remedy=remedy) from None
        require(table.ndim == 2 and table.shape[1] == 2, "reference.file", lines[:1], remedy)
        t, angle = table.T
        # of times and angles: those of no slew are larger
        largest = 1e9
        is_finite = len(t) >= 4 and (abs(table) <= largest).all()
        require(is_finite, "reference.file", lines[:4], "give at least four lines of finite numbers")
        require(
            (np.diff(t) > 0).all(), "reference.file", lines[:4], "give times that increase from line to line"
        )
        remedy = "give an end at another angle than the start"
        require(abs(angle[-1] - angle[0]) * largest > np.ptp(angle), "reference.file", lines[-1], remedy)
    return CubicSpline(
        (t - t[0]) / (t[-1] - t[0]), (angle - angle[0]) / (angle[-1] - angle[0]), bc_type="clamped"
    )
