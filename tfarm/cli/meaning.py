"""What a misspelt or foreign word most likely means, and numbers that Python would take for numbers but nobody else."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from tfarm.arm import GAINS
from tfarm.errors import ParameterError, did_you_mean
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
