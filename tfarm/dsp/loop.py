"""The sampled closed loop: its matrix, its poles with growths that are resolved below the last bit of 1, its verdict.

    u_k = -Kp theta_k - K1 theta_t,k - K2 M_k + r_k,   M the root moment E I phi'(0) as a strain gauge reads it

    F(z) = 1 + gains . H(z) = 1 + Kp Theta(z) + K1 R(z) + K2 M(z) = 0

Matrix eigenvalues are right to about 1e-14, and a mode may grow by 1e-10 a sample; those of n poles next to each other,
as a law of high order has them next to z = 1, are right to the nth root of that.  So all are polished together, each as
an offset o from the nearest open-loop pole e^{pT}, by the Ehrlich-Aberth method on P(z) = F(z) prod(z - poles of F),

    step = 1/(P'/P - sum over the other roots of 1/(z - root))

where o F(e^{pT} + o) is computed without loss; then ln|z| = Re(pT) + ln|1 + o e^{-pT}|.  (Aberth, Mathematics of
Computation 27, 1973.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from tfarm.arm import FED_BACK, Arm, HubFeedback, must_not_be_algebraic
from tfarm.arrays import Complex, Real, Whole
from tfarm.dsp.chain import Chain, chain_or_usual
from tfarm.dsp.plant import USUAL_MODES, Branching, Plant, is_analog, loop_plant, shorter_plant, with_modes
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
DIFFERENCE = 1e-7  # of an offset: between two points that give a slope
MOST_STEPS = 60  # of all roots together: from four digits on two are enough, of a cluster a dozen spread first
LAST_STEP = 1e-12  # of the offset: below its rounding
SETTLED, EIGENVALUE_ROUNDING = 1e-6, 1e-9  # of the offset, and beyond: a root that still steps by more is put back
UNMOVED = 1e-50  # an offset this small is a pole that the loop does not move
NONE = np.empty(0, complex)
LEAST_SQUARE = -1.0 + 1e-15  # stands for |z|^2 - 1 of a pole at z = 0, which no root is laid out from
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

    @cached_property
    def own_moment(self) -> Real:
        """The row of C that reads the arm's own root moment, ahead of the anti-alias filter: states as in `matrix`."""
        plant = with_modes(self.plant.model, self.chain, FED_BACK, self.plant.count).rows(["root_moment"])
        row = PulseTransfer(self.plant.beside(plant), self.chain.sampling).folded().matrices()[2][-1]
        return np.pad(row, (0, 2 * self.differences))

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
        return self.polished()

    def polished(self, which: Any = None) -> SampledPoles:
        """The closed-loop poles, polished, or some of them."""
        more = np.array([self.smoothing - 1, -1.0]) if self.differences else NONE
        open_loop = OpenLoop.of_order(self.eigenvalues.size, self.pulse, of_F=more)
        return polished_poles(self.eigenvalues, open_loop, self.characteristic, which)


@dataclass(frozen=True)
@record
class OpenLoop:
    """Poles to which roots are near, as z - 1: those of the plant and then others of q; `poles` are those of F."""

    pulse: PulseTransfer
    poles: Complex
    others: Complex = field(default_factory=lambda: np.empty(0, complex))

    @classmethod
    def of_order(cls, order: int, pulse: PulseTransfer, *, of_F: Complex = NONE, of_law: Complex = NONE) -> OpenLoop:
        """Of a loop with so many poles: those of its plant, of its delay, and at z = 1 what is left."""
        known = np.r_[pulse.shifts[:-1], np.full(pulse.sampling.whole_delay + 1, -1.0), of_F]
        return cls(pulse, np.r_[known, np.zeros(max(0, order - known.size - of_law.size))], of_law)

    @cached_property
    def shifts(self) -> Complex:
        """z - 1 of each pole that a root may be near to."""
        return np.r_[self.pulse.shifts, self.others]

    @cached_property
    def log_radius(self) -> Real:
        """ln|z| of each."""
        own = 2 * self.others.real + abs(self.others) ** 2
        return np.r_[self.pulse.poles.real * self.pulse.sampling.period, np.log1p(np.maximum(own, LEAST_SQUARE)) / 2]

    def nearest(self, delta: Complex) -> Whole:
        """The number of the pole nearest to each z = 1 + delta, of those that have not faded and that are poles of F.

        The integrals of a hub that cannot drift are none: next to them F has no digits of its own.
        """
        away = abs(delta[:, None] - self.shifts)
        away[:, abs(1 + self.shifts) <= FADED_RADIUS] = np.inf
        if not self.pulse.plant.rigid.any():
            away[:, self.pulse.poles.size - 1] = np.inf
        return np.asarray(away.argmin(axis=1))


