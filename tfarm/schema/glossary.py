"""The five words of certainty and the terms of the results, for `tfarm proof glossary`, pages and documentation.

The quantities of all results, with label, unit and meaning, are read where each record declares them.
"""

import pkgutil
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated

from tfarm.errors import ParameterError, did_you_mean
from tfarm.schema.quantities import Quantity, quantities


@dataclass(frozen=True, slots=True)
class Term:
    """A term and its meaning; of a word of certainty what has to be shown for it."""

    name: Annotated[str, Quantity("term", key="term", help="word of certainty, or term of the results")]
    meaning: Annotated[str, Quantity("meaning", help="definition; of a word of certainty also its condition")]


@dataclass(frozen=True, slots=True)
class Declared:
    """A quantity of the results."""

    label: Annotated[
        str, Quantity("quantity", key="quantity", help="label of the quantity in text, tables and pages")
    ]
    unit: Annotated[str, Quantity("unit", help="SI unit; none of a ratio or a word")]
    meaning: Annotated[str, Quantity("meaning", help="definition, with its sign or limit convention")]


def _read_terms(kind: str) -> tuple[Term, ...]:
    """Return the terms of a kind, certainty or terms, in the file `terms.toml`."""
    tables = tomllib.loads(Path(__file__).with_name("terms.toml").read_text(encoding="utf-8"))
    return tuple(Term(**entry) for entry in tables[kind])


CERTAINTY = _read_terms("certainty")
GLOSSARY_TERMS = tuple(sorted((*CERTAINTY, *_read_terms("terms")), key=lambda term: term.name.casefold()))


def declared_records() -> Iterator[tuple[type, dict[str, Quantity]]]:
    """Yield every class of records with its quantities by attribute; imports the whole package."""
    for module in pkgutil.walk_packages([str(Path(__file__).parents[1])], "tfarm."):
        # it acts when it is imported
        if module.name == "tfarm.__main__":
            continue
        for kind in vars(import_module(module.name)).values():
            # of a class whose annotations are for type checkers alone
            with suppress(NameError):
                is_own = isinstance(kind, type) and kind.__module__ == module.name
                if is_own and quantities(kind):
                    yield kind, quantities(kind)


@dataclass(frozen=True)
class Glossary:
    """The words of certainty and terms, and the quantities that have a meaning of their own."""

    terms: Annotated[
        tuple[Term, ...], Quantity("terms", help="words of certainty and other terms, in alphabetical order")
    ]
    quantities: Annotated[
        tuple[Declared, ...],
        Quantity("quantities of the results", help="labelled entries of all records, in alphabetical order"),
    ]


def glossary(words: str | None = None) -> Glossary:
    """Return every term and quantity, or those whose name contains the words.

    Raises ParameterError where there is none.
    """
    every = set()
    for _, declared in declared_records():
        every |= {Declared(of.label, of.unit, of.help) for of in declared.values() if of.label and of.help}
    part = (words or "").casefold()
    terms = tuple(each for each in GLOSSARY_TERMS if part in each.name.casefold())
    in_order = sorted(every, key=lambda each: (each.label.casefold(), each.unit, each.meaning))
    found = tuple(each for each in in_order if part in each.label.casefold())
    if not (terms or found):
        remedy = did_you_mean(part, [each.name for each in GLOSSARY_TERMS])
        raise ParameterError(key="term", value=words, remedy=remedy)
    return Glossary(terms, found)
