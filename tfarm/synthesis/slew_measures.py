"""Figures of the slew of a law in the sampled loop: settling time, overshoot, residual moment, largest input."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.case import Case
from tfarm.dsp import Chain, Scenario, traces
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.shaping import impulses_of
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import final_value, settling_time
from tfarm.records import frozen
from tfarm.spectrum.table import first_frequency

TIP = "tip_displacement"


@frozen
class SlewMeasures:
    """The slew of an arm with references of the arm `known`, by `count` modes, four records a sample between."""

    arm: Arm
    known: Arm
    chain: Chain
    count: int

    @cached_property
    def plain(self) -> Scenario:
        """The slew without its shaper, and after it as long again or four periods of the first mode."""
        rise = self.chain.slew.rise_time
        left = max(2 * rise, 4 * 2 * np.pi / first_frequency(self.arm), 64 * self.chain.sampling.period)
        long = self.chain.reference.shaper != "none"
        # a shaper of two modes may be as long as a period and a half
        more = 3 * np.pi / first_frequency(self.arm) * long
        return slew_scenario(self.known, self.chain, rise + left + more)

    def of(self, law: AnyLaw) -> dict[str, float]:
        """Return the figures by name of the measure, inf where the run stops or the tip does not settle."""
        impulses = impulses_of(self.known, self.chain, law)
        task = self.plain.through(impulses) if impulses.size > 1 else self.plain
        run = Simulator(
            Case(self.arm, law, self.chain), task, count=self.count, between=4, outputs=(TIP,)
        ).run()
        names = ("settling_time_s", "overshoot", "residual_moment", "peak_input")
        if run.stopped is not None:
            return dict.fromkeys(names, np.inf)
        t, y = traces.continuous(run, TIP)
        final = final_value(run.at_samples.t, run.at_samples.signal(TIP))
        travel = final - float(y[0])
        settled = settling_time(t, abs(y - final), abs(travel), task.busy_until)
        residual = run.residual_moment
        return {
            "settling_time_s": np.inf if settled is None else settled,
            "overshoot": max(0.0, float((y / final).max()) - 1.0) if travel else 0.0,
            "residual_moment": np.inf if residual is None else residual,
            "peak_input": float(abs(run.torque).max()),
        }
