"""The verbs that say why an answer can be trusted."""

from __future__ import annotations

from tfarm.cli.app import Json, app


@app.command()
def audit(json: Json = False) -> None:
    """Every equation of the paper, as printed and as corrected, with the check that tells them apart."""
    from tfarm.audit import audit_answer

    answer = audit_answer()
    if json:
        from tfarm.cli.answers import to_json

        print(to_json(answer))
    else:
        from tfarm.cli.tables import print_audit

        print_audit(answer)
