"""From a Law back to TOML: what `load_law` reads, to the last bit."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tfarm.arm.blocks import Rational
from tfarm.arm.law import Law, Part
from tfarm.errors import ParameterError
from tfarm.files import write_file

LAW_DEFAULTS: dict[str, Any] = {  # what a [law] is where it does not say otherwise
    "input": None, "delay": 0.0, "period": None, "sign": -1, "references": (), "rule": "tustin", "prewarp": 0.0,
}  # fmt: skip


def law_toml(law: Law) -> str:
    """The table [law] of a law; equal laws give equal text.

    Raises ParameterError for a law with a state space, which stands in a .mat file, and for one with two blocks on a
    signal.
    """
    head = [f"name = {json.dumps(law.name, ensure_ascii=False)}"]
    given = ((key, getattr(law, key), usual) for key, usual in LAW_DEFAULTS.items())
    head += [f"{key} = {_value(value)}" for key, value, usual in given if value != usual]
    names = [name for part in law.parts for name in part.signals]
    if len(set(names)) < len(names):
        raise ParameterError(key="law", value=law.name, remedy="two blocks on one signal: add them up to be saved")
    tables = [["[law]", *head], *(list(_signal(part)) for part in law.parts)]
    return "\n\n".join("\n".join(table) for table in tables) + "\n"


def save_law(law: Law, path: Path) -> None:
    """Write it beside, then rename."""
    write_file(path, law_toml(law).encode(), key="--save")


def _signal(part: Part) -> Iterable[str]:
    """The table of one signal; a name with its place along the link is quoted."""
    block, name = part.block, part.signals[0]
    if not isinstance(block, Rational) or len(part.signals) > 1:
        remedy = "a state space is kept in a .mat file: scipy.io.savemat(file, {'A': ..}), matrices = file in [law]"
        raise ParameterError(key="law", value=name, remedy=remedy)
    yield f"[law.{json.dumps(name) if '@' in name else name}]"
    if len(block.num) == len(block.den) == 1 and block.den[0] == 1.0:
        yield f"gain = {block.num[0]!r}"
    else:
        yield f"num = {_value(block.num)}"
        yield f"den = {_value(block.den)}"


def _value(value: Any) -> str:
    """Python's shortest exact digits are TOML's too."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value) if isinstance(value, str) else repr(value)
