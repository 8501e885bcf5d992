"""The response to loads on the link: a force, or a pair of moments of a piezo patch.

The input of the hub is zero.  At a load e (1 in Q or in M) the states on both sides satisfy z- = z+ + e.  The
conditions W = 0 at the axis and the hub's balance, carried out to the load, are f z = 0 and g z = 0.  With the plane of
the payload's states there (`waves`) the outer state is

    z+ = -((g e) F - (f e) G)/(g F),     F = met(f), G = met(g),

which is met(h) for the condition h = (g e) f - (f e) g, carried outwards.  All numbers are balls, as f and g become
nearly parallel far out.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any, NamedTuple

from tfarm.errors import CertificationError, ParameterError

from .balls import Ball, Sweep, first_success, point, rational
from .compiled import python_of
from .layout import Layout, Reading, reading_of
from .outputs import Output
from .system import Body, Mark, Offset, Place, Segment, Spring, System
from .values import NO_NUMBER, PROVEN_BITS, precisions
from .waves import Plane, Row, met

_met = python_of(met)
LOAD_KINDS = {"force": ("N", 3), "moment_pair": ("N m", 2)}  # unit, and the entry of (W, Psi, M, Q) that jumps
LOAD_PATTERN = re.compile(r"(force|moment_pair)@([^,]+)(?:,([^,]+))?")


class Load(NamedTuple):
    """A unit load: `kind` "force" [N], positive with W, or "moment_pair" [N m], with Psi at the second of its places.

    `shares` are its places as shares of the link's length.
    """

    kind: str
    shares: tuple[float, ...]

    @property
    def unit(self) -> str:
        """N or N m."""
        return LOAD_KINDS[self.kind][0]


def is_load(text: str) -> bool:
    """Whether an input has the name of a load."""
    return "@" in text


def load_of(text: str, length: float) -> Load:
    """Return the load of force@X or moment_pair@X1,X2, X [m] from the clamp.  Raises ParameterError for others."""
    found = LOAD_PATTERN.fullmatch(text.replace(" ", ""))
    remedy = "force@X or moment_pair@X1,X2, with X in m from the clamp, such as force@0.3"
    if not found or (found[1] == "force") == bool(found[3]):
        raise ParameterError(key="input", value=text, remedy=remedy)
    try:
        places = [float(each) for each in found.groups()[1:] if each]
    except ValueError:
        raise ParameterError(key="input", value=text, remedy=remedy) from None
    if not all(0 <= x <= length for x in places):
        raise ParameterError(key="input", value=text, remedy=f"a place on the link lies between 0 and {length:g} m")
    if len(set(places)) < len(places):
        raise ParameterError(key="input", value=text, remedy="two moments at one place cancel; give two places")
    return Load(found[1], tuple(x / length for x in places))


def loaded_value(chain: System, load: Load, wanted: Output, s: complex, x: float) -> Ball:
    """Return the output for unit load at s, SI, to `PROVEN_BITS`.  Raises CertificationError at a pole or zero."""
    one, jumps = reading_of(chain, wanted, x), LOAD_KINDS[load.kind][1]
    if one.is_current:
        raise ParameterError(key="output", value=wanted.name, remedy="needs an input at the hub instead of a load")
    signs = (1,) if load.kind == "force" else (-1, 1)
    unit = (chain.length / chain.EI) * (chain.length if load.kind == "force" else 1)  # of the dimensionless load

    def attempt() -> Ball | None:
        states = [_Loaded(chain, point(s), Place(Fraction(share)), one.place) for share in load.shares]
        if any(state.balance.contains(0) for state in states):
            return None
        total = sum(sign * state.read(one, jumps) for sign, state in zip(signs, states, strict=True))
        value = total * rational(one.unit * chain.input_unit * unit)
        return value if value.rel_accuracy_bits() >= PROVEN_BITS or value.is_zero() else None

    failure = CertificationError(NO_NUMBER.format(f"{PROVEN_BITS} bits", s))
    return first_success(precisions(PROVEN_BITS), attempt, failure)


class _Loaded(Sweep):
    """The sweep with a mark at the load, and one at the place of an output on the link."""

    def __init__(self, chain: System, s: Ball, at: Place, read: Place | None) -> None:
        self.places = (at,) if read is None or read == at else (at, read)
        super().__init__(Layout(chain, self.places), s)
        zero, one = 0 * s, 1 + 0 * s
        self.f: Row = (one, zero, zero, zero)
        self.g: Row = (zero, self.drive_of(one, zero), self.drive_of(zero, one), zero)
        for each in reversed(self.numbers.elements):
            if each == Mark(0):
                break
            if not isinstance(each, Mark):
                self.f, self.g = self._beyond(each, self.f), self._beyond(each, self.g)

    @property
    def plane(self) -> Plane:
        """The plane of the payload's states at the load."""
        return self.planes[0]

    @property
    def balance(self) -> Ball:
        """g F: zero at an eigenvalue."""
        return sum(a * b for a, b in zip(self.g, _met(self.f, self.plane), strict=True))

    def read(self, one: Reading, jumps: int) -> Ball:
        """Return the reading, without its unit, for a unit jump of that entry of the state."""
        h = tuple(self.g[jumps] * a - self.f[jumps] * b for a, b in zip(self.f, self.g, strict=True))
        outer = tuple(-part / self.balance for part in _met(h, self.plane))
        inner = [part + (1 if n == jumps else 0) for n, part in enumerate(outer)]
        theta, at_place = self._inwards(inner)
        state = at_place or (self._outwards(h) if one.place is not None and len(self.places) > 1 else outer)
        value = theta * rational(one.theta)
        if one.place is not None:
            value = sum((part * rational(weight) for weight, part in zip(one.state, state, strict=True)), value)
        C = 0.0 if not one.gauge or one.place is None else self.layout.read[self.places.index(one.place)].damping
        return value * self.s**one.power / (1 + rational(C) * self.s)

    def _inwards(self, state: Any) -> tuple[Ball, Any]:
        """Return the hub angle, and the state at the place of the output if that is inside of the load."""
        found, elements = None, self.numbers.elements
        for each in elements[elements.index(Mark(0)) + 1 :]:
            if isinstance(each, Mark):
                found = state
            else:
                state = self._state_inside(each, state)
        return state[1], found

    def _outwards(self, h: Any) -> Any:
        """Return the state at a place beyond the load."""
        elements = self.numbers.elements
        for each in reversed(elements[: elements.index(Mark(0))]):
            if isinstance(each, Mark):
                return tuple(-part / self.balance for part in _met(h, self.planes[each.number]))
            h = self._beyond(each, h)
        raise AssertionError("the place is on neither side of the load")

    def _state_inside(self, element: Any, z: Any) -> Any:
        """Return the state at the inner end of an element from that at its outer one."""
        W, Psi, M, Q = z
        match element:
            case Segment():
                w, m, q = element.units
                own = W * w, Psi, M * m, Q * q
                rows = self._transition(element)
                W, Psi, M, Q = (sum(a * b for a, b in zip(row, own, strict=True)) for row in rows)
                return W / w, Psi, M / m, Q / q
            case Offset():
                a = element.length
                return W - a * Psi, Psi, M + a * Q, Q
            case Spring():
                stiffness, compliance = self._spring(element)
                return W, Psi - compliance / stiffness * M, M, Q
        assert isinstance(element, Body)
        translation, rotation = self._body(element)
        return W, Psi, M - rotation * Psi, Q - translation * W
