"""The plant of a sampled loop: poles and residues of the modal model with an analog filter, and its discretisation.

    G_o(s) = rigid[o,0]/s^2 + rigid[o,1]/s + static[o] + sum over poles of residues[o,i]/(s - poles[i])

A first-order filter wc/(s + wc) on an output adds one pole and changes residues; the form is the same.  Analog damping
of the hub is friction of the arm.

The zero-order hold is exact, with any sampling period and any computational delay.  The torque u_k, computed from the
sample at t_k, acts from t_k + tau to t_{k+1} + tau, tau = (d + f) T.  A pole p with the amplitude a' = p a + u then
steps by

    a_{k+1} = e^{pT} a_k + early u_{k-d} + late u_{k-d-1},
    early = (e^{p(1-f)T} - 1)/p,   late = e^{p(1-f)T} (e^{pfT} - 1)/p

and what is measured just before the update, y_k = Re(sum r a_k) + static u_{k-d-1}, sees the torque of the *preceding*
interval: nothing of u_k comes through at once.  At C = 0 e^{pT} has modulus one to the last bit, and is never a
quotient.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, lru_cache, reduce
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tfarm.arm import Arm, must_have_free_hub
from tfarm.arm.chain import Chain, Sampling
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, require
from tfarm.exact.outputs import Output
from tfarm.records import frozen
from tfarm.reduced import ModalModel, modal_model
from tfarm.reduced.modal import SLOW_POLES_FROM, slow_remainder
from tfarm.response import transfer
from tfarm.response.signals import Signals
from tfarm.schema import Quantity
from tfarm.spectrum.frequencies import LISTS_KEPT

if TYPE_CHECKING:
    import control

# of a simulation, not filtered
RECORDED = ("hub_angle", "hub_rate", "root_moment", "tip_displacement")
MODES_USED = Quantity(
    "flexible modes", help="number of flexible modes of the arm in the model of the sampled loop"
)
# flexible, of a sampled loop or a simulation by default
USUAL_MODES = 20
# |p| T below which a pole is slow: its two parts are then more than ten times their sum
SLOW = 0.1
# C w from which on a mode surely is: following it further costs a hundred times as much
OVERDAMPED = 2.5
# e^-40 = 4e-18: such a pole has settled before the next sample
FORGOTTEN = 40.0


@frozen
class Plant:
    """Poles (m,) [1/s] other than s = 0, conjugates listed too; residues (outputs, m), rigid (outputs, 2), static
    (outputs,).

    `mode` (m,) is the flexible mode of a pole; 0 for those of a filter, the hub, or no certain mode.
    `model` is its modal model, which may have more modes.
    """

    arm: Arm
    outputs: tuple[str, ...]
    poles: Complex
    residues: Complex
    rigid: Real
    static: Real
    mode: NDArray[np.int64]
    model: ModalModel

    def __call__(self, s: complex) -> Complex:
        """G_o(s) of every output at one s."""
        return self.rigid @ np.array([1 / s**2, 1 / s]) + self.static + self.residues @ (1 / (s - self.poles))

    def rows(self, at: Sequence[int], names: tuple[str, ...]) -> Plant:
        """The plant with these of its outputs, in this order, under these names."""
        return replace(
            self, outputs=names, residues=self.residues[at], rigid=self.rigid[at], static=self.static[at]
        )

    def joined(self, more: Plant) -> Plant:
        """The plant with the outputs of another of the same arm after its own; the other may lack the filter's pole."""
        # those of the arm, for any output
        assert np.array_equal(more.poles, self.poles[: more.poles.size])
        lacking = self.poles.size - more.poles.size
        return replace(
            self,
            outputs=(*self.outputs, *more.outputs),
            residues=np.r_[self.residues, np.pad(more.residues, ((0, 0), (0, lacking)))],
            rigid=np.r_[self.rigid, more.rigid],
            static=np.r_[self.static, more.static],
        )

    def with_poles(self, poles: Any, residues: Any) -> Plant:
        """The plant with further poles, which are of no mode."""
        return replace(
            self,
            poles=np.r_[self.poles, poles],
            residues=np.c_[self.residues, residues],
            mode=np.r_[self.mode, np.zeros(np.size(poles), np.int64)],
        )

    @property
    def at_rest(self) -> Real:
        """G_o(0) of every output that does not turn with the arm (outputs,), and H_o(1) at any period."""
        return self.static - (self.residues / self.poles).sum(axis=1).real

    def slow_hub_pole(self, slower_than: float) -> int | None:
        """The pole of a hub that friction brings to rest, if |p| is below `slower_than` [1/s]; else None.

        Its residues nearly cancel rigid[:, 1], the more the less friction there is.
        """
        (slow,) = np.nonzero((self.poles.imag == 0) & (abs(self.poles) < slower_than))
        turns = self.rigid[:, 1].any() and not self.rigid[:, 0].any()
        if turns and slow.size:
            return int(slow[abs(self.poles[slow]).argmin()])
        return None

    @property
    def count(self) -> int:
        """The last flexible mode in it."""
        return int(self.mode.max(initial=0))


