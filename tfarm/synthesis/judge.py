"""One judge of laws: whether a loop of few modes holds with a reserve, and what the laws are worth in it.

A design is for the sampled loop or, without sampling, for the continuous one.  In the sampled one all poles are stable
with every gain a quarter larger and smaller, too, and without sampling: the best damping of few modes often lies where
a higher one is about to grow.  What wins is judged once more by the exact verdicts; a model only says where to look.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tfarm.arm import AnyLaw, Arm, as_law, tracked
from tfarm.arm.blocks import Rational
from tfarm.arrays import Complex, Real
from tfarm.dsp import Chain, sampled_verdict
from tfarm.dsp.edges import most_modes
from tfarm.dsp.results import residual_moment_rms, simulated
from tfarm.dsp.verdict import UNDAMPED_MODES
from tfarm.errors import ConvergenceError
from tfarm.loop.stability import stability
from tfarm.records import record
from tfarm.synthesis.models import Model, continuous_model, sampled_model
from tfarm.synthesis.objectives import OBJECTIVES, Objective, Reading, lowest
from tfarm.synthesis.slews import Slews, slew_and_after
from tfarm.synthesis.structures import Entry, Structure

RESERVE = 1.25  # the loop holds with all its gains larger or smaller by this factor: what a gauge or motor is off by
SEARCH_RESERVE = 1.002 * RESERVE  # by as much in the search: the model's few modes have edges that are off by less
FEWEST_MODES = 8  # of the first model; more where its best laws do not hold
CONTINUOUS_TIMES = 2  # as many where the continuous loop is designed: two poles that meet double few digits
LAWS_AT_ONCE = 256  # memory, whatever the number of laws
LOST = 1e3  # score where a condition of stability is not met, and as much for each later one


@dataclass(frozen=True)
@record
class Judge:
    """What laws are worth on an arm, by a `model` of few modes; the models `also` have to be stable, too.

    Slews are made for the arm `known`, and damping is that of the first `modes` modes.
    """

    arm: Arm
    known: Arm
    chain: Chain
    objective: str
    modes: int
    model: Model
    also: tuple[Model, ...]

    @property
    def is_sampled(self) -> bool:
        """Whether the loop is the sampled one."""
        return self.model.period is not None

    @property
    def aim(self) -> Objective:
        """The objective."""
        return OBJECTIVES[self.objective]

    @cached_property
    def slews(self) -> Slews:
        """The slews of the model."""
        return Slews(self.model, self.arm, self.known, self.chain)

    @property
    def _conditions(self) -> list[tuple[Model, float]]:
        """What has to be stable, and a factor on the law: most of what is not fails the first, the last is the loop."""
        shares = (SEARCH_RESERVE, 1 / SEARCH_RESERVE) if self.is_sampled else ()
        return [*((self.model, share) for share in shares), *((each, 1.0) for each in self.also), (self.model, 1.0)]

    # ------------------------------------------------------------ in the model

    def scores(self, form: Structure, x: Real) -> Real:
        """What is minimised, at points x (n, laws); `LOST` and more where the loop does not hold with the reserve."""
        parts = [x[:, i : i + LAWS_AT_ONCE] for i in range(0, x.shape[1], LAWS_AT_ONCE)]
        return np.concatenate([self.scores_of(form.entries(form.coefficients(part)), part.shape[1]) for part in parts])

    def score(self, law: AnyLaw) -> float:
        """The same of one law."""
        return float(self.scores_of(entries_of(law), 1)[0])

    def scores_of(self, entries: Sequence[Entry], number: int) -> Real:
        """The same of the entries of so many laws."""
        scores, alive, poles, conditions = np.empty(number), np.arange(number), np.empty(0, complex), self._conditions
        for left, (model, share) in zip(range(len(conditions), 0, -1), conditions, strict=True):
            poles = model.poles(entries, share)
            growth = model.growth(poles).max(axis=1)
            held = growth < 0.0
            scores[alive[~held]] = LOST * (left + growth[~held] / (1 + growth[~held]))
            alive, poles, entries = alive[held], poles[held], chosen(entries, held)
            if not alive.size:
                return scores
        scores[alive] = self.aim.scores(Reading(self.model, self.slews, entries, poles))
        return scores

    # ------------------------------------------------------------ beyond it

    def value(self, law: AnyLaw) -> float:
        """The objective of one law, as exactly as it is known."""
        return self.aim.value(self, law)

    def lowest(self, law: AnyLaw, of: Callable[[Complex], Real]) -> float:
        """The least of a function of the loop function, between the points of the grid too."""
        return lowest(self.model, entries_of(law), of)

    def peak(self, law: AnyLaw) -> float:
        """The largest |S|; in continuous time at least 1."""
        largest = 1 / self.lowest(law, lambda L: np.asarray(abs(1 + L)))
        return largest if self.is_sampled else max(1.0, largest)

    def exact_damping(self, law: AnyLaw) -> float:
        """The least damping ratio: of the continuous loop that of its exact poles."""
        if self.is_sampled:
            return -self.score(law)
        s = stability(self.arm, law, self.model.band).poles.values
        s = s[(s.imag > 0) & (s.imag < self.model.band)]
        return float((-s.real / abs(s)).min(initial=1.0))

    def simulated_residual(self, law: AnyLaw) -> float:
        """What `tfarm simulate` finds of the slew [N m], through the converters too; inf where it stops."""
        if not self.is_sampled:
            return self.score(law)
        run, _ = simulated(*tracked(self.arm, law), self.chain, slew_and_after(self.arm, self.known, self.chain))
        left = residual_moment_rms(run)
        return np.inf if left is None else left

    def holds(self, law: AnyLaw) -> bool:
        """Whether the loop is stable by the exact verdict, when sampled with a reserve, too."""
        shares = (1.0, 1 / RESERVE, RESERVE) if self.is_sampled else ()
        try:
            return stability(self.arm, law).is_stable and all(
                sampled_verdict(self.arm, law.times(share), self.chain).is_stable for share in shares
            )
        except ConvergenceError:  # on the edge
            return False


def judges_of(
    arm: Arm, known: Arm, chain: Chain, objective: str, form: Structure, modes: int, *, continuous: bool
) -> Iterator[Judge]:
    """Judges of the laws of a structure on an arm, of ever more modes."""
    counts = mode_counts(arm, chain, modes) if not continuous else iter((max(FEWEST_MODES, modes + FEWEST_MODES // 2),))
    for count in counts:
        yield judge_of(arm, known, chain, objective, form.signals, modes, count, continuous=continuous)


def judge_of(
    arm: Arm, known: Arm, chain: Chain, objective: str, signals: tuple[str, ...], modes: int, count: int, *,
    continuous: bool = False,
) -> Judge:  # fmt: skip
    """The judge of laws that read these signals, with `count` flexible modes; more of the continuous loop."""
    if OBJECTIVES[objective].of_slew and "root_moment" not in signals:
        signals = (*signals, "root_moment")
    own = continuous_model(
        arm, signals, modes, (CONTINUOUS_TIMES if continuous else 1) * count, 2 / chain.sampling.period
    )
    models = [own] if continuous else [sampled_model(arm, chain, signals, modes, count), own]
    return Judge(arm, known, chain, objective, modes, models[0], tuple(models[1:]))


def mode_counts(arm: Arm, chain: Chain, modes: int) -> Iterator[int]:
    """Flexible modes of the first model, and of larger ones where what is best there does not hold.

    Without damping as many as the sampled verdict takes.
    """
    if arm.has_elastic_link:
        yield max(UNDAMPED_MODES, modes + FEWEST_MODES // 2)
        return
    most = most_modes(arm, chain)
    count = min(most, max(FEWEST_MODES, modes + FEWEST_MODES // 2))
    while count < most:
        yield count
        count *= 2
    yield most


def chosen(entries: Sequence[Entry], rows: Real) -> list[Entry]:
    """The entries of some of the laws; what all laws have in common stays."""
    return [
        Entry(each.signal, *(of[:, rows] if of.shape[1] > 1 else of for of in (each.num, each.den))) for each in entries
    ]


def entries_of(law: AnyLaw) -> list[Entry]:
    """The entries of a law of rational blocks, one for each signal."""
    parts = as_law(law).parts
    blocks = [(part.signals[0], part.block) for part in parts if isinstance(part.block, Rational)]
    return [Entry(name, np.array(block.num)[:, None], np.array(block.den)[:, None]) for name, block in blocks]
