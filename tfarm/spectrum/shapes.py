"""Mode shapes: the free response at the natural frequencies, in float64, of unit modal mass.

At an eigenvalue the state with W = 0 on the axis is in the plane of the payload's states everywhere along the link.  So
the sweeps of the response have the states at both ends of every segment.  Between them each wave is the sum of one
decaying from the inner end and one decaying from the outer end,

    W_j(x) = P_j e^{-t_j x} + R_j e^{-t_j (1 - x)},     2 P_j = W_j(0) - t_j s_j(0),     2 R_j = W_j(1) + t_j s_j(1),

with W_j' = z_j s_j, so that nothing grows or cancels.  For slow segments the transition functions are used.  At a
double frequency the whole plane satisfies both conditions of the hub.  Two other conditions determine two modes, which
are made orthogonal in the modal mass.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import copy
from fractions import Fraction
from itertools import accumulate, pairwise
from operator import mul
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import LEAST_SIZE, Complex, Real, Whole
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import characteristic
from tfarm.exact.compiled import python_of
from tfarm.exact.layout import ROW, kernel_row, segment_at
from tfarm.exact.system import Body, Place, Segment, System
from tfarm.exact.values import free_fields
from tfarm.exact.waves import SERIES_RADIUS, fill_wave_numbers, transition_rows, transition_series
from tfarm.records import read_only

_rows = python_of(transition_rows)
_series = python_of(transition_series)

AT_HUB = Place(Fraction(0), "inner")


class Shapes:
    """The modes of an undamped system at its natural frequencies, dimensionless, of unit modal mass times EI/L.

    A call with x (shares of the length, 1-D) returns W, Psi, M, Q, each of shape (modes, x), at a joint or a body those
    of its outer side.  Raises ConvergenceError for a mode without a shape.
    """

    # relative gap under which rounding would leave two modes not quite orthogonal
    close_gap = 1e-5

    def __init__(self, system: System, omega: Real) -> None:
        # relative gap under which two frequencies are one, with two modes
        double = 1e-15
        self.system = system
        self.omega = omega
        self._segments = list(reversed(system.segments))
        joints = list(accumulate((each.length for each in self._segments), initial=Fraction(0)))
        self._ends = [
            (Place(low, "outer"), Place(min(high, Fraction(1)), "inner")) for low, high in pairwise(joints)
        ]
        edges = np.array([float(each) for each in joints])
        self._edges = edges / edges[-1]
        # Each mode is a sum of four responses, two of its own and two of a close neighbour below, for orthogonality:
        # frequency, condition on the axis (`_conditions`), scale and factor of each, the modes last.
        gap = np.r_[np.inf, np.diff(omega) / omega[1:], np.inf]
        is_first = gap[1:] < double
        is_second = gap[:-1] < double
        close = np.minimum(gap[1:], gap[:-1]) < self.close_gap
        conditions = self._conditions()
        left = np.array([self._at_axis(axis) for axis in conditions[:2]])
        # the larger one
        best = (abs(left[1]).max(axis=0) > abs(left[0]).max(axis=0)).astype(int)
        Psi, M, Q = np.where(best, left[1], left[0])
        opposite = Psi if system.drive.turns else M
        own = np.array([Q, -opposite])
        own = np.where(is_first, [[1.0], [0.0]], np.where(is_second, [[0.0], [1.0]], own))
        factors = np.where(close, own, [[1.0], [0.0]])
        self._factors = np.concatenate([factors, np.zeros((2, omega.size))])
        single = np.where(best, conditions[1], conditions[0])
        axes = [np.where(close, conditions[2], single), conditions[3]]
        self._axes = np.array([*axes, *np.roll(axes, 1, axis=-1)])
        self._omegas = np.array([omega, omega, np.roll(omega, 1), np.roll(omega, 1)])
        # a cut system has other scales
        size = free_fields(system, 1j * omega, ())[2].real
        self._sizes = np.array([size, size, np.roll(size, 1), np.roll(size, 1)])
        self._normalise()

    def __call__(self, x: Real) -> Real:
        result = np.empty((4, self.omega.size, x.size))
        for number, here, share in self._by_segment(x):
            result[:, :, here] = self._along(number, share)
        return result

    def at(self, mode: Whole, x: Real) -> Real:
        """Return W, Psi, M, Q (4, n), those of mode[i] at x[i]."""
        result = np.empty((4, x.size))
        for number, here, share in self._by_segment(x):
            result[:, here] = self.part(mode[here])._along(number, share[:, None])[..., 0]
        return result

    def part(self, modes: slice | Whole) -> Shapes:
        """Return some of the modes."""
        part = copy(self)
        for name in ("omega", "_omegas", "_axes", "_sizes", "_factors"):
            setattr(part, name, getattr(self, name)[..., modes])
        return part

    def blocks(self) -> Iterator[Shapes]:
        """Yield blocks of neighbouring modes with a bounded number of panels times modes."""
        # each of 4 kB: memory alone
        most_panels = 2**13
        first = 0
        while first < self.omega.size:
            # 4 modes; each next block has twice as many: time alone
            block = self.part(slice(first, 2 * first + 4))
            while block.omega.size > 1 and block.omega.size * sum(block._counts) > most_panels:
                block = block.part(slice(block.omega.size // 2))
            yield block
            first += block.omega.size

    def tip(self) -> Real:
        """Return W, Psi, M, Q of each mode at the tip, (4, modes)."""
        return self.states((Place(Fraction(1)),))[0][..., 0]

    def root(self) -> Real:
        """Return W, Psi, M, Q of each mode at the hub's end of the link, (4, modes)."""
        return self.states((AT_HUB,))[0][..., 0]

    def theta(self) -> Real:
        """Return the hub angle of each mode, 0 of a locked hub.

        From the hub's balance A theta = M where A, its inertia and spring, dominates, so that no digit is lost.
        """
        drive = self.system.drive
        if not drive.turns:
            return np.zeros(self.omega.size)
        fields, theta = self.states((AT_HUB,))
        _, _, M, Q = fields[..., 0]
        A = self._hub_balance()
        heavy = abs(A) > 1.0
        return np.where(heavy, (M + float(self.system.radius) * Q) / np.where(heavy, A, 1.0), theta)

    def masses(self) -> Real:
        """Return the modal masses."""
        return np.sum([weight @ motion**2 for weight, motion in self._inertias()], axis=0)

    def mass_matrix(self) -> Real:
        """Return modal masses (diagonal) and products of different modes, in EI/L: the identity to rounding."""
        return np.asarray(sum((motion.T * weight) @ motion for weight, motion in self._inertias()))

    def states(self, places: tuple[Place, ...]) -> tuple[Real, Real]:
        """Return W, Psi, M, Q (fields, modes, places) and the hub angle (modes,)."""
        fields = np.zeros((4, self.omega.size, len(places)))
        theta = np.zeros(self.omega.size)
        for modes, _, more, turned in self._responses(places):
            fields[:, modes] += more
            theta[modes] += turned
        return fields, theta

    def panels(self) -> Iterator[tuple[Segment, Real, Real]]:
        """Yield each segment, weights of its Gauss points as shares of the whole length, and W, Psi, M, Q there."""
        # 16 of a panel; exact for products of waves over a few radians
        nodes, weights = np.polynomial.legendre.leggauss(16)
        for number, (each, count) in enumerate(zip(self._segments, self._counts, strict=True)):
            shares = ((np.arange(count)[:, None] + (nodes + 1) / 2) / count).ravel()
            yield each, np.tile(weights / 2 / count, count) * float(each.length), self._along(number, shares)

    # ------------------------------------------------------------ inside

    def _by_segment(self, x: Real) -> Iterator[tuple[int, Whole, Real]]:
        """Yield each segment with points, the indices of these, and their shares of its length."""
        segment = np.clip(np.searchsorted(self._edges, x, side="right") - 1, 0, len(self._segments) - 1)
        for number in np.unique(segment).tolist():
            (here,) = np.nonzero(segment == number)
            low, high = self._edges[number : number + 2]
            yield number, here, np.clip((x[here] - low) / (high - low), 0.0, 1.0)

    @property
    def _counts(self) -> list[int]:
        """Numbers of panels of the segments, short against every wave of these modes."""
        S = self.omega.max() ** 2
        waves = [
            (float(each.g) * S) ** 0.25 + math.sqrt(S * float(each.a + each.b)) for each in self._segments
        ]
        # 4.0 rad of the fastest wave in a panel, integrated to the last digit
        # 2 of a segment with slow waves
        return [2 + math.ceil(each / 4.0) for each in waves]

    def _at_axis(self, axis: Real) -> Real:
        """Return Psi, M and Q (3, modes) on the axis, of the state with a condition at each frequency."""
        fields, theta, _ = free_fields(self.system, 1j * self.omega, (AT_HUB,), axis)
        _, _, M, Q = fields[..., 0]
        return np.array([theta, M + float(self.system.radius) * Q, Q]).real

    def _hub_balance(self) -> Real:
        """Return A (modes,) of the hub's balance A theta = M, of its inertia and spring."""
        drive = self.system.drive
        return float(drive.stiffness) - float(drive.inertia) * self.omega**2

    def _conditions(self) -> Real:
        """Return conditions (4, 4, modes) on the axis: W = 0, the balance A Psi = M, and two for close modes."""
        A = self._hub_balance()
        none = 0 * self.omega
        units = np.eye(4)[:, :, None] + none
        size = np.maximum(abs(A), 1.0)
        balance = [none, A / size, -1.0 / size, none]
        if self.system.drive.turns:
            return np.array([units[0], balance, units[1], units[3]])
        return units

    def _responses(self, places: tuple[Place, ...]) -> Iterator[tuple[Whole, Real, Real, Real]]:
        """Yield each response: the modes that have it, its frequencies, states (4, modes, places) and hub angles."""
        for omega, axes, size, factor in zip(
            self._omegas, self._axes, self._sizes, self._factors, strict=True
        ):
            (modes,) = np.nonzero(factor)
            if modes.size:
                states, theta, scale = free_fields(self.system, 1j * omega[modes], places, axes[:, modes])
                unit = np.exp(scale - size[modes]) * factor[modes]
                # real on the axis
                yield modes, omega[modes], (states * unit[:, None]).real, (theta * unit).real

    def _along(self, number: int, x: Real) -> Real:
        """Return W, Psi, M, Q (4, modes, n) at the shares x, (n,) or (modes, n), of a segment."""
        x = np.broadcast_to(x, (self.omega.size, x.shape[-1]))
        result = np.zeros((4, *x.shape))
        for modes, omega, states, _ in self._responses(self._ends[number]):
            result[:, modes] += _of_segment(self._segments[number], omega, states, x[modes])
        return result

    def _inertias(self) -> list[tuple[Real, Real]]:
        """Return inertias (n,) and their motions (n, modes): along the segments, of bodies, payload and hub."""
        system = self.system
        parts = []
        for piece, weights, (W, Psi, _, _) in self.panels():
            parts.append((float(piece.g * piece.stiffness / piece.length**4) * weights, W.T))
            parts.append((float(piece.a * piece.stiffness / piece.length**2) * weights, Psi.T))
        single: list[tuple[Any, Real]] = []
        for share, body in self._bodies():
            W, Psi = self.states((Place(share, "inner"),))[0][:2, :, 0]
            single += [(body.mass, W), (body.inertia, Psi)]
        W, Psi, *_ = self.tip()
        single += [(system.tip_mass, W + float(system.offset) * Psi), (system.tip_inertia, Psi)]
        single.append((system.drive.inertia, self.theta()))
        for size, motion in single:
            # an infinite one rests
            if math.isfinite(size):
                parts.append((np.array([float(size)]), motion[None]))
        return parts

    def _bodies(self) -> Iterator[tuple[Fraction, Body]]:
        """Yield the place and each body."""
        position = Fraction(1)
        for each in self.system.elements:
            if isinstance(each, Segment):
                position -= each.length
            elif isinstance(each, Body):
                yield position, each

    def _normalise(self) -> None:
        """Scale to unit modal mass and a positive tip (else its rotation, else the hub), close modes orthogonal."""
        # of another motion of the tip or hub: a smaller one is rounding
        no_motion = 1e-9
        if not self.omega.size:
            return
        with np.errstate(all="ignore"):
            self._factors[:2] /= np.sqrt(np.concatenate([part.masses() for part in self.blocks()]))
        lost = ~np.isfinite(self._factors).all(axis=0)
        if lost.any():
            worst = float(self.omega[lost][0])
            raise ConvergenceError(f"the mode at {worst:.10g} rad/s has no shape", worst, 0.0)
        for lower in map(int, np.flatnonzero(np.diff(self.omega) < self.close_gap * self.omega[1:])):
            upper = lower + 1
            overlap = self.part(slice(lower, lower + 2)).mass_matrix()[0, 1]
            self._factors[2:, upper] = -overlap * self._factors[:2, lower]
            self._factors[:, upper] /= math.sqrt(self.part(slice(upper, upper + 1)).masses()[0])
        tip = self.tip()
        theta = self.theta()
        turned = np.where(abs(tip[1]) > no_motion * abs(theta), tip[1], theta)
        motion = np.where(abs(tip[0]) > no_motion * abs(tip[1]), tip[0], turned)
        self._factors = self._factors * np.where(motion < 0, -1.0, 1.0)


