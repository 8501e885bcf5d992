"""The pulse transfer functions of a sampled arm: its plant from sample to sample, under a zero-order hold.

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
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tfarm.arm import Arm
from tfarm.arm.chain import Sampling
from tfarm.arrays import Complex, Real
from tfarm.dsp.plant import FORGOTTEN, USUAL_MODES, Plant, undelayed_plant
from tfarm.records import frozen

if TYPE_CHECKING:
    import control


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
        """Return the values (outputs, *z.shape)."""
        points = np.asarray(z, dtype=complex)
        flat = self.scaled_values(points.ravel(), None, np.ones(points.size))
        return flat.reshape(len(self.plant.outputs), *points.shape)

    def held_response(self, u: Real) -> Real:
        """Return the outputs (outputs, n) at the samples, before each update, from rest under held torques (n,)."""
        plant = self.plant
        from scipy.signal import lfilter

        d = self.sampling.whole_delay
        late = np.r_[np.zeros(d + 1), u][: u.size]
        new = np.r_[np.zeros(d), u][: u.size]
        found = plant.static[:, None] * late
        upper = np.flatnonzero(plant.poles.imag >= 0)
        for i in upper.tolist():
            driven = self.early[i] * new + self.late[i] * late
            amplitude = lfilter([0.0, 1.0], [1.0, -self.multipliers[i]], driven)
            weights = plant.residues[:, i] * (2.0 if plant.poles[i].imag > 0 else 1.0)
            found += weights.real[:, None] * amplitude.real - weights.imag[:, None] * amplitude.imag
        steps = self.sampling.remaining * new + self.sampling.late * late
        single = np.r_[0.0, np.cumsum(steps)[:-1]]
        by_new, by_late = self.ramps
        ramps = self.sampling.period * single + by_new * new + by_late * late
        double = np.r_[0.0, np.cumsum(ramps)[:-1]]
        return np.asarray(found + np.outer(plant.rigid[:, 0], double) + np.outer(plant.rigid[:, 1], single))

    def free_responses(self, pole: int, count: int) -> Real:
        """Return the outputs (2, outputs, count) at the samples from amplitudes 1/2 and -i/2 of a pole's pair."""
        motion = np.exp(self.plant.poles[pole] * self.sampling.period * np.arange(count))
        values = np.outer(self.plant.residues[:, pole], motion)
        return np.array([values.real, values.imag])

    def scaled_values(
        self, z: Complex, base: NDArray[np.int64] | None, offset: NDArray[Any], delta: Complex | None = None
    ) -> Complex:
        """Return offset H(z) at z = multipliers[base] + offset, without loss for any offset: (outputs, n).

        With no `base`, or one of -1, it is offset H(z); `delta` is z - 1, where that has more digits than z.
        """
        if delta is None:
            gap = z[:, None] - self.multipliers
            distance: Any = z - 1.0
        else:
            gap = delta[:, None] - self.shifts
            distance = delta
        if base is None:
            share = offset[:, None] / gap
        else:
            # of a pole that is the base the share is 1
            rows = np.flatnonzero(base >= 0)
            own = (rows, base[rows])
            gap[own] = 1.0
            share = offset[:, None] / gap
            share[own] = 1.0
            distance = np.where(base == self.poles.size - 1, offset, distance)
        return self._sum_terms(np.positive, share, z, offset, distance)

    def sizes(self, base: NDArray[np.int64], offset: Complex, delta: Complex) -> Real:
        """Return the sums (outputs, n) of the sizes of all terms of `scaled_values`, a bound on its rounding in eps.

        The rounding of z itself is in them: it is |z - 1|/|z - pole| in the term of a pole.
        """
        z = abs(1 + delta)
        gap = abs(delta[:, None] - self.shifts)
        own = base[:, None] == np.arange(self.poles.size)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(own, 1.0, abs(offset)[:, None] / gap * (1 + abs(delta)[:, None] / gap))
        distance = abs(np.where(base == self.poles.size - 1, offset, delta))
        return self._sum_terms(np.abs, share, z, abs(offset), distance)

    def _sum_terms(self, size: Callable[[Any], Any], share: Any, z: Any, offset: Any, distance: Any) -> Any:
        """Return the terms of `scaled_values`, or their sizes.

        They are shares (n, poles) of r (early + late/z), static and rigid terms.
        """
        plant = self.plant
        sampling = self.sampling
        early = size(self.early)
        late = size(self.late)
        residues = size(self.residues)
        value = (residues * early) @ share.T + np.outer(size(plant.static), offset / z)
        if sampling.fraction:
            value = value + (residues * late) @ share.T / z
        double = plant.rigid[:, 0]
        if double.any():
            push = early[-1] + late[-1] / z
            now, before = self.ramps
            twice = (sampling.period * push / distance + (now + before / z)) / distance
            value = value + np.outer(size(double), twice * offset)
        return value * z ** (-sampling.whole_delay)

    def without_fast_poles(self) -> PulseTransfer:
        """Return the same with every pole that decays within a sample as a static share."""
        of = self.plant
        gone = of.poles.real * (1 - self.sampling.fraction) * self.sampling.period < -FORGOTTEN
        if not gone.any():
            return self
        kept = ~gone
        static = of.static - (of.residues[:, gone] / of.poles[gone]).real.sum(axis=1)
        plant = replace(
            of, poles=of.poles[kept], residues=of.residues[:, kept], static=static, mode=of.mode[kept]
        )
        return replace(self, plant=plant)

    # ------------------------------------------------------------ state space

    @property
    def integrals_at(self) -> int:
        """The index of the torque's two integrals among the states; the next state is the input of the last sample."""
        upper, real = self.pole_rows()
        return int(2 * upper.size + real.size)

    def matrices(self) -> tuple[Real, Real, Real]:
        """Return A (n, n), B (n,), C (outputs, n) of x_{k+1} = A x_k + B u_k, y_k = C x_k, real.

        States: real and imaginary part of the amplitude of each pole with Im p > 0, the amplitude of each real one, the
        double integral and the integral of the torque, and u_{k-1} to u_{k-d-1}.  For a hub that friction brings to
        rest slowly (`Plant.slow_hub_pole`) the last integral is that of that pole's amplitude.
        """
        return self._matrices

    @cached_property
    def _matrices(self) -> tuple[Real, Real, Real]:
        upper, real = self.pole_rows()
        plant = self.plant
        T = self.sampling.period
        d = self.sampling.whole_delay
        z = self.multipliers[upper]
        first = 2 * np.arange(upper.size)
        n = self.integrals_at + 2
        decays = self.multipliers[real].real
        A = np.diag(np.r_[np.repeat(z.real, 2), decays, 1.0, 1.0, np.zeros(d + 1)])
        A[first, first + 1] = -z.imag
        A[first + 1, first] = z.imag
        A[n - 2, n - 1] = T
        A[n:, n:] = np.eye(d + 1, k=-1)
        pairs = np.ascontiguousarray(2 * self.residues[:, upper].conj()).view(float)
        singles = self.residues[:, real].real
        C = np.c_[pairs, singles, plant.rigid, np.zeros((len(pairs), d)), plant.static]
        now, before = (
            np.r_[push[upper].view(float), push[real].real, ramp, push[-1].real]
            for push, ramp in zip((self.early, self.late), self.ramps, strict=True)
        )
        B = np.eye(len(A))[n]
        A[:n, -1] = before
        newest = A[:, -2] if d else B
        newest[:n] = now
        slow = plant.slow_hub_pole(T)
        if slow is not None:
            place = 2 * upper.size + int(np.flatnonzero(real == slow)[0])
            p = float(plant.poles[slow].real)
            self._integrate(A, newest, p, (place, n - 1))
            # R/s + r/(s - p) = -R p/(s (s - p)) + (r + R)/(s - p)
            C[:, place] += plant.rigid[:, 1]
            C[:, n - 1] = -p * plant.rigid[:, 1]
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

    def pole_rows(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the indices of the poles with Im p > 0 and of the real ones, without s = 0."""
        p = self.plant.poles
        return np.nonzero(p.imag > 0)[0], np.nonzero(p.imag == 0)[0]

    def state_space(self) -> control.StateSpace:
        """Return a discrete `control.StateSpace` with dt = T and named signals, "moment@0_3" of moment@0.3."""
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
    """Return (e^u - 1 - u)/u^2, by its series: |u| is below 0.1."""
    # of 12 terms 0.1^12/14! is left
    return math.fsum(u**k / math.factorial(k + 2) for k in range(12))


def held_amplitude(p: Complex, duration: float) -> Complex:
    """Return (e^{p t} - 1)/p, the amplitude of a unit torque after `duration` t [s]."""
    safe = np.where(p * duration == 0, 1.0, p)
    return np.where(p * duration == 0, duration, np.expm1(p * duration) / safe)
