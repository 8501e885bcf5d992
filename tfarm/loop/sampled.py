"""The sampled loop of any linear law: its matrix, its characteristic function, its poles.

    u_k = r_k - (C x_k + D y_k),  x_{k+1} = A x_k + B y_k                        the law in z, p_i/q its entries
    F(z) = q(z) + sum over parts of weight sum over signals of p_i(z) H_i(z)     0 at the closed-loop poles

Gains at the hub are a law of three parts without states, u = -Kp theta - K1 theta_t - K2 M + r, M the root moment
E I phi'(0) as a strain gauge reads it.  F is affine in the weights of the parts, and `SampledRig.terms` has its terms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import FED_BACK, Arm, HubFeedback, Law, law_of
from tfarm.arm.chain import Chain, Sampling
from tfarm.arm.feedback import OUTPUT_OF
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.case import Case
from tfarm.dsp.discretise import (
    LawInZ,
    acting_law,
    law_in_z,
    root_product,
)
from tfarm.dsp.plant import MODES_USED, USUAL_MODES, Plant, first_distinct
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.sensed import sensed_plant
from tfarm.errors import ParameterError, did_you_mean
from tfarm.loop.loop import Loop
from tfarm.loop.sampled_poles import SampledPoles, polish_poles
from tfarm.loop.sampled_rig import SampledRig
from tfarm.moved import FormerName
from tfarm.records import frozen
from tfarm.response.signals import ControllerSignals
from tfarm.schema import Quantity


@frozen
class Sampled(Loop):
    """A rig under a law at the samples of a chain.

    `unit_law` has the parts of the law, with 1 for each plain gain; `weights` are the factors on these parts: such a
    gain, or 1.
    """

    rig: SampledRig
    unit_law: Law
    weights: tuple[float, ...]

    @property
    def chain(self) -> Chain:
        """The chain, which has the delay of the law too."""
        return self.rig.chain

    @property
    def period(self) -> float:
        """The sampling period [s]."""
        return self.chain.sampling.period

    @property
    def in_z(self) -> LawInZ:
        """The parts of `unit_law` in z."""
        return self.rig.in_z

    @property
    def plant(self) -> Plant:
        """From the input to the signals of the law, through their filters."""
        return self.rig.plant

    @property
    def pulse(self) -> PulseTransfer:
        """The pulse transfer functions to the signals of the law."""
        return self.rig.pulse

    @cached_property
    def arm(self) -> Arm:
        """The arm, without the actuator's damping."""
        return self.plant.arm

    # ------------------------------------------------------------ its numbers, and other loops

    @cached_property
    def law(self) -> Law:
        """The law with its weights."""
        return self.unit_law.with_factors(self.weights)

    @property
    def is_of_gains(self) -> bool:
        """Whether the law is that of all gains at the hub, with their references."""
        return self.unit_law.signals == FED_BACK and self.unit_law.gains is not None

    @property
    def gains(self) -> HubFeedback:
        """The gains at the hub, of a loop with these alone."""
        assert self.is_of_gains
        return law_of(self.weights)

    @property
    def numbers(self) -> dict[str, float]:
        """The weights that are numbers of the law, by name."""
        if self.is_of_gains:
            return self.gains.by_name
        return {name: self.weights[place] for name, (place, _) in self.unit_law.part_gains.items()}

    @property
    def feeds_back(self) -> bool:
        """Whether a weight is other than 0."""
        return any(self.weights)

    def place(self, name: str) -> int | None:
        """Return the part whose weight is a number, by its name in `Law.with_number`; None of any other number."""
        known = self.unit_law.part_gains
        name = OUTPUT_OF.get(name, name).removesuffix(".gain")
        return next((known[key][0] for key in (name, f"{name}.gain") if key in known), None)

    def number(self, name: str) -> float:
        """Return a number of the law."""
        return self.weights[self.part(name)]

    def part(self, name: str) -> int:
        """Return the part whose weight is a number.  Raises ParameterError for any other number."""
        place = self.place(name)
        if place is None:
            remedy = did_you_mean(name, list(self.unit_law.part_gains))
            raise ParameterError(key="law", value=name, remedy=remedy)
        return place

    def with_weights(self, weights: Sequence[float]) -> Sampled:
        """Return the same loop with other weights."""
        return replace(self, weights=tuple(weights))

    weighted = FormerName("with_weights")

    def with_number(self, name: str, value: float) -> Sampled:
        """Return the same loop with another value of one number of its law; cheap where that is a gain or factor."""
        place = self.place(name)
        if place is None:
            return super().with_number(name, value)
        weights = [*self.weights]
        weights[place] = value
        return self.with_weights(weights)

    def times(self, factor: float) -> Sampled:
        """Return the same loop with a factor on the whole law."""
        return self.with_weights([factor * each for each in self.weights])

    def with_delay(self, samples: float) -> Sampled:
        """Return the same loop with another total delay."""
        chain = with_delay_samples(self.chain, samples)
        return replace(self, rig=replace(self.rig, chain=chain))

    def with_modes(self, count: int) -> Sampled:
        """Return the same loop with another number of flexible modes; cheap where its models have as many."""
        return replace(self, rig=replace(self.rig, sensed=self.rig.sensed.with_modes(count)))

    def under(self, law: Law) -> Sampled:
        """Return the loop of another law on the same arm, with the same number of modes."""
        own = max(0.0, self.chain.sampling.delay_samples - self.law.delay / self.period)
        case = Case(self.arm, law, with_delay_samples(self.chain, own))
        return sampled_loop(case, count=self.plant.count)

    def on(self, arm: Arm, count: int) -> Sampled:
        """Return the loop of the same law on another arm, with `count` flexible modes."""
        sensed = sensed_plant(arm, self.chain, self.in_z.signals, count)
        return replace(self, rig=replace(self.rig, sensed=sensed))

    @property
    def push(self) -> Real:
        """Bound on the shift of each pole of the plant by the law, at its aliased frequency [1/s]."""
        delta = np.exp(1j * self.plant.poles.imag * self.period) - 1
        entries = np.zeros(self.plant.residues.shape, complex)
        for part, row, gain, zeros in self.in_z.terms:
            entries[row] += self.weights[part] * gain * root_product(delta, zeros)
        whole = np.maximum(abs(root_product(delta, self.in_z.poles)), LEAST_SIZE)
        return abs(entries * self.plant.residues).sum(axis=0) / whole

    # ------------------------------------------------------------ characteristic function

    @cached_property
    def row(self) -> Real:
        """The weights of the rows of `SampledRig.terms`."""
        return np.array([1.0, *self.weights])

    def parts(self, s: NDArray[Any]) -> tuple[Complex, Complex]:
        """Return denominator and numerator of L at z = e^{sT}, s = i w up to pi/T, or off the axis."""
        grid = self.rig.grid
        at = np.ravel(s) * self.period
        is_on = at.real == 0
        q = at.imag[is_on]
        base = grid.base[np.minimum(np.searchsorted(grid.q, q), grid.q.size - 1)]
        rows = np.empty((1 + len(self.weights), at.size), complex)
        rows[:, is_on] = grid.at(base, q - grid.angles[base])
        if q.size < at.size:
            rows[:, ~is_on] = self.rig.terms(np.exp(at[~is_on]), None, np.ones(at.size - q.size))
        fed_back = np.asarray(np.array(self.weights) @ rows[1:], dtype=np.complex128)
        return rows[0].reshape(np.shape(s)), fed_back.reshape(np.shape(s))

    def __call__(self, z: Complex) -> Complex:
        """Return F(z) at an array of z."""
        z = np.asarray(z, dtype=complex)
        return (self.row @ self.rig.terms(z.ravel(), None, np.ones(z.size))).reshape(z.shape)

    # ------------------------------------------------------------ poles

    def matrix(self) -> Real:
        """Return the closed-loop matrix: states of `PulseTransfer.matrices`, then those of the law."""
        M, b = self.rig.frame
        _, _, Ck, Dk = self.in_z.matrices
        weights = np.array([self.weights])
        return M - np.outer(b, np.hstack([weights @ Dk @ self.pulse.matrices()[2], weights @ Ck]))

    @cached_property
    def has_free_angle(self) -> bool:
        """Whether the hub angle is a pole at z = 1 without feedback."""
        turned = self.plant.rigid[:, int(self.rig.is_damped)]
        return bool(self.plant.arm.has_rigid_mode and self.in_z.ignores(turned, self.weights))

    def reduced_matrix(self) -> Real:
        """Return the closed-loop matrix without the pole z = 1 of a free hub angle, or of a hub that cannot drift."""
        A = self.matrix()
        first = self.pulse.integrals_at
        # its angle is the single integral
        unfelt = 2 if not self.plant.arm.has_rigid_mode else int(self.rig.is_damped)
        felt = np.r_[np.arange(first), np.arange(first + unfelt, len(A))]
        A = A[np.ix_(felt, felt)]
        if not self.has_free_angle:
            return A
        own, B, _, _ = self.in_z.matrices
        angle = self.pulse.matrices()[2][:, first + int(self.rig.is_damped)]
        shift = np.zeros(len(A))
        # and the states of the law where the hub is at rest at that angle
        shift[first] = 1.0
        shift[len(A) - len(own) :] = np.linalg.lstsq(np.eye(len(own)) - own, B @ angle, rcond=None)[0]
        # the quotient by that direction
        others = np.arange(len(A)) != first
        return A[others][:, others] - np.outer(shift[others], A[first, others])

    @cached_property
    def eigenvalues(self) -> Complex:
        """The closed-loop poles, not polished, in the order of `poles`."""
        return np.linalg.eigvals(self.reduced_matrix()).astype(complex)

    @cached_property
    def poles_at_one(self) -> int:
        """Number of closed-loop poles at z = 1 for any numbers, without a free hub angle.

        Such are an integrator of a signal that is 0 at rest, one of two parallel integrators, a hub without feedback of
        its rate.  The order of x^N F, N the poles of the plant there, at x = 1 - 1/z = 0 is the least of its terms.
        """
        if not self.plant.arm.has_rigid_mode:
            poles = 0
        else:
            poles = (1 if self.rig.is_damped else 2) - self.has_free_angle
        return max(0, poles + min(n for n, _ in self.rig.near_one(self.row)))

    @property
    def is_stable(self) -> bool:
        """Whether all poles lie inside the unit circle."""
        return self.poles.is_stable

    @cached_property
    def poles(self) -> SampledPoles:
        """The closed-loop poles, polished."""
        return polish_poles(self.rig, self.row, self.eigenvalues, self.poles_at_one)


