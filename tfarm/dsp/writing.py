"""From an arm and its chain back to one TOML file: what `load` and `load_chain` read, to the last bit."""

from __future__ import annotations

import json
from dataclasses import fields

from tfarm.arm import Arm, to_toml
from tfarm.dsp.chain import Chain


def file_text(arm: Arm, chain: Chain | None = None) -> str:
    """The arm's TOML file with those tables of the chain that say more than the defaults; none: the arm alone."""
    tables = "" if chain is None else _tables(chain)
    return to_toml(arm) + tables


def _tables(chain: Chain) -> str:
    """[sampling], [converters], [actuator] and [slew], each key that differs from its default."""
    lines: list[str] = []
    for table in fields(chain):
        record = getattr(chain, table.name)
        default = type(record)()
        given = [f.name for f in fields(record) if getattr(record, f.name) != getattr(default, f.name)]
        if given:
            lines += ["", f"[{table.name}]", *(f"{name} = {_value(getattr(record, name))}" for name in given)]
    return "\n".join([*lines, ""]) if lines else ""


def _value(value: float | int | str) -> str:
    """Python's shortest exact digits are TOML's too, and so is inf; a text needs its quotes."""
    return json.dumps(value) if isinstance(value, str) else repr(value)
