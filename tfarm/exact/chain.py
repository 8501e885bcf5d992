"""A rig as a chain of elements without dimensions, from the payload inwards: exact fractions and the compiled kernel.

Payload, offset of its centre, segments with bodies and springs between them, clamp, hub radius, joint, and at last the
drive: what the input must be for the response that is left,

    input = sum of A_n s^n theta - sum of B_n s^n M_axis,

with M_axis the moment that the link puts on the hub.  Torque has A = (k_theta, b, I_h + N^2 J_m), B = 1; a motor's
voltage and a prescribed hub angle have others (see `Drive`).  Lengths are in L (clamp to tip), moments
in EI/L, forces in EI/L^2 of the segment at the hub, time in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Attachment, Link, RotarySpring, Theory
from tfarm.records import record

from .coefficients import Condition, Inertia, double_double, scaled_inertia, stiffness_of, uniform
from .outputs import Side

SEGMENT, OFFSET, SPRING, BODY, MARK = range(5)
KIND, WIDTH = 8, 12  # where a row of the kernel says what it is, after the eight numbers of a segment (`vector`)
TO_W, TO_M, TO_Q = 9, 10, 11  # from the chain's units to the segment's own
TIP, OF_ANGLE, OF_MOMENT = 0, 6, 10  # of the vector of ends: six numbers of the payload, A_0..A_3, B_0 and B_1


class Segment(NamedTuple):
    """A uniform piece: a, b, g [s^2], sigma, C [s] as in `Coefficients`, length/L, EI/EI of the first, depth/2 [m]."""

    a: Fraction
    b: Fraction
    g: Fraction
    sigma: Fraction
    damping: float
    length: Fraction
    stiffness: Fraction
    half_depth: float | None = None

    def piece(self, share: Fraction) -> Segment:
        """That share of it."""
        return self._replace(
            a=self.a * share**2,
            b=self.b * share**2,
            g=self.g * share**4,
            sigma=self.sigma / share**2,
            length=self.length * share,
        )

    @property
    def units(self) -> tuple[Fraction, Fraction, Fraction]:
        """What W, M and Q in the chain's units are multiplied by to be in the segment's own."""
        return 1 / self.length, self.length / self.stiffness, self.length**2 / self.stiffness


class Offset(NamedTuple):
    """A rigid massless piece of that length, of L; of either sign."""

    length: Fraction


class Spring(NamedTuple):
    """A rotational spring with a dashpot, k (1 + c s): stiffness = k/(1 + k), compliance = 1/(1 + k), c [s]."""

    stiffness: Fraction
    compliance: Fraction
    damping: float


class Body(NamedTuple):
    """Mass and inertia [s^2], springs to ground in both motions."""

    mass: Fraction
    inertia: Fraction
    stiffness: Fraction
    rotational_stiffness: Fraction


class Mark(NamedTuple):
    """A place that something is read at: its number in the list of places."""

    number: int


class Place(NamedTuple):
    """A point of the link, as a share of its length (0..1), and a side where a body or a joint is at it.

    "payload" is the payload's centre of mass, beyond the tip.
    """

    share: Fraction
    side: Side | Literal["payload"] = "outer"


Element = Segment | Offset | Spring | Body | Mark


class Drive(NamedTuple):
    """What the hub asks of its input: inertia [s^2], friction [s], stiffness, back-EMF [s] and the lag L_a/R [s].

    The input turns the hub against  Z_h = inertia s^2 + friction s + stiffness,  or is its angle (`turns` false).  A
    voltage has back-EMF and lag too:  (1 + lag s)(Z_h theta - M_axis) + back_emf s theta.  `unit` is the SI value of
    one unit of the input.
    """

    turns: bool
    inertia: Fraction
    friction: Fraction
    stiffness: Fraction
    back_emf: Fraction
    lag: Fraction
    unit: Fraction

    @property
    def of_angle(self) -> tuple[Fraction, ...]:
        """A_0..A_3."""
        if not self.turns:
            return Fraction(1), Fraction(0), Fraction(0), Fraction(0)
        Z = self.stiffness, self.friction, self.inertia
        return Z[0], Z[1] + self.lag * Z[0] + self.back_emf, Z[2] + self.lag * Z[1], self.lag * Z[2]

    @property
    def of_moment(self) -> tuple[Fraction, Fraction]:
        """B_0 and B_1."""
        return Fraction(self.turns), self.lag * self.turns


@dataclass(frozen=True, kw_only=True)
@record
class Chain:
    """A rig: its elements from the payload inwards, the conditions of both ends, and the units.

    `gauge` is where the moment that a law feeds back is read; `radius` and `offset` of hub and payload are shares of
    the link's `length` [m]; `EI` [N m^2] is that at the hub.
    """

    elements: tuple[Element, ...]
    tip_mass: Inertia
    tip_inertia: Inertia
    drive: Drive
    radius: Fraction
    offset: Fraction
    gauge: Place
    length: Fraction
    EI: Fraction

    @cached_property
    def kept(self) -> dict[Any, Any]:
        """What is laid out of it once (`chain_values.readings`), with the chain and gone with it."""
        return {}

    @property
    def segments(self) -> tuple[Segment, ...]:
        """The uniform pieces, from the outermost inwards."""
        return tuple(each for each in self.elements if isinstance(each, Segment))

    @property
    def damping(self) -> float:
        """The largest C [s] of the segments."""
        return max(each.damping for each in self.segments)

    @property
    def is_locked(self) -> bool:
        """Whether the hub angle is the input."""
        return not self.drive.turns

    @property
    def has_rigid_mode(self) -> bool:
        """Whether it can turn as a rigid body: nothing is infinite and no spring holds it."""
        free = all(isinstance(end, Fraction) for end in (self.tip_mass, self.tip_inertia)) and not self.is_locked
        bodies = [each for each in self.elements if isinstance(each, Body)]
        return (
            free
            and not self.drive.stiffness
            and not any(each.stiffness or each.rotational_stiffness for each in bodies)
        )

    @property
    def transit(self) -> float:
        """The sum over the segments of (rho A l^4/(E I))^(1/4) [s^(1/2)]."""
        return math.fsum(float(each.g) ** 0.25 for each in self.segments)

    @property
    def at_rest(self) -> int:
        """How often the drive vanishes at s = 0: twice where the rig turns freely, once where friction resists it."""
        if not self.has_rigid_mode:
            return 0
        return 1 if self.drive.friction or self.drive.back_emf else 2

    @property
    def singular(self) -> tuple[float, ...]:
        """-1/C [1/s] of each damped segment, ascending: there eigenvalues accumulate."""
        return tuple(sorted({-1.0 / each.damping for each in self.segments if each.damping}))

    @property
    def is_undamped(self) -> bool:
        """Whether nothing dissipates."""
        dashpots = any(each.damping for each in self.elements if isinstance(each, Segment | Spring))
        return not (dashpots or self.drive.friction or self.drive.back_emf)

    @property
    def is_real_on_axis(self) -> bool:
        """Whether drive and outputs are real at s = i w, but for odd powers of s: no loss, and no inductance's lag."""
        return self.is_undamped and not self.drive.lag

    @property
    def input_unit(self) -> Fraction:
        """The SI value of one unit of the input."""
        return self.drive.unit

    def with_damping(self, share: float) -> Chain:
        """The chain with so much of every damper: of C, of the dashpots, and of what the drive has in odd powers."""
        parts: list[Element] = [
            each._replace(damping=each.damping * share) if isinstance(each, Segment | Spring) else each
            for each in self.elements
        ]
        drive = self.drive._replace(
            friction=self.drive.friction * Fraction(share), back_emf=self.drive.back_emf * Fraction(share)
        )
        return replace(self, elements=tuple(parts), drive=drive)

    def at(self, places: tuple[Place, ...] = ()) -> Layout:
        """The chain with marks at those places, cut where they are inside a segment."""
        return Layout(self, places)


