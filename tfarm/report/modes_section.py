"""Modes: undamped, damped and hub-locked frequencies, shapes, the four beam theories, sensitivities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import lru_cache, partial
from typing import Annotated, NamedTuple

import numpy as np

import tfarm
from tfarm.arm import Arm, Theory
from tfarm.arrays import Real
from tfarm.digits import fixed, kept_digits, lined, plain, significant
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.plots.motion import SHAPE_POINTS, draw_differences, scaled, theory_name
from tfarm.plots.motion import modes as shapes_plot
from tfarm.report.cases import Case
from tfarm.report.sections import PageSection, Picture, prose
from tfarm.schema import Column, Quantity, Table, table
from tfarm.spectrum import DampedModes, Modes, damped_modes, modes
from tfarm.spectrum.damped import damped_at_hub
from tfarm.spectrum.listing import SHAPE_DIGITS, ListedMode, beyond_the_box, listed_modes
from tfarm.spectrum.table import hub_locked

PROVEN_MODES, BRACKET_DIGITS = 10, 20  # flexible modes of each arm, as its page lists them; beyond a double's digits
PROVEN_DIGITS = 12  # of an eigenvalue: more than a page prints of any
TWO_PI = Decimal("6.2831853071795864769252867665590057683943387987502")
DAMPED_COLUMNS = ("index", "eigenvalue", "second_eigenvalue", "damping_ratio")
MODAL_COLUMNS = (
    "index", "natural_frequency", "natural_frequency_hz", "hub_participation", "modal_moment", "nodes",
)  # fmt: skip
BOX_WORDS = "in the box", "outside"
TABLED_MODES, DRAWN_MODES, LOCKED_MODES = 10, 6, 6  # as `tfarm modes` lists them; shapes in three rows of two
SIMPLER: tuple[Theory, ...] = ("shear", "rayleigh", "euler-bernoulli")
NEGLECTED = 5e-7  # a sensitivity that never exceeds this reads as zero
RISE_COLOUR, FALL_COLOUR = (196, 80, 10), (0, 96, 168)  # red, green, blue: the orange and blue of the pictures


@lru_cache(maxsize=8)  # the arm's page and the page on trust speak of the same ones, and a proof takes seconds
def proven_damped_modes(arm: Arm, count: int) -> DampedModes:
    """The arm's first damped modes, each enclosed to 12 digits, none missing in their box.

    Raises CertificationError where that cannot be proven, ConvergenceError where they are too near to each other.
    """
    found = damped_modes(modes(arm, count))
    found.certify(PROVEN_DIGITS)
    return found


def damped_tables(undamped: Modes) -> list[Table]:
    """The arm's damped modes, each number certified to 12 digits and printed to fewer; then those of no mode."""
    arm = undamped.arm
    damped = proven_damped_modes(arm, int(undamped.index[-1]))
    every = np.concatenate([damped.eigenvalues, damped.unassigned_pairs])
    inside = np.all(damped.box.holds(every) | np.isnan(every), axis=1)
    words_of, found = np.where(inside, *BOX_WORDS), listed_modes(undamped)
    caption = prose(
        "damped", arm=arm, damped=damped, note=found.damped_note, is_inside=bool(inside.all()),
        beyond=beyond_the_box(arm),
        resisted=damped.single.size - len(damped.others),
        edges=[plain(round(x)) if abs(x) >= 100 else plain(x, 3) for x in damped.box],
    )  # fmt: skip
    columns = table(found.modes[: len(damped.index)], DAMPED_COLUMNS).columns
    complete = Column("complete", "list complete", of=words_of[: len(damped.index)])
    tables = [Table(stem="damped-modes", title="Damped modes", caption=caption, columns=(*columns, complete))]
    if found.unassigned:
        more = {"stem": "unassigned-eigenvalues", "title": "Eigenvalues of no mode", "caption": prose("unassigned")}
        tables.append(table(found.unassigned, **more))
    return tables


