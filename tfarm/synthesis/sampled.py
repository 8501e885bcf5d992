"""Gains judged by the sampled loop, many at once.

The closed-loop matrix of the modal model under a hold is affine in the gains, so that the poles of thousands of gains
are one call of NumPy.  What wins is judged once more by `sampled_verdict`, with as many modes as that takes; a model of
few modes only says where to look.

    damping    least -Re s/|s| of the oscillating poles, s = ln z/T, of the first modes
    margin     min 2 |1 + L|/|1 - L| over the unit circle, of nearly equal ones that with more damping
    residual   root mean square of the arm's own root moment less the rigid arm's, at the samples after the slew
    cost       that of the tuner's trial with constant gains, of the moment that the controller reads

Poles of higher modes, which alias into the same angles, are told by where the open loop has them: a held torque moves a
pole less the higher its mode.  They have to be stable and count no further; where two poles are about as near, the one
that has decayed more is taken for that of the higher mode, so that no damping is claimed that is not there.  All poles
are stable with every gain a quarter larger and smaller, too: the best damping of few modes often lies where a higher
one is about to grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from tfarm.arm import PLANE, AnyLaw, Arm, HubFeedback, laws_at, tracked
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.dsp import Chain, Sampled, Scenario, sampled_loop, sampled_verdict, scenario
from tfarm.dsp.edges import most_modes
from tfarm.dsp.results import residual_moment_rms, simulated
from tfarm.dsp.sampling import PulseTransfer
from tfarm.dsp.scenarios import TRIAL_SLEWS, trial_weights
from tfarm.dsp.verdict import UNDAMPED_MODES
from tfarm.errors import ConvergenceError
from tfarm.loop.stability import stability
from tfarm.records import record
from tfarm.spectrum.scales import first_frequency
from tfarm.synthesis.search import TIE, Bounds, Effort, GainAxis, Score

RESERVE = 1.25  # the loop holds with all its gains larger or smaller by this factor: what a gauge or motor is off by
SEARCH_RESERVE = 1.002 * RESERVE  # by as much in the search: the model's few modes have edges that are off by less
FEWEST_MODES = 8  # of the first model; more where its best gains do not hold
GAINS_AT_ONCE = 2000  # gains at a time
REAL_ANGLE = 1e-9  # rad: a pole at a smaller angle is real
SAMPLES_LEFT = 16  # of the record after the slew, where a period of the first mode has fewer
POLE_OFFSETS = np.geomspace(1e-9, 0.5, 40)  # rad, to either side of the open loop's poles
EVEN_ANGLES = 400  # points of the circle beside those
AS_NEAR = 4.0  # of the least distance to an open-loop pole: as far off a pole may be its own too
DIPS_REFINED = 5  # lowest points of the circle that are refined


@dataclass(frozen=True)
@record
class SampledJudge:
    """What both gains are worth in a sampled loop of few modes, the others held; those two of `loop` do not matter.

    `known` is the arm that the slew's references and feed-forward are made for.
    """

    loop: Sampled
    objective: str
    modes: int
    known: Arm

    def effort(self, up: Bounds) -> Effort:
        """The grid is cheap but for slews, which are simulated."""
        smooth = {"margin": Effort(24, 32, 6), "cost": Effort(24, 32, 6), "damping": Effort(32, 36, 12)}
        return smooth.get(self.objective, Effort(36, 90, 20))

    def landscape(self, axes: tuple[GainAxis, GainAxis], effort: Effort) -> tuple[Real, Score]:
        """Scores over the grid, rows upwards, inf where not stable, and the score itself, which is so too."""
        gains = (axis.gain(axis.middles(number)) for axis, number in zip(axes, effort[:2], strict=True))
        grid = np.array(np.meshgrid(*gains))
        return self.score(grid.reshape(2, -1)).reshape(grid.shape[1:]), self.score

    def score(self, points: Real) -> Real:
        """What is minimised, at points (2, n) of the plane; inf where the loop does not hold with `RESERVE`."""
        number = points.shape[1]
        values = np.full(number, np.inf)
        for i in range(0, number, GAINS_AT_ONCE):
            part, places = points[:, i : i + GAINS_AT_ONCE], np.arange(i, min(i + GAINS_AT_ONCE, number))
            for share in (SEARCH_RESERVE, 1 / SEARCH_RESERVE, 1.0):  # most of those that do not hold fail the first
                z = np.linalg.eigvals(self._matrices(part, share))
                good = abs(z).max(axis=1) < 1.0
                part, places, z = part[:, good], places[good], z[good]
            if places.size:
                values[places] = self._scores(part, np.asarray(z, dtype=complex))
        return values

    def holds(self, law: HubFeedback) -> bool:
        """Whether the loop is stable with as many modes as it takes, also with the reserve, and without a clock."""
        arm, chain = self.loop.plant.arm, self.loop.chain
        try:
            return stability(arm, law).is_stable and all(
                sampled_verdict(arm, law.times(share), chain).is_stable for share in (1.0, 1 / RESERVE, RESERVE)
            )
        except ConvergenceError:
            return False

    def value(self, law: HubFeedback, score: float) -> float:
        """The damping ratio, disk margin, residual moment [N m] or cost of a law of that score."""
        if self.objective == "margin":
            return self.disk(law)
        if self.objective == "residual":
            return simulated_residual(self.loop.plant.arm, law, self.loop.chain, self.known)
        return -score if self.objective == "damping" else score

    def _scores(self, points: Real, z: Complex) -> Real:
        if self.objective in ("residual", "cost"):
            return self.residual(points) if self.objective == "residual" else self.cost(points)
        damping = first_damping(z, self._higher)
        return -damping if self.objective == "damping" else -self._disks(points) - TIE * damping

    # ------------------------------------------------------------ matrices and poles

    @cached_property
    def _parts(self) -> tuple[Real, Real, Real]:
        """Closed-loop matrices without any gain, what the held ones add, and what 1 of each of both does (2, n, n)."""
        bare = self._bare
        start = bare.reduced_matrix()
        by_held = bare.times(2.0).reduced_matrix() - start
        by_each = np.array([bare.having(**{name: 1.0}).reduced_matrix() - start for name in PLANE])
        return start - by_held, by_held, by_each

    @property
    def _bare(self) -> Sampled:
        """The loop without both gains."""
        return self.loop.having(**dict.fromkeys(PLANE, 0.0))

    def _matrices(self, points: Real, share: float) -> Real:
        start, by_held, by_each = self._parts
        across, up = points[..., None, None] * by_each[:, None]
        return np.asarray(start + share * (by_held + (across + up)))

    @cached_property
    def _higher(self) -> list[complex]:
        return higher_poles(self.loop.pulse, self.modes)

    # ------------------------------------------------------------ disk margin

    @cached_property
    def _circle(self) -> Complex:
        """z and H (1 + gains, n) of what is fed back, at points of the circle dense about the open loop's poles."""
        q = circle_angles(self.loop.pulse)
        return np.concatenate([np.exp(1j * q)[None], self._signals(q)])

    def _signals(self, q: Real) -> Complex:
        whole, *rows = self.loop.terms(np.exp(1j * q), None, np.ones(q.size))
        return np.asarray(rows / whole)

    def _disks(self, points: Real) -> Real:
        laws = laws_at(self.loop.gains, points)
        return np.array([disk_of(gains @ self._circle[1:]).min() for gains in laws.T])

    def disk(self, law: HubFeedback) -> float:
        """The disk margin of one law, its lowest dips refined between the points of the circle."""
        row = np.array(law.row)
        return lowest_on_circle(lambda q: disk_of(row @ self._signals(q)), np.angle(self._circle[0]))

    # ------------------------------------------------------------ residual

    @cached_property
    def _with_angle(self) -> tuple[Real, Real, Real]:
        """Closed-loop matrices with the hub angle: without both gains, what 1 of each adds; the input."""
        bare = self._bare
        start = bare.matrix()
        by_each = np.array([bare.having(**{name: 1.0}).matrix() - start for name in PLANE])
        B = self.loop.pulse.matrices()[1]
        return start, by_each, np.pad(B, (0, len(start) - B.size))

    @cached_property
    def _measured_moment(self) -> Real:
        """The row that reads the root moment as the controller does, through the anti-alias filter."""
        return np.asarray(self.loop.pulse.matrices()[2][self.loop.in_z.signals.index("root_moment")])

    def _run(self, task: Scenario, points: Real, sense: Real) -> tuple[Real, Real]:
        """A root moment, as a row reads it of the states, and the input at the samples of a slew, (samples, gains)."""
        start, by_each, drive = self._with_angle
        (on_rate, on_moment), number = points, points.shape[1]
        A = start + on_rate[:, None, None] * by_each[0] + on_moment[:, None, None] * by_each[1]
        laws, references = laws_at(self.loop.gains, points), task.wanted
        kept, sense = self.loop.pulse.integrals_at + 2, np.pad(sense, (0, len(start) - sense.size))
        feedforward = task.feedforward[:, None]
        wanted = sum((row * each[:, None] for row, each in zip(laws, references.T, strict=True)), start=feedforward)
        x, (moment, u) = np.zeros((number, len(start), 1)), np.zeros((2, task.t.size, number))
        for k, push in enumerate(wanted):
            moment[k] = x[..., 0] @ sense
            x = A @ x + drive[:, None] * push[:, None, None]
            u[k] = x[:, kept, 0]
        return moment, u

    @cached_property
    def _slew(self) -> Scenario:
        return slew_and_after(self.loop.plant.arm, self.known, self.loop.chain)

    def residual(self, points: Real) -> Real:
        """Root mean square of the root moment less the rigid arm's [N m] over a period of the first mode after it."""
        task = self._slew
        moment, _ = self._run(task, points, self.loop.own_moment)
        return np.asarray(np.sqrt((task.residual(moment) ** 2).mean(axis=0)))

    def cost(self, points: Real) -> Real:
        """What the trial of the tuner costs with constant gains."""
        chain = self.loop.chain
        task = trial_slew(self.known, chain)
        moment, u = self._run(task, points, self._measured_moment)
        return slew_cost(task, chain, trial_weights(self.known, chain), moment, u)


