"""The table [law] of a TOML file: of an arm's file, or of a file of its own.

    [law]
    input = "hub_torque"        # else that of the arm's file
    delay = 0.004               # s
    [law.hub_angle]
    num = [2.0, 1.0]            # descending powers of s; of z with a period
    den = [0.01, 1.0]
    [law.strain]
    x = 0.02                    # m from the clamp, for an output along the link
    gain = 3.0                  # with zeros = [...] and poles = [...] too

or `matrices = "file.mat"` with A, B, C, D and `signals = [...]`, a name for each column of B.

    [weights]                   # on S, K S and T, for `tfarm norm`
    KS = 0.1
    [weights.S]
    num = [0.5, 2.0]            # of s; of z with a period
    den = [1.0, 0.02]
"""

from pathlib import Path
from typing import Any

from pydantic import Field

from tfarm.arm.law import Law
from tfarm.arm.reading import AnyFile, load_tables
from tfarm.arm.schema import StrictTable, validate_table
from tfarm.arm.weights import Weights, weights_of
from tfarm.errors import MISSING, ParameterError, close_to, list_within, must_be_known, name_file, require
from tfarm.files import read_mat


class LawTable(StrictTable):
    """[law], without the tables of its signals."""

    name: str = "law"
    input: str | None = None
    delay: float = 0.0
    period: float | None = None
    sign: int = -1
    references: list[str] = Field(default_factory=list)
    rule: str = "tustin"
    prewarp: float = 0.0
    anti_windup: float = 0.0
    matrices: str | None = None
    system: str | None = None
    signals: list[str] | None = None
    scales: list[float] | None = None


class SignalTable(StrictTable):
    """[law.SIGNAL]: a gain, num and den, or zeros, poles and a gain."""

    gain: float | None = None
    num: list[float] | None = None
    den: list[float] | None = None
    zeros: list[float | list[float]] | None = None
    poles: list[float | list[float]] | None = None
    x: float | None = None

    def build(self, key: str) -> Any:
        """Return the entry of `Law`.  Raises ParameterError for keys that exclude each other."""
        if self.num is not None:
            is_alone = self.gain is None and self.zeros is None and self.poles is None
            require(is_alone, f"{key}.num", self.num, "either num and den, or zeros, poles, gain")
            return tuple(self.num), tuple(self.den or [1.0])
        require(self.den is None, f"{key}.num", MISSING, "den needs num")
        require(self.gain is not None, f"{key}.gain", MISSING, "give gain, or num and den")
        return {"zeros": self.zeros or (), "poles": self.poles or (), "gain": self.gain}


class WeightTable(StrictTable):
    """[weights]: a number or a table as of [law.SIGNAL] for each of S, KS and T."""

    period: float | None = None
    S: Any = None
    KS: Any = None
    T: Any = None


def load_weights(name_or_path: AnyFile) -> Weights | None:
    """Return the weights of a file's [weights] table, None where it has none.

    Raises ParameterError, naming the file, for an unknown key, a wrong type or an illegal value.
    """
    tables, file = load_tables(name_or_path)
    if "weights" not in tables:
        return None
    with name_file(file):
        head = validate_table(WeightTable, tables["weights"], "weights")
        entries = {}
        for name, value in head.model_dump(exclude={"period"}, exclude_none=True).items():
            if isinstance(value, dict):
                key = f"weights.{name}"
                block = validate_table(SignalTable, value, key)
                require(block.x is None, f"{key}.x", block.x, "a weight has no place; leave it out")
                entries[name] = block.build(key)
            else:
                entries[name] = value
        return weights_of(entries, head.period)


def load_law(name_or_path: AnyFile) -> Law | None:
    """Return the law of a file's [law] table, None where it has none.

    Raises ParameterError, naming the file, for an unknown key, a wrong type or an illegal value.
    """
    tables, file = load_tables(name_or_path)
    with name_file(file):
        if "law" in tables:
            return law_of_table(tables["law"], Path(file).parent)
        return None


def law_of_table(table: Any, folder: Path) -> Law:
    """Return the law of a parsed [law] table; the path of a .mat file is relative to `folder`."""
    require(isinstance(table, dict), "law", table, "give a table, headed [law]")
    signals = {key: value for key, value in table.items() if isinstance(value, dict)}
    others = {key: value for key, value in table.items() if key not in signals}
    # hub_angle = 2.0, and no misspelt delay
    for key, value in others.items():
        is_signal = type(value) in (int, float) and not close_to(key, LawTable.model_fields)
        remedy = f"a signal has a table of its own: [law.{key}] with gain = {value}"
        require(not is_signal, f"law.{key}", value, remedy)
    head = validate_table(LawTable, others, "law")
    common = head.model_dump(exclude={"matrices", "system", "signals", "scales"})
    try:
        if head.matrices is not None:
            remedy = "either matrices and signals, or a table for each signal"
            require(not signals, next(iter(signals), ""), MISSING, remedy)
            return _of_file(head, folder, common)
        is_alone = head.signals is None and head.system is None and head.scales is None
        require(is_alone, "matrices", MISSING, "signals, system and scales need a .mat file")
        entries = {}
        for name, values in signals.items():
            place = f"law.{name}"
            block = validate_table(SignalTable, values, place)
            signal = name if block.x is None else f"{name}@{block.x!r}"
            entries[signal] = block.build(place)
        return Law(entries, **common)
    except ParameterError as error:
        key = error.key if error.key.startswith("law") else f"law.{error.key}"
        raise ParameterError(key=key, value=error.value, remedy=error.remedy) from None


def _of_file(head: LawTable, folder: Path, common: dict[str, Any]) -> Law:
    """Return the law of a .mat file with A, B, C and D, or of its structure named `system`."""
    signals = head.signals or []
    require(signals, "signals", MISSING, "name a signal for each column of B")
    # bytes at most
    found, _ = read_mat(folder / str(head.matrices), 16 << 20, key="matrices")
    place = ""
    if head.system is not None:
        structures = dict.fromkeys(name.partition(".")[0] for name in found if "." in name)
        must_be_known("system", head.system, structures)
        place = f"{head.system}."
    missing = [name for name in "ABCD" if f"{place}{name}" not in found]
    remedy = f"holds no {', '.join(missing)}; it has {list_within(found, 300)} (system = names a structure)"
    require(not missing, "matrices", head.matrices, remedy)
    A, B, C, D = (found[f"{place}{name}"] for name in "ABCD")
    law = Law.of_matrices(A, B, C, D, signals, **common)
    if head.scales is None:
        return law
    require(len(head.scales) == len(signals), "scales", head.scales, "one number for each signal")
    (part,) = law.parts
    # of finite numbers now
    A, B, C, D = part.block.matrices()
    return Law.of_matrices(A, B * head.scales, C, D * head.scales, signals, **common)
