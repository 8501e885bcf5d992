"""A rig as a chain of elements without dimensions, from the payload inwards, and the compiled kernel of it.

Payload, offset of its centre, segments with bodies and springs between them, clamp, hub radius, joint, and at last the
drive: what the input must be for the response that is left,

    input = sum of A_n s^n theta - sum of B_n s^n M_axis,

with M_axis the moment that the link puts on the hub.  Torque has A = (k_theta, b, I_h + N^2 J_m), B = 1; a motor's
voltage and a prescribed hub angle have others (see `Drive`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.records import record

from .coefficients import EndCondition, Inertia, double_double
from .elements import Body, Drive, Element, Mark, Offset, Place, Segment, Spring

SEGMENT, OFFSET, SPRING, BODY, MARK = range(5)
LENGTH, NUMBER = 0, 0  # of an offset's row of the kernel, and of a mark's
STIFFNESS, COMPLIANCE, LOSS = range(3)  # of a spring's row, the last the stiffness times the damping
MASS, INERTIA, GROUND, TURNING_GROUND = range(4)  # of a body's row, in the order of `Body`
AT_JOINT = 2.0**-50  # of the length: a place so near to a joint is at it, its share being a quotient of float64 numbers
ROW_KIND, ROW_WIDTH = 8, 12  # where a row of the kernel says what it is, after the numbers of a segment (`vector`)
TO_W, TO_M, TO_Q = 9, 10, 11  # from the chain's units to the segment's own
OF_ANGLE, OF_MOMENT = 6, 10  # in the vector of ends: after six numbers of the payload A_0..A_3, then B_0 and B_1


@dataclass(frozen=True, kw_only=True)
@record
class ElementChain:
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
        """What is laid out or worked out of it once (`chain_values.readings`), with the chain and gone with it."""
        return {}

    @cached_property
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

    @cached_property
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

    def with_damping(self, share: float) -> ElementChain:
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


class Layout:
    """A chain cut and marked at places, as the compiled sweeps read it (`sweep`), and as elements for balls.

    `elements` run from the payload inwards.
    """

    def __init__(self, chain: ElementChain, places: tuple[Place, ...]) -> None:
        self.chain, self.places = chain, places
        self.elements = _marked(chain.elements, _at_joints(chain.elements, places))

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """The elements, which balls have no use for (elements, `ROW_WIDTH`)."""
        return np.array([kernel_row(each) for each in self.elements]).reshape(-1, ROW_WIDTH)

    @cached_property
    def ends(self) -> NDArray[np.float64]:
        """Payload and drive (12,)."""
        chain = self.chain
        tip = [EndCondition.of(inertia) for inertia in (chain.tip_mass, chain.tip_inertia)]
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


def _at_joints(elements: Sequence[Element], places: tuple[Place, ...]) -> tuple[Place, ...]:
    """The places, one that rounding has moved off a joint, or off what is attached there, put back."""
    lengths = [each.length for each in elements if isinstance(each, Segment)]
    joints = list(accumulate(lengths, lambda position, length: position - length, initial=Fraction(1)))
    ends = np.array([float(joint) for joint in joints])
    found = []
    for place in places:
        near = int(abs(ends - float(place.share)).argmin())
        found.append(place._replace(share=joints[near]) if abs(place.share - joints[near]) <= AT_JOINT else place)
    return tuple(found)


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


def kernel_row(element: Element) -> list[float]:
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
    return [*numbers, *[0.0] * (ROW_KIND - len(numbers)), kind, 0.0, 0.0, 0.0]
