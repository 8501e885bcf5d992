"""The response to loads on the link: a force, or a pair of moments of a piezo patch.

The input of the hub is zero.  At a load e (1 in Q or in M) the states on both sides satisfy z- = z+ + e.  The
conditions W = 0 at the axis and the hub's balance, carried out to any place, are f z = 0 and g z = 0 there.  With the
plane of the payload's states (`waves`), F = met(f) and G = met(g), the states

    z+ = -((g e) F - (f e) G)/(g F)                  beyond the load,
    z- = (w(G, e) f* - w(F, e) g*)/(g F)             inside of it

satisfy all of them: w is the symplectic form of two states,  W Q' - Q W' + Psi M' - M Psi',  which is 0 for two states
of a plane, and f* the state with  w(f*, z) = f z.  All numbers are balls, as f and g become nearly parallel far out.
"""

import re
from fractions import Fraction
from typing import Any, NamedTuple

from tfarm.errors import ParameterError, require
from tfarm.exact.balls import Ball, Sweep, point, rational
from tfarm.exact.layout import Field, Layout, OutputFormula, reading_of
from tfarm.exact.outputs import Output
from tfarm.exact.system import Place, Spring, System
from tfarm.exact.values import PROVEN_BITS, accurate_ball, certify_by_precision
from tfarm.exact.waves import SolutionRow

# unit, entry of the state, its jumps
LOAD_KINDS = {"force": ("N", Field.Q, (1,)), "moment_pair": ("N m", Field.M, (-1, 1))}


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
    found = re.fullmatch(r"(force|moment_pair)@([^,]+)(?:,([^,]+))?", text.replace(" ", ""))
    remedy = "force@X or moment_pair@X1,X2, with X in m from the clamp, such as force@0.3"
    try:
        places = [float(each) for each in found.groups()[1:] if each] if found else []
    except ValueError:
        places = []
    if not found or len(places) != len(LOAD_KINDS[found[1]][2]):
        raise ParameterError(key="input", value=text, remedy=remedy)
    is_inside = all(0 <= x <= length for x in places)
    require(is_inside, "input", text, f"a place on the link lies between 0 and {length:g} m")
    require(len({*places}) == len(places), "input", text, "two moments at one place cancel; give two places")
    return Load(found[1], tuple(x / length for x in places))


def loaded_value(chain: System, load: Load, wanted: Output, s: complex, x: float) -> Ball:
    """Return the output for unit load at s, SI, to `PROVEN_BITS`.  Raises CertificationError at a pole or zero."""
    one = reading_of(chain, wanted, x)
    (_, jump, signs) = LOAD_KINDS[load.kind]
    require(not one.input, "output", wanted.name, "needs an input at the hub instead of a load")
    # of the dimensionless load
    unit = chain.length / chain.EI
    if jump == Field.Q:
        unit = unit * chain.length
    loads = [Place(Fraction(share)) for share in load.shares]
    layouts = [Layout(chain, tuple(dict.fromkeys((at, one.place or at)))) for at in loads]

    def attempt() -> Ball | None:
        parts = zip(signs, layouts, loads, strict=True)
        value = sum(sign * _Loaded(layout, point(s)).quantity(one, at, jump) for sign, layout, at in parts)
        value = value * point(s) ** one.power / (1 + rational(one.C) * point(s))
        value = value * rational(one.unit * chain.drive.unit * unit)
        if not value.is_finite():
            return None
        return accurate_ball(value, PROVEN_BITS)

    return certify_by_precision(PROVEN_BITS, attempt, f"{PROVEN_BITS} bits", s)


class _Loaded(Sweep):
    """The sweep with marks at a load and at the place of an output."""

    def _row_beyond(self, element: Any, f: SolutionRow) -> SolutionRow:
        """Return the condition beyond an element, beyond a spring not times its stiffness."""
        f = super()._row_beyond(element, f)
        if isinstance(element, Spring):
            stiffness = self.s * element.damping + element.stiffness
            return tuple(each / stiffness for each in f)
        return f

    def quantity(self, one: OutputFormula, load: Place, jump: int) -> Ball:
        """Return theta and field of a reading for a unit jump of an entry of the state at the load."""
        none = 0 * self.s
        whole = 1 + 0 * self.s
        f = self.carry_out((whole, none, none, none))
        g = self.carry_out((none, self.of_angle, -self.of_moment, none))
        F = self.states_under(f)
        G = self.states_under(g)

        def balance(at: Place) -> Ball:
            """Return g F at a mark: 0 at an eigenvalue."""
            return sum(a * b for a, b in zip(g[at], F[at], strict=True))

        # w(F, e) and w(G, e)
        by_F = F[load][Field.Q - jump] / balance(load)
        by_G = G[load][Field.Q - jump] / balance(load)
        value = by_F * self.of_moment * rational(one.theta)
        if one.place is None:
            return value
        at = one.place
        n = one.field
        if self.layout.marks[at] > self.layout.marks[load]:
            dual = by_G * f[at][Field.Q - n] - by_F * g[at][Field.Q - n]
            if n in (Field.W, Field.Psi):
                return value + dual
            return value - dual
        return value - (g[load][jump] * F[at][n] - f[load][jump] * G[at][n]) / balance(at)
