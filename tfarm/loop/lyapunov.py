"""What the energy argument proves about constant gains, and energies along a trajectory.

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

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.linalg import expm

from tfarm.arm import FED_BACK, Arm, HubFeedback
from tfarm.arm.checks import positive, whole
from tfarm.arrays import Real
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.reduced import modal_model
from tfarm.response import transfer

from .plant import Loop

Kind = Literal["dissipated", "conserved", "unproven"]

MOST_ENERGY_POINTS = 100_000  # of time, each a step of the model


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


@dataclass(frozen=True)
@record
class EnergyBalance:
    """V along a free response of a modal model at C = 0, with a2 = 1 and a1 = 1 - K2.

    At times `t` (n,) [s]: the hub's rate `hub_rate` [rad/s], `V` [J], its rate by the formula, `V_t` = -K1 theta_t^2
    [W], and `dissipated` [J], the integral of -V_t from 0.  `defect` is the largest |V + dissipated - V(0)| over the
    largest energy of hub, arm and spring on the way: the formula holds if it is rounding.
    """

    t: Real
    hub_rate: Real
    V: Real
    V_t: Real
    dissipated: Real
    defect: float
    modes: int


def lyapunov(arm: Arm, law: HubFeedback) -> Lyapunov:
    """What V proves of the law with a strain gauge as it is.  Raises ParameterError where there is no loop."""
    loop, C = Loop(arm, law), arm.damping
    if law.K2 and not arm.reads_hub_moment:
        return _unproven(loop, "the gauge does not read the moment on the hub (r > 0, or inertia at the clamp)")
    if C and law.K2:
        reason = (
            f"the gauge does not feel the damping C = {C:g} s, so V_t keeps a term in phi_xt(0) theta_t of no sign, "
            "and no weights a1, a2 prove a K2 other than 0"
        )
        return _unproven(loop, reason)
    return _with_whole_moment(loop)


def lyapunov_with_damped_gauge(arm: Arm, law: HubFeedback) -> Lyapunov:
    """What V would prove if the gauge's signal were multiplied by 1 + C s, so that K2 feeds back the whole moment M(0).

    At C = 0 the same as `lyapunov`.  Raises ParameterError where there is no loop.
    """
    return _with_whole_moment(Loop(arm, law))


def damped_gauge_equivalent(arm: Arm, law: HubFeedback) -> tuple[Arm, HubFeedback]:
    """An arm and a law without K2 whose poles are those of the law with the gauge's signal multiplied by 1 + C s.

    A hub of inertia I_h/(1 - K2) with a damper K1/(1 - K2) and a spring Kp/(1 - K2), for K2 < 1; at C = 0 this is the
    law itself.  Raises ParameterError for K2 >= 1, where that hub would have no finite positive inertia.
    """
    if law.K2 >= 1:
        raise ParameterError(
            key="K2", value=law.K2, remedy="below 1: from there on no hub of positive inertia equals it"
        )
    Loop(arm, law)
    share = 1.0 - law.K2
    return arm.having(hub_inertia=arm.hub_inertia / share), HubFeedback(K1=law.K1 / share, Kp=law.Kp / share)


def _with_whole_moment(loop: Loop) -> Lyapunov:
    """V_t = -a2 K1 theta_t^2 - a1 C integral(E I phi_xt^2) with a1/a2 = 1 - K2."""
    law, C = loop.law, 0.0 if loop.arm.is_undamped else 1.0
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


# ------------------------------------------------------------ along a trajectory


def energy_along(arm: Arm, law: HubFeedback, duration: float, points: int = 501, modes: int = 20) -> EnergyBalance:
    """V and its rate after a unit impulse [N m s] of torque on the hub at rest, over `duration` [s], at C = 0.

    The plant is the modal model with its first `modes` flexible modes, closed by the law in continuous time, and the
    steps are matrix exponentials: no time step to choose.  In this model M(0) = I_h theta_tt - u holds exactly, hence
    so does the formula of V_t.  V(0) tends to 1/(2 I_h) as the modes become many.  For K2 >= 1, where a1 is not
    positive, the balance holds and proves nothing.

    Raises ParameterError where there is no loop, at C > 0 (a modal model does not tell the strain energy there), and
    where so few modes have no solution under K2 > 1.
    """
    loop, duration = Loop(arm, law), positive("duration", duration, "seconds to follow")
    if not arm.is_undamped:
        remedy = "0: modes of a damped arm do not share out its energy, and V_t has no such formula"
        raise ParameterError(key="link.damping", value=arm.damping, remedy=remedy)
    if not arm.is_told_by_lyapunov:
        remedy = "V_t has its formula where the gauge at the root of a hub without radius reads what turns the hub"
        raise ParameterError(key="hub.radius", value=arm.hub.radius, remedy=remedy)
    points = whole("points", points, 2, MOST_ENERGY_POINTS, f"a whole number from 2 to {MOST_ENERGY_POINTS}")
    A, struck, angle, rate, weights = _closed_modal_model(loop, modes)
    hub = np.outer(rate, rate)
    P = (1.0 - law.K2) * (np.diag(weights) - arm.hub_inertia * hub) + arm.hub_inertia * hub
    P = P + law.Kp * np.outer(angle, angle)
    sizes = np.diag(weights) + abs(law.Kp) * np.outer(angle, angle)
    step = duration / (points - 1)
    advance, loss = _step(A, law.K1 * hub, step)
    x = np.empty((points, struck.size))
    x[0] = struck
    for n in range(1, points):
        x[n] = advance @ x[n - 1]
    V, size = _form(P, x) / 2, _form(sizes, x) / 2
    dissipated = np.r_[0.0, np.cumsum(_form(loss, x[:-1]))]
    defect = float(abs(V + dissipated - V[0]).max() / max(abs(V).max(), size.max()))
    theta_t: Real = x @ rate
    return EnergyBalance(
        np.linspace(0.0, duration, points), theta_t, V, -law.K1 * theta_t**2, dissipated, defect, modes
    )


def _closed_modal_model(loop: Loop, modes: int) -> tuple[Real, Real, Real, Real, Real]:
    """A of x_t = A x under the law, the state after a unit impulse, rows of theta and theta_t, and twice the energies.

    theta is the sum of the modes kept, without a static remainder, so that theta_t is its rate.
    """
    arm, law = loop.arm, loop.law
    model = modal_model(arm, FED_BACK, modes)
    model = replace(model, static=np.where(np.array(FED_BACK) == "root_moment", model.static, 0.0))
    _, B, (angle, rate, _), _ = model.matrices()
    if 1.0 + np.array(law.row) @ model.static <= 0:
        raise ParameterError(
            key="modes", value=modes, remedy=f"more modes: too few have no solution at K2 = {law.K2:g}"
        )
    weights = np.ones(model.order)
    if model.has_rigid_states:
        weights[:2] = 0.0, arm.total_inertia
    return model.closed(law.row)[0], B[:, 0], angle, rate, weights


def _step(A: Real, Q: Real, step: float) -> tuple[Real, Real]:
    """e^(A t) over a step, and the integral of e^(A' t) Q e^(A t) on the way: none of the weights of V is in it.

    By Van Loan (1978) over so short a time that neither e^(A t) nor its inverse is large, then doubled.
    """
    n = A.shape[0]
    growth = float(abs(np.linalg.eigvals(A).real).max()) * step
    halvings = max(0, math.ceil(math.log2(growth))) if growth else 0
    blocks: Any = expm(np.block([[-A.T, Q], [np.zeros((n, n)), A]]) * (step / 2**halvings))
    advance, lost = blocks[n:, n:], blocks[n:, n:].T @ blocks[:n, n:]
    for _ in range(halvings):
        advance, lost = advance @ advance, lost + advance.T @ lost @ advance
    return advance, lost


def _form(P: Real, x: Real) -> Real:
    """x' P x for each row x."""
    return np.asarray(((x @ P) * x).sum(axis=1))
