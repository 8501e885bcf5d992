"""The arm: its headline numbers, what was given, what follows from it, its assumptions and the paper's slips."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, NamedTuple

import tfarm
from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm, implausible, input_words, unit_of
from tfarm.arm.writing import number_unit, to_toml
from tfarm.columns import Column, Table
from tfarm.digits import plain, significant, singly, unit
from tfarm.plots.shapes import sketch
from tfarm.report.sections import Fact, PageSection, Picture
from tfarm.schema import Quantity, table

HEADLINE_MODES = 3  # natural frequencies among the headline numbers, the rigid body's 0 not shown
MOST_POISSON = 0.5  # of an isotropic material; a larger E/2G - 1 is none's ratio
ONE_PAIR = "In this theory one pair of the beam's waves decays along it at any frequency: there is no shear cut-off."
BELOW_CUTOFF = "Below the shear cut-off one pair of the beam's waves decays along it, above it both pairs travel."
GIVEN_CAPTION = (
    "What the arm's file says, in SI units. An infinite hub inertia locks the hub, an infinite payload mass pins "
    "the tip, an infinite payload inertia keeps it from rotating."
)
RIG_GIVEN_CAPTION = (
    "What the rig's file says, in SI units, from the hub outwards; parts that are not listed are not there: a clamp or "
    "joint is rigid then, the radius 0, the payload's centre at the tip."
)
PARTS = (
    " So are the radius from the axis to the clamp and the payload's centre beyond the tip; dots are attachments, a "
    "ring is a clamp that yields."
)
THEORY_WORDS = {
    "timoshenko": "Timoshenko's, with shear and rotary inertia",
    "shear": "the shear theory, without rotary inertia",
    "rayleigh": "Rayleigh's, without shear",
    "euler-bernoulli": "Euler and Bernoulli's, without shear and rotary inertia",
}
TEXTS = ("name", "assumptions")  # of the file, which stand elsewhere on the page
QuantityRow = tuple[str, str, float, str]


def arm_section(arm: Arm) -> PageSection:
    """The first part of every page: slips of units, of a rig by which theory and through what its loops close."""
    odd = "; and on ".join(implausible(arm))
    words = [f"Check the units: every number on this page rests on {odd}."] * bool(odd)
    if not arm.is_uniform:
        driven = "It is led through the hub's angle" if arm.is_locked else f"Its input is {input_words(arm)}"
        theory = THEORY_WORDS[arm.theory]
        words.append(f"The theory of its link is {theory}. {driven}; all loops on this page close through that.")
    caption = GIVEN_CAPTION if arm.is_uniform else RIG_GIVEN_CAPTION
    rows = list(parameters(tomllib.loads(to_toml(arm))))
    given = table(rows, stem="parameters", title="Parameters", caption=caption)
    return PageSection(
        anchor="arm",
        title="The arm",
        facts=headline_numbers(arm),
        words=words + ["This arm states no assumptions."] * (not arm.assumptions),
        items=arm.assumptions,
        blocks=(_picture(arm), given, derived_table(arm)),
    )


def headline_numbers(arm: Arm) -> tuple[Fact, ...]:
    """First natural frequencies (at C = 0), total inertia, slenderness, shear cut-off, damping."""

    def frequency(label: str, omega: float, digits: int) -> Fact:
        hertz = significant(omega / (2 * math.pi), digits)
        return Fact(label=label, value=significant(omega, 8), unit="rad/s", beside=f"{hertz} Hz")

    modes = tfarm.modes(arm, count=HEADLINE_MODES)
    inertia, how = significant(arm.total_inertia, 8), "the arm cannot turn as a rigid body" * (not arm.has_rigid_mode)
    slenderness = arm.link.slenderness if arm.is_uniform else arm.length / arm.link.section.radius_of_gyration
    depth = f"depth/length {significant(math.sqrt(12) / slenderness, 3)} as a rectangle"
    lossless = "none: resonances are infinite" if arm.is_undamped else "none in the link: hub, clamp or joint lose"
    differs = "of the most damped segment" * (len({link.damping for link in arm.links}) > 1)
    numbered = zip(modes.index, modes.natural_frequency, strict=True)
    return (
        *(frequency(f"natural frequency {number}", omega, 8) for number, omega in numbered if number > 0),
        Fact(label="total inertia J about the hub", value=inertia, unit="kg m²", beside=how),
        Fact(label="slenderness L/√(I/A)", value=significant(slenderness, 5), beside=depth),
        *([frequency("shear cut-off √(κGA/ρI)", arm.shear_cutoff, 6)] * arm.has_cutoff),
        Fact(label="mass of the link", value=significant(arm.own_mass, 5), unit="kg"),
        Fact(label="damping C", value=plain(arm.damping), unit="s", beside=differs if arm.damping else lossless),
    )


def _picture(arm: Arm) -> Picture:
    """The arm to scale, and what moves it."""
    drive = "The hub turns the link by the torque u (positive anticlockwise)."
    if arm.is_locked:
        drive = "The hub is locked: no torque turns it; it is led through the angle θ (positive anticlockwise)."
    elif arm.input_per_torque != 1.0:
        drive = f"The hub turns the link through its motor; the input u is {input_words(arm)}."
    elif arm.has_massless_hub:
        drive = "The torque u (positive anticlockwise) acts on the root of the link itself: the pin has no inertia."
    tip = "nothing"
    if arm.payload.mass or arm.payload.inertia:
        tip = "a pin" if math.isinf(arm.payload.mass) else "a payload"
    return Picture(
        stem="arm",
        title="The arm, its link to scale",
        caption=f"{drive} Hub and payload are symbols; the link's length and depth are to scale, which shows at "
        f"a glance whether shear can matter.{PARTS * (not arm.is_uniform)}",
        alt=f"Side view of the arm: hub at the left, a link {plain(arm.length, 6)} m long, {tip} at the tip.",
        figure=sketch.figure(arm),
    )


def derived_table(arm: Arm) -> Table:
    """What follows from the parameters alone."""
    waves = BELOW_CUTOFF if arm.has_cutoff else ONE_PAIR
    return _table("derived", "What follows from them", waves, derived_rows(arm), digits=8)


def _table(stem: str, title: str, caption: str, rows: list[QuantityRow], digits: int = 10) -> Table:
    quantity, symbol, value, units = zip(*rows, strict=True)
    return Table(
        stem=stem,
        title=title,
        caption=caption,
        columns=(
            Column("quantity", "quantity", of=quantity),
            Column("symbol", "symbol", of=symbol),
            Column("value", "value", of=value, digits=singly(plain, digits)),
            Column("unit", "unit", of=[unit(u) for u in units]),
        ),
    )


class Parameter(NamedTuple):
    """A number of the arm's file."""

    key: Annotated[str, Quantity("key")]
    value: Annotated[float | str, Quantity("value", digits=10)]
    unit: Annotated[str, Quantity("unit")]


