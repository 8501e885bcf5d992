"""One command from its arguments to its exit code: errors and broken streams become one line on standard error."""

import os
import re
import sys
import tomllib
from difflib import get_close_matches
from functools import cache
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import typer
from typer.exceptions import TyperException

from tfarm.cli import arm_files, commands, control, designing, measuring, pages  # noqa: F401  each adds its commands
from tfarm.cli.app import app
from tfarm.cli.progress import discard, print_line, progress
from tfarm.errors import CertificationError, ConvergenceError, ParameterError, TfarmError, require
from tfarm.files import STANDARD_OUTPUT

# files that may be "-", standard output
STREAMED = ("--csv", "--figure", "--png", "--mat", "--save")
WRITTEN = (*STREAMED, "--animate", "--c")
# such as 1_0
PATHS = (
    *WRITTEN,
    "--out",
    "--tuned",
    "--dsp",
    "--law",
    "--controller",
    "--list",
    "--posterior",
    "--run",
    "--with",
    "--before",
)
# NAME=VALUE, one a name
BY_NAME = (
    "--range",
    "--weight",
    "--over",
    "--start",
    "--bounds",
    "--prior",
    "--vary",
    "--noise",
    "--without",
    "--gain",
)
# of the help, in its order
CHAPTERS = ("Arm", "Loop", "Design", "Measure", "Study", "Report")


@cache  # some 35 ms, which a process with several commands need not spend on each
def whole_command() -> Any:
    """Return the command with all its subcommands; called once every module of commands is loaded.

    An epilog is the example of its command, and a [unit] in a help text no markup of rich.  The help of the whole has
    its options in the line of usage, and a group of commands last in its chapter.
    """
    command: Any = typer.main.get_command(app)

    def place_of(named: tuple[str, Any]) -> tuple[int, bool]:
        return CHAPTERS.index(named[1].rich_help_panel), hasattr(named[1], "commands")

    command.commands = dict(sorted(command.commands.items(), key=place_of))
    for option in command.get_params(typer.Context(command)):
        option.hidden = True
    for each in commands_of(command).values():
        each.epilog = f"Example: tfarm {each.epilog}"
        for text in (each, *each.params):
            text.help = (text.help or "").replace("[", r"\[")
    return command


def commands_of(group: Any) -> dict[str, Any]:
    """Return the commands of a group by their words: modes, and proof audit of a group in it."""
    found: dict[str, Any] = {}
    for name, each in group.commands.items():
        if hasattr(each, "commands"):
            found |= {f"{name} {word}": inner for word, inner in commands_of(each).items()}
        else:
            found[name] = each
    return found


def run(arguments: list[str]) -> int:
    """Return the exit code of a command: 0, 2 for bad input, 3 for what could not be solved or proven."""
    open_streams()
    message = ""
    code = 0
    try:
        with progress():
            code = call(arguments or ["--help"])
        sys.stdout.flush()
    except (ConvergenceError, CertificationError, MemoryError) as error:
        message = str(error) or "not enough memory for this; ask for less at a time"
        code = 3
    except (TfarmError, TyperException) as error:
        message = usage(error)
        code = 2
    except (BrokenPipeError, SystemExit):
        # the reader, head for instance, has left; rich leaves with it
        discard(sys.stdout)
    except OSError as error:
        # of standard output, or of a folder that compiled code is kept in
        discard(sys.stdout)
        remedy = "free some space, or write elsewhere (NUMBA_CACHE_DIR is the folder of compiled code)"
        message = f"{error.filename or 'standard output'}: {error.strerror or error}; {remedy}"
        code = 2
    if message:
        print_line(message)
        # what was printed before the error
        try:
            sys.stdout.flush()
        except OSError:
            discard(sys.stdout)
    return code


def call(arguments: list[str]) -> int:
    """Run a command, or complete one for a shell; return its exit code."""
    command = whole_command()
    if arguments[0] not in command.commands:
        arguments = replace_old_name(arguments)
    check_words(arguments)
    # not command.main, which takes a closed pipe for an error
    try:
        command._main_shell_completion({}, "tfarm")
        with command.make_context("tfarm", list(arguments)) as context:
            command.invoke(context)
    except typer.Exit as stop:
        return stop.exit_code
    except typer.Abort:
        # of a question, by the end of the input or an interrupt
        raise KeyboardInterrupt from None
    return 0