def chain_of(arm: Arm, theory: Theory | None = None) -> Chain:
    """The chain of an arm under its own theory, or another."""
    theory = theory or arm.theory
    unit_length, EI = sum((Fraction(link.length) for link in arm.links), Fraction(0)), stiffness_of(arm.link)
    translation, rotation = unit_length**3 / EI, unit_length / EI

    def segment(link: Link) -> Segment:
        numbers = uniform(link, theory)
        length, stiffness = Fraction(link.length) / unit_length, stiffness_of(link) / EI
        return Segment(*numbers, link.damping, length, stiffness, link.section.half_depth)

    pieces: list[Element] = [Offset(Fraction(arm.payload.offset) / unit_length)] if arm.payload.offset else []
    waiting = sorted(arm.attachments, key=lambda each: each.x)
    position = unit_length
    for link in reversed(arm.links):
        start, own = position - Fraction(link.length), segment(link)
        while waiting and Fraction(waiting[-1].x) > start:
            each = waiting.pop()
            if gap := position - min(Fraction(each.x), position):
                pieces.append(own.piece(gap / Fraction(link.length)))
                position -= gap
            pieces.append(_body(each, translation, rotation))
        pieces.append(own.piece((position - start) / Fraction(link.length)))
        position = start
    pieces += [_body(each, translation, rotation) for each in reversed(waiting)]
    pieces += _springs(arm.clamp, rotation)
    pieces += [Offset(Fraction(arm.hub.radius) / unit_length)] if arm.hub.radius else []
    pieces += _springs(arm.joint, rotation)
    return Chain(
        elements=tuple(pieces),
        tip_mass=scaled_inertia(arm.payload.mass, translation),
        tip_inertia=scaled_inertia(arm.payload.inertia, rotation),
        drive=drive_of(arm, rotation),
        radius=Fraction(arm.hub.radius) / unit_length,
        offset=Fraction(arm.payload.offset) / unit_length,
        gauge=Place(min(Fraction(arm.gauge.x) / unit_length, Fraction(1)), arm.gauge.side),
        length=unit_length,
        EI=EI,
    )


