"""The file that declares a study: its arguments read, and written with the files that it names."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tfarm.arm.chain import file_text, load_chain
from tfarm.arm.law_tables import load_law
from tfarm.arm.reading import AnyFile, load, load_tables, presets
from tfarm.arm.schema import StrictTable, validate_table
from tfarm.arm.writing import law_head, law_toml, toml_tables, toml_text
from tfarm.case import Case
from tfarm.errors import ParameterError, name_file
from tfarm.files import mat_content
from tfarm.studies.running import (
    STUDY_FILE,
)

PATHS = "rows", "posterior"


class StudyFile(StrictTable):
    """The file of a study: the arguments of `study` that it declares."""

    arm: str
    law: str = ""
    rows: str = ""
    posterior: str = ""
    over: dict[str, Any] | None = None
    ask: list[str] | None = None
    draws: int = 0
    seed: int = 0
    worst: str = ""
    sobol: int = 0


def load_study(name_or_path: AnyFile) -> dict[str, Any]:
    """Return the arguments of `study` that a file declares; its paths are relative to its folder.

    Raises ParameterError, naming the file.
    """
    tables, file = load_tables(name_or_path)
    folder = Path(file).parent
    with name_file(file):
        declared = validate_table(StudyFile, tables, "").model_dump(exclude_unset=True)
    arm = load_tables(declared["arm"] if declared["arm"] in presets() else str(folder / declared["arm"]))
    law = load_law(folder / declared["law"] if "law" in declared else arm)
    own = {key: folder / value if key in PATHS else value for key, value in declared.items()}
    return {**own, "arm": load(arm), "law": law, "chain": load_chain(arm)}


def files_of(case: Case, declared: Mapping[str, Any]) -> dict[str, bytes]:
    """Return the files from which `load_study` has the study again, by their names.

    These are the study, the arm with its chain and its [law], and the matrices of a law.  A list and a posterior keep
    their places.
    """
    arm_file = "arm.toml"
    matrices = "law.mat"
    own = case.law
    files = dict[str, bytes]()
    try:
        text = law_toml(own)
    except ParameterError:
        # of a state space: it has no text
        columns = (*own.signals, *own.wanted)
        files[matrices] = mat_content(dict(zip("ABCD", own.matrices(columns), strict=True)), "column")
        table = {**law_head(own), "sign": -1, "matrices": matrices, "signals": columns}
        text = toml_text(toml_tables(table, "law"))
    places = {key: declared[key] and os.path.abspath(declared[key]) for key in PATHS}
    over = {}
    for key, entry in declared["over"].items():
        over[key] = {kind: tuple(numbers) for kind, numbers in entry.items()}
    kept = {"arm": arm_file, **declared, **places, "ask": tuple(declared["ask"]), "over": over}
    study = toml_text(toml_tables({key: value for key, value in kept.items() if value or key == "seed"}))
    return {
        **files,
        arm_file: f"{file_text(case.arm, case.chain)}\n{text}".encode(),
        STUDY_FILE: study.encode(),
    }
