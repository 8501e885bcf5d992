"""Objectives and one judge of laws: stability with a reserve in a loop of few modes, and the scores of laws in it.

damping       least damping ratio of the oscillating poles of the first modes
margin        disk margin min 2 |1 + L|/|1 - L|; of nearly equal ones that with more damping
sensitivity   max |S|, S = 1/(1 + L)
delay         least further delay [s] that turns L to -1 where |L| = 1: (pi + arg L)/w; of laws that reach the longest
              one looked for that with most damping
residual      root mean square of the arm's own root moment less the rigid arm's, over a period of the first mode after
              the slew
cost          T sum of (a x^2 + b e^2)/2 over a slew, the tuner's: x as the controller reads it, e what is added

Where two poles are nearly as close to that of a higher mode, the one with more decay is taken for it, so that damping
is not overestimated.

A design is for the sampled loop or for the continuous-time one.  In the sampled one all poles are stable also with
every gain a quarter larger and smaller, and in continuous time: the best damping of few modes is often next to the
instability of a higher one.  The result is checked by the exact verdicts; a model is only for the search.
"""

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.blocks import Rational
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.dsp.plant import arm_under_chain
from tfarm.dsp.results import simulate_modes
from tfarm.errors import ConvergenceError, require
from tfarm.loop.edges import LowerBound, most_modes
from tfarm.loop.loop_margins import lowest
from tfarm.loop.sampled_verdict import UNDAMPED_MODES, sampled_verdict
from tfarm.loop.stability import stability
from tfarm.records import frozen
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.models import DesignModel, continuous_model, sampled_model
from tfarm.synthesis.slew_models import Slews, slew_and_after
from tfarm.synthesis.structures import Entry, polynomial_of

# factor on all gains with which the loop is stable, up and down: the error of a gauge or motor
RESERVE = 1.25
# score where a loop is unstable, and as much for each later condition: above any value in SI units
LOST = 1e30
# score where a law is slower than allowed: above the value of every objective with that condition
TOO_SLOW = 1e6


def damping_of(model: DesignModel, poles: Complex) -> Real:
    """Return the least damping ratio (laws,) of oscillating poles (laws, n); 1 where a law has none.

    One of each pair counts.  The poles nearest to those of `higher` modes are left out.
    """
    s = model.in_s(poles)
    counted = poles.imag >= 0
    rows = np.arange(len(poles))
    for own in model.higher:
        gap = np.where(counted, abs(poles - own), np.inf)
        # up to four times the least distance a pole may be this one too
        near = counted & (gap <= 4.0 * gap.min(axis=1, keepdims=True))
        counted[rows, np.where(near, abs(poles), np.inf).argmin(axis=1)] = False
    # at a smaller angle [rad], of ln z or s, a pole is real
    counted &= (np.angle(poles) > 1e-9) & (poles != 0) & (s.imag < model.band)
    return np.where(counted, -s.real / np.maximum(abs(s), LEAST_SIZE), 1.0).min(axis=1, initial=1.0)


def dominant_time_constant(model: DesignModel, poles: Complex, first: float) -> Real:
    """Return the time constant [s] (laws,) of the slowest pole below twice the `first` frequency [rad/s].

    Modes above ring on at their own small damping, which no law of few coefficients changes.  Where no pole is below,
    the nearest to 0 counts.
    """
    s = model.in_s(poles) / (model.period or 1.0)
    counted = np.ones(s.shape, dtype=bool)
    rows = np.arange(len(s))
    for own in model.higher:
        # of sampled modes that alias to lower frequencies
        gap = np.where(counted & (poles.imag >= 0), abs(poles - own), np.inf)
        counted[rows, gap.argmin(axis=1)] = False
    counted &= (s.imag >= 0) & (poles != 0)
    size = np.where(counted, abs(s), np.inf)
    reach = np.maximum(2.0 * first, size.min(axis=1, keepdims=True))
    rate = np.where(size <= reach, -s.real, np.inf).min(axis=1)
    return 1 / np.maximum(rate, LEAST_SIZE)


