"""A slew simulated without and with moment feedback, fine enough to be drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm, HubFeedback
from tfarm.digits import plain
from tfarm.dsp.chain import Chain
from tfarm.dsp.curves import resolved
from tfarm.dsp.scenarios import scenario
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import Simulation
from tfarm.records import record

WITHOUT = f"without moment feedback, {MOMENT_GAIN} = 0"
RECORD_LENGTH = 3.0  # times the slew: how long a record is


@dataclass(frozen=True)
@record
class Slews:
    """One slew simulated twice: `without` and `with_moment` feedback, the other gains the same."""

    arm: Arm
    gains: HubFeedback
    without: Simulation
    with_moment: Simulation

    @property
    def each(self) -> Mapping[str, Simulation]:
        """Both, by what they are called; the one without comes first."""
        return {WITHOUT: self.without, f"with, {self.fed_back}": self.with_moment}

    @property
    def held(self) -> str:
        """The gain on the hub rate, which both have."""
        return self.gains.told(RATE_GAIN, plain)

    @property
    def fed_back(self) -> str:
        """The gain on the root moment of the second."""
        return self.gains.told(MOMENT_GAIN, plain)


def slews(arm: Arm, gains: HubFeedback, chain: Chain, modes: int) -> Slews:
    """The slew of the chain, for three times as long as it takes.

    Raises ParameterError for an arm that cannot turn.
    """
    task = scenario("slew", arm, chain, RECORD_LENGTH * chain.slew.rise_time)
    simulator = Simulator(arm, chain, task, count=modes)
    laws = (gains.having(MOMENT_GAIN, 0.0), gains)
    both = resolved(simulator, arm, *(partial(Simulator.linear, gains=law) for law in laws))
    return Slews(arm, gains, *both)
