"""What an arm's TOML file may hold: strict pydantic models at the file's edge, then the records.

Types and names are checked here, physics in the records; either way the first problem becomes one
ParameterError.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from tfarm.arm.link import Link
from tfarm.arm.records import Arm
from tfarm.arm.rig import Hub, Payload
from tfarm.arm.sections import Section
from tfarm.errors import MISSING, ParameterError, did_you_mean


class Table(BaseModel):
    """A TOML table: no unknown keys, no conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def given(self) -> dict[str, Any]:
        """What the file says, and nothing that it leaves out."""
        return {name: getattr(self, name) for name in self.model_fields_set}


class Rectangle(Table):
    """[link.section] with shape = "rectangle"."""

    shape: Literal["rectangle"]
    width: float
    depth: float
    shear_factor: float | None = None

    def build(self) -> Section:
        return Section.rectangle(width=self.width, depth=self.depth, shear_factor=self.shear_factor)


class Round(Table):
    """[link.section] with shape = "round"."""

    shape: Literal["round"]
    diameter: float
    shear_factor: float | None = None

    def build(self) -> Section:
        return Section.round(diameter=self.diameter, shear_factor=self.shear_factor)


class Tube(Table):
    """[link.section] with shape = "tube"."""

    shape: Literal["tube"]
    outer_diameter: float
    inner_diameter: float
    shear_factor: float | None = None

    def build(self) -> Section:
        return Section.tube(
            outer_diameter=self.outer_diameter,
            inner_diameter=self.inner_diameter,
            shear_factor=self.shear_factor,
        )


class General(Table):
    """[link.section] with shape = "general"."""

    shape: Literal["general"]
    area: float
    second_moment: float
    shear_factor: float

    def build(self) -> Section:
        return Section.general(area=self.area, second_moment=self.second_moment, shear_factor=self.shear_factor)


class LinkTable(Table):
    """[link]: exactly one of shear_modulus and poissons_ratio."""

    length: float
    density: float
    youngs_modulus: float
    shear_modulus: float | None = None
    poissons_ratio: float | None = None
    damping: float = 0.0
    section: Annotated[Rectangle | Round | Tube | General, Field(discriminator="shape")]

    def build(self) -> Link:
        given = {**self.given(), "section": self.section.build()}
        if self.shear_modulus is None and self.poissons_ratio is None:
            remedy = "give it in Pa, or give poissons_ratio"
            raise ParameterError(key="link.shear_modulus", value=MISSING, remedy=remedy)
        if self.shear_modulus is not None and self.poissons_ratio is not None:
            remedy = "shear_modulus is given too, and one follows from the other; leave one out"
            raise ParameterError(key="link.poissons_ratio", value=self.poissons_ratio, remedy=remedy)
        return Link(**given) if self.poissons_ratio is None else Link.isotropic(**given)


class HubTable(Table):
    """[hub]."""

    inertia: float


class PayloadTable(Table):
    """[payload], optional."""

    mass: float = 0.0
    inertia: float = 0.0


class ArmTable(Table):
    """The whole file."""

    name: str
    assumptions: list[str] = []
    link: LinkTable
    hub: HubTable
    payload: PayloadTable = PayloadTable()

    def build(self) -> Arm:
        return Arm(
            name=self.name,
            assumptions=tuple(self.assumptions),
            link=self.link.build(),
            hub=Hub(**self.hub.given()),
            payload=Payload(**self.payload.given()),
        )


SHAPES: dict[str, type[Table]] = {"rectangle": Rectangle, "round": Round, "tube": Tube, "general": General}
TABLES: dict[str, type[Table]] = {"": ArmTable, "link": LinkTable, "hub": HubTable, "payload": PayloadTable}
LOOP_TABLES = ("sampling", "converters", "actuator", "slew")  # of the sampled loop; tfarm.dsp reads them


def arm_of_table(table: dict[str, Any]) -> Arm:
    """The arm that a parsed TOML table describes."""
    try:
        own = {key: value for key, value in table.items() if key not in LOOP_TABLES}
        return ArmTable.model_validate(own).build()
    except ValidationError as error:
        raise _in_one_line(error.errors(include_url=False)) from None


def _in_one_line(problems: Sequence[ErrorDetails]) -> ParameterError:
    """The first problem; a key that is misspelt comes before the one that is then missing."""
    problem = min(problems, key=lambda problem: problem["type"] != "extra_forbidden")
    key, kind = _key(problem["loc"]), problem["type"]
    if kind in ("missing", "union_tag_not_found"):
        key = f"{key}.shape" if kind == "union_tag_not_found" else key
        return ParameterError(key=key, value=MISSING, remedy=f"give {_expected(key)}")
    if kind == "extra_forbidden":
        word = str(problem["loc"][-1])
        remedy = f"unknown key; {did_you_mean(word, _known_keys(problem['loc'][:-1]))}"
        return ParameterError(key=key, value=problem["input"], remedy=remedy)
    if kind == "union_tag_invalid":
        shape = str(problem["ctx"]["tag"])
        remedy = f"unknown shape; {did_you_mean(shape, SHAPES)}"
        return ParameterError(key=f"{key}.shape", value=shape, remedy=remedy)
    return ParameterError(key=key, value=problem["input"], remedy=f"wrong type; give {_expected(key)}")


def _key(place: Sequence[str | int]) -> str:
    """The TOML key of a pydantic location, which in a section names the shape as well."""
    in_section = tuple(place[:2]) == ("link", "section")
    return ".".join(map(str, [*place[:2], *place[3:]] if in_section else place))


def _expected(key: str) -> str:
    """What a key should hold."""
    known = {
        "name": 'a text such as name = "my-arm"',
        "assumptions": 'a list of texts such as ["density from the data sheet"]',
        "link.section.shape": f"one of {', '.join(SHAPES)}",
        **dict.fromkeys(("link", "hub", "payload", "link.section"), f"a table, headed [{key}]"),
    }
    is_text = key.startswith("assumptions.")
    return known.get(key, "a text in double quotes" if is_text else "a number without quotes, in SI units")


def _known_keys(place: Sequence[str | int]) -> list[str]:
    """The keys that the table at a pydantic location may have."""
    in_section = tuple(place[:2]) == ("link", "section")
    table = SHAPES[str(place[2])] if in_section else TABLES[str(place[0]) if place else ""]
    return list(table.model_fields)
