"""The arm: its headline numbers, its parameters, what follows from these, its assumptions and the paper's slips."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import tfarm
from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm, implausible, input_words, unit_of
from tfarm.arm.schema import file_key
from tfarm.audit.assumptions import Study, has_hub_inertia, hub_study, section_study
from tfarm.digits import fixed, plain, significant, singly, unit
from tfarm.dsp.chain import file_text
from tfarm.plots.motion import sketch
from tfarm.plots.style import COLOURS, GREY, page
from tfarm.report.cases import Case
from tfarm.report.sections import Fact, PageSection, Picture, prose
from tfarm.schema import Column, Quantity, Table, table

if TYPE_CHECKING:
    from tfarm.plots.style import Figure

HEADLINE_MODES = 3  # natural frequencies among the headline numbers, the rigid body's 0 not shown
MOST_POISSON = 0.5  # of an isotropic material; a larger E/2G - 1 is none's ratio
TEXTS = ("name", "assumptions")  # of the file, which are in other places of the page


def arm_section(case: Case) -> PageSection:
    """The first part of every page: headline numbers, slips of units, the theory, and the parameters."""
    arm = case.arm
    words = [prose("units", odd=odd) for odd in ["; ".join(implausible(arm))] if odd]
    if not arm.is_uniform:
        words.append(prose("rig", arm=arm, input=input_words(arm)))
    words += ["This arm states no assumptions."] * (not arm.assumptions)
    rows = list(parameters(arm, tomllib.loads(file_text(arm, case.chain))))
    given = table(rows, stem="parameters", title="Parameters", caption=prose("parameters", is_rig=not arm.is_uniform))
    tip = "a payload" if arm.payload.mass or arm.payload.inertia else "nothing"
    tip = "a pin" if math.isinf(arm.payload.mass) else tip
    picture = Picture(
        stem="arm",
        title="The arm, its link to scale",
        caption=prose("sketch", arm=arm, input=input_words(arm)),
        alt=f"Side view of the arm: hub at the left, a link {plain(arm.length, 6)} m long, {tip} at the tip.",
        figure=sketch.figure(arm),
    )
    blocks, facts = (picture, given, derived_table(arm)), headline_numbers(arm)
    return PageSection(anchor="arm", title="The arm", facts=facts, words=words, items=arm.assumptions, blocks=blocks)


def headline_numbers(arm: Arm) -> tuple[Fact, ...]:
    """First natural frequencies (at C = 0), total inertia, slenderness, shear cut-off, damping."""

    def frequency(label: str, omega: float, digits: int) -> Fact:
        hertz = significant(omega / (2 * math.pi), digits)
        return Fact(label=label, value=significant(omega, 8), unit="rad/s", note=f"{hertz} Hz")

    modes = tfarm.modes(arm, count=HEADLINE_MODES)
    inertia, how = significant(arm.total_inertia, 8), "the arm cannot turn as a rigid body" * (not arm.has_rigid_mode)
    slenderness = arm.link.slenderness if arm.is_uniform else arm.length / arm.link.section.radius_of_gyration
    depth = f"depth/length {significant(math.sqrt(12) / slenderness, 3)} as a rectangle"
    lossless = "none: resonances are infinite" if arm.is_undamped else "none in the link: hub, clamp or joint lose"
    differs = "of the most damped segment" * (len({link.damping for link in arm.links}) > 1)
    numbered = zip(modes.index, modes.natural_frequency, strict=True)
    return (
        *(frequency(f"natural frequency {number}", omega, 8) for number, omega in numbered if number > 0),
        Fact(label="total inertia J about the hub", value=inertia, unit="kg m²", note=how),
        Fact(label="slenderness L/√(I/A)", value=significant(slenderness, 5), note=depth),
        *([frequency("shear cut-off √(κGA/ρI)", arm.shear_cutoff, 6)] * arm.has_cutoff),
        Fact(label="mass of the link", value=significant(arm.own_mass, 5), unit="kg"),
        Fact(label="damping C", value=plain(arm.damping), unit="s", note=differs if arm.damping else lossless),
    )


class Parameter(NamedTuple):
    """A number of the arm's file."""

    label: Annotated[str, Quantity("parameter", help="what the number is in the model")]
    value: Annotated[float | str, Quantity("value", digits=10, help="as the file has it")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the value")]
    key: Annotated[str, Quantity("key of the file", help="table and key of the TOML file")]


def parameters(arm: Arm, table: Mapping[str, Any], under: str = "") -> Iterator[Parameter]:
    """The numbers of a table of an arm's file by their keys, those of tables in it too."""
    for key, value in table.items():
        name = f"{under}{key}"
        if isinstance(value, dict):
            yield from parameters(arm, value, f"{name}.")
        elif isinstance(value, list) and all(isinstance(each, dict) for each in value):
            for number, each in enumerate(value, 1):
                yield from parameters(arm, each, f"{name}.{number}.")
        elif key not in TEXTS:
            of = file_key(name, arm)
            yield Parameter(of.label, value, unit(of.unit), name)


class Derived(NamedTuple):
    """A number that follows from the parameters."""

    quantity: Annotated[str, Quantity("quantity", help="number that the parameters determine")]
    symbol: Annotated[str, Quantity("symbol", help="letter or formula of the quantity")]
    value: Annotated[float, Quantity("value", digits=8, help="from the parameters alone")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the value")]


def derived_table(arm: Arm) -> Table:
    """The numbers that follow from the parameters alone."""
    rows: list[Derived] = []
    for i, link in enumerate(arm.links, 1):
        prefix = f"segment {i}: " * bool(arm.outer)
        kappa = "given" if link.section.shear_factor is not None else "Cowper (1966)"
        rows += [
            Derived(f"{prefix}area of the section", "A", link.section.area, "m²"),
            Derived(f"{prefix}second moment of area", "I", link.section.second_moment, "m⁴"),
            Derived(f"{prefix}shear factor, {kappa}", "κ", link.shear_factor, ""),
            Derived(f"{prefix}mass", "ρAL", link.rhoA * link.length, "kg"),
            Derived(f"{prefix}bending stiffness", "EI", link.EI, "N m²"),
            Derived(f"{prefix}shear stiffness", "κGA", link.kGA, "N"),
            Derived(f"{prefix}Poisson's ratio of an isotropic material", "E/2G − 1", link.poissons_ratio, ""),
            Derived(f"{prefix}radius of gyration", "√(I/A)", link.section.radius_of_gyration, "m"),
            Derived(f"{prefix}slenderness", "L/√(I/A)", link.slenderness, ""),
        ]
    rows = [row for row in rows if row.symbol != "E/2G − 1" or -1 < row.value <= MOST_POISSON]
    rows.append(Derived("total inertia about the axis", "J", arm.total_inertia, "kg m²"))
    if arm.motor is not None:
        rows.append(Derived("rotor inertia at the hub", "N² J_m", arm.motor.reflected_inertia, "kg m²"))
    if arm.has_rigid_mode and not arm.is_locked:
        symbol, ratio = "−(J − I_h)/J" * arm.is_uniform, -arm.gauged_inertia / arm.total_inertia
        rows.append(Derived("root moment per torque at rest", symbol, ratio, "N m/(N m)"))
    if arm.input_per_torque != 1.0:
        rows.append(Derived("input for a torque of 1 N m", "", arm.input_per_torque, unit_of(MOMENT_GAIN, arm)))
    if arm.rate_loss:
        rows.append(Derived(f"losses at the hub, in {RATE_GAIN}", "", arm.rate_loss, unit_of(RATE_GAIN, arm)))
    if arm.has_cutoff:
        lowest = ", of several segments the lowest" * bool(arm.outer)
        rows.append(Derived(f"shear cut-off{lowest}", "√(κGA/ρI)", arm.shear_cutoff, "rad/s"))
        rows.append(Derived("shear cut-off", "", arm.shear_cutoff / (2 * math.pi), "Hz"))
    return table(rows, stem="derived", title="Derived parameters", caption=prose("derived", has_cutoff=arm.has_cutoff))


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
        if self.symbol == "C":
            return prose("paper_damping", used=self.used)
        if self.printed is None:
            return "needed, but not in the paper: an assumption"
        is_as_printed = self.symbol != "ρ" and math.isclose(self.used, self.printed)
        return "" if is_as_printed else prose("paper_value", row=self)


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
    return all(math.isclose(row.used, row.printed or 0.0) for row in paper_values(arm) if row.symbol in "L A E κ G")


def paper_section(case: Case) -> PageSection:
    """Table 1 and its corrections."""
    values = table(
        paper_values(case.arm),
        stem="paper-values",
        title="Table 1 of the paper, and the values used here",
        caption=prose("paper_table"),
    )
    words = (prose("paper"),)
    return PageSection(anchor="paper", title="The paper's values, corrected", words=words, blocks=(values,))


# ------------------------------------------------------------ assumptions


CANDIDATE_COLUMNS = ("is_own", "depth", "width", "second_moment", "hub_inertia")
LOOP_COLUMNS = ("verdict", "K2_below", "K2_below_is_edge")


def assumptions_section(case: Case) -> PageSection:
    """Frequencies over the sections and the hub inertias that could be chosen, with sensitivities."""
    arm, title, blocks = case.arm, "What the assumptions do", list[Picture | Table]()
    if not arm.is_uniform:
        return PageSection(anchor="assumptions", title=title, words=(prose("assumptions_rig"),))
    blocks += candidate_blocks(
        section_study(arm), "section", "Candidate sections: rectangles of this area", "depth of the section [m]",
        prose("assumed_section"),
    )  # fmt: skip
    if has_hub := has_hub_inertia(arm):
        hub = hub_study(arm)
        blocks += candidate_blocks(
            hub, "hub", "Candidate hub inertias", "hub inertia [kg m²]",
            prose("assumed_hub", locked=float(hub.locked[0]), pinned=float(hub.pinned[0])),
        )  # fmt: skip
    words = (prose("assumptions", arm=arm, is_from_paper=is_from_paper(arm), has_hub=has_hub),)
    return PageSection(anchor="assumptions", title=title, words=words, blocks=blocks)


def candidate_blocks(study: Study, stem: str, title: str, label: str, caption: str) -> Iterator[Picture | Table]:
    """Natural frequencies over the candidates as a picture, and with the sensitivities, a column a mode, as a table."""
    low, high = (significant(float(omega), 5) for omega in study.natural_frequency[[0, -1], 0])
    yield Picture(
        stem=f"assumptions-{stem}-frequencies",
        title=f"Natural frequencies over the {label.partition(' [')[0]}",
        caption=prose("assumed_frequencies"),
        alt=f"Natural frequencies over the {label}; the first goes from {low} to {high} rad/s.",
        figure=draw_candidates(study, label),
    )
    rows, columns = study.candidates, list[Column]()
    columns += table(rows, [name for name in CANDIDATE_COLUMNS if getattr(rows[0], name) is not None]).columns
    for number, omega in enumerate(study.natural_frequency.T, 1):
        columns.append(
            Column(f"mode_{number}_rad_s", f"mode {number}", "rad/s", of=omega, digits=singly(significant, 6))
        )
    for number, slope in enumerate(study.sensitivity.T, 1):
        name = f"sensitivity of mode {number}"
        columns.append(Column(f"sensitivity_{number}", name, "%/%", of=slope, digits=partial(fixed, decimals=3)))
    columns += table(rows, LOOP_COLUMNS).columns
    yield Table(stem=f"assumptions-{stem}", title=title, caption=caption, columns=tuple(columns))


def draw_candidates(study: Study, label: str) -> Figure:
    """Natural frequencies over the candidates of an assumed parameter, both axes logarithmic; the arm's own filled."""
    own = study.is_own
    with page(9.0, 4.6, f"{study.arm.name}: natural frequencies over the {label.partition(' [')[0]}") as (figure, ax):
        ax.axvline(study.values[own][0], color=GREY, lw=1.0, ls=(0, (4, 3)))
        for number, (colour, omega) in enumerate(zip(COLOURS, study.natural_frequency.T, strict=False), 1):
            ax.plot(study.values, omega, "o-", color=colour, mfc="white", label=f"mode {number}")
            ax.plot(study.values[own], omega[own], "o", color=colour, ms=7.0, zorder=4)
        ax.set(xscale="log", yscale="log", xlabel=label, ylabel="natural frequency [rad/s]")
    return figure
