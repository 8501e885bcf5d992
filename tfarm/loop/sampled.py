"""The sampled loop of any linear law: its matrix, its characteristic function, its poles.

    u_k = r_k - (C x_k + D y_k),  x_{k+1} = A x_k + B y_k                        the law in z, p_i/q its entries
    F(z) = q(z) + sum over parts of weight sum over signals of p_i(z) H_i(z)     0 at the closed-loop poles

Gains at the hub are a law of three parts without states, u = -Kp theta - K1 theta_t - K2 M + r, M the root moment
E I phi'(0) as a strain gauge reads it.  F is affine in the weights of the parts, and `SampledRig.terms` has its terms.

Matrix eigenvalues have an error of about 1e-14, and a mode may grow by 1e-10 a sample; n poles next to each other, as a
law of high order has them next to z = 1, have the nth root of that error.  So all are polished together, each as an
offset o from the nearest open-loop pole, of the plant (e^{pT}) or of the law, by the Ehrlich-Aberth method on the monic
polynomial P(z) = F(z) prod(z - poles of F), in Boersch-Supan's form without derivatives,

    step = W/(1 + sum over the other roots of their W/(z - root)),   W = P(z)/prod over the other roots of (z - root)

where o F(e^{pT} + o) is computed without loss; then ln|z| = Re(pT) + ln|1 + o e^{-pT}|.  q and p_i are polynomials,
kept as factors (`discretise`), so that F has no other poles than the plant.  (Aberth, Mathematics of Computation 27,
1973; Boersch-Supan, Numerische Mathematik 5, 1963.)

Within n |W| of each value, n the number of poles, there is a root (Smith, Journal of the ACM 17, 1970).  With the
rounding error of F in W that bounds the error of the root: where |ln|z|| is less it is not known from 0, and is 0.
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
from tfarm.arrays import LEAST_SIZE, MACHINE_EPS, Complex, Real, Whole
from tfarm.case import Case
from tfarm.dsp.discretise import (
    LawInZ,
    acting_law,
    law_in_z,
    root_product,
    root_product_error,
)
from tfarm.dsp.plant import MODES_USED, USUAL_MODES, Plant, first_distinct
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.sensed import sensed_plant
from tfarm.errors import ParameterError, did_you_mean
from tfarm.loop.loop import Loop
from tfarm.loop.sampled_rig import SampledRig
from tfarm.records import frozen
from tfarm.response.signals import ControllerSignals
from tfarm.schema import Quantity

# a pole nearer to z = 0 is stable and not polished
FADED_RADIUS = 0.2


@frozen
class SampledPoles:
    """Closed-loop poles `z` and `log_radius` ln|z| of each, without z = 1 of a free hub angle.

    `error` bounds the error of each z; where ln|z| may be no more than that, it is 0.
    `mode` is the flexible mode of the open-loop pole that is nearest (0: none).
    """

    z: Complex
    log_radius: Real
    mode: Whole
    error: Real

    @property
    def log_spectral_radius(self) -> float:
        """The largest ln|z|."""
        return float(self.log_radius.max())

    @property
    def unstable(self) -> int:
        """Number of poles outside the unit circle."""
        return int((self.log_radius > 0).sum())

    @property
    def is_determined(self) -> bool:
        """Whether none but poles that are exactly 1 may lie on the circle by rounding alone."""
        return bool((self.z[self.log_radius == 0] == 1).all())

    @property
    def is_stable(self) -> bool:
        """Whether all lie inside the unit circle."""
        return self.log_spectral_radius < 0.0


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
        return self.unit_law.weighted(self.weights)

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
        """The part whose weight is a number, by its name in `Law.having`; None of any other number."""
        known = self.unit_law.part_gains
        name = OUTPUT_OF.get(name, name).removesuffix(".gain")
        return next((known[key][0] for key in (name, f"{name}.gain") if key in known), None)

    def number(self, name: str) -> float:
        """A number of the law."""
        return self.weights[self.part(name)]

    def part(self, name: str) -> int:
        """The part whose weight is a number.  Raises ParameterError for any other number."""
        if (place := self.place(name)) is None:
            raise ParameterError(
                key="law", value=name, remedy=did_you_mean(name, list(self.unit_law.part_gains))
            )
        return place

    def weighted(self, weights: Sequence[float]) -> Sampled:
        """Return the same loop with other weights."""
        return replace(self, weights=tuple(weights))

    def having(self, name: str, value: float) -> Sampled:
        """Return the same loop with another value of one number of its law; cheap where that is a gain or factor."""
        if (place := self.place(name)) is None:
            return super().having(name, value)
        return self.weighted([*self.weights[:place], value, *self.weights[place + 1 :]])

    def times(self, factor: float) -> Sampled:
        """The same loop with a factor on the whole law."""
        return self.weighted([factor * each for each in self.weights])

    def with_delay(self, samples: float) -> Sampled:
        """The same loop with another total delay."""
        chain = replace(self.chain, sampling=replace(self.chain.sampling, delay_samples=samples))
        return replace(self, rig=replace(self.rig, chain=chain))

    def with_modes(self, count: int) -> Sampled:
        """The same loop with another number of flexible modes; cheap where its models have as many."""
        return replace(self, rig=replace(self.rig, sensed=self.rig.sensed.with_modes(count)))

    def under(self, law: Law) -> Sampled:
        """The loop of another law on the same arm, with the same number of modes."""
        sampling = self.chain.sampling
        own = max(0.0, sampling.delay_samples - self.law.delay / sampling.period)
        chain = replace(self.chain, sampling=replace(sampling, delay_samples=own))
        return sampled_loop(Case(self.arm, law, chain), count=self.plant.count)

    def on(self, arm: Arm, count: int) -> Sampled:
        """The loop of the same law on another arm, with `count` flexible modes."""
        return replace(
            self, rig=replace(self.rig, sensed=sensed_plant(arm, self.chain, self.in_z.signals, count))
        )

    @property
    def push(self) -> Real:
        """Bound on the shift of each pole of the plant by the law, at its aliased frequency [1/s]."""
        delta = np.exp(1j * self.plant.poles.imag * self.chain.sampling.period) - 1
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

    def rounding(self, base: Whole, offset: Complex) -> Real:
        """Bound on the rounding error (n,) of row @ terms at the same points: of the sizes of all terms."""
        start = self.rig.open_loop[base]
        is_of_law = base >= self.pulse.poles.size
        scale = np.where(is_of_law, 1.0, offset)
        sizes = self.pulse.sizes(np.where(is_of_law, -1, base), scale, start + offset)
        error = abs(scale) * root_product_error(start, self.in_z.poles, offset)
        for part, row, gain, zeros in self.in_z.terms:
            error += abs(self.weights[part] * gain) * root_product_error(start, zeros, offset) * sizes[row]
        return error

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
        """F(z) at an array of z."""
        z = np.asarray(z, dtype=complex)
        return (self.row @ self.rig.terms(z.ravel(), None, np.ones(z.size))).reshape(z.shape)

    # ------------------------------------------------------------ poles

    def matrix(self) -> Real:
        """The closed-loop matrix: states of `PulseTransfer.matrices`, then those of the law."""
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
        """The closed-loop matrix without the pole z = 1 of a free hub angle, or of a hub that cannot drift."""
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
        """The closed-loop poles, each polished as an offset from its nearest open-loop pole; `poles_at_one` are 1.

        Those next to z = 0 are stable, and not polished.
        """
        # for |z|^2 - 1 of a pole at z = 0, the base of no root
        least_square = -1.0 + 1e-15
        z = self.eigenvalues.copy()
        shifts = self.rig.open_loop
        pulse = self.pulse
        z[np.argsort(abs(z - 1), kind="stable")[: self.poles_at_one]] = 1.0
        # the smallest double, for the logarithm of 0
        log_radius = np.log(np.maximum(abs(z), 5e-324))
        rows = np.flatnonzero((abs(z) > FADED_RADIUS) & (z != 1))
        base = _nearest(self, z - 1)
        offset: Complex = (z - 1) - shifts[base]
        for _ in range(2):
            offset, error = _settled(base, offset, rows, self)
            nearest = _nearest(self, shifts[base] + offset)
            if (nearest[rows] == base[rows]).all():
                break
            # all digits are kept from there
            offset = offset + (shifts[base] - shifts[nearest])
            base = nearest
        own = 2 * self.in_z.poles.real + abs(self.in_z.poles) ** 2
        start = np.r_[pulse.poles.real * pulse.sampling.period, np.log1p(np.maximum(own, least_square)) / 2]
        at = base[rows]
        o = offset[rows]
        ratio = o / (1 + shifts[at])
        log_radius[rows] = start[at] + np.log1p(2 * ratio.real + abs(ratio) ** 2) / 2
        z[rows] = (1 + shifts[at]) + o
        log_radius[abs(log_radius) * abs(z) < error] = 0.0
        mode = pulse.mode[abs(z[:, None] - pulse.multipliers).argmin(axis=1)]
        return SampledPoles(z, log_radius, mode, error)


class OfLoop:
    """What a record of a sampled loop has of that loop."""

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


def _nearest(loop: Sampled, delta: Complex) -> Whole:
    """The number of the open-loop pole nearest to each z = 1 + delta, of those that are not near z = 0.

    The integrals of a hub that cannot drift are not among them, as F has no digits next to them.
    """
    away = abs(delta[:, None] - loop.rig.open_loop)
    away[:, abs(1 + loop.rig.open_loop) <= FADED_RADIUS] = np.inf
    if not loop.plant.rigid.any():
        away[:, loop.pulse.poles.size - 1] = np.inf
    return away.argmin(axis=1)


def _settled(base: Whole, offset: Complex, rows: Whole, loop: Sampled) -> tuple[Complex, Real]:
    """The offsets with some iterated until they converge or F is 0 but for rounding, and bounds on the errors of all.

    These are the radii of Smith's discs, and the rounding of a pole of the law; 0 of the others.
    """
    # of all roots together: a cluster of nine takes 24
    most_steps = 200
    # an offset this small is a pole that the loop does not move
    unmoved = 1e-50
    error = np.zeros(offset.size)
    offset = offset.copy()
    # for an offset of 0: next to 1 that is none
    offset[rows] = np.where(offset[rows] == 0, 1e-17, offset[rows])
    # a root on an open-loop pole, and one that diverges
    with np.errstate(all="ignore"):
        for _ in range(most_steps):
            o = offset[rows]
            f, slope, apart = _weierstrass(base, offset, rows, loop)
            W = np.nan_to_num(f / slope, posinf=0.0, neginf=0.0)
            others = W / apart[:, rows]
            np.fill_diagonal(others, 0.0)
            step = np.nan_to_num(W / (1 + others.sum(axis=1)), posinf=0.0, neginf=0.0)
            # of the offset: a smaller step is below its rounding
            moving = abs(step) > 1e-12 * abs(o)
            offset[rows] = np.where(abs(o - step) < unmoved, unmoved, o - step)
            if (abs(f[moving]) <= loop.rounding(base[rows[moving]], o[moving])).all():
                break
        offset[abs(offset) <= unmoved] = 0.0
        f, slope, _ = _weierstrass(base, offset, rows, loop)
        radius = offset.size * (abs(f) + loop.rounding(base[rows], offset[rows])) / abs(slope)
    own = np.where(base[rows] < loop.pulse.poles.size, 0.0, MACHINE_EPS * abs(loop.rig.open_loop[base[rows]]))
    # of a pole that the loop does not move 0/0
    error[rows] = np.nan_to_num(radius, posinf=0.0) + own
    return offset, error


def _weierstrass(
    base: Whole, offset: Complex, rows: Whole, loop: Sampled
) -> tuple[Complex, Complex, Complex]:
    """At some roots o F and o F/W, and their distances from all roots, 1 from themselves."""
    pulse = loop.pulse
    b = base[rows]
    o = offset[rows]
    one = loop.rig.open_loop[b]
    # the other poles are at z = 1
    known = np.r_[pulse.shifts[:-1], np.full(pulse.sampling.whole_delay + 1, -1.0)]
    poles = np.r_[known, np.zeros(max(0, offset.size - known.size - loop.in_z.poles.size))]
    apart = (one[:, None] - loop.rig.open_loop[base]) + (o[:, None] - offset)
    apart[np.arange(rows.size), rows] = 1.0
    away = (one[:, None] - poles) + o[:, None]
    of_plant = b < pulse.poles.size
    own = np.where(b == pulse.poles.size - 1, known.size, b)
    # but where a free hub angle has the pole at z = 1
    listed = of_plant & (own < poles.size)
    # F is times the distance from that pole
    away[listed, own[listed]] = 1.0
    of_poles = (apart[:, : poles.size] / away).prod(axis=1)
    others = apart[:, poles.size :].prod(axis=1)
    slope = np.where(of_plant & ~listed, o, 1.0) * of_poles * others
    return loop.row @ loop.rig.terms(1 + (one + o), b, o), slope, apart


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
        law, acting = (each.having(name, 1.0) for each in (law, acting))
    in_z = law_in_z(law, acting, chain)
    return Sampled(
        SampledRig(sensed_plant(case.arm, chain, in_z.signals, count), chain, in_z), law, tuple(weights)
    )


def with_more_modes(loop: Sampled, count: int) -> Sampled:
    """The loop with another number of flexible modes, or up to two more or less where two damped modes are one."""
    if count == loop.plant.count:
        return loop
    counts = count, count - 1, count + 1, count - 2, count + 2
    return first_distinct(lambda each: loop.with_modes(max(1, int(each))), counts)
