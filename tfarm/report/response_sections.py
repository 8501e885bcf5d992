"""The arm without a controller: its numbers and assumptions, modes, shapes, theories, sensitivities, responses."""

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm, Theory, implausible, input_words, unit_of
from tfarm.arm.chain import file_text
from tfarm.arm.schema import file_key
from tfarm.audit.arm_proofs import BRACKET_DIGITS
from tfarm.digits import column_format, fix_decimals, join_words, kept_digits, plain, significant, unit
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.fitting.fit import ARMS
from tfarm.plots import arm_sketch, frequency, motion
from tfarm.plots.labels import gains_words
from tfarm.report.blocks import Fact, PageSection, Picture, picture_block, prose, record_sheet, sheet, upper
from tfarm.report.page import ArmReport
from tfarm.response.frequency import AXIS_SHARE, Bode
from tfarm.schema import Column, Quantity, Table, curve_table, table
from tfarm.spectrum import Modes
from tfarm.spectrum.listing import SHAPE_DIGITS, beyond_the_box

# as `tfarm modes` lists them; shapes in three rows of two
TABLED_MODES = 10


def arm_section(report: ArmReport) -> PageSection:
    """Return the first part of every page: headline numbers, slips of units, the theory, and the parameters."""
    arm = report.arm
    input = input_words(arm)
    words = (
        prose("units", odd="; ".join(implausible(arm))),
        prose("rig", arm=arm, input=input),
        "" if arm.assumptions else "This arm states no assumptions.",
    )
    return PageSection(
        title="The arm",
        facts=headline_numbers(report.modes(3)),
        words=list(filter(None, words)),
        items=arm.assumptions,
        blocks=(
            picture_block("arm", arm_sketch.sketch.figure(arm), arm=arm, input=input),
            sheet(
                "parameters",
                table([*file_parameters(arm, tomllib.loads(file_text(arm, report.chain)))]),
                is_rig=not arm.is_uniform,
            ),
            derived_table(arm),
        ),
    )


def headline_numbers(modes: Modes) -> tuple[Fact, ...]:
    """Return first natural frequencies (at C = 0), total inertia, slenderness, shear cut-off, damping."""
    arm = modes.arm
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


