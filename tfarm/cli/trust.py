"""The verbs that say why an answer can be trusted."""

from __future__ import annotations

from typing import Annotated

import typer

from tfarm.cli.app import ArmName, Json, app, give, load_arm, say_when_compiling, whole_number


@app.command()
def audit(json: Json = False) -> None:
    """Every equation of the paper, as printed and as corrected, with the check that tells them apart."""
    say_when_compiling()
    from tfarm.audit import audit_answer
    from tfarm.cli.tables import print_audit

    give(audit_answer(), json, print_audit)


@app.command()
def assumptions(
    arm: ArmName,
    count: Annotated[str, typer.Option("--count", metavar="N", help="flexible modes, 1 to 100")] = "4",
    json: Json = False,
) -> None:
    """What the assumed section and hub do: frequencies over the candidates, with exact sensitivities."""
    wanted = whole_number("--count", count, 1, 100)
    subject = load_arm(arm)
    from tfarm.audit.candidates import assumptions_answer
    from tfarm.cli.tables import print_assumptions

    give(assumptions_answer(subject, wanted), json, print_assumptions)


@app.command()
def validate(json: Json = False) -> None:
    """Natural frequencies of published tables beside the exact ones, and why where they differ."""
    say_when_compiling()
    from tfarm.audit.published import validate_answer
    from tfarm.cli.tables import print_validation

    give(validate_answer(), json, print_validation)
