"""Arms and laws as TOML that `load` and `load_law` read back to the last bit.

The numbers of an arm have keys, those of its TOML file, such as "link.2.section.width".
"""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from tfarm.arm.blocks import Rational
from tfarm.arm.law import Law, Part
from tfarm.arm.materials import SHEAR, of_material
from tfarm.arm.parts import Link, repr_fields
from tfarm.arm.records import MOST_PARTS, Arm
from tfarm.arm.schema import file_keys, parts_of_tables
from tfarm.errors import ParameterError, must_be_known, require
from tfarm.files import write_file


def to_toml(arm: Arm) -> str:
    """Return the arm as a TOML file; equal arms have equal texts.

    The numbers of the paper's arm are always there, others only where they differ from their defaults.
    """
    return toml_text(toml_tables(arm_table(arm)))


def arm_table(arm: Arm) -> dict[str, Any]:
    """Return the tables of the arm's file, as `arm_of_table` reads them."""
    links = [_link_table(link) for link in arm.links]
    motor = arm.motor
    tables: dict[str, Any] = {
        "name": arm.name,
        "assumptions": list(arm.assumptions),
        "theory": None if arm.theory == "timoshenko" else arm.theory,
        # required with a motor
        "input": None if arm.input == "hub_torque" and motor is None else arm.input,
        "link": links if arm.outer else links[0],
        "hub": repr_fields(arm.hub, always=1),
        "clamp": repr_fields(arm.clamp, always=0) or None,
        "joint": repr_fields(arm.joint, always=0) or None,
        "motor": motor and repr_fields(motor, always=2),
        "attachment": [repr_fields(each, always=1) for each in arm.attachments] or None,
        "gauge": {"x": arm.gauge.x, "side": arm.gauge.side} if arm.gauge.x else None,
        "payload": repr_fields(arm.payload, always=2),
    }
    # its default
    if motor is not None and motor.back_emf_constant == motor.torque_constant:
        del tables["motor"]["back_emf_constant"]
    return {key: value for key, value in tables.items() if value is not None}


def _link_table(link: Link) -> dict[str, Any]:
    """Return the table of a link, in it that of its section: its dimensions, or else its area and second moment."""
    section = link.section
    numbers = dict(section.dimensions) or {"area": section.area, "second_moment": section.second_moment}
    factor = {} if section.shear_factor is None else {"shear_factor": section.shear_factor}
    own = _link_numbers(link)
    if link.stated_ratio is None:
        del own["poissons_ratio"]
    else:
        del own["shear_modulus"]
        own["poissons_ratio"] = link.stated_ratio
    return {**own, "section": {"shape": section.shape, **numbers, **factor}}


def _link_numbers(link: Link) -> dict[str, float]:
    """Return the numbers of a link by their keys, without those of its section."""
    names = ("length", "density", "youngs_modulus", "shear_modulus", "damping", "poissons_ratio")
    return {name: getattr(link, name) for name in names}


def law_toml(law: Law) -> str:
    """Return the table [law] of a law; equal laws have equal texts.

    Raises ParameterError for a law with a state space, whose form is a .mat file, and for two blocks on one signal.
    """
    names = law.columns
    require(len(set(names)) == len(names), "law", law.name, "two blocks on one signal: add them up first")
    signals = {part.signals[0]: _signal_table(part) for part in law.parts}
    return toml_text(toml_tables(law_head(law) | signals, "law"))


def law_head(law: Law) -> dict[str, Any]:
    """Return the keys of [law] but its signals: the name, and what is not at its default."""
    keys = ("input", "delay", "period", "sign", "references", "rule", "prewarp", "anti_windup")
    head = {key: getattr(law, key) for key in keys if getattr(law, key) != getattr(Law, key)}
    return {"name": law.name, **head}


def save_law(law: Law, path: Path) -> None:
    """Write a law as a TOML file.  Raises ParameterError where it cannot be written."""
    write_file(path, law_toml(law).encode(), key="--save")


def _signal_table(part: Part) -> dict[str, Any]:
    """Return the table of one signal."""
    block = part.block
    if not isinstance(block, Rational) or len(part.signals) > 1:
        remedy = (
            "save a state space as a .mat file: scipy.io.savemat(file, {'A': ..}), matrices = file in [law]"
        )
        raise ParameterError(key="law", value=part.signals[0], remedy=remedy)
    is_gain = block.is_constant and block.den == (1.0,)
    if is_gain:
        return {"gain": block.num[0]}
    return {"num": block.num, "den": block.den}


def toml_text(tables: Iterable[list[str]]) -> str:
    """Return the lines of tables, with an empty one between two."""
    return "\n\n".join("\n".join(table) for table in tables) + "\n"


def toml_tables(table: Mapping[str, Any], place: str = "", heading: str = "[{}]") -> Iterator[list[str]]:
    """Yield the lines of a table with its heading, then those of the tables in it."""
    lists = {key: value if isinstance(value, list) else [value] for key, value in table.items()}
    inner = {key: each for key, each in lists.items() if each and isinstance(each[0], dict)}
    head = [heading.format(place)] if place else []
    yield [*head, *(f"{key} = {_value(value)}" for key, value in table.items() if key not in inner)]
    for key, tables in inner.items():
        name = json.dumps(key) if {*"@."} & {*key} else key
        where = f"{place}.{name}" if place else name
        for each in tables:
            yield from toml_tables(each, where, "[[{}]]" if tables is table[key] else "[{}]")


