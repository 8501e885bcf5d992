"""Stability of every mode from the sign of a law: passivity, negative imaginary systems, and moment feedback.

A hub torque does work on its own angle: the transfer function from torque to hub rate is positive real (passive) for
any rig, with any losses.  So a positive real law on the rate destabilises no mode.  It damps each one where the hub
takes part in all of them and the law dissipates energy at every frequency.  The same rig from torque to angle is
negative imaginary: under u = -C theta with -C strictly negative imaginary it is stable if and only if
k_theta + C(0) > 0 (Lanzon and Petersen 2008; positive position feedback is of that kind).

Both need hub torque on the hub's own angle or rate, no delay, no inductance, no sampling.  The signs of real
polynomials are decided in exact arithmetic, by Sturm's theorem, at all frequencies.

Feedback of the moment M on the hub, u = -C - k M, is absorbed by the hub of another rig (`cancel_hub_moment`).  Its
equation

    I theta_tt + b theta_t + c theta = u + M   divided by 1 - k   is that of inertia I/(1-k), friction b/(1-k),
                                                                  stiffness c/(1-k) and the law C/(1-k)

So for k < 1 the sign of C decides, for k > 1 the opposite sign, and k = 1 leaves the modes of the locked hub undamped.
That is the paper's theorem for C = K1 s + Kp.  It needs a gauge that reads M, so no damping in the links.

The same by energy, as the paper has it (`lyapunov`), for constant gains:

    V = a1/2 (kinetic energy of beam and payload + strain energy) + a2/2 (I_h theta_t^2 + Kp theta^2),   a1, a2 > 0

is equation (15) with its payload, and a term for the extension Kp.  Under u = -Kp theta - K1 theta_t - K2 E I phi_x(0)

    V_t = -a2 K1 theta_t^2 - a1 C integral(E I phi_xt^2) + (a2 - a2 K2 - a1) E I phi_x(0) theta_t
          + (a2 - a1) C E I phi_xt(0) theta_t

The last two have no sign, so both factors must vanish: a1/a2 = 1 - K2, and where C > 0 also a1 = a2, that is K2 = 0,
as the gauge signal has no term in C.  A gauge signal multiplied by 1 + C s is the whole moment M(0): then the two terms
have one factor, and a1/a2 = 1 - K2 is sufficient at any C.

V_t <= 0 proves that no pole lies in the right half-plane, for the arm with all its modes.  It does not prove asymptotic
stability: theta is free where Kp = 0, and exceptional arms have a mode without moment at the root (with a free tip just
below the cut-off frequency).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np

from tfarm.arm import Law
from tfarm.arm.blocks import Rational
from tfarm.loop.loop import Loop
from tfarm.records import frozen
from tfarm.response import transfer
from tfarm.schema import Quantity

if TYPE_CHECKING:
    # of sympy, over the rationals: it comes without types, and is imported where it is used
    Poly = Any


class Energy(IntEnum):
    """Effect of a law on the energy of every mode with motion of the hub."""

    LOSS = 1
    CONSTANT = 0
    SUPPLY = -1


@frozen
class Signs:
    """The `kind` of a law in s on hub angle and hub rate, and the `reason`.

    "strictly passive": Re of the law on the rate is above 0 at all frequencies; "passive": nowhere below;
    "negative imaginary": -C strictly so on the angle; "" where none of these is shown.  `energy` is None
    where the effect on it is not shown.
    """

    kind: Annotated[
        Literal["strictly passive", "passive", "negative imaginary", ""],
        Quantity("kind", help="from the hub's angle or rate to its torque; none where no sign is shown"),
    ]
    reason: Annotated[str, Quantity("reason", help="property of the controller that decides the kind")]
    energy: Energy | None = None


class Theorem(NamedTuple):
    """Effect of a law on the `energy` of every mode of a loop by a theorem, None without one, and the `reason`."""

    energy: Energy | None = None
    reason: str = ""


def cancel_hub_moment(loop: Loop) -> tuple[float, Law] | None:
    """Return the share k of the moment on the hub that a law cancels, and the rest of the law.

    None for laws on other signals than the hub's angle and rate and, statically, the moment that acts on the hub.  With
    damping in the links that moment is not the gauge's.
    """
    arm = loop.arm
    law = loop.law
    share = 0.0
    rest = []
    for part in law.parts:
        if part.signals != ("root_moment",):
            rest.append(part)
        elif isinstance(part.block, Rational) and not part.block.order and not part.block.excess:
            share -= law.sign * part.block.num[0] / part.block.den[0] / arm.input_per_torque
        else:
            return None
    if not set(law.signals) <= {"hub_angle", "hub_rate", "root_moment"}:
        return None
    if share and not (arm.has_elastic_link and arm.reads_hub_moment and not law.delay):
        return None
    return share, replace(law, parts=tuple(rest), references=())


def theorem_of(loop: Loop) -> Theorem:
    """Return the theorem that decides the stability of every mode of a loop."""
    arm = loop.arm
    parts = cancel_hub_moment(loop)
    if parts is None or (arm.input_lags and loop.feeds_back):
        return Theorem()
    share, rest = parts
    if share == 1.0:
        words = "modes with the hub at rest stay undamped at all frequencies: the whole moment on the hub is fed back"
        return Theorem(Energy.CONSTANT, words)
    way = 1.0 if share < 1.0 else -1.0
    signs = signs_of(rest.times(way), way * arm.rate_loss)
    if signs.energy is not None:
        if not arm.has_elastic_link or not loop.law.is_static:
            words = f"{signs.reason}: no mode is unstable at any frequency"
        elif signs.energy == Energy.CONSTANT:
            words = "C = 0 and energy is conserved: modes beyond lie on the axis"
        else:
            words = "C = 0: every mode beyond is damped (Lyapunov), with a decay rate that tends to 0"
        return Theorem(signs.energy, words)
    if arm.has_elastic_link and arm.loses_at_hub_alone:
        opposite = signs_of(rest.times(-way), -way * arm.rate_loss)
        if opposite.energy == Energy.LOSS:
            words = "C = 0: every flexible mode beyond is unstable too, with a growth rate that tends to 0"
            return Theorem(Energy.SUPPLY, words)
    return Theorem()


def signs_of_loop(loop: Loop) -> Signs:
    """Return the sign of the law of a loop, the hub's friction included; none behind an inductance."""
    if loop.arm.input_lags:
        return Signs("", "the torque lags behind the input, through an inductance")
    return signs_of(loop.law, loop.arm.rate_loss)


