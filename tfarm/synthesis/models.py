"""Loops of few modes under many laws at once: closed-loop matrices, poles and loop functions.

A law is a list of entries (`structures`), each in controllable form in p = s/c, c = 2/T.  Sampled by Tustin's rule,
p = (z - 1)/(z + 1), it becomes

    (1 - A)^-1 (1 + A),  2 (1 - A)^-1 B,  C (1 - A)^-1,  D + C (1 - A)^-1 B.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices
from tfarm.arm.weights import Weights
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.dsp import Chain
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.shaping import modes_alone
from tfarm.loop.continuous import frequency_above_mode, grid
from tfarm.records import frozen
from tfarm.reduced.modal import ALGEBRAIC, sensed_model
from tfarm.response.signals import Signals
from tfarm.synthesis.structures import Entry


@frozen
class DesignModel:
    """A, B, C, D from the input to `signals`, of few modes; at samples of `period` [s], or in continuous time (None).

    `speed` [1/s] is c, the unit of a law's s.  `grid` gives angles (m,) of the circle [rad] or frequencies [rad/s], and
    `response` the signals (signals, k) at k of them.  The damping of poles counts below `band` [rad/s], without one
    each near the poles of open-loop modes `higher`, the highest first.  `last` is the state with the input of the last
    sample; `own_moment` (n,) is the row of the arm's own root moment, before the anti-alias filter.  `alone` are the
    poles of the modes of the sampled arm without a law, by their numbers.  A `rate` is the filtered difference of the
    angle, which it is a factor of; `weights` are those of a norm.
    """

    plant: Matrices
    signals: tuple[str, ...]
    speed: float
    period: float | None
    grid: Callable[[], Real]
    response: Callable[[Real], Complex]
    band: float
    higher: tuple[complex, ...]
    last: int
    own_moment: Real
    alone: dict[int, complex]
    rate: Callable[[Complex], Complex] | None = None
    weights: Weights | None = None

    def states(self, entries: Sequence[Entry]) -> Matrices:
        """Return A (laws, k, k), B (laws, k, signals), C (laws, 1, k), D (laws, 1, signals) of laws."""
        number = max(each.num.shape[1] for each in entries)
        order = sum(len(each.den) - 1 for each in entries)
        signals = len(self.signals)
        A = np.zeros((number, order, order))
        B = np.zeros((number, order, signals))
        C = np.zeros((number, 1, order))
        D = np.zeros((number, 1, signals))
        first = 0
        for signal, num, den in entries:
            n = len(den) - 1
            column = self.signals.index(signal)
            scale = self.speed ** np.arange(n, -1.0, -1.0)[:, None]
            lead = den[0] * scale[0]
            num = np.pad(num, ((n + 1 - len(num), 0), (0, 0))) * scale / lead
            den = den * scale / lead
            D[:, 0, column] += num[0]
            if n:
                own = slice(first, first + n)
                A[:, own, own] = np.eye(n, k=-1)
                A[:, first, own] = -den[1:].T
                B[:, first, column] = 1.0
                C[:, 0, own] = (num[1:] - num[0] * den[1:]).T
            first += n
        if self.period is None:
            return self.speed * A, self.speed * B, C, D
        unit = np.eye(order)
        within = np.asarray(np.linalg.inv(unit - A), dtype=float)
        return within @ (unit + A), 2 * within @ B, C @ within, D + C @ within @ B

    def feedback(self, law: Matrices, share: float = 1.0) -> tuple[Real, Real]:
        """Return the row (laws, 1, n) of the input by all states, under a factor on the law, and 1 + D_k D or nan."""
        _, _, C, D = self.plant
        _, _, Ck, Dk = law
        through = 1.0 + share * (Dk @ D)
        through = np.where(abs(through) < ALGEBRAIC, np.nan, through)
        return -share * np.concatenate([Dk @ C, Ck], axis=2) / through, through

    def closed_matrices(self, law: Matrices, share: float = 1.0) -> Real:
        """Return closed-loop matrices (laws, n, n), the plant's states first; nan of algebraic loops."""
        A, B, C, D = self.plant
        Ak, Bk, *_ = law
        row, _ = self.feedback(law, share)
        read = D @ row
        n = len(A)
        read[:, :, :n] += C
        found = np.zeros((len(Ak), *row.shape[-1:] * 2))
        found[:, :n, :n] = A
        found[:, n:, n:] = Ak
        found[:, :n] += B @ row
        found[:, n:] += Bk @ read
        return found

    def poles(self, entries: Sequence[Entry], share: float = 1.0) -> Complex:
        """Return closed-loop poles (laws, n), of a matrix that is not finite far outside."""
        found = self.closed_matrices(self.states(entries), share)
        growth = 1e6
        found[~np.isfinite(found).all(axis=(1, 2))] = growth * np.eye(found.shape[1])
        return np.linalg.eigvals(found).astype(complex)

    def growth(self, poles: Complex) -> Real:
        """Return ln |z| of poles, or Re s/|s| less the error of the model: below 0 if stable."""
        size = np.maximum(abs(poles), LEAST_SIZE)
        if self.period is not None:
            return np.log(size)
        # a smaller growth may be an error of the model
        return poles.real / size - 1e-6

    def in_s(self, poles: Complex) -> Complex:
        """Return s of poles, times the period of a sampled loop; 1 of poles at z = 0."""
        if self.period is None:
            return poles
        return np.log(np.where(poles == 0, np.e, poles))

    @cached_property
    def angles(self) -> Real:
        """The grid (m,)."""
        return self.grid()

    @cached_property
    def responses(self) -> tuple[Complex, Complex]:
        """The s (m,) of laws, and the signals (signals, m), at all angles."""
        return self.responses_at(self.angles)

    def s_at(self, angles: Real) -> Complex:
        """Return the s of laws at angles, of a sampled loop by Tustin's rule."""
        s = 1j * angles
        if self.period is None:
            return s
        z = np.exp(s)
        # at z = -1 Tustin's s is infinite
        return self.speed * (z - 1) / np.where(abs(z + 1) < 1e-12, 1e-12, z + 1)

    def responses_at(self, angles: Real) -> tuple[Complex, Complex]:
        """Return the s of laws and the signals (signals, m) or (signals, laws, m) at angles (m,) or (laws, m)."""
        return self.s_at(angles), self.response(angles.ravel()).reshape(-1, *angles.shape)

    def loop(self, entries: Sequence[Entry], angles: Real | None = None) -> Complex:
        """Return L (laws, m) at the model's own angles, or at others (m,) or (laws, m)."""
        s, response = self.responses if angles is None else self.responses_at(np.asarray(angles))
        total: Any = 0.0
        for signal, through in controllers(entries, s):
            total = total + through * response[self.signals.index(signal)]
        return np.asarray(total)


