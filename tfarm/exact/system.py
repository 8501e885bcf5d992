"""The exact system of an arm: a chain of dimensionless elements, as exact fractions, from the payload inwards.

Lengths are in L (clamp to tip), moments in EI/L, forces in EI/L^2 of the segment at the hub, time in seconds.

The chain has the payload, the offset of its centre, segments with bodies and springs between them, clamp, hub radius,
joint, and the drive, which is the input of the free response,

    input = sum of A_n s^n theta - sum of B_n s^n M_axis,

with M_axis the moment of the link on the hub.  For a torque A = (k_theta, b, I_h + N^2 J_m) and B = 1; for a motor's
voltage and a prescribed hub angle see `Drive`.  One uniform link is a chain of one segment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from enum import IntEnum
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import takewhile
from typing import Any, Literal, NamedTuple

import numpy as np

from tfarm.arm import THEORIES, WITH_ROTARY_INERTIA, WITH_SHEAR, Arm, Link, RotarySpring, Theory
from tfarm.arm.stages import Consumer
from tfarm.arm.writing import arm_table
from tfarm.arrays import Complex, Real
from tfarm.errors import must_be_known
from tfarm.exact.outputs import Side
from tfarm.records import frozen

ZERO = Fraction(0)
ONE = Fraction(1)
# a fraction, or math.inf
Inertia = Fraction | float


class Segment(NamedTuple):
    """A uniform piece: a, b, g [s^2], sigma, C [s] (see `waves`), length/L, EI/EI at the hub, depth/2 [m]."""

    a: Fraction
    b: Fraction
    g: Fraction
    sigma: Fraction
    damping: float
    length: Fraction
    stiffness: Fraction
    half_depth: float | None = None

    def piece(self, share: Fraction) -> Segment:
        """Return that share of the segment."""
        return self._replace(
            a=self.a * share**2,
            b=self.b * share**2,
            g=self.g * share**4,
            sigma=self.sigma / share**2,
            length=self.length * share,
        )

    @property
    def units(self) -> tuple[Fraction, Fraction, Fraction]:
        """The factors of W, M and Q from the chain's units to those of the segment."""
        return 1 / self.length, self.length / self.stiffness, self.length * self.length / self.stiffness

    @property
    def of_chain(self) -> tuple[Fraction, Fraction, Fraction, Fraction]:
        """The numbers a, b, g and sigma in the chain's units."""
        l = self.length
        EI = self.stiffness
        if l == EI == 1:
            return self.a, self.b, self.g, self.sigma
        return (
            self.a * EI / (l * l),
            self.b / (l * l),
            self.g * EI / (l * l * l * l),
            self.sigma * (l * l) / EI,
        )


class Offset(NamedTuple):
    """A rigid massless piece of that length in L, of either sign."""

    length: Fraction


class Spring(NamedTuple):
    """A rotational spring with a dashpot, k (1 + c s): k/(1 + k), 1/(1 + k) and k c/(1 + k) [s]."""

    stiffness: Fraction
    compliance: Fraction
    damping: Fraction | float


class Body(NamedTuple):
    """Mass and inertia [s^2], springs to ground in both motions."""

    mass: Fraction
    inertia: Fraction
    stiffness: Fraction
    rotational_stiffness: Fraction


class Place(NamedTuple):
    """A point of the link, as a share of its length (0..1), and a side where a body or a joint is at it.

    "payload" is the payload's centre of mass, beyond the tip.
    """

    share: Fraction
    side: Side | Literal["payload"] = "outer"


class Mark(NamedTuple):
    """The place of an output, as an element."""

    place: Place


Element = Segment | Offset | Spring | Body | Mark


