"""Layouts of a system: cut and marked at places, as rows of the kernel, with the weights of each output."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.errors import ParameterError
from tfarm.records import read_only

from .outputs import Output
from .system import Body, Element, Mark, Offset, Place, Segment, Spring, System, double_double, end_condition

SEGMENT, OFFSET, SPRING, BODY, MARK = range(5)
LENGTH, NUMBER = 0, 0  # of an offset's row of the kernel, and of a mark's
STIFFNESS, COMPLIANCE, LOSS = range(3)  # of a spring's row, the last the stiffness times the damping
MASS, INERTIA, GROUND, TURNING_GROUND = range(4)  # of a body's row, in the order of `Body`
AT_JOINT = 2.0**-50  # of the length: rounding of a place at a joint, a quotient of float64 numbers
ROW_KIND, ROW_WIDTH = 8, 12  # the kind in a row of the kernel, after the numbers of a segment (`waves`), and its width
TO_W, TO_M, TO_Q = 9, 10, 11  # from the chain's units to the segment's own
OF_ANGLE, OF_MOMENT = 6, 10  # in the vector of ends: after six numbers of the payload A_0..A_3, then B_0 and B_1
LAYOUTS_KEPT = 256  # of one system: more places than those of a page

# The outputs of `uniform`, of a uniform link: theta, M and Q at the root, W and W - theta at the tip.
AT_ENDS: Mapping[Any, int] = {
    ((0, 0, 0, 0), 1): 0,
    (0, (0, 0, 1, 0), 0): 1,
    (0, (0, 0, 0, 1), 0): 2,
    (1, (1, 0, 0, 0), 0): 3,
    (1, (1, 0, 0, 0), -1): 4,
}


class Numbers(NamedTuple):
    """A layout's numbers in one arithmetic: elements; rest, inertia and force of both tip conditions; drive.

    `of_angle` are A_0..A_3, `of_moment` B_0 and B_1 (see `system`).
    """

    elements: tuple[Any, ...]
    tip_mass: tuple[Any, ...]
    tip_inertia: tuple[Any, ...]
    of_angle: tuple[Any, ...]
    of_moment: tuple[Any, ...]


class Layout:
    """A chain cut and marked at places, as rows of the compiled sweeps (`sweep`), and as elements for balls.

    `elements` run from the payload inwards.
    """

    def __init__(self, chain: System, places: tuple[Place, ...] = ()) -> None:
        self.chain, self.places = chain, places
        self.elements = _marked(chain.elements, _at_joints(chain.elements, places))
        self._numbers: dict[Any, Numbers] = {}

    def numbers(self, key: Any, exact: Callable[[Any], Any]) -> Numbers:
        """Return its numbers converted by `exact`, cached for each `key`."""
        if key not in self._numbers:
            elements = [
                each if isinstance(each, Mark) else type(each)._make(n if n is None else exact(n) for n in each)
                for each in self.elements
            ]
            chain, drive = self.chain, self.chain.drive
            ends = end_condition(chain.tip_mass), end_condition(chain.tip_inertia), drive.of_angle, drive.of_moment
            self._numbers[key] = Numbers(tuple(elements), *(tuple(map(exact, each)) for each in ends))
        return self._numbers[key]

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """The elements for the kernel (elements, `ROW_WIDTH`)."""
        rows = np.array([kernel_row(each) for each in self.elements]).reshape(-1, ROW_WIDTH)
        return np.asarray(read_only(rows))

    @cached_property
    def ends(self) -> NDArray[np.float64]:
        """Payload and drive (12,)."""
        _, *numbers = self.numbers("float64", float)
        return np.asarray(read_only(np.concatenate(numbers)))

    @cached_property
    def read(self) -> tuple[Segment, ...]:
        """The segment of each place."""
        found: list[Segment] = []
        for number, place in enumerate(self.places):
            at = self.elements.index(Mark(number))
            outer, inner = (
                [each for each in part if isinstance(each, Segment)]
                for part in (self.elements[at::-1], self.elements[at:])
            )
            found.append(((inner or outer) if place.side == "inner" else (outer or inner))[0])
        return tuple(found)


def _at_joints(elements: Sequence[Element], places: tuple[Place, ...]) -> tuple[Place, ...]:
    """Return the places, those next to a joint at it."""
    lengths = [each.length for each in elements if isinstance(each, Segment)]
    joints = list(accumulate(lengths, lambda position, length: position - length, initial=Fraction(1)))
    ends = np.array([float(joint) for joint in joints])
    found = []
    for place in places:
        near = int(abs(ends - float(place.share)).argmin())
        found.append(place._replace(share=joints[near]) if abs(place.share - joints[near]) <= AT_JOINT else place)
    return tuple(found)


def _marked(elements: Sequence[Element], places: tuple[Place, ...]) -> tuple[Element, ...]:
    """Return the elements with a mark for each place; segments are cut at places inside."""
    order = sorted(range(len(places)), key=lambda n: (-places[n].share, places[n].side != "outer"))
    marks, position = [n for n in order if places[n].side != "payload"], Fraction(1)
    result: list[Element] = [Mark(n) for n in order if places[n].side == "payload"]
    is_beyond = True  # outside the link: the payload's offset
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
    """Return an element as a row of the kernel."""
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


class Reading(NamedTuple):
    """The weights of an output, of W, Psi, M and Q at a place and of theta; its power of s, gauge and SI unit."""

    place: Place | None
    state: tuple[Fraction | int, ...]
    theta: Fraction
    power: int
    gauge: bool
    unit: Fraction
    is_current: bool = False

    @property
    def at(self) -> tuple[Fraction, ...]:
        """The place as a share of the length; none of the hub angle."""
        return () if self.place is None else (self.place.share,)


@dataclass(frozen=True)
class Readings:
    """Several outputs of one chain: layout, readings, and tables for the compiled sweeps."""

    layout: Layout = field(repr=False)
    each: tuple[Reading, ...] = field(repr=False)

    @property
    def gauges(self) -> list[float]:
        """C [s] of each output's gauge, 0 for other outputs."""
        places = self.layout.places
        return [
            self.layout.read[places.index(one.place)].damping if one.gauge and one.place is not None else 0.0
            for one in self.each
        ]

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """Rows for `sweep.fill_free`."""
        places = self.layout.places
        table = np.array([
            [-1 if one.place is None else places.index(one.place), *one.state, one.theta, one.power, C, one.unit]
            for one, C in zip(self.each, self.gauges, strict=True)
        ], dtype=float).reshape(-1, 9)  # fmt: skip
        return np.asarray(read_only(table))

    @cached_property
    def ends_table(self) -> NDArray[np.float64] | None:
        """Rows for `uniform.fill_ends`: number, power of s, C of the gauge, factor; None if one is not at the ends."""
        chain = self.layout.chain
        if not chain.is_uniform or chain.drive.friction or chain.drive.stiffness or chain.drive.lag:
            return None
        which = [None if one.is_current else AT_ENDS.get((*one.at, one.state, one.theta)) for one in self.each]
        if None in which:
            return None
        rows = [(n, one.power, C, one.unit) for n, one, C in zip(which, self.each, self.gauges, strict=True)]
        return np.asarray(read_only(np.array(rows, dtype=float).reshape(-1, 4)))


