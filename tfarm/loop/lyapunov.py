"""What the energy argument proves about constant gains.

    V = a1/2 (kinetic energy of beam and payload + strain energy) + a2/2 (I_h theta_t^2 + Kp theta^2),   a1, a2 > 0

is equation (15) with its payload, and a term for the extension Kp.  Under u = -Kp theta - K1 theta_t - K2 E I phi_x(0)

    V_t = -a2 K1 theta_t^2 - a1 C integral(E I phi_xt^2) + (a2 - a2 K2 - a1) E I phi_x(0) theta_t
          + (a2 - a1) C E I phi_xt(0) theta_t

The last two have no sign, so both factors must vanish: a1/a2 = 1 - K2, and where C > 0 also a1 = a2, that is K2 = 0:
the gauge does not feel C.  A gauge signal multiplied by 1 + C s is the whole moment M(0): then the two terms have one
factor, and a1/a2 = 1 - K2 does at any C.

V_t <= 0 says that no pole lies in the right half-plane, for the arm with all its modes.  It does not say that all
motion dies out: theta is left alone where Kp = 0, and exceptional arms have a mode that the root does not feel (with a
free tip just below the cut-off frequency).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tfarm.arm import Arm, HubFeedback, as_law
from tfarm.records import record
from tfarm.response import transfer

from .loop import Loop

Kind = Literal["dissipated", "conserved", "unproven"]


@dataclass(frozen=True)
@record
class Lyapunov:
    """What V proves about an arm and a law with constant gains.

    `proven`: no pole lies in the right half-plane, because V >= 0 never grows; its weights are then `a1_over_a2`, else
    None: no weights exist.  `kind`: V is "dissipated" (V_t <= 0), "conserved" (V_t = 0: every pole on the axis), or
    the law is "unproven", which alone does not make it unstable.  `reason` is one sentence.
    """

    loop: Loop
    proven: bool
    a1_over_a2: float | None
    kind: Kind
    reason: str


def lyapunov(arm: Arm, law: HubFeedback) -> Lyapunov:
    """What V proves of the law with a strain gauge as it is.  Raises ParameterError where there is no loop."""
    loop, C = Loop(arm, as_law(law)), arm.damping
    if law.K2 and not arm.reads_hub_moment:
        return _unproven(loop, "the gauge does not read the moment on the hub (r > 0, or inertia at the clamp)")
    if C and law.K2:
        reason = (
            f"the gauge does not feel the damping C = {C:g} s, so V_t keeps a term in phi_xt(0) theta_t of no sign, "
            "and no weights a1, a2 prove a K2 other than 0"
        )
        return _unproven(loop, reason)
    return _with_whole_moment(loop, law)


def _with_whole_moment(loop: Loop, law: HubFeedback) -> Lyapunov:
    """V_t = -a2 K1 theta_t^2 - a1 C integral(E I phi_xt^2) with a1/a2 = 1 - K2."""
    C = 0.0 if loop.arm.is_undamped else 1.0
    weight, K1 = 1.0 - law.K2 / loop.arm.input_per_torque, law.K1 + loop.arm.rate_loss
    if loop.arm.input_lags:
        return _unproven(loop, "the voltage reaches the hub through an inductance, late: V_t has a term of no sign")
    if weight == 0:
        return _unproven(loop, "K2 = 1 leaves a1 = 0: V sees the hub alone, and the arm moves as on a held hub")
    if weight < 0:
        return _unproven(loop, f"a1/a2 = 1 - K2 = {weight:g} is negative, so V has no sign")
    if K1 < 0:
        return _unproven(loop, f"K1 = {law.K1:g} feeds energy in: V_t = -a2 K1 theta_t^2 has the wrong sign")
    stiffness = 0.0  # of the hub at rest [N m/rad]: more than 0 where the tip is held
    if law.Kp < 0 and not loop.arm.has_rigid_mode:
        stiffness = 1.0 / float(transfer(loop.arm, "hub_angle").static)
    if law.Kp < 0 and law.Kp < (least := -weight * stiffness):
        return _unproven(
            loop, f"Kp = {law.Kp:g} is below {least:g} N m/rad, where the spring at the hub makes V negative"
        )
    kind: Kind = "dissipated" if K1 or C else "conserved"
    loss = "V_t = -a2 K1 theta_t^2" + (" less what the material dissipates" if C else "")
    what = f"never grows ({loss})" if kind == "dissipated" else "is constant (K1 = 0), and no motion dies out"
    return Lyapunov(loop, True, weight, kind, f"V with a1/a2 = {weight:g} {what}: no pole lies in the right half-plane")


def _unproven(loop: Loop, reason: str) -> Lyapunov:
    return Lyapunov(loop, False, None, "unproven", reason)
