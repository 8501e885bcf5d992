"""Loops of few modes under many laws at once: closed-loop matrices, poles and loop functions.

A law is a list of entries (`structures`), each in controllable form in p = s/c, c = 2/T.  Sampled by Tustin's rule,
p = (z - 1)/(z + 1), it becomes

    (1 - A)^-1 (1 + A),  2 (1 - A)^-1 B,  C (1 - A)^-1,  D + C (1 - A)^-1 B.

A slew under laws, sample by sample, many laws at once:

    x_{k+1} = A x_k + G (r_k + D_k ref_k) + E ref_k,   w = (r + D_k (ref - C x) - C_k x_k)/(1 + D_k D)

A is that of the closed loop, r the feed-forward, w the input, D_k the direct term of a law.  In continuous time the
reference has states: its angle, rate and acceleration, constant over each half of the slew.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.blocks import Matrices
from tfarm.arm.weights import Weights
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.dsp import Chain, Scenario
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.scenarios import TRIAL_SLEWS, slew_scenario, trial_weights
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.shaping import SHARES, impulses_at, impulses_of, modes_alone, modes_under
from tfarm.loop.continuous import frequency_above_mode, grid
from tfarm.records import frozen
from tfarm.reduced.modal import ALGEBRAIC, sensed_model
from tfarm.response.signals import Signals
from tfarm.spectrum.table import first_frequency
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
    """Return the signals (inputs, samples) in blocks, before them zeros so that the sample `first` begins one.

    Those of a slew are polynomials over each half: the blocks have a low rank, whatever their number.
    """
    inputs, number = signals.shape
    size = 2 ** max(int(np.log2(number**0.5 / 1.3)), 0)
    before = -first % size
    after = -(before + number) % size
    scale = np.maximum(abs(signals).max(axis=1), LEAST_SIZE)[:, None, None]
    r = np.pad(signals, ((0, 0), (before, after))).reshape(inputs, -1, size) / scale
    basis, weights, shares = np.linalg.svd(
        np.moveaxis(r, 1, 2).reshape(inputs * size, -1), full_matrices=False
    )
    # of the largest singular value: rounding of the signals of a slew
    rank = (weights > 1e-11 * weights[0]).sum()
    basis = (basis * weights)[:, :rank].reshape(inputs, size, rank) * scale
    return Blocks(basis, shares[:rank], (before + first) // size, size - after, number - first)


def squares(A: Real, B: Real, C: Real, D: Real, signals: Blocks) -> Real:
    """Return the sum of squares (laws,) of the outputs over the counted samples."""
    return np.asarray((block_outputs(A, B, C, D, signals) ** 2).sum(axis=(1, 2)))


def block_outputs(A: Real, B: Real, C: Real, D: Real, signals: Blocks) -> Real:
    """Return C x_k + D r_k over the counted samples, x_{k+1} = A x_k + B r_k from x = 0: (laws, size outputs, blocks).

    A row is a sample of its block and an output; those beyond the last sample are 0.  The outputs of a block are one
    product with its first state and the shares of its signals.
    """
    laws, _, inputs = B.shape
    seen = C.shape[1]
    _, size, rank = signals.basis.shape
    rows = C
    columns = B
    power = A
    # C, C A, ...; ..., A B, B
    while rows.shape[1] < size * seen:
        rows = np.concatenate([rows, rows @ power], axis=1)
        columns = np.concatenate([power @ columns, columns], axis=2)
        power = power @ power
    basis = signals.basis.reshape(inputs, -1)
    # after each number of samples
    echo = np.concatenate([D, rows @ B], axis=1).reshape(laws, -1, seen, inputs)
    direct = np.zeros((laws, seen, size, rank))
    for k in range(size):
        direct[:, :, k:] += (echo[:, k] @ basis[:, : (size - k) * rank]).reshape(laws, seen, -1, rank)
    together = np.concatenate([rows, np.moveaxis(direct, 1, 2).reshape(laws, -1, rank)], axis=2)
    push = np.moveaxis(columns @ np.moveaxis(signals.basis, 0, 1).reshape(-1, rank) @ signals.shares, 2, 0)[
        ..., None
    ]
    x = np.zeros_like(push)
    for k in range(1, len(x)):
        x[k] = power @ x[k - 1] + push[k - 1]
    shares = np.broadcast_to(signals.shares, (laws, *signals.shares.shape))
    x = np.concatenate([np.moveaxis(x[..., 0], 0, 2), shares], axis=1)
    outputs = together @ x[:, :, signals.first :]
    outputs[:, signals.tail * seen :, -1] = 0.0
    return outputs


def shaped_outputs(outputs: Real, signals: Blocks, impulses: Sequence[Real]) -> Real:
    """Return the outputs (laws, outputs, samples) of `block_outputs` through the impulses of each law."""
    laws, rows, blocks = outputs.shape
    size = signals.basis.shape[1]
    in_time = outputs.reshape(laws, size, rows // size, blocks).transpose(0, 2, 3, 1)
    in_time = in_time.reshape(laws, rows // size, -1)[..., : signals.counted]
    for several, own in zip(in_time, impulses, strict=True):
        for y in several:
            y[:] = np.convolve(y, own)[: y.size]
    return in_time


def slew_and_after(
    arm: Arm, known: Arm, chain: Chain, law: AnyLaw | None = None, added: float = 0.0
) -> Scenario:
    """Return the slew for the arm `known`, through its shaper for a `law`, and a period of the moving arm's first mode.

    The record is longer by the shaper, and by the time `added` [s].
    """
    # where a period of the first mode has fewer samples
    left = max(2 * np.pi / first_frequency(arm), 16 * chain.sampling.period)
    impulses = np.ones(1) if law is None else impulses_of(known, chain, law)
    later = added + (impulses.size - 1) * chain.sampling.period
    return slew_scenario(known, chain, chain.slew.rise_time + left + later).through(impulses)


def trial_slew(known: Arm, chain: Chain) -> Scenario:
    """Return the slew of the tuner's trials for the arm `known`, without a shaper."""
    return slew_scenario(known, chain, TRIAL_SLEWS * chain.slew.rise_time)


