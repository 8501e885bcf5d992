"""The hub-locked frequencies of a rig beside its free ones, with and without what its hub loses."""

from __future__ import annotations

import math

import numpy as np

import tfarm
from tfarm.arm import Arm
from tfarm.columns import Column, Table
from tfarm.digits import lined, significant, singly
from tfarm.spectrum import Modes
from tfarm.spectrum.damped import damped_at_hub
from tfarm.spectrum.table import hub_locked

LOCKED_MODES = 6  # rows, of the modes that are measured on a rig
LOCKED_CAPTION = (
    "Natural frequencies with the hub free to turn and with the hub held still, neither damped{damped}. What is "
    "measured on a rig after a slew lies mostly near the right column."
)
WITH_LOSSES = (
    "; between them those of the free hub with what it loses at its own friction (and back-EMF), and nothing else"
)
WHICH_IS_MEASURED = (
    "Which number is it that you measured? Once a slew is over dry friction holds the hub, and the link rings at the "
    "hub-locked frequencies: first {locked} rad/s ({locked_hz} Hz). The linear rig, whose hub swings along, rings at "
    "{free} rad/s ({free_hz} Hz){damped}. A peak near the former says that the hub stood still, one near the latter "
    "that it moved; fit each to its own column."
)
SWINGS = "; with its hub's own losses at {omega} rad/s, {ratio} % of critical"
CREEPS = "; with its hub's own losses its first mode no longer swings"


def locked_words(arm: Arm) -> list[str]:
    """What the two columns mean for a reader with a measured number; nothing where the hub is locked anyway."""
    if arm.is_locked:
        return []
    free, locked = tfarm.modes(arm, 1), hub_locked(tfarm.modes(arm, 1))
    omega, held = float(free.natural_frequency[-1]), float(locked.natural_frequency[-1])
    numbers = {"free": omega, "free_hz": omega / (2 * math.pi), "locked": held, "locked_hz": held / (2 * math.pi)}
    damped = ""
    lossy = damped_at_hub(arm, 1)  # how the first mode of the free hub rings with its own losses
    if lossy is not None and lossy.is_assigned.all():
        s, ratio = complex(lossy.eigenvalues[-1, 0]), significant(100 * float(lossy.damping_ratio[-1]), 3)
        damped = SWINGS.format(omega=significant(s.imag, 5), ratio=ratio) if s.imag else CREEPS
    return [WHICH_IS_MEASURED.format(damped=damped, **{name: significant(x, 5) for name, x in numbers.items()})]


def locked_table(table: Modes) -> Table:
    """A row a mode: hub free, with its losses where it has any, and locked."""
    arm = table.arm
    free = tfarm.modes(arm, LOCKED_MODES, theory=table.theory)
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
