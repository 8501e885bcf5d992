"""Mode shapes: the free response at the natural frequencies, in float64, of unit modal mass; exact sensitivities.

At an eigenvalue the state with W = 0 on the axis is in the plane of the payload's states everywhere along the link.  So
the sweeps of the response have the states at both ends of every segment.  Between them each wave is the sum of one
decaying from the inner end and one decaying from the outer end,

    W_j(x) = P_j e^{-t_j x} + R_j e^{-t_j (1 - x)},     2 P_j = W_j(0) - t_j s_j(0),     2 R_j = W_j(1) + t_j s_j(1),

with W_j' = z_j s_j, so that nothing grows or cancels.  For slow segments the transition functions are used.  At a
double frequency the whole plane satisfies both conditions of the hub.  Two other conditions determine two modes, which
are made orthogonal in the modal mass.

The sensitivities d ln w/d ln p are exact, from the energies of the mode.  Rayleigh's quotient w^2 = V/T is stationary
at a mode, so for a parameter p of the energies

    2 d ln w/d ln p = (dV/d ln p - w^2 dT/d ln p)/V

with constant fields.  With constant functions of x/l, the term of a piece's length l is  -2 P l/V,  where

    P = M^2/(2 EI) + Q^2/(2 kappa G A) + Q Psi + w^2 (rhoA W^2 + rhoI Psi^2)/2

is constant along a uniform piece, its energy-momentum (Eshelby 1951).  A rigid piece (the hub's radius, the payload's
offset) has P = Q Psi.  An attachment that moves outwards lengthens the piece inside of it.

In these functions energies are shares of those of the mode: potential and kinetic ones sum to 1 each.
"""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Iterator
from copy import copy
from fractions import Fraction
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import characteristic
from tfarm.exact.compiled import python_of
from tfarm.exact.layout import kernel_row, segment_at
from tfarm.exact.system import Body, Place, Segment, System
from tfarm.exact.values import free_fields
from tfarm.exact.waves import SERIES_RADIUS, even_functions, fill_wave_numbers, transition_rows, transition_series

_even, _rows, _series = python_of(even_functions), python_of(transition_rows), python_of(transition_series)

GAUSS_POINTS = 16  # of a panel; exact for products of waves over a few radians
PANEL_WAVES = 4.0  # rad of the fastest wave in a panel, integrated to the last digit
LEAST_PANELS = 2  # of a segment with slow waves
DOUBLE = 1e-15  # relative gap under which two frequencies are one, with two modes
CLOSE_MODES = 1e-5  # relative gap under which rounding would leave two modes not quite orthogonal
PANELS_AT_ONCE = 2**13  # times modes, each of 4 kB: memory alone
FIRST_BLOCK = 4  # modes; each next block has twice as many: time alone
NO_MOTION = 1e-9  # of another motion of the tip or hub: a smaller one is rounding
AT_HUB, AT_TIP = Place(Fraction(0), "inner"), Place(Fraction(1))