def drive_of(arm: Arm, rotation: Fraction) -> Drive:
    """The drive of an arm's input; `rotation` is L/EI."""
    hub, motor, none = arm.hub, arm.motor, Fraction(0)
    if arm.is_locked:
        return Drive(False, none, none, none, none, none, Fraction(1))
    inertia, friction, per_ampere, lag, back_emf = (
        Fraction(hub.inertia),
        Fraction(hub.friction),
        Fraction(1),
        none,
        none,
    )
    if motor is not None:
        N = Fraction(motor.gear_ratio)
        inertia += N**2 * Fraction(motor.rotor_inertia)
        friction += N**2 * Fraction(motor.rotor_friction)
        per_ampere = Fraction(motor.gear_efficiency) * N * Fraction(motor.torque_constant)
        back_emf = per_ampere * N * Fraction(motor.back_emf_constant) / Fraction(motor.resistance) * rotation
        lag = Fraction(motor.inductance) / Fraction(motor.resistance)
    per_torque = {"motor_current": 1 / per_ampere}.get(arm.input, Fraction(1))
    if motor is not None and arm.input == "motor_voltage":
        per_torque = Fraction(motor.resistance) / per_ampere
    else:
        lag = back_emf = none
    own = inertia * rotation, friction * rotation, Fraction(hub.stiffness) * rotation
    return Drive(True, *own, back_emf, lag, per_torque / rotation)


def _body(each: Attachment, translation: Fraction, rotation: Fraction) -> Body:
    return Body(
        mass=Fraction(each.mass) * translation,
        inertia=Fraction(each.inertia) * rotation,
        stiffness=Fraction(each.stiffness) * translation,
        rotational_stiffness=Fraction(each.rotational_stiffness) * rotation,
    )