def slew_and_after(arm: Arm, known: Arm, chain: Chain) -> Scenario:
    """The slew made for the arm `known`, and a period of the first mode of the one that moves."""
    left = max(2 * np.pi / first_frequency(arm), SAMPLES_LEFT * chain.sampling.period)
    return scenario("slew", known, chain, chain.slew.rise_time + left)


def simulated_residual(arm: Arm, law: AnyLaw, chain: Chain, known: Arm) -> float:
    """What `tfarm simulate` finds of that slew [N m], through the converters too; inf where it stops."""
    run, _ = simulated(*tracked(arm, law), chain, slew_and_after(arm, known, chain))
    left = residual_moment_rms(run)
    return np.inf if left is None else left


def trial_slew(known: Arm, chain: Chain) -> Scenario:
    """The slew of the tuner's trials, made for the arm `known`."""
    return scenario("slew", known, chain, TRIAL_SLEWS * chain.slew.rise_time)


def slew_cost(task: Scenario, chain: Chain, weights: tuple[float, float], moment: Real, u: Real) -> Real:
    """T sum of (a x^2 + b e^2)/2 of a slew whose root moment and input are (samples, n)."""
    (a, b), (x, e) = weights, slew_errors(task, chain, moment, u)
    return np.asarray(task.period * (a * x**2 + b * e**2).sum(axis=0) / 2)


