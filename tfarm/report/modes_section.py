"""Modes: undamped, damped and hub-locked frequencies, shapes, the four beam theories, sensitivities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import lru_cache, partial

import numpy as np

import tfarm
from tfarm.arm import Arm, Theory
from tfarm.arrays import Real
from tfarm.columns import Column, Table
from tfarm.digits import fixed, kept_digits, lined, listed, plain, significant, singly
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.plots.shapes import SHAPE_POINTS, draw_differences, scaled, theory_name
from tfarm.plots.shapes import modes as shapes_plot
from tfarm.report.sections import PageSection, Picture, typeset
from tfarm.schema import table
from tfarm.spectrum import DampedModes, Modes, damped_modes, modes
from tfarm.spectrum.damped import damped_at_hub
from tfarm.spectrum.listing import SHAPE_DIGITS, ListedMode, beyond_the_box, listed_modes
from tfarm.spectrum.table import hub_locked

PROVEN_MODES, BRACKET_DIGITS = (
    10,
    20,
)  # flexible modes of each arm, as its page lists them; five digits beyond a double's
PLAIN_DIGITS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
TWO_PI = Decimal("6.2831853071795864769252867665590057683943387987502")

DAMPED_CAPTION = (
    "Eigenvalues of {whose} (C = {C} s), each continued from the undamped mode of its number. Each is enclosed in a "
    "disc of 12 digits that holds exactly one. All {count} eigenvalues with {left} < Re s < {right} 1/s and |Im s| < "
    "{top} rad/s are listed (conjugates counted{rigid}): the argument principle in ball arithmetic counts those in "
    "this box. {outside}Beyond any such box there are more: {beyond}."
)
OWN_DAMPING, LOSSES = "the arm with its own damping", "the rig with what its hub, clamp and joint lose"
DAMPED_COLUMNS = ("index", "eigenvalue", "second_eigenvalue", "damping_ratio")
UNASSIGNED_NOTE = "They continue from no mode for certain; the origin is the part of the drive that sets them, if any."
NOT_ASSIGNED_NOTE = "A mode without an eigenvalue has one of those of no mode, or none in the box. "
NOT_LISTED = "Modes above {last} are not listed: the box of their eigenvalues could not be searched. "
OUTSIDE_NOTE = (
    "Rows that are “outside” lie, with one eigenvalue or both, beyond the box: beside them others may exist that are "
    "not listed. "
)
MODAL_COLUMNS = (
    "index", "natural_frequency", "natural_frequency_hz", "hub_participation", "modal_moment", "nodes",
)  # fmt: skip
PROVEN_DIGITS = 12  # of an eigenvalue: more than a page prints of any
BOX_WORDS = "in the box", "outside"
TABLED_MODES, DRAWN_MODES = 10, 6  # as `tfarm modes` lists them; shapes in three rows of two
SIMPLER: tuple[Theory, ...] = ("shear", "rayleigh", "euler-bernoulli")
NEGLECTED = 5e-7  # a sensitivity that never exceeds this reads as zero
RISE_COLOUR, FALL_COLOUR = (196, 80, 10), (0, 96, 168)  # red, green, blue: the orange and blue of the pictures
COMPLETE = (
    "Free vibration of the undamped arm. The list is complete: the number of natural frequencies below any "
    "frequency is counted, not searched for, so no mode is missing between two rows."
)
MODAL_TABLE = (
    "Natural frequencies, hub participation b (hub angle of the mode), root moment of the mode and nodes. "
    "{rigid}Modes have unit modal mass and a positive {tip}: b² is how strongly a torque at the hub excites the mode "
    "and how well the hub angle sees it{hub}. {proof}"
)
LOCKED_TAKES_NO_PART = "; the locked hub takes part in none"
FREE_PIN = "; a free pin bears no moment, so that at the root is 0"
NO_DAMPED_TABLE = "The damped modes of this arm could not be listed with a proof, and are left out: {why}."
MODE_SHAPES = (
    "Total displacement w(x), each mode scaled to a largest value of one; hub at the left (grey), nodes as "
    "open circles, their distances from the hub above. A force or a displacement sensor at a node does not "
    "touch that mode."
)
FOUR_THEORIES = (
    "The Timoshenko theory has shear and rotary inertia, the shear theory only shear, the Rayleigh theory only "
    "rotary inertia, the Euler-Bernoulli theory neither. Over these modes Euler-Bernoulli is off by {least} % "
    "to {most} %: what is left out makes an arm stiffer or lighter, and its frequencies too high."
)
DIFFERENCES = (
    "Natural frequency of each simpler theory against Timoshenko's, in per cent, mode by mode. Where a curve "
    "passes the accuracy you need, that theory no longer serves."
)
SENSITIVITIES = (
    "Per cent of natural frequency for one per cent more of the parameter, all others held (Young's modulus "
    "with the shear modulus held, the area with the second moment held); exact, from the energies of each "
    "mode. Blue lowers the frequency, orange raises it: the strongest colours are the parameters worth "
    "measuring well."
)
OF_RIGS = (
    " Without a segment's number a parameter is that of all segments at once; a length takes along what is attached to "
    "it, and x is the place of an attachment alone."
)
LOCKED_MODES = 6  # rows, of the modes that are measured on a rig
LOCKED_CAPTION = (
    "Natural frequencies with the hub free to turn and with the hub held still, neither damped{damped}. What is "
    "measured on a rig after a slew lies mostly near the right column."
)
WITH_LOSSES = (
    "; between them those of the free hub with what it loses at its own friction (and back-EMF), and nothing else"
)
WHICH_IS_MEASURED = (
    "Which frequency was measured? Once a slew is over dry friction holds the hub, and the link vibrates at the "
    "hub-locked frequencies. The linear rig, whose hub moves along, vibrates at those of the free hub with its losses. "
    "A peak near the former shows that the hub stood still, one near the latter that it moved: fit each to its own "
    "column."
)


@lru_cache(maxsize=8)  # the arm's page and the page on trust speak of the same ones, and a proof takes seconds
def proven_damped_modes(arm: Arm, count: int) -> DampedModes:
    """The arm's first damped modes, each enclosed to 12 digits, none missing in their box.

    Raises CertificationError where that cannot be proven, ConvergenceError where they cannot be told apart.
    """
    found = damped_modes(modes(arm, count))
    found.certify(PROVEN_DIGITS)
    return found


def damped_tables(undamped: Modes) -> list[Table]:
    """The arm's damped modes, each number certified to 12 digits and printed to fewer; then those of no mode."""
    arm = undamped.arm
    damped = proven_damped_modes(arm, int(undamped.index[-1]))
    C, box = arm.damping, damped.box
    edges = {"left": box.re_min, "right": box.re_max, "top": box.im_max}
    resisted = damped.single.size - len(damped.others)
    rigid = ""
    if arm.has_rigid_mode:
        rigid = ", with 0 twice" if damped.eigenvalues[0, 1] == 0 else ", with 0"
    if arm.has_rigid_mode and resisted:
        rigid = f", with 0 and the {significant(damped.single[0], 6)} 1/s to which friction resists the turning rig"
    for each in damped.others:
        rigid += f"; {significant(each, 6)} 1/s, of the motor's circuit, is one of no mode"
    words = {name: plain(round(x)) if abs(x) >= 100 else plain(x, 3) for name, x in edges.items()}
    every = np.concatenate([damped.eigenvalues, damped.unassigned_pairs])
    inside = np.all(box.holds(every) | np.isnan(every), axis=1)
    words_of = np.where(inside, *BOX_WORDS)
    notes = NOT_LISTED.format(last=damped.index[-1]) if damped.left_out else ""
    if damped.unassigned or not damped.is_assigned.all():
        notes += NOT_ASSIGNED_NOTE
    listed = listed_modes(undamped)
    caption = DAMPED_CAPTION.format(
        whose=OWN_DAMPING if C else LOSSES,
        C=plain(C),
        count=damped.count,
        rigid=rigid,
        outside=("" if inside.all() else OUTSIDE_NOTE) + notes,
        beyond=typeset(beyond_the_box(arm)),
        **words,
    )
    columns = table(listed.modes[: len(damped.index)], DAMPED_COLUMNS).columns
    complete = Column("complete", "list complete", of=words_of[: len(damped.index)])
    tables = [Table(stem="damped-modes", title="Damped modes", caption=caption, columns=(*columns, complete))]
    if listed.unassigned:
        more = {"stem": "unassigned-eigenvalues", "title": "Eigenvalues of no mode", "caption": UNASSIGNED_NOTE}
        tables.append(table(listed.unassigned, **more))
    return tables