def polished_poles(
    eigenvalues: Complex, open_loop: OpenLoop, characteristic: Characteristic, which: Any = None
) -> SampledPoles:
    """Closed-loop poles from eigenvalues that are nearly right, each as an offset from its nearest open-loop pole.

    Those of a mask alone where `which` is one; those that are 1 stay.
    """
    delta, pulse = eigenvalues - 1, open_loop.pulse
    base = open_loop.nearest(delta)
    offset = delta - open_loop.shifts[base]
    bright = (abs(eigenvalues) > FADED_RADIUS) & (delta != 0) & (True if which is None else which)
    rows = np.flatnonzero(bright)
    if rows.size:
        _settle(base, offset, rows, open_loop, characteristic)
        moved = open_loop.nearest(open_loop.shifts[base] + offset)
        if (rows := np.flatnonzero(bright & (moved != base))).size:  # then all digits are kept from there
            offset[rows] += open_loop.shifts[base[rows]] - open_loop.shifts[moved[rows]]
            base[rows] = moved[rows]
            _settle(base, offset, rows, open_loop, characteristic)
    z, at = eigenvalues.copy(), base[bright]
    with np.errstate(divide="ignore"):
        log_radius = np.maximum(np.log(abs(z)), SMALLEST_LOG)
    ratio = offset[bright] / (1 + open_loop.shifts[at])
    log_radius[bright] = open_loop.log_radius[at] + np.log1p(2 * ratio.real + abs(ratio) ** 2) / 2
    z[bright] = (1 + open_loop.shifts[at]) + offset[bright]
    mode = pulse.mode[abs(z[:, None] - pulse.multipliers).argmin(axis=1)]
    found = SampledPoles(z, log_radius, mode)
    return found if which is None else SampledPoles(z[which], log_radius[which], mode[which])


def _settle(base: Whole, offset: Complex, rows: Whole, open_loop: OpenLoop, characteristic: Characteristic) -> None:
    """Bring some roots to rest, in place: those that never come there stay as they are."""
    start, shifts = offset.copy(), open_loop.shifts
    last = np.full(offset.size, np.inf)
    offset[rows] = np.where(offset[rows] == 0, OFF_POLE, offset[rows])
    with np.errstate(all="ignore"):  # a root on an open-loop pole, and one that strays beyond any number
        for _ in range(MOST_STEPS):
            b, o = base[rows], offset[rows]
            both, one = np.r_[o, o * (1 + DIFFERENCE)], shifts[b]
            f, ahead = characteristic(1 + (np.r_[one, one] + both), np.r_[b, b], both).reshape(2, -1)
            slope = (ahead - f) / (DIFFERENCE * o * f) - np.where(b < open_loop.pulse.poles.size, 1 / o, 0.0)
            apart = (one[:, None] - shifts[base]) + (o[:, None] - offset)
            slope = slope + (1 / ((one[:, None] - open_loop.poles) + o[:, None])).sum(axis=1)
            step = 1 / (slope - np.where(apart == 0, 0.0, 1 / apart).sum(axis=1))
            step = np.where((f == 0) | ~np.isfinite(step), 0.0, step)
            offset[rows] = np.where(abs(o - step) < UNMOVED, UNMOVED, o - step)
            last[rows] = abs(step)
            rows = rows[abs(step) > LAST_STEP * abs(offset[rows])]
            if not rows.size:
                break
    lost = np.isfinite(last) & (last > EIGENVALUE_ROUNDING + SETTLED * abs(offset))
    offset[lost] = start[lost]
    offset[abs(offset) <= UNMOVED] = 0.0


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
