"""The application, and the decorator that makes a command of a function and its keyword-only parameters."""

import re
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from functools import partial, wraps
from inspect import Parameter, Signature, getdoc, isfunction, signature
from typing import Annotated, Any, get_args, get_origin

import typer

import tfarm

app = typer.Typer(name="tfarm", rich_markup_mode="rich", pretty_exceptions_enable=False)


def print_version(wanted: bool) -> None:
    """Print the version and exit, where --version is given."""
    if wanted:
        print(f"tfarm {tfarm.__version__}")
        raise typer.Exit


@app.callback(options_metavar="[--version] [--help]")
def tfarm_options(
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=print_version, help="print the version, and exit"),
    ] = False,
) -> None:
    """Exact frequency-domain analysis of a rotating flexible Timoshenko arm."""


def add_command(
    chapter: str | None, group: typer.Typer = app, **how: Any
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return the decorator that adds a command to a chapter of the help; `how` are its name and its example.

    Its keyword-only parameters are its arguments and options.  "name: text" below "Options:" in its docstring is the
    help of one.  A parameter whose default is a function has an option for each keyword-only parameter of that, and is
    the function with their values.
    """

    def add(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def called(**options: Any) -> None:
            command(**keywords_of(command, options))

        called.__signature__ = Signature(options_of(command))  # type: ignore[attr-defined]
        called.__doc__ = help_of(command)[0]
        group.command(rich_help_panel=chapter, **how)(called)
        return command

    return add


def help_of(function: Callable[..., Any]) -> tuple[str, dict[str, str]]:
    """Return the docstring of a function without its options, and the help of each option."""
    words, _, lines = (getdoc(function) or "").partition("\n\nOptions:\n")
    # a paragraph is one line: where it is broken, the width of the terminal decides
    paragraphs = [" ".join(each.split()) for each in words.split("\n\n")]
    helps = re.split(r"\n(?=\w)", lines) if lines else []
    return "\n\n".join(paragraphs), dict(each.split(": ", 1) for each in helps)


def keyword_only(function: Callable[..., Any]) -> Iterator[Parameter]:
    """Yield the keyword-only parameters of a function."""
    return (each for each in signature(function).parameters.values() if each.kind is Parameter.KEYWORD_ONLY)


def options_of(function: Callable[..., Any]) -> list[Parameter]:
    """Return the options of a command, or of a function that has some of them."""
    helps = help_of(function)[1]
    found: list[Parameter] = []
    for each in keyword_only(function):
        if isfunction(each.default):
            found += options_of(each.default)
        else:
            found.append(_with_help(each, helps.get(each.name, "")))
    return found


def keywords_of(function: Callable[..., Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keywords of a command, or of a function that has some of its options, by the values of all."""
    found: dict[str, Any] = {}
    for each in keyword_only(function):
        if isfunction(each.default):
            found[each.name] = partial(each.default, **keywords_of(each.default, options))
        else:
            found[each.name] = options[each.name]
    return found


def _with_help(option: Parameter, text: str) -> Parameter:
    """Return the parameter of a command with that help; a plain one becomes the option --NAME."""
    if get_origin(option.annotation) is Annotated:
        kind, info = get_args(option.annotation)
        info = copy(info)
    else:
        kind = option.annotation
        info = typer.Option(f"--{option.name.replace('_', '-')}")
    info.help = " ".join(text.split()) or info.help
    return option.replace(annotation=Annotated[kind, info])
