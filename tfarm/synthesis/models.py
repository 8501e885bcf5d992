"""Loops of few modes under many laws at once: closed-loop matrices, poles and loop functions.

A law is a list of entries (`structures`), each in controllable form in p = s/c, c = 2/T.  Sampled by Tustin's rule,
p = (z - 1)/(z + 1), it becomes

    (1 - A)^-1 (1 + A),  2 (1 - A)^-1 B,  C (1 - A)^-1,  D + C (1 - A)^-1 B.

A slew under laws, sample by sample, many laws at once:

    x_{k+1} = A x_k + G (r_k + D_k ref_k) + E ref_k,   w = (r + D_k (ref - C x) - C_k x_k)/(1 + D_k D)

A is that of the closed loop, r the feed-forward, w the input, D_k the direct term of a law.  In continuous time the
reference has states: its angle, rate and acceleration, constant over each half of the slew.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.dsp import Chain, Scenario, scenario
from tfarm.dsp.plant import PulseTransfer, sensed_plant
from tfarm.dsp.scenarios import TRIAL_SLEWS, trial_weights
from tfarm.loop.continuous import band_of, grid
from tfarm.records import record
from tfarm.reduced.modal import ALGEBRAIC, sensed_model
from tfarm.response.signals import Signals
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.structures import Entry

GROWTH_OF_MODEL = 1e-6  # of |s|: a smaller growth may be an error of the model
AT_NYQUIST = 1e-12  # of z = -1, where Tustin's s is infinite
POLE_OFFSETS = np.geomspace(1e-9, 0.5, 40)  # rad, to either side of the open loop's poles
EVEN_ANGLES = 400  # points of the circle at equal distances
LOST_GROWTH = 1e6  # of a matrix that is not finite
RANK_LOST = 1e-11  # of the largest singular value: rounding of the signals of a slew
OF_ROOT = 1.3  # the root of the number of samples by the length of a block, at least


@dataclass(frozen=True)
@record
class Model:
    """A, B, C, D from the input to `signals`, of few modes; at samples of `period` [s], or in continuous time (None).

    `speed` [1/s] is c, the unit of a law's s.  `grid` gives angles (m,) of the circle [rad] or frequencies [rad/s], and
    `response` the signals (signals, k) at k of them.  The damping of poles counts below `band` [rad/s], without one
    each near the poles of open-loop modes `higher`, the highest first.  `last` is the state with the input of the last
    sample; `own_moment` (n,) is the row of the arm's own root moment, before the anti-alias filter.
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

    # ------------------------------------------------------------ laws in states

    def states(self, entries: Sequence[Entry]) -> tuple[Real, Real, Real, Real]:
        """A (laws, k, k), B (laws, k, signals), C (laws, 1, k), D (laws, 1, signals) of laws."""
        number = max(each.num.shape[1] for each in entries)
        order, signals = sum(len(each.den) - 1 for each in entries), len(self.signals)
        A, B = np.zeros((number, order, order)), np.zeros((number, order, signals))
        C, D = np.zeros((number, 1, order)), np.zeros((number, 1, signals))
        first = 0
        for signal, num, den in entries:
            n, column = len(den) - 1, self.signals.index(signal)
            scale = self.speed ** np.arange(n, -1.0, -1.0)[:, None]
            num = np.concatenate([np.zeros((n + 1 - len(num), num.shape[1])), num]) * scale
            num, den = num / (den[0] * scale[0]), den * scale / (den[0] * scale[0])
            D[:, 0, column] += num[0]
            if n:
                own = slice(first, first + n)
                A[:, first, own], B[:, first, column] = -den[1:].T, 1.0
                A[:, np.arange(first + 1, first + n), np.arange(first, first + n - 1)] = 1.0
                C[:, 0, own] = (num[1:] - num[0] * den[1:]).T
            first += n
        if self.period is None:
            return self.speed * A, self.speed * B, C, D
        unit = np.eye(order)
        within = np.asarray(np.linalg.inv(unit - A), dtype=float)
        return within @ (unit + A), 2 * within @ B, C @ within, D + C @ within @ B

    def closed(self, entries: Sequence[Entry], share: float = 1.0) -> Real:
        """Closed-loop matrices (laws, n, n) with a factor `share` on the law, the plant's states first.

        They are nan of algebraic loops.
        """
        A, B, C, D = self.plant
        Ak, Bk, Ck, Dk = self.states(entries)
        whole = 1.0 + share * (Dk @ D)
        whole = np.where(abs(whole) < ALGEBRAIC, np.nan, whole)
        number, n, k = len(Ak), len(A), Ak.shape[1]
        v = -share * np.concatenate([Dk @ C, Ck], axis=2) / whole
        y = np.concatenate([np.broadcast_to(C, (number, *C.shape)), np.zeros((number, len(C), k))], axis=2) + D @ v
        found = np.zeros((number, n + k, n + k))
        found[:, :n, :n], found[:, n:, n:] = A, Ak
        found[:, :n] += B @ v
        found[:, n:] += Bk @ y
        return found

    # ------------------------------------------------------------ poles

    def poles(self, entries: Sequence[Entry], share: float = 1.0) -> Complex:
        """Closed-loop poles (laws, n), of a matrix that is not finite far outside."""
        found = self.closed(entries, share)
        bad = ~np.isfinite(found).all(axis=(1, 2))
        found[bad] = LOST_GROWTH * np.eye(found.shape[1])
        return np.linalg.eigvals(found).astype(complex)

    def growth(self, poles: Complex) -> Real:
        """ln |z| of poles, or Re s/|s| less the error of the model: below 0 if stable."""
        size = np.maximum(abs(poles), LEAST_SIZE)
        return np.log(size) if self.period is not None else poles.real / size - GROWTH_OF_MODEL

    def in_s(self, poles: Complex) -> Complex:
        """s of poles, times the period of a sampled loop; 1 of poles at z = 0."""
        return poles if self.period is None else np.log(np.where(poles == 0, np.e, poles))

    # ------------------------------------------------------------ loop function

    @cached_property
    def angles(self) -> Real:
        """The grid (m,)."""
        return np.asarray(self.grid())

    @cached_property
    def responses(self) -> Complex:
        """The signals (signals, m) at all angles."""
        return self.response(self.angles)

    def loop(self, entries: Sequence[Entry], angles: Real | None = None) -> Complex:
        """L (laws, m) at the model's own angles, or at others."""
        q = self.angles if angles is None else np.asarray(angles)
        response, total = self.responses if angles is None else self.response(q), 0.0
        s, z = 1j * q, np.exp(1j * q)
        if self.period is not None:
            s = self.speed * (z - 1) / np.where(abs(z + 1) < AT_NYQUIST, AT_NYQUIST, z + 1)
        for signal, num, den in entries:
            through = np.polyval(num[:, :, None], s) / np.polyval(den[:, :, None], s)  # (laws, m)
            total = total + through * response[self.signals.index(signal)]
        return np.asarray(total)


