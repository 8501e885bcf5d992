"""The file of a page's arm, and the command that writes the page again."""

import shlex
from contextlib import suppress

from tfarm.arm.chain import file_text
from tfarm.arm.writing import law_toml
from tfarm.errors import ParameterError
from tfarm.report.blocks import argument
from tfarm.report.page import ArmReport, is_preset


def file_of(report: ArmReport) -> str:
    """Return the arm's file with its chain, and with the law that the page is about where TOML can say that alone."""
    law = own_law(report)
    if law is None:
        return file_text(report.arm, report.chain)
    return f"{file_text(report.cases[0].arm, report.chain)}\n{law}"


def own_law(report: ArmReport) -> str | None:
    """Return the table [law] of the one law of a page; None of none or several, or of one with files of its own."""
    with suppress(ParameterError):
        if len(report.laws) == 1 and report.laws[0].measured is None:
            return law_toml(report.cases[0].law)
    return None


def command_of(report: ArmReport, only: str) -> str:
    """The command that writes this page; an arm that is no preset is named by its file, as are laws with theirs."""
    law = own_law(report)
    options = [] if law is not None else [f"--law {shlex.quote(each.file or 'FILE')}" for each in report.laws]
    options += [f"--measured {shlex.quote(f'{each.name}={each.source}')}" for each in report.measured]
    options += [f"--only {only}"] * bool(only) + ["--paper"] * report.is_paper
    name = argument(report.arm.name, law is None and is_preset(report.arm, report.chain))
    return " ".join(["tfarm report", name, *options, "--out reports"])