def modes_section(arm: Arm) -> PageSection:
    """Everything about free vibration: at C = 0, and the eigenvalues at the arm's own C."""
    modes = tfarm.modes(arm, count=TABLED_MODES)
    exact = _flexible(
        modes if modes.theory == "timoshenko" else tfarm.modes(arm, count=TABLED_MODES, theory="timoshenko")
    )
    theories: dict[str, Real] = {t: _flexible(tfarm.modes(arm, count=TABLED_MODES, theory=t)) for t in SIMPLER}
    differences: dict[str, Real] = {theory: 100 * (simpler / exact - 1) for theory, simpler in theories.items()}
    damped: list[Table] = []
    words = [COMPLETE]
    if not arm.is_undamped:
        try:
            damped = damped_tables(modes)
        except (ConvergenceError, CertificationError) as error:
            words.append(NO_DAMPED_TABLE.format(why=error))
    return PageSection(
        anchor="modes",
        title="Modes",
        words=[*words, *[WHICH_IS_MEASURED] * (not (arm.is_uniform or arm.is_locked))],
        blocks=(
            modal_table(modes),
            *([] if arm.is_uniform else [locked_table(modes)]),
            *damped,
            _shapes(tfarm.modes(arm, count=DRAWN_MODES)),
            theories_table(exact, theories, differences),
            _differences(arm.name, differences),
            sensitivity_table(modes),
        ),
    )