def slowest_allowed(arm: Arm, period: float) -> float:
    """Return the longest dominant time constant [s] of a law: four periods of mode 1, or 50 samples."""
    return max(4 * 2 * np.pi / first_frequency(arm), 50 * period)


def disk_of(L: Complex) -> Real:
    """Return 2 |1 + L|/|1 - L|."""
    return 2 * abs(1 + L) / np.maximum(abs(1 - L), LEAST_SIZE)


def delay(model: DesignModel, L: Complex) -> Real:
    """Return the delay [s] that turns L to -1 where |L| passes 1, along straight lines between points of the grid.

    A law is without limit where `RESERVE` L passes 1 nowhere either: a resonance peaks between two points of the grid.
    """
    late = _passing_delay(model, gain_crossings(L), len(L))
    longest = np.flatnonzero(late >= longest_delay(model))
    if longest.size:
        late[longest] = _passing_delay(model, gain_crossings(RESERVE * L[longest]), longest.size)
    return late


def longest_delay(model: DesignModel) -> float:
    """Return the longest delay [s] that is looked for: 100 samples, or 100 s; that where |L| is nowhere 1."""
    return 100.0 * (model.period or 1.0)


def _passing_delay(model: DesignModel, crossings: "GainCrossings", laws: int) -> Real:
    """Return that delay [s] by the passages between points of the grid alone, at most the longest."""
    q = model.angles
    n = crossings.place
    late = crossings.lag / (q[n] + crossings.share * (q[n + 1] - q[n]))
    return least_of(crossings.law, (model.period or 1.0) * late, laws, longest_delay(model))


class GainCrossings(NamedTuple):
    """Passages of |L| through 1 of many laws: number of the `law`, and point of the grid before, each (k,).

    The `share` of the way to the next point and the `lag` to -1 [rad], in [0, 2 pi), are along straight lines.
    """

    law: Any
    place: Any
    share: Real
    lag: Real


def gain_crossings(L: Complex) -> GainCrossings:
    """Return the passages of |L| (laws, m) through 1 between two points of the grid."""
    is_above = L.real**2 + L.imag**2 > 1.0
    law, place = np.nonzero(is_above[:, 1:] != is_above[:, :-1])
    here = L[law, place]
    there = L[law, place + 1]
    size = np.log(np.maximum(abs(here), LEAST_SIZE))
    share = size / (size - np.log(np.maximum(abs(there), LEAST_SIZE)))
    step = np.angle(there * here.conj())
    return GainCrossings(law, place, share, np.mod(np.pi + np.angle(here) + share * step, 2 * np.pi))


def least_of(law: Any, values: Real, laws: int, most: float) -> Real:
    """Return the least of the values (k,) of each law (laws,), at most `most`."""
    found = np.full(laws, most)
    np.minimum.at(found, law, values)
    return found


def peak_of(model: DesignModel, distance: Any) -> Any:
    """Return the largest |S| of the least |1 + L|; in continuous time at least 1, as L -> 0 beyond the grid."""
    least = 1.0 if model.period is None else 0.0
    return np.maximum(1 / np.maximum(distance, LEAST_SIZE), least)