def _of_segment(segment: Segment, omega: Real, ends: Real, x: Real) -> Real:
    """Return W, Psi, M, Q (4, modes, n) at the shares x (modes, n) from the states (4, modes, 2) at both ends."""
    numbers = np.empty((2, 3, omega.size), complex)
    result = np.empty((4, *x.shape))
    fill_wave_numbers(1j * omega, read_only(np.array([kernel_row(segment)], ROW)), numbers)
    of_W, *others = [float(each) for each in segment.units]
    own = np.array([of_W, 1.0, *others])[:, None]
    inner = ends[..., 0] * own
    outer = ends[..., 1] * own
    low = abs(numbers[:, 0]).max(axis=0) < SERIES_RADIUS
    if low.any():
        result[:, low] = _by_series(segment, omega[low], inner[:, low], x[low])
    if not low.all():
        fast = ~low
        result[:, fast] = _by_waves(
            segment, omega[fast], numbers[..., fast], inner[:, fast], outer[:, fast], x[fast]
        )
    for end, state in ((0.0, inner), (1.0, outer)):
        mode, point = np.nonzero(x == end)
        result[:, mode, point] = state[:, mode]
    return result / own[..., None]


def _by_series(segment: Segment, omega: Real, inner: Real, x: Real) -> Real:
    """Return W, Psi, M, Q in a slow segment's own units, carried outwards, with the other sign of Psi and Q."""
    a, b, g, _ = k = [float(each) for each in segment[:4]]
    S = -(omega[:, None] ** 2)
    outwards = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    F0, F1, F2, F3, _, _ = _series(S * (a + b) * x**2, S * (a * b * S + g) * x**4)
    rows = _rows((x**3 * F0, x**2 * F1, x * F2, F3), S, 1.0, k)
    state = (inner * outwards)[..., None]
    return np.array([sum(map(mul, row, state)) for row in rows]) * outwards[..., None]


