"""Limits of a loop in numbers: the margin with the least reserve, the costs of sampling, and the gains recommended."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tfarm.assessment.card import LoopCard, ResultCard
from tfarm.spectrum import Modes
from tfarm.synthesis.goals import card_values
from tfarm.synthesis.requirements import GOOD, Requirement
from tfarm.synthesis.result import Design


class LimitingMargin(NamedTuple):
    """The margin of a stable loop with the least reserve to its limit of the grade good.

    It is at `omega` [rad/s], if that is known; `mode` is the flexible mode whose `frequency` [rad/s] is nearest, None
    of no mode that is known up to there.
    """

    requirement: Requirement
    value: float
    is_met: bool
    omega: float | None
    mode: int | None
    frequency: float | None


class SamplingCost(NamedTuple):
    """A margin of the continuous-time and of the sampled loop, and the loss by sampling, below 0 where it is a gain."""

    title: str
    unit: str
    continuous: float
    sampled: float
    loss: float


class LoopLimits(NamedTuple):
    """What limits a controller: `limiting` margin of the sampled loop, `costs` of sampling, and gains to take next."""

    card: ResultCard
    limiting: LimitingMargin | None
    costs: tuple[SamplingCost, ...]
    recommended: Design | None
    recommended_card: ResultCard | None

    @property
    def is_good(self) -> bool:
        """Whether every loop of the controller is determined and has the grade good."""
        loops = self.card.loops.values()
        return self.card.sampled is not None and all(each.grade == "good" for each in loops)


def loop_limits(
    card: ResultCard,
    modes: Modes,
    recommended: Design | None = None,
    recommended_card: ResultCard | None = None,
) -> LoopLimits:
    """Return the limits of a controller by its card, the modes of its arm, and the gains recommended in its place."""
    limiting = None if card.sampled is None else limiting_margin(card.sampled, modes)
    return LoopLimits(card, limiting, sampling_costs(card), recommended, recommended_card)


def limiting_margin(card: LoopCard, modes: Modes) -> LimitingMargin | None:
    """Return the margin with the largest violation of the grade good, None of a loop without margins."""
    if card.stability != "stable" or card.grade == "-":
        return None
    values = card_values(card)
    worst = max(GOOD, key=lambda each: each.violation(values[each.name]))
    value = values[worst.name]
    if math.isinf(value):
        return None
    gains = [each for each in (card.gain_margin, card.gain_reduction) if each.value == value]
    places = {"phase_margin_deg": card.phase_margin.omega, "peak_sensitivity": card.peak_sensitivity.omega}
    omega = gains[0].omega if gains else places.get(worst.name)
    mode = None
    frequency = None
    known = modes.flexible
    if omega and known.size and omega < known[-1]:
        nearest = int(abs(np.log(known / omega)).argmin())
        mode = nearest + 1
        frequency = float(known[nearest])
    return LimitingMargin(worst, value, worst.violation(value) <= 0, omega, mode, frequency)


def sampling_costs(card: ResultCard) -> tuple[SamplingCost, ...]:
    """Return the finite margins of both loops, where both are stable."""
    if card.continuous is None or card.sampled is None:
        return ()
    both = [card_values(each) for each in (card.continuous, card.sampled)]
    found = []
    for each in GOOD:
        continuous, sampled = (values[each.name] for values in both)
        if math.isfinite(continuous) and math.isfinite(sampled):
            sign = 1.0 if each.sense == ">=" else -1.0
            loss = sign * (continuous - sampled)
            found.append(SamplingCost(each.measure.title, each.measure.unit, continuous, sampled, loss))
    return tuple(found)