@frozen
class Slews:
    """Slews of an arm in a model, with references of the arm `known`, whose model is `nominal`.

    A shaper acts as one of the outputs: what is linear and at rest before has them in any order.
    """

    model: DesignModel
    arm: Arm
    known: Arm
    chain: Chain
    nominal: DesignModel

    def residual(self, entries: Sequence[Entry]) -> Real:
        """Return the root mean square [N m] of the arm's own moment less the rigid arm's (laws,)."""
        if self.model.period is None:
            return np.sqrt(self._mean_square_in_time(entries))
        A, B, C, D = self._closed_loop(entries, 1)
        D[:, 0, -1] -= 1.0
        if self.chain.reference.shaper == "none":
            return np.sqrt(squares(A, B, C, D, self._after) / self._after.counted)
        impulses = self._impulses(entries)
        added = max(each.size - 1 for each in impulses)
        signals = self._signals_after(added * self.chain.sampling.period)
        # over equally long records from the end of each slew on
        number = signals.counted - added
        outputs = shaped_outputs(block_outputs(A, B, C, D, signals), signals, impulses)
        late = (y[each.size - 1 :][:number] for y, each in zip(outputs[:, 0], impulses, strict=True))
        return np.array([np.sqrt(np.mean(each**2)) for each in late])

    def cost(self, entries: Sequence[Entry]) -> Real:
        """Return T sum of (a x^2 + b e^2)/2 (laws,)."""
        model = self.model
        A, B, *_ = self._closed_loop(entries, 2)
        C = np.zeros((len(A), 2, A.shape[1]))
        D = np.zeros((len(A), 2, B.shape[2]))
        read = model.plant[2][model.signals.index("root_moment")]
        C[:, 0, : read.size] = read
        C[:, 1] = A[:, model.last]
        D[:, 1] = B[:, model.last]
        D[:, (0, 1), (-2, -1)] = -1.0
        T = self.chain.sampling.period
        weights = np.sqrt(np.array(trial_weights(self.known, self.chain)) * T / 2)[:, None]
        matrices = (A, B, weights * C, weights * D)
        if self.chain.reference.shaper == "none":
            return squares(*matrices, self._trial)
        outputs = shaped_outputs(block_outputs(*matrices, self._trial), self._trial, self._impulses(entries))
        return np.asarray((outputs**2).sum(axis=(1, 2)))

    def _impulses(self, entries: Sequence[Entry]) -> list[Real]:
        """Return the impulses of the shaper under each law; nan for an unstable loop, and one too slow for its slew."""
        nominal = self.nominal
        law = nominal.states(entries)
        reference = self.chain.reference
        matrices = np.stack([nominal.closed_matrices(law, share) for share in SHARES.tolist()], axis=1)
        found = [np.full(1, np.nan)] * len(matrices)
        # angle of a mode whose half period takes 20 slews
        slowest = np.pi * self.chain.sampling.period / (20 * self.chain.slew.rise_time)
        is_stable = nominal.growth(nominal.poles(entries)).max(axis=1) < 0
        for n in np.flatnonzero(is_stable).tolist():
            poles = modes_under(matrices[n], nominal.alone)
            if np.angle([*poles.values()]).min(initial=np.inf) > slowest:
                found[n] = impulses_at(poles, reference.shaper, reference.modes)
        return found

    @cached_property
    def _after(self) -> Blocks:
        """The signals of a residual without a shaper."""
        return self._signals_after(0.0)

    def _signals_after(self, added: float) -> Blocks:
        """Return the signals of a residual, and the rigid arm's moment, of a record longer by `added` [s]."""
        task = slew_and_after(self.arm, self.known, self.chain, added=added)
        return in_blocks(self._signals(task, task.rigid_moment), int(task.is_after.argmax()))

    @cached_property
    def _trial(self) -> Blocks:
        """The signals of a cost, what the controller is to read, and what is not to be added."""
        task = trial_slew(self.known, self.chain)
        own = (self.chain.slew.reading == "vibration") * task.feedforward
        return in_blocks(self._signals(task, task.moment_reference, own), 0)

    def _signals(self, task: Scenario, *wanted: Real) -> Real:
        """Return the feed-forward, the references, and signals that are wanted."""
        references = (task.references.get(name, 0.0 * task.t) for name in self.model.signals)
        return np.array([task.feedforward, *references, *wanted])

    def _closed_loop(self, entries: Sequence[Entry], wanted: int) -> Matrices:
        """Return the closed loop from feed-forward, references and signals that are wanted to the arm's own moment."""
        model = self.model
        _, B, _, D = model.plant
        law = model.states(entries)
        _, Bk, _, Dk = law
        row, through = model.feedback(law)
        push = np.concatenate([np.ones_like(Dk[..., :1]), Dk], axis=2) / through
        push = np.pad(push, ((0, 0), (0, 0), (0, wanted)))
        error = D @ push
        error[:, :, 1:] -= np.eye(len(D), push.shape[2] - 1)
        own = D[model.signals.index("root_moment")]
        C = own * row
        C[..., : len(B)] += model.own_moment
        return model.closed_matrices(law), np.concatenate([B @ push, Bk @ error], axis=1), C, own * push

    def _mean_square_in_time(self, entries: Sequence[Entry]) -> Real:
        """Return the mean square (laws,) of the moment over the first mode's period after the slew.

        The rigid arm's is 0 then.  Angle and rate have references here, the moment has none.  Of the reference angle,
        rate and acceleration are states of their own: the acceleration is constant over each half of the slew.
        """
        slew = self.chain.slew
        A, B, C, D = self._closed_loop(entries, 0)
        # the feed-forward and the references by angle, rate and acceleration
        followed = {"hub_angle": (1.0, 0.0, 0.0), "hub_rate": (0.0, 1.0, 0.0)}
        forward = (0.0, self.known.rate_loss, self.known.turned_inertia)
        signals = np.array([forward, *(followed.get(name, (0.0, 0.0, 0.0)) for name in self.model.signals)])
        size = A.shape[1]
        whole = np.zeros((len(A), size + 3, size + 3))
        whole[:, :size, :size] = A
        whole[:, :size, size:] = B @ signals
        whole[:, size:, size:] = np.eye(3, k=1)
        half = expm(whole * slew.rise_time / 2)
        x = np.zeros((len(A), size + 3, 1))
        for way in (1, -1):
            x[:, -1] = way * slew.acceleration(self.known.reach)
            x = half @ x
        x[:, -2:] = 0.0
        # of the period after the slew
        points = 64
        step = expm(whole * (2 * np.pi / first_frequency(self.arm) / points))
        sense = np.concatenate([C, D @ signals], axis=2)
        total = np.zeros(len(A))
        for _ in range(points):
            total += (sense @ x)[:, 0, 0] ** 2
            x = step @ x
        return total / points