def continuous_model(arm: Arm, signals: tuple[str, ...], modes: int, count: int, speed: float) -> Model:
    """The continuous-time loop of `count` flexible modes; its response is that of the exact arm."""
    A, B, C, D = sensed_model(arm, signals, count)
    if arm.has_rigid_mode and "hub_angle" not in signals:  # an angle without feedback is no state of the loop
        A, B, C = A[1:, 1:], B[1:], C[:, 1:]
    read, top = Signals(arm, signals), band_of(arm, modes)
    moment = C[signals.index("root_moment")] if "root_moment" in signals else np.zeros(len(A))
    return Model(
        (A, B, C, D), signals, speed, None, lambda: grid(arm, top), lambda w: read.values(1j * w), top, (), 0, moment
    )


def sampled_model(arm: Arm, chain: Chain, signals: tuple[str, ...], modes: int, count: int) -> Model:
    """The loop at the samples of a chain, of `count` flexible modes.

    Poles of higher modes, which alias into the same angles, are those nearest to the open-loop ones: a held torque
    moves a pole less the higher its mode.
    """
    T, by_difference = chain.sampling.period, "hub_rate" in signals and chain.converters.hub_rate == "difference"
    read = (*signals, *(("hub_angle",) if by_difference and "hub_angle" not in signals else ()))
    sensed = sensed_plant(arm, chain, read, count)
    pulse = PulseTransfer(sensed.together, chain.sampling).folded()
    A, B, C = pulse.matrices()
    own = sensed.own_moment(chain.sampling) if "root_moment" in signals else 0.0 * C[0]
    first = pulse.integrals_at
    damped, turns = bool(sensed.read.arm.rate_loss), arm.has_rigid_mode
    gone = [first] if damped or not turns else []
    gone += [] if turns else [first + 1]
    angle = first + damped
    response: Callable[[Complex], Complex] = pulse
    if by_difference:
        a, n, row = float(np.exp(-chain.converters.rate_filter * T)), read.index("hub_angle"), signals.index("hub_rate")
        A, B, C = differenced(A, B, C, (n, row), (a, T), angle if turns else None)
        own = np.append(own, 0.0)

        def response(z: Complex) -> Complex:
            found = pulse(z)
            found[row] = (1 - a) / T * (z - 1) / (z - a) * found[n]
            return found

    if turns and "hub_angle" not in signals:
        gone.append(angle)
    A, B, C = np.delete(np.delete(A, gone, 0), gone, 1), np.delete(B, gone), np.delete(C, gone, 1)[: len(signals)]
    beyond = np.nonzero((pulse.mode > modes) & (pulse.poles.imag >= 0))[0]
    higher = pulse.multipliers[beyond[np.argsort(-pulse.mode[beyond], kind="stable")]]  # the highest come first
    return Model(
        (A, B[:, None], C, np.zeros((len(C), 1))), signals, 2 / T, T, lambda: circle_angles(pulse),
        lambda q: response(np.exp(1j * q))[: len(signals)], np.inf,
        tuple(complex(each.real, abs(each.imag)) for each in higher), first + 2 - len(gone), np.delete(own, gone),
    )  # fmt: skip