def modes_section(case: Case) -> PageSection:
    """Everything about free vibration: at C = 0, and the eigenvalues at the arm's own C."""
    arm = case.arm
    modes = tfarm.modes(arm, count=TABLED_MODES)
    omega: dict[str, Real] = {
        each: _flexible(tfarm.modes(arm, TABLED_MODES, theory=each)) for each in ("timoshenko", *SIMPLER)
    }
    words, blocks = [prose("complete_modes")], [modal_table(modes)]
    if not arm.is_uniform:
        blocks.append(locked_table(modes))
        words += [prose("which_is_measured")] * (not arm.is_locked)
    if not arm.is_undamped:
        try:
            blocks += damped_tables(modes)
        except (ConvergenceError, CertificationError) as error:
            words.append(prose("no_damped_table", why=error))
    pictures = _shapes(tfarm.modes(arm, count=DRAWN_MODES)), *theories(arm.name, omega)
    return PageSection(
        anchor="modes", title="Modes", words=words, blocks=[*blocks, *pictures, sensitivity_table(modes)]
    )


def _flexible(modes: Modes) -> Real:
    return modes.natural_frequency[modes.index > 0]


def modal_table(modes: Modes) -> Table:
    """Frequencies, hub participation, modal moment and nodes."""
    rows = [_rounded(row, modes.arm.length) for row in listed_modes(modes).modes]
    columns = table(rows, MODAL_COLUMNS).columns
    proof = how_proven(modes, columns[1].cells, columns[2].cells)
    return Table(
        stem="modal-table",
        title="Modal table",
        caption=prose("modal_table", arm=modes.arm, proof=proof),
        columns=columns,
    )


def _rounded(row: ListedMode, length: float) -> ListedMode:
    """The row with all that depends on a mode's shape to the digits that hold on every processor."""
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
        caption=prose("mode_shapes"),
        alt=f"Mode shapes of the arm, modes 1 to {len(shapes)}; they have {counts} nodes between hub and tip.",
        figure=shapes_plot.figure(modes),
        data=Table(stem="mode-shapes-data", title="Mode shapes", columns=tuple(columns)),
    )


def theories(name: str, omega: Mapping[str, Real]) -> tuple[Table, Picture]:
    """Natural frequencies by the four beam theories, and differences from the first in per cent."""
    differences = {theory: 100 * (omega[theory] / omega["timoshenko"] - 1) for theory in SIMPLER}
    columns = [Column("mode", "mode", of=range(1, TABLED_MODES + 1))]
    for theory, each in omega.items():
        key = f"{theory.replace('-', '_')}_rad_s"
        columns.append(Column(key, theory_name(theory), "rad/s", of=each, digits=lined(8, 7)))
    for theory, each in differences.items():
        key, title = f"{theory.replace('-', '_')}_difference_percent", f"{theory_name(theory)}, difference"
        columns.append(Column(key, title, "%", of=each, digits=lined(5, 3)))
    worst = differences["euler-bernoulli"]
    caption = prose("theories", least=float(worst.min()), most=float(worst.max()))
    last = ", ".join(f"{theory_name(theory)} {significant(float(v[-1]), 3)} %" for theory, v in differences.items())
    picture = Picture(
        stem="theory-differences",
        title="Errors of the simpler theories",
        caption=prose("differences"),
        alt=f"Differences from the Timoshenko theory by mode; at mode {TABLED_MODES}: {last}.",
        figure=draw_differences(name, dict(reversed(differences.items()))),
    )
    return Table(stem="theories", title="Four beam theories", caption=caption, columns=tuple(columns)), picture


def sensitivity_table(modes: Modes) -> Table:
    """Per cent of frequency per per cent of each parameter: a row a parameter, a column a mode."""
    flexible = modes.index > 0
    rows = {
        name.replace("youngs", "Young's").replace("_", " "): np.round(values[flexible], SHAPE_DIGITS - 1) + 0.0
        for name, values in modes.sensitivity.items()
    }
    shown = {name: values for name, values in rows.items() if abs(values).max() > NEGLECTED}
    columns = [Column("parameter", "parameter", of=list(shown))]
    for number, values in zip(modes.index[flexible], np.array(list(shown.values())).T, strict=True):
        key, digits = f"mode_{number}", partial(fixed, decimals=3)
        columns.append(Column(key, f"mode {number}", "%/%", of=values, digits=digits, tint=list(map(tint, values))))
    caption = prose(
        "sensitivities", is_rig=not modes.arm.is_uniform, dropped=[name for name in rows if name not in shown]
    )
    return Table(
        stem="sensitivities", title="Sensitivity of each natural frequency", caption=caption, columns=tuple(columns)
    )