def signs_of(law: Law, friction: float = 0.0) -> Signs:
    """Return the sign of a law, the hub's friction [input per rad/s] included."""
    # degree: exact arithmetic with such polynomials takes a moment
    most_exact_degree = 40
    has_matrices = not all(isinstance(part.block, Rational) for part in law.parts)
    reads_other = not set(law.signals) <= {"hub_angle", "hub_rate"}
    obstacles = {
        "a delay turns the phase with frequency": law.delay,
        "it is not a law in s on the hub's own angle or rate alone": law.is_discrete or reads_other,
        "the sign of matrices is not determined: give transfer functions": has_matrices,
        f"the sign of more than {most_exact_degree} states is not determined": law.order > most_exact_degree,
    }
    if reason := next((text for text, holds in obstacles.items() if holds), ""):
        return Signs("", reason)
    # gains on hub angle and hub rate, by their signs alone
    if law.is_static:
        values = dict(zip(law.signals, law.values(np.ones(1, complex))[:, 0].real.tolist(), strict=True))
        return _of_signs(values.get("hub_rate", 0.0) + friction, values.get("hub_angle", 0.0))
    # of the whole law as one fraction on the angle
    num = exact_polynomial([0.0])
    den = exact_polynomial([1.0])
    for part in law.parts:
        # seen above
        assert isinstance(part.block, Rational)
        p = exact_polynomial(part.block.num) * -law.sign
        q = exact_polynomial(part.block.den)
        if part.signals == ("hub_rate",):
            p = p * exact_polynomial([1.0, 0.0])
        num = num * q + p * den
        den = den * q
    passive = _positive_real(num + exact_polynomial([friction, 0.0]) * den, den)
    if passive is not None and passive.kind:
        return passive
    if is_hurwitz(den) and num.degree() <= den.degree() and definite(on_axis(num, den)[1]) == "above":
        words = "the law on the hub's angle, with its sign changed, is strictly negative imaginary"
        return Signs("negative imaginary", words, Energy.LOSS)
    return passive or Signs("", "neither passive nor negative imaginary")


