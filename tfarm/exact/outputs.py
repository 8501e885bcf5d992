"""The outputs of the arm: a power of s times one quantity of the exact solution, at the hub, at the tip or at x.

A new power of s or place is one row of `outputs.toml`.  A new quantity has there its places and its unit, here its
letter and whether the appendix has it, and in `reading_of` (`layout`) its weights of W, Psi, M and Q.  Signs as in the
paper: root moment E I phi'(0), shear force kappa G A (w' - psi).
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal, get_args

from tfarm.arm.checks import INPUT_UNITS, whole
from tfarm.errors import must_be_known, require

# theta, M, Q, W, W - (r + x) theta, Psi - theta: hub angle, moment, shear force, displacement, deflection, rotation;
# Psi: rotation in space;
# bending strain at the surface, displacement of the payload's centre of mass, current of the motor
OutputQuantity = Literal["theta", "M", "Q", "W", "Y", "Phi", "Psi", "strain", "centre", "current"]
OutputPlace = Literal["root", "tip", "x"]
# of a joint of two segments, or of an attachment
Side = Literal["outer", "inner"]

_TABLES = tomllib.loads((Path(__file__).parent / "outputs.toml").read_text(encoding="utf-8"))
# SI unit of each quantity, and the places where it is known
QUANTITIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {name: (each["unit"], *each["places"]) for name, each in _TABLES["quantity"].items()}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """s^power times a quantity at a place; `gauge` divides by 1 + C s (a strain gauge has no part of the damping).

    `label` has its words, `name` its identifier, by default the label's words joined by underscores.  `unit` is its SI
    unit, by default that of the quantity and the power.
    Raises ParameterError, naming the key and the remedy, for illegal values.
    """

    quantity: OutputQuantity
    place: OutputPlace
    unit: str = ""
    power: int = 0
    gauge: bool = False
    side: Side = "outer"
    label: str
    name: str = ""

    def __post_init__(self) -> None:
        # of s: rate, acceleration, jerk and its rate
        most_power = 4
        has_word = isinstance(self.label, str) and re.search(r"\w", self.label)
        require(has_word, "output.label", self.label, "a text with a word")
        if not self.name:
            object.__setattr__(self, "name", "_".join(re.findall(r"\w+", self.label)))
        is_name = isinstance(self.name, str) and re.fullmatch(r"\w+", self.name)
        require(is_name, "output.name", self.name, "letters, digits and underscores")
        must_be_known("output.quantity", self.quantity, QUANTITIES)
        unit, *places = QUANTITIES[self.quantity]
        require(
            self.place in places,
            "output.place",
            self.place,
            f"{self.quantity} is known at: {', '.join(places)}",
        )
        whole(
            "output.power", self.power, 0, most_power, f"a power of s: a whole number from 0 to {most_power}"
        )
        is_gauge = isinstance(self.gauge, bool) and (not self.gauge or self.quantity in ("M", "strain"))
        remedy = "true or false, true for a moment only: a strain gauge measures E I phi' without its damping"
        require(is_gauge, "output.gauge", self.gauge, remedy)
        if self.power == 1:
            unit += "/s"
        elif self.power:
            unit += f"/s^{self.power}"
        require(self.unit in ("", unit), "output.unit", self.unit, f'values are in SI units, here "{unit}"')
        object.__setattr__(self, "unit", unit)

    @property
    def is_in_appendix(self) -> bool:
        """Whether the paper's appendix has it."""
        along = self.quantity == "W" and self.place == "x"
        is_of_rig = self.side == "inner" or self.quantity in ("Psi", "strain", "centre", "current")
        return not (along or is_of_rig)

    @property
    def base(self) -> Output:
        """The same quantity without its power of s."""
        return replace(self, power=0, unit="")

    def share(self, x: float) -> float:
        """Return its place as a share of the length; x is that share for an output along the arm."""
        return {"root": 0.0, "tip": 1.0, "x": x}[self.place]


def _named_outputs() -> dict[str, Output]:
    """Return the outputs of the table by their names."""
    rows = [Output(**row) for row in _TABLES["output"]]
    return {each.name: each for each in rows}


OUTPUTS: Mapping[str, Output] = MappingProxyType(_named_outputs())


def output(wanted: str | Output) -> Output:
    """Return the output of a name, or the output itself.  Raises ParameterError with the nearest name."""
    if isinstance(wanted, Output):
        is_free = OUTPUTS.get(wanted.name, wanted) == wanted
        require(is_free, "output.name", wanted.name, "the name of another output; choose one")
        return wanted
    require(isinstance(wanted, str), "output", wanted, "the name of an output, or an Output")
    must_be_known("output", wanted, OUTPUTS)
    return OUTPUTS[wanted]


def on_side(wanted: str | Output, side: Side) -> Output:
    """Return an output along the arm on that side of a joint of two segments, or of an attachment.

    One on the inner side has another name.  Raises ParameterError for an output at root or tip.
    """
    found = output(wanted)
    must_be_known("side", side, get_args(Side))
    remedy = f"{found.name} has a fixed place; give an output along the arm, such as moment with its x"
    require(found.place == "x", "side", side, remedy)
    if side == found.side:
        return found
    return replace(found, side=side, name=f"{found.name}_{side}", label=f"{found.label}, {side} side")


def signal_words(name: str) -> tuple[str, str]:
    """Return label and SI unit of an output or input, with its place: ("bending strain at x = 0.05 m", "1")."""
    plain, _, place = name.partition("@")
    if plain not in OUTPUTS:
        return plain.replace("_", " "), INPUT_UNITS[plain]
    found = OUTPUTS[plain]
    label = found.label
    if place:
        label = f"{label} = {place} m"
    return label, found.unit


def unit_over(above: str, below: str) -> str:
    """Return the unit of a quantity in one unit over one in another: m/s^2/(N m)."""
    if " " in below or "/" in below:
        below = f"({below})"
    return f"{above}/{below}"