def parameters(table: Mapping[str, Any], under: str = "") -> Iterator[Parameter]:
    """The numbers of a table of an arm's file by their keys, those of tables in it too."""
    for key, value in table.items():
        name = f"{under}{key}"
        if isinstance(value, dict):
            yield from parameters(value, f"{name}.")
        elif isinstance(value, list) and all(isinstance(each, dict) for each in value):
            for number, each in enumerate(value, 1):
                yield from parameters(each, f"{name}.{number}.")
        elif key not in TEXTS:
            yield Parameter(name, value, "" if isinstance(value, str) else unit(number_unit(name)).removeprefix("1"))


def derived_rows(arm: Arm) -> list[QuantityRow]:
    """What follows from the parts."""
    alone = not arm.outer
    rows: list[QuantityRow] = []
    for i, link in enumerate(arm.links, 1):
        prefix = "" if alone else f"segment {i}: "
        kappa = "given" if link.section.shear_factor is not None else "Cowper (1966)"
        rows += [
            (f"{prefix}area of the section", "A", link.section.area, "m^2"),
            (f"{prefix}second moment of area", "I", link.section.second_moment, "m^4"),
            (f"{prefix}shear factor, {kappa}", "κ", link.shear_factor, ""),
            (f"{prefix}mass", "ρAL", link.rhoA * link.length, "kg"),
            (f"{prefix}bending stiffness", "EI", link.EI, "N m^2"),
            (f"{prefix}shear stiffness", "κGA", link.kGA, "N"),
            (f"{prefix}Poisson's ratio of an isotropic material", "E/2G − 1", link.poissons_ratio, ""),
            (f"{prefix}radius of gyration", "√(I/A)", link.section.radius_of_gyration, "m"),
            (f"{prefix}slenderness", "L/√(I/A)", link.slenderness, ""),
        ]
    rows = [row for row in rows if row[1] != "E/2G − 1" or -1 < row[2] <= MOST_POISSON]
    rows.append(("total inertia about the axis", "J", arm.total_inertia, "kg m^2"))
    if arm.motor is not None:
        rows.append(("rotor as the hub feels it", "N² J_m", arm.motor.reflected_inertia, "kg m^2"))
    if arm.has_rigid_mode and not arm.is_locked:
        symbol = "−(J − I_h)/J" * arm.is_uniform
        rows.append(("root moment per torque at rest", symbol, -arm.gauged_inertia / arm.total_inertia, "N m/(N m)"))
    if arm.input_per_torque != 1.0:
        rows.append(("input for a torque of 1 N m", "", arm.input_per_torque, unit_of(MOMENT_GAIN, arm)))
    if arm.rate_loss:
        rows.append((f"what the losses at the hub add to {RATE_GAIN}", "", arm.rate_loss, unit_of(RATE_GAIN, arm)))
    return [*rows, *cutoff_rows(arm)]


def cutoff_rows(arm: Arm) -> list[QuantityRow]:
    """The shear cut-off, of an arm whose theory has one."""
    lowest = ", of several segments the lowest" * bool(arm.outer)
    rows = [
        (f"shear cut-off{lowest}", "√(κGA/ρI)", arm.shear_cutoff, "rad/s"),
        ("shear cut-off", "", arm.shear_cutoff / (2 * math.pi), "Hz"),
    ]
    return rows * arm.has_cutoff


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


DENSITIES = {  # remarks on the density used, by its ratio to the printed one
    1.0: "kept as printed, to show what the misprint does: aluminium has a thousand times as much",
    1000.0: "misprint: aluminium has a thousand times the printed density",
}


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
    values = Table(
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
    return PageSection(anchor="paper", title="The paper's values, corrected", words=words, blocks=(values,))


def remark(key: str, used: float) -> str:
    """Why the value used is not the printed one, or what is odd about it; empty where all is well."""
    printed = TABLE_1[key].value
    if key == "C":
        value = "" if used == 0 else "; the value is chosen here"
        return f"a time, since it enters as E (1 + C s): s, not kg/s{value}"
    if printed is None:
        return "needed, but not in the paper: an assumption"
    if key == "density":
        known = (words for factor, words in DENSITIES.items() if math.isclose(used, factor * printed))
        return next(known, "another density than the printed one, itself a misprint (aluminium: 2766.7 kg/m³)")
    return "" if math.isclose(used, printed) else "chosen here"


def _with_unit(value: float, of: str) -> str:
    return f"{plain(value, 6)} {unit(of)}".strip()
