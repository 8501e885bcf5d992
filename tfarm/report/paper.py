"""The paper's Table 1 beside what is used here, for every arm that has the paper's link.

"Self-Tuning Vibration Control of a Rotational Flexible Timoshenko Arm Using Neural Networks", Advances in Acoustics
and Vibration, 2012, article 852780.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

from tfarm.arm import Arm
from tfarm.columns import Column, Table
from tfarm.digits import plain, unit
from tfarm.report.sections import PageSection


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """A row of Table 1: its value, None where the table has none, and unit, as printed."""

    quantity: str
    symbol: str
    value: float | None
    unit: str
    unit_here: str


TABLE_1 = {
    "length": Printed(quantity="length of the arm", symbol="L", value=1.0, unit="m", unit_here="m"),
    "area": Printed(quantity="cross-sectional area", symbol="A", value=6.0e-4, unit="m^2", unit_here="m^2"),
    "density": Printed(quantity="density", symbol="ρ", value=2.7667, unit="kg/m^3", unit_here="kg/m^3"),
    "E": Printed(quantity="Young's modulus", symbol="E", value=6.8944e10, unit="Pa", unit_here="Pa"),
    "C": Printed(quantity="internal damping", symbol="C", value=0.0, unit="kg/s", unit_here="s"),
    "I_c": Printed(quantity="payload inertia", symbol="I_c", value=0.0, unit="kg m^2", unit_here="kg m^2"),
    "m": Printed(quantity="payload mass", symbol="m", value=0.0, unit="kg", unit_here="kg"),
    "kappa": Printed(quantity="shear factor", symbol="κ", value=5 / 6, unit="", unit_here=""),
    "G": Printed(quantity="shear modulus", symbol="G", value=2.6517e10, unit="Pa", unit_here="Pa"),
    "I": Printed(quantity="second moment of area", symbol="I", value=None, unit="", unit_here="m^4"),
    "I_h": Printed(quantity="hub inertia", symbol="I_h", value=None, unit="", unit_here="kg m^2"),
}
EQUAL_IN_PAPER = ("length", "area", "E", "kappa", "G")  # equal in all these, an arm is the paper's
DENSITY_MISPRINT = 1000.0  # the density is printed a thousand times too small


def values_of(arm: Arm) -> dict[str, float]:
    """The arm's values by the keys of TABLE_1."""
    link = arm.link
    return {
        "length": link.length,
        "area": link.section.area,
        "density": link.density,
        "E": link.youngs_modulus,
        "C": link.damping,
        "I_c": arm.payload.inertia,
        "m": arm.payload.mass,
        "kappa": link.shear_factor,
        "G": link.shear_modulus,
        "I": link.section.second_moment,
        "I_h": arm.hub.inertia,
    }


def is_from_paper(arm: Arm) -> bool:
    """Whether length, section and moduli are those of Table 1."""
    used = values_of(arm)
    return all(math.isclose(used[key], TABLE_1[key].value or 0.0, rel_tol=1e-12) for key in EQUAL_IN_PAPER)


def paper_section(arm: Arm) -> PageSection:
    """Table 1 and its corrections."""
    used = values_of(arm)
    marked = partial(Column, tint=["#fff1de" if remark(key, used[key]) else "" for key in TABLE_1])
    printed = [_with_unit(row.value, row.unit) if row.value is not None else "not given" for row in TABLE_1.values()]
    table = Table(
        stem="paper-values",
        title="Table 1 of the paper, and what is used here",
        caption="Rows in colour differ from the paper in value or unit, or are missing there: every number on this "
        "page rests on them.",
        record=list(TABLE_1.values()),
        columns=(
            Column("quantity", "quantity"),
            Column("symbol", "symbol"),
            marked("printed", "printed in Table 1", of=printed),
            marked("used_here", "used here", of=[_with_unit(used[k], row.unit_here) for k, row in TABLE_1.items()]),
            marked("remark", "why", of=[remark(key, used[key]) for key in TABLE_1]),
        ),
    )
    words = (
        "The arm is that of “Self-Tuning Vibration Control of a Rotational Flexible Timoshenko Arm Using Neural "
        "Networks”, Advances in Acoustics and Vibration, 2012, article 852780.",
    )
    return PageSection(anchor="paper", title="The paper's values, corrected", words=words, blocks=(table,))


def remark(key: str, used: float) -> str:
    """Why the value used is not the printed one, or what is odd about it; empty where all is well."""
    printed = TABLE_1[key].value
    if key == "density":
        if math.isclose(used, printed or 0.0):
            return "kept as printed, to show what the misprint does: aluminium has a thousand times as much"
        if math.isclose(used, DENSITY_MISPRINT * (printed or 0.0)):
            return "misprint: aluminium has a thousand times the printed density"
        return "another density than the printed one, itself a misprint (aluminium: 2766.7 kg/m³)"
    if key == "C":
        value = "" if used == 0 else "; the value is chosen here"
        return f"a time, since it enters as E (1 + C s): s, not kg/s{value}"
    if printed is None:
        return "needed, but not in the paper: an assumption"
    return "" if math.isclose(used, printed) else "chosen here"


def _with_unit(value: float, of: str) -> str:
    return f"{plain(value, 6)} {unit(of)}".strip()