class Shapes:
    """The modes of an undamped system at its natural frequencies, dimensionless, of unit modal mass times EI/L.

    A call with x (shares of the length, 1-D) returns W, Psi, M, Q, each of shape (modes, x), at a joint or a body those
    of its outer side.  Raises ConvergenceError for a mode without a shape.
    """

    def __init__(self, system: System, omega: Real) -> None:
        self.system, self.omega = system, omega
        inner = list(reversed(system.segments))
        edges = np.cumsum([0.0, *(float(each.length) for each in inner)])
        self._segments, self._edges = inner, edges / edges[-1]
        self._rows = [np.array(kernel_row(each)) for each in inner]
        # Each mode is a sum of four responses, two of its own and two of a close neighbour below, for orthogonality:
        # frequency, condition on the axis (`_condition`), scale and factor of each, of shape (4, modes).
        gap = np.r_[np.inf, np.diff(omega) / omega[1:], np.inf]
        is_first, is_second = gap[1:] < DOUBLE, gap[:-1] < DOUBLE
        close = np.minimum(gap[1:], gap[:-1]) < CLOSE_MODES
        left = np.array([self._at_axis(which) for which in (0, 1)])
        best = (abs(left[1]).max(axis=0) > abs(left[0]).max(axis=0)).astype(int)  # the larger one
        Psi, M, Q = np.where(best, left[1], left[0])
        own = np.array([Q, -Psi if system.drive.turns else -M])
        own = np.where(is_first, [[1.0], [0.0]], np.where(is_second, [[0.0], [1.0]], own))
        which = np.array([np.where(close, 2, best), np.full(omega.size, 3)])
        self._factors = np.concatenate([np.where(close, own, [[1.0], [0.0]]), np.zeros((2, omega.size))])
        self._which = np.concatenate([which, np.roll(which, 1, axis=1)])
        self._omegas = np.array([omega, omega, np.roll(omega, 1), np.roll(omega, 1)])
        size = free_fields(system, 1j * omega, ())[2].real  # a cut system has other scales
        self._sizes = np.array([size, size, np.roll(size, 1), np.roll(size, 1)])
        self._normalise()

    def __call__(self, x: Real) -> Real:
        number = np.clip(np.searchsorted(self._edges, x, side="right") - 1, 0, len(self._segments) - 1)
        result = np.empty((4, self.omega.size, x.size))
        for n in np.unique(number):
            here, (low, high) = number == n, self._edges[n : n + 2]
            result[:, :, here] = self._along(int(n), np.clip((x[here] - low) / (high - low), 0.0, 1.0))
        return result

    def part(self, first: int, last: int) -> Shapes:
        """Return the modes first..last - 1."""
        part = copy(self)
        for name in ("omega", "_omegas", "_which", "_sizes", "_factors"):
            setattr(part, name, getattr(self, name)[..., first:last])
        return part

    def blocks(self) -> Iterator[Shapes]:
        """Yield blocks of neighbouring modes with at most `PANELS_AT_ONCE` panels."""
        first = 0
        while first < self.omega.size:
            last = min(2 * first + FIRST_BLOCK, self.omega.size)
            while last > first + 1 and (last - first) * sum(self.part(first, last)._counts) > PANELS_AT_ONCE:
                last = (first + last) // 2
            yield self.part(first, last)
            first = last

    def tip(self) -> Real:
        """Return W, Psi, M, Q of each mode at the tip, (4, modes)."""
        return self.states((AT_TIP,))[0][..., 0]

    def theta(self) -> Real:
        """Return the hub angle of each mode, 0 of a locked hub.

        From the hub's balance A theta = M where A, its inertia and spring, dominates, so that no digit is lost.
        """
        drive = self.system.drive
        if not drive.turns:
            return np.zeros(self.omega.size)
        fields, theta = self.states((AT_HUB,))
        _, _, M, Q = fields[..., 0]
        A = float(drive.stiffness) - float(drive.inertia) * self.omega**2
        heavy = abs(A) > 1.0
        return np.where(heavy, (M + float(self.system.radius) * Q) / np.where(heavy, A, 1.0), theta)

    def masses(self) -> Real:
        """Return the modal masses."""
        return np.sum([weight @ motion**2 for weight, motion in self._moving()], axis=0)

    def mass_matrix(self) -> Real:
        """Return modal masses (diagonal) and products of different modes, in EI/L: the identity to rounding."""
        return np.asarray(sum((motion.T * weight) @ motion for weight, motion in self._moving()))

    def states(self, places: tuple[Place, ...]) -> tuple[Real, Real]:
        """Return W, Psi, M, Q (fields, modes, places) and the hub angle (modes,)."""
        fields, theta = np.zeros((4, self.omega.size, len(places))), np.zeros(self.omega.size)
        for row in range(len(self._factors)):
            (used,) = np.nonzero(self._factors[row])
            if used.size:
                more, turned = self._raw(row, used, places)
                fields[:, used], theta[used] = fields[:, used] + more, theta[used] + turned
        return fields, theta

    def panels(self) -> Iterator[tuple[Segment, Real, Real]]:
        """Yield each segment, weights of its Gauss points as shares of the whole length, and W, Psi, M, Q there."""
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        for number, (each, count) in enumerate(zip(self._segments, self._counts, strict=True)):
            shares = ((np.arange(count)[:, None] + (nodes + 1) / 2) / count).ravel()
            yield each, np.tile(weights / 2 / count, count) * float(each.length), self._along(number, shares)

    # ------------------------------------------------------------ inside

    @property
    def _counts(self) -> list[int]:
        """Numbers of panels of the segments, short against every wave of these modes."""
        S = self.omega.max() ** 2
        waves = [(float(each.g) * S) ** 0.25 + math.sqrt(S * float(each.a + each.b)) for each in self._segments]
        return [LEAST_PANELS + math.ceil(each / PANEL_WAVES) for each in waves]

    def _at_axis(self, which: int) -> Real:
        """Return Psi, M and Q (3, modes) on the axis, of the state with a condition at each frequency."""
        axis = self._condition(which, self.omega)
        fields, theta, _ = free_fields(self.system, 1j * self.omega, (AT_HUB,), axis)
        _, _, M, Q = fields[..., 0]
        return np.array([theta, M + float(self.system.radius) * Q, Q]).real

    def _condition(self, which: int, omega: Real) -> Real:
        """Return a condition (4, modes) on the axis: W = 0, the balance A Psi = M, or one of two for close modes."""
        A = float(self.system.drive.stiffness) - float(self.system.drive.inertia) * omega**2
        moment = 1.0 if self.system.drive.turns else 0.0
        size = np.maximum(abs(A), moment) if moment else np.ones(omega.size)
        balance = np.array([0.0 * A, A / size if moment else size, -moment / size, 0.0 * A])
        units = np.eye(4)[:, :, None] * np.ones(omega.size)
        return (units[0], balance, units[1] if moment else units[2], units[3])[which]

    def _raw(self, row: int, modes: Any, places: tuple[Place, ...]) -> tuple[Real, Real]:
        """Return states and hub angles of those modes in one of their four responses."""
        omega, which = self._omegas[row, modes], self._which[row, modes]
        fields, theta = np.empty((4, omega.size, len(places))), np.empty(omega.size)
        for number in np.unique(which):
            here, axis = which == number, self._condition(int(number), omega)
            if here.any():
                states, turned, scale = free_fields(self.system, 1j * omega[here], places, axis[:, here])
                unit = np.exp(scale - self._sizes[row, modes][here]) * self._factors[row, modes][here]
                fields[:, here], theta[here] = (states * unit[:, None]).real, (turned * unit).real  # real on the axis
        return fields, theta

    def _along(self, number: int, x: Real) -> Real:
        """Return W, Psi, M, Q (4, modes, x) at the shares x of a segment, in the units of the system."""
        segment, ends = self._segments[number], Fraction(0)
        for each in self._segments[:number]:
            ends += each.length
        places = Place(ends, "outer"), Place(min(ends + segment.length, Fraction(1)), "inner")
        units = np.array([float(each) for each in segment.units])
        own = np.array([units[0], 1.0, units[1], units[2]])[:, None]
        result = np.zeros((4, self.omega.size, x.size))
        for row in range(len(self._factors)):
            (used,) = np.nonzero(self._factors[row])
            if used.size:
                states, _ = self._raw(row, used, places)
                result[:, used] += _of_segment(segment, self._rows[number], self._omegas[row, used], states, own, x)
        return result

    def _moving(self) -> list[tuple[Real, Real]]:
        """Return inertias (n,) and their motions (n, modes): along the segments, of bodies, payload and hub."""
        system, parts = self.system, []
        for piece, weights, (W, Psi, _, _) in self.panels():
            parts.append((float(piece.g * piece.stiffness / piece.length**4) * weights, W.T))
            parts.append((float(piece.a * piece.stiffness / piece.length**2) * weights, Psi.T))
        for share, body in self._bodies():
            W, Psi = self.states((Place(share, "inner"),))[0][:2, :, 0]
            parts += [(np.array([float(body.mass)]), W[None]), (np.array([float(body.inertia)]), Psi[None])]
        W, Psi, *_ = self.tip()
        ends = (
            (system.tip_mass, W + float(system.offset) * Psi),
            (system.tip_inertia, Psi),
            (system.drive.inertia, self.theta()),
        )
        return parts + [(np.array([float(size)]), motion[None]) for size, motion in ends if math.isfinite(size)]

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
        if not self.omega.size:
            return
        with np.errstate(all="ignore"):
            self._factors[:2] /= np.sqrt(np.concatenate([part.masses() for part in self.blocks()]))
        lost = ~np.isfinite(self._factors).all(axis=0)
        if lost.any():
            worst = float(self.omega[lost][0])
            raise ConvergenceError(f"the mode at {worst:.10g} rad/s has no shape", worst, 0.0)
        for lower in map(int, np.flatnonzero(np.diff(self.omega) < CLOSE_MODES * self.omega[1:])):
            overlap = self.part(lower, lower + 2).mass_matrix()[0, 1]
            self._factors[2:, lower + 1] = -overlap * self._factors[:2, lower]
            self._factors[:, lower + 1] /= math.sqrt(self.part(lower + 1, lower + 2).masses()[0])
        tip, theta = self.tip(), self.theta()
        turned = np.where(abs(tip[1]) > NO_MOTION * abs(theta), tip[1], theta)
        motion = np.where(abs(tip[0]) > NO_MOTION * abs(tip[1]), tip[0], turned)
        self._factors = self._factors * np.where(motion < 0, -1.0, 1.0)


