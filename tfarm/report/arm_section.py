"""The arm: its headline numbers, its parameters, what follows from these, its assumptions and the paper's slips."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

import tfarm
from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm, implausible, input_words, unit_of
from tfarm.arm.schema import file_key
from tfarm.arrays import Real
from tfarm.audit.assumptions import Study, has_hub_inertia, hub_study, section_study
from tfarm.digits import fixed, plain, significant, singly, unit
from tfarm.dsp.chain import file_text
from tfarm.plots import style
from tfarm.plots.motion import sketch
from tfarm.plots.style import COLOURS, GREY, Axes
from tfarm.report.page import Case, Fact, PageSection, Picture, picture, prose, sheet
from tfarm.schema import Column, Quantity, Table, table


def arm_section(case: Case) -> PageSection:
    """The first part of every page: headline numbers, slips of units, the theory, and the parameters."""
    arm, input = case.arm, input_words(case.arm)
    words = (
        prose("units", odd="; ".join(implausible(arm))), prose("rig", arm=arm, input=input),
        "" if arm.assumptions else "This arm states no assumptions.",
    )  # fmt: skip
    rows = list(parameters(arm, tomllib.loads(file_text(arm, case.chain))))
    return PageSection(
        title="The arm", facts=headline_numbers(arm), words=list(filter(None, words)),
        items=arm.assumptions,
        blocks=(
            picture("arm", sketch.figure(arm), arm=arm, input=input),
            sheet("parameters", table(rows), is_rig=not arm.is_uniform),
            derived_table(arm),
        ),
    )  # fmt: skip


def headline_numbers(arm: Arm) -> tuple[Fact, ...]:
    """First natural frequencies (at C = 0), total inertia, slenderness, shear cut-off, damping."""

    def frequency(label: str, omega: float, digits: int) -> Fact:
        return Fact(label, significant(omega, 8), "rad/s", f"{significant(omega / (2 * math.pi), digits)} Hz")

    modes = tfarm.modes(arm, count=3)  # the rigid body's 0 is not shown
    slenderness = arm.link.slenderness if arm.is_uniform else arm.length / arm.link.section.radius_of_gyration
    depth = f"depth/length {significant(math.sqrt(12) / slenderness, 3)} as a rectangle"
    numbered = zip(modes.index, modes.natural_frequency, strict=True)
    return (
        *(frequency(f"natural frequency {number}", omega, 8) for number, omega in numbered if number > 0),
        Fact("total inertia J about the hub", significant(arm.total_inertia, 8), "kg m²",
             "the arm cannot turn as a rigid body" * (not arm.has_rigid_mode)),
        Fact("slenderness L/√(I/A)", significant(slenderness, 5), note=depth),
        *([frequency("shear cut-off √(κGA/ρI)", arm.shear_cutoff, 6)] if arm.has_cutoff else []),
        Fact("mass of the link", significant(arm.own_mass, 5), "kg"),
        Fact("damping C", plain(arm.damping), "s", prose("damping_note", arm=arm)),
    )  # fmt: skip


class Parameter(NamedTuple):
    """A number of the arm's file."""

    label: Annotated[str, Quantity("parameter", help="what the number is in the model")]
    value: Annotated[float | str, Quantity("value", digits=10, help="as the file has it")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the value")]
    key: Annotated[str, Quantity("key of the file", help="table and key of the TOML file")]


def parameters(arm: Arm, table: Mapping[str, Any], under: str = "") -> Iterator[Parameter]:
    """The numbers of a table of an arm's file by their keys, those of tables in it too."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from parameters(arm, value, f"{under}{key}.")
        elif isinstance(value, list) and all(isinstance(each, dict) for each in value):
            yield from parameters(arm, {str(number): each for number, each in enumerate(value, 1)}, f"{under}{key}.")
        elif key not in ("name", "assumptions"):  # which are in other places of the page
            of = file_key(f"{under}{key}", arm)
            yield Parameter(of.label, value, unit(of.unit), f"{under}{key}")


class Derived(NamedTuple):
    """A number that follows from the parameters; False where an arm has none."""

    quantity: Annotated[str, Quantity("quantity", help="number that the parameters determine")]
    symbol: Annotated[str, Quantity("symbol", help="letter or formula of the quantity")]
    value: Annotated[float | Literal[False], Quantity("value", digits=8, help="from the parameters alone")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the value")]


def derived_table(arm: Arm) -> Table:
    """The numbers that follow from the parameters alone."""
    turns, cutoff = arm.has_rigid_mode and not arm.is_locked, arm.has_cutoff and arm.shear_cutoff
    rows = [
        Derived(f"segment {i}: " * bool(arm.outer) + quantity, symbol, value, unit)
        for i, link in enumerate(arm.links, 1)
        for quantity, symbol, value, unit in (
            ("area of the section", "A", link.section.area, "m²"),
            ("second moment of area", "I", link.section.second_moment, "m⁴"),
            (f"shear factor, {'Cowper (1966)' if link.section.shear_factor is None else 'given'}", "κ",
             link.shear_factor, ""),
            ("mass", "ρAL", link.rhoA * link.length, "kg"),
            ("bending stiffness", "EI", link.EI, "N m²"),
            ("shear stiffness", "κGA", link.kGA, "N"),
            ("Poisson's ratio of an isotropic material", "E/2G − 1",
             -1 < link.poissons_ratio <= 0.5 and link.poissons_ratio, ""),
            ("radius of gyration", "√(I/A)", link.section.radius_of_gyration, "m"),
            ("slenderness", "L/√(I/A)", link.slenderness, ""),
        )
    ] + [
        Derived("total inertia about the axis", "J", arm.total_inertia, "kg m²"),
        Derived("rotor inertia at the hub", "N² J_m", arm.motor is not None and arm.motor.reflected_inertia, "kg m²"),
        Derived("root moment per torque at rest", "−(J − I_h)/J" * arm.is_uniform,
                turns and -arm.gauged_inertia / arm.total_inertia, "N m/(N m)"),
        Derived("input for a torque of 1 N m", "", arm.input_per_torque != 1.0 and arm.input_per_torque,
                unit_of(MOMENT_GAIN, arm)),
        Derived(f"losses at the hub, in {RATE_GAIN}", "", arm.rate_loss != 0.0 and arm.rate_loss,
                unit_of(RATE_GAIN, arm)),
        Derived("shear cut-off" + ", of several segments the lowest" * bool(arm.outer), "√(κGA/ρI)", cutoff, "rad/s"),
        Derived("shear cut-off", "", cutoff and cutoff / (2 * math.pi), "Hz"),
    ]  # fmt: skip
    return sheet("derived", table([row for row in rows if row.value is not False]), arm=arm)


# ------------------------------------------------------------ the paper


class PaperValue(NamedTuple):
    """A row of Table 1: its value, None where the table has none, and unit, as printed; and those used here."""

    quantity: Annotated[str, Quantity("quantity", help="entry of the paper's Table 1")]
    symbol: Annotated[str, Quantity("symbol", help="letter of the quantity in the paper")]
    printed: Annotated[
        float | None, Quantity("printed in Table 1", help="value as printed; none where the table has no such entry")
    ]
    printed_unit: Annotated[str, Quantity("unit, as printed", help="unit as printed")]
    used: Annotated[float, Quantity("used here", help="value of this arm, in the unit of the next column")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the value used here")]

    @property
    def remark(self) -> Annotated[str, Quantity("remark", help="reason where the value used is not the printed one")]:
        """The reason why the value used is not the printed one, or is an odd one; empty of any other."""
        return prose("paper_remark", row=self)

    @property
    def is_as_printed(self) -> bool:
        """Whether the number used is the printed one."""
        return self.printed is not None and math.isclose(self.used, self.printed)


def paper_values(arm: Arm) -> tuple[PaperValue, ...]:
    """Table 1 of the paper, and the values of an arm."""
    link, payload = arm.link, arm.payload
    return (
        PaperValue("length of the arm", "L", 1.0, "m", link.length, "m"),
        PaperValue("cross-sectional area", "A", 6.0e-4, "m²", link.section.area, "m²"),
        PaperValue("density", "ρ", 2.7667, "kg/m³", link.density, "kg/m³"),
        PaperValue("Young's modulus", "E", 6.8944e10, "Pa", link.youngs_modulus, "Pa"),
        PaperValue("internal damping", "C", 0.0, "kg/s", link.damping, "s"),
        PaperValue("payload inertia", "I_c", 0.0, "kg m²", payload.inertia, "kg m²"),
        PaperValue("payload mass", "m", 0.0, "kg", payload.mass, "kg"),
        PaperValue("shear factor", "κ", 5 / 6, "", link.shear_factor, ""),
        PaperValue("shear modulus", "G", 2.6517e10, "Pa", link.shear_modulus, "Pa"),
        PaperValue("second moment of area", "I", None, "", link.section.second_moment, "m⁴"),
        PaperValue("hub inertia", "I_h", None, "", arm.hub.inertia, "kg m²"),
    )


def is_from_paper(arm: Arm) -> bool:
    """Whether length, section and moduli are those of Table 1."""
    return all(row.is_as_printed for row in paper_values(arm) if row.symbol in "L A E κ G")


def paper_section(case: Case) -> PageSection:
    """Table 1 and its corrections."""
    values = sheet("paper_values", table(paper_values(case.arm)))
    return PageSection(title="The paper's values, corrected", words=(prose("paper"),), blocks=(values,))


# ------------------------------------------------------------ assumptions


def assumptions_section(case: Case) -> PageSection:
    """Frequencies over the sections and the hub inertias that could be chosen, with sensitivities."""
    arm, blocks = case.arm, list[Picture | Table]()
    if arm.is_uniform:
        blocks += candidate_blocks(section_study(arm), "assumptions_section", "depth of the section [m]")
    if arm.is_uniform and has_hub_inertia(arm):
        blocks += candidate_blocks(hub_study(arm), "assumptions_hub", "hub inertia [kg m²]")
    words = (prose("assumptions", arm=arm, is_from_paper=is_from_paper(arm), has_hub=has_hub_inertia(arm)),)
    return PageSection(title="What the assumptions do", words=words, blocks=blocks)


def candidate_blocks(study: Study, kind: str, label: str) -> Iterator[Picture | Table]:
    """Natural frequencies over the candidates as a picture, and with the sensitivities, a column a mode, as a table."""
    stem, rows = f"{kind.replace('_', '-')}-frequencies", study.candidates
    omega = np.array([row.natural_frequency for row in rows])
    yield picture("assumed_frequencies", draw_candidates.figure(study, label, omega), stem=stem, label=label,
                  omega=omega)  # fmt: skip
    own = ("is_own", "depth", "width", "second_moment", "hub_inertia")
    columns = (
        *table(rows, [name for name in own if getattr(rows[0], name) is not None]).columns,
        *(Column(f"mode_{n}_rad_s", f"mode {n}", "rad/s", of=each, digits=singly(significant, 6))
          for n, each in enumerate(omega.T, 1)),
        *(Column(f"sensitivity_{n}", f"sensitivity of mode {n}", "%/%", of=each, digits=partial(fixed, decimals=3))
          for n, each in enumerate(np.array([row.sensitivity for row in rows]).T, 1)),
        *table(rows, ("verdict", "K2_below", "K2_below_is_edge")).columns,
    )  # fmt: skip
    yield sheet(kind, columns, study=study)


@style.picture(
    size=(9.0, 4.6),
    title=lambda study, label, omega: f"{study.arm.name}: natural frequencies over the {label.partition(' [')[0]}",
)  # fmt: skip
def draw_candidates(study: Study, label: str, omega: Real, *, ax: Axes) -> None:
    """Natural frequencies over the candidates of an assumed parameter, both axes logarithmic; the arm's own filled."""
    values = np.array([row.depth or row.hub_inertia for row in study.candidates], dtype=float)
    own = [row.is_own for row in study.candidates].index(True)
    ax.axvline(values[own], color=GREY, lw=1.0, ls=(0, (4, 3)))
    for number, (colour, of_mode) in enumerate(zip(COLOURS, omega.T, strict=False), 1):
        ax.plot(values, of_mode, "o-", color=colour, mfc="white", label=f"mode {number}")
        ax.plot(values[own], of_mode[own], "o", color=colour, ms=7.0, zorder=4)
    ax.set(xscale="log", yscale="log", xlabel=label, ylabel="natural frequency [rad/s]")