def unit_scale(wanted: Output, k: System) -> Fraction:
    """Return the SI value of one dimensionless unit of the output for 1 N m of torque, or 1 rad of a locked hub."""
    if wanted.quantity in ("W", "Y", "centre"):
        return k.length / k.input_unit
    if wanted.quantity in ("M", "Q"):
        return k.EI / k.length ** (1 if wanted.quantity == "M" else 2) / k.input_unit
    return 1 / k.input_unit


def reading_of(chain: System, wanted: Output, x: float) -> Reading:
    """Return an output as weights; x is the share of the length for one along the link."""
    share = Fraction(wanted.share(x))
    weights: dict[str, tuple[Fraction | int, ...]] = {
        **dict.fromkeys(("W", "Y", "centre"), (1, 0, 0, 0)),
        **dict.fromkeys(("Psi", "Phi"), (0, 1, 0, 0)),
        **dict.fromkeys(("M", "strain"), (0, 0, 1, 0)),
    }
    theta = {"Y": -(chain.radius + share), "Phi": Fraction(-1), "theta": Fraction(1)}
    if wanted.quantity == "current":
        if not chain.drive.per_ampere or not chain.drive.turns:
            raise ParameterError(
                key="output", value="motor_current", remedy="needs a [motor] and another input than hub_angle"
            )
        amperes = chain.EI / chain.length / chain.drive.per_ampere / chain.input_unit  # per dimensionless torque
        return Reading(None, (0, 0, 0, 0), Fraction(1), wanted.power, False, amperes, True)
    place = None if wanted.quantity == "theta" else Place(share, wanted.side)
    if wanted.place == "root" and wanted.gauge:
        place = chain.gauge
    if wanted.quantity == "centre":
        place = Place(Fraction(1), "payload")
    state = weights.get(wanted.quantity, (0, 0, 0, 1)) if place else (0, 0, 0, 0)
    unit = unit_scale(wanted, chain)
    if wanted.quantity == "strain" and place:  # at the surface: half the depth over E I/L
        (segment,) = Layout(chain, (place,)).read
        if segment.half_depth is None:
            raise ParameterError(
                key="link.section.shape",
                value="general",
                remedy='a "general" section has no depth: give rectangle, round or tube',
            )
        unit = Fraction(segment.half_depth) / chain.length / segment.stiffness / chain.input_unit
    return Reading(place, state, theta.get(wanted.quantity, Fraction(0)), wanted.power, wanted.gauge, unit)


