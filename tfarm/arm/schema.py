"""The tables of an arm's TOML file as strict pydantic models, each with the parameters of its record's constructor.

Types and names are checked here, physics in the records.  The first problem of a file becomes one ParameterError.
Label, unit and meaning of every key are in `keys.toml` and read by `file_key`.
"""

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files
from inspect import Parameter, signature
from typing import Any, ClassVar, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from tfarm.arm.materials import fill_material, material_assumptions, materials
from tfarm.arm.parts import Attachment, Gauge, Hub, Link, Motor, Payload, RotarySpring, Section
from tfarm.arm.records import MOST_PARTS, Arm
from tfarm.errors import MISSING, ParameterError, require, unknown_key
from tfarm.files import read_file
from tfarm.schema import Quantity

_Strict = TypeVar("_Strict", bound="StrictTable")
_AnyTable = TypeVar("_AnyTable", bound="TomlTable")
# keys before the first table
AT_THE_TOP = ("name", "assumptions", "theory", "input")


class StrictTable(BaseModel):
    """A table without unknown keys and conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class TomlTable(StrictTable):
    """A TOML table of the numbers of a record, whose model is built at its first use: most files have few of them."""

    model_config = ConfigDict(defer_build=True)
    makes: ClassVar[Callable[..., Any]]

    def build(self) -> Any:
        """Return the record of the table.  Raises ParameterError for illegal numbers."""
        # which has chosen the constructor of a section
        given = self.model_fields_set - {"shape"}
        return type(self).makes(**{name: getattr(self, name) for name in given})


def validate_table(model: type[_Strict], table: Any, place: str) -> _Strict:
    """Return the table headed [place] of a file, "" for its top.

    Raises ParameterError for anything but a table and for one wrong key, an unknown one before a missing one.
    """
    expected_types: dict[Any, str] = {
        float: "a number without quotes, in SI units",
        str: "a text in double quotes",
        list[str]: "a list of texts in double quotes",
        dict[str, Any]: "a table, headed [link.section]",
    }
    require(isinstance(table, dict), place, table, f"wrong type; give a table, headed [{place}]")
    try:
        return model.model_validate(table)
    except ValidationError as error:
        problem = min(
            error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden"
        )
    key = ".".join(filter(None, (place, *map(str, problem["loc"]))))
    word = str(problem["loc"][0])
    value = problem["input"]
    known = model.model_fields
    if word not in known:
        remedy = unknown_key(word, known)
        if place and word in AT_THE_TOP:
            remedy = f"unknown key; {word} belongs at the top of the file"
        raise ParameterError(key=key, value=value, remedy=remedy)
    expected = expected_types.get(known[word].annotation)
    if word in PART_TABLES:
        expected = f"a table, headed [{word}]"
    remedy = f"give {expected}" if expected else problem["msg"]
    if problem["type"] == "missing":
        raise ParameterError(key=key, value=MISSING, remedy=remedy)
    raise ParameterError(key=key, value=value, remedy=f"wrong type; {remedy}")


def validated_file(
    model: type[_Strict], path: str | os.PathLike[str], most: int, *, key: str, what: str
) -> _Strict:
    """Return the table of a JSON file of at most `most` bytes; `what` names the kind of file ("a tuner's file").

    Raises ParameterError, naming the file, for its first problem; one that cannot be read is named under `key`.
    """
    text = read_file(path, most, key=key, what=what)
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
    place = ".".join(map(str, problem["loc"])) or "file"
    value = {"json_invalid": os.fspath(path), "missing": MISSING}.get(problem["type"], problem["input"])
    raise ParameterError(
        key=place, value=value, remedy=f"{problem['msg']}; give {what}", file=os.fspath(path)
    )


def of(makes: Callable[..., Any]) -> Callable[[type[_AnyTable]], type[_AnyTable]]:
    """Decorate a table whose keys are the parameters of a constructor, with their names, types and defaults.

    Keys of the class itself are kept.
    """

    def with_keys(table: type[_AnyTable]) -> type[_AnyTable]:
        hints = get_type_hints(makes)
        own: dict[str, Any] = {}
        for name, each in signature(makes).parameters.items():
            # which is poissons_ratio in a file
            if name not in table.model_fields and name != "stated_ratio":
                own[name] = hints[name], ... if each.default is Parameter.empty else each.default
        made: type[_AnyTable] = create_model(table.__name__, __base__=table, __doc__=table.__doc__, **own)
        made.makes = makes
        return made

    return with_keys


class SectionTable(TomlTable):
    """[link.section]: its shape, and the numbers of that."""

    shape: str


@of(Link)
class LinkTable(TomlTable):
    """[link], or one [[link]] of several, with either shear_modulus or poissons_ratio.

    A material fills those that are left out, and the density and Young's modulus.
    """

    material: str | None = None
    shear_modulus: float | None = None
    poissons_ratio: float | None = None
    section: dict[str, Any]

    def build(self) -> Link:
        nu = self.poissons_ratio
        shape = self.section.get("shape", MISSING)
        require(shape in SHAPE_TABLES, "link.section.shape", shape, f"give one of {', '.join(SHAPE_TABLES)}")
        section = validate_table(SHAPE_TABLES[shape], self.section, "link.section").build()
        is_isotropic = self.material is None or materials()[self.material].is_isotropic
        # Cowper's needs a Poisson's ratio of at most 0.5
        if not is_isotropic and section.shear_factor is None:
            section = replace(section, shear_factor=section.cowper_factor(0.0))
        remedy = "give it in Pa, or give poissons_ratio"
        require(self.shear_modulus is not None or nu is not None, "link.shear_modulus", MISSING, remedy)
        remedy = "shear_modulus is given too, and one follows from the other; leave one out"
        require(self.shear_modulus is None or nu is None, "link.poissons_ratio", nu, remedy)
        numbers = {name: getattr(self, name) for name in self.model_fields_set - {"material", "section"}}
        return (Link if nu is None else Link.isotropic)(**numbers, section=section)


class ArmTable(StrictTable):
    """The whole file; its tables are read one by one."""

    name: str
    assumptions: list[str] = Field([])
    theory: str = "timoshenko"
    input: str = "hub_torque"
    link: Any
    hub: Any
    clamp: Any = None
    joint: Any = None
    motor: Any = None
    attachment: Any = Field([])
    gauge: Any = None
    payload: Any = None


SHAPE_TABLES: dict[str, type[TomlTable]] = {
    shape: of(getattr(Section, shape))(SectionTable) for shape in ("rectangle", "round", "tube", "general")
}
PART_TABLES: dict[str, type[TomlTable]] = {
    "link": LinkTable,
    "attachment": of(Attachment)(TomlTable),
    "hub": of(Hub)(TomlTable),
    "clamp": of(RotarySpring)(TomlTable),
    "joint": of(RotarySpring)(TomlTable),
    "motor": of(Motor)(TomlTable),
    "gauge": of(Gauge)(TomlTable),
    "payload": of(Payload)(TomlTable),
}


def arm_of_table(table: dict[str, Any]) -> Arm:
    """Return the arm of a parsed TOML table.  Raises ParameterError for the first problem."""
    # of the loop: read by other rooms
    loop_tables = ("sampling", "converters", "actuator", "slew", "law", "weights", "requirements")
    of_arm = {key: value for key, value in table.items() if key not in loop_tables}
    head = validate_table(ArmTable, of_arm, "")
    own = head.model_dump(exclude_unset=True)
    parts = parts_of_tables(own)
    own["assumptions"] = [*head.assumptions, *material_assumptions(_link_tables(head.link))]
    return Arm(**{name: own[name] for name in AT_THE_TOP if name in own}, **parts)


def parts_of_tables(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of an arm of which there are tables, by their names in `Arm`, in the order of their checks.

    Raises ParameterError for the first problem.
    """
    found: dict[str, Any] = {}
    if "link" in tables:
        wanted = "a table, headed [link], or [[link]] for each of several"
        link, *outer = _records("link", _link_tables(tables["link"]), wanted) or [None]
        require(link, "link", MISSING, f"give {wanted}")
        found = {"link": link, "outer": tuple(outer)}
    if "attachment" in tables:
        wanted = "a table for each, headed [[attachment]]"
        found["attachments"] = tuple(_records("attachment", tables["attachment"], wanted))
    for name in PART_TABLES:
        if name in tables and name not in ("link", "attachment"):
            found[name] = _record(name, name, tables[name])
    return found


