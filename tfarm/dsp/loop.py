"""The sampled closed loop: its matrix, its poles with growths that are resolved below the last bit of 1, its verdict.

    u_k = -Kp theta_k - K1 theta_t,k - K2 M_k + r_k,   M the root moment E I phi'(0) as a strain gauge reads it

    F(z) = 1 + gains . H(z) = 1 + Kp Theta(z) + K1 R(z) + K2 M(z) = 0

Matrix eigenvalues are right to about 1e-14, and a mode may grow by 1e-10 a sample.  So each is polished as an offset
delta from the nearest open-loop pole e^{pT}, by the secant method on delta F(e^{pT} + delta), which is computed without
loss; then ln|z| = Re(pT) + ln|1 + delta e^{-pT}|.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from tfarm.arm import FED_BACK, Arm, HubFeedback, must_not_be_algebraic
from tfarm.arrays import Complex, Real, Whole
from tfarm.dsp.chain import Chain, chain_or_usual
from tfarm.dsp.plant import USUAL_MODES, Branching, Plant, is_analog, loop_plant, shorter_plant
from tfarm.dsp.sampling import PulseTransfer
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import torque
from tfarm.exact.outputs import OUTPUTS
from tfarm.records import record
from tfarm.response import transfer
from tfarm.spectrum.damped import all_damped_modes
from tfarm.spectrum.scales import check_gains

Characteristic = Callable[[Complex, Whole | None, Any], Complex]  # offset F at z = e^{pT} + offset, p of that number

ANGLE_ROW, RATE_ROW = (FED_BACK.index(name) for name in ("hub_angle", "hub_rate"))  # rows of what is measured
NO_LAG = 1e-30  # stands for zero where a root sits on the filter's own pole, which it does where nothing is fed back
SMALLEST_LOG = -745.0  # of the smallest double: stands for the logarithm of 0
OFF_POLE = 1e-17  # stands for an offset of 0: next to 1 that is none
FIRST_DIFFERENCE, LEAST_DIFFERENCE = 1e-4, 1e-18  # of an offset, and beyond: between the two first points of a secant
OFFSET_STEPS = 8  # of the secant: from four digits on three are enough
EIGENVALUE_ROUNDING, OFF_COURSE = 1e-9, 1e-3  # and of the offset: a root farther than both from its start has strayed
LAST_STEP = 1e-12  # of the offset: the secant method's next step would be below its rounding
UNMOVED = 1e-50  # an offset this small is a pole that the loop does not move
FADED_RADIUS = 0.2  # a pole nearer to z = 0 decides nothing and is not polished


@dataclass(frozen=True)
@record
class SampledPoles:
    """Closed-loop poles `z` and `log_radius` ln|z| of each, the z = 1 of a hub angle that nothing regulates left out.

    `mode` is the flexible mode of the open-loop pole that is nearest (0: none).
    """

    z: Complex
    log_radius: Real
    mode: Whole

    @property
    def log_spectral_radius(self) -> float:
        """The largest ln|z|."""
        return float(self.log_radius.max())

    @property
    def unstable(self) -> int:
        """How many lie outside the unit circle."""
        return int((self.log_radius > 0).sum())

    @property
    def is_stable(self) -> bool:
        """Whether all lie inside the unit circle; nothing is rounded."""
        return self.log_spectral_radius < 0.0


def turning(plant: Plant) -> Real:
    """What each output is of an arm that has turned, but for a factor: 0 except of its angle and of displacements."""
    return np.asarray(plant.rigid[:, 0 if plant.rigid[ANGLE_ROW, 0] else 1])


def without_drift(A: Real, first: int, shift: Real) -> Real:
    """A without its pole z = 1 at the direction `shift`, whose entry `first` is 1: the quotient by that direction."""
    others = np.arange(len(A)) != first
    return np.asarray(A[others][:, others] - np.outer(shift[others], A[first, others]))


@dataclass(frozen=True)
@record
class SampledLoop:
    """The arm under the control law at the samples of a chain: `plant` from torque to what is measured, and `gains`."""

    plant: Plant
    chain: Chain
    gains: HubFeedback

    @cached_property
    def pulse(self) -> PulseTransfer:
        """The pulse transfer functions to hub angle, hub rate and root moment."""
        return PulseTransfer(self.plant, self.chain.sampling).folded()

    def having(self, **gains: float) -> SampledLoop:
        """The same loop with other values of the gains that are named."""
        return self.under(replace(self.gains, **gains))

    def under(self, gains: HubFeedback) -> SampledLoop:
        """The same loop under another law; the pulse transfer functions, which know no law, are shared."""
        other = replace(self, gains=gains)
        vars(other)["pulse"] = self.pulse
        return other

    def with_delay(self, samples: float) -> SampledLoop:
        """The same loop with another computational delay."""
        return replace(self, chain=replace(self.chain, sampling=replace(self.chain.sampling, delay_samples=samples)))

    def with_modes(self, count: int) -> SampledLoop:
        """The same loop with another number of flexible modes; no work where the plant's model has as many."""
        if count <= self.plant.model.index.size:
            return replace(self, plant=shorter_plant(self.plant, self.chain, count))
        return replace(self, plant=loop_plant(self.plant.arm, self.chain, count))

    @property
    def differences(self) -> bool:
        """Whether the hub rate is the filtered difference of the encoder."""
        return self.chain.converters.hub_rate == "difference"

    @property
    def has_free_angle(self) -> bool:
        """Whether the hub angle is a pole at z = 1 that nothing regulates."""
        turned = turning(self.plant)
        return bool(turned[ANGLE_ROW]) and not np.array(self.gains.row)[turned != 0].any()

    @property
    def smoothing(self) -> float:
        """The pole a of the rate filter (1 - a)/(1 - a/z); 0 is none."""
        return float(np.exp(-self.chain.converters.rate_filter * self.chain.sampling.period))

    @property
    def exact(self) -> Callable[[Complex], Complex]:
        """The exact transfer functions of what is fed back, at s (n,), without the filters."""
        return transfer(self.plant.arm, list(FED_BACK))

    @property
    def analog(self) -> tuple[bool, ...]:
        """Of what is fed back, what passes the anti-alias filter."""
        return tuple(is_analog(OUTPUTS[name], self.chain) for name in FED_BACK)

    @property
    def push(self) -> Real:
        """What the law adds to each pole of the plant, at most [1/s]."""
        return np.asarray(abs(np.array(self.gains.row)[:, None] * self.plant.residues).sum(axis=0))

    # ------------------------------------------------------------ characteristic function

    def signals(self, z: Complex, base: Whole | None, offset: Any) -> Complex:
        """offset H (gains, n) of all that is fed back, at z = e^{pT} + offset (n,), p the pole number `base`."""
        measured = self.pulse.scaled(z, base, offset)
        if self.differences:
            a, T = self.smoothing, self.chain.sampling.period
            step = z - 1.0
            if base is not None:
                step = np.where(base == self.pulse.poles.size - 1, offset, step)
            lag = np.where(z == a, NO_LAG, z - a)
            measured[RATE_ROW] = measured[ANGLE_ROW] * step * ((1 - a) / T) / lag
        return measured

    def characteristic(self, z: Complex, base: Whole | None, offset: Any) -> Complex:
        """offset F(z)."""
        return np.asarray(offset + torque(self.gains.row, self.signals(z, base, offset)))

    def __call__(self, z: Complex) -> Complex:
        """F(z) at an array of z."""
        z = np.asarray(z, dtype=complex)
        return self.characteristic(z.ravel(), None, np.ones(z.size)).reshape(z.shape)

    # ------------------------------------------------------------ poles

    def matrix(self) -> Real:
        """The closed-loop matrix with the hub angle: states of `PulseTransfer.matrices`, then of the rate filter."""
        A, B, C = self.pulse.matrices()
        if self.differences:
            n, a, T = len(A), self.smoothing, self.chain.sampling.period
            A, B, C = np.pad(A, (0, 2)), np.pad(B, (0, 2)), np.pad(C, ((0, 0), (0, 2)))
            A[n] = C[ANGLE_ROW]  # two states more: the angle and the rate of the sample before
            A[n + 1] = C[RATE_ROW] = (1 - a) / T * (C[ANGLE_ROW] - np.eye(n + 2)[n]) + a * np.eye(n + 2)[n + 1]
        return A - np.outer(B, np.array(self.gains.row) @ C)

    def reduced_matrix(self) -> Real:
        """The closed-loop matrix without the pole z = 1 of a free hub angle, or of a hub that cannot drift."""
        A, first = self.matrix(), self.pulse.integrals_at
        rigid = self.plant.rigid[ANGLE_ROW]
        if not rigid.any():  # neither integral of the torque is felt
            return np.delete(np.delete(A, [first, first + 1], 0), [first, first + 1], 1)
        if rigid[0] == 0.0:  # a damped hub: the angle feels the single integral alone
            A = np.delete(np.delete(A, first, 0), first, 1)
        if not self.has_free_angle:
            return A
        shift = np.zeros(len(A))
        shift[first] = 1.0
        if self.differences:
            shift[-2] = self.pulse.matrices()[2][ANGLE_ROW, first + int(rigid[0] == 0.0)]
        return without_drift(A, first, shift)

    @cached_property
    def eigenvalues(self) -> Complex:
        """The closed-loop poles, not polished, in the order of `poles`."""
        return np.linalg.eigvals(self.reduced_matrix()).astype(complex)

    @cached_property
    def poles(self) -> SampledPoles:
        """The closed-loop poles, polished."""
        return polished_poles(self.eigenvalues, self.pulse, self.characteristic)