def _of_signs(rate: float, at_rest: float) -> Signs:
    """Return the signs of a law without poles right of the axis, by that of Re on the rate and by its value at rest."""
    if rate > 0 and at_rest >= 0:
        words = "the law on the hub's rate dissipates energy at every frequency (strictly positive real)"
        return Signs("strictly passive", words, Energy.LOSS)
    if rate == 0 and at_rest >= 0:
        words = "the law on the hub's rate supplies energy at no frequency (positive real)"
        return Signs("passive", words, Energy.CONSTANT)
    if rate < 0:
        return Signs("", "neither passive nor negative imaginary")
    # Re > 0 on the whole axis but 0: a pole crosses that at s = 0 alone, and only real poles are unstable
    effect = Energy.LOSS if rate else Energy.CONSTANT
    return Signs("", "the static stiffness of the law is negative", effect)


def _positive_real(num: Poly, den: Poly) -> Signs | None:
    """Return signs of C(s)/s, the law on the rate, if positive real, or Re > 0 on the whole axis but 0; else None.

    It is if Re >= 0 on the axis, no pole lies right of it, and those on it are simple with a residue above 0: of these
    one at 0 alone is allowed, C(0) of a law on the angle.
    """
    if not den.eval(0) or not is_hurwitz(den):
        return None
    at_rest = num.eval(0) / den.eval(0)
    excess = num.degree() - den.degree()
    if excess > 2 or (excess == 2 and num.LC() / den.LC() < 0):
        return None
    # Re C(i w)/(i w) = Im C(i w)/w
    sign = definite(on_axis(num, den)[1])
    if not sign or (at_rest < 0 and sign != "above"):
        return None
    return _of_signs(float(sign == "above"), float(at_rest))


# ------------------------------------------------------------ by energy


@frozen
class Lyapunov:
    """Lyapunov's proof by V about an arm and a law with constant gains.

    `proven`: no pole lies in the right half-plane, because V >= 0 never grows; its weights are then `a1_over_a2`, else
    None: no weights exist.  `kind`: V is "dissipated" (V_t <= 0), "conserved" (V_t = 0: every pole on the axis), or
    the law is "unproven", which alone does not make it unstable.  `reason` is one sentence.
    """

    proven: Annotated[
        bool, Quantity("stability proven", help="no pole in the right half-plane, as V never grows")
    ]
    a1_over_a2: Annotated[float | None, Quantity("weights a1/a2", help="1 - K2, of the energies in V")]
    kind: Literal["dissipated", "conserved", "unproven"]
    reason: Annotated[str, Quantity("reason", help="sign of V_t, or the term of V or V_t that has no sign")]


