"""The parts of the loop function along the imaginary axis, as polynomials through exact samples.

Drive, hub angle and gauge at s = i w have neither poles nor branches (but for s = -1/C, off the axis): resonances are
zeros of the drive.  So on a panel of a few resonances polynomials through Chebyshev points have all digits, between
the samples and, for poles, some way off the axis too (Trefethen 2013, theorem 8.2).  L is a quotient of them, linear
in the gains: the samples give the loop for any gains, without the arm.

    L(s) = gains . (theta, s theta, s^2 m) / (s^n d),   drive = s^n d, gauge = s^2 m,  n = 2, or 1 where the hub loses

The powers of s are taken out so that slow gains lose no digits next to s = 0.

The zeros from the hub's input to a sensor are listed for each place of it: a law at the hub does not move them, as it
changes the drive alone.
"""

import itertools
from collections.abc import Callable
from functools import partial
from typing import Literal

import numpy as np

from tfarm.arm import AT_HUB, Arm, must_turn
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, require
from tfarm.loop.continuous import ContinuousLoop, frequency_above_mode, steep_places
from tfarm.records import frozen
from tfarm.response import transfer
from tfarm.response.signals import Signals
from tfarm.spectrum import Modes, modes

# of a panel: of order 1/2 as the parts are, few more never help where a panel holds one mode
PANEL_SAMPLES = 24
Sensor = Literal["displacement", "moment"]


@frozen
class Panels:
    """Samples of d, theta and m, `values` (3, panels, PANEL_SAMPLES), on panels of the axis up to `band` [rad/s].

    Under a law they are of the drive times its denominator and of what each part feeds back.

    A panel is from `low` to `high` [rad/s], the first from -`high`, and has one positive factor on its values; `order`
    is n of the drive's s^n.  `error` is the largest miss between samples, as a share of a part's size on its panel.
    """

    band: float
    low: Real
    high: Real
    values: Complex
    order: int
    error: float


def loop_panels(arm: Arm, band: float, loop: ContinuousLoop | None = None, most_panels: int = 400) -> Panels:
    """Return the samples up to a band [rad/s], of hub angle and gauge or of the parts of a loop's law.

    A panel whose polynomials miss a part by more than 1e-11 of its size there is halved, up to `most_panels`: more mean
    that halving does not help.
    Raises ParameterError for an arm that cannot turn freely, ConvergenceError where halving panels does not help.
    """
    # steep places a panel: each mode has one of the own, the locked and the free hub
    steep_a_panel = 3
    most_miss = 1e-11
    require(arm.has_rigid_mode, "arm", arm.name, "samples of a loop are of an arm that turns freely")
    order = 1 if arm.rate_loss else 2
    rows: Callable[[Complex], Complex] = partial(_hub_rows, arm, order)
    if loop is not None:
        at_rest = loop.k.at_rest + int((loop.law.poles == 0).sum())
        order = at_rest - loop.zeros_at_origin
        rows = partial(_law_rows, loop, at_rest)
    places = np.asarray(steep_places(arm, band))[steep_a_panel - 1 :: steep_a_panel]
    edges = np.r_[0.0, places[places < band], band]
    waiting = [(-edges[1], edges[1]), *itertools.pairwise(edges[1:])]
    done: list[tuple[float, float, Complex, float]] = []
    while waiting:
        low, high = waiting.pop()
        values, error = _panel(rows, low, high)
        if error <= most_miss:
            done.append((float(low), float(high), values, error))
        elif low == -high:
            waiting += [(low / 2, high / 2), (high / 2, high)]
        else:
            waiting += [(low, (low + high) / 2), ((low + high) / 2, high)]
        if len(done) + len(waiting) > most_panels:
            raise ConvergenceError("polynomials do not follow the loop's parts along the axis", high, error)
    lows, highs, parts, errors = zip(*sorted(done, key=lambda each: each[1]), strict=True)
    return Panels(band, np.array(lows), np.array(highs), np.stack(parts, axis=1), order, max(errors))


def _hub_rows(arm: Arm, order: int, s: Complex) -> Complex:
    """Return d, theta and m; without losses real: an imaginary part of rounding would be a loss next to a resonance."""
    drive, (theta, _, gauge), scale = Signals(arm, AT_HUB).parts(s)
    both = np.stack([drive / s**order, theta, gauge / s**2]) * np.exp(scale - scale.real.max())
    return both.real + 0j if arm.is_reactive else both