def _link_tables(link: Any) -> Any:
    """Return the tables of links as a list, also the single [link]."""
    return [link] if isinstance(link, dict) else link


def _records(name: str, tables: Any, wanted: str) -> list[Any]:
    """Return the records of a list of tables, which have a number in messages; a single link has none."""
    require(isinstance(tables, list), name, tables, f"wrong type; give {wanted}")
    require(len(tables) <= MOST_PARTS, name, len(tables), f"at most {MOST_PARTS}")
    alone = name == "link" and len(tables) == 1
    return [_record(name, name if alone else f"{name}.{i}", table) for i, table in enumerate(tables, 1)]


@cache
def file_keys() -> dict[str, Quantity]:
    """Return label, unit and meaning of every key of a file: "top.name", "link.section.width", "law.SIGNAL.gain"."""
    tables = tomllib.loads((files("tfarm.arm") / "keys.toml").read_text("utf-8"))
    found: dict[str, Quantity] = {}
    for place, keys in tables.items():
        found |= {f"{place}.{key}": Quantity(**words) for key, words in keys.items()}
    return found


def file_key(key: str, arm: Arm | None = None) -> Quantity:
    """Return label, unit and meaning of a number such as "link.2.section.width", or of a sensor's "gain:1".

    The unit of a limit of the input is that of the arm's input where the arm is given, else "N m, V or A".
    """
    words = [word for word in key.partition(":")[0].split(".") if not word.isdecimal()]
    place = ["top" if words[0] in AT_THE_TOP else "sensor"] if len(words) == 1 else []
    found = file_keys()[".".join((*place, *words))]
    if arm is not None and found.unit == "N m, V or A":
        return replace(found, unit=arm.input_unit)
    return found


def _record(name: str, place: str, table: Any) -> Any:
    """Return the record of a table; the key of a ParameterError begins with its place in the file."""
    if name == "link":
        table = fill_material(table)
    try:
        return validate_table(PART_TABLES[name], table, name).build()
    except ParameterError as error:
        key = ".".join((place, *error.key.split(".")[1:]))
        raise ParameterError(key=key, value=error.value, remedy=error.remedy) from None
