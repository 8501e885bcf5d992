"""The sampled loop of any linear law in z: its matrix, its characteristic function, its poles.

    u_k = -(C x_k + D y_k) + r_k,  x_{k+1} = A x_k + B y_k          the law, p_i/q its entries
    F(z) = q(z) + sum over signals of p_i(z) H_i(z) = 0             closed-loop poles

Poles are polished as those of gains at the hub are (`loop`), from the nearest pole of the plant or of the law: q and
p_i are polynomials, kept as factors (`law_factors`), so that F has no other poles than the plant has.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from typing_extensions import TypeVar

from tfarm.arm import Arm, must_not_be_algebraic
from tfarm.arm.blocks import Rational, StateSpace
from tfarm.arm.law import Law, Part
from tfarm.arrays import LEAST_SIZE, Complex, Real, Whole
from tfarm.dsp.chain import MOST_DELAY, Chain
from tfarm.dsp.discretise import discretised
from tfarm.dsp.law_factors import LawFactors, law_factors
from tfarm.dsp.law_plant import SensedPlant, sensed_plant
from tfarm.dsp.loop import OpenLoop, SampledLoop, SampledPoles, polished_poles, without_drift
from tfarm.dsp.plant import USUAL_MODES, Branching, Plant, is_analog
from tfarm.dsp.sampling import PulseTransfer
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.reduced.sensed import closed
from tfarm.spectrum.damped import all_damped_modes

STATIC_ZERO = 1e-11  # of its terms: a static gain that is 0, summed over 400 modes


@dataclass(frozen=True)
@record
class SampledLaw:
    """A rig under a law at the samples of a chain: `asked` as it was given, `law` in z as it acts.

    `sensed` is what the law reads, its delay among that of `chain`; `factors` are those of the law in z.
    """

    sensed: SensedPlant
    chain: Chain
    law: Law
    asked: Law
    factors: LawFactors

    @cached_property
    def plant(self) -> Plant:
        """From the input to the signals of the law, through their filters."""
        return self.sensed.together

    @cached_property
    def pulse(self) -> PulseTransfer:
        """The pulse transfer functions to the signals of the law."""
        return PulseTransfer(self.plant, self.chain.sampling).folded()

    @cached_property
    def own_moment(self) -> Real:
        """The row of C that reads the arm's own root moment, a signal of the law, ahead of the anti-alias filter."""
        plant = self.plant.beside(self.sensed.unfiltered.rows(["root_moment"]))
        return np.asarray(PulseTransfer(plant, self.chain.sampling).folded().matrices()[2][-1])

    def times(self, factor: float) -> SampledLaw:
        """The same loop with a factor on the whole law."""
        return self.weighted([factor] * len(self.law.parts))

    def weighted(self, factors: Sequence[float]) -> SampledLaw:
        """The same loop with a factor on each part of the law."""
        return replace(
            self,
            law=self.law.weighted(factors),
            asked=self.asked.weighted(factors),
            factors=self.factors.weighted(factors),
        )

    def with_delay(self, samples: float) -> SampledLaw:
        """The same loop with another delay in all."""
        chain = replace(self.chain, sampling=replace(self.chain.sampling, delay_samples=samples))
        return replace(self, chain=chain)

    def with_modes(self, count: int, branches: Branching = all_damped_modes) -> SampledLaw:
        """The same loop with another number of flexible modes."""
        return replace(self, sensed=self.sensed.with_modes(count, branches))

    @property
    def exact(self) -> Callable[[Complex], Complex]:
        """The exact transfer functions of the signals, at s (n,), without the filters."""
        return self.sensed.read.values

    @property
    def analog(self) -> tuple[bool, ...]:
        """Which signals pass the anti-alias filter."""
        return tuple(is_analog(each, self.chain) for each in self.sensed.read.outputs)

    @property
    def push(self) -> Real:
        """What the law adds to each pole of the plant, at most, where the samples see it [1/s]."""
        seen = np.exp(1j * self.plant.poles.imag * self.chain.sampling.period)
        shares, whole = self.factors.shares(seen - 1)
        entries = shares.sum(axis=0)
        return np.asarray(abs(entries * self.plant.residues).sum(axis=0) / np.maximum(abs(whole), LEAST_SIZE))

    def signals(self, z: Complex, base: Whole | None, offset: Any) -> Complex:
        """Both `terms`, in rows: q, then each part of the law."""
        open_loop, fed_back = self.terms(z, base, offset)
        return np.vstack([open_loop, fed_back])

    @property
    def slowest(self) -> str:
        """What has the largest radius: the flexible mode whose pole is nearest, the hub, or the law itself."""
        n = int(self.poles.log_radius.argmax())
        delta, mode = self.poles.z[n] - 1, int(self.poles.mode[n])
        own = abs(self.factors.poles - delta).min(initial=np.inf)
        if own <= abs(self.pulse.shifts - delta).min():  # the same where it is put at z = 1: an integrator's
            return "a pole of the law"
        return f"mode {mode}" if mode else "the hub"

    # ------------------------------------------------------------ characteristic function

    def characteristic(self, z: Complex, base: Whole | None, offset: Any) -> Complex:
        """offset F(z); F(z) where the pole is the law's."""
        open_loop, fed_back = self.terms(z, base, offset)
        return np.asarray(open_loop + fed_back.sum(axis=0))

    def terms(self, z: Complex, base: Whole | None, offset: Any) -> tuple[Complex, Complex]:
        """offset q (n,) and, of each part of the law, offset times its sum of p_i H_i (parts, n).

        At z = e^{pT} + offset (n,), p the pole number `base`; of the law's poles, which are numbered after those of the
        plant, not times the offset.
        """
        z = np.asarray(z)
        if base is None:
            shares, whole = self.factors.shares(z - 1)
            return offset * whole, (shares * self.pulse.scaled(z, None, offset)).sum(axis=1)
        of_plant = self.pulse.poles.size
        own = base - of_plant
        delta = np.r_[self.pulse.shifts, self.factors.poles][base] + offset
        shares, whole = self.factors.shares(delta, own, offset)
        measured = np.empty((shares.shape[1], z.size), complex)
        for rows, at in ((own < 0, base), (own >= 0, None)):
            if rows.any():
                factor = np.ones(int(rows.sum())) if at is None else offset[rows]
                measured[:, rows] = self.pulse.scaled(z[rows], at if at is None else at[rows], factor, delta[rows])
        return np.where(own < 0, offset, 1.0) * whole, (shares * measured).sum(axis=1)

    def __call__(self, z: Complex) -> Complex:
        """F(z) at an array of z."""
        z = np.asarray(z, dtype=complex)
        return self.characteristic(z.ravel(), None, np.ones(z.size)).reshape(z.shape)

    # ------------------------------------------------------------ poles

    def matrix(self) -> Real:
        """The closed-loop matrix: states of `PulseTransfer.matrices`, then those of the law."""
        A, B, C = self.pulse.matrices()
        return closed((A, B[:, None], C, np.zeros((len(C), 1))), self.law.matrices())

    @property
    def is_damped(self) -> bool:
        """Whether friction makes the turning hub a single integral of the input."""
        return bool(self.plant.arm.rate_loss or self.chain.actuator.hub_damping)

    @cached_property
    def has_free_angle(self) -> bool:
        """Whether the hub angle is a pole at z = 1 that nothing regulates."""
        turned = dict(zip(self.factors.signals, self.plant.rigid[:, int(self.is_damped)], strict=True))
        return bool(self.plant.arm.has_rigid_mode and self.factors.ignores(turned))

    def reduced_matrix(self) -> Real:
        """The closed-loop matrix without the pole z = 1 of a free hub angle, or of a hub that cannot drift."""
        A, first = self.matrix(), self.pulse.integrals_at
        if not self.plant.arm.has_rigid_mode:
            return np.delete(np.delete(A, [first, first + 1], 0), [first, first + 1], 1)
        if self.is_damped:  # its angle is the single integral
            A = np.delete(np.delete(A, first, 0), first, 1)
        if not self.has_free_angle:
            return A
        own, B, _, _ = self.law.matrices()
        angle = self.pulse.matrices()[2][:, first + int(self.is_damped)]
        shift = np.zeros(len(A))
        shift[first] = 1.0  # and the states of the law where the hub stands still an angle off
        shift[len(A) - len(own) :] = np.linalg.lstsq(np.eye(len(own)) - own, B @ angle, rcond=None)[0]
        return without_drift(A, first, shift)

    @cached_property
    def eigenvalues(self) -> Complex:
        """The closed-loop poles, not polished."""
        return np.linalg.eigvals(self.reduced_matrix()).astype(complex)

    def near_one(self, places: Container[int] | None = None) -> tuple[tuple[int, float], list[tuple[int, float]]]:
        """q, and p_i H_i of each signal that is fed back, as (n, c) of c x^n where x = 1 - 1/z is small.

        Of the parts of the law at these places alone, or of all.
        """
        plant, T = self.plant, self.chain.sampling.period
        at_rest = plant.static - (plant.residues / plant.poles).real.sum(axis=1)
        size = abs(plant.static) + abs(plant.residues / plant.poles).sum(axis=1)
        whole, entries = self.factors.at_one()
        slopes, found = self.pulse.slopes_at_one, []
        for place, row, n, value in entries:
            if places is None or place in places:
                (twice, once), gain = plant.rigid[row], at_rest[row]
                own = (-2, twice * T * T) if twice else (-1, once * T) if once else (0, gain)
                if own[0] == 0 and abs(gain) <= STATIC_ZERO * size[row]:
                    own = (1, slopes[row])
                found.append((n + own[0], float(own[1] * value)))
        return whole, found

    @cached_property
    def poles_at_one(self) -> int:
        """How many closed-loop poles are at z = 1 for whatever numbers, a free hub angle apart.

        So are an integrator of what is 0 at rest, one of two integrators side by side, a hub whose rate nothing feels:
        x^N F, N the poles of the plant there, vanishes at x = 1 - 1/z = 0 as often as all of its terms do.
        """
        poles = 0 if not self.plant.arm.has_rigid_mode else (1 if self.is_damped else 2) - self.has_free_angle
        whole, fed_back = self.near_one()
        return max(0, poles + min(n for n, _ in (whole, *fed_back)))

    @cached_property
    def poles(self) -> SampledPoles:
        """The closed-loop poles, polished, those that are at z = 1 for whatever numbers put there."""
        return self.polished()

    def polished(self, which: Any = None) -> SampledPoles:
        """Those poles, or some of them."""
        z = self.eigenvalues.copy()
        z[np.argsort(abs(z - 1), kind="stable")[: self.poles_at_one]] = 1.0
        open_loop = OpenLoop.of_order(z.size, self.pulse, of_law=self.factors.poles)
        return polished_poles(z, open_loop, self.characteristic, which)