class Drive(NamedTuple):
    """The drive at the hub: inertia [s^2], friction [s], stiffness, back-EMF [s] and the lag L_a/R [s].

    The input turns the hub against  Z_h = inertia s^2 + friction s + stiffness,  or is its angle (`turns` false).  A
    voltage has back-EMF and lag too:  (1 + lag s)(Z_h theta - M_axis) + back_emf s theta.  `unit` is the SI value of
    one unit of the input, `per_ampere` the torque at the hub of 1 A [N m/A], 0 without a motor.
    """

    turns: bool
    inertia: Fraction = ZERO
    friction: Fraction = ZERO
    stiffness: Fraction = ZERO
    back_emf: Fraction = ZERO
    lag: Fraction = ZERO
    unit: Fraction = ONE
    per_ampere: Fraction = ZERO

    @property
    def of_angle(self) -> tuple[Fraction, ...]:
        """A_0..A_3."""
        if not self.turns:
            return ONE, ZERO, ZERO, ZERO
        k = self.stiffness
        b = self.friction
        J = self.inertia
        lag = self.lag
        if not lag:
            return k, b + self.back_emf, J, ZERO
        return k, b + lag * k + self.back_emf, J + lag * b, lag * J

    @property
    def of_moment(self) -> tuple[Fraction, Fraction]:
        """B_0 and B_1."""
        return Fraction(self.turns), self.lag * self.turns

    def at(self, s: Complex) -> tuple[Complex, Complex]:
        """Return the sums of A_n s^n and of B_n s^n."""
        return tuple(np.polyval(np.array(each[::-1], float), s) for each in (self.of_angle, self.of_moment))  # type: ignore[return-value]


@lru_cache(maxsize=64)  # a proof needs the same three at every step of its contour
def end_condition(inertia: Inertia) -> tuple[Fraction, Fraction, Fraction]:
    """Return r, n, f of  (r + n s^2) motion + f force = 0  at the end, a body of that dimensionless inertia (0..inf).

    A finite inertia i gives (0, i, 1)/(1 + i), near one, an infinite one (1, 0, 0): motion = 0.
    """
    if not isinstance(inertia, Fraction):
        return ONE, ZERO, ZERO
    return ZERO, inertia / (1 + inertia), 1 / (1 + inertia)


class PlaceOrder(IntEnum):
    """The order at one point, from the payload inwards."""

    payload = 0
    outer = 1
    body = 2
    inner = 3
    next = 4


# distance from the clamp (of a segment's outer end), order there, and element
Placed = tuple[Fraction, PlaceOrder, Element]


def elements_with_places(elements: Iterable[Element]) -> Iterator[Placed]:
    """Yield the elements of a chain, from the payload inwards, with their places."""
    position = ONE
    is_beyond = True
    for each in elements:
        is_beyond = is_beyond and isinstance(each, Offset)
        order = PlaceOrder.next
        if is_beyond:
            order = PlaceOrder.payload
        elif isinstance(each, Body):
            order = PlaceOrder.body
        yield position, order, each
        if isinstance(each, Segment):
            position -= each.length


def cut_segments(elements: Sequence[Placed]) -> tuple[Element, ...]:
    """Return elements in their order from the payload inwards, each segment cut where there is another one on it."""
    ordered = sorted(elements, key=lambda each: (-each[0], each[1]))
    found: list[Element] = []
    inner_ends = [*(position for position, _, _ in ordered[1:]), ZERO]
    for (position, _, each), inner_end in zip(ordered, inner_ends, strict=True):
        if isinstance(each, Segment):
            segment = each
        else:
            found.append(each)
        if inner_end < position:
            length = position - inner_end
            found.append(segment if length == segment.length else segment.piece(length / segment.length))
    return tuple(found)


def ratio(above: Iterable[float], below: Iterable[float] = ()) -> Fraction:
    """Return the exact quotient of two products, as one fraction in lowest terms at the end."""
    p = q = 1
    for each in above:
        n, d = each.as_integer_ratio()
        p = p * n
        q = q * d
    for each in below:
        n, d = each.as_integer_ratio()
        p = p * d
        q = q * n
    return Fraction(p, q)


def stiffness_of(link: Link) -> Fraction:
    """Return E I [N m^2] of a link, exact."""
    return ratio((link.youngs_modulus, link.section.second_moment))


CONSUMER = Consumer("exact solution", acts=("plant",))


