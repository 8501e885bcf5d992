"""The verbs that help with the others: what a word means, and completion in a shell."""

from __future__ import annotations

from typing import Annotated

import typer

from tfarm.cli.app import Json, app, give, whole_command
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
def glossary(
    words: Annotated[str | None, typer.Argument(metavar="[TERM]", help="part of a term; all if none")] = None,
    json: Json = False,
) -> None:
    """What the words mean that answers use in a sense of their own: proven, certified, band, window ..."""
    from tfarm.glossary import glossary as find
    from tfarm.tables.terminal import show

    give({"terms": find(words)}, json, lambda answer: show(answer["terms"]))


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
    from tfarm.arm import presets

    cases = [
        f'            {name}) words="{" ".join([*options, *(presets() if takes_arm else ())])}" ;;'
        for name, (options, takes_arm) in verbs.items()
    ]
    return BASH.format(verbs=" ".join(verbs), cases="\n".join(cases))


def _fish(verbs: dict[str, tuple[list[str], bool]]) -> str:
    """A line a word: fish completes files by itself."""
    from tfarm.arm import presets

    lines = ["# Completion of tfarm.  Made by `tfarm completion`; make it anew after an update."]
    lines += [f"complete -c tfarm -n __fish_use_subcommand -a {name}" for name in (*verbs, "--version")]
    for name, (options, takes_arm) in verbs.items():
        seen = f'complete -c tfarm -n "__fish_seen_subcommand_from {name}"'
        lines += [f"{seen} -l {option.removeprefix('--')}" for option in options]
        lines += [f"{seen} -a {preset}" for preset in presets()] if takes_arm else []
    return "\n".join(lines) + "\n"
