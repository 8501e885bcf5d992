"""The user's words in the languages of targets: identifiers, comments, quoted texts, and templates.

No text of a user reaches a file but through one function here: `comment`, `identifiers`, `matlab_text`, or Python's
`ascii`; XML is written by ElementTree.
"""

import re
import unicodedata
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tfarm.schema import entries, text


def identifiers(names: Iterable[str], prefix: str, longest: int = 31) -> dict[str, str]:
    """Return an identifier of C, C++, MATLAB and Python for each name: `prefix`, letters, digits and underscores.

    A prefix that ends in an underscore, such as "y_", begins no keyword.  Equal identifiers are numbered.  C99 compares
    their first 31 characters.
    """
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(names):
        plain = f"{prefix}{re.sub(r'[^A-Za-z0-9]+', '_', name).strip('_') or 'unnamed'}"
        tries = (
            plain[:longest],
            *(f"{plain[: longest - 1 - len(str(n))]}_{n}" for n in range(2, len(found) + 3)),
        )
        found[name] = next(each for each in tries if each.lower() not in taken)
        taken.add(found[name].lower())
    return found


def comment(words: str) -> str:
    """Return one line of printable ASCII that ends no comment of C and continues none."""
    plain = unicodedata.normalize("NFKD", words)
    line = "".join(printable(c) for c in plain if not unicodedata.combining(c))
    # marks of C, and the trigraph of a backslash
    for mark, instead in (("\\", "|"), ("*/", "* /"), ("/*", "/ *"), ("??/", "? ?/")):
        line = line.replace(mark, instead)
    return line[:200].strip()


def printable(character: str) -> str:
    """Return a character of printable ASCII for any other one."""
    if " " <= character <= "~":
        return character
    return " " if character.isspace() else "?"


def matlab_text(words: str) -> str:
    """Return a character vector of MATLAB in one line of ASCII, its quotes doubled."""
    return "'" + comment(words).replace("'", "''") + "'"


def name_in_c(wanted: str) -> dict[str, str]:
    """Return the name that the identifiers of a file in C begin with, by the wanted one."""
    first = wanted[:1]
    prefix = "" if first.isascii() and first.isalpha() else "n_"
    # room for "_step" and the like
    return identifiers([wanted], prefix, longest=16)


def literal(value: float, suffix: str = "") -> str:
    """Return a number in C: whole, or hexadecimal with all its bits."""
    if isinstance(value, int):
        return f"{value:d}"
    return f"{float(value).hex()}{suffix}"


@cache
def source_templates() -> Environment:
    """Return the templates of source files, without the escapes of HTML."""
    folder = Path(__file__).parent / "templates"
    environment = Environment(
        loader=FileSystemLoader(folder),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters["comment"] = comment
    return environment


def render_source(template: str, **values: Any) -> bytes:
    """Return a source file from its template."""
    return source_templates().get_template(template).render(**values).encode("ascii")


def facts_of(record: Any) -> list[tuple[str, str]]:
    """Return the entries of a record that have one value, by label with unit, for a comment."""
    rows = (
        (f"{label} [{of.unit}]" if of.unit else label, text(value, of.digits))
        for label, of, value in entries(record)
    )
    return [(label, shown) for label, shown in rows if shown]