def arm_under_chain(arm: Arm, chain: Chain) -> tuple[Arm, Chain]:
    """The arm that a chain drives, with the actuator's analog damping as friction of its hub, and the chain without it.

    So it is in every loop of that arm once: in the sampled and in the continuous-time one.
    """
    damping = chain.actuator.hub_damping
    remedy = "a hub without inertia has no model of finite order under it; give hub.inertia, or leave it out"
    require(not (damping > 0 and arm.has_massless_hub), "actuator.hub_damping", damping, remedy)
    if damping == 0:
        return arm, chain
    hub = replace(arm.hub, friction=arm.hub.friction + damping)
    return replace(arm, hub=hub), replace(chain, actuator=replace(chain.actuator, hub_damping=0.0))


# the simulations of one page need the same model some twenty times
_modelled_once = lru_cache(maxsize=LISTS_KEPT)(modal_model)


def undelayed_plant(arm: Arm, outputs: Sequence[str], count: int, x: float | None = None) -> Plant:
    """The arm with `count` flexible modes, its outputs not filtered; `x` [m] is the place of outputs along the arm."""
    must_have_free_hub(arm)
    return with_modes(_modelled_once(arm, tuple(outputs), count, x, reach=OVERDAMPED), count)


def with_modes(model: ModalModel, count: int) -> Plant:
    """The plant with the first `count` modes of a model, and slow real poles for all others where C is large."""
    some = model.first(count)
    C = model.arm.damping
    poles = some.eigenvalues.ravel()
    residues = some.residues.reshape(len(some.outputs), poles.size)
    mode = np.repeat(some.index, 2)
    plant = Plant(some.arm, some.outputs, poles, residues, some.rigid, some.static, mode, model)
    plant = plant.with_poles(some.single, some.single_residues)
    if C * some.natural_frequency.max(initial=0.0) < SLOW_POLES_FROM:
        return plant
    exact = transfer(model.arm, model.outputs, x=model.x)
    corners, shares = slow_remainder(C, lambda s: exact(s) - np.array([plant(each) for each in s]).T)
    return replace(plant, static=plant.static - shares.sum(axis=1)).with_poles(-corners, shares * corners)


def is_analog(wanted: Output, chain: Chain) -> bool:
    """Whether an output passes the analog anti-alias filter of a chain.

    Strain, moment and shear, current, accelerations and rates do, as they leave analog amplifiers.  Angles and
    displacements do not, nor does the hub's rate where it is the difference of an encoder.
    """
    is_encoder = wanted.quantity == "theta" and chain.converters.hub_rate == "difference"
    # quantities of strain gauges, load cells and shunts
    is_amplified = wanted.quantity in ("M", "Q", "strain", "current")
    return is_amplified or (wanted.power > 0 and not is_encoder)


def with_filter(plant: Plant, rows: Sequence[int], corner: float) -> Plant:
    """The plant with wc/(s + wc) after some outputs: a pole at -wc, with the residue wc G(-wc).

    None of these has the double integral of the torque, as angles and displacements do (`is_analog`).
    """
    is_filtered = np.isin(np.arange(len(plant.outputs)), rows)
    lag = np.where(is_filtered[:, None], corner / (plant.poles + corner), 1.0)
    late = replace(plant, residues=plant.residues * lag, static=np.where(is_filtered, 0.0, plant.static))
    return late.with_poles(-corner, np.where(is_filtered, corner * plant(-corner).real, 0.0))


def with_held_filter(plant: Plant, held: Real) -> Plant:
    """The plant whose filters, its last pole, start from other values than 0: with the same pole once more.

    An amplitude 1 of it is the excess `held` (outputs,) over the filtered outputs.  The torque drives both poles, and
    the shares of the second cancel.
    """
    residues = plant.residues.copy()
    residues[:, -1] -= held
    return replace(plant, residues=residues).with_poles(plant.poles[-1], held)