class FileParameter(NamedTuple):
    """A number of the arm's file."""

    label: Annotated[str, Quantity("parameter", help="what the number is in the model")]
    value: Annotated[float | str, Quantity("value", digits=10, help="as the file has it")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the value")]
    key: Annotated[str, Quantity("key of the file", help="table and key of the TOML file")]


def file_parameters(arm: Arm, table: Mapping[str, Any], under: str = "") -> Iterator[FileParameter]:
    """Yield the numbers of a table of an arm's file by their keys, those of tables in it too."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from file_parameters(arm, value, f"{under}{key}.")
        elif isinstance(value, list) and all(isinstance(each, dict) for each in value):
            yield from file_parameters(
                arm, {str(number): each for number, each in enumerate(value, 1)}, f"{under}{key}."
            )
        elif key not in ("name", "assumptions"):
            # which are in other places of the page
            of = file_key(f"{under}{key}", arm)
            yield FileParameter(of.label, value, unit(of.unit), f"{under}{key}")


class Derived(NamedTuple):
    """A number that follows from the parameters; False where an arm has none."""

    quantity: Annotated[str, Quantity("quantity", help="number that the parameters determine")]
    symbol: Annotated[str, Quantity("symbol", help="letter or formula of the quantity")]
    value: Annotated[float | Literal[False], Quantity("value", digits=8, help="from the parameters alone")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the value")]


def derived_table(arm: Arm) -> Table:
    """Return the numbers that follow from the parameters alone."""
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
        Derived(
            "rotor inertia at the hub",
            "N² J_m",
            arm.motor is not None and arm.motor.reflected_inertia,
            "kg m²",
        ),
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
            f"losses at the hub, in {RATE_GAIN}",
            "",
            arm.rate_loss != 0.0 and arm.rate_loss,
            unit_of(RATE_GAIN, arm),
        ),
    ]
    return record_sheet("derived", [row for row in rows if row.value is not False], arm=arm)


# ------------------------------------------------------------ modes


def modes_section(report: ArmReport) -> PageSection:
    """Return everything about free vibration: at C = 0, and the eigenvalues at the arm's own C."""
    drawn_modes = 6
    of_theories: tuple[Theory, ...] = ("timoshenko", "shear", "rayleigh", "euler-bernoulli")
    arm = report.arm
    words = [prose("complete_modes")]
    blocks: list[Picture | Table] = [modal_table(report)]
    if not arm.is_uniform:
        blocks.append(locked_table(report))
        words += [prose("which_is_measured")] * (not arm.is_locked)
    if not arm.is_undamped:
        try:
            blocks += damped_tables(report)
        except (ConvergenceError, CertificationError) as error:
            words.append(prose("no_damped_table", why=error))
    drawn = report.modes(drawn_modes)
    x, shapes = motion.scaled_shapes(drawn, drawn_modes)
    columns = (
        Column("x_m", of=x),
        *(Column(f"mode_{number}", of=np.round(w, SHAPE_DIGITS - 1) + 0.0) for number, w in shapes.items()),
    )
    nodes = [own for number, own in zip(drawn.index, drawn.nodes, strict=True) if number in shapes]
    blocks += [
        picture_block("mode_shapes", motion.modes.figure(drawn), data=columns, arm=arm, nodes=nodes),
        theories({theory: report.modes(TABLED_MODES, theory) for theory in of_theories}),
        sensitivity_table(report.modes(TABLED_MODES)),
    ]
    return PageSection(title="Modes", words=words, blocks=blocks)


# ------------------------------------------------------------ natural frequencies, and their proof


def modal_table(report: ArmReport) -> Table:
    """Frequencies, hub participation, modal moment and nodes."""
    decimals = SHAPE_DIGITS - 1 - math.floor(math.log10(report.arm.length))
    rows = []
    # what depends on a shape to the digits that hold on every processor
    for row in report.mode_list(TABLED_MODES).modes:
        participation, moment = kept_digits((row.hub_participation, row.modal_moment + 0.0), SHAPE_DIGITS)
        nodes = np.round(row.nodes, decimals).tolist()
        rows.append(replace(row, hub_participation=participation, modal_moment=moment, nodes=nodes))
    names = (
        "index",
        "natural_frequency",
        "natural_frequency_hz",
        "hub_participation",
        "modal_moment",
        "nodes",
    )
    columns = table(rows, names).columns
    proof = how_proven(report, columns[1].cells, columns[2].cells)
    return sheet("modal_table", columns, arm=report.arm, proof=proof)


def how_proven(report: ArmReport, cells: Sequence[str], cells_hz: Sequence[str]) -> str:
    """Whether every digit of these cells [rad/s] and [Hz] is certified: a sentence or two."""
    try:
        proof = report.proven_modes(TABLED_MODES)
    except CertificationError as error:
        return f"The digits are those of double precision, not proven: {error}."
    rows = np.flatnonzero(report.modes(TABLED_MODES).index > 0).tolist()
    two_pi = Decimal("6.2831853071795864769252867665590057683943387987502")
    is_proven = all(
        rounds_to(cells[row], bracket) and rounds_to(cells_hz[row], bracket, two_pi)
        for row, bracket in zip(rows, proof.brackets, strict=True)
    )
    return prose("proven_digits", is_proven=is_proven, digits=BRACKET_DIGITS, proof=proof, arm=report.arm)


def rounds_to(cell: str, bracket: tuple[str, str], divisor: Decimal = Decimal(1)) -> bool:
    """Whether every number in the bracket, divided by the divisor, is rounded to the number of the cell."""
    with localcontext(prec=45):
        return all((Decimal(end) / divisor).quantize(Decimal(cell)) == Decimal(cell) for end in bracket)


# ------------------------------------------------------------ damped modes, and those of a locked hub


def damped_tables(report: ArmReport, count: int = TABLED_MODES) -> list[Table]:
    """Return the arm's damped modes, each number certified to 12 digits and printed to fewer; then those of no mode."""
    arm = report.arm
    damped = report.proven_damped_modes(count)
    found = report.mode_list(count)
    every = np.concatenate([damped.eigenvalues, damped.unassigned_pairs])
    inside = np.all(damped.box.holds(every) | np.isnan(every), axis=1)
    number = len(damped.index)
    names = ("index", "eigenvalue", "second_eigenvalue", "damping_ratio")
    is_there = Column("complete", "list complete", of=np.where(inside, "in the box", "outside")[:number])
    return [
        sheet(
            "damped_modes",
            [*table(found.modes[:number], names).columns, is_there],
            arm=arm,
            damped=damped,
            note=found.damped_note,
            is_inside=bool(inside.all()),
            beyond=beyond_the_box(arm),
            edges=[plain(round(x)) if abs(x) >= 100 else plain(x, 3) for x in damped.box],
        ),
        *([record_sheet("unassigned_eigenvalues", found.unassigned)] if found.unassigned else []),
    ]


def locked_table(report: ArmReport, count: int = TABLED_MODES) -> Table:
    """Return a row a mode: natural frequency with the hub free, and with the hub locked."""
    rows = [row for row in report.mode_list(count).modes if row.index > 0]
    return sheet("hub_locked", table(rows, ("index", "natural_frequency", "hub_locked")))


# ------------------------------------------------------------ shapes, theories, sensitivities


def theories(found: Mapping[Theory, Modes]) -> Table:
    """Return natural frequencies by the four beam theories, and differences from the first in per cent."""
    omega = {theory: each.natural_frequency[each.index > 0] for theory, each in found.items()}
    first, *others = omega
    differences = {theory: 100 * (omega[theory] / omega[first] - 1) for theory in others}
    columns = [Column("mode", "mode", of=range(1, TABLED_MODES + 1))]
    for theory, each in omega.items():
        name = f"{theory.replace('-', '_')}_rad_s"
        columns.append(Column(name, theory.title(), "rad/s", of=each, digits=column_format(8, 7)))
    for theory, each in differences.items():
        name = f"{theory.replace('-', '_')}_difference_percent"
        label = f"{theory.title()}, difference"
        columns.append(Column(name, label, "%", of=each, digits=column_format(5, 3)))
    return sheet("theories", columns, worst=differences["euler-bernoulli"])


def sensitivity_table(modes: Modes) -> Table:
    """Return per cent of frequency per per cent of each parameter: a row a parameter, a column a mode."""
    flexible = modes.index > 0
    rows = {
        name.replace("youngs", "Young's").replace("_", " "): np.round(values[flexible], SHAPE_DIGITS - 1)
        + 0.0
        for name, values in modes.sensitivity.items()
    }
    # which do not read as zero
    shown = {name: values for name, values in rows.items() if abs(values).max() > 5e-7}
    by_mode = zip(modes.index[flexible], np.array(list(shown.values())).T, strict=True)
    columns = (
        Column("parameter", "parameter", of=list(shown)),
        *(
            Column(
                f"mode_{number}",
                f"mode {number}",
                "%/%",
                of=values,
                digits=partial(fix_decimals, decimals=3),
                tint=list(map(tint, values)),
            )
            for number, values in by_mode
        ),
    )
    return sheet(
        "sensitivities",
        columns,
        is_rig=not modes.arm.is_uniform,
        dropped=[name for name in rows if name not in shown],
    )


def tint(x: float) -> str:
    """Return orange for a rise, blue for a fall, full at 2 %/%; light enough for dark print."""
    strength = 0.45 * min(1.0, abs(x) / 2.0) ** 0.6
    full = (196, 80, 10) if x > 0 else (0, 96, 168)
    parts = [round(255 - strength * (255 - part)) for part in full]
    return f"#{bytes(parts).hex()}"


# ------------------------------------------------------------ frequency responses


def bode_section(report: ArmReport, output: str) -> PageSection:
    """Return one output: picture, its meaning, poles and zeros."""
    data = report.bode(output)
    stem = f"bode-{output.replace('_', '-')}"
    what = f"{data.input_label} to {data.label}"
    if data.is_zero:
        none = f"The {data.label} is zero at every frequency: this arm's tip is pinned."
        return PageSection(title=f"From {what}", words=(none,))
    boxes = [
        f"{name} in {plain(left, 5)} < Re s < {plain(right, 5)} 1/s"
        for name, (left, right) in (("poles", data.pole_width), ("zeros", data.zero_width))
        if not math.isinf(left)
    ]
    roots = table([*data.pole_list, *data.zero_list], parent=data).columns
    facts = {"data": data, "boxes": boxes}
    blocks = (
        picture_block(
            "bode", frequency.bode.figure(data), stem=stem, data=curve_table(data), **bode_facts(data)
        ),
        sheet("bode_table", roots, stem=f"{stem}-roots", **facts),
    )
    words = () if roots else (f"{prose('bode_roots', **facts)} There are none.",)
    return PageSection(title=f"From {what}", words=words, blocks=blocks)


def bode_facts(data: Bode) -> dict[str, Any]:
    """Return the facts of a caption of a response: its zeros in the right half-plane, and the turn of its phase."""
    right = data.zeros[data.zeros.real > AXIS_SHARE * abs(data.zeros)]
    count = int(np.sum(right.imag == 0) + 2 * np.sum(right.imag > 0))
    slowest = float(abs(right).min(initial=np.inf))
    return {"found": data, "right": count, "slowest": slowest, "turned": float(np.ptp(data.phase))}


# ------------------------------------------------------------ fitted to measurements


def fit_section(report: ArmReport, count: int = ARMS) -> PageSection:
    """Measurements, the fitted numbers with their intervals, and the share of possible arms on which a loop holds."""
    fit = report.fit
    assert fit is not None
    words = [f"{upper(each)}." for each in fit.not_determined]
    words += [f"Remedy: {fit.advice}."] * bool(fit.misses)
    blocks: list[Picture | Table] = []
    if fit.responses:
        names = join_words([f"{each.label} [{each.unit}]" for each in fit.responses])
        blocks.append(picture_block("fit_overlay", frequency.fit_curves.figure(fit), names=names))
    if fit.problem.runs:
        words += [f"{upper(each)}." for each in fit.run_notes]
        blocks.append(picture_block("fit_runs", frequency.fit_runs.figure(fit)))
    blocks.append(record_sheet("fitted", fit.parameters, stem="fit"))
    if fit.responses:
        blocks.append(record_sheet("fit_resonances", fit.resonances))
    if fit.problem.runs:
        blocks += [
            record_sheet("fit_signals", fit.run_signals),
            record_sheet("fit_own", fit.own_numbers),
        ]
    try:
        possible = report.possible_arms(count)
    except ConvergenceError as error:
        words.append(f"The loops of the arms that agree with the data are not drawn: {error}.")
    else:
        if possible.band is not None:
            figure = frequency.draw_band.figure(fit, possible.band, "root_moment", len(possible.arms))
            blocks.append(picture_block("fit_band", figure, arms=possible.arms))
        if possible.share is not None:
            gains = gains_words(report.default.law)
            words.append(prose("fit_share", gains=gains, every=possible.margins))
            stable = [each.in_band for each in possible.margins if each.in_band is not None]
            columns = table(stable, ("phase_margin", "delay_margin", "disk_margin"))
            blocks += [
                picture_block("fit_map", frequency.draw_share.figure(fit, possible.share)),
                sheet("fit_margins", columns, gains=gains),
            ]
    answer = prose("fit", verdict=fit.verdict, found=fit.in_words)
    return PageSection(title="Fitted to measurements", answer=answer, words=words, blocks=blocks)


# ------------------------------------------------------------ measured


def measured_section(report: ArmReport) -> PageSection:
    """Return each response over the exact one, with the differences."""
    blocks: list[Picture | Table] = []
    words: list[str] = []
    for number, found in enumerate(report.overlays, start=1):
        label = f"-{number}" if len(report.measured) > 1 else ""
        name = found.measured.label
        words.append(
            prose("measured_response", name=name, found=found, peaks=found.unmatched / (2 * math.pi))
        )
        blocks += [
            picture_block(
                "measured",
                frequency.measured_response.figure(found),
                stem=f"measured{label}",
                data=found.csv_table,
                name=name,
            ),
            record_sheet("measured_modes", found.modes, stem=f"measured-modes{label}"),
            record_sheet("measured_required", found.required_changes, stem=f"measured-required{label}"),
        ]
    return PageSection(title="Measured over exact", words=words, blocks=blocks)


# ------------------------------------------------------------ assumptions


def assumptions_section(report: ArmReport) -> PageSection:
    """Return frequencies over the sections and the hub inertias that could be chosen, with sensitivities."""
    arm = report.arm
    blocks = [record_sheet(kind, study.candidates, study=study) for kind, study in report.candidates.items()]
    words = (prose("assumptions", arm=arm, has_hub=report.has_candidate_hubs),)
    return PageSection(title="Effect of the assumptions", words=words, blocks=blocks)
