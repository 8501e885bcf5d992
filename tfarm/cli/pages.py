"""The commands that write pages, give evidence, and help with the others."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.completion import get_completion_script  # type: ignore[attr-defined]  # Typer does not list it

import tfarm
from tfarm.cli.app import (
    ArmName,
    LawFiles,
    TheoryName,
    add_command,
    advance,
    emit_record,
    given_gains,
    load_arm,
    load_chain,
    load_law,
    preset_names,
    print_line,
    read_arms,
)
from tfarm.errors import must_be_known

command = partial(add_command, "Report")


@command(epilog="report sasaki2012-lab --out pages")
def report(
    *,
    arms: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ARM ...]", help="presets or files; by default all", autocompletion=preset_names),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="FOLDER")] = Path("reports"),
    only: str | None = None,
    law: LawFiles = None,
    theory: TheoryName = None,
    measured: Annotated[list[str] | None, typer.Option(metavar="OUTPUT/INPUT=FILE")] = None,
    paper: Annotated[bool, typer.Option("--paper")] = False,
    gains: Any = given_gains,
    chain: Any = load_chain,
) -> None:
    """Pages with pictures, tables and data: open index.html in a browser.

    The pages are about the gains or the laws that are given, or the [law] of an arm's file, or the default gains.

    Options:
    out: the folder to write to
    only: one page: bode, modes, margins, locus ...
    measured: measured response; may be repeated
    paper: each figure as a PDF at the width of a paper's column too, which takes about a quarter longer
    """
    from tfarm.fitting import data, recording
    from tfarm.report import page, write, writing

    if only is not None:
        must_be_known("--only", only, writing.QUESTIONS)
    files = read_arms(arms or tfarm.presets())
    others = read_arms(law or [])
    subjects = [load_arm(file, theory) for file in files]
    laws = []
    for file, arm in zip(files, subjects, strict=True):
        if others:
            runs = [
                page.GivenLaw(load_law(file, arm, gains(), each)[0], Path(each.name).name, recording.load_run(each))
                for each in others
            ]
        elif "law" in file.tables or gains():
            runs = [page.GivenLaw(load_law(file, arm, gains())[0])]
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


@command(epilog="audit")
def audit(*, show: Any = emit_record) -> None:
    """Every equation of the paper, as printed and as corrected, with the check of each."""
    from tfarm import audit as paper

    show(paper.Audit(paper.PAPER, paper.audit()))


@command(epilog="assumptions sasaki2012")
def assumptions(
    *,
    arm: ArmName,
    count: Annotated[int, typer.Option(min=1, max=100)] = 4,
    theory: TheoryName = None,
    show: Any = emit_record,
) -> None:
    """Effect of the assumed section and hub inertia: frequencies over the candidates, with exact sensitivities.

    Options:
    count: flexible modes
    """
    from tfarm.studies.candidates import assumptions as find

    show(find(load_arm(arm, theory), count))


@command(epilog="validate")
def validate(*, show: Any = emit_record) -> None:
    """Natural frequencies of published tables compared with the exact ones, with the reason of each difference."""
    from tfarm.audit import published

    show(published.Validation(published.validate()))


@command(epilog="glossary margin")
def glossary(
    *,
    words: Annotated[str | None, typer.Argument(metavar="[TERM]", help="part of a term; by default all")] = None,
    show: Any = emit_record,
) -> None:
    """Words of certainty, terms, and the quantities of all results with their units."""
    from tfarm.schema.glossary import glossary as find

    show(find(words))


@command(epilog="completion bash")
def completion(
    *,
    shell: Annotated[
        Literal["bash", "zsh", "fish", "powershell"],
        typer.Argument(metavar="SHELL", help="the shell"),
    ],
) -> None:
    """Script that completes commands, options and presets in a shell: eval "$(tfarm completion bash)"."""
    print(get_completion_script(prog_name="tfarm", complete_var="_TFARM_COMPLETE", shell=shell))