AnySampled = SampledLoop | SampledLaw
SampledKind = TypeVar("SampledKind", bound=AnySampled, default=SampledLoop)  # hub gains, unless a law is said


def sampled_law(
    arm: Arm, law: Law, chain: Chain, *, count: int = USUAL_MODES, branches: Branching = all_damped_modes
) -> SampledLaw:
    """The loop with `count` flexible modes.

    Raises ParameterError for a locked hub, an unknown signal, a law in z of another period, and what `discretised`
    refuses, and for a massless hub whose moment is fed back (an algebraic loop).
    """
    acting, late = acting_law(arm, law, chain)
    acting = with_estimate(acting, chain)
    sensed = sensed_plant(arm, late, acting.signals, count, branches)
    return SampledLaw(sensed, late, acting, law, law_factors(law, chain))


def acting_law(arm: Arm, law: Law, chain: Chain) -> tuple[Law, Chain]:
    """The law in z, and the chain with its delay."""
    T = chain.sampling.period
    samples = chain.sampling.delay_samples + law.delay / T
    if samples > MOST_DELAY:
        remedy = f"with the chain's delay that is {samples:.4g} samples; at most {MOST_DELAY:g}"
        raise ParameterError(key="delay", value=law.delay, remedy=remedy)
    if "root_moment" in law.signals:
        must_not_be_algebraic(arm, "signals", "root_moment")
    late = replace(chain, sampling=replace(chain.sampling, delay_samples=samples))
    return discretised(law, T), late