def _by_waves(segment: Segment, omega: Real, numbers: Complex, inner: Real, outer: Real, x: Real) -> Real:
    """Return W, Psi, M, Q in a fast segment's own units, of both waves: without damping their z and v are real."""
    gS = -float(segment.g) * omega**2
    z = numbers[:, 0].real
    v = numbers[:, 1].real
    k = abs(numbers[:, 2])
    fields = np.zeros((4, *x.shape))
    for n, other in ((0, 1), (1, 0)):
        gap = z[n] - z[other]
        states = [
            ((M - v[other] * W) / gap, (Psi - v[other] * Q / gS) / gap) for W, Psi, M, Q in (inner, outer)
        ]
        wave, slope = _wave(z[n], k[n], states, x)
        fields += np.array([wave, v[n, :, None] * slope, v[n, :, None] * wave, gS[:, None] * slope])
    return fields


def _wave(z: Real, k: Real, ends: list[tuple[Real, Real]], x: Real) -> tuple[Real, Real]:
    """Return W_j and s_j (modes, n) of a wave with real z = -k^2 or k^2, from those (modes,) at both ends."""
    z = z[:, None]
    k = np.maximum(k, LEAST_SIZE)[:, None]
    (W0, s0), (W1, s1) = np.array(ends)[..., None]
    wave, slope = np.empty((2, *x.shape))
    for kind, even, odd in ((z < 0, np.cos, np.sin), ((z >= 0) & (z < 1), np.cosh, np.sinh)):
        rows = kind[:, 0]
        c = even(k[rows] * x[rows])
        s = odd(k[rows] * x[rows]) / k[rows]
        wave[rows] = W0[rows] * c + (z * s0)[rows] * s
        slope[rows] = s0[rows] * c + W0[rows] * s
    rows = z[:, 0] >= 1
    from_inner = ((W0 - k * s0)[rows] / 2) * np.exp(-k[rows] * x[rows])
    from_outer = ((W1 + k * s1)[rows] / 2) * np.exp(-k[rows] * (1 - x[rows]))
    wave[rows] = from_inner + from_outer
    slope[rows] = (from_outer - from_inner) / k[rows]
    return wave, slope


