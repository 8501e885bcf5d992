"""The analog plant before any law: outputs by name, those along the link with their place, through their filters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tfarm.arm import Arm
from tfarm.dsp.chain import Chain
from tfarm.dsp.plant import AT_DAMPED_HUB, Branching, Plant, is_analog, undelayed_plant, with_filter, with_modes
from tfarm.records import record
from tfarm.response.signals import Signals
from tfarm.spectrum.damped import all_damped_modes


@dataclass(frozen=True)
@record
class SensedPlant:
    """An arm's signals with `count` modes: one plant for each place that signals are read at, and all of it together.

    `plants` are not filtered, one for each of `places` [share of the length].  Raises ParameterError as `Signals` does,
    for a locked hub, and for an output that grows with s without bound.
    """

    read: Signals
    chain: Chain
    plants: tuple[Plant, ...]

    @property
    def together(self) -> Plant:
        """All signals in the order of their names, through their analog filters."""
        whole, corner = self.unfiltered, self.chain.sampling.antialias_corner
        analog = [n for n, each in enumerate(self.read.outputs) if is_analog(each, self.chain)]
        return whole if math.isinf(corner) or not analog else with_filter(whole, analog, corner)

    @property
    def unfiltered(self) -> Plant:
        """All signals in the order of their names, as they are."""
        places = list(dict.fromkeys(self.read.places))
        first, rows = self.plants[0], []
        for wanted, place in zip(self.read.outputs, self.read.places, strict=True):
            plant = self.plants[places.index(place)]
            assert np.array_equal(plant.poles, first.poles)  # the poles are the arm's, wherever it is looked at
            rows.append((plant, plant.outputs.index(wanted.name)))
        return replace(
            first,
            outputs=self.read.names,
            residues=np.array([plant.residues[n] for plant, n in rows]),
            rigid=np.array([plant.rigid[n] for plant, n in rows]),
            static=np.array([plant.static[n] for plant, n in rows]),
        )

    def with_modes(self, count: int, branches: Branching = all_damped_modes) -> SensedPlant:
        """The same with another number of modes; no work where the models have as many."""
        if count > self.plants[0].model.index.size:
            return sensed_plant(self.read.arm, self.chain, self.read.names, count, branches)
        damped = self.chain.actuator.hub_damping > 0
        shorter = [
            with_modes(each.model, self.chain, each.model.outputs[: -len(AT_DAMPED_HUB) if damped else None], count)
            for each in self.plants
        ]
        return replace(self, plants=tuple(shorter))


def sensed_plant(
    arm: Arm, chain: Chain, names: Sequence[str], count: int, branches: Branching = all_damped_modes
) -> SensedPlant:
    """The signals of that name with `count` flexible modes."""
    read, plants = Signals(arm, tuple(names)), []
    for share in dict.fromkeys(read.places):
        here = zip(read.outputs, read.places, strict=True)
        wanted = list(dict.fromkeys(each.name for each, place in here if place == share))
        along = any(each.place == "x" for each in read.outputs if each.name in wanted)
        plants.append(undelayed_plant(arm, chain, wanted, count, branches, share * arm.length if along else None))
    return SensedPlant(read, chain, tuple(plants))
