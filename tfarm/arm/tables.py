"""What an arm's TOML file may hold: strict pydantic models at the file's edge, which build the records.

Types and names are checked here, physics in the records.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field

from tfarm.arm import declared
from tfarm.arm.declared import TomlTable
from tfarm.arm.link import Link
from tfarm.arm.records import MOST_PARTS, Arm
from tfarm.arm.rig import Attachment, Gauge, Hub, Motor, Payload, RotarySpring
from tfarm.arm.sections import Section
from tfarm.errors import MISSING, ParameterError

_Part = TypeVar("_Part")


@declared.of(Section.rectangle)
class Rectangle(TomlTable):
    """[link.section] with shape = "rectangle"."""

    shape: Literal["rectangle"]


@declared.of(Section.round)
class Round(TomlTable):
    """[link.section] with shape = "round"."""

    shape: Literal["round"]


@declared.of(Section.tube)
class Tube(TomlTable):
    """[link.section] with shape = "tube"."""

    shape: Literal["tube"]


@declared.of(Section.general)
class General(TomlTable):
    """[link.section] with shape = "general"."""

    shape: Literal["general"]


@declared.of(Link)
class LinkTable(TomlTable):
    """[link], or one [[link]] of several: exactly one of shear_modulus and poissons_ratio."""

    shear_modulus: float | None = None
    poissons_ratio: float | None = None
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


@declared.of(Hub)
class HubTable(TomlTable):
    """[hub]."""


@declared.of(RotarySpring)
class SpringTable(TomlTable):
    """[clamp] and [joint], optional."""


@declared.of(Motor)
class MotorTable(TomlTable):
    """[motor], optional."""


@declared.of(Attachment)
class AttachmentTable(TomlTable):
    """One [[attachment]]."""


@declared.of(Gauge)
class GaugeTable(TomlTable):
    """[gauge], optional."""


@declared.of(Payload)
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
        texts: dict[str, Any] = {
            key: getattr(self, key) for key in ("name", "theory", "input")
        }  # the record checks them
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


def _within(place: str, build: Callable[[], _Part]) -> _Part:
    """What `build` gives; a ParameterError names the table's place in the file in its key's first word."""
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