def controllers(entries: Sequence[Entry], s: Complex) -> Iterator[tuple[str, Complex]]:
    """Yield each signal with its entry of the laws (laws, m) at s (m,) or (laws, m)."""
    for signal, num, den in entries:
        yield signal, values_of(num, s) / values_of(den, s)


def values_of(polynomial: Real, s: Complex) -> Any:
    """Return polynomials (degree + 1, laws) at s (m,), (laws, m); of constants (laws, 1)."""
    total: Any = polynomial[0][:, None]
    for row in polynomial[1:]:
        total = total * s + row[:, None]
    return total


def continuous_model(arm: Arm, signals: tuple[str, ...], modes: int, count: int, speed: float) -> DesignModel:
    """Return the continuous-time loop of `count` flexible modes; its response is that of the exact arm."""
    A, B, C, D = sensed_model(arm, signals, count)
    # an angle without feedback is no state of the loop
    if arm.has_rigid_mode and "hub_angle" not in signals:
        A = A[1:, 1:]
        B = B[1:]
        C = C[:, 1:]
    read = Signals(arm, signals)
    top = frequency_above_mode(arm, modes)
    moment = C[signals.index("root_moment")] if "root_moment" in signals else np.zeros(len(A))
    return DesignModel(
        (A, B, C, D),
        signals,
        speed,
        None,
        lambda: grid(arm, top),
        lambda w: read.values(1j * w),
        top,
        (),
        0,
        moment,
        {},
    )


