"""The arm without a controller: modes, shapes, theories, sensitivities; frequency responses, computed and measured."""

import math
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import partial
from typing import Any

import numpy as np

import tfarm
from tfarm.arm import Arm, Theory
from tfarm.audit.arm_proofs import BRACKET_DIGITS, proven_damped_modes, proven_modes
from tfarm.digits import fixed, kept_digits, lined, listed, plain
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.fitting.fit import ARMS, arms_drawn, response_band, stable_share
from tfarm.fitting.overlay import overlay
from tfarm.loop.margins import margins
from tfarm.loop.plane import ranges_of
from tfarm.plots import frequency, motion
from tfarm.plots.style import gains_words
from tfarm.report.page import ArmReport, PageSection, Picture, has_loop, picture, prose, sheet, upper
from tfarm.response.frequency import AXIS_SHARE, Bode, bode
from tfarm.schema import Column, Table, curve_table, table
from tfarm.spectrum import Modes
from tfarm.spectrum.gains import default_gains
from tfarm.spectrum.listing import SHAPE_DIGITS, beyond_the_box, listed_modes

# as `tfarm modes` lists them; shapes in three rows of two
TABLED_MODES = 10
DRAWN_MODES = 6
THEORIES: tuple[Theory, ...] = ("timoshenko", "shear", "rayleigh", "euler-bernoulli")


def modes_section(report: ArmReport) -> PageSection:
    """Everything about free vibration: at C = 0, and the eigenvalues at the arm's own C."""
    arm = report.arm
    found = tfarm.modes(arm, count=TABLED_MODES)
    words = [prose("complete_modes")]
    blocks: list[Picture | Table] = [modal_table(found)]
    if not arm.is_uniform:
        blocks.append(locked_table(found))
        words += [prose("which_is_measured")] * (not arm.is_locked)
    if not arm.is_undamped:
        try:
            blocks += damped_tables(found)
        except (ConvergenceError, CertificationError) as error:
            words.append(prose("no_damped_table", why=error))
    drawn = tfarm.modes(arm, count=DRAWN_MODES)
    shapes = motion.scaled(drawn, DRAWN_MODES)
    columns = (
        Column("x_m", of=np.linspace(0.0, arm.length, motion.SHAPE_POINTS)),
        *(Column(f"mode_{number}", of=np.round(w, SHAPE_DIGITS - 1) + 0.0) for number, w in shapes.items()),
    )
    nodes = [own for number, own in zip(drawn.index, drawn.nodes, strict=True) if number in shapes]
    blocks += [
        picture("mode_shapes", motion.modes.figure(drawn), data=columns, arm=arm, nodes=nodes),
        theories(arm),
        sensitivity_table(found),
    ]
    return PageSection(title="Modes", words=words, blocks=blocks)


# ------------------------------------------------------------ natural frequencies, and their proof


def modal_table(modes: Modes) -> Table:
    """Frequencies, hub participation, modal moment and nodes."""
    decimals = SHAPE_DIGITS - 1 - math.floor(math.log10(modes.arm.length))
    rows = []
    for row in listed_modes(modes).modes:  # what depends on a shape to the digits that hold on every processor
        participation, moment = kept_digits((row.hub_participation, row.modal_moment + 0.0), SHAPE_DIGITS)
        nodes = np.round(row.nodes, decimals).tolist()
        rows.append(replace(row, hub_participation=participation, modal_moment=moment, nodes=nodes))
    names = ("index", "natural_frequency", "natural_frequency_hz", "hub_participation", "modal_moment", "nodes")
    columns = table(rows, names).columns
    proof = how_proven(modes, columns[1].cells, columns[2].cells)
    return sheet("modal_table", columns, arm=modes.arm, proof=proof)


def how_proven(modes: Modes, cells: Sequence[str], cells_hz: Sequence[str]) -> str:
    """Whether every digit of these cells [rad/s] and [Hz] is certified: a sentence or two."""
    try:
        proof = proven_modes(modes.arm, int(modes.index[-1]))
    except CertificationError as error:
        return f"The digits are those of double precision, not proven: {error}."
    rows = np.flatnonzero(modes.index > 0).tolist()
    two_pi = Decimal("6.2831853071795864769252867665590057683943387987502")
    is_proven = all(
        rounds_to(cells[row], bracket) and rounds_to(cells_hz[row], bracket, two_pi)
        for row, bracket in zip(rows, proof.brackets, strict=True)
    )
    return prose("proven_digits", is_proven=is_proven, digits=BRACKET_DIGITS, proof=proof, arm=modes.arm)


def rounds_to(cell: str, bracket: tuple[str, str], divisor: Decimal = Decimal(1)) -> bool:
    """Whether every number in the bracket, divided by the divisor, is rounded to the number of the cell."""
    with localcontext(prec=45):
        return all((Decimal(end) / divisor).quantize(Decimal(cell)) == Decimal(cell) for end in bracket)


# ------------------------------------------------------------ damped modes, and those of a locked hub


def damped_tables(undamped: Modes) -> list[Table]:
    """The arm's damped modes, each number certified to 12 digits and printed to fewer; then those of no mode."""
    arm = undamped.arm
    damped = proven_damped_modes(arm, int(undamped.index[-1]))
    found = listed_modes(undamped)
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
        *([sheet("unassigned_eigenvalues", table(found.unassigned))] if found.unassigned else []),
    ]


def locked_table(found: Modes) -> Table:
    """A row a mode: natural frequency with the hub free, and with the hub locked."""
    rows = [row for row in listed_modes(found).modes if row.index > 0]
    return sheet("hub_locked", table(rows, ("index", "natural_frequency", "hub_locked")))