def _flexible(modes: Modes) -> Real:
    return modes.natural_frequency[modes.index > 0]


def modal_table(modes: Modes) -> Table:
    """Frequencies, hub participation, modal moment and nodes."""
    rigid = "Row 0 is the arm turning as a rigid body. " if modes.arm.has_rigid_mode else ""
    tip = "tip rotation" if math.isfinite(modes.arm.payload.inertia) else "hub angle"
    tip = (
        "tip displacement" if math.isfinite(modes.arm.payload.mass) else tip
    )  # the first of its motions that it can make
    rows = listed_modes(modes).modes
    columns = table([_rounded(row, modes.arm.length) for row in rows], MODAL_COLUMNS).columns
    caption = MODAL_TABLE.format(
        rigid=rigid,
        tip=tip,
        hub=LOCKED_TAKES_NO_PART if modes.arm.is_locked else FREE_PIN if modes.arm.has_massless_hub else "",
        proof=how_proven(modes, columns[1].cells, columns[2].cells),
    )
    return Table(stem="modal-table", title="Modal table", caption=caption, columns=columns)


def _rounded(row: ListedMode, length: float) -> ListedMode:
    """The row with what depends on a mode's shape to the digits that hold on every processor."""
    decimals = SHAPE_DIGITS - 1 - math.floor(math.log10(length))
    participation, moment = kept_digits((row.hub_participation, row.modal_moment + 0.0), SHAPE_DIGITS)
    nodes = np.round(row.nodes, decimals).tolist()
    return replace(row, hub_participation=participation, modal_moment=moment, nodes=nodes)