def lyapunov(loop: Loop) -> Lyapunov:
    """Return Lyapunov's proof for a loop of gains at the hub, with a strain gauge.

    V_t = -a2 K1 theta_t^2 - a1 C integral(E I phi_xt^2) with a1/a2 = 1 - K2, where that has a sign.
    """
    arm = loop.arm
    law = loop.law.gains
    assert law is not None
    C = arm.damping
    weight = 1.0 - law.K2 / arm.input_per_torque
    K1 = law.K1 + arm.rate_loss
    # of Kp: below 0 where the tip is held, and gives the hub a static stiffness
    least = 0.0
    if law.Kp < 0 and not arm.has_rigid_mode:
        least = -weight / float(transfer(arm, "hub_angle").static)
    obstacles = {
        "the gauge does not read the moment on the hub (r > 0, or inertia at the clamp)": (
            law.K2 and not arm.reads_hub_moment
        ),
        f"the gauge signal has no term in the damping C = {C:g} s, so V_t keeps a term in phi_xt(0) theta_t of no "
        "sign, and no weights a1, a2 prove a K2 other than 0": C and law.K2,
        "the torque lags behind the voltage, through an inductance: V_t has a term of no sign": arm.input_lags,
        "K2 = 1 leaves a1 = 0: V is of the hub alone, and the arm moves as on a locked hub": weight == 0,
        f"a1/a2 = 1 - K2 = {weight:g} is negative, so V has no sign": weight < 0,
        f"K1 = {law.K1:g} supplies energy: V_t = -a2 K1 theta_t^2 has the wrong sign": K1 < 0,
        f"Kp = {law.Kp:g} is below {least:g} N m/rad, where the spring at the hub makes V negative": (
            law.Kp < min(least, 0.0)
        ),
    }
    if reason := next((text for text, holds in obstacles.items() if holds), ""):
        return Lyapunov(False, None, "unproven", reason)
    loss = "V_t = -a2 K1 theta_t^2" + ("" if arm.is_undamped else " less the dissipation of the material")
    is_dissipated = bool(K1) or not arm.is_undamped
    change = f"never grows ({loss})" if is_dissipated else "is constant (K1 = 0), and no motion decays"
    reason = f"V with a1/a2 = {weight:g} {change}: no pole lies in the right half-plane"
    return Lyapunov(True, weight, "dissipated" if is_dissipated else "conserved", reason)


# ------------------------------------------------------------ polynomials, exactly


def exact_polynomial(coefficients: Sequence[float]) -> Poly:
    """Return the polynomial in w with these doubles as coefficients, descending, exact."""
    from sympy import QQ, Poly, Rational, Symbol

    return Poly([Rational(*float(each).as_integer_ratio()) for each in coefficients], Symbol("w"), domain=QQ)


def on_axis(num: Poly, den: Poly) -> tuple[Poly, Poly]:
    """Return real part, and imaginary part over w, of num(i w) conj den(i w): polynomials in v = w^2."""
    a, b = _even_and_odd(num)
    c, d = _even_and_odd(den)
    v = exact_polynomial([1.0, 0.0])
    return a * c + v * b * d, b * c - a * d


def _even_and_odd(poly: Poly) -> tuple[Poly, Poly]:
    """Return a and b of p(i w) = a(v) + i w b(v), v = w^2."""
    ascending = poly.all_coeffs()[::-1]
    found = []
    for part in (ascending[0::2], ascending[1::2]):
        signed = [(-1) ** n * each for n, each in enumerate(part)]
        found.append(poly.from_list(signed[::-1] or [0], *poly.gens, domain=poly.domain))
    return found[0], found[1]


def definite(poly: Poly) -> Literal["above", "not below", "zero", ""]:
    """Return the sign of a polynomial on v > 0: "above" 0, "not below" it, "zero", or "" where it is below."""
    if poly.is_zero:
        return "zero"
    if poly.LC() < 0:
        return ""
    factors = poly.sqf_list()[1]
    with_roots = [order for each, order in factors if int(each.count_roots(0, None)) > int(each.eval(0) == 0)]
    if not with_roots:
        return "above"
    return "" if any(order % 2 for order in with_roots) else "not below"


def is_hurwitz(poly: Poly) -> bool:
    """Return whether all roots lie left of the axis, by Routh's table."""
    row = poly.all_coeffs()[0::2]
    other = poly.all_coeffs()[1::2]
    if not row[0]:
        return False
    while other:
        if not other[0] * row[0] > 0:
            return False
        padded = [*other, 0]
        rest = [row[n + 1] - row[0] / other[0] * padded[n + 1] for n in range(len(row) - 1)]
        row = other
        other = rest
    return True