class Objective(NamedTuple):
    """Its `scores` (laws,), small where laws are good, and the `value` of one law by a judge.

    Scores are of a judge, the entries of laws, and if `of_poles` of their poles (laws, n) in its model.  `is_negated`:
    whether the value is the negated score; `of_slew`: whether it is of a slew; `needs_speed`: whether it is best
    without a controller, so that only laws count that are as fast as `slowest_allowed`.
    """

    scores: Callable[[Any, Sequence[Entry], Any], Real]
    value: Callable[[Any, AnyLaw], float]
    is_negated: bool = False
    of_slew: bool = False
    of_poles: bool = False
    needs_speed: bool = False

    def aims(self, judge: Any, entries: Sequence[Entry], limits: Real) -> Real:
        """Return the objective by the judge's own model alone; of its poles `LOST` and more where one is unstable."""
        if not self.of_poles:
            # slews of unstable laws
            with np.errstate(all="ignore"):
                return np.nan_to_num(self.scores(judge, entries, None), nan=np.inf)
        poles = judge.model.poles(entries)
        growth = judge.model.growth(poles).max(axis=1)
        scores = lost(1, growth)
        stable = growth < 0
        if stable.any():
            scores[stable] = self.scores(judge, of_laws(entries, stable), poles[stable])
            if self.needs_speed:
                slow = dominant_time_constant(judge.model, poles[stable], first_frequency(judge.arm))
                excess = slow / slowest_allowed(judge.arm, judge.chain.sampling.period)
                scores[stable] += np.where(excess > 1, TOO_SLOW * excess, 0.0)
        return scores

    def within_one_per_cent(self, score: float) -> float:
        """Return the score of a value one per cent worse."""
        return score + 0.01 * abs(score)

    def words(self, score: float) -> str:
        """Return a score as a value."""
        return f"{-score if self.is_negated else score:.6g}"

    def worst(self, values: Sequence[float]) -> float:
        """Return the worst of its values."""
        return min(values) if self.is_negated else max(values)


@frozen
class Judge:
    """The objective of laws on an arm, by a `model` of few modes; the models `also` have to be stable, too.

    Slews are those of the arm `known`, by its model `nominal` where that is another arm.
    """

    arm: Arm
    known: Arm
    chain: Chain
    objective: Objective
    model: DesignModel
    also: tuple[DesignModel, ...]
    delayed: tuple[DesignModel, ...] = ()
    nominal: DesignModel | None = None

    @property
    def is_sampled(self) -> bool:
        """Whether the loop is the sampled one."""
        return self.model.period is not None

    @cached_property
    def slews(self) -> Slews:
        """The slews of the model."""
        return Slews(self.model, self.arm, self.known, self.chain, self.nominal or self.model)

    @cached_property
    def conditions(self) -> list[tuple[DesignModel, float]]:
        """The models that have to be stable, each with a factor on the law: most unstable laws fail the first.

        An objective of poles has the model itself.
        """
        # edges of the model's few modes have a smaller error
        reserve = 1.002 * RESERVE
        found = []
        if self.is_sampled:
            found += [(self.model, reserve), (self.model, 1 / reserve)]
        if not self.objective.of_poles:
            found.append((self.model, 1.0))
        return found + [(each, 1.0) for each in self.also]

    def case(self, law: AnyLaw) -> Case:
        """Return the case of a law on the arm."""
        return Case(self.arm, law, self.chain)

    # ------------------------------------------------------------ in the model

    def entries(self, law: AnyLaw) -> list[Entry]:
        """Return the entries of a law of rational blocks, one for each signal."""
        entries = []
        for part in self.case(law).law.parts:
            block = part.block
            if isinstance(block, Rational):
                entries.append(Entry(part.signals[0], polynomial_of(*block.num), polynomial_of(*block.den)))
        return entries

    def score(self, law: AnyLaw) -> float:
        """Return the function to be minimised, of one law."""
        return float(scores_of([self], self.entries(law), np.array([np.inf]))[0])

    # ------------------------------------------------------------ beyond it

    def value(self, law: AnyLaw) -> float:
        """Return the objective of one law, by the best available method."""
        return self.objective.value(self, law)

    def disk_margin(self, law: AnyLaw) -> float:
        """Return the disk margin, between the points of the grid too."""
        return self._lowest(law, disk_of)

    def peak_sensitivity(self, law: AnyLaw) -> float:
        """Return the largest |S|, likewise."""
        return float(peak_of(self.model, self._lowest(law, lambda L: np.asarray(abs(1 + L)))))

    def _lowest(self, law: AnyLaw, of: Callable[[Complex], Real]) -> float:
        """Return the least of a function of the loop function."""
        entries = self.entries(law)
        return lowest(lambda angles: of(self.model.loop(entries, angles)[0]), self.model.angles)[0]

    def exact_damping(self, law: AnyLaw) -> float:
        """Return the least damping ratio; of the continuous-time loop that of its exact poles."""
        if self.is_sampled:
            return -self.score(law)
        s = stability(self.case(law), self.model.band).poles.values
        s = s[(s.imag > 0) & (s.imag < self.model.band)]
        return float((-s.real / abs(s)).min(initial=1.0))

    def delay_margin(self, law: AnyLaw) -> float:
        """Return the delay margin [s] by the model; a lower bound where it is the longest that is looked for."""
        late = float(delay(self.model, self.model.loop(self.entries(law)))[0])
        return late if late < longest_delay(self.model) else LowerBound(late)

    def simulated_residual(self, law: AnyLaw) -> float:
        """Return the residual of `tfarm simulate` after the slew [N m], with the converters; inf where it stops."""
        if not self.is_sampled:
            return self.score(law)
        case = self.case(law)
        run, _ = simulate_modes(case, slew_and_after(case.arm, self.known, case.chain, law))
        return np.inf if run.residual_moment is None else run.residual_moment

    def is_confirmed(self, law: AnyLaw, score: float) -> bool:
        """Return whether the residual of a shaped slew is as simulated: impulses jump where a mode gets overdamped."""
        if self.chain.reference.shaper == "none" or not self.objective.of_slew:
            return True
        return self.value(law) <= self.objective.within_one_per_cent(score)

    def is_stable(self, law: AnyLaw) -> bool:
        """Return whether the loop is stable by the exact verdicts, when sampled also with a reserve."""
        try:
            if not stability(self.case(law)).is_stable:
                return False
            shares = (1.0, 1 / RESERVE, RESERVE) if self.is_sampled else ()
            return all(sampled_verdict(self.case(law.times(share))).is_stable for share in shares)
        except ConvergenceError:
            # a pole on the axis or the circle
            return False


