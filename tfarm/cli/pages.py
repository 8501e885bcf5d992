"""The commands that write pages, give evidence, and help with the others."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.completion import get_completion_script  # type: ignore[attr-defined]  # Typer does not list it

import tfarm
from tfarm.cli.app import add_command, app
from tfarm.cli.options import (
    ArmName,
    LawFiles,
    TheoryName,
    chain_of_options,
    gains_of_options,
    law_of_options,
    load_arm,
    preset_names,
    read_arms,
)
from tfarm.cli.output import emit_record
from tfarm.cli.progress import advance, print_line
from tfarm.errors import must_be_known

command = partial(add_command, "Report")
proof = typer.Typer(help="Audit of the paper, published tables, assumptions, glossary.")
app.add_typer(proof, name="proof", rich_help_panel="Report")
proof_command = partial(add_command, None, proof)


@proof.callback(invoke_without_command=True)
def print_proofs(context: typer.Context) -> None:
    """Print the commands, where none of them is given."""
    if context.invoked_subcommand is None:
        print(context.get_help())


@command(epilog="report sasaki2012-lab --out pages")
def report(
    *,
    arms: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[ARM ...]", help="presets or files; by default all", autocompletion=preset_names
        ),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="FOLDER")] = Path("reports"),
    only: str | None = None,
    law: LawFiles = None,
    theory: TheoryName = None,
    measured: Annotated[list[str] | None, typer.Option(metavar="OUTPUT/INPUT=FILE")] = None,
    paper: Annotated[bool, typer.Option("--paper")] = False,
    gains: Any = gains_of_options,
    chain: Any = chain_of_options,
) -> None:
    """Pages with pictures, tables and data, to read in a browser.

    Open index.html in a browser.
    The pages are about the gains or the laws that are given, or the [law] of an arm's file, or the default gains.

    Options:
    out: the folder to write to
    only: one page: bode, modes, margins, locus ...
    measured: measured response; may be repeated
    paper: each figure as a PDF at the width of a paper's column too, which takes about a quarter longer
    """
    from tfarm.fitting import data, run_files
    from tfarm.report import page, sections, write

    if only is not None:
        must_be_known("--only", only, sections.QUESTIONS)
    files = read_arms(arms or tfarm.presets())
    others = read_arms(law or [])
    subjects = [load_arm(file, theory) for file in files]
    laws = []
    for file, arm in zip(files, subjects, strict=True):
        if others:
            runs = [
                page.GivenLaw(
                    law_of_options(file, arm, gains(), each)[0],
                    Path(each.name).name,
                    run_files.load_run(each),
                )
                for each in others
            ]
        elif "law" in file.tables or gains():
            runs = [page.GivenLaw(law_of_options(file, arm, gains())[0])]
        else:
            runs = []
        laws.append(runs)
    index = write(
        subjects,
        out,
        laws=laws,
        only=None if only is None else (only,),
        paper=paper,
        progress=advance,
        notice=print_line,
        announce=print_line,
        chains=[chain(file) for file in files],
        measured=[data.data_of(text, "--measured") for text in measured or []],
    )
    print(index)


@proof_command(epilog="proof audit")
def audit(*, show: Any = emit_record) -> None:
    """Every equation of the paper, as printed and as corrected.

    Each has its check.
    """
    from tfarm import audit as paper

    show(paper.Audit(paper.PAPER, paper.audit()))


@proof_command(epilog="proof assumptions sasaki2012")
def assumptions(
    *,
    arm: ArmName,
    count: Annotated[int, typer.Option(min=1, max=100)] = 4,
    theory: TheoryName = None,
    show: Any = emit_record,
) -> None:
    """Frequencies over candidates of the assumed section and hub.

    Sections and hub inertias are varied; the sensitivities are exact.

    Options:
    count: flexible modes
    """
    from tfarm.studies.candidates import assumptions as find

    show(find(load_arm(arm, theory), count))


@proof_command(epilog="proof validate")
def validate(*, show: Any = emit_record) -> None:
    """Published natural frequencies compared with the exact ones.

    Each difference has its reason.
    """
    from tfarm.audit import published

    show(published.Validation(published.validate()))


@proof_command(epilog="proof glossary margin")
def glossary(
    *,
    words: Annotated[
        str | None, typer.Argument(metavar="[TERM]", help="part of a term; by default all")
    ] = None,
    show: Any = emit_record,
) -> None:
    """Words of certainty, terms, and quantities with their units.

    The quantities are those of all results.
    """
    from tfarm.schema.glossary import glossary as find

    show(find(words))


@command(epilog="completion bash", hidden=True)
def completion(
    *,
    shell: Annotated[
        Literal["bash", "zsh", "fish", "powershell"],
        typer.Argument(metavar="SHELL", help="the shell"),
    ],
) -> None:
    """Script that completes commands, options and presets in a shell.

    A shell takes it by eval "$(tfarm completion bash)".
    """
    print(get_completion_script(prog_name="tfarm", complete_var="_TFARM_COMPLETE", shell=shell))
