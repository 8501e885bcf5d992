"""The commands that write pages, give evidence, and help with the others."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer.completion import get_completion_script  # type: ignore[attr-defined]  # Typer does not list it

import tfarm
from tfarm.cli.app import (
    ArmName,
    Delay,
    DspFile,
    Gains,
    Json,
    LawFiles,
    Period,
    TheoryName,
    add_command,
    advance,
    emit,
    load_arm,
    load_chain,
    load_law,
    preset_names,
    print_line,
)

command = partial(add_command, "Report")


@command(epilog="report sasaki2012-lab --out pages")
def report(
    arms: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ARM ...]", help="presets or files; by default all", autocompletion=preset_names),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="FOLDER")] = Path("reports"),
    only: str | None = None,
    law: LawFiles = None,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    theory: TheoryName = None,
    measured: Annotated[list[str] | None, typer.Option(metavar="OUTPUT/INPUT=FILE")] = None,
    *,
    gains: Gains,
) -> None:
    """Pages with pictures, tables and data: open index.html in a browser.

    The pages are about the gains or the laws that are given, or the [law] of an arm's file, or the default gains.

    Options:
    out: the folder to write to
    only: one page: bode, modes, margins, locus ...
    measured: measured response; may be repeated
    """
    from tfarm.arm import law_tables
    from tfarm.fitting import data, recording
    from tfarm.report import cases, write

    names: list[str] = arms or list(tfarm.presets())
    files: list[Path | None] = [*(law or [])]
    subjects = [load_arm(name, theory) for name in names]
    laws = [
        [
            cases.GivenLaw(
                load_law(arm, name, gains, file)[0],
                file.name if file else "",
                recording.load_run(file) if file else None,
            )
            for file in files or [None] * (set(gains.values()) != {None} or law_tables.load_law(name) is not None)
        ]
        for arm, name in zip(subjects, names, strict=True)
    ]
    print(write(
        subjects, out, laws=laws, only=None if only is None else (only,), progress=advance, notice=print_line,
        chains=[load_chain(dsp or name, period, delay_samples) for name in names],
        measured=[data.data_of(text, "--measured") for text in measured or []],
    ))  # fmt: skip


@command(epilog="audit")
def audit(json: Json = False) -> None:
    """Every equation of the paper, as printed and as corrected, with the check of each."""
    from tfarm import audit as paper

    emit(paper.Audit(paper.PAPER, paper.audit()), json)


@command(epilog="assumptions sasaki2012")
def assumptions(
    arm: ArmName,
    count: Annotated[int, typer.Option(min=1, max=100)] = 4,
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """Effect of the assumed section and hub inertia: frequencies over the candidates, with exact sensitivities.

    Options:
    count: flexible modes
    """
    from tfarm.audit.assumptions import assumptions as find

    emit(find(load_arm(arm, theory), count), json)


@command(epilog="validate")
def validate(json: Json = False) -> None:
    """Natural frequencies of published tables compared with the exact ones, with the reason of each difference."""
    from tfarm.audit import published

    emit(published.Validation(published.validate()), json)


@command(epilog="glossary margin")
def glossary(
    words: Annotated[str | None, typer.Argument(metavar="[TERM]", help="part of a term; by default all")] = None,
    json: Json = False,
) -> None:
    """Words of certainty, terms, and the quantities of all results with their units."""
    from tfarm.schema.glossary import glossary as find

    emit(find(words), json)


@command(epilog="completion bash")
def completion(
    shell: Annotated[
        Literal["bash", "zsh", "fish", "powershell"],
        typer.Argument(metavar="SHELL", help="the shell"),
    ],
) -> None:
    """Script that completes commands, options and presets in a shell: eval "$(tfarm completion bash)"."""
    print(get_completion_script(prog_name="tfarm", complete_var="_TFARM_COMPLETE", shell=shell))