def mode_field(k: System, s: complex, quantity: str, x: NDArray[np.float64]) -> Complex:
    """Return "W", "Psi" or "M" (dimensionless lengths and moments) at the shares x, of unit modal mass in SI units.

    At an eigenvalue  D'(s) theta = a  (locked hub: D'(s) M = a),  a the mode's  2 s (mass) + (damping)  in the shape's
    own scale (reciprocity, differentiated); the shape is scaled to  a = 2 s, its tip moving up (turning, if pinned).
    """
    at = np.array([s])
    places = [Place(Fraction(float(share))) for share in (*x, 1.0)]
    fields, angle, scale = free_fields(k, at, [*places, AT_HUB])
    drive = characteristic(k, at)
    # a cut system has another scale
    slope = drive.slope[0]
    back = np.exp(scale - drive.scale)
    fields = fields * back
    theta = complex((angle * back)[0])
    _, _, M, Q = fields[:, 0, -1]
    M = M + float(k.radius) * Q
    A = k.drive.at(at)[0][0]
    B = k.drive.at(at)[1][0]
    # the balance of a heavy hub, for the digits of M
    if abs(A) > abs(B) > 0:
        theta = M * B / A
    motion = theta / B if k.drive.turns else M
    product = complex(slope * motion)
    if product == 0 or not np.isfinite(product):
        raise ConvergenceError(f"the mode at {s:.6g} 1/s is double, or the hub is at a node of it", s, slope)
    values = fields[("W", "Psi", "M").index(quantity), 0, :-1]
    if quantity == "M":
        damping = [segment_at(k, each).damping for each in places]
        values = values / (1.0 + s * np.array(damping))
    unit = np.sqrt(2 * s / product * float(k.length / k.EI))
    is_pinned = not isinstance(k.tip_mass, Fraction)
    tip = fields[int(is_pinned), 0, -2]
    if (unit * tip).real < 0:
        unit = -unit
    return np.asarray(unit * values[:-1], dtype=complex)