def with_estimate(law: Law, chain: Chain) -> Law:
    """The law in z with the difference of the encoder in it, where the chain makes the hub's rate so.

    rate = (1 - a)/T (z - 1)/(z - a) angle,  a the pole of its filter.
    """
    if chain.converters.hub_rate != "difference" or "hub_rate" not in law.signals:
        return law
    T = chain.sampling.period
    a = float(np.exp(-chain.converters.rate_filter * T))
    return replace(law, parts=tuple(_differenced(part, a, T) for part in law.parts), references=())


def _differenced(part: Part, a: float, T: float) -> Part:
    """A part of a law with its columns of the hub's rate led to the hub's angle."""
    if "hub_rate" not in part.signals:
        return part
    signals = tuple("hub_angle" if name == "hub_rate" else name for name in part.signals)
    if isinstance(part.block, Rational):
        num = np.convolve(part.block.num, [(1 - a) / T, -(1 - a) / T])
        return Part(signals, Rational(tuple(num), tuple(np.convolve(part.block.den, [1.0, -a]))))
    A, B, C, D = part.block.matrices()
    rate = np.array([name == "hub_rate" for name in part.signals], dtype=float)
    through, kept = (1 - a) / T, 1.0 - rate
    Br, Dr = (B @ rate)[:, None], (D @ rate)[:, None]
    slope = through * (a - 1)
    block = StateSpace(
        np.block([[A, slope * Br], [np.zeros((1, len(A))), np.array([[a]])]]),
        np.vstack([B * kept + through * Br * rate, rate[None]]),
        np.hstack([C, slope * Dr]),
        D * kept + through * Dr * rate,
    )
    return Part(signals, block)