class OfLoop:
    """Properties of the loop in a record of a sampled loop."""

    loop: Sampled

    @property
    def controller(
        self,
    ) -> Annotated[ControllerSignals, Quantity(flat=True, help="arm and controller of the loop")]:
        """Names of the arm and the controller."""
        return self.loop.controller

    @property
    def sampling(
        self,
    ) -> Annotated[Sampling, Quantity(flat=True, help="sampling period and delay of the loop")]:
        """Period and delay."""
        return self.loop.chain.sampling

    @property
    def modes_used(self) -> Annotated[int, MODES_USED]:
        """Number of flexible modes in the loop."""
        return self.loop.plant.count


def sampled_loop(case: Case, *, count: int = USUAL_MODES) -> Sampled:
    """Return the loop of a case with `count` flexible modes.

    Raises ParameterError for a locked hub, an unknown signal, a law in z of another period, a massless hub whose moment
    is fed back (an algebraic loop), and as `discretise_law` does.
    """
    law = case.feedback
    acting, chain = acting_law(case, law)
    weights = [1.0] * len(law.parts)
    units = acting.part_gains
    for name, (place, value) in units.items():
        weights[place] = value
        law, acting = (each.with_number(name, 1.0) for each in (law, acting))
    in_z = law_in_z(law, acting, chain)
    sensed = sensed_plant(case.arm, chain, in_z.signals, count)
    return Sampled(SampledRig(sensed, chain, in_z), law, tuple(weights))


def with_delay_samples(chain: Chain, samples: float) -> Chain:
    """Return a chain with another delay."""
    return replace(chain, sampling=replace(chain.sampling, delay_samples=samples))


def with_more_modes(loop: Sampled, count: int) -> Sampled:
    """Return the loop with another number of flexible modes; up to two more or less where two damped modes are one."""
    if count == loop.plant.count:
        return loop
    counts = count, count - 1, count + 1, count - 2, count + 2
    return first_distinct(lambda each: loop.with_modes(max(1, int(each))), counts)