def _shapes(modes: Modes) -> Picture:
    shapes = scaled(modes, DRAWN_MODES)
    counts = ", ".join(str(len(modes.nodes[modes.index.tolist().index(number)])) for number in shapes)
    columns = [Column("x_m", "x", "m", of=np.linspace(0.0, modes.arm.length, SHAPE_POINTS))]
    columns += [
        Column(f"mode_{number}", f"mode {number}", of=np.round(w, SHAPE_DIGITS - 1) + 0.0)
        for number, w in shapes.items()
    ]
    return Picture(
        stem="mode-shapes",
        title=f"Shapes of the first {len(shapes)} flexible modes",
        caption=MODE_SHAPES,
        alt=f"Mode shapes of the arm, modes 1 to {len(shapes)}; they have {counts} nodes between hub and tip.",
        figure=shapes_plot.figure(modes),
        data=Table(stem="mode-shapes-data", title="Mode shapes", columns=tuple(columns)),
    )


def theories_table(exact: Real, theories: Mapping[str, Real], differences: Mapping[str, Real]) -> Table:
    """Natural frequencies by the four beam theories, and differences from the first in per cent."""
    both = "natural frequency", "difference from Timoshenko"
    columns = [Column("mode", "mode", of=range(1, exact.size + 1))]
    for theory, omega in {"timoshenko": exact, **theories}.items():
        key = f"{_key(theory)}_rad_s"
        columns.append(Column(key, theory_name(theory), "rad/s", of=omega, digits=lined(8, 7), group=both[0]))
    for theory, percent in differences.items():
        key, digits = f"{_key(theory)}_difference_percent", lined(5, 3)
        columns.append(Column(key, theory_name(theory), "%", of=percent, digits=digits, group=both[1]))
    worst = differences["euler-bernoulli"]
    least, most = significant(float(worst.min()), 2), significant(float(worst.max()), 2)
    return Table(
        stem="theories",
        title="Four beam theories",
        caption=FOUR_THEORIES.format(least=least, most=most),
        columns=tuple(columns),
    )


def _key(theory: str) -> str:
    return theory.replace("-", "_")


def _differences(name: str, differences: Mapping[str, Real]) -> Picture:
    shown = dict(reversed(list(differences.items())))
    words = ", ".join(f"{theory_name(theory)} {significant(float(v[-1]), 3)} %" for theory, v in shown.items())
    columns = [Column("mode", "mode", of=range(1, TABLED_MODES + 1))]
    columns += [Column(f"{_key(t)}_difference_percent", theory_name(t), "%", of=v) for t, v in shown.items()]
    return Picture(
        stem="theory-differences",
        title="How far the simpler theories are off",
        caption=DIFFERENCES,
        alt=f"Differences from the Timoshenko theory by mode; at mode {TABLED_MODES}: {words}.",
        figure=draw_differences(name, shown),
        data=Table(stem="theory-differences-data", title="Differences", columns=tuple(columns)),
    )


def sensitivity_table(modes: Modes) -> Table:
    """Per cent of frequency per per cent of each parameter: a row a parameter, a column a mode."""
    flexible = modes.index > 0
    rows = {
        name.replace("youngs", "Young's").replace("_", " "): np.round(values[flexible], SHAPE_DIGITS - 1) + 0.0
        for name, values in modes.sensitivity.items()
    }
    shown = {name: values for name, values in rows.items() if abs(values).max() > NEGLECTED}
    dropped = [name for name in rows if name not in shown]
    columns = [Column("parameter", "parameter", of=list(shown))]
    for number, column in zip(modes.index[flexible], np.array(list(shown.values())).T, strict=True):
        tints = [tint(x) for x in column]
        columns.append(
            Column(f"mode_{number}", f"mode {number}", "%/%", of=column, digits=partial(fixed, decimals=3), tint=tints)
        )
    left_out = f" Left out, as one per cent more of it changes no frequency here: {listed(dropped)}." if dropped else ""
    return Table(
        stem="sensitivities",
        title="Sensitivity of each natural frequency",
        caption=SENSITIVITIES + OF_RIGS * (not modes.arm.is_uniform) + left_out,
        columns=tuple(columns),
    )


