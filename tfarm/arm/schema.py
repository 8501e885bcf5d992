"""The tables of an arm's TOML file as strict pydantic models, each with the parameters of its record's constructor.

Types and names are checked here, physics in the records.  The first problem of a file becomes one ParameterError.
Label, unit and meaning of every key are in `keys.toml` and read by `file_key`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from inspect import Parameter, signature
from typing import Annotated, Any, ClassVar, Literal, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model
from pydantic_core import ErrorDetails

from tfarm.arm.checks import INPUTS, THEORIES
from tfarm.arm.link import Link, Section
from tfarm.arm.records import MOST_PARTS, Arm
from tfarm.arm.rig import Attachment, Gauge, Hub, Motor, Payload, RotarySpring
from tfarm.errors import MISSING, ParameterError, did_you_mean, require
from tfarm.schema import Quantity

_Strict = TypeVar("_Strict", bound="StrictTable")
_Table = TypeVar("_Table", bound="TomlTable")
_Part = TypeVar("_Part")
LOOP_TABLES = ("sampling", "converters", "actuator", "slew", "law")  # of the loop: read by other rooms
OF_INPUT = "N m, V or A"  # unit of a limit of the input
AT_THE_TOP = ("name", "assumptions", "theory", "input")  # keys before the first table


class StrictTable(BaseModel):
    """A table without unknown keys and conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class TomlTable(StrictTable):
    """A TOML table of the numbers of a record."""

    makes: ClassVar[Callable[..., Any]]
    parameters: ClassVar[frozenset[str]]  # their names, read once: a fit builds a thousand arms

    def given(self) -> dict[str, Any]:
        """Return the keys of the file alone, without defaults."""
        return {name: getattr(self, name) for name in self.model_fields_set}

    def build(self) -> Any:
        """Return the record of the table.  Raises ParameterError for illegal numbers."""
        return type(self).makes(**{name: value for name, value in self.given().items() if name in self.parameters})