def _law_rows(loop: ContinuousLoop, at_rest: int, s: Complex) -> Complex:
    """Return the drive times the law's denominator over s^at_rest, and the feedback of each part over the s^n of D."""
    rig = loop.signals.parts(s)
    shares, whole = loop.law.shares(s)
    fed_back = np.exp(-s * loop.law.delay) * (shares * rig.numerators).sum(axis=1) / s**loop.zeros_at_origin
    return np.vstack([rig.drive * whole / s**at_rest, fed_back]) * np.exp(rig.scale - rig.scale.real.max())


def _panel(rows: Callable[[Complex], Complex], low: float, high: float) -> tuple[Complex, float]:
    """Return samples of all parts on one panel, the largest 1, and the largest miss between them."""
    # Chebyshev points of the first kind: none in the middle
    number = np.arange(PANEL_SAMPLES)
    angles = np.pi * (number + 0.5) / PANEL_SAMPLES
    points = np.cos(angles)
    # not at s = 0
    others = np.linspace(-0.97, 0.97, 40)
    middle = (low + high) / 2
    half = (high - low) / 2
    both = rows(1j * (middle + half * np.r_[points, others]))
    both = both / abs(both).max()
    values = both[:, :PANEL_SAMPLES]
    between = both[:, PANEL_SAMPLES:]
    # barycentric weights of the polynomial through the points
    weights = (-1.0) ** number * np.sin(angles) / (others[:, None] - points)
    missed = abs(values @ weights.T / weights.sum(axis=1) - between)
    return values, float((missed.max(axis=1) / abs(values).max(axis=1)).max())


@frozen
class Positions:
    """Sensor positions `x` (n,) [m] from the clamp, and `participation` (modes, n) of the first flexible modes there.

    The largest of a mode is 1 in size; `natural_frequency` (modes,) is in rad/s.  `zeros` [1/s] of each position are
    those with 0 < Im s < `band` [rad/s], and the real ones from 0 to it, which limit the bandwidth of every law.
    """

    x: Real
    band: float
    natural_frequency: Real
    participation: Real
    zeros: tuple[Complex, ...]

    @property
    def known_zeros(self) -> tuple[Complex, ...]:
        """The same, with 0 for a real or imaginary part below the error of a zero."""
        return tuple(map(_without_rounding, self.zeros))


def _without_rounding(s: Complex) -> Complex:
    """Return zeros, with 0 for a real or imaginary part below 1e-8 of their size."""
    least = 1e-8 * abs(s)
    return np.where(abs(s.real) > least, s.real, 0.0) + 1j * np.where(abs(s.imag) > least, s.imag, 0.0)


def sensed_places(arm: Arm, sensor: Sensor, x: Real, count: int) -> Real:
    """Return the places x [m] at which a sensor reads any of the first modes: not an end that none moves, or bends."""
    # of a mode's largest: a reading no larger of any mode is none
    not_sensed = 1e-9
    size = abs(_readings(modes(arm, count), sensor, x))
    is_read = size > not_sensed * size.max(axis=1, keepdims=True)
    return np.asarray(x[is_read.any(axis=0)])


def _readings(found: Modes, sensor: Sensor, x: Real) -> Real:
    """Return the reading of each flexible mode by a sensor at each x (modes, n)."""
    read = found.shape if sensor == "displacement" else found.moment
    return np.asarray(read(x)[found.index > 0])


def positions(arm: Arm, sensor: Sensor, x: Real, count: int) -> Positions:
    """Return participation of the first `count` modes, and zeros below the next, of a sensor at each x [m].

    Raises ParameterError for an arm that cannot turn, ConvergenceError where the zeros are not complete.
    """
    must_turn(arm)
    found = modes(arm, count)
    band = frequency_above_mode(arm, count)
    zeros = []
    for place in x.tolist():
        every = transfer(arm, sensor, x=place).zeros(up_to=band).values
        zeros.append(every[(every.imag > 0) | ((every.imag == 0) & (every.real > 0))])
    readings = _readings(found, sensor, x)
    participation = readings / abs(readings).max(axis=1, keepdims=True)
    return Positions(x, band, found.natural_frequency[found.index > 0], participation, tuple(zeros))