def tint(x: float) -> str:
    """Orange for a rise, blue for a fall, full at 2 %/%; light enough for dark print."""
    strength = 0.45 * min(1.0, abs(x) / 2.0) ** 0.6
    parts = (round(255 - strength * (255 - part)) for part in (RISE_COLOUR if x > 0 else FALL_COLOUR))
    return "#" + "".join(f"{part:02x}" for part in parts)


def locked_table(found: Modes) -> Table:
    """A row a mode: hub free, with its losses where it has any, and locked."""
    arm = found.arm
    free = tfarm.modes(arm, LOCKED_MODES, theory=found.theory)
    omega, locked = free.natural_frequency[free.index > 0], hub_locked(free)
    held = locked.natural_frequency[locked.index > 0]
    columns = [Column("mode", "mode", of=range(1, LOCKED_MODES + 1)), *_pair("hub_free", "hub free", omega)]
    lossy = None if arm.is_locked else damped_at_hub(arm, LOCKED_MODES)
    if lossy is not None and not lossy.left_out and lossy.is_assigned.all():
        flexible = lossy.index > 0
        s, ratio = lossy.eigenvalues[flexible, 0], lossy.damping_ratio[flexible]
        group = "hub free, with its own losses"
        columns += [
            Column("with_losses_rad_s", "Im s", "rad/s", of=s.imag, digits=lined(8, 7), group=group),
            Column("with_losses_damping_percent", "damping ratio", "%", of=100 * ratio, digits=singly(significant, 4),
                   group=group),
        ]  # fmt: skip
    columns += _pair("hub_locked", "hub locked", held)
    caption = LOCKED_CAPTION.format(damped=WITH_LOSSES if lossy is not None else "")
    return Table(stem="hub-locked", title="Hub free and hub locked", caption=caption, columns=tuple(columns))


def _pair(key: str, group: str, omega: np.ndarray) -> list[Column]:
    """Frequencies in rad/s and in Hz."""
    return [
        Column(f"{key}_rad_s", "frequency", "rad/s", of=omega, digits=lined(8, 7), group=group),
        Column(f"{key}_hz", "", "Hz", of=omega / (2 * math.pi), digits=lined(8, 7), group=group),
    ]


def how_proven(modes: Modes, cells: Sequence[str], cells_hz: Sequence[str]) -> str:
    """Why every digit of these cells [rad/s] and [Hz] is right, or that this is not proven: a sentence or two."""
    try:
        proof = modes.certify(BRACKET_DIGITS)
    except CertificationError as error:
        return f"The digits are those of double precision, not proven: {error}."
    rows = np.flatnonzero(modes.index > 0).tolist()
    pairs = [((cells[row], cells_hz[row]), bracket) for row, bracket in zip(rows, proof.brackets, strict=True)]
    if not all(rounds_to(w, bracket) and rounds_to(f, bracket, TWO_PI) for (w, f), bracket in pairs):
        untold = f"in one of them rounding cannot be told at {BRACKET_DIGITS} digits"
        return f"The digits are those of double precision; {untold}."
    rigid = ", the rigid body included" if modes.arm.has_rigid_mode else ""
    return (
        "Every printed digit of the natural frequencies is proven: each lies between two numbers that round to it "
        f"(bounds of {BRACKET_DIGITS} digits, ball arithmetic). So is the list: {proof.count} lie below "
        f"{float(proof.below):.6g} rad/s{rigid}. The other columns come from double precision and show fewer digits "
        "than it holds."
    )


def rounds_to(cell: str, bracket: tuple[str, str], divisor: Decimal = Decimal(1)) -> bool:
    """Whether every number in the bracket, divided by the divisor, is rounded to what the cell shows."""
    mantissa, _, power = cell.partition(" × 10")
    shown = Decimal(mantissa.translate(PLAIN_DIGITS)).scaleb(int(power.translate(PLAIN_DIGITS) or 0))
    with localcontext(prec=45):
        return all((Decimal(end) / divisor).quantize(shown) == shown for end in bracket)
