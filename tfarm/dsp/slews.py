"""A slew simulated without and with moment feedback, fine enough to be drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

from tfarm.arm import Arm, HubFeedback
from tfarm.digits import plain
from tfarm.dsp.chain import Chain
from tfarm.dsp.curves import resolved
from tfarm.dsp.scenarios import scenario
from tfarm.dsp.simulate import Simulation, Simulator
from tfarm.records import record

LASTING = 3.0  # times the slew: how long a record is


@dataclass(frozen=True)
@record
class Slews:
    """One slew simulated twice: `without` (K2 = 0) and `with_moment` feedback, K1 the same."""

    arm: Arm
    gains: HubFeedback
    without: Simulation
    with_moment: Simulation

    @property
    def each(self) -> Mapping[str, Simulation]:
        """Both, by what they are called; the one without comes first."""
        return {"without moment feedback, K2 = 0": self.without, f"with, K2 = {plain(self.gains.K2)}": self.with_moment}


def slews(arm: Arm, gains: HubFeedback, chain: Chain, modes: int) -> Slews:
    """The slew of the chain, for three times as long as it takes.

    Raises ParameterError for an arm that cannot turn.
    """
    task = scenario("slew", arm, chain, LASTING * chain.slew.rise_time)
    simulator = Simulator(arm, chain, task, count=modes)
    without = HubFeedback(K1=gains.K1, K2=0.0)
    both = resolved(simulator, arm, *(partial(Simulator.linear, gains=law) for law in (without, gains)))
    return Slews(arm, gains, *both)