def _of_segment(segment: Segment, row: Real, omega: Real, ends: Real, own: Real, x: Real) -> Real:
    """Return W, Psi, M, Q (4, modes, x) from the states (4, modes, 2) at both ends.

    `row` is the segment for compiled code, `own` are its units.
    """
    numbers = np.empty((2, 3, omega.size), complex)
    fill_wave_numbers(1j * omega, row, numbers)
    inner, outer = ends[..., 0] * own, ends[..., 1] * own
    low = abs(numbers[:, 0]).max(axis=0) < SERIES_RADIUS
    result = np.empty((4, omega.size, x.size))
    result[:, low] = _by_series(segment, omega[low], inner[:, low], x)
    result[:, ~low] = _by_waves(segment, omega[~low], numbers[..., ~low], inner[:, ~low], outer[:, ~low], x)
    result[:, :, x == 0.0], result[:, :, x == 1.0] = inner[..., None], outer[..., None]
    return result / own[..., None]


def _by_series(segment: Segment, omega: Real, inner: Real, x: Real) -> Real:
    """Return W, Psi, M, Q in a slow segment's own units, carried outwards, with the other sign of Psi and Q."""
    a, b, g, _ = k = [float(each) for each in segment[:4]]
    S, outwards = -(omega[:, None] ** 2), np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    F0, F1, F2, F3, _, _ = _series(S * (a + b) * x**2, S * (a * b * S + g) * x**4)
    rows = _rows((x**3 * F0, x**2 * F1, x * F2, F3), S, 1.0, k)
    state = (inner * outwards)[..., None]
    carried = [sum(entry * part for entry, part in zip(row, state, strict=True)) for row in rows]
    return np.array(carried).reshape(4, omega.size, x.size) * outwards[..., None]