def slew_errors(task: Scenario, chain: Chain, moment: Real, u: Real) -> tuple[Real, Real]:
    """x and e of the tuner's cost, from measured root moment and input (samples, n) at the samples of a slew."""
    return moment - task.moment_reference[:, None], u - (chain.slew.reading == "vibration") * task.feedforward[:, None]


def sampled_judges(
    arm: Arm, chain: Chain, objective: str, held: HubFeedback, modes: int, known: Arm | None = None
) -> Iterator[SampledJudge]:
    """Judges of 8 modes, of 16, ... up to as many as the loop has; without damping of as many as its verdict takes.

    `known`, if not the arm itself, is the one that slews are made for.
    """
    law = held.at(1.0, 0.5 * arm.input_per_torque)
    for count in mode_counts(arm, chain, modes):
        yield SampledJudge(sampled_loop(arm, law, chain, count=count), objective, modes, known or arm)


def mode_counts(arm: Arm, chain: Chain, modes: int) -> Iterator[int]:
    """Flexible modes of the first model, and of larger ones where what is best there does not hold."""
    if arm.has_elastic_link:
        yield UNDAMPED_MODES
        return
    most = most_modes(arm, chain)
    count = min(most, max(FEWEST_MODES, modes + FEWEST_MODES // 2))
    while count < most:
        yield count
        count *= 2
    yield most


def higher_poles(pulse: PulseTransfer, modes: int) -> list[complex]:
    """Open-loop poles in z, Im z >= 0, of the modes beyond the first ones: the highest come first."""
    places = np.nonzero((pulse.mode > modes) & (pulse.poles.imag >= 0))[0]
    z = pulse.multipliers[places[np.argsort(-pulse.mode[places], kind="stable")]]
    return [complex(each.real, abs(each.imag)) for each in z]


def first_damping(z: Complex, higher: list[complex]) -> Real:
    """The least damping ratio of the oscillating poles (gains, n), those of the `higher` modes left out."""
    z = np.where(of_first_modes(z, higher), z, 0.0)
    angle, seen = np.angle(z), z != 0
    s = np.log(np.where(seen, abs(z), 1.0)) + 1j * angle
    ratio = -s.real / np.where(seen, abs(s), 1.0)
    return np.asarray(np.where(seen & (angle > REAL_ANGLE), ratio, 1.0).min(axis=1))


def of_first_modes(z: Complex, higher: list[complex]) -> NDArray[np.bool_]:
    """Which poles (gains, n) are none of a higher mode: one of each pair, those about the `higher` ones left out."""
    left, rows = z.imag >= 0, np.arange(len(z))
    for own in higher:
        gap = np.where(left, abs(z - own), np.inf)
        near = left & (gap <= AS_NEAR * gap.min(axis=1, keepdims=True))
        left[rows, np.where(near, abs(z), np.inf).argmin(axis=1)] = False
    return np.asarray(left)


def circle_angles(pulse: PulseTransfer) -> Real:
    """Angles (0, pi] of the circle, dense about the poles of the open loop."""
    angle = abs(np.angle(pulse.multipliers))
    close = (angle[:, None] + np.r_[-POLE_OFFSETS, POLE_OFFSETS]).ravel()
    return np.unique(np.r_[np.linspace(0, np.pi, EVEN_ANGLES + 1)[1:], close[(close > 0) & (close <= np.pi)]])


def lowest_on_circle(values: Callable[[Real], Real], q: Real) -> float:
    """The least of a function of the angle on a grid, its lowest dips refined between the points."""
    found = values(q)
    best = [float(found.min())]
    for i in np.argsort(found)[:DIPS_REFINED]:
        ends = (q[max(i - 1, 0)], q[min(i + 1, q.size - 1)])
        done = minimize_scalar(
            lambda at: float(values(np.array([at]))[0]),
            bounds=ends, method="bounded", options={"xatol": 1e-9 * (ends[1] - ends[0])},
        )  # fmt: skip
        best.append(float(done.fun))
    return min(best)


def disk_of(L: Complex) -> Real:
    """2 |1 + L|/|1 - L|."""
    return np.asarray(2 * abs(1 + L) / np.maximum(abs(1 - L), LEAST_SIZE))