def tint(x: float) -> str:
    """Orange for a rise, blue for a fall, full at 2 %/%; light enough for dark print."""
    strength = 0.45 * min(1.0, abs(x) / 2.0) ** 0.6
    parts = (round(255 - strength * (255 - part)) for part in (RISE_COLOUR if x > 0 else FALL_COLOUR))
    return "#" + "".join(f"{part:02x}" for part in parts)


class LockedMode(NamedTuple):
    """A mode with the hub free, with the losses of the hub where it has any, and with the hub locked."""

    mode: Annotated[int, Quantity("mode", help="number of the flexible mode")]
    free: Annotated[
        float,
        Quantity(
            "hub free",
            "rad/s",
            8,
            key="hub_free_rad_s",
            help="natural frequency, the hub free to turn and without losses",
        ),
    ]
    free_hz: Annotated[
        float,
        Quantity(
            "hub free", "Hz", 8, key="hub_free_hz", help="natural frequency, the hub free to turn and without losses"
        ),
    ]
    with_losses: Annotated[
        float | None,
        Quantity(
            "with its own losses, Im s", "rad/s", 8, help="frequency of the free hub with its own friction and back-EMF"
        ),
    ]
    damping: Annotated[
        float | None,
        Quantity(
            "damping ratio",
            "%",
            4,
            key="with_losses_damping_percent",
            help="share of critical damping by the losses of the hub alone",
        ),
    ]
    locked: Annotated[
        float, Quantity("hub locked", "rad/s", 8, key="hub_locked_rad_s", help="natural frequency, the hub fixed")
    ]
    locked_hz: Annotated[
        float, Quantity("hub locked", "Hz", 8, key="hub_locked_hz", help="natural frequency, the hub fixed")
    ]


def locked_table(found: Modes) -> Table:
    """A row a mode: hub free, with its losses where it has any, and locked."""
    arm = found.arm
    free = tfarm.modes(arm, LOCKED_MODES, theory=found.theory)
    lossy = None if arm.is_locked else damped_at_hub(arm, LOCKED_MODES)
    losses: list[tuple[float | None, float | None]] = [(None, None)] * LOCKED_MODES
    if lossy is not None and not lossy.left_out and lossy.is_assigned.all():
        flexible = lossy.index > 0
        ratio = 100 * lossy.damping_ratio[flexible]
        losses = list(zip(lossy.eigenvalues[flexible, 0].imag.tolist(), ratio.tolist(), strict=True))
    pairs = zip(_flexible(free).tolist(), losses, _flexible(hub_locked(free)).tolist(), strict=True)
    rows = [
        LockedMode(n, w, w / (2 * math.pi), *loss, held, held / (2 * math.pi))
        for n, (w, loss, held) in enumerate(pairs, 1)
    ]
    return table(
        rows, stem="hub-locked", title="Hub free and hub locked", caption=prose("locked", has_losses=lossy is not None)
    )


def how_proven(modes: Modes, cells: Sequence[str], cells_hz: Sequence[str]) -> str:
    """Whether every digit of these cells [rad/s] and [Hz] is certified: a sentence or two."""
    try:
        proof = modes.certify(BRACKET_DIGITS)
    except CertificationError as error:
        return f"The digits are those of double precision, not proven: {error}."
    rows = np.flatnonzero(modes.index > 0).tolist()
    pairs = [((cells[row], cells_hz[row]), bracket) for row, bracket in zip(rows, proof.brackets, strict=True)]
    is_proven = all(rounds_to(w, bracket) and rounds_to(f, bracket, TWO_PI) for (w, f), bracket in pairs)
    return prose(
        "proven_digits",
        is_proven=is_proven,
        digits=BRACKET_DIGITS,
        proof=proof,
        below=float(proof.below),
        arm=modes.arm,
    )


def rounds_to(cell: str, bracket: tuple[str, str], divisor: Decimal = Decimal(1)) -> bool:
    """Whether every number in the bracket, divided by the divisor, is rounded to the number of the cell."""
    with localcontext(prec=45):
        return all((Decimal(end) / divisor).quantize(Decimal(cell)) == Decimal(cell) for end in bracket)