def _by_waves(segment: Segment, omega: Real, numbers: Complex, inner: Real, outer: Real, x: Real) -> Real:
    """Return W, Psi, M, Q in a fast segment's own units, of both waves."""
    gS = -float(segment.g) * omega**2
    pairs = zip(numbers, numbers[::-1], strict=True)
    fields: Any = np.zeros((4, omega.size, x.size), complex)
    for (z, v, t), (other, v_other, _) in pairs:
        (W0, s0), (W1, s1) = (
            ((M - v_other * W) / (z - other), (Psi - v_other * Q / gS) / (z - other)) for W, Psi, M, Q in (inner, outer)
        )
        slow = abs(z) < 1.0  # little phase along the segment: P and R would cancel
        z, t = (np.where(is_used, part, 1.0)[:, None] for is_used, part in ((slow, z), (~slow, t)))
        from_inner = (W0 - t[:, 0] * s0)[:, None] / 2 * np.exp(-t * x)
        from_outer = (W1 + t[:, 0] * s1)[:, None] / 2 * np.exp(-t * (1 - x))
        c, s = _even(z * x**2)
        even, odd, is_slow = W0[:, None], s0[:, None], slow[:, None]
        W = np.where(is_slow, even * c + z * odd * x * s, from_inner + from_outer)
        slope = np.where(is_slow, odd * c + even * x * s, (from_outer - from_inner) / t)
        fields += np.array([W, v[:, None] * slope, v[:, None] * W, gS[:, None] * slope])
    return np.asarray(fields.real)


