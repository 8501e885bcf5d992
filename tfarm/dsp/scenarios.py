"""Scenarios of a sampled loop: references, feedforward, disturbances and initial state."""

import math
from dataclasses import replace
from typing import Annotated, Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AT_HUB, AnyLaw, Arm, must_turn
from tfarm.arm.chain import PERIOD, TIME_ROUNDING, Chain, MomentReading
from tfarm.arm.checks import positive
from tfarm.arrays import Real
from tfarm.dsp.inverse import inverse_torque
from tfarm.dsp.plant import arm_under_chain
from tfarm.dsp.profiles import motion_of_slew
from tfarm.dsp.shaping import impulses_of
from tfarm.errors import must_be_known, require
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.gains import turning_inertia

# 1/(N m)^2 s: weights a and b of the paper's (23), of vibration and of the law's own share
TRIAL_COST = (1.0, 2.6)
# times the slew: length of a trial for an arm and its chain
TRIAL_SLEWS = 3.0
# s, of a trial or a simulation by default: three times the paper's slew
TRIAL_DURATION = 3.0


@frozen
class Scenario:
    """One row for each sample: `feedforward` r [N m], `hub_angle` and `hub_rate` references, `rigid_moment` [N m] at
    the root of the rigid arm on them, `disturbance` [N m] at the hub (held over the sample, not delayed).

    It starts at rest, but for the first mode released with `tip_offset` [m] at the tip; `impulse` [N m s] acts on the
    hub just after the sample at t = 0. `busy_until` [s]: the residual vibration is measured from there on.  `reading`:
    whether the moment feedback subtracts the rigid arm's moment.
    """

    name: Annotated[str, Quantity(key="scenario", help="name of the scenario")]
    period: Annotated[float, PERIOD]
    feedforward: Real
    hub_angle: Real
    hub_rate: Real
    rigid_moment: Real
    disturbance: Real
    impulse: float = 0.0
    tip_offset: float = 0.0
    busy_until: float = 0.0
    reading: MomentReading = "vibration"

    @property
    def t(self) -> Real:
        """The times of the samples [s]."""
        return np.arange(self.feedforward.size) * np.float64(self.period)

    @property
    def references(self) -> dict[str, Real]:
        """References of outputs, by name: hub angle [rad], hub rate [rad/s], root moment [N m]."""
        return dict(zip(AT_HUB, (self.hub_angle, self.hub_rate, self.moment_reference), strict=True))

    @property
    def moment_reference(self) -> Real:
        """Reference of the moment feedback [N m]: the rigid arm's moment, or 0 under the reading "total"."""
        return self.rigid_moment * float(self.reading == "vibration")

    def residual(self, moment: Real) -> Real:
        """Return the root moment (samples, ...) less the rigid arm's [N m], at samples from the end of the slew on."""
        return (moment.T - self.rigid_moment).T[self.is_after]

    @property
    def is_after(self) -> NDArray[np.bool_]:
        """Whether each sample (n,) is from the end of the slew on."""
        return self.t >= self.busy_until * (1 - TIME_ROUNDING)

    def through(self, impulses: Real) -> Self:
        """Return the scenario with every reference passed through impulses (m,); the slew ends later."""
        names = ("feedforward", "hub_angle", "hub_rate", "rigid_moment")
        late: dict[str, Any] = {
            name: np.convolve(getattr(self, name), impulses)[: self.t.size] for name in names
        }
        return replace(self, busy_until=self.busy_until + (impulses.size - 1) * self.period, **late)

    def residual_rms(self, moment: Real) -> float | None:
        """Return the rms of the residual of a root moment (n,) [N m]; None of a record that ends before."""
        left = self.residual(moment) if moment.size == self.t.size else np.empty(0)
        return float(np.sqrt(np.mean(left**2))) if left.size else None


def slew_scenario(arm: Arm, chain: Chain, duration: float) -> Scenario:
    """Return the slew of a chain's profile, without its shaper: means over a sample, fed forward with J.

    Or with the exact inverse at the hub (`inverse_torque`), or without.  On a rig also friction, back-EMF and analog
    damping at the mean rate, all in the unit of its input.
    The rigid arm's moment is -(J - I_h) theta_dd_ref of the interval before the sample.  Raises ParameterError for an
    arm that cannot turn.
    """
    must_turn(arm)
    arm, chain = arm_under_chain(arm, chain)
    T = chain.sampling.period
    manoeuvre = chain.slew
    t = np.float64(T) * np.arange(_samples(duration, T) + 1)
    rate, mean = motion_of_slew(chain, arm.reach, t)
    acceleration = np.diff(rate) / T
    torque = {
        "rigid": lambda: arm.turned_inertia * acceleration + arm.rate_loss * mean,
        "inverse": lambda: inverse_torque(arm, chain, mean.size),
        "none": lambda: 0 * mean,
    }
    return Scenario(
        name="slew",
        period=T,
        feedforward=torque[chain.reference.feedforward](),
        hub_angle=np.r_[0.0, np.cumsum(mean * T)][:-1],
        hub_rate=rate[:-1],
        rigid_moment=-arm.gauged_inertia * np.r_[0.0, acceleration[:-1]],
        disturbance=np.zeros(mean.size),
        busy_until=manoeuvre.rise_time,
        reading=manoeuvre.reading,
    )


