"""The signals of a loop, through the analog filters of its chain: a plant for each place on the arm, and one of all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, reduce

from tfarm.arm import Arm
from tfarm.arm.chain import Chain, Sampling
from tfarm.arrays import Real
from tfarm.dsp.plant import Plant, arm_under_chain, is_analog, undelayed_plant, with_filter, with_modes
from tfarm.dsp.pulse import PulseTransfer
from tfarm.records import frozen
from tfarm.response.signals import Signals


@frozen
class SensedPlant:
    """An arm's signals with `count` modes: a plant for each place of signals, and one of all together.

    `read` is of the arm with the actuator's damping; `plants` are not filtered, one for each of `places` [share of the
    length].  Raises ParameterError as `Signals` does, for a locked hub, and for an output that grows with s without
    bound.
    """

    arm: Arm
    read: Signals
    chain: Chain
    plants: tuple[Plant, ...]

    @cached_property
    def together(self) -> Plant:
        """All signals in the order of their names, through their analog filters."""
        whole = self.unfiltered
        corner = self.chain.sampling.antialias_corner
        analog = [n for n, each in enumerate(self.read.outputs) if is_analog(each, self.chain)]
        if math.isinf(corner) or not analog:
            return whole
        return with_filter(whole, analog, corner)

    @property
    def unfiltered(self) -> Plant:
        """All signals in the order of their names, without filters."""
        read = self.read
        whole = reduce(Plant.join, self.plants)
        keys: list[tuple[float, str]] = []
        for place, plant in zip(dict.fromkeys(read.places), self.plants, strict=True):
            keys += [(place, name) for name in plant.outputs]
        wanted = zip(read.places, read.outputs, strict=True)
        at = [keys.index((place, each.name)) for place, each in wanted]
        return replace(whole.rows(at, read.names), arm=self.arm)

    def own_moment(self, sampling: Sampling) -> Real:
        """Return the row of C of the arm's own root moment, one of the signals, ahead of the anti-alias filter."""
        alone = self.unfiltered.rows([self.read.names.index("root_moment")], ("root_moment",))
        pulse = PulseTransfer(self.together.join(alone), sampling).without_fast_poles()
        return pulse.matrices()[2][-1]

    def with_modes(self, count: int) -> SensedPlant:
        """Return the same with another number of modes; cheap where the models have as many."""
        if count > self.plants[0].model.index.max(initial=0):
            return sensed_plant(self.arm, self.chain, self.read.names, count)
        return replace(self, plants=tuple(with_modes(each.model, count) for each in self.plants))


def sensed_plant(arm: Arm, chain: Chain, names: Sequence[str], count: int) -> SensedPlant:
    """Return the signals of these names with `count` flexible modes, of an arm whose hub a chain may damp."""
    read = Signals(arm_under_chain(arm, chain)[0], tuple(names))
    plants = []
    for share in dict.fromkeys(read.places):
        here = zip(read.outputs, read.places, strict=True)
        wanted = list(dict.fromkeys(each.name for each, place in here if place == share))
        along = any(each.place == "x" for each in read.outputs if each.name in wanted)
        plants.append(undelayed_plant(read.arm, wanted, count, share * arm.length if along else None))
    return SensedPlant(arm, read, chain, tuple(plants))
