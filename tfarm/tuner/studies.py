"""Studies: many tunings at once, on all cores, kept line by line in a file so that a stopped study goes on.

curves    learning curves over seeds: median and quartiles
map       final cost over (alpha_c, eta_c), with the paper's (0.6, 0.8), which it calls the best, and a verdict on that
weights   the effect of a and b of the cost
inputs    the seventh input K(t-1) beside the six
rules     plain (21) beside the two ways that make it robust, and learning online
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.writing import to_toml
from tfarm.arrays import Real
from tfarm.columns import JSON, TERMINAL, Column, Table
from tfarm.digits import general, singly
from tfarm.dsp import Chain
from tfarm.errors import ParameterError
from tfarm.files import read_file, write_file
from tfarm.records import record
from tfarm.tuner.guard import Guard, find_guard
from tfarm.tuner.network import initial_network
from tfarm.tuner.training import Mode, Rule, Sensitivity, Training, train
from tfarm.tuner.trial import Trial, residual_rms
from tfarm.tuner.tuning import Plan, Tuning, trial_of
from tfarm.tuner.yardsticks import BestConstant, best_constant

TellDone = Callable[[int, int], None]

ALPHAS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9)  # momentum factors of the map, about the paper's
ETAS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # learning rates, likewise
PAPER_PAIR = (0.6, 0.8)  # its momentum factor and learning rate
QUARTILES = (0.25, 0.75)  # of the runs of one plan, between which their spread is said
WEIGHT_PAIRS = ((1.0, 0.65), (1.0, 1.3), (1.0, 2.6), (1.0, 5.2), (1.0, 10.4), (0.25, 2.6), (4.0, 2.6))  # a, b
STUDIED_RULES: tuple[tuple[Rule, Mode, Sensitivity], ...] = (
    ("dynamic", "trial", "one-step"),
    ("clipped", "trial", "one-step"),
    ("plain", "trial", "one-step"),
    ("clipped", "online", "one-step"),
    ("plain", "online", "one-step"),
    ("clipped", "online", "whole"),
)
MOST_STUDY_BYTES = 1_000_000_000  # bytes of a file of results; a line has a few thousand
LINE_BEGINS = b'{"key": "'  # of every line that is kept


@dataclass(frozen=True)
@record
class Finished:
    """One tuning of a study: `costs` of its trials, then a trial with what was learnt.

    Where it ran away, its cost is inf and nothing is known of the `residual` root moment.
    """

    plan: Plan
    costs: list[float]
    cost: float
    residual: float | None
    mean_gain: float
    stopped: bool
    died: bool
    best_constant_gain: float
    best_constant_cost: float


@dataclass(frozen=True)
class _Ground:
    """What tunings that differ by learning and seed alone have in common."""

    trial: Trial
    guard: Guard
    best: BestConstant


def run_study(
    arm: Arm,
    plans: Iterable[Plan],
    chain: Chain | None = None,
    *,
    keep: Path | None = None,
    tell: TellDone | None = None,
    workers: int | None = None,
    tuned: Tuning | None = None,
) -> list[Finished]:
    """Each plan's tuning, in their order.  `keep` is a file of one JSON object a line that a second run starts from.

    `tell(done, all)` is called after each.  `tuned` is a tuning of this arm and chain, whose trial and guard serve
    where a plan has the same.  Raises what `tune` raises, and ParameterError for a file that is not a
    study's.
    """
    wanted = list(plans)
    keys = [_key(arm, chain, plan) for plan in wanted]
    known = _resumed(keep)
    todo = {key: plan for key, plan in zip(keys, wanted, strict=True) if key not in known}
    grounds = _grounds(arm, chain, todo.values(), tuned)
    done = len(keys) - len(todo)
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:  # the compiled loops let other threads run
        running = {pool.submit(_finished, grounds[_common(plan)], plan): key for key, plan in todo.items()}
        for future in as_completed(running):
            known[running[future]] = future.result()
            _append(keep, running[future], known[running[future]])
            done += 1
            if tell is not None:
                tell(done, len(keys))
    return [Finished(plan, **known[key]) for key, plan in zip(keys, wanted, strict=True)]


def _finished(ground: _Ground, plan: Plan) -> dict[str, Any]:
    network = initial_network(plan.seed, hidden=plan.hidden, scales=plan.scales)
    training: Training = train(ground.trial, network, ground.guard, plan.learning, plan.trials)
    gone = training.stopped is not None
    return {
        "costs": training.costs.tolist(),
        "cost": float("inf") if gone else training.result.cost,
        "residual": None if gone else residual_rms(training.result, ground.trial.task),
        "mean_gain": float(training.result.K.mean()),
        "stopped": gone,
        "died": training.died,
        "best_constant_gain": ground.best.gain,
        "best_constant_cost": ground.best.cost,
    }


def _grounds(arm: Arm, chain: Chain | None, plans: Iterable[Plan], tuned: Tuning | None) -> dict[str, _Ground]:
    """What each plan stands on, by `_common`; the trial and its best constant gain are the same for every guard."""
    grounds: dict[str, _Ground] = {}
    trials: dict[str, tuple[Trial, BestConstant]] = {}
    if tuned is not None:
        trials[_trial(tuned.plan)] = tuned.trial, tuned.best_constant
        grounds[_common(tuned.plan)] = _Ground(tuned.trial, tuned.training.guard, tuned.best_constant)
    for plan in plans:
        if _trial(plan) not in trials:
            trial = trial_of(arm, plan, chain)
            trials[_trial(plan)] = trial, best_constant(trial)
        if _common(plan) not in grounds:
            trial, best = trials[_trial(plan)]
            grounds[_common(plan)] = _Ground(trial, find_guard(trial.loop, plan.guard, best.gain), best)
    return grounds


def _common(plan: Plan) -> str:
    return f"{plan.guard} {_trial(plan)}"


def _trial(plan: Plan) -> str:
    return repr((plan.cost, plan.signals, plan.servo, plan.duration, plan.count))


# ---------------------------------------------------------------- what is kept


def _key(arm: Arm, chain: Chain | None, plan: Plan) -> str:
    text = "\n".join([to_toml(arm), repr(chain or Chain()), json.dumps(asdict(plan), default=repr)])
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _resumed(keep: Path | None) -> dict[str, Any]:
    """What an earlier run kept; a last line that was cut short is taken off the file."""
    if keep is None or not keep.exists():
        return {}
    content = read_file(keep, MOST_STUDY_BYTES, key="--keep", what="the file of a study")
    complete, _, cut = content.rpartition(b"\n")
    lines, known = complete.splitlines(), {}
    for i, line in enumerate([*lines, cut] if not LINE_BEGINS.startswith(cut[: len(LINE_BEGINS)]) else lines):
        try:
            entry = json.loads(line)
            known[entry["key"]] = {name: entry[name] for name in Finished.__dataclass_fields__ if name != "plan"}
        except (ValueError, KeyError, TypeError):
            remedy = f"line {i + 1} is no result of a study; give another file"
            raise ParameterError(key="--keep", value=str(keep), remedy=remedy) from None
    if cut:
        write_file(keep, complete + b"\n" * bool(complete), key="--keep")
    return known


def _append(keep: Path | None, key: str, result: dict[str, Any]) -> None:
    if keep is None:
        return
    try:
        with open(keep, "a", encoding="utf-8") as file:
            file.write(json.dumps({"key": key, **result}) + "\n")
    except OSError as error:
        raise ParameterError(key="--keep", value=str(keep), remedy=f"cannot be written ({error.strerror})") from None


# ---------------------------------------------------------------- which plans


def plans_of(study: str, base: Plan, seeds: int) -> list[Plan]:
    """The plans of a study by its name."""
    learning = base.learning
    known = {
        "curves": [base],
        "map": [replace(base, learning=replace(learning, alpha=alpha, eta=eta)) for alpha in ALPHAS for eta in ETAS],
        "weights": [replace(base, cost=replace(base.cost, a=a, b=b)) for a, b in WEIGHT_PAIRS],
        "inputs": [replace(base, seventh_input=seventh) for seventh in (False, True)],
        "rules": [
            replace(base, learning=replace(learning, rule=rule, mode=mode, sensitivity=sensitivity))
            for rule, mode, sensitivity in STUDIED_RULES
        ],
    }
    if study not in known:
        raise ParameterError(key="study", value=study, remedy=f"known are: {', '.join(known)}")
    return [replace(plan, seed=base.seed + i) for plan in known[study] for i in range(seeds)]


# ---------------------------------------------------------------- what came of them


def final_cost(group: list[Finished], share: float) -> float:
    """A quantile of the final costs over the seeds: always one of the costs."""
    return float(np.quantile([each.cost for each in group], share, method="nearest"))


def learning_costs(finished: list[Finished], trials: int) -> Real:
    """Costs (seeds, trials); a run that ended early counts as inf from there on."""
    costs = np.full((len(finished), trials), np.inf)
    for row, each in zip(costs, finished, strict=True):
        row[: len(each.costs)] = each.costs
    return costs


def _known(value: float | None) -> str:
    return "ran away" if value is None else general(value, 4)


_four = partial(Column, digits=singly(general, 4))
PLAN_COLUMNS = (  # what the seeds of a group have in common
    Column("alpha", "alpha", of=lambda group: group[0].plan.learning.alpha),
    Column("eta", "eta", of=lambda group: np.asarray(group[0].plan.learning.eta).tolist()),
    Column("a", "a", of=lambda group: group[0].plan.cost.a),
    Column("b", "b", of=lambda group: group[0].plan.cost.b),
    Column("inputs", "inputs", of=lambda group: group[0].plan.scales.size),
    Column("rule", "rule", of=lambda group: group[0].plan.learning.rule),
    Column("mode", "mode", of=lambda group: group[0].plan.learning.mode),
    Column("sensitivity", "sensitivity", of=lambda group: group[0].plan.learning.sensitivity),
)
GROUP_COLUMNS = (  # of the runs of one plan, a run a seed
    _four("cost_median", "median", of=lambda group: final_cost(group, 0.5)),
    Column("cost_quartiles", of=lambda group: [final_cost(group, share) for share in QUARTILES], on=(JSON,)),
    _four("", "lower quartile", of=lambda group: final_cost(group, QUARTILES[0]), on=(TERMINAL,)),
    _four("", "upper quartile", of=lambda group: final_cost(group, QUARTILES[1]), on=(TERMINAL,)),
    _four("cost_best", "best", of=lambda group: min(each.cost for each in group)),
    _four("cost_worst", "worst", of=lambda group: max(each.cost for each in group)),
    Column("below_best_constant", "below best constant", of=lambda group: _below(group),
           shown=lambda group: f"{_below(group)} of {len(group)}"),
    Column("best_constant_gain", of=lambda group: group[0].best_constant_gain, on=(JSON,)),
    Column("best_constant_cost", of=lambda group: group[0].best_constant_cost, on=(JSON,)),
    Column("mean_gain_median", of=lambda group: float(np.median([each.mean_gain for each in group])), on=(JSON,)),
    Column("residual_median", "residual", "N m", of=lambda group: _median_residual(group), digits=singly(_known)),
    Column("diverged", "diverged", of=lambda group: sum(each.stopped for each in group)),
    Column("died", "died", of=lambda group: sum(each.died for each in group)),
)  # fmt: skip


def _median_residual(group: list[Finished]) -> float | None:
    """Of the root moment left after the slew [N m]; None where half of the runs, or more, ran away."""
    left = [math.inf if each.residual is None else each.residual for each in group]
    found = float(np.quantile(left, 0.5, method="nearest"))
    return found if math.isfinite(found) else None


def _below(group: list[Finished]) -> int:
    return sum(each.cost < each.best_constant_cost for each in group)


def study_answer(study: str, results: list[Finished], seeds: int) -> dict[str, Any]:
    """A study's result: a group a plan, its seeds summed up by median and quartiles.

    On a terminal what all plans have in common is left out.
    """
    groups = [results[i : i + seeds] for i in range(0, len(results), seeds)]
    varied = (
        replace(column, on=(JSON, TERMINAL) if len(set(column.read(groups).cells)) > 1 else (JSON,))
        for column in PLAN_COLUMNS
    )
    table = Table(columns=(*varied, *GROUP_COLUMNS), record=groups)
    answer: dict[str, Any] = {"study": study, "seeds": seeds, "groups": table}
    if study == "curves":
        costs = learning_costs(results, max(len(each.costs) for each in results))
        low, middle, high = np.quantile(costs, [QUARTILES[0], 0.5, QUARTILES[1]], axis=0, method="nearest").tolist()
        answer |= {"median": middle, "lower_quartile": low, "upper_quartile": high}
    if study == "map":
        answer["verdict"] = map_verdict(groups)
    return answer


def map_verdict(groups: list[list[Finished]]) -> str:
    """Is the paper's (alpha_c, eta_c) the best of the map?  By medians, with the spread over the seeds beside it."""
    medians = np.array([final_cost(group, 0.5) for group in groups])
    at = [(group[0].plan.learning.alpha, group[0].plan.learning.eta) for group in groups]
    paper, best = at.index(PAPER_PAIR), int(np.argmin(medians))
    spread = [final_cost(groups[paper], share) for share in QUARTILES]
    rank = int((medians < medians[paper]).sum()) + 1
    quartiles = ", ".join(f"{cost:.4g}" for cost in spread)
    start = f"(alpha_c, eta_c) = {PAPER_PAIR}: median cost {medians[paper]:.4g} (quartiles {quartiles})"
    if rank == 1:
        return f"{start}, the best of {len(at)} points"
    within = "within" if medians[best] >= spread[0] else "beyond"
    return (
        f"{start}, rank {rank} of {len(at)}; best {at[best]} with {medians[best]:.4g}, {within} the paper's quartiles"
    )