def _springs(spring: RotarySpring, rotation: Fraction) -> list[Element]:
    """The spring as an element, or nothing where it is rigid."""
    if math.isinf(spring.stiffness):
        return []
    k = Fraction(spring.stiffness) * rotation
    return [Spring(k / (1 + k), 1 / (1 + k), spring.damping)]


class Layout:
    """A chain cut and marked at places, as the compiled sweeps read it (`sweep`), and as elements for balls.

    `elements` run from the payload inwards.
    """

    def __init__(self, chain: Chain, places: tuple[Place, ...]) -> None:
        self.chain, self.places = chain, places
        self.elements = _marked(chain.elements, places)

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """The elements, which balls have no use for (elements, `WIDTH`)."""
        return np.array([row_of(each) for each in self.elements]).reshape(-1, WIDTH)

    @cached_property
    def ends(self) -> NDArray[np.float64]:
        """Payload and drive (12,)."""
        chain = self.chain
        tip = [Condition.of(inertia) for inertia in (chain.tip_mass, chain.tip_inertia)]
        numbers = [number for end in tip for number in (end.rest, end.inertia, end.force)]
        return np.array([*map(float, (*numbers, *chain.drive.of_angle, *chain.drive.of_moment))])

    @cached_property
    def read(self) -> tuple[Segment, ...]:
        """The segment that each place belongs to."""
        return tuple(self._segment_at(number) for number in range(len(self.places)))

    def _segment_at(self, number: int) -> Segment:
        at = self.elements.index(Mark(number))
        outer = [each for each in self.elements[:at] if isinstance(each, Segment)]
        inner = [each for each in self.elements[at:] if isinstance(each, Segment)]
        is_outer = self.places[number].side != "inner"
        return (outer[-1] if outer else inner[0]) if is_outer else (inner[0] if inner else outer[-1])


def _marked(elements: Sequence[Element], places: tuple[Place, ...]) -> tuple[Element, ...]:
    """The elements with a mark for each place; segments are cut where a place lies inside."""
    order = sorted(range(len(places)), key=lambda n: (-places[n].share, places[n].side != "outer"))
    marks, position = [n for n in order if places[n].side != "payload"], Fraction(1)
    result: list[Element] = [Mark(n) for n in order if places[n].side == "payload"]
    is_beyond = True  # still outside the link: the payload's offset
    for each in elements:
        if is_beyond and isinstance(each, Offset):
            result.append(each)
            continue
        is_beyond = False
        inner_end = position - each.length if isinstance(each, Segment) else position
        while (
            marks
            and places[marks[0]].share >= position
            and (places[marks[0]].side == "outer" or not isinstance(each, Body))
        ):
            result.append(Mark(marks.pop(0)))
        rest = each
        while marks and isinstance(each, Segment) and places[marks[0]].share > inner_end:
            here = places[marks[0]].share
            if here < position:
                result.append(each.piece((position - here) / each.length))
                rest, position = each.piece((here - inner_end) / each.length), here
            result.append(Mark(marks.pop(0)))
        result.append(rest)
        position = inner_end
    return (*result, *map(Mark, marks))


def row_of(element: Element) -> list[float]:
    """An element as a row of the kernel."""
    match element:
        case Segment():
            split = [part for value in element[:3] for part in double_double(value)]
            return [*split, float(element.sigma), element.damping, SEGMENT, *map(float, element.units)]
        case Offset():
            numbers = [float(element.length)]
        case Spring():
            numbers = [*map(float, element[:2]), float(element.stiffness * Fraction(element.damping))]
        case Body():
            numbers = [float(number) for number in element]
        case Mark():
            numbers = [float(element.number)]
    kind = {Offset: OFFSET, Spring: SPRING, Body: BODY, Mark: MARK}[type(element)]
    return [*numbers, *[0.0] * (KIND - len(numbers)), kind, 0.0, 0.0, 0.0]
