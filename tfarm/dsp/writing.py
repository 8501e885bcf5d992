"""From an arm and its chain back to one TOML file: what `load` and `load_chain` read, to the last bit."""

from __future__ import annotations

import json
from dataclasses import fields

from tfarm.arm import Arm, to_toml
from tfarm.dsp.chain import Chain


def file_text(arm: Arm, chain: Chain | None = None) -> str:
    """The arm's TOML file with those tables of the chain that say more than the defaults; none: the arm alone.

    Of [sampling], [converters], [actuator] and [slew] each key that differs from its default.  Python's shortest exact
    digits are TOML's too, and so is inf; a text needs its quotes.
    """
    lines: list[str] = []
    for table in () if chain is None else fields(chain):
        record = getattr(chain, table.name)
        default = type(record)()
        given = {f.name: getattr(record, f.name) for f in fields(record)}
        given = {name: value for name, value in given.items() if value != getattr(default, name)}
        texts = (json.dumps(value) if isinstance(value, str) else repr(value) for value in given.values())
        if given:
            lines += ["", f"[{table.name}]", *map(" = ".join, zip(given, texts, strict=True))]
    return to_toml(arm) + ("\n".join([*lines, ""]) if lines else "")
