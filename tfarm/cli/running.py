"""One command from its arguments to its exit code: errors and broken streams become one line on standard error.

What a misspelt or foreign word most likely means, and numbers that Python would take for numbers but nobody else.
"""

from __future__ import annotations

import os
import sys
from itertools import pairwise
from typing import Any

import typer
from typer.exceptions import TyperException

from tfarm.arm import GAINS
from tfarm.cli import commands, control, designing, fitting, sampling, trust, tuning  # noqa: F401  each adds its verbs
from tfarm.cli.app import discard, tell, whole_command
from tfarm.errors import CertificationError, ConvergenceError, ParameterError, TfarmError, did_you_mean
from tfarm.files import STANDARD_OUTPUT

VERBS = {  # words of other tools
    "rlocus": "locus",
    "eig": "modes",
    "eigenvalues": "modes",
    "frequencies": "modes",
    "zeros": "poles",
    "step": "simulate ARM --scenario step",
    "impulse": "simulate ARM --scenario impulse",
    "slew": "simulate ARM --scenario slew",
    "stability": "margins",
    "gains": "design",
    "transfer": "response",
    "train": "tune",
    "list": "presets",
    "version": "--version",
    "help": "--help",
}
GAINS_ELSEWHERE = {"hub_angle": ("--K0",), "hub_rate": ("--Kd",), "root_moment": ("--Km",)}
OPTIONS: dict[str, tuple[str, ...]] = {
    "--period": ("--Ts", "--ts", "--dt", "--T", "--sample-time", "--sampling-time", "--sample", "-T"),
    "--count": ("--n", "--num", "--number", "--modes", "-n", "-N"),
    "--modes": ("--n", "--num", "--number", "--count", "-n", "-N"),
    "--omega": ("--w", "--freq", "--frequency", "--frequencies", "-w"),
    "--delay-samples": ("--tau", "--delay", "--latency"),
    "--csv": ("--out", "--file", "--save", "-o"),
    "--out": ("--output", "--folder", "--dir", "-o"),
    "--duration": ("--time", "--tend", "--tmax", "-t"),
    **{f"--{gain.name}": (*GAINS_ELSEWHERE.get(gain.output, ()), f"--{gain.name.lower()}") for gain in GAINS},
    "--from": ("--start", "--wmin", "--min"),
    "--to": ("--stop", "--end", "--wmax", "--max"),
}
STREAMED = ("--csv", "--png", "--mat", "--save")  # of files that may go to standard output instead, called "-"
PATHS = (*STREAMED, "--out", "--keep", "--dsp", "--controller")  # may be called 1_0


def run(arguments: list[str]) -> int:
    """The exit code of a command: 0, 2 for bad input, 3 for what could not be solved or proven, 130 if interrupted."""
    _mend_streams()
    try:
        result = _call(arguments or ["--help"])
        sys.stdout.flush()
        return result
    except (KeyboardInterrupt, typer.Abort):
        code = _fail("stopped", 130)
    except (ConvergenceError, CertificationError) as error:
        code = _fail(str(error), 3)
    except TfarmError as error:
        code = _fail(str(error), 2)
    except TyperException as error:
        code = _fail(usage(error), 2)
    except BrokenPipeError:  # the reader, head for instance, has left
        discard(sys.stdout)
        return 0
    except MemoryError:
        code = _fail("not enough memory for this; ask for less at a time", 3)
    except OSError as error:  # of standard output, or of a folder that compiled code is kept in
        discard(sys.stdout)
        code = _fail(_of_the_system(error), 2)
    try:  # what was printed before the error
        sys.stdout.flush()
    except OSError:
        discard(sys.stdout)
    return code


def _call(arguments: list[str]) -> int:
    command = whole_command()
    check_verb(arguments[0], command)
    check_numbers(arguments)
    check_streams(arguments)
    try:  # not command.main, which takes a closed pipe for an error
        with command.make_context("tfarm", list(arguments)) as context:
            command.invoke(context)
    except typer.Exit as stop:
        return stop.exit_code
    return 0


def _mend_streams() -> None:
    """Streams that take every letter and fail like a full disk where they are closed.

    A closed standard error swallows what is said: Python would print it on standard output.
    """
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  for as long as the process lives
    if sys.stdout is None:
        read_only = os.open(os.devnull, os.O_RDONLY)
        sys.stdout = open(read_only, "w", encoding="utf-8")  # noqa: SIM115  writing raises OSError
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _of_the_system(error: OSError) -> str:
    reason = error.strerror or str(error)
    if error.filename is None:
        return f"standard output cannot be written ({reason}); free some space, or send it elsewhere"
    return f"{error.filename}: {reason}; free some space, or set NUMBA_CACHE_DIR to a folder with some"


def _fail(message: str, code: int) -> int:
    tell(message)
    return code


def check_verb(word: str, group: Any) -> None:
    """Raise ParameterError for a word that is no verb of the command line."""
    if word.startswith("-") or word in group.commands:
        return
    remedy = f'did you mean "{VERBS[word.lower()]}"?' if word.lower() in VERBS else did_you_mean(word, group.commands)
    raise ParameterError(key="command", value=word, remedy=remedy)


def check_numbers(arguments: list[str]) -> None:
    """Raise ParameterError for an option's number in Python's own spelling, 5_0, or in other than ASCII digits."""
    words = [word for argument in arguments for word in argument.split("=", 1 if argument.startswith("--") else 0)]
    for option, text in pairwise(words):
        takes_number = option.startswith("--") and option not in PATHS
        if takes_number and any(_is_odd(part) for part in text.split(",")):
            raise ParameterError(key=option, value=text, remedy="write numbers as 50, 0.5 or 5e1")


def check_streams(arguments: list[str]) -> None:
    """Raise ParameterError for "-" in the place of a path that is no file to be written, or where two would mix."""
    words = [word for argument in arguments for word in argument.split("=", 1 if argument.startswith("--") else 0)]
    streamed = [option for option, text in pairwise(words) if text == STANDARD_OUTPUT and option in PATHS]
    for option in streamed:
        if option not in STREAMED:
            remedy = f"- stands for standard output, and only {', '.join(STREAMED)} may go there: give a name"
            raise ParameterError(key=option, value=STANDARD_OUTPUT, remedy=remedy)
        if len(streamed) > 1 or "--json" in words:
            remedy = "standard output takes one thing at a time: name a file, or leave the other out"
            raise ParameterError(key=option, value=STANDARD_OUTPUT, remedy=remedy)


def _is_odd(text: str) -> bool:
    try:
        complex(text.strip().replace("i", "j"))
    except ValueError:
        return False
    return "_" in text or not text.isascii()


def usage(error: Any) -> str:
    """The parser's complaint, in the words of our own errors."""
    name = getattr(error, "option_name", None)
    if name is None or "no such option" not in str(error).lower():
        return str(error.format_message()) if hasattr(error, "format_message") else str(error)
    known = [option for param in error.ctx.command.params for option in param.opts] if error.ctx else []
    meant = [option for option, others in OPTIONS.items() if name in others and option in known]
    near = meant or sorted(error.possibilities or ())
    hint = f": did you mean {' or '.join(near)}?" if near else f"; known are {', '.join(sorted(known))}"
    return f"{name}: no such option{hint}"
