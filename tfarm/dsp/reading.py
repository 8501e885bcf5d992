"""The tables [sampling], [converters], [actuator] and [slew] of a TOML file: the arm's own, or one beside it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from tfarm.arm import schema
from tfarm.arm.reading import load_tables
from tfarm.arm.schema import ArmTable, TomlTable, validated
from tfarm.dsp.chain import Actuator, Chain, Converters, Sampling, Slew
from tfarm.errors import ParameterError, did_you_mean, naming

OF_AN_ARM = (*ArmTable.model_fields, "law")


@schema.of(Sampling)
class SamplingTable(TomlTable):
    """[sampling]."""


@schema.of(Converters)
class ConvertersTable(TomlTable):
    """[converters]."""


@schema.of(Actuator)
class ActuatorTable(TomlTable):
    """[actuator]."""


@schema.of(Slew)
class SlewTable(TomlTable):
    """[slew]."""


CHAIN_TABLES: dict[str, type[TomlTable]] = {
    "sampling": SamplingTable,
    "converters": ConvertersTable,
    "actuator": ActuatorTable,
    "slew": SlewTable,
}


def load_chain(name_or_path: str | os.PathLike[str]) -> Chain:
    """The chain that an arm's file (or preset, or a file of its own) describes; ideal where it says nothing.

    Raises ParameterError for an unknown key, a wrong type or a value that cannot be.
    """
    tables, file = load_tables(name_or_path)
    with naming(file):
        return chain_of_tables(tables)


def chain_of_tables(tables: Mapping[str, Any]) -> Chain:
    """The chain of a parsed file; the tables of an arm may stand beside its own."""
    unknown = [key for key in tables if key not in CHAIN_TABLES and key not in OF_AN_ARM]
    if unknown:
        remedy = f"unknown table; {did_you_mean(unknown[0], CHAIN_TABLES)}"
        raise ParameterError(key=unknown[0], value=tables[unknown[0]], remedy=remedy)
    given = {name: table for name, table in CHAIN_TABLES.items() if name in tables}
    return Chain(**{name: validated(table, tables[name], name).build() for name, table in given.items()})
