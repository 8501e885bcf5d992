"""What an arm's TOML file may hold: strict pydantic models at the file's edge, which build the records.

Types and names are checked here, physics in the records.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from tfarm.arm.link import Link
from tfarm.arm.records import MOST, Arm
from tfarm.arm.rig import Attachment, Gauge, Hub, Motor, Payload, RotarySpring
from tfarm.arm.sections import Section
from tfarm.errors import MISSING, ParameterError

_Part = TypeVar("_Part")


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
    """[link], or one [[link]] of several: exactly one of shear_modulus and poissons_ratio."""

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
    friction: float = 0.0
    radius: float = 0.0
    stiffness: float = 0.0


class SpringTable(Table):
    """[clamp] and [joint], optional."""

    stiffness: float = math.inf
    damping: float = 0.0

    def build(self) -> RotarySpring:
        return RotarySpring(**self.given())


class MotorTable(Table):
    """[motor], optional."""

    resistance: float
    torque_constant: float
    back_emf_constant: float | None = None
    inductance: float = 0.0
    gear_ratio: float = 1.0
    rotor_inertia: float = 0.0
    rotor_friction: float = 0.0
    gear_efficiency: float = 1.0


class AttachmentTable(Table):
    """One [[attachment]]."""

    x: float
    mass: float = 0.0
    inertia: float = 0.0
    stiffness: float = 0.0
    rotational_stiffness: float = 0.0

    def build(self) -> Attachment:
        return Attachment(**self.given())


class GaugeTable(Table):
    """[gauge], optional."""

    x: float = 0.0
    side: str = "outer"


class PayloadTable(Table):
    """[payload], optional."""

    mass: float = 0.0
    inertia: float = 0.0
    offset: float = 0.0


class ArmTable(Table):
    """The whole file, its [link] as a list of one."""

    name: str
    assumptions: list[str] = []
    theory: str = "timoshenko"
    input: str = "hub_torque"
    link: Annotated[list[LinkTable], Field(min_length=1, max_length=MOST)]
    hub: HubTable
    clamp: SpringTable = SpringTable()
    joint: SpringTable = SpringTable()
    motor: MotorTable | None = None
    attachment: Annotated[list[AttachmentTable], Field(max_length=MOST)] = []
    gauge: GaugeTable = GaugeTable()
    payload: PayloadTable = PayloadTable()

    def build(self) -> Arm:
        alone = len(self.link) == 1
        link, *outer = (_within("link" if alone else f"link.{i}", table.build) for i, table in enumerate(self.link, 1))
        attachments = (_within(f"attachment.{i}", table.build) for i, table in enumerate(self.attachment, 1))
        texts: dict[str, Any] = {
            key: getattr(self, key) for key in ("name", "theory", "input")
        }  # the record checks them
        return Arm(
            **texts,
            assumptions=tuple(self.assumptions),
            link=link,
            outer=tuple(outer),
            hub=Hub(**self.hub.given()),
            clamp=_within("clamp", self.clamp.build),
            joint=_within("joint", self.joint.build),
            motor=None if self.motor is None else Motor(**self.motor.given()),
            attachments=tuple(attachments),
            gauge=Gauge(**self.gauge.given()),
            payload=Payload(**self.payload.given()),
        )


def _within(place: str, build: Callable[[], _Part]) -> _Part:
    """What `build` gives; a ParameterError names the table's place in the file in its key's first word."""
    try:
        return build()
    except ParameterError as error:
        key = ".".join((place, *error.key.split(".")[1:]))
        raise ParameterError(key=key, value=error.value, remedy=error.remedy) from None


SHAPES: dict[str, type[Table]] = {"rectangle": Rectangle, "round": Round, "tube": Tube, "general": General}
TABLES: dict[str, type[Table]] = {
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