@frozen
class SensedPlant:
    """An arm's signals with `count` modes: a plant for each place of signals, and one of all together.

    `read` is of the arm with the actuator's damping; `plants` are not filtered, one for each of `places` [share of the
    length].  Raises ParameterError as `Signals` does, for a locked hub, and for an output that grows with s without
    bound.
    """

    arm: Arm
    read: Signals
    chain: Chain
    plants: tuple[Plant, ...]

    @cached_property
    def together(self) -> Plant:
        """All signals in the order of their names, through their analog filters."""
        whole = self.unfiltered
        corner = self.chain.sampling.antialias_corner
        analog = [n for n, each in enumerate(self.read.outputs) if is_analog(each, self.chain)]
        if math.isinf(corner) or not analog:
            return whole
        return with_filter(whole, analog, corner)

    @property
    def unfiltered(self) -> Plant:
        """All signals in the order of their names, without filters."""
        places = dict.fromkeys(self.read.places)
        whole = reduce(Plant.joined, self.plants)
        keys = [
            (place, name) for place, plant in zip(places, self.plants, strict=True) for name in plant.outputs
        ]
        at = [
            keys.index((place, each.name))
            for each, place in zip(self.read.outputs, self.read.places, strict=True)
        ]
        return replace(whole.rows(at, self.read.names), arm=self.arm)

    def own_moment(self, sampling: Sampling) -> Real:
        """The row of C that reads the arm's own root moment, one of the signals, ahead of the anti-alias filter."""
        alone = self.unfiltered.rows([self.read.names.index("root_moment")], ("root_moment",))
        pulse = PulseTransfer(self.together.joined(alone), sampling).folded()
        return pulse.matrices()[2][-1]

    def with_modes(self, count: int) -> SensedPlant:
        """The same with another number of modes; cheap where the models have as many."""
        if count > self.plants[0].model.index.max(initial=0):
            return sensed_plant(self.arm, self.chain, self.read.names, count)
        return replace(self, plants=tuple(with_modes(each.model, count) for each in self.plants))


def sensed_plant(arm: Arm, chain: Chain, names: Sequence[str], count: int) -> SensedPlant:
    """Return the signals of these names with `count` flexible modes, of an arm whose hub a chain may damp."""
    read = Signals(arm_under_chain(arm, chain)[0], tuple(names))
    plants = []
    for share in dict.fromkeys(read.places):
        here = zip(read.outputs, read.places, strict=True)
        wanted = list(dict.fromkeys(each.name for each, place in here if place == share))
        along = any(each.place == "x" for each in read.outputs if each.name in wanted)
        plants.append(undelayed_plant(read.arm, wanted, count, share * arm.length if along else None))
    return SensedPlant(arm, read, chain, tuple(plants))


# ------------------------------------------------------------ at the samples