def differenced(
    A: Real, B: Real, C: Real, rows: tuple[int, int], numbers: tuple[float, float], angle: int | None
) -> tuple[Real, Real, Real]:
    """The plant with the rate as the filtered difference of the angle, (1 - a)/T (z - 1)/(z - a); numbers a and T.

    It has one more state g, a g + theta of the next sample, less its share of the turning state.  `rows` are those of
    angle and rate; only the angle depends on the state `angle` then.
    """
    (n, row), (a, T), size = rows, numbers, len(A)
    A, B, C = np.pad(A, (0, 1)), np.append(B, 0.0), np.pad(C, ((0, 0), (0, 1)))
    A[size, :size], A[size, size] = C[n, :size], a
    C[row] = (1 - a) / T * C[n]
    C[row, size] = -((1 - a) ** 2) / T
    if angle is not None:
        turned = np.eye(size + 1)
        turned[size, angle] = -C[n, angle] / (1 - a)
        back = 2 * np.eye(size + 1) - turned
        A, B, C = turned @ A @ back, turned @ B, C @ back
    return A, B, C


def circle_angles(pulse: PulseTransfer) -> Real:
    """Angles (0, pi] of the circle, dense near the poles of the open loop."""
    angle = abs(np.angle(pulse.multipliers))
    close = (angle[:, None] + np.r_[-POLE_OFFSETS, POLE_OFFSETS]).ravel()
    return np.unique(np.r_[np.linspace(0, np.pi, EVEN_ANGLES + 1)[1:], close[(close > 0) & (close <= np.pi)]])


class Blocks(NamedTuple):
    """Signals in blocks of samples: `basis` (inputs, size, rank) times `shares` (rank, blocks).

    Of the `counted` samples the first is that of the block `first`, the last the one before `tail` of the last block.
    """

    basis: Real
    shares: Real
    first: int
    tail: int
    counted: int