@frozen(kw_only=True)
class System:
    """An arm or rig: its elements from the payload inwards, the conditions of both ends, and the units.

    `gauge` is the place of the moment that a law feeds back; with `has_rigid_mode` it can turn freely; `radius` and
    `offset` of hub and payload are shares of the link's `length` [m]; `EI` [N m^2] is that at the hub.
    """

    elements: tuple[Element, ...]
    tip_mass: Inertia
    tip_inertia: Inertia
    drive: Drive
    radius: Fraction
    offset: Fraction
    gauge: Place
    has_rigid_mode: bool
    length: Fraction
    EI: Fraction

    @cached_property
    def kept(self) -> dict[Any, Any]:
        """The cache of layouts and other results of the system."""
        return {}

    def keep(self, key: Any, make: Callable[[], Any]) -> Any:
        """Return the result that is cached under a key, made where there is none."""
        if key not in self.kept:
            # 256: more than the places of a page
            if len(self.kept) >= 256:
                self.kept.clear()
            self.kept[key] = make()
        return self.kept[key]

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The uniform pieces, from the outermost inwards."""
        return tuple(each for each in self.elements if isinstance(each, Segment))

    @property
    def free_motions_of_tip(self) -> int:
        """The number of motions of the tip that no infinite inertia locks."""
        return sum(isinstance(end, Fraction) for end in (self.tip_mass, self.tip_inertia))

    @property
    def reads_hub_moment(self) -> bool:
        """Whether the root moment acts on the hub: a clamp on the axis, without a body there."""
        inside = takewhile(lambda each: not isinstance(each, Segment), reversed(self.elements))
        return not self.radius and not any(isinstance(each, Body) for each in inside)

    @property
    def damping(self) -> float:
        """The largest C [s] of the segments."""
        return max(each.damping for each in self.segments)

    @property
    def is_locked(self) -> bool:
        """Whether the hub angle is the input."""
        return not self.drive.turns

    @property
    def at_rest(self) -> int:
        """The order of the drive's zero at s = 0: 2 of a free rig, 1 with friction, 0 without a rigid-body mode."""
        if not self.has_rigid_mode:
            return 0
        if self.drive.friction or self.drive.back_emf:
            return 1
        return 2

    @cached_property
    def singular(self) -> tuple[float, ...]:
        """-1/C [1/s] of each damped segment, ascending, where eigenvalues accumulate."""
        return tuple(sorted({-1.0 / each.damping for each in self.segments if each.damping}))

    @property
    def is_undamped(self) -> bool:
        """Whether nothing dissipates."""
        dashpots = any(each.damping for each in self.elements if isinstance(each, Segment | Spring))
        return not (dashpots or self.drive.friction or self.drive.back_emf)

    @property
    def is_real_on_axis(self) -> bool:
        """Whether drive and outputs are real at s = i w, up to odd powers of s: no dissipation and no lag."""
        return self.is_undamped and not self.drive.lag

    @property
    def undamped(self) -> System:
        """The chain without all damping: itself where nothing dissipates."""
        return self._undamped or self

    @cached_property
    def _undamped(self) -> System | None:
        """The chain without damping, None where nothing dissipates."""
        if self.is_undamped:
            return None
        return self.with_damping(0.0)

    def with_damping(self, share: float) -> System:
        """Return the chain with a share of all damping: C, dashpots, friction and back-EMF."""
        elements: list[Element] = []
        for each in self.elements:
            if isinstance(each, Segment | Spring):
                elements.append(each._replace(damping=each.damping * share))
            else:
                elements.append(each)
        exact_share = Fraction(share)
        friction = self.drive.friction * exact_share
        back_emf = self.drive.back_emf * exact_share
        drive = self.drive._replace(friction=friction, back_emf=back_emf)
        return replace(self, elements=tuple(elements), drive=drive)