def sampled_model(arm: Arm, chain: Chain, signals: tuple[str, ...], modes: int, count: int) -> DesignModel:
    """Return the loop at the samples of a chain, of `count` flexible modes.

    Poles of higher modes, which alias into the same angles, are those nearest to the open-loop ones: a held torque
    moves a pole less the higher its mode.
    """
    T = chain.sampling.period
    by_difference = "hub_rate" in signals and chain.converters.hub_rate == "difference"
    read = signals
    if by_difference and "hub_angle" not in signals:
        read = (*signals, "hub_angle")
    sensed = sensed_plant(arm, chain, read, count)
    pulse = PulseTransfer(sensed.together, chain.sampling).without_fast_poles()
    A, B, C = pulse.matrices()
    own = sensed.own_moment(chain.sampling) if "root_moment" in signals else 0.0 * C[0]
    # of the two states of the rigid body those that the loop does not have; of an arm that turns the angle is the last
    first = pulse.integrals_at
    angle = None
    missing = 2
    if arm.has_rigid_mode:
        damped = bool(sensed.read.arm.rate_loss)
        angle = first + damped
        missing = damped + ("hub_angle" not in signals)
    gone = range(first, first + missing)
    response: Callable[[Complex], Complex] = pulse
    rate = None
    if by_difference:
        a = np.exp(-chain.converters.rate_filter * T)
        n = read.index("hub_angle")
        row = signals.index("hub_rate")
        A, B, C = difference_rate(A, B, C, n, row, a, T, angle)
        own = np.append(own, 0.0)

        def rate(z: Complex) -> Complex:
            return (1 - a) / T * (z - 1) / (z - a)

        def response(z: Complex) -> Complex:
            found = pulse(z)
            found[row] = rate(z) * found[n]
            return found

    A = np.delete(np.delete(A, gone, 0), gone, 1)
    B = np.delete(B, gone)
    C = np.delete(C, gone, 1)[: len(signals)]
    beyond = np.nonzero((pulse.mode > modes) & (pulse.poles.imag >= 0))[0]
    # the highest come first
    higher = pulse.multipliers[beyond[np.argsort(-pulse.mode[beyond], kind="stable")]]
    return DesignModel(
        (A, B[:, None], C, np.zeros((len(C), 1))),
        signals,
        2 / T,
        T,
        lambda: circle_angles(pulse),
        lambda q: response(np.exp(1j * q))[: len(signals)],
        np.inf,
        tuple(complex(each.real, abs(each.imag)) for each in higher),
        first + 2 - missing,
        np.delete(own, gone),
        modes_alone(pulse),
        rate,
    )


def difference_rate(
    A: Real, B: Real, C: Real, angle: int, rate: int, a: float, T: float, state: int | None
) -> tuple[Real, Real, Real]:
    """Return the plant with the rate as the filtered difference of the angle, (1 - a)/T (z - 1)/(z - a).

    It has one more state g, a g + theta of the next sample, less its share of the turning `state`.  `angle` and `rate`
    are rows; only the angle depends on that state then.
    """
    size = len(A)
    A = np.pad(A, (0, 1))
    B = np.append(B, 0.0)
    C = np.pad(C, ((0, 0), (0, 1)))
    A[size] = C[angle]
    A[size, size] = a
    C[rate] = (1 - a) / T * C[angle]
    C[rate, size] = -((1 - a) ** 2) / T
    if state is not None:
        turned = np.eye(size + 1)
        back = np.eye(size + 1)
        turned[size, state] = -C[angle, state] / (1 - a)
        back[size, state] = -turned[size, state]
        A = turned @ A @ back
        B = turned @ B
        C = C @ back
    return A, B, C


def circle_angles(pulse: PulseTransfer) -> Real:
    """Return angles (0, pi] of the circle, dense near the poles of the open loop."""
    angle = abs(np.angle(pulse.multipliers))
    away = np.geomspace(1e-9, 0.5, 40)
    close = (angle[:, None] + np.r_[-away, away]).ravel()
    found = np.unique(np.r_[np.linspace(0, np.pi, 401), close])
    return found[(found > 0) & (found <= np.pi)]
