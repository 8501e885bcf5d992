"""The verb of the tuner's studies.  Rooms are imported inside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from tfarm.cli.app import ArmName, Json, app, give, load_arm, whole_number
from tfarm.cli.sampling import asked_chain


@app.command()
def study(
    arm: ArmName,
    what: Annotated[str, typer.Argument(metavar="STUDY", help="curves, map, weights, inputs or rules")],
    seeds: Annotated[str, typer.Option("--seeds", metavar="N", help="initial weights for each point")] = "20",
    trials: Annotated[str, typer.Option("--trials", metavar="N", help="slews to learn from")] = "100",
    signals: Annotated[str | None, typer.Option("--signals", help="vibration or total; as the arm's file says")] = None,
    guard: Annotated[str, typer.Option("--guard", help="time-varying (proven), frozen or none")] = "time-varying",
    rule: Annotated[str, typer.Option("--rule", help="dynamic, clipped or plain")] = "dynamic",
    keep: Annotated[Path | None, typer.Option("--keep", help="file of results; a stopped study goes on there")] = None,
    json: Json = False,
) -> None:
    """Studies of the tuner on all cores: learning curves, the map of (alpha_c, eta_c), a and b, inputs, rules."""
    number, slews = whole_number("--seeds", seeds, 1, 10_000), whole_number("--trials", trials, 1, 1_000_000)
    subject, chain = load_arm(arm), asked_chain(arm, None, None)
    from tfarm.tuner import Learning
    from tfarm.tuner.studies import plans_of, run_study, study_answer
    from tfarm.tuner.tuning import usual_plan

    usual = usual_plan(subject, chain)
    base = replace(
        usual,
        learning=Learning(rule=cast("Any", rule)),
        signals=usual.signals if signals is None else cast("Any", signals),
        guard=cast("Any", guard),
        trials=slews,
    )
    plans = plans_of(what, base, number)
    from tfarm.cli.tables import progress
    from tfarm.cli.tuning_tables import print_study

    with progress() as advance:
        tell = None if advance is None else lambda done, total: advance(done, total, "tuning")
        answer = study_answer(what, run_study(subject, plans, chain, keep=keep, tell=tell), number)
    give(answer, json, print_study)