@frozen
class PulseTransfer:
    """H_o(z), the pulse transfer functions from the torque computed at a sample to the next samples.

    Poles at e^{pT}, those of s = 0 at z = 1, and a delay z^-d.  Callable at complex z.
    """

    plant: Plant
    sampling: Sampling

    @cached_property
    def poles(self) -> Complex:
        """p [1/s] of each pole, and 0, that of the turning hub, as the last one."""
        return np.r_[self.plant.poles, 0.0]

    @cached_property
    def mode(self) -> NDArray[np.int64]:
        """The flexible mode of each pole, 0 for none."""
        return np.r_[self.plant.mode, 0]

    @cached_property
    def residues(self) -> Complex:
        """(outputs, poles) of the plant, those of 1/s in the last column."""
        return np.c_[self.plant.residues, self.plant.rigid[:, 1]]

    @cached_property
    def multipliers(self) -> Complex:
        """e^{pT}."""
        x = self.poles * self.sampling.period
        return np.exp(x.real) * (np.cos(x.imag) + 1j * np.sin(x.imag))

    @cached_property
    def shifts(self) -> Complex:
        """e^{pT} - 1, to all digits next to z = 1."""
        return np.expm1(self.poles * self.sampling.period)

    @cached_property
    def early(self) -> Complex:
        """Share of u_{k-d} in an amplitude within a sample."""
        return held_amplitude(self.poles, self.sampling.remaining)

    @cached_property
    def late(self) -> Complex:
        """Share of u_{k-d-1}, from before the switch."""
        sampling = self.sampling
        return np.exp(self.poles * sampling.remaining) * held_amplitude(self.poles, sampling.late)

    @property
    def slopes_at_one(self) -> Real:
        """dH/dz (outputs,) at z = 1, of the poles other than s = 0 and without the delay."""
        gap = 1 - self.multipliers[:-1]
        late = self.late[:-1]
        terms = late / gap + (self.early[:-1] + late) / gap**2
        return -(self.plant.residues @ terms).real - self.plant.static

    @property
    def ramps(self) -> tuple[float, float]:
        """Shares of u_{k-d} and u_{k-d-1} in the double integral of the torque within a sample."""
        T = self.sampling.period
        f = self.sampling.fraction
        return (1 - f) ** 2 * T * T / 2, f * (1 - f / 2) * T * T

    def __call__(self, z: ArrayLike) -> Complex:
        """Values (outputs, *z.shape)."""
        points = np.asarray(z, dtype=complex)
        flat = self.scaled(points.ravel(), None, np.ones(points.size))
        return flat.reshape(len(self.plant.outputs), *points.shape)

    def scaled(
        self, z: Complex, base: NDArray[np.int64] | None, offset: NDArray[Any], delta: Complex | None = None
    ) -> Complex:
        """offset H(z) at z = multipliers[base] + offset, without loss for any offset: (outputs, n).

        With no `base`, or one of -1, it is offset H(z); `delta` is z - 1, where that has more digits than z.
        """
        gap = z[:, None] - self.multipliers if delta is None else delta[:, None] - self.shifts
        rows = np.empty(0, np.int64) if base is None else np.flatnonzero(base >= 0)
        near = (rows, rows if base is None else base[rows])
        gap[near] = 1.0
        share = offset[:, None] / gap
        distance = z - 1.0 if delta is None else delta
        share[near] = 1.0
        distance = distance if base is None else np.where(base == self.poles.size - 1, offset, distance)
        return self._summed(np.positive, share, z, offset, distance)

    def sizes(self, base: NDArray[np.int64], offset: Complex, delta: Complex) -> Real:
        """Sums (outputs, n) of the sizes of all terms of `scaled`, a bound on its rounding error in units of eps.

        The rounding of z itself is in them: it is |z - 1|/|z - pole| in the term of a pole.
        """
        z = abs(1 + delta)
        gap = abs(delta[:, None] - self.shifts)
        own = base[:, None] == np.arange(self.poles.size)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(own, 1.0, abs(offset)[:, None] / gap * (1 + abs(delta)[:, None] / gap))
        distance = abs(np.where(base == self.poles.size - 1, offset, delta))
        return self._summed(np.abs, share, z, abs(offset), distance)

    def _summed(self, size: Callable[[Any], Any], share: Any, z: Any, offset: Any, distance: Any) -> Any:
        """The terms of `scaled`, or their sizes: shares (n, poles) of r (early + late/z), static and rigid terms."""
        residues, early, late = (size(each) for each in (self.residues, self.early, self.late))
        value = (residues * early) @ share.T + np.outer(size(self.plant.static), offset / z)
        if self.sampling.fraction:
            value = value + (residues * late) @ share.T / z
        if self.plant.rigid[:, 0].any():
            push = early[-1] + late[-1] / z
            ramp = self.ramps[0] + self.ramps[1] / z
            twice = (self.sampling.period * push / distance + ramp) / distance
            value = value + np.outer(size(self.plant.rigid[:, 0]), twice * offset)
        return value * z ** (-self.sampling.whole_delay)

    def folded(self) -> PulseTransfer:
        """The same with every pole that decays within a sample as a static share."""
        gone = self.plant.poles.real * (1 - self.sampling.fraction) * self.sampling.period < -FORGOTTEN
        if not gone.any():
            return self
        static = self.plant.static - (self.plant.residues[:, gone] / self.plant.poles[gone]).real.sum(axis=1)
        plant = replace(
            self.plant,
            poles=self.plant.poles[~gone],
            residues=self.plant.residues[:, ~gone],
            static=static,
            mode=self.plant.mode[~gone],
        )
        return replace(self, plant=plant)

    # ------------------------------------------------------------ state space

    @property
    def integrals_at(self) -> int:
        """The index of the torque's two integrals among the states; the next state is the input of the last sample."""
        upper, real = self.kept()
        return int(2 * upper.size + real.size)

    def matrices(self) -> tuple[Real, Real, Real]:
        """A (n, n), B (n,), C (outputs, n) of x_{k+1} = A x_k + B u_k, y_k = C x_k, real.

        States: real and imaginary part of the amplitude of each pole with Im p > 0, the amplitude of each real one, the
        double integral and the integral of the torque, and u_{k-1} to u_{k-d-1}.  For a hub that friction brings to
        rest slowly (`Plant.slow_hub_pole`) the last integral is that of that pole's amplitude.
        """
        return self._matrices

    @cached_property
    def _matrices(self) -> tuple[Real, Real, Real]:
        upper, real = self.kept()
        T = self.sampling.period
        d = self.sampling.whole_delay
        z = self.multipliers
        first = 2 * np.arange(upper.size)
        n = self.integrals_at + 2
        A = np.diag(np.r_[np.repeat(z[upper].real, 2), z[real].real, 1.0, 1.0, np.zeros(d + 1)])
        A[first, first + 1] = -z[upper].imag
        A[first + 1, first] = z[upper].imag
        A[n - 2, n - 1] = T
        A[n:, n:] = np.eye(d + 1, k=-1)
        pairs = np.ascontiguousarray(2 * self.residues[:, upper].conj()).view(float)
        C = np.c_[
            pairs, self.residues[:, real].real, self.plant.rigid, np.zeros((len(pairs), d)), self.plant.static
        ]
        now, before = (
            np.r_[push[upper].view(float), push[real].real, ramp, push[-1].real]
            for push, ramp in zip((self.early, self.late), self.ramps, strict=True)
        )
        B = np.eye(len(A))[n]
        A[:n, -1] = before
        newest = A[:, -2] if d else B
        newest[:n] = now
        if (slow := self.plant.slow_hub_pole(SLOW / self.sampling.period)) is not None:
            place = 2 * upper.size + int(np.flatnonzero(real == slow)[0])
            p = float(self.plant.poles[slow].real)
            self._integrate(A, newest, p, (place, n - 1))
            # R/s + r/(s - p) = -R p/(s (s - p)) + (r + R)/(s - p)
            C[:, place] += self.plant.rigid[:, 1]
            C[:, n - 1] = -p * self.plant.rigid[:, 1]
        return A, B, C

    def _integrate(self, A: Real, newest: Real, p: float, at: tuple[int, int]) -> None:
        """Put the integral of the amplitude of a slow real pole p into a row; `at`: that pole, and the row."""
        T = self.sampling.period
        late = self.sampling.late
        place, row = at
        now = T - late
        A[row, :-1] = 0.0
        A[row, row] = 1.0
        A[row, place] = T * np.expm1(p * T) / (p * T)
        A[row, -1] = late**2 * phi(p * late) + np.expm1(p * late) / p * np.expm1(p * now) / p
        newest[row] = now**2 * phi(p * now)

    def kept(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Indices of the poles with Im p > 0 and of the real ones, without s = 0."""
        p = self.plant.poles
        return np.nonzero(p.imag > 0)[0], np.nonzero(p.imag == 0)[0]

    def state_space(self) -> control.StateSpace:
        """The same as a discrete `control.StateSpace` with dt = T and named signals, "moment@0_3" of moment@0.3."""
        import control

        A, B, C = self.matrices()
        return control.StateSpace(
            A,
            B[:, None],
            C,
            np.zeros((len(C), 1)),
            self.sampling.period,
            inputs=["hub_torque"],
            # a dot separates a system and its signal
            outputs=[name.replace(".", "_") for name in self.plant.outputs],
            name=f"{self.plant.arm.name} sampled",
        )


def pulse_transfer(
    arm: Arm,
    outputs: tuple[str, ...] | list[str],
    sampling: Sampling | None = None,
    *,
    count: int = USUAL_MODES,
) -> PulseTransfer:
    """Return the sampled arm with `count` flexible modes: exact for its modal model, callable at z, `.state_space()`.

    Raises ParameterError for an unknown output, a locked hub or a count out of range.
    """
    return PulseTransfer(undelayed_plant(arm, outputs, count), sampling or Sampling())


def phi(u: float) -> float:
    """(e^u - 1 - u)/u^2, by its series: |u| is below `SLOW`."""
    # of 12 terms 0.1^12/14! is left
    return math.fsum(u**k / math.factorial(k + 2) for k in range(12))


def held_amplitude(p: Complex, duration: float) -> Complex:
    """(e^{p t} - 1)/p: the amplitude of a unit torque after `duration` t [s]."""
    safe = np.where(p * duration == 0, 1.0, p)
    return np.where(p * duration == 0, duration, np.expm1(p * duration) / safe)


Made = TypeVar("Made")


def first_distinct(make: Callable[[Any], Made], candidates: Sequence[Any]) -> Made:
    """What is made of the first of some candidates at which no two damped modes are one; the error of the last one."""
    *others, last = candidates
    for each in others:
        with suppress(ConvergenceError):
            return make(each)
    return make(last)
