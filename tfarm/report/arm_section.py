"""The arm: its headline numbers, its parameters, what follows from these, and its assumptions."""

import math
import tomllib
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple

import tfarm
from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm, implausible, input_words, unit_of
from tfarm.arm.chain import file_text
from tfarm.arm.schema import file_key
from tfarm.digits import plain, significant, unit
from tfarm.plots.motion import sketch
from tfarm.report.page import ArmReport, Fact, PageSection, picture, prose, sheet
from tfarm.schema import Quantity, Table, table
from tfarm.studies.candidates import Candidates, has_hub_inertia, hub_study, section_study


def arm_section(report: ArmReport) -> PageSection:
    """The first part of every page: headline numbers, slips of units, the theory, and the parameters."""
    arm = report.arm
    input = input_words(report.arm)
    words = (
        prose("units", odd="; ".join(implausible(arm))),
        prose("rig", arm=arm, input=input),
        "" if arm.assumptions else "This arm states no assumptions.",
    )
    return PageSection(
        title="The arm",
        facts=headline_numbers(arm),
        words=list(filter(None, words)),
        items=arm.assumptions,
        blocks=(
            picture("arm", sketch.figure(arm), arm=arm, input=input),
            sheet(
                "parameters",
                table([*parameters(arm, tomllib.loads(file_text(arm, report.chain)))]),
                is_rig=not arm.is_uniform,
            ),
            derived_table(arm),
        ),
    )


def headline_numbers(arm: Arm) -> tuple[Fact, ...]:
    """Return first natural frequencies (at C = 0), total inertia, slenderness, shear cut-off, damping."""
    modes = tfarm.modes(arm, count=3)
    numbered = zip(modes.index.tolist(), modes.natural_frequency.tolist(), strict=True)
    # the rigid body's 0 is not shown
    frequencies = [(f"natural frequency {number}", omega) for number, omega in numbered if number > 0]
    if arm.has_cutoff:
        frequencies.append(("shear cut-off √(κGA/ρI)", arm.shear_cutoff))
    slenderness = arm.link.slenderness if arm.is_uniform else arm.length / arm.link.section.radius_of_gyration
    return (
        *(
            Fact(label, significant(omega, 8), "rad/s", f"{significant(omega / (2 * math.pi), 8)} Hz")
            for label, omega in frequencies
        ),
        Fact(
            "total inertia J about the hub",
            significant(arm.total_inertia, 8),
            "kg m²",
            "the arm cannot turn as a rigid body" * (not arm.has_rigid_mode),
        ),
        Fact("slenderness L/√(I/A)", significant(slenderness, 5)),
        Fact("damping C", plain(arm.damping), "s", prose("damping_note", arm=arm)),
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
    turns = arm.has_rigid_mode and not arm.is_locked
    rows = [
        Derived(f"segment {i}: " * bool(arm.outer) + quantity, symbol, value, unit)
        for i, link in enumerate(arm.links, 1)
        for quantity, symbol, value, unit in (
            ("area of the section", "A", link.section.area, "m²"),
            ("second moment of area", "I", link.section.second_moment, "m⁴"),
            (
                f"shear factor, {'Cowper (1966)' if link.section.shear_factor is None else 'given'}",
                "κ",
                link.shear_factor,
                "",
            ),
            ("mass", "ρAL", link.rhoA * link.length, "kg"),
            ("bending stiffness", "EI", link.EI, "N m²"),
            ("shear stiffness", "κGA", link.kGA, "N"),
            (
                "Poisson's ratio of an isotropic material",
                "E/2G − 1",
                -1 < link.poissons_ratio <= 0.5 and link.poissons_ratio,
                "",
            ),
            ("radius of gyration", "√(I/A)", link.section.radius_of_gyration, "m"),
            ("slenderness", "L/√(I/A)", link.slenderness, ""),
        )
    ] + [
        Derived("rotor inertia at the hub", "N² J_m", arm.motor is not None and arm.motor.reflected_inertia, "kg m²"),
        Derived(
            "root moment per torque at rest",
            "−(J − I_h)/J" * arm.is_uniform,
            turns and -arm.gauged_inertia / arm.total_inertia,
            "N m/(N m)",
        ),
        Derived(
            "input for a torque of 1 N m",
            "",
            arm.input_per_torque != 1.0 and arm.input_per_torque,
            unit_of(MOMENT_GAIN, arm),
        ),
        Derived(
            f"losses at the hub, in {RATE_GAIN}", "", arm.rate_loss != 0.0 and arm.rate_loss, unit_of(RATE_GAIN, arm)
        ),
    ]
    return sheet("derived", table([row for row in rows if row.value is not False]), arm=arm)


# ------------------------------------------------------------ assumptions


def assumptions_section(report: ArmReport) -> PageSection:
    """Frequencies over the sections and the hub inertias that could be chosen, with sensitivities."""
    arm = report.arm
    found: dict[str, Candidates] = {}
    if arm.is_uniform:
        found["assumptions_section"] = section_study(arm)
    if arm.is_uniform and has_hub_inertia(arm):
        found["assumptions_hub"] = hub_study(arm)
    blocks = [sheet(kind, table(study.candidates), study=study) for kind, study in found.items()]
    words = (prose("assumptions", arm=arm, has_hub=has_hub_inertia(arm)),)
    return PageSection(title="Effect of the assumptions", words=words, blocks=blocks)
