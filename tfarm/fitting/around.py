"""An arm and its neighbours, a step away along each number that is free: for derivatives of whatever is read of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from tfarm.arm import INPUTS, Arm, Input
from tfarm.arrays import Complex
from tfarm.exact.gradients import Direction, response_gradients
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.series import Jet
from tfarm.exact.system import System, system_of
from tfarm.response.signals import Signals

from .parameters import COORDINATE_STEP

NUDGE = 1e-6  # of s: for a slope along it by a difference, which is right to about as much


class Around:
    """An arm and its neighbours a step below and above along each free number, as chains, made once for each drive.

    Where there is no arm on one side, at the tip for what is attached, the arm itself stands in its place.
    """

    def __init__(self, arm: Arm, pairs: Sequence[tuple[Arm, ...]]) -> None:
        self.arm, self._pairs = arm, pairs
        self._chains: dict[str, tuple[System, list[tuple[System, System]]]] = {}

    def gradients(self, driven: str, names: tuple[str, ...], s: Complex) -> tuple[Jet, list[Jet]]:
        """Drive and signals at s, up to one factor, with their derivatives along the free numbers."""
        if driven not in self._chains:
            pairs = [(system_of(under_drive(a, driven)), system_of(under_drive(b, driven))) for a, b in self._pairs]
            self._chains[driven] = system_of(under_drive(self.arm, driven)), pairs
        chain, pairs = self._chains[driven]
        signals, own = Signals(self.arm, names), self.arm
        along = [
            Direction(
                below,
                above,
                Signals(a, names).places,
                Signals(b, names).places,
                COORDINATE_STEP * ((a != own) + (b != own)),
            )
            for (below, above), (a, b) in zip(pairs, self._pairs, strict=True)
        ]
        return response_gradients(chain, signals.outputs, signals.places, along, s)


def drive_behind(arm: Arm, name: str) -> str:
    """What drives an arm where that is the input of a response: the arm's own drive, where it is over a signal."""
    return name if name in INPUTS and name not in OUTPUTS else arm.input


def under_drive(arm: Arm, driven: str) -> Arm:
    return arm if arm.input == driven else replace(arm, input=cast("Input", driven))