def delay_score(judge: Judge, entries: Sequence[Entry], poles: Complex) -> Real:
    """Return minus the delay margin, at the longest one times 1 + damping ratio, which decides among such laws."""
    late = delay(judge.model, judge.model.loop(entries))
    is_longest = late >= longest_delay(judge.model)
    return np.where(is_longest, -late * (1 + damping_of(judge.model, poles)), -late)


def disk_score(judge: Judge, entries: Sequence[Entry], poles: Complex) -> Real:
    """Return minus the disk margin and a little of the damping: without sampling all rate feedback has margin 2."""
    return -disk_of(judge.model.loop(entries)).min(axis=1) - 1e-3 * damping_of(judge.model, poles)


OBJECTIVES = {
    "damping": Objective(
        lambda judge, entries, poles: -damping_of(judge.model, poles),
        Judge.exact_damping,
        is_negated=True,
        of_poles=True,
    ),
    "margin": Objective(disk_score, Judge.disk_margin, is_negated=True, of_poles=True, needs_speed=True),
    "sensitivity": Objective(
        lambda judge, entries, _: peak_of(judge.model, abs(1 + judge.model.loop(entries)).min(axis=1)),
        Judge.peak_sensitivity,
        of_poles=True,
        needs_speed=True,
    ),
    "delay": Objective(delay_score, Judge.delay_margin, is_negated=True, of_poles=True, needs_speed=True),
    "residual": Objective(
        lambda judge, entries, _: judge.slews.residual(entries), Judge.simulated_residual, of_slew=True
    ),
    "cost": Objective(lambda judge, entries, _: judge.slews.cost(entries), Judge.score, of_slew=True),
}