# ------------------------------------------------------------ shapes, theories, sensitivities


def theories(arm: Arm) -> Table:
    """Natural frequencies by the four beam theories, and differences from the first in per cent."""
    found = {theory: tfarm.modes(arm, TABLED_MODES, theory=theory) for theory in THEORIES}
    omega = {theory: each.natural_frequency[each.index > 0] for theory, each in found.items()}
    differences = {theory: 100 * (omega[theory] / omega["timoshenko"] - 1) for theory in THEORIES[1:]}
    columns = (
        Column("mode", "mode", of=range(1, TABLED_MODES + 1)),
        *(
            Column(f"{theory.replace('-', '_')}_rad_s", theory.title(), "rad/s", of=each, digits=lined(8, 7))
            for theory, each in omega.items()
        ),
        *(
            Column(
                f"{theory.replace('-', '_')}_difference_percent",
                f"{theory.title()}, difference",
                "%",
                of=each,
                digits=lined(5, 3),
            )
            for theory, each in differences.items()
        ),
    )
    return sheet("theories", columns, worst=differences["euler-bernoulli"])


def sensitivity_table(modes: Modes) -> Table:
    """Per cent of frequency per per cent of each parameter: a row a parameter, a column a mode."""
    flexible = modes.index > 0
    rows = {
        name.replace("youngs", "Young's").replace("_", " "): np.round(values[flexible], SHAPE_DIGITS - 1) + 0.0
        for name, values in modes.sensitivity.items()
    }
    shown = {name: values for name, values in rows.items() if abs(values).max() > 5e-7}  # which do not read as zero
    by_mode = zip(modes.index[flexible], np.array(list(shown.values())).T, strict=True)
    columns = (
        Column("parameter", "parameter", of=list(shown)),
        *(
            Column(
                f"mode_{number}",
                f"mode {number}",
                "%/%",
                of=values,
                digits=partial(fixed, decimals=3),
                tint=list(map(tint, values)),
            )
            for number, values in by_mode
        ),
    )
    return sheet(
        "sensitivities", columns, is_rig=not modes.arm.is_uniform, dropped=[name for name in rows if name not in shown]
    )


def tint(x: float) -> str:
    """Orange for a rise, blue for a fall, full at 2 %/%; light enough for dark print."""
    strength = 0.45 * min(1.0, abs(x) / 2.0) ** 0.6
    return "#" + "".join(
        f"{round(255 - strength * (255 - part)):02x}" for part in ((196, 80, 10) if x > 0 else (0, 96, 168))
    )


# ------------------------------------------------------------ frequency responses


def bode_section(report: ArmReport, output: str) -> PageSection:
    """One output: picture, its meaning, poles and zeros."""
    data = bode(report.arm, output)
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
        picture("bode", frequency.bode.figure(data), stem=stem, data=curve_table(data), **bode_facts(data)),
        sheet("bode_table", roots, stem=f"{stem}-roots", **facts),
    )
    words = () if roots else (f"{prose('bode_roots', **facts)} There are none.",)
    return PageSection(title=f"From {what}", words=words, blocks=blocks)


def bode_facts(data: Bode) -> dict[str, Any]:
    """The facts of a caption of a response: its zeros in the right half-plane, and the turn of its phase."""
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
        names = listed([f"{each.label} [{each.unit}]" for each in fit.responses])
        blocks.append(picture("fit_overlay", frequency.fitted.figure(fit), names=names))
    blocks += [
        sheet("fitted", table(fit.parameters), stem="fit"),
        sheet("fit_resonances", table(fit.resonances)),
    ]
    try:
        arms = arms_drawn(fit, count)
    except ConvergenceError as error:
        words.append(f"The loops of the arms that agree with the data are not drawn: {error}.")
    else:
        every = [margins(each, default_gains(fit.arm)) for each in arms if has_loop(fit.arm)]
        gains = gains_words(default_gains(fit.arm))
        stable = [each.in_band for each in every if each.in_band is not None]
        if fit.responses:
            output = "root_moment"
            figure = frequency.draw_band.figure(fit, response_band(fit, arms, output), output, len(arms))
            blocks.append(picture("fit_band", figure, arms=arms))
        if every:
            words.append(prose("fit_share", gains=gains, every=every))
            columns = table(stable, ("phase_margin", "delay_margin", "disk_margin"))
            blocks += [
                picture("fit_map", frequency.draw_share.figure(fit, stable_share(arms, ranges_of(fit.arm)))),
                sheet("fit_margins", columns, gains=gains),
            ]
    answer = prose("fit", verdict=fit.verdict, found=fit.in_words)
    return PageSection(title="Fitted to measurements", answer=answer, words=words, blocks=blocks)


# ------------------------------------------------------------ measured


def measured_section(report: ArmReport) -> PageSection:
    """Each response over the exact one, with the differences."""
    blocks: list[Picture | Table] = []
    words: list[str] = []
    for number, one in enumerate(report.measured, start=1):
        found = overlay(report.arm, one)
        label = f"-{number}" if len(report.measured) > 1 else ""
        name = found.measured.label
        words.append(prose("measured_response", name=name, found=found, peaks=found.unmatched / (2 * math.pi)))
        blocks += [
            picture(
                "measured", frequency.measured.figure(found), stem=f"measured{label}", data=found.csv_table, name=name
            ),
            sheet("measured_modes", table(found.modes), stem=f"measured-modes{label}"),
            sheet("measured_required", table(found.required_changes), stem=f"measured-required{label}"),
        ]
    return PageSection(title="Measured over exact", words=words, blocks=blocks)
