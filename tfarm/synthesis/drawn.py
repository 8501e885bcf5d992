"""Laws for the arms of an ensemble: requirements that hold on few drawn arms, and their share on fresh ones.

The worst arm of a pool joins the arms of a design until none of the pool violates a requirement more (`for_the_worst`):
the law is as good as one for the whole pool, the sampled program of the scenario approach (Campi and Garatti, SIAM J.
Optimization 19, 2008).  No bound is taken from there, as the program is not convex.  The exact loops examine the law on
fresh arms, which are drawn independently of it; so the share of Clopper and Pearson is one of all arms.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.chain import CHAIN_TABLES
from tfarm.arm.checks import whole
from tfarm.case import Case
from tfarm.ensemble.confidence import least_share, least_share_words
from tfarm.ensemble.declaration import load_study
from tfarm.ensemble.space import Space, Subjects, listing_of, space_of
from tfarm.errors import require
from tfarm.fitting.posterior import load_posterior
from tfarm.records import frozen
from tfarm.schema import Percent, Quantity
from tfarm.spectrum.gains import default_gains
from tfarm.synthesis.goals import Checked, check
from tfarm.synthesis.required import RequiredLaw, RequirementTask
from tfarm.synthesis.worst_case import DrawnArms, NamedArm, Tell

# a path of a file, or the [over] of one
AnyStudy = str | os.PathLike[str] | Mapping[str, Mapping[str, Any]]


class LeastMargin(NamedTuple):
    """A requirement on the fresh arm that is nearest to its limit, or beyond it."""

    requirement: Annotated[str, Quantity("requirement", help="as after --require")]
    margin: Annotated[
        Percent | None,
        Quantity(
            "least margin", digits=3, help="to the limit, of that limit; none where the loop is not stable"
        ),
    ]
    sampled: Annotated[float | None, Quantity("sampled", digits=4, help="exact value of the sampled loop")]
    continuous: Annotated[
        float | None, Quantity("continuous-time", digits=4, help="of the continuous-time loop")
    ]
    arm: Annotated[str, Quantity("arm", help="row of the ensemble")]
    numbers: Annotated[dict[str, float], Quantity(help="drawn numbers of that arm, by key")]


@frozen
class Verification:
    """The exact loops of a law on fresh arms of an ensemble."""

    source: Annotated[str, Quantity("drawn from", help="study or posterior of the arms")]
    arms: Annotated[int, Quantity("fresh arms", help="arms for which the law was not designed")]
    met: Annotated[int, Quantity("requirements met", help="fresh arms on which all requirements are met")]
    at_least: Annotated[
        Percent | None,
        Quantity(help="least share of all arms, with 95 % confidence; of independent draws only"),
    ]
    margins: Annotated[
        tuple[LeastMargin, ...], Quantity("least margins", help="each requirement on its worst fresh arm")
    ]

    @property
    def finding(
        self,
    ) -> Annotated[
        str,
        Quantity("finding", key="in_words", help="share with its confidence, one-sided, Clopper-Pearson"),
    ]:
        """The share of the fresh arms that meet the requirements, with its confidence."""
        text = f"requirements met on {self.met} of {self.arms} arms"
        if self.at_least is None:
            return f"{text}; no confidence, as they are no independent draws"
        return f"{text}: {least_share_words(self.at_least)}"


def drawn_arms(
    arm: Arm,
    study: AnyStudy | None,
    posterior: str | os.PathLike[str] | None = None,
    fresh: int = 64,
    pool: int = 128,
) -> DrawnArms:
    """Return the arms of the file of a study, or of its table [over], and of the posterior of a fit.

    Of independent draws the fresh ones follow the pool; of a list or a grid every second row is in the pool.
    Raises ParameterError for a study of another arm, numbers that are none of the arm, and illegal arms.
    """
    most_fresh = 100_000
    fresh = whole("fresh arms", fresh, 1, most_fresh, f"a whole number from 1 to {most_fresh:,}")
    declared, source = _declared(arm, study, posterior)
    space = _space_of(declared)
    for key in space.keys:
        is_of_arm = key.partition(".")[0] not in (*CHAIN_TABLES, "law", "tuner")
        require(is_of_arm, "study", key, "a law is designed for numbers of the arm alone: leave this one out")
    numbers = np.arange(pool + fresh)
    own = slice(None, pool)
    others = slice(pool, None)
    if not space.is_independent:
        numbers = np.unique(np.linspace(0, space.count - 1, min(space.count, pool + fresh)).astype(int))
        own = slice(0, None, 2)
        others = slice(1, None, 2)
    require(numbers.size > 1, "study", space.count, "at least two arms: one to design for, and a fresh one")
    fitted = space.posterior.keys if space.posterior else ()
    rows = space.some_rows(numbers.tolist())
    subjects = Subjects(Case(arm, default_gains(arm)), space.keys, fitted).all_of(rows, numbers.tolist())
    found = [
        NamedArm(f"{arm.name}, row {n}", each.case.arm, dict(zip(space.keys, row, strict=True)))
        for n, each, row in zip(numbers.tolist(), subjects, rows.tolist(), strict=True)
    ]
    return DrawnArms(source, tuple(found[own]), tuple(found[others]), space.is_independent)


def _declared(
    arm: Arm, study: AnyStudy | None, posterior: str | os.PathLike[str] | None
) -> tuple[dict[str, Any], str]:
    """Return the arguments of a study, and the names of its files."""
    declared: dict[str, Any] = {}
    sources = []
    if isinstance(study, Mapping):
        declared["over"] = study
        sources.append(", ".join(study))
    elif study is not None:
        declared = load_study(os.fspath(study))
        own = declared["arm"]
        remedy = f"is a study of {own.name}, and the design is for another arm, {arm.name}: one arm has both"
        require(replace(own, theory=arm.theory) == arm, "study", os.fspath(study), remedy)
        sources.append(Path(study).name)
    if posterior is not None:
        has_none = not declared.get("posterior")
        require(
            has_none,
            "posterior",
            os.fspath(posterior),
            "the study has a posterior itself: leave this one out",
        )
        declared["posterior"] = posterior
        sources.append(Path(posterior).name)
    return declared, " and ".join(sources)


def _space_of(declared: Mapping[str, Any]) -> Space:
    """Return the space of the arguments of a study."""
    rows = declared.get("rows")
    posterior = declared.get("posterior")
    return space_of(
        declared.get("over") or {},
        draws=declared.get("draws", 1000),
        seed=declared.get("seed", 0),
        posterior=load_posterior(posterior) if posterior else None,
        listing=listing_of(Path(rows)) if rows else None,
    )


def verify(task: RequirementTask, choice: RequiredLaw, drawn: DrawnArms, tell: Tell) -> Verification:
    """Return the shares and margins of a law on the fresh arms, by the exact loops."""
    found: list[list[Checked]] = []
    for n, each in enumerate(drawn.fresh, 1):
        tell(f"requirements on fresh arm {n} of {len(drawn.fresh)}")
        rows, _ = check(choice.goal, task.arm, task.chain, each, choice.law)
        found.append(rows)
    met = sum(all(row.violation <= 0 for row in rows) for rows in found)
    share = None
    if drawn.is_independent:
        share = Percent(least_share(met, len(found)))
    numbers = {each.name: each.numbers for each in drawn.fresh}
    worst = [max(rows, key=attrgetter("violation")) for rows in zip(*found, strict=True)]
    margins = tuple(_least_margin(row, numbers[row.arm]) for row in worst)
    return Verification(drawn.source, len(found), met, share, margins)


def _least_margin(row: Checked, numbers: dict[str, float]) -> LeastMargin:
    """Return the margin of a requirement on an arm with these numbers."""
    margin = None
    if np.isfinite(row.violation):
        margin = Percent(-row.violation)
    return LeastMargin(row.requirement, margin, row.sampled, row.continuous, row.arm, numbers)
