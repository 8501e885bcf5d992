"""Layouts of a system: cut and marked at places, as rows of the kernel, with the weights of each output."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import IntEnum
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.errors import require
from tfarm.exact.outputs import Output
from tfarm.exact.system import (
    ONE,
    ZERO,
    Body,
    Element,
    Mark,
    Offset,
    Place,
    PlaceOrder,
    Segment,
    Spring,
    System,
    cut_segments,
    elements_with_places,
    end_condition,
)
from tfarm.records import read_only

SEGMENT, OFFSET, SPRING, BODY, MARK = range(5)
KINDS: Mapping[type, int] = {Segment: SEGMENT, Offset: OFFSET, Spring: SPRING, Body: BODY, Mark: MARK}
# A row of the kernel: kind and numbers of an element, with the names of its record; a, b, g are two doubles each.
OF_ELEMENT = (
    "kind a b g a_low b_low g_low sigma damping length stiffness compliance mass inertia rotational_stiffness"
)
ROW = np.dtype([*((name, float) for name in OF_ELEMENT.split()), ("of_chain", float, 4)])
# of the length: rounding of a place at a joint, a quotient of float64 numbers
AT_JOINT = 2.0**-50
# in the vector of ends: after six numbers of the payload A_0..A_3, then B_0 and B_1
OF_ANGLE = 6
OF_MOMENT = 10


class Field(IntEnum):
    """The fields of a state, W, Psi, M and Q, and by the names of other quantities the field that they are of."""

    W = Y = centre = 0
    Psi = Phi = 1
    M = strain = 2
    Q = 3


class OutputFormula(NamedTuple):
    """An output:  unit s^power (field at the place + theta theta + rate s theta + input u)/(1 + C s),  in SI units.

    The field is one of W, Psi, M and Q, u the input and C [s] the damping at a gauge, or the lag of a motor.
    """

    place: Place | None
    field: int
    theta: Fraction
    power: int
    unit: Fraction
    C: Fraction | float = 0.0
    rate: Fraction = ZERO
    input: int = 0


class Layout:
    """A chain cut and marked at places, with the readings `each` there: rows of the compiled sweeps, and elements.

    `elements` run from the payload inwards.
    """

    def __init__(
        self, chain: System, places: tuple[Place, ...] = (), each: tuple[OutputFormula, ...] = ()
    ) -> None:
        self.chain = chain
        self.places = places
        self.each = each
        elements = list(elements_with_places(chain.elements))
        joints = [position for position, _, each in elements if isinstance(each, Segment)] + [ZERO]
        marks = []
        for place in places:
            away = [abs(joint - place.share) for joint in joints]
            share = place.share
            if min(away) <= AT_JOINT:
                share = joints[away.index(min(away))]
            marks.append((share, PlaceOrder[place.side], Mark(place)))
        self.elements = cut_segments([*marks, *elements])
        self._numbers: dict[Any, list[Any]] = {}

    def numbers(self, key: Any, exact: Callable[[Any], Any]) -> list[Any]:
        """Return elements, both tip conditions (rest, inertia, force), A_0..A_3 and B_0, B_1, converted by `exact`.

        They are cached for each `key`.
        """
        if key not in self._numbers:
            elements: list[Any] = []
            for each in self.elements:
                if isinstance(each, Mark):
                    elements.append(each)
                else:
                    elements.append(type(each)._make(n if n is None else exact(n) for n in each))
            self._numbers[key] = [elements, *(tuple(map(exact, each)) for each in self._conditions)]
        return self._numbers[key]

    @property
    def _conditions(self) -> tuple[tuple[Fraction, ...], ...]:
        """Both tip conditions, A_0..A_3, and B_0 and B_1."""
        chain = self.chain
        drive = chain.drive
        return (
            end_condition(chain.tip_mass),
            end_condition(chain.tip_inertia),
            drive.of_angle,
            drive.of_moment,
        )

    @cached_property
    def rows(self) -> NDArray[np.void]:
        """The elements for the kernel (elements,) of `ROW`."""
        return np.asarray(read_only(np.array([kernel_row(each) for each in self.elements], ROW)))

    @cached_property
    def ends(self) -> Real:
        """Payload and drive (12,)."""
        return np.asarray(read_only(np.array(sum(self._conditions, ()), dtype=float)))

    @cached_property
    def marks(self) -> dict[Place | None, int]:
        """The index of each place's mark."""
        return {each.place: n for n, each in enumerate(self.elements) if isinstance(each, Mark)}

    @cached_property
    def table(self) -> Real:
        """Rows for `sweep.fill_free`: the numbers of `OutputFormula` in their order, the row of the place first."""
        rows = [(self.marks.get(one.place, -1), *one[1:]) for one in self.each]
        return np.asarray(read_only(np.array(rows, dtype=float).reshape(-1, len(OutputFormula._fields))))