def mode_field(k: System, s: complex, quantity: str, x: NDArray[np.float64]) -> Complex:
    """Return "W", "Psi" or "M" (dimensionless lengths and moments) at the shares x, of unit modal mass in SI units.

    At an eigenvalue  D'(s) theta = a  (locked hub: D'(s) M = a),  a the mode's  2 s (mass) + (damping)  in the shape's
    own scale (reciprocity, differentiated); the shape is scaled to  a = 2 s, its tip moving up (turning, if pinned).
    """
    at, places = np.array([s]), [Place(Fraction(float(share))) for share in (*x, 1.0)]
    fields, angle, scale = free_fields(k, at, [*places, AT_HUB])
    drive = characteristic(k, at)
    slope, back = drive.slope[0], np.exp(scale - drive.scale)  # a cut system has another scale
    fields, theta = fields * back, complex((angle * back)[0])
    _, _, M, Q = fields[:, 0, -1]
    M = M + float(k.radius) * Q
    lag = 1.0 + float(k.drive.lag) * s
    A = np.polyval([float(each) for each in reversed(k.drive.of_angle)], s)
    if k.drive.turns and abs(A) > abs(lag):  # the balance of a heavy hub, for the digits of M
        theta = M * lag / A
    product = complex(slope * (theta / lag if k.drive.turns else M))
    if product == 0 or not np.isfinite(product):
        raise ConvergenceError(f"the mode at {s:.6g} 1/s is double, or the hub is at a node of it", s, slope)
    values = fields[("W", "Psi", "M").index(quantity), 0, :-1]
    if quantity == "M":
        damping = [segment_at(k, each).damping for each in places]
        values = values / (1.0 + s * np.array(damping))
    unit = np.sqrt(2 * s / product * float(k.length / k.EI))
    tip = fields[0 if isinstance(k.tip_mass, Fraction) else 1, 0, -2]
    return np.asarray((-unit if (unit * tip).real < 0 else unit) * values[:-1], dtype=complex)


Doubled = dict[str, Real]  # 2 d ln w/d ln p of each mode (modes,)

LINK = ("length", "density", "youngs_modulus", "shear_modulus", "shear_factor", "area", "second_moment")
PARAMETERS = (*LINK, "hub_inertia", "payload_mass", "payload_inertia")  # of every arm; a rig has more


def sensitivities(arm: Arm, shapes: Shapes) -> dict[str, Real]:
    """Return d ln w/d ln p of the arm's parameters, by parameter, for each mode of `shapes`.

    All arms have those of link (all segments together), hub and payload; others "segment_1_length", ... of each
    segment, "attachment_1_x", ... and those of springs, rotor and offsets.  Attachments move with a length.
    """
    parts = [_of_modes(arm, part) for part in shapes.blocks()]
    return {name: np.concatenate([each[name] for each in parts]) / 2 + 0.0 for name in parts[0]}


def _of_modes(arm: Arm, shapes: Shapes) -> Doubled:
    ends = list(accumulate(Fraction(link.length) / shapes.system.length for link in arm.links))  # from the hub outwards
    totals, start = [np.zeros((5, shapes.omega.size)) for _ in arm.links], Fraction(0)
    for piece, weight, fields in shapes.panels():
        terms = _densities(piece, shapes.omega[:, None], *fields)
        totals[bisect(ends, start)] += np.array([term @ weight for term in terms])
        start += piece.length
    segments = [_of_link(*total) for total in totals]
    found = {name: np.sum([each[name] for each in segments], axis=0) for name in LINK}
    found |= _hub(arm, shapes) | _payload(arm, shapes)
    for number, each in enumerate(segments if len(segments) > 1 else (), start=1):
        found |= {f"segment_{number}_{name}": values for name, values in each.items()}
    for number in range(len(arm.attachments)):
        found |= {f"attachment_{number + 1}_{name}": values for name, values in _attachment(arm, shapes, number)}
    return found


def _of_link(bend: Real, shear: Real, slide: Real, move: Real, turn: Real) -> Doubled:
    """Return those of a link from its energies; `slide` is the integral of Q W', twice the work of the shear force."""
    return {
        "length": -bend + shear - 2 * slide - move - turn,
        "density": -move - turn,
        "youngs_modulus": bend,
        "shear_modulus": shear,
        "shear_factor": shear,
        "area": shear - move,
        "second_moment": bend - turn,
    }


