"""Where poles cross the imaginary axis along a line of gains: solved, for all windows at once (D-decomposition).

Along gains g0 + t g1 the characteristic function is N(s) + t P(s), linear in t.  A pole lies at i w where t(w) = -N/P
is real, that is at the zeros of h(w) = Im(N P*), a real function of one variable.  As t grows, the pair of poles there
goes right if Im t(w) grows with w, and left if it falls (differentiate N + t P = 0).  A real pole crosses at s = 0,
where t(s) for real s has a finite limit, and goes right if t(s) grows with s.  (Neimark 1948; Gryazina, Polyak and
Tremba 2008.)

At C = 0 h vanishes identically along K2: there is no curve, only the line K2 = 1; `margins` knows that case.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.exact.characteristic import Gains, loop_parts
from tfarm.exact.coefficients import Coefficients, coefficients
from tfarm.spectrum import modes

from .frequencies import grid
from .plant import effective_inertia

Complex = NDArray[np.complexfloating[Any, Any]]
Real = NDArray[np.float64]

BISECTIONS = 60
NONE = HubFeedback()


@dataclass(frozen=True, slots=True)
class Crossing:
    """Poles on the axis at t along the line: +-i omega (one at 0), `change` more of them unstable for greater t."""

    t: float
    omega: float
    change: int


@dataclass(frozen=True, slots=True)
class Line:
    """Gains base + t direction, t real."""

    base: HubFeedback
    direction: HubFeedback

    def at(self, t: float) -> HubFeedback:
        """The law at t."""
        a, b = self.base, self.direction
        return HubFeedback(K1=a.K1 + t * b.K1, K2=a.K2 + t * b.K2, Kp=a.Kp + t * b.Kp)

    @property
    def length(self) -> float:
        """The largest gain of the direction."""
        return max(abs(self.direction.K1), abs(self.direction.K2), abs(self.direction.Kp))


def along(name: str, law: HubFeedback) -> Line:
    """The line on which one gain takes every value, t being that value, and the others keep theirs."""
    others = {key: getattr(law, key) for key in ("K1", "K2", "Kp") if key != name}
    return Line(HubFeedback(**others), HubFeedback(**{name: 1.0}))


def crossings(arm: Arm, line: Line, band: float) -> tuple[Crossing, ...]:
    """All crossings of the imaginary axis at frequencies up to `band` [rad/s], ascending in t."""
    k = coefficients(arm)
    omega = np.asarray(grid(arm, band))
    found, unit = [crossing_at_zero(arm, line)], line.length
    if unit:
        way = line.direction
        line = replace(line, direction=HubFeedback(K1=way.K1 / unit, K2=way.K2 / unit, Kp=way.Kp / unit))
    h = _h(k, line, omega)
    (before,) = np.nonzero(np.sign(h[1:]) * np.sign(h[:-1]) < 0)
    if before.size:
        at = _bisected(k, line, omega[before], omega[before + 1])
        N, P = _parts(k, line, 1j * at)
        with np.errstate(over="ignore"):  # of a direction that is next to nothing: beyond any number
            t = -(N * P.conj()).real / abs(P) ** 2 / unit
        change = np.where(h[before + 1] < 0, 2, -2)  # Im t = -h/|P|^2
        found += [Crossing(float(a), float(b), int(c)) for a, b, c in zip(t, at, change, strict=True) if np.isfinite(a)]
    return tuple(sorted((each for each in found if each is not None), key=lambda each: each.t))


def _h(k: Coefficients, line: Line, omega: Real) -> Real:
    N, P = _parts(k, line, 1j * omega)
    return np.asarray((N * P.conj()).imag)


def _parts(k: Coefficients, line: Line, s: NDArray[Any]) -> tuple[Complex, Complex]:
    """N and P at s, up to one common positive factor."""
    drive, theta, moment, _ = loop_parts(k, s)
    base, way = (Gains.of(k, law.K1, law.K2, law.Kp) for law in (line.base, line.direction))
    N = drive + (float(base.Kp) + float(base.K1) * s) * theta + float(base.K2) * moment
    P = (float(way.Kp) + float(way.K1) * s) * theta + float(way.K2) * moment
    return N, P


def _bisected(k: Coefficients, line: Line, low: Real, high: Real) -> Real:
    """The zero of h in each bracket."""
    low, high, start = low.copy(), high.copy(), np.sign(_h(k, line, low))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        left = np.sign(_h(k, line, middle)) == start
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return (low + high) / 2


def crossing_at_zero(arm: Arm, line: Line) -> Crossing | None:
    """A real pole through s = 0, if there is a t at which one passes."""
    return _through_zero_free(arm, line) if arm.has_rigid_mode else _through_zero_held(arm, line)


def _through_zero_free(arm: Arm, line: Line) -> Crossing | None:
    """Of an arm that turns freely:  D/theta = Kp + K1 s + J s^2 + c s^3 + ...,  with J the effective inertia.

    The lowest coefficient that does not vanish all along the line decides: the pole passes where it is 0.
    """
    base, way = line.base, line.direction
    if way.Kp:
        t = -base.Kp / way.Kp + 0.0
        return Crossing(t, 0.0, _sign(way.Kp) * _change_with_stiffness(arm, line.at(t)))
    if base.Kp:
        return None
    if way.K1:
        t = -base.K1 / way.K1 + 0.0
        return Crossing(t, 0.0, -_sign(way.K1 * effective_inertia(arm, line.at(t).K2)))
    if base.K1 or not way.K2:
        return None
    J = arm.total_inertia
    carried = J - arm.hub.inertia
    if not carried:  # below the rounding of the hub's own: no gain a loop takes reaches so far
        return None
    return Crossing((J / carried - base.K2) / way.K2, 0.0, _sign(way.K2))


def _change_with_stiffness(arm: Arm, law: HubFeedback) -> int:
    """How many more poles are unstable above Kp = 0 than below: by K1 if not 0, else by J s^2 + c s^3, c ~ K2 C."""
    if law.K1:
        return -_sign(law.K1)
    J = effective_inertia(arm, law.K2)
    oscillating = 2 if law.K2 * arm.link.damping * J > 0 else 0  # against one real pole on the other side
    return _sign(J) * (oscillating - 1)


def _through_zero_held(arm: Arm, line: Line) -> Crossing | None:
    """Of an arm whose tip is held: where the static stiffness vanishes, from t(s) at two small s."""
    small = 1e-7 * float(modes(arm, 1).natural_frequency[-1])
    N, P = _parts(coefficients(arm), line, small * np.array([1 + 0j, 0.5]))
    if not P.all():
        return None
    far, near = -(N / P).real
    if not abs(near) < 1.5 * abs(far):
        return None
    return Crossing(float(2 * near - far), 0.0, 1 if far > near else -1)


def _sign(value: float) -> int:
    return int(np.sign(value))
