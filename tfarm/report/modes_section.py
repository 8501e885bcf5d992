"""Modes: undamped, damped and hub-locked frequencies, shapes, the four beam theories, sensitivities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import lru_cache, partial
from typing import Annotated, Any, NamedTuple

import numpy as np

import tfarm
from tfarm.arm import Arm, Theory
from tfarm.arrays import Real
from tfarm.digits import fixed, kept_digits, lined, plain
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.plots.motion import SHAPE_POINTS, draw_differences, scaled, theory_name
from tfarm.plots.motion import modes as shapes_plot
from tfarm.report.cases import Case
from tfarm.report.sections import PageSection, Picture, picture, prose, sheet
from tfarm.schema import Column, Quantity, Table, table
from tfarm.spectrum import DampedModes, Modes, damped_modes, modes
from tfarm.spectrum.damped import damped_at_hub
from tfarm.spectrum.listing import SHAPE_DIGITS, ListedMode, beyond_the_box, listed_modes
from tfarm.spectrum.proofs import Certificate
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


def modes_section(case: Case) -> PageSection:
    """Everything about free vibration: at C = 0, and the eigenvalues at the arm's own C."""
    arm, found = case.arm, tfarm.modes(case.arm, count=TABLED_MODES)
    words, blocks = [prose("complete_modes")], list[Picture | Table]([modal_table(found)])
    if not arm.is_uniform:
        blocks.append(locked_table(found))
        words += [prose("which_is_measured")] * (not arm.is_locked)
    if not arm.is_undamped:
        try:
            blocks += damped_tables(found)
        except (ConvergenceError, CertificationError) as error:
            words.append(prose("no_damped_table", why=error))
    blocks += [_shapes(tfarm.modes(arm, count=DRAWN_MODES)), *theories(arm), sensitivity_table(found)]
    return PageSection(anchor="modes", title="Modes", words=words, blocks=blocks)


def _flexible(modes: Modes) -> Real:
    return modes.natural_frequency[modes.index > 0]


# ------------------------------------------------------------ natural frequencies, and their proof


def modal_table(modes: Modes) -> Table:
    """Frequencies, hub participation, modal moment and nodes."""
    rows = [_rounded(row, modes.arm.length) for row in listed_modes(modes).modes]
    columns = table(rows, MODAL_COLUMNS).columns
    proof = how_proven(modes, columns[1].cells, columns[2].cells)
    return sheet("modal_table", columns, arm=modes.arm, proof=proof)


def _rounded(row: ListedMode, length: float) -> ListedMode:
    """The row with all that depends on a mode's shape to the digits that hold on every processor."""
    participation, moment = kept_digits((row.hub_participation, row.modal_moment + 0.0), SHAPE_DIGITS)
    nodes = np.round(row.nodes, SHAPE_DIGITS - 1 - math.floor(math.log10(length))).tolist()
    return replace(row, hub_participation=participation, modal_moment=moment, nodes=nodes)


@lru_cache(maxsize=8)  # for the arm's page and the page on trust, as the damped ones below
def proven_modes(arm: Arm, count: int) -> Certificate:
    """Brackets of the arm's first natural frequencies.  Raises CertificationError where that cannot be proven."""
    return modes(arm, count).certify(BRACKET_DIGITS)


def how_proven(modes: Modes, cells: Sequence[str], cells_hz: Sequence[str]) -> str:
    """Whether every digit of these cells [rad/s] and [Hz] is certified: a sentence or two."""
    try:
        proof = proven_modes(modes.arm, int(modes.index[-1]))
    except CertificationError as error:
        return f"The digits are those of double precision, not proven: {error}."
    rows = np.flatnonzero(modes.index > 0).tolist()
    is_proven = all(
        rounds_to(cells[row], bracket) and rounds_to(cells_hz[row], bracket, TWO_PI)
        for row, bracket in zip(rows, proof.brackets, strict=True)
    )
    return prose("proven_digits", is_proven=is_proven, digits=BRACKET_DIGITS, proof=proof, arm=modes.arm)


def rounds_to(cell: str, bracket: tuple[str, str], divisor: Decimal = Decimal(1)) -> bool:
    """Whether every number in the bracket, divided by the divisor, is rounded to the number of the cell."""
    with localcontext(prec=45):
        return all((Decimal(end) / divisor).quantize(Decimal(cell)) == Decimal(cell) for end in bracket)


# ------------------------------------------------------------ damped modes, and those of a locked hub


@lru_cache(maxsize=8)
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
    damped, found = proven_damped_modes(arm, int(undamped.index[-1])), listed_modes(undamped)
    every = np.concatenate([damped.eigenvalues, damped.unassigned_pairs])
    inside = np.all(damped.box.holds(every) | np.isnan(every), axis=1)
    number = len(damped.index)
    is_there = Column("complete", "list complete", of=np.where(inside, *BOX_WORDS)[:number])
    return [
        sheet(
            "damped_modes", [*table(found.modes[:number], DAMPED_COLUMNS).columns, is_there], arm=arm, damped=damped,
            note=found.damped_note, is_inside=bool(inside.all()), beyond=beyond_the_box(arm),
            edges=[plain(round(x)) if abs(x) >= 100 else plain(x, 3) for x in damped.box],
        ),
        *([sheet("unassigned_eigenvalues", table(found.unassigned).columns)] if found.unassigned else []),
    ]  # fmt: skip