def in_blocks(signals: Real, first: int) -> Blocks:
    """The signals (inputs, samples) in blocks, before them zeros so that the sample `first` begins one.

    Those of a slew are polynomials over each half: the blocks have a low rank, whatever their number.
    """
    inputs, number = signals.shape
    size = 2 ** max(int(np.log2(number**0.5 / OF_ROOT)), 0)
    before = -first % size
    after = -(before + number) % size
    scale = np.maximum(abs(signals).max(axis=1), LEAST_SIZE)[:, None, None]
    r = np.pad(signals, ((0, 0), (before, after))).reshape(inputs, -1, size) / scale
    basis, weights, shares = np.linalg.svd(np.moveaxis(r, 1, 2).reshape(inputs * size, -1), full_matrices=False)
    rank = int((weights > RANK_LOST * weights[0]).sum())
    basis = (basis * weights)[:, :rank].reshape(inputs, size, rank) * scale
    return Blocks(basis, shares[:rank], (before + first) // size, size - after, number - first)


def squares(A: Real, B: Real, C: Real, D: Real, signals: Blocks) -> Real:
    """The sum of squares (laws,) of C x_k + D r_k over the counted samples, x_{k+1} = A x_k + B r_k from x = 0.

    The outputs of a block are one product with its first state and the shares of its signals; of many rows a
    triangular factor has the same sum.
    """
    (laws, n, inputs), seen, (_, size, rank) = B.shape, C.shape[1], signals.basis.shape
    rows, columns, power = C, B, A
    while rows.shape[1] < size * seen:  # C, C A, ...; ..., A B, B
        rows = np.concatenate([rows, rows @ power], axis=1)
        columns = np.concatenate([power @ columns, columns], axis=2)
        power = power @ power
    basis = signals.basis.reshape(inputs, -1)
    echo = np.concatenate([D, rows @ B], axis=1).reshape(laws, -1, seen, inputs)  # after each number of samples
    direct = np.zeros((laws, seen, size, rank))
    for k in range(size):
        direct[:, :, k:] += (echo[:, k] @ basis[:, : (size - k) * rank]).reshape(laws, seen, -1, rank)
    together = np.concatenate([rows, np.moveaxis(direct, 1, 2).reshape(laws, -1, rank)], axis=2)
    push = np.moveaxis(columns @ np.moveaxis(signals.basis, 0, 1).reshape(-1, rank) @ signals.shares, 2, 0)[..., None]
    x = np.zeros_like(push)
    for k in range(1, len(x)):
        x[k] = power @ x[k - 1] + push[k - 1]
    x = np.concatenate(
        [np.moveaxis(x[..., 0], 0, 2), np.broadcast_to(signals.shares, (laws, *signals.shares.shape))], axis=1
    )
    last = together[:, : signals.tail * seen] @ x[:, :, -1:]
    if size * seen > n + rank:
        together = np.asarray(np.linalg.qr(together, mode="r"))
    whole = together @ x[:, :, signals.first : -1]
    return np.asarray((whole**2).sum(axis=(1, 2)) + (last**2).sum(axis=(1, 2)))


SAMPLES_LEFT = 16  # of the record after the slew, where a period of the first mode has fewer
PERIOD_POINTS = 64  # of the period after the slew, in continuous time


def slew_and_after(arm: Arm, known: Arm, chain: Chain) -> Scenario:
    """The slew for the arm `known`, and a period of the first mode of the moving arm."""
    left = max(2 * np.pi / first_frequency(arm), SAMPLES_LEFT * chain.sampling.period)
    return scenario("slew", known, chain, chain.slew.rise_time + left)


def trial_slew(known: Arm, chain: Chain) -> Scenario:
    """The slew of the tuner's trials for the arm `known`."""
    return scenario("slew", known, chain, TRIAL_SLEWS * chain.slew.rise_time)


@dataclass(frozen=True)
@record
class Slews:
    """Slews of an arm in a model, with references of the arm `known`."""

    model: Model
    arm: Arm
    known: Arm
    chain: Chain

    def residual(self, entries: Sequence[Entry]) -> Real:
        """Root mean square [N m] of the arm's own moment less the rigid arm's (laws,)."""
        if self.model.period is None:
            return np.sqrt((self._left_in_time(entries) ** 2).mean(axis=0))
        A, B = self._driven(entries, 1)
        C, D = np.zeros((len(A), 1, A.shape[1])), np.zeros((len(A), 1, B.shape[2]))
        C[:, 0, : self.model.own_moment.size], D[:, 0, -1] = self.model.own_moment, -1.0
        return np.sqrt(squares(A, B, C, D, self._after) / self._after.counted)

    def cost(self, entries: Sequence[Entry]) -> Real:
        """T sum of (a x^2 + b e^2)/2 (laws,)."""
        model, n = self.model, len(self.model.plant[0])
        A, B = self._driven(entries, 2)
        C, D = np.zeros((len(A), 2, A.shape[1])), np.zeros((len(A), 2, B.shape[2]))
        C[:, 0, :n], D[:, 0, -2] = model.plant[2][model.signals.index("root_moment")], -1.0
        C[:, 1], D[:, 1] = A[:, model.last], B[:, model.last]
        D[:, 1, -1] = -1.0
        weights = np.sqrt(np.array(trial_weights(self.known, self.chain)) * self.chain.sampling.period / 2)[:, None]
        return squares(A, B, weights * C, weights * D, self._trial)

    @cached_property
    def _after(self) -> Blocks:
        """The signals of a residual, and the moment of the rigid arm."""
        task = slew_and_after(self.arm, self.known, self.chain)
        return in_blocks(self._signals(task, task.rigid_moment), int(task.is_after.argmax()))

    @cached_property
    def _trial(self) -> Blocks:
        """The signals of a cost, what the controller is to read, and what is not to be added."""
        task = trial_slew(self.known, self.chain)
        own = (self.chain.slew.reading == "vibration") * task.feedforward
        return in_blocks(self._signals(task, task.moment_reference, own), 0)

    def _signals(self, task: Scenario, *wanted: Real) -> Real:
        """The feed-forward, the references, and signals that are wanted."""
        references = (task.references.get(name, 0.0 * task.t) for name in self.model.signals)
        return np.array([task.feedforward, *references, *wanted])

    def _driven(self, entries: Sequence[Entry], wanted: int) -> tuple[Real, Real]:
        """A and B of the closed loop with these signals."""
        model, n = self.model, len(self.model.plant[0])
        A, (_, Bk, _, Dk) = model.closed(entries), model.states(entries)
        B = np.zeros((*A.shape[:2], 1 + len(model.signals) + wanted))
        B[:, :n, :1], B[:, :n, 1:-wanted], B[:, n:, 1:-wanted] = model.plant[1], model.plant[1] @ Dk, -Bk
        return A, B

    # ------------------------------------------------------------ in continuous time

    def _left_in_time(self, entries: Sequence[Entry]) -> Real:
        """The moment at points of the first mode's period after the slew, where the rigid arm's is 0.

        Angle and rate have references here, the moment has none.
        """
        model, slew = self.model, self.chain.slew
        A, (_, Bk, Ck, Dk) = model.closed(entries), model.states(entries)
        _, B, C, D = model.plant
        number, n = len(A), len(B)
        states = np.zeros((len(model.signals), 3))  # references of angle, rate, acceleration
        for column, name in enumerate(("hub_angle", "hub_rate")):
            if name in model.signals:
                states[model.signals.index(name), column] = 1.0
        through = 1.0 + Dk @ D
        push = (np.array([0.0, self.known.rate_loss, self.known.turned_inertia]) + Dk @ states) / through
        whole = np.zeros((number, A.shape[1] + 3, A.shape[1] + 3))
        size = A.shape[1]
        whole[:, :size, :size] = A
        whole[:, :n, size:], whole[:, n:size, size:] = B @ push, Bk @ (D @ push) - Bk @ states
        whole[:, size, size + 1] = whole[:, size + 1, size + 2] = 1.0
        half = expm(whole * slew.rise_time / 2)
        x = np.zeros((number, size + 3, 1))
        peak = slew.acceleration(self.known.reach)
        for acceleration in (peak, -peak):
            x[:, -1] = acceleration
            x = half @ x
        x[:, -2:] = 0.0
        step = expm(whole * (2 * np.pi / first_frequency(self.arm) / PERIOD_POINTS))
        row, at = model.own_moment, model.signals.index("root_moment")
        passed = D[at, 0] * np.concatenate([-(Dk @ C) / through, -Ck / through, push], axis=2)
        sense = passed + np.r_[row, np.zeros(size + 3 - n)]
        left = np.zeros((PERIOD_POINTS, number))
        for k in range(PERIOD_POINTS):
            left[k] = (sense @ x)[:, 0, 0]
            x = step @ x
        return left