@lru_cache(maxsize=64)  # one page needs the exact numbers of one arm some thousand times
def system_of(arm: Arm, theory: Theory | None = None) -> System:
    """Return the system of an arm under its own theory, or another.

    Raises ParameterError for an unknown theory, and for a part of the arm that is not in the equations.
    """
    theory = theory or arm.theory
    must_be_known("theory", theory, THEORIES)
    CONSUMER.refuse_others(arm_table(arm))
    unit_length = sum((Fraction(link.length) for link in arm.links), ZERO)
    EI = stiffness_of(arm.link)
    rotation = unit_length / EI
    translation = rotation * unit_length * unit_length

    def segment(link: Link) -> Segment:
        L = link.length
        rho = link.density
        A = link.section.area
        E = link.youngs_modulus
        I = link.section.second_moment
        a = b = sigma = ZERO
        if theory in WITH_ROTARY_INERTIA:
            a = ratio((rho, L, L), (E,))
        if theory in WITH_SHEAR:
            kappa_G = link.shear_factor, link.shear_modulus
            b = ratio((rho, L, L), kappa_G)
            sigma = ratio((E, I), (*kappa_G, A, L, L))
        return Segment(
            a=a,
            b=b,
            g=ratio((rho, A, L, L, L, L), (E, I)),
            sigma=sigma,
            damping=link.damping,
            length=Fraction(L) / unit_length if arm.outer else ONE,
            stiffness=stiffness_of(link) / EI if arm.outer else ONE,
            half_depth=link.section.half_depth,
        )

    offset = Fraction(arm.payload.offset) / unit_length
    radius = Fraction(arm.hub.radius) / unit_length
    chain: list[Element] = []
    if offset:
        chain.append(Offset(offset))
    chain += map(segment, reversed(arm.links))
    chain += _springs(arm.clamp, rotation)
    if radius:
        chain.append(Offset(radius))
    chain += _springs(arm.joint, rotation)
    bodies: list[Placed] = []
    for each in reversed(arm.attachments):
        body = Body(
            mass=Fraction(each.mass) * translation,
            inertia=Fraction(each.inertia) * rotation,
            # on the axis, which is fixed, a spring has no effect
            stiffness=Fraction(each.stiffness if each.x or radius else 0) * translation,
            rotational_stiffness=Fraction(each.rotational_stiffness) * rotation,
        )
        bodies.append((min(Fraction(each.x) / unit_length, ONE), PlaceOrder.body, body))
    return System(
        elements=cut_segments([*elements_with_places(chain), *bodies]),
        tip_mass=_inertia(arm.payload.mass, translation),
        tip_inertia=_inertia(arm.payload.inertia, rotation),
        drive=hub_drive(arm, rotation),
        radius=radius,
        offset=offset,
        gauge=Place(min(Fraction(arm.gauge.x) / unit_length, ONE), arm.gauge.side),
        has_rigid_mode=arm.has_rigid_mode,
        length=unit_length,
        EI=EI,
    )


def hub_drive(arm: Arm, rotation: Fraction) -> Drive:
    """Return the drive of an arm's input; `rotation` is L/EI."""
    hub = arm.hub
    motor = arm.motor
    if arm.is_locked:
        return Drive(turns=False)
    inertia = Fraction(hub.inertia) * rotation
    friction = Fraction(hub.friction) * rotation
    stiffness = Fraction(hub.stiffness) * rotation
    drive = Drive(True, inertia, friction, stiffness, unit=1 / rotation)
    if motor is None:
        return drive
    N = Fraction(motor.gear_ratio)
    resistance = Fraction(motor.resistance)
    drive = drive._replace(
        inertia=inertia + N**2 * Fraction(motor.rotor_inertia) * rotation,
        friction=friction + N**2 * Fraction(motor.rotor_friction) * rotation,
        per_ampere=Fraction(motor.gear_efficiency) * N * Fraction(motor.torque_constant),
    )
    if arm.input == "motor_current":
        return drive._replace(unit=drive.unit / drive.per_ampere)
    if arm.input == "motor_voltage":
        return drive._replace(
            back_emf=drive.per_ampere * N * Fraction(motor.back_emf_constant) / resistance * rotation,
            lag=Fraction(motor.inductance) / resistance,
            unit=drive.unit * resistance / drive.per_ampere,
        )
    return drive


def _inertia(value: float, unit: Fraction) -> Inertia:
    """Return a mass or inertia in that unit, or inf."""
    if math.isinf(value):
        return value
    return Fraction(value) * unit


def _springs(spring: RotarySpring, rotation: Fraction) -> list[Element]:
    """Return the spring as an element, or none where it is rigid."""
    if math.isinf(spring.stiffness):
        return []
    k = Fraction(spring.stiffness) * rotation
    share = k / (1 + k)
    return [Spring(share, 1 / (1 + k), share * Fraction(spring.damping))]


def shear_flexibility(k: System, x: Real) -> Real:
    """Return E I/(kappa G A L^2) at the shares x (1-D), E I and L those of the chain: W' = Psi + that Q."""
    lengths, own = np.array([(each.length, each.of_chain[3]) for each in reversed(k.segments)], float).T
    return np.asarray(own[np.searchsorted(np.cumsum(lengths)[:-1], x, side="right")])