def kernel_row(element: Element) -> tuple[Any, ...]:
    """Return the numbers of an element in the order of `ROW`."""
    numbers: dict[str, Any] = dict.fromkeys(ROW.names or (), 0.0)
    numbers["kind"] = KINDS[type(element)]
    numbers["of_chain"] = (0.0,) * 4
    numbers |= {name: float(getattr(element, name)) for name in element._fields if name in numbers}
    if isinstance(element, Segment):
        for name in "abg":
            value = getattr(element, name)
            numbers[f"{name}_low"] = float(value - Fraction(numbers[name]))
        numbers["of_chain"] = tuple(map(float, element.of_chain))
    return tuple(numbers.values())


def segment_at(chain: System, place: Place) -> Segment:
    """Return the segment of a place, at a joint that of its side."""
    inner_end = ONE
    for each in chain.segments:
        inner_end -= each.length
        is_at_joint = place.side == "outer" and place.share >= inner_end - AT_JOINT
        if is_at_joint or place.share > inner_end + AT_JOINT:
            break
    return each


def unit_scale(wanted: Output, k: System) -> Fraction:
    """Return the SI value of one dimensionless unit of the output for 1 N m of torque, or 1 rad of a locked hub."""
    unit = ONE
    if wanted.quantity in ("W", "Y", "centre"):
        unit = k.length
    elif wanted.quantity == "M":
        unit = k.EI / k.length
    elif wanted.quantity == "Q":
        unit = k.EI / k.length**2
    return unit / k.drive.unit


def reading_of(chain: System, wanted: Output, x: float) -> OutputFormula:
    """Return an output as a reading; x is the share of the length for one along the link."""
    share = Fraction(wanted.share(x))
    drive = chain.drive
    unit = unit_scale(wanted, chain)
    # the torque, which is the input less back-EMF, through the lag
    if wanted.quantity == "current":
        is_driven = drive.per_ampere and drive.turns
        require(is_driven, "output", "motor_current", "needs a [motor] and another input than hub_angle")
        # per dimensionless torque
        amperes = chain.EI / chain.length / drive.per_ampere / drive.unit
        return OutputFormula(None, -1, ZERO, wanted.power, amperes, drive.lag, -drive.back_emf, 1)
    if wanted.quantity == "theta":
        return OutputFormula(None, -1, ONE, wanted.power, unit)
    place = Place(share, wanted.side)
    if wanted.quantity == "centre":
        place = Place(ONE, "payload")
    elif wanted.place == "root" and wanted.gauge:
        place = chain.gauge
    segment = segment_at(chain, place)
    # at the surface: half the depth over E I/L
    if wanted.quantity == "strain":
        remedy = 'a "general" section has no depth: give rectangle, round or tube'
        require(segment.half_depth is not None, "link.section.shape", "general", remedy)
        unit = Fraction(segment.half_depth or 0) / chain.length / segment.stiffness / drive.unit
    theta = ZERO
    if wanted.quantity == "Y":
        theta = -(chain.radius + share)
    elif wanted.quantity == "Phi":
        theta = -ONE
    C = segment.damping if wanted.gauge else 0.0
    return OutputFormula(place, Field[wanted.quantity], theta, wanted.power, unit, C)


def readings(chain: System, wanted: Iterable[Output] = (), x: float = 0.0) -> Layout:
    """Return the layout of outputs of a chain, cached with it."""
    outputs = tuple(wanted)
    layout: Layout = chain.keep((outputs, x), lambda: lay_out(chain, outputs, [x] * len(outputs)))
    return layout


def lay_out(chain: System, wanted: Sequence[Output], shares: Sequence[float]) -> Layout:
    """Return the layout of outputs of a chain, each with its share of the length."""
    each = tuple(reading_of(chain, one, x) for one, x in zip(wanted, shares, strict=True))
    places = tuple(dict.fromkeys(one.place for one in each if one.place is not None))
    return Layout(chain, places, each)
