"""What can be asked of the arm: one row an output, and nothing else to edit for a new one.

An output is a power of s times one quantity of the exact solution, at the hub, at the tip or at a point x of the
arm.  Signs as in the paper: root moment E I phi'(0), shear force kappa G A (w' - psi).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from tfarm.errors import ParameterError, did_you_mean

from .coefficients import Coefficients

# theta, M, Q, W - x theta, W and Psi - theta: hub angle, moment, shear force, deflection and rotation
Quantity = Literal["theta", "M", "Q", "W", "Y", "Phi"]
Place = Literal["root", "tip", "x"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """`s`^power times a quantity at a place; `gauge` divides by 1 + C s (a strain gauge does not feel C)."""

    quantity: Quantity
    place: Place
    unit: str
    power: int = 0
    gauge: bool = False
    label: str


OUTPUTS: dict[str, Output] = {
    "hub_angle": Output(quantity="theta", place="root", unit="rad", label="hub angle"),
    "hub_rate": Output(quantity="theta", place="root", unit="rad/s", power=1, label="hub rate"),
    "tip_displacement": Output(quantity="W", place="tip", unit="m", label="tip displacement"),
    "tip_deflection": Output(quantity="Y", place="tip", unit="m", label="tip deflection"),
    "tip_acceleration": Output(quantity="W", place="tip", unit="m/s^2", power=2, label="tip acceleration"),
    "root_moment": Output(quantity="M", place="root", unit="N m", gauge=True, label="root moment"),
    "root_shear": Output(quantity="Q", place="root", unit="N", label="root shear force"),
    "deflection": Output(quantity="Y", place="x", unit="m", label="deflection at x"),
    "rotation": Output(quantity="Phi", place="x", unit="rad", label="rotation at x"),
    "moment": Output(quantity="M", place="x", unit="N m", gauge=True, label="bending moment at x"),
    "shear": Output(quantity="Q", place="x", unit="N", label="shear force at x"),
}


def output(name: str) -> Output:
    """The output of that name.  Raises ParameterError, with the nearest name."""
    if name not in OUTPUTS:
        raise ParameterError(key="output", value=name, remedy=did_you_mean(name, OUTPUTS))
    return OUTPUTS[name]


def unit_scale(wanted: Output, k: Coefficients) -> Fraction:
    """SI value of the output per N m of torque (per radian where the hub is locked), for one dimensionless unit."""
    units = {"W": k.length, "Y": k.length, "M": k.EI / k.length, "Q": k.EI / k.length**2}
    scale = units.get(wanted.quantity, Fraction(1))
    return scale if k.is_locked else scale * k.length / k.EI