def validated(model: type[_Strict], table: object, place: str) -> _Strict:
    """Return the table headed [place] of a file.

    Raises ParameterError for anything but a table and for one wrong key, an unknown one before a missing one.
    """
    if not isinstance(table, dict):
        raise ParameterError(key=place, value=table, remedy=f"give a table, headed [{place}]")
    try:
        return model.model_validate(table)
    except ValidationError as error:
        problem = min(error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden")
    word, value = str(problem["loc"][0]), problem["input"]
    if problem["type"] == "extra_forbidden":
        remedy = f"unknown key; {did_you_mean(word, model.model_fields)}"
    elif problem["type"] == "missing":
        value, remedy = MISSING, f"[{place}] needs it"
    else:
        remedy = f"wrong value; {problem['msg'][:1].lower()}{problem['msg'][1:]}"
    raise ParameterError(key=f"{place}.{word}", value=value, remedy=remedy)


def of(makes: Callable[..., Any]) -> Callable[[type[_Table]], type[_Table]]:
    """Decorate a table whose keys are the parameters of a constructor, with their names, types and defaults.

    Keys of the class itself are kept.
    """

    def with_keys(table: type[_Table]) -> type[_Table]:
        hints, known = get_type_hints(makes), signature(makes).parameters.values()
        own: dict[str, Any] = {
            each.name: (hints[each.name], ... if each.default is Parameter.empty else each.default)
            for each in known
            if each.name not in table.model_fields
        }
        made: type[_Table] = create_model(table.__name__, __base__=table, __doc__=table.__doc__, **own)
        made.makes, made.parameters = makes, frozenset(hints) & frozenset(signature(makes).parameters)
        return made

    return with_keys


@of(Section.rectangle)
class Rectangle(TomlTable):
    """[link.section] with shape = "rectangle"."""

    shape: Literal["rectangle"]


@of(Section.round)
class Round(TomlTable):
    """[link.section] with shape = "round"."""

    shape: Literal["round"]


@of(Section.tube)
class Tube(TomlTable):
    """[link.section] with shape = "tube"."""

    shape: Literal["tube"]


@of(Section.general)
class General(TomlTable):
    """[link.section] with shape = "general"."""

    shape: Literal["general"]


@of(Link)
class LinkTable(TomlTable):
    """[link], or one [[link]] of several, with either shear_modulus or poissons_ratio."""

    shear_modulus: float | None = None
    poissons_ratio: float | None = None
    section: Annotated[Rectangle | Round | Tube | General, Field(discriminator="shape")]

    def build(self) -> Link:
        given = {**self.given(), "section": self.section.build()}
        nu = self.poissons_ratio
        require(
            self.shear_modulus is not None or nu is not None,
            "link.shear_modulus",
            MISSING,
            "give it in Pa, or give poissons_ratio",
        )
        remedy = "shear_modulus is given too, and one follows from the other; leave one out"
        require(self.shear_modulus is None or nu is None, "link.poissons_ratio", nu, remedy)
        return Link(**given) if nu is None else Link.isotropic(**given)


@of(Hub)
class HubTable(TomlTable):
    """[hub]."""


@of(RotarySpring)
class SpringTable(TomlTable):
    """[clamp] and [joint], optional."""


@of(Motor)
class MotorTable(TomlTable):
    """[motor], optional."""


@of(Attachment)
class AttachmentTable(TomlTable):
    """One [[attachment]]."""


@of(Gauge)
class GaugeTable(TomlTable):
    """[gauge], optional."""


@of(Payload)
class PayloadTable(TomlTable):
    """[payload], optional."""


class ArmTable(TomlTable):
    """The whole file, its [link] as a list of one."""

    name: str
    assumptions: list[str] = Field([])
    theory: str = "timoshenko"
    input: str = "hub_torque"
    link: Annotated[list[LinkTable], Field(min_length=1, max_length=MOST_PARTS)]
    hub: HubTable
    clamp: SpringTable = SpringTable()
    joint: SpringTable = SpringTable()
    motor: MotorTable | None = None
    attachment: Annotated[list[AttachmentTable], Field(max_length=MOST_PARTS)] = Field([])
    gauge: GaugeTable = GaugeTable()
    payload: PayloadTable = PayloadTable()

    def build(self) -> Arm:
        alone = len(self.link) == 1
        link, *outer = (_within("link" if alone else f"link.{i}", table.build) for i, table in enumerate(self.link, 1))
        attachments = (_within(f"attachment.{i}", table.build) for i, table in enumerate(self.attachment, 1))
        texts: dict[str, Any] = self.model_dump(include={"name", "theory", "input"})  # checked by the record
        return Arm(
            **texts,
            assumptions=tuple(self.assumptions),
            link=link,
            outer=tuple(outer),
            hub=self.hub.build(),
            clamp=_within("clamp", self.clamp.build),
            joint=_within("joint", self.joint.build),
            motor=None if self.motor is None else self.motor.build(),
            attachments=tuple(attachments),
            gauge=self.gauge.build(),
            payload=self.payload.build(),
        )


@cache
def file_keys() -> dict[str, Quantity]:
    """Return label, unit and meaning of every key of a file: "top.name", "link.section.width", "law.SIGNAL.gain"."""
    tables = tomllib.loads((files("tfarm.arm") / "keys.toml").read_text("utf-8"))
    return {f"{place}.{key}": Quantity(**words) for place, keys in tables.items() for key, words in keys.items()}


def file_key(key: str, arm: Arm | None = None) -> Quantity:
    """Return label, unit and meaning of a number such as "link.2.section.width", or of a sensor's "gain:1".

    A unit that is that of the arm's input is one of `OF_INPUT` where the arm is given, else all three.
    """
    words = [word for word in key.partition(":")[0].split(".") if not word.isdecimal()]
    place = ["top" if words[0] in AT_THE_TOP else "sensor"] if len(words) == 1 else []
    found = file_keys()[".".join((*place, *words))]
    return replace(found, unit=arm.input_unit) if arm is not None and found.unit == OF_INPUT else found


def _within(place: str, build: Callable[[], _Part]) -> _Part:
    """Return `build()`; the key of a ParameterError begins with the table's place in the file."""
    try:
        return build()
    except ParameterError as error:
        key = ".".join((place, *error.key.split(".")[1:]))
        raise ParameterError(key=key, value=error.value, remedy=error.remedy) from None


SHAPE_TABLES: dict[str, type[TomlTable]] = {"rectangle": Rectangle, "round": Round, "tube": Tube, "general": General}
ARM_TABLES: dict[str, type[TomlTable]] = {
    "": ArmTable,
    "link": LinkTable,
    "hub": HubTable,
    "clamp": SpringTable,
    "joint": SpringTable,
    "motor": MotorTable,
    "attachment": AttachmentTable,
    "gauge": GaugeTable,
    "payload": PayloadTable,
}


def arm_of_table(table: dict[str, Any]) -> Arm:
    """Return the arm of a parsed TOML table.  Raises ParameterError for the first problem."""
    own = {key: value for key, value in table.items() if key not in LOOP_TABLES}
    if isinstance(own.get("link"), dict):
        own["link"] = [own["link"]]
    try:
        return ArmTable.model_validate(own).build()
    except ValidationError as error:
        links = own.get("link")
        alone = not isinstance(links, list) or len(links) < 2
        raise _in_one_line(error.errors(include_url=False), alone) from None


def _in_one_line(problems: Sequence[ErrorDetails], alone: bool) -> ParameterError:
    """Return the error of the first problem, an unknown key before a missing one.

    `alone` is whether there is one link, which has no number.
    """
    problem = min(problems, key=lambda problem: problem["type"] != "extra_forbidden")
    place, kind = problem["loc"], problem["type"]
    numbered = len(place) > 1 and (place[0] == "attachment" or (place[0] == "link" and not alone))
    words = (place[0], *([int(place[1]) + 1] if numbered else []), *_without_shape(place)[1:])  # counted from 1
    key, value = ".".join(map(str, words if place[0] in ("link", "attachment") else place)), problem["input"]
    if kind in ("missing", "too_short"):
        return ParameterError(key=key, value=MISSING, remedy=f"give {_expected(place)}")
    if kind == "union_tag_not_found":
        return ParameterError(key=f"{key}.shape", value=MISSING, remedy=f"give one of {', '.join(SHAPE_TABLES)}")
    if kind == "extra_forbidden":
        word, names = str(place[-1]), [name for name in place[:-1] if isinstance(name, str)]
        table = SHAPE_TABLES[names[2]] if names[:2] == ["link", "section"] else ARM_TABLES[names[0] if names else ""]
        meant = did_you_mean(word, table.model_fields)
        if names and word in AT_THE_TOP:
            meant = f"{word} belongs at the top of the file, before its first table"
        return ParameterError(key=key, value=value, remedy=f"unknown key; {meant}")
    if kind == "union_tag_invalid":
        shape = str(problem["ctx"]["tag"])
        remedy = f"unknown shape; {did_you_mean(shape, SHAPE_TABLES)}"
        return ParameterError(key=f"{key}.shape", value=shape, remedy=remedy)
    if kind == "too_long":
        return ParameterError(key=key, value=problem["ctx"]["actual_length"], remedy=f"at most {MOST_PARTS}")
    return ParameterError(key=key, value=value, remedy=f"wrong type; give {_expected(place)}")


def _without_shape(place: Sequence[str | int]) -> tuple[str, ...]:
    """Return the names of a pydantic location, without list numbers and without the shape between section and key."""
    names = tuple(name for name in place if isinstance(name, str))
    return names[:2] + names[3:] if names[:2] == ("link", "section") else names


def _expected(place: Sequence[str | int]) -> str:
    """Return the expected value of a key in words."""
    key = ".".join(_without_shape(place))
    known = {
        "name": 'a text such as name = "my-arm"',
        "assumptions": "a text in double quotes" if place[1:] else 'a list of texts such as ["density from a table"]',
        "theory": f"one of {', '.join(THEORIES)}, in double quotes",
        "input": f"one of {', '.join(INPUTS)}, in double quotes",
        "link.section.shape": f"one of {', '.join(SHAPE_TABLES)}",
        "link": "a table, headed [link], or [[link]] for each of several",
        "attachment": "a table for each, headed [[attachment]]",
        **dict.fromkeys(("hub", "clamp", "joint", "motor", "payload", "link.section"), f"a table, headed [{key}]"),
    }
    return known.get(key, "a number without quotes, in SI units")