def replace_old_name(arguments: list[str]) -> list[str]:
    """Return the arguments with the new name of a command of an old name, which is named on standard error."""
    old, *others = arguments
    new = hints()["renamed"].get(old)
    if new is None:
        return arguments
    print_line(f'"tfarm {old}" has moved: write "tfarm {new}"')
    return [*new.split(), *others]


def hints() -> dict[str, dict[str, Any]]:
    """Return the words of other tools and the old names, and the word of tfarm for each."""
    return tomllib.loads((Path(__file__).parent / "hints.toml").read_text(encoding="utf-8"))


def open_streams() -> None:
    """Make streams that take every letter and fail like a full disk where they are closed.

    A closed standard error swallows its lines: Python would print them on standard output.
    """
    # for as long as the process lives; writing to what is open for reading raises OSError
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.stdout = sys.stdout or open(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def check_words(arguments: list[str]) -> None:
    """Raise ParameterError for 5_0, Python's own spelling, an empty path, and a "-" that is no file or one of two."""
    words: list[str] = []
    for argument in arguments:
        words += argument.split("=", 1 if argument.startswith("--") else 0)
    options = [(option, text) for option, text in pairwise(words) if option.startswith("--")]
    takers = [option for option, text in options if text == STANDARD_OUTPUT]
    if "--json" in words:
        takers.append("--json")
    files = [text for option, text in options if option in WRITTEN and text != STANDARD_OUTPUT]
    named = [(option, text.partition("=")[0]) for option, text in options if option in BY_NAME]
    for option, name in named:
        require(named.count((option, name)) == 1, option, name, "is given twice; once is enough")
    for option, text in options:
        if option not in PATHS:
            # numbers to Python alone: 5_0, or other digits
            number = re.compile(r"(?=.*(_|[^\x00-\x7f]))[-+.\d_eEij]*\d[-+.\d_eEij]*")
            is_odd = any(map(number.fullmatch, re.split("[,=]", text)))
            require(not is_odd, option, text, "write numbers as 50, 0.5 or 5e1")
        else:
            require(text.strip(), option, text, "give a path")
        if text == STANDARD_OUTPUT:
            remedy = f"- is standard output, and only {', '.join(STREAMED)} may go there: give a name"
            require(option in STREAMED, option, text, remedy)
            require(len(takers) == 1, option, text, "standard output takes one thing at a time: name a file")
        if option in WRITTEN:
            require(files.count(text) <= 1, option, text, "two results in one file: name another")
            require(Path(text).parent.is_dir(), option, text, "is in no folder: make that first")
            require(not Path(text).is_dir(), option, text, "is a folder: give the name of a file")


def usage(error: Any) -> str:
    """Return a refusal as one line: option, value, expected form, and the option or command that may be meant."""
    if not hasattr(error, "format_message"):
        return str(error)
    text = error.format_message()
    if text.startswith("No such option"):
        name = error.option_name
        known = [*chain.from_iterable(each.opts for each in error.ctx.command.params)]
        alike = [option for option, others in hints()["options"].items() if name in others]
        meant = [option for option in alike if option in known]
        if meant:
            return f"No such option: {name}. Did you mean {' or '.join(meant)}?"
        return text + hints()["other_commands"].get(name, "")
    # of pydantic, which converts for Typer
    for problem in getattr(error.__cause__, "errors", list)():
        of = error.param
        within = "" if None in (of.min, of.max) else f", from {of.min} to {of.max}"
        remedy = problem["msg"].removeprefix("Value error, ").replace("Input should", "should") + within
        return str(ParameterError(key=of.opts[0], value=problem["input"], remedy=remedy))
    if text.startswith("No such command"):
        word = text.split("'")[1].lower()
        ours = hints()["commands"] | hints()["renamed"]
        # those that Typer has found among the commands
        found = text.split("'")[3::2]
        near = get_close_matches(word, [*found, *ours], 1, cutoff=0.8)
        if near and near[0] not in found:
            return f"No such command '{word}'. Did you mean \"{ours[near[0]]}\"?"
    if "param" in vars(error):
        return text.removeprefix("Invalid value for ").replace("'", "", 2)
    return text
