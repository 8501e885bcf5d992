"""A study declared by a small TOML file, which can be kept and run again:

arm = "sasaki2012-lab"                # preset or file, with its chain and its [law]
ask = ["card", "modes"]
draws = 2000
[over]
"payload.mass" = { uniform = [0.0, 0.2] }
"hub.inertia" = { normal = [0.1, 0.005] }
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from tfarm.arm.law_tables import load_law
from tfarm.arm.reading import arm_in, load_tables, presets
from tfarm.arm.schema import StrictTable, validated
from tfarm.dsp.chain import load_chain
from tfarm.errors import naming

from .quantities import CARD


class StudyFile(StrictTable):
    """The keys of a study's file; paths are relative to its folder."""

    arm: str
    over: dict[str, dict[str, list[float]]] = Field(default_factory=dict)
    ask: list[str] = Field(default_factory=lambda: [CARD])
    law: str | None = None
    draws: int = 1000
    seed: int = 0
    rows: str | None = None
    posterior: str | None = None
    worst: str = ""
    sobol: int = 0


def is_study(tables: Mapping[str, Any]) -> bool:
    """Return whether a parsed TOML file declares a study: an arm's file names no arm."""
    return "arm" in tables


def load_study(name_or_path: str) -> dict[str, Any]:
    """Return the arguments of `study` that a file declares.  Raises ParameterError, naming the file."""
    tables, file = load_tables(name_or_path)
    folder = Path(file).parent
    with naming(file):
        declared = validated(StudyFile, tables, "")
    arm = declared.arm if declared.arm in presets() else str(folder / declared.arm)
    law = load_law(arm if declared.law is None else folder / declared.law)
    paths = {name: folder / path for name in ("rows", "posterior") if (path := getattr(declared, name))}
    others = declared.model_dump(include={"over", "ask", "draws", "seed", "worst", "sobol"})
    return {"arm": arm_in(*load_tables(arm)), "law": law, "chain": load_chain(arm), **others, **paths}
