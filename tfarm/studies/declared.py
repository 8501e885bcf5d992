"""A study declared by a small TOML file, which can be kept and run again:

arm = "sasaki2012-lab"                # preset or file, with its chain and its [law]
ask = ["card", "modes"]
draws = 2000
[over]
"payload.mass" = { uniform = [0.0, 0.2] }
"hub.inertia" = { normal = [0.1, 0.005] }
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from tfarm.arm import AnyLaw, Arm, as_law
from tfarm.arm.law_tables import load_law
from tfarm.arm.reading import arm_in, load_tables, presets
from tfarm.arm.schema import StrictTable, validated
from tfarm.arm.writing import LAW_DEFAULTS, law_toml, toml_tables, toml_text
from tfarm.dsp import Chain
from tfarm.dsp.chain import file_text, load_chain
from tfarm.errors import ParameterError, naming
from tfarm.files import mat_bytes, read_file
from tfarm.fitting.posterior import MOST_BYTES

from .quantities import CARD

STUDY_FILE, ARM_FILE, MATRICES, POSTERIOR = "study.toml", "arm.toml", "law.mat", "posterior.json"


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
    gains = None if law is None else law.gains
    same = gains if gains and as_law(gains) == law else law  # as gains, of which one of 0 can be varied
    paths = {name: folder / path for name in ("rows", "posterior") if (path := getattr(declared, name))}
    others = declared.model_dump(include={"over", "ask", "draws", "seed", "worst", "sobol"})
    return {"arm": arm_in(*load_tables(arm)), "law": same, "chain": load_chain(arm), **others, **paths}


def files_of(arm: Arm, law: AnyLaw, chain: Chain, declared: Mapping[str, Any]) -> dict[str, bytes]:
    """Return the files from which `load_study` has the study again, by their names.

    These are the study, the arm with its chain and its [law], the matrices of a law and the posterior, a copy.  A list
    keeps its place.
    """
    own, files = as_law(law), dict[str, bytes]()
    try:
        text = law_toml(own)
    except ParameterError:  # of a state space: it has no text
        columns = (*own.signals, *own.wanted)
        files[MATRICES] = mat_bytes(dict(zip("ABCD", own.matrices(columns), strict=True)))
        head = {key: getattr(own, key) for key, usual in LAW_DEFAULTS.items() if getattr(own, key) != usual}
        table = {"name": own.name, **head, "sign": -1, "matrices": MATRICES, "signals": columns}
        text = toml_text(toml_tables(table, "law"))
    places = {"rows": declared["rows"] and os.path.abspath(declared["rows"])}
    if declared["posterior"] is not None:
        files[POSTERIOR] = read_file(declared["posterior"], MOST_BYTES, key="posterior", what="a posterior's file")
        places["posterior"] = POSTERIOR
    over = {key: {kind: tuple(numbers) for kind, numbers in entry.items()} for key, entry in declared["over"].items()}
    kept = {"arm": ARM_FILE, **declared, **places, "ask": tuple(declared["ask"]), "over": over}
    study = toml_text(toml_tables({key: value for key, value in kept.items() if value or key == "seed"}))
    return {**files, ARM_FILE: f"{file_text(arm, chain)}\n{text}".encode(), STUDY_FILE: study.encode()}