def polished_poles(eigenvalues: Complex, pulse: PulseTransfer, characteristic: Characteristic) -> SampledPoles:
    """Closed-loop poles from eigenvalues that are nearly right, each as an offset from its nearest open-loop pole."""
    z, open_loop = eigenvalues.copy(), pulse.multipliers
    base = abs(z[:, None] - open_loop).argmin(axis=1)
    with np.errstate(divide="ignore"):
        log_radius = np.maximum(np.log(abs(z)), SMALLEST_LOG)
    bright = (abs(z) > FADED_RADIUS) & (abs(open_loop[base]) > FADED_RADIUS)
    if bright.any():
        offset = _offsets(z[bright], base[bright], open_loop[base[bright]], characteristic)
        ratio = offset / open_loop[base[bright]]
        own = pulse.poles[base[bright]].real * pulse.sampling.period
        log_radius[bright] = own + np.log1p(2 * ratio.real + abs(ratio) ** 2) / 2
        z[bright] = open_loop[base[bright]] + offset
    return SampledPoles(z, log_radius, pulse.mode[base])


def _offsets(z: Complex, base: Whole, open_loop: Complex, characteristic: Characteristic) -> Complex:
    """Offsets of the roots from their open-loop poles, by the secant method where it does not stray."""
    start = z - open_loop
    start = np.where(start == 0, OFF_POLE, start)
    old = start * (1 + FIRST_DIFFERENCE) + LEAST_DIFFERENCE
    new, f_old = start, characteristic(open_loop + old, base, old)
    with np.errstate(all="ignore"):  # a root that strays beyond any number is put back to its start below
        for _ in range(OFFSET_STEPS):
            f_new = characteristic(open_loop + new, base, new)
            slope = f_new - f_old
            step = np.where(slope == 0, 0.0, f_new * (new - old) / np.where(slope == 0, 1.0, slope))
            old, f_old, new = new, f_new, np.where(abs(new - step) < UNMOVED, UNMOVED, new - step)
            if not (abs(step) > LAST_STEP * abs(new)).any():
                break
    near = abs(new - start) <= EIGENVALUE_ROUNDING + OFF_COURSE * abs(start)
    offset = np.where(near, new, start)
    return np.where(abs(offset) <= UNMOVED, 0.0, offset)