def readings(chain: System, wanted: tuple[Output, ...], x: float) -> Readings:
    """Return the outputs of a chain, laid out and cached with it."""
    key = wanted, x
    if key not in chain.kept:
        if len(chain.kept) >= LAYOUTS_KEPT:
            chain.kept.clear()
        chain.kept[key] = laid_out(chain, wanted, [x] * len(wanted))
    return chain.kept[key]


def laid_out(chain: System, wanted: Sequence[Output], shares: Sequence[float]) -> Readings:
    """Return outputs of a chain, each with its share of the length, laid out."""
    each = tuple(reading_of(chain, one, x) for one, x in zip(wanted, shares, strict=True))
    places = tuple(dict.fromkeys(one.place for one in each if one.place is not None))
    return Readings(Layout(chain, places), each)


def constant_of(k: System, wanted: Output, x: float) -> int | None:
    """Return the quantity for unit input, dimensionless, where an end condition fixes it: 0, 1 or -1; else None.

    W, Phi and Y are 0 at the root, W at a pinned tip, M and Q at a free tip.  The hub angle is the input of a locked
    hub, M(0) = -u of a hub without inertia.
    """
    at, locked = wanted.share(x), k.is_locked
    if wanted.quantity == "theta":
        return 1 if locked else None
    if not k.is_uniform:
        return None
    pinned, clamped = (not isinstance(end, Fraction) for end in (k.tip_mass, k.tip_inertia))
    if at == 0 and (wanted.quantity != "M" or not wanted.gauge or k.gauge.share == 0):
        free_pin = not any(k.drive.of_angle) and not k.drive.lag
        return {"M": -1 if free_pin else None, "Q": None, "Psi": 1 if locked else None}.get(wanted.quantity, 0)
    if at != 1:
        return None
    tip = {
        "M": 0 if k.tip_inertia == 0 else None,
        "Q": 0 if k.tip_mass == 0 else None,
        "W": 0 if pinned else None,
        "centre": 0 if pinned else None,
        "Y": -1 if pinned and locked else None,
        "Phi": -1 if clamped and locked else None,
        "Psi": 0 if clamped else None,
    }
    return tip.get(wanted.quantity)