def _value(value: Any) -> str:
    """Return a TOML value, a list with a line an entry; the repr of a float, inf too, is valid TOML."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list):
        return "\n".join(["[", *(f"    {_value(each)}," for each in value), "]"])
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)


class KeyedArms:
    """Arms with other values of some numbers of one arm, by their TOML keys.

    With Young's modulus the shear modulus changes too, at a constant Poisson's ratio, but for a key in `alone` whose
    link has a stated shear modulus.  Raises ParameterError, naming `what`, for an unknown key, with the nearest.
    """

    def __init__(
        self, arm: Arm, keys: Sequence[str], what: str = "free", alone: Collection[str] = ()
    ) -> None:
        self.arm = arm
        self.keys = tuple(keys)
        self.alone = alone
        self._table = arm_table(arm)
        self._numbers = numbers_of(arm)
        for key in keys:
            must_be_known(what, key, self._numbers)
            require(keys.count(key) == 1, what, key, "is named twice; once is enough")

    def at(self, values: Mapping[str, float]) -> Arm:
        """Return the arm with other values of numbers.  Raises ParameterError for an illegal value."""
        # the other parts stay as they are, and so they are not checked again
        changed = {key.partition(".")[0] for key in values}
        table = {name: deepcopy(self._table.get(name, {})) for name in changed}
        for key, value in values.items():
            here, name = _table_of(table, key)
            if name == "youngs_modulus" and "shear_modulus" in here and self.is_shear_scaled(key):
                here["shear_modulus"] *= value / here[name]
            if name in SHEAR:
                for other in SHEAR:
                    here.pop(other, None)
            here[name] = value
        return replace(self.arm, **parts_of_tables(table))

    def is_shear_scaled(self, key: str) -> bool:
        """Return whether the shear modulus of a link changes with its Young's modulus, which has that key."""
        place = key.removesuffix("youngs_modulus")
        if any(f"{place}{name}" in self.keys for name in SHEAR):
            return False
        return key not in self.alone or "shear_modulus" not in _table_of(self._table, key)[0]

    def value(self, key: str) -> float:
        """Return a number of the arm, from its file or its default."""
        return self._numbers[key]


def numbers_of(arm: Arm) -> dict[str, float]:
    """Return all numbers of an arm by their keys, also those at their defaults."""
    found: dict[str, float] = {}
    for n, link in enumerate(arm.links, 1):
        place = f"link.{n}" if arm.outer else "link"
        found |= {f"{place}.{name}": value for name, value in _link_numbers(link).items()}
        section = _link_table(link)["section"]
        del section["shape"]
        found |= {f"{place}.section.{name}": value for name, value in section.items()}
    parts = {name: getattr(arm, name) for name in ("hub", "clamp", "joint", "payload", "motor")}
    parts |= {f"attachment.{n}": each for n, each in enumerate(arm.attachments, 1)}
    for place, part in parts.items():
        if part is not None:
            numbers = repr_fields(part, always=MOST_PARTS)
            found |= {f"{place}.{name}": value for name, value in numbers.items()}
    return found


def _table_of(table: dict[str, Any], key: str) -> tuple[dict[str, Any], str]:
    """Return the innermost table of a key, a new one where there is none, and the name in it."""
    *places, name = key.split(".")
    here: Any = table
    for place in places:
        here = here[int(place) - 1] if isinstance(here, list) else here.setdefault(place, {})
    return here, name


# ------------------------------------------------------------ a first file


def first_file(tables: Mapping[str, Any]) -> str:
    """Return the text of an arm's file with these tables, each line with a comment, and examples of other tables."""
    head = "# An arm of tfarm, in SI units throughout.\n"
    replaced = "density, youngs_modulus, shear_modulus or poissons_ratio in [link] replace the numbers of the material"
    # example of a link without damping
    undamped = "# damping = 0.0003"
    text = head
    if (found := of_material(tables["link"])) is not None:
        text += f"# {found[0].words(found[1])}\n# usual range: {found[0].range}\n# {replaced}\n"
    for lines in toml_tables(tables):
        place = lines[0].strip("[]") if lines[0].startswith("[") else "top"
        if place == "link" and "damping" not in tables["link"]:
            lines = [*lines, undamped]
        text += "".join(["\n", *(f"{_with_comment(line, place)}\n" for line in lines)])
    return text + (files("tfarm.arm") / "first_file.txt").read_text("utf-8")


def _with_comment(line: str, place: str) -> str:
    """Return a line of a table with unit and meaning of its key, or of the table, where they are declared."""
    # column of a comment, if the value is no longer
    comment_at = 24
    key = line.removeprefix("# ").partition(" = ")[0]
    words = file_keys().get(f"top.{place}" if key.startswith("[") else f"{place}.{key}")
    if words is None:
        return line
    unit = f"[{words.unit}] " if words.unit else ""
    return f"{line:<{comment_at}}  # {unit}{words.help}"