def torque_unit(arm: Arm, chain: Chain) -> float:
    """Return the slew's torque J theta_dd over that of the paper's arm [N m], to one digit: 1 there.

    For an arm without a slew J is its own inertia about the hub, without the held parts.
    """
    # the slew of the paper's arm, of 1.15 m in 1 s, takes 3 N m
    return float(f"{abs(turning_inertia(arm) * chain.slew.acceleration(arm.reach)) / 3:.1g}")


def trial_weights(arm: Arm, chain: Chain) -> tuple[float, float]:
    """Return the weights a and b [1/(N m)^2 s] of the cost of a trial: `TRIAL_COST` in the arm's own unit of torque."""
    a, b = np.array(TRIAL_COST) / torque_unit(arm, chain) ** 2
    return float(a), float(b)


def rest_scenario(name: str, arm: Arm, chain: Chain, duration: float, signal: str = "hub_angle") -> Scenario:
    """Return a scenario without references, or "reference", one of 1 rad or 1 rad/s of a `signal` of the hub.

    A step of the torque r at t = 0, 0.1 of the arm's unit of torque; the decay of the first mode from rest with the tip
    displaced by 0.01 L; a disturbance on the hub of 0.1 of that unit for a tenth of the slew; or an impulse there just
    after the sample at t = 0, 0.01 s of that unit.  So it is first measured a sample later.  (Just before a sample the
    moment of a damped arm would be measured where it grows as t^-1/2, without bound, and no number of modes converges.)
    """
    T = chain.sampling.period
    unit = torque_unit(arm, chain)
    torque = 0.1 * unit
    zero = np.zeros(_samples(duration, T))
    # of the pulse, in whole samples
    width = max(1, round(0.1 * chain.slew.rise_time / T))
    sizes: dict[str, dict[str, Any]] = {
        "pulse": {
            "disturbance": np.where(np.arange(zero.size) < width, torque, 0.0),
            "busy_until": width * T,
        },
        "step": {"feedforward": zero + torque},
        "decay": {"tip_offset": 0.01 * arm.length},
        "impulse": {"impulse": 0.01 * unit},
        "reference": {signal: zero + 1.0},
    }
    return replace(Scenario(name, T, zero, zero, zero, zero, zero), **sizes[name])


def describe_scenario(task: Scenario, arm: Arm, chain: Chain) -> str:
    """Return a scenario with its size, in words."""
    if task.name == "slew":
        reference = chain.reference
        profile = f", {reference.profile}" * (reference.profile != "bang-bang")
        shaper = f", {reference.shaper} shaper" * (reference.shaper != "none")
        travel = chain.slew.travel_of(arm.reach)
        return f"a slew: the tip moves {travel:.4g} m in {chain.slew.rise_time:g} s{profile}{shaper}"
    return {
        "step": f"a step of {task.feedforward[0]:.4g} {arm.input_unit}",
        "decay": f"the first mode released with the tip at {task.tip_offset:.4g} m",
        "impulse": f"an impulse of {task.impulse:.4g} {arm.input_unit} s on the hub",
        "pulse": f"{task.disturbance[0]:.4g} {arm.input_unit} on the hub for {task.busy_until:.4g} s",
        "reference": f"a unit step of the reference of the hub {'angle' if task.hub_angle[0] else 'rate'}",
    }[task.name]


def scenario(name: str, arm: Arm, chain: Chain, duration: float, law: AnyLaw | None = None) -> Scenario:
    """Return the scenario of that name with its usual size; a slew through the shaper of the chain.

    The impulses of a shaper are those for the arm under a `law`.  Raises ParameterError for an unknown scenario,
    and for a shaper without a law.
    """
    must_be_known("scenario", name, ("slew", "step", "decay", "impulse", "pulse"))
    if name != "slew":
        return rest_scenario(name, arm, chain, duration)
    task = slew_scenario(arm, chain, duration)
    shaper = chain.reference.shaper
    if shaper == "none":
        return task
    remedy = "its impulses are those of a loop, and here is no law: leave it out"
    require(law is not None, "reference.shaper", shaper, remedy)
    return task.through(impulses_of(arm, chain, cast("AnyLaw", law)))


def _samples(duration: float, period: float) -> int:
    """Return the number of samples in 0 .. duration, both ends included."""
    # of a record, a few hundred MB of signals
    most_task_samples = 4_000_000
    length = positive("duration", duration, "a duration is a positive, finite number of seconds")
    periods = length / period
    remedy = f"at most {most_task_samples} samples of {period:g} s; a shorter one, or a longer period"
    require(periods < most_task_samples, "duration", length, remedy)
    return math.floor(periods * (1 + TIME_ROUNDING)) + 1
