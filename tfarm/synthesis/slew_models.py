"""Slews of loops of few modes under many laws at once, sample by sample, in blocks of samples:

    x_{k+1} = A x_k + G (r_k + D_k ref_k) + E ref_k,   w = (r + D_k (ref - C x) - C_k x_k)/(1 + D_k D)

A is that of the closed loop, r the feed-forward, w the input, D_k the direct term of a law.  In continuous time the
reference has states: its angle, rate and acceleration, constant over each half of the slew.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.blocks import Matrices
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.dsp import Chain, Scenario
from tfarm.dsp.scenarios import TRIAL_SLEWS, slew_scenario, trial_weights
from tfarm.dsp.shaping import SHARES, impulses_at, impulses_of, modes_under
from tfarm.records import frozen
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.models import DesignModel
from tfarm.synthesis.structures import Entry


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
