"""Table 1: its values against the material they name, its units against the equations they enter.

The audit of the paper: a row for each of its equations, its table and its appendix.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated

from tfarm.schema import Quantity

from .appendix import APPENDIX_CLAIMS, DAMPING_CLAIM, LAMBDA
from .energy import ENERGY_CLAIMS
from .formulas import NEEDED, PAPER_UNITS, Dimension, clauses, mismatch, parsed, spelled, unit_dimension, unlike
from .motion import MOTION_CLAIMS, TIME
from .rows import AuditRow, Claim
from .tuner import TUNER_CLAIMS

ALUMINIUM_DENSITIES = (2550.0, 2900.0)  # kg/m^3: alloys from aluminium-lithium to those rich in copper and zinc
PRINTED_E = 6.8944e10  # Pa, as printed
PRINTED_G = 2.6517e10  # Pa
PRINTED_A = 6.0e-4  # m^2
OTHER_UNITS = "L: m; A: m^2; rho: kg/m^3; E: Pa; I_c: kg m^2; m: kg; kappa: 1; G: Pa"
PAPER = (
    "Self-Tuning Vibration Control of a Rotational Flexible Timoshenko Arm Using Neural Networks, "
    "Advances in Acoustics and Vibration, 2012, article 852780"
)


def quantity(clause: str) -> tuple[str, float, Dimension]:
    """Name, value and dimension of a text such as "rho = 2766.7 kg/m^3"."""
    name, _, rest = clause.partition(" = ")
    value, _, of = rest.partition(" ")
    return name, float(value), unit_dimension(of)


def is_aluminium(text: str) -> str:
    """rho: the relative distance from what aluminium alloys weigh, the material of E and G."""
    name, value, dimension = quantity(text)
    if dimension != PAPER_UNITS[name]:
        return f"{name} in {spelled(dimension)}"
    low, high = ALUMINIUM_DENSITIES
    distance = max(1 - value / low, value / high - 1, 0.0)
    return f"{distance:.4f}" if distance else "0"


def is_unit_of_damping(text: str) -> str:
    """C: the dimensions of 1 + C s."""
    return mismatch(parsed("1 + C*s"), PAPER_UNITS | {"C": unit_dimension(text.partition(": ")[2])})


def are_units(text: str) -> str:
    """Every sum in (1), (2), (4), (5) and (A.2) with the units of the text."""
    given = {name: unit_dimension(of) for name, of in (clause.split(": ") for clause in clauses(text))}
    found = [unlike(formula, PAPER_UNITS | given) for formula in (*(TIME[n] for n in (1, 2, 4, 5)), LAMBDA)]
    return "; ".join(each for each in found if each != "0") or "0"


def is_given(name: str, text: str) -> str:
    """Whether a parameter that (2), (3) and the a_ij need has a value of the right dimension."""
    for clause in clauses(text):
        if clause.startswith(f"{name} = "):
            _, value, dimension = quantity(clause)
            return "0" if value > 0 and dimension == unit_dimension(NEEDED[name]) else f"{name} in {spelled(dimension)}"
    return f"{name} has no value"


def is_section(text: str) -> str:
    """I: given, and that of a rectangle "b m x h m" with the printed area."""
    given = is_given("I", text)
    if given != "0":
        return given
    value, sides = quantity(clauses(text)[0])[1], clauses(text)[1].removeprefix("rectangle ").split(" x ")
    width, depth = (quantity(f"side = {side}")[1] for side in sides)
    off = max(abs(width * depth / PRINTED_A - 1), abs(width * depth**3 / 12 / value - 1))
    return f"{off:.2g}" if off > 1e-12 else "0"  # doubles read from decimals


def density_in_numbers() -> str:
    """What the density printed would mean."""
    from tfarm.arm import load
    from tfarm.spectrum import modes

    printed, used = (modes(load(name), 3).natural_frequency[1:] for name in ("sasaki2012-as-printed", "sasaki2012"))
    ratios = ", ".join(f"{ratio:.1f}" for ratio in printed / used)
    speeds = [math.sqrt(PRINTED_E / rho) / 1e3 for rho in (2.7667, 2766.7)]
    return (
        f"E/(2 G) - 1 = {PRINTED_E / (2 * PRINTED_G) - 1:.4f}, Poisson's ratio of aluminium. As printed, sound would "
        f"run along the arm at {speeds[0]:.0f} km/s (mended: {speeds[1]:.2f}; diamond: about 18), and the first "
        f"natural frequencies would be {ratios} times as high (hub inertia 0.1 kg m^2)."
    )


TABLE_CLAIMS = (  # Table 1
    Claim(
        equation="Table 1 (rho)",
        printed="rho = 2.7667 kg/m^3",
        corrected="rho = 2766.7 kg/m^3",
        check=is_aluminium,
        evidence="E and G are those of aluminium, whose alloys weigh 2550 to 2900 kg/m^3: the printed number is "
        "right in g/cm^3. Residual: relative distance from that range.",
        measured=density_in_numbers,
    ),
    Claim(
        equation="Table 1 (C's unit)",
        printed="C: kg/s",
        corrected="C: s",
        check=is_unit_of_damping,
        evidence="C enters as 1 + C s (A.2), so C s is a pure number (dimension checker).",
    ),
    Claim(
        equation="Table 1 (other units)",
        printed=OTHER_UNITS,
        check=are_units,
        evidence="With these units every sum in (1), (2), (4), (5) and the mended (A.2) adds like to like "
        "(dimension checker).",
    ),
    Claim(
        equation="Table 1 (I)",
        printed="no value",
        corrected="I = 1.8e-9 m^4; rectangle 0.1 m x 0.006 m",
        check=is_section,
        evidence="(2), (3), (5), (A.2) and the a_ij need I.",
        doubt="The area does not decide it: rectangles of 6e-4 m^2 and 2 to 60 mm depth have I from 2.0e-10 to "
        "1.8e-7 m^4. The value is our assumption.",
    ),
    Claim(
        equation="Table 1 (I_h)",
        printed="no value",
        corrected="I_h = 0.1 kg m^2",
        check=partial(is_given, "I_h"),
        evidence="(3), (10) and a_41 to a_44 need I_h.",
        doubt="Nothing in the paper decides it. The value is our assumption.",
    ),
)


def claims() -> tuple[Claim, ...]:
    """Every claim, in the order of the paper."""
    return (*MOTION_CLAIMS, DAMPING_CLAIM, *ENERGY_CLAIMS, *TUNER_CLAIMS, *TABLE_CLAIMS, *APPENDIX_CLAIMS)


@cache
def audit() -> tuple[AuditRow, ...]:
    """Check every equation, as printed and as corrected.

    Raises CertificationError if a correction does not pass its own check.
    """
    return tuple(claim.row() for claim in claims())


@dataclass(frozen=True)
class Audit:
    """The paper, equation by equation."""

    paper: Annotated[str, Quantity("paper")]
    rows: Annotated[tuple[AuditRow, ...], Quantity("equations")]
