"""The exact solution in ball arithmetic (python-flint): every number comes with a bound on its error.

No wave is ever separated here.  With z1 + z2 and z1 z2 from the dispersion relation, the functions F0..F3 of
`closed_form.from_transition` are the last column of the exponential of a 4x4 companion matrix, entire in
s^2/(1 + C s): there is no cut-off, no pair of equal waves and no low frequency where this form loses
its meaning, only digits, and then the precision is raised until the digits asked for are proven.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from functools import cached_property
from typing import Any

import flint

from .closed_form import fields_from_root, from_transition
from .coefficients import Coefficients, EndCondition
from .compiled import python_of
from .outputs import Output, Quantity, unit_scale

_algebra, _fields = python_of(from_transition), python_of(fields_from_root)
Ball = Any  # flint.acb or flint.arb, which come without types


@contextmanager
def precision(bits: int) -> Iterator[None]:
    """flint's working precision inside the block, restored after it."""
    with flint.ctx.workprec(bits):
        yield


def rational(value: Fraction | float) -> Ball:
    """The ball of a fraction or float, at the working precision."""
    return flint.arb(flint.fmpq(*value.as_integer_ratio()))


def point(s: complex) -> Ball:
    """The exact ball of a complex float."""
    return flint.acb(flint.arb(s.real), flint.arb(s.imag))


def root(z: Ball) -> Ball:
    """A square root whose branch cut lies away from the ball; which of the two is nothing to even functions."""
    return z.sqrt() if z.real.mid() >= 0 else (-z).sqrt() * flint.acb(0, 1)


def transition(z_sum: Ball, z_product: Ball, x: Ball) -> tuple[Ball, Ball, Ball, Ball]:
    """F0..F3 at x (0..1), by the two waves where they differ and by the matrix exponential where they may not.

    That is of F'''' = (z1 + z2) F'' - z1 z2 F as a first-order system, with F'''(0) = 1.
    """
    spread = root(z_sum * z_sum / 4 - z_product)
    z1, z2 = z_sum / 2 + spread, z_sum / 2 - spread
    if (z1 - z2).contains(0) or z1.contains(0) or z2.contains(0):
        zero, one = flint.acb(0), flint.acb(x)
        rows = [[zero, one, zero, zero], [zero, zero, one, zero], [zero, zero, zero, one]]
        exponential = flint.acb_mat([*rows, [-z_product * x, zero, z_sum * x, zero]]).exp()
        return exponential[0, 3], exponential[1, 3], exponential[2, 3], exponential[3, 3]
    t1, t2 = root(z1), root(z2)
    (h1, c1), (h2, c2) = (t1 * x).sinh_cosh(), (t2 * x).sinh_cosh()
    over = 1 / (z1 - z2)
    return (h1 / t1 - h2 / t2) * over, (c1 - c2) * over, (t1 * h1 - t2 * h2) * over, (z1 * c1 - z2 * c2) * over


class State:
    """The free response of the arm at one s: root values, and by them the fields at any x."""

    def __init__(self, k: Coefficients, s: Ball) -> None:
        self.k, self.s = k, s
        self._fields: dict[float, tuple[Ball, ...]] = {}  # by x: four quantities share the transition
        self.S, self.d = s * s, 1 + rational(k.damping) * s
        self.a, self.b, self.g, self.sigma = (rational(value) for value in (k.a, k.b, k.g, k.sigma))
        S, over_d = self.S, 1 / self.d
        self.z_sum = S * (self.b + self.a * over_d)
        self.z_product = S * (self.a * self.b * S + self.g) * over_d
        mass, inertia = EndCondition.of(k.tip_mass), EndCondition.of(k.tip_inertia)
        F0, F1, F2, F3 = transition(self.z_sum, self.z_product, flint.arb(1))
        self.theta, self.M0, self.Q0, self.W1, self.Y1 = _algebra(
            F0, F1, F2, F3, F2 - 1, S, over_d, self.a, self.b, self.g, self.sigma,
            self.end(mass), rational(mass.force), self.end(inertia), rational(inertia.force),
        )  # fmt: skip

    def end(self, condition: EndCondition) -> Ball:
        """rest + inertia s^2 of an end condition."""
        return rational(condition.rest) + rational(condition.inertia) * self.S

    @cached_property
    def input(self) -> Ball:
        """The torque behind this response, or the hub angle where the hub is locked: zero at a pole."""
        hub = EndCondition.of(self.k.hub_inertia)
        drive = self.end(hub) * self.theta - rational(hub.force) * self.M0
        return drive if hub.rest else drive / rational(hub.force)

    def field(self, quantity: Quantity, x: float) -> Ball:
        """The quantity at x (a share of the length, 0..1), from the root by the state-transition matrix."""
        if x not in self._fields:
            at = rational(x)
            F0, F1, F2, F3 = transition(self.z_sum, self.z_product, at)
            self._fields[x] = _fields(
                at, F0, F1, F2, F3, F2 - at, F3 - 1, self.S, 1 / self.d, self.a, self.b, self.g, self.sigma,
                self.theta, self.M0, self.Q0,
            )  # fmt: skip
        return self._fields[x][("Y", "Phi", "M", "Q").index(quantity)]

    def value(self, output: Output, x: float = 0.0) -> Ball:
        """The output for a unit input, in SI units; x is a share of the length."""
        constant = output.constant(self.k, x)
        ratio = self.s**output.power * (self._ratio(output, x) if constant is None else constant)
        ratio = ratio / self.d if output.gauge else ratio
        return ratio * rational(unit_scale(output, self.k))

    def _ratio(self, output: Output, x: float) -> Ball:
        if output.is_at_end:
            ends = {"theta": self.theta, "M": self.M0, "Q": self.Q0, "W": self.W1, "Y": self.Y1}
            return ends[output.quantity] / self.input
        return self.field(output.quantity, output.share(x)) / self.input

    def determines(self, output: Output, x: float) -> bool:
        """Whether the output has a value here: everywhere but where the input may be zero, at a pole."""
        return output.constant(self.k, x) is not None or not self.input.contains(0)


def nearest_float(ball: Ball) -> complex:
    """The complex float at the middle of a ball."""
    return complex(float(ball.real.mid()), float(ball.imag.mid()))