FREE = "natural frequency, the hub free to turn and without losses"
LOCKED = "natural frequency, the hub fixed"
WITH_LOSSES = "frequency of the free hub with its own friction and back-EMF"
SHARE = "share of critical damping by the losses of the hub alone"


class LockedMode(NamedTuple):
    """A mode with the hub free, with the losses of the hub where it has any, and with the hub locked."""

    mode: Annotated[int, Quantity("mode", help="number of the flexible mode")]
    free: Annotated[float, Quantity("hub free", "rad/s", 8, FREE, "hub_free_rad_s")]
    free_hz: Annotated[float, Quantity("hub free", "Hz", 8, FREE, "hub_free_hz")]
    with_losses: Annotated[float | None, Quantity("with its own losses, Im s", "rad/s", 8, WITH_LOSSES)]
    damping: Annotated[float | None, Quantity("damping ratio", "%", 4, SHARE, "with_losses_damping_percent")]
    locked: Annotated[float, Quantity("hub locked", "rad/s", 8, LOCKED, "hub_locked_rad_s")]
    locked_hz: Annotated[float, Quantity("hub locked", "Hz", 8, LOCKED, "hub_locked_hz")]


def locked_table(found: Modes) -> Table:
    """A row a mode: hub free, with its losses where it has any, and locked."""
    arm, numbers = found.arm, range(1, LOCKED_MODES + 1)
    own = tfarm.modes(arm, LOCKED_MODES, theory=found.theory)
    free, held = _flexible(own), _flexible(hub_locked(own))
    lossy = None if arm.is_locked else damped_at_hub(arm, LOCKED_MODES)
    losses: list[Any] = [[None] * LOCKED_MODES] * 2
    if lossy is not None and not lossy.left_out and lossy.is_assigned.all():
        losses = [each[lossy.index > 0].tolist() for each in (lossy.eigenvalues[:, 0].imag, 100 * lossy.damping_ratio)]
    columns = zip(numbers, free, free / (2 * math.pi), *losses, held, held / (2 * math.pi), strict=True)
    rows = [LockedMode(*row) for row in columns]
    return sheet("hub_locked", table(rows).columns, has_losses=lossy is not None)


# ------------------------------------------------------------ shapes, theories, sensitivities


def _shapes(modes: Modes) -> Picture:
    shapes = scaled(modes, DRAWN_MODES)
    columns = (
        Column("x_m", "x", "m", of=np.linspace(0.0, modes.arm.length, SHAPE_POINTS)),
        *(Column(f"mode_{number}", f"mode {number}", of=np.round(w, SHAPE_DIGITS - 1) + 0.0)
          for number, w in shapes.items()),
    )  # fmt: skip
    nodes = [own for number, own in zip(modes.index, modes.nodes, strict=True) if number in shapes]
    return picture("mode_shapes", shapes_plot.figure(modes), data=columns, nodes=nodes)


def theories(arm: Arm) -> tuple[Table, Picture]:
    """Natural frequencies by the four beam theories, and differences from the first in per cent."""
    names: tuple[Theory, ...] = ("timoshenko", *SIMPLER)
    omega = {theory: _flexible(tfarm.modes(arm, TABLED_MODES, theory=theory)) for theory in names}
    differences = {theory: 100 * (omega[theory] / omega["timoshenko"] - 1) for theory in SIMPLER}
    columns = (
        Column("mode", "mode", of=range(1, TABLED_MODES + 1)),
        *(Column(f"{theory.replace('-', '_')}_rad_s", theory_name(theory), "rad/s", of=each, digits=lined(8, 7))
          for theory, each in omega.items()),
        *(Column(f"{theory.replace('-', '_')}_difference_percent", f"{theory_name(theory)}, difference", "%", of=each,
                 digits=lined(5, 3)) for theory, each in differences.items()),
    )  # fmt: skip
    figure = draw_differences(arm.name, dict(reversed(differences.items())))
    named = {theory_name(theory): each for theory, each in differences.items()}
    return (
        sheet("theories", columns, worst=differences["euler-bernoulli"]),
        picture("theory_differences", figure, differences=named),
    )


def sensitivity_table(modes: Modes) -> Table:
    """Per cent of frequency per per cent of each parameter: a row a parameter, a column a mode."""
    flexible = modes.index > 0
    rows = {
        name.replace("youngs", "Young's").replace("_", " "): np.round(values[flexible], SHAPE_DIGITS - 1) + 0.0
        for name, values in modes.sensitivity.items()
    }
    shown = {name: values for name, values in rows.items() if abs(values).max() > NEGLECTED}
    by_mode = zip(modes.index[flexible], np.array(list(shown.values())).T, strict=True)
    columns = (
        Column("parameter", "parameter", of=list(shown)),
        *(Column(f"mode_{number}", f"mode {number}", "%/%", of=values, digits=partial(fixed, decimals=3),
                 tint=list(map(tint, values))) for number, values in by_mode),
    )  # fmt: skip
    dropped = [name for name in rows if name not in shown]
    return sheet("sensitivities", columns, is_rig=not modes.arm.is_uniform, dropped=dropped)


def tint(x: float) -> str:
    """Orange for a rise, blue for a fall, full at 2 %/%; light enough for dark print."""
    strength = 0.45 * min(1.0, abs(x) / 2.0) ** 0.6
    return "#" + "".join(
        f"{round(255 - strength * (255 - part)):02x}" for part in (RISE_COLOUR if x > 0 else FALL_COLOUR)
    )