def model_sizes(arm: Arm, chain: Chain, modes: int, *, continuous: bool) -> list[int]:
    """Return numbers of flexible modes of the models of a search, in turn until the best law is stable.

    Without damping there is one, that of the sampled verdict.
    """
    # of the first model; more where its best laws are unstable
    fewest_modes = 8
    fewest = modes + fewest_modes // 2
    if continuous:
        return [max(fewest_modes, fewest)]
    if arm.has_elastic_link:
        return [max(UNDAMPED_MODES, fewest)]
    # with twice as many modes a law takes eight times as long
    most = min(most_modes(arm, chain), 32)
    sizes = []
    size = max(fewest_modes, fewest)
    while size < most:
        sizes.append(size)
        size *= 2
    return [*sizes, most]


# those of the arms inside a box, which are the same in each exchange
@lru_cache(64)
def judge_of(
    arm: Arm,
    known: Arm,
    chain: Chain,
    objective: Any,
    signals: tuple[str, ...],
    modes: int,
    count: int,
    *,
    continuous: bool = False,
) -> Judge:
    """Return the judge of laws on these signals, with `count` flexible modes; more of the continuous-time loop."""
    aim = OBJECTIVES[objective] if isinstance(objective, str) else objective
    if aim.of_slew and "root_moment" not in signals:
        signals = (*signals, "root_moment")
    nominal = None
    if aim.of_slew and known != arm and chain.reference.shaper != "none" and not continuous:
        nominal = judge_of(known, known, chain, objective, signals, modes, count).model
    known, _ = arm_under_chain(known, chain)
    arm, chain = arm_under_chain(arm, chain)
    speed = 2 / chain.sampling.period
    if continuous:
        # an error in a search would be lost
        own = (chain.reference.profile, chain.reference.shaper, chain.reference.feedforward)
        remedy = "the continuous-time residual is that of a bang-bang slew without a shaper: leave them out"
        require(not aim.of_slew or own == ("bang-bang", "none", "rigid"), "reference", " ".join(own), remedy)
        model = continuous_model(arm, signals, modes, 2 * count, speed)
        return Judge(arm, known, chain, aim, model, ())
    model = sampled_model(arm, chain, signals, modes, count)
    also = (continuous_model(arm, signals, modes, count, speed),)
    return Judge(arm, known, chain, aim, model, also, nominal=nominal)


def lost(stage: int, growth: Real) -> Real:
    """Return scores of laws with a growth (laws,) of their fastest pole, above those of laws lost later."""
    return LOST * (stage + growth / (1 + abs(growth)))


def scores_of(judges: Sequence[Judge], entries: Sequence[Entry], limits: Real) -> Real:
    """Return the largest score of laws by any judge; `LOST` and more where a loop is unstable.

    A law whose score is above its one of the `limits` (laws,) may have any value above it.  Where the limit is the
    score of a stable law, the objective is first: most laws have lost by it.
    """
    scores = np.full(limits.size, -np.inf)
    _add_aims(judges, entries, limits < LOST, scores, limits)
    left = np.flatnonzero(scores <= limits)
    conditions = [each for judge in judges for each in judge.conditions]
    for stage, (model, share) in enumerate(conditions, -len(conditions)):
        if left.size:
            growth = model.growth(model.poles(of_laws(entries, left), share)).max(axis=1)
            scores[left[growth >= 0]] = lost(1 - stage, growth[growth >= 0])
            left = left[growth < 0]
    _add_aims(judges, entries, np.isneginf(scores), scores, limits)
    return scores


def _add_aims(
    judges: Sequence[Judge], entries: Sequence[Entry], which: Any, scores: Real, limits: Real
) -> None:
    """Raise the scores of some laws to their objective by each judge in turn, up to their limits."""
    for judge in judges:
        left = np.flatnonzero(which & (scores <= limits) & (scores < LOST))
        if left.size:
            scores[left] = np.maximum(
                scores[left], judge.objective.aims(judge, of_laws(entries, left), limits[left])
            )


def of_laws(entries: Sequence[Entry], laws: Any) -> list[Entry]:
    """Return the entries of some of the laws."""
    return [each.of_laws(laws) for each in entries]