def sampled_loop(
    arm: Arm,
    gains: HubFeedback,
    chain: Chain | None = None,
    *,
    count: int = USUAL_MODES,
    branches: Branching = all_damped_modes,
) -> SampledLoop:
    """The loop with `count` flexible modes.  Raises ParameterError for a locked hub, and for I_h = 0 with K2 != 0.

    For one arm with many C: `branches` of its damped modes, that remember where they were.
    """
    chain = chain_or_usual(chain)
    check_loop(arm, gains)
    return SampledLoop(loop_plant(arm, chain, count, branches), chain, gains)


class Resizable(Protocol):
    """A loop that can be had with another number of flexible modes."""

    def with_modes(self, count: int) -> Self:
        """The same loop with that many."""


Sized = TypeVar("Sized", bound=Resizable)


def resized(loop: Sized, count: int) -> Sized:
    """The loop with another number of flexible modes, or a few less or more where two damped modes are one there."""
    for number in (count, count - 1, count + 1, count - 2, count + 2):
        try:
            return loop.with_modes(max(1, number))
        except ConvergenceError as error:
            lost = error
    raise lost


def check_loop(arm: Arm, gains: HubFeedback) -> None:
    """Refuse the loop that does not exist, I_h = 0 and K2 != 0, and a gain that is absurdly large for the arm."""
    if gains.K2:
        must_not_be_algebraic(arm, "K2", gains.K2)
    check_gains(arm, gains)
