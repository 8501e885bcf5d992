"""The verbs that write pages, say why an answer can be trusted, and help with the others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tfarm.arm import presets
from tfarm.cli.app import (
    ArmName,
    Json,
    TheoryName,
    app,
    emit,
    load_arm,
    progress,
    say_when_compiling,
    tell,
    whole_command,
    whole_number,
)
from tfarm.cli.inputs import GAIN_OPTIONS, LawFiles, Typed, asked_laws, with_options
from tfarm.cli.sampling import Delay, DspFile, Period, asked_chain
from tfarm.errors import must_be_known

SHELLS = ("bash", "zsh", "fish")
BASH = """\
# Completion of tfarm.  Made by `tfarm completion`; make it anew after an update.
_tfarm() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" words
    if [ "$COMP_CWORD" -eq 1 ]; then
        words="{verbs} --help --version"
    else
        case "${{COMP_WORDS[1]}}" in
{cases}
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _tfarm tfarm
"""
ZSH = "#compdef tfarm\nautoload -U +X bashcompinit && bashcompinit\n"


@app.command()
@with_options(GAIN_OPTIONS, after="only")
def report(
    arms: Annotated[
        list[str] | None, typer.Argument(metavar="[ARM ...]", help="presets or files; all presets if none")
    ] = None,
    out: Annotated[Path, typer.Option("--out", help="the folder to write to")] = Path("reports"),
    only: Annotated[str | None, typer.Option("--only", help="one page: bode, modes, margins, locus ...")] = None,
    law: LawFiles = None,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    theory: TheoryName = None,
    measured: Annotated[
        list[str] | None, typer.Option("--measured", metavar="OUTPUT/INPUT=FILE", help="lay this over the exact one")
    ] = None,
    *,
    gains: Typed,
) -> None:
    """Write pages with pictures, tables and data: open index.html in a browser.

    With gains, or laws, or a [law] in an arm's file, the pages are about these; else about the default gains.
    """
    import tfarm
    from tfarm.fitting.data import data_of
    from tfarm.report import write

    names = arms or tfarm.presets()
    subjects = [load_arm(name, theory) for name in names]
    chains = [asked_chain(dsp or name, period, delay_samples) for name in names]
    laws = [asked_laws(arm, name, gains, law or []) for arm, name in zip(subjects, names, strict=True)]
    responses = [data_of(text, "--measured") for text in measured or []]
    left_out: list[str] = []
    with progress() as advance:
        page = write(
            subjects, out, chains=chains, laws=laws, only=None if only is None else (only,), measured=responses,
            progress=advance, notice=left_out.append,
        )  # fmt: skip
    for text in left_out:
        tell(text)
    print(page)


@app.command()
def audit(json: Json = False) -> None:
    """Every equation of the paper, as printed and as corrected, with the check that tells them apart."""
    say_when_compiling()
    from tfarm.audit import PAPER, Audit
    from tfarm.audit import audit as find

    emit(Audit(PAPER, find()), json)


@app.command()
def assumptions(
    arm: ArmName,
    count: Annotated[str, typer.Option("--count", metavar="N", help="flexible modes, 1 to 100")] = "4",
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """What the assumed section and hub do: frequencies over the candidates, with exact sensitivities."""
    wanted = whole_number("--count", count, 1, 100)
    subject = load_arm(arm, theory)
    from tfarm.audit.assumptions import assumptions as find

    emit(find(subject, wanted), json)


@app.command()
def validate(json: Json = False) -> None:
    """Natural frequencies of published tables beside the exact ones, and why where they differ."""
    say_when_compiling()
    from tfarm.audit.published import Validation
    from tfarm.audit.published import validate as find

    emit(Validation(find()), json)


@app.command()
def glossary(
    words: Annotated[str | None, typer.Argument(metavar="[TERM]", help="part of a term; all if none")] = None,
    json: Json = False,
) -> None:
    """What the words mean that answers use in a sense of their own: proven, certified, band, window ..."""
    from tfarm.glossary import glossary as find

    emit(find(words), json)


@app.command()
def completion(shell: Annotated[str, typer.Argument(metavar="SHELL", help="bash, zsh or fish")]) -> None:
    """Print the script that completes tfarm's words in a shell: eval "$(tfarm completion bash)"."""
    must_be_known("SHELL", shell, SHELLS)
    verbs = {
        name: (
            [option for each in command.params for option in each.opts if option.startswith("--")] + ["--help"],
            any(each.name in ("arm", "arms") for each in command.params),
        )
        for name, command in sorted(whole_command().commands.items())
    }
    print(_fish(verbs) if shell == "fish" else ZSH * (shell == "zsh") + _bash(verbs), end="")


def _bash(verbs: dict[str, tuple[list[str], bool]]) -> str:
    """A case a verb: of each its options, and whether it takes an arm."""
    cases = [
        f'            {name}) words="{" ".join([*options, *(presets() if takes_arm else ())])}" ;;'
        for name, (options, takes_arm) in verbs.items()
    ]
    return BASH.format(verbs=" ".join(verbs), cases="\n".join(cases))


def _fish(verbs: dict[str, tuple[list[str], bool]]) -> str:
    """A line a word: fish completes files by itself."""
    lines = ["# Completion of tfarm.  Made by `tfarm completion`; make it anew after an update."]
    lines += [f"complete -c tfarm -n __fish_use_subcommand -a {name}" for name in (*verbs, "--version")]
    for name, (options, takes_arm) in verbs.items():
        seen = f'complete -c tfarm -n "__fish_seen_subcommand_from {name}"'
        lines += [f"{seen} -l {option.removeprefix('--')}" for option in options]
        lines += [f"{seen} -a {preset}" for preset in presets()] if takes_arm else []
    return "\n".join(lines) + "\n"