def _densities(piece: Segment, omega: Any, W: Any, Psi: Any, M: Any, Q: Any) -> tuple[Any, ...]:
    """Return energies of a piece, as in `_of_link`, per length."""
    length, stiffness, square = float(piece.length), float(piece.stiffness), omega**2
    slip = float(piece.sigma) * length**2 / stiffness  # W' = Psi + slip Q
    bend, shear, slide = M**2 / stiffness / square, slip * Q**2 / square, Q * (Psi + slip * Q) / square
    return (
        bend,
        shear,
        slide,
        float(piece.g) * stiffness / length**4 * W**2,
        float(piece.a) * stiffness / length**2 * (Psi**2),
    )


def _hub(arm: Arm, shapes: Shapes) -> Doubled:
    """Return those of hub, rotor, clamp and joint; behind the clamp the rotation is Psi - M/k, at the joint theta."""
    chain, hub, square = shapes.system, arm.hub, shapes.omega**2
    per_rotation, theta = float(chain.length / chain.EI), shapes.theta()
    _, Psi, M, Q = shapes.states((AT_HUB,))[0][..., 0]
    found = {"hub_inertia": -hub.inertia * per_rotation * theta**2 if not arm.is_locked else np.zeros_like(theta)}
    if not arm.clamp.is_rigid:
        found["clamp_stiffness"] = M**2 / (arm.clamp.stiffness * per_rotation) / square
        Psi = Psi - M / (arm.clamp.stiffness * per_rotation)
    if hub.radius:
        found["hub_radius"] = -2 * float(chain.radius) * Q * Psi / square
        M = M + float(chain.radius) * Q
    if not arm.joint.is_rigid:
        found["joint_stiffness"] = M**2 / (arm.joint.stiffness * per_rotation) / square
    if hub.stiffness:
        found["hub_stiffness"] = hub.stiffness * per_rotation * theta**2 / square
    if arm.motor is not None and arm.motor.rotor_inertia:
        rotor = -arm.motor.reflected_inertia * per_rotation * theta**2 * (not arm.is_locked)
        found |= {"rotor_inertia": rotor, "gear_ratio": 2 * rotor}
    return found


def _payload(arm: Arm, shapes: Shapes) -> Doubled:
    """Return those of the payload, with the displacement W + e Psi."""
    chain, square = shapes.system, shapes.omega**2
    W, Psi, _, Q = shapes.tip()
    motions = (("mass", chain.tip_mass, W + float(chain.offset) * Psi), ("inertia", chain.tip_inertia, Psi))
    found = {
        f"payload_{name}": -float(inertia) * motion**2 if math.isfinite(inertia) else np.zeros_like(motion)
        for name, inertia, motion in motions
    }
    if arm.payload.offset:
        found["payload_offset"] = -2 * float(chain.offset) * Q * Psi / square
    return found


def _attachment(arm: Arm, shapes: Shapes, number: int) -> Iterator[tuple[str, Real]]:
    """Yield those of an attachment; also of its place, where the link is uniform around it and has no other there."""
    each, chain, square = arm.attachments[number], shapes.system, shapes.omega**2
    share = min(Fraction(each.x) / chain.length, Fraction(1))
    sides = Place(share, "inner"), Place(share, "outer")
    inner, outer = shapes.states(sides)[0].transpose(2, 0, 1)
    per_motion, per_rotation = float(chain.length**3 / chain.EI), float(chain.length / chain.EI)
    joints = list(accumulate((Fraction(link.length) for link in arm.links), initial=Fraction(0)))
    if Fraction(each.x) not in joints and sum(other.x == each.x for other in arm.attachments) == 1:
        pieces = [segment_at(chain, side) for side in sides]
        beyond, within = (
            _of_link(*_densities(piece, shapes.omega, *state))["length"]
            for piece, state in zip(pieces[::-1], (outer, inner), strict=True)
        )
        yield "x", (within - beyond) * float(share)
    translation, rotation = per_motion * outer[0] ** 2, per_rotation * outer[1] ** 2
    energies = {  # kinetic ones negative
        "mass": -translation,
        "inertia": -rotation,
        "stiffness": translation / square,
        "rotational_stiffness": rotation / square,
    }
    yield from ((name, value * energy) for name, energy in energies.items() if (value := getattr(each, name)))
