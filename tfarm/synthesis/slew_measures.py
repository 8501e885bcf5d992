"""Figures of the slew of a law in the sampled loop: settling time, overshoot, residual moment, largest input."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.case import Case
from tfarm.dsp import Chain, Scenario, traces
from tfarm.dsp.results import simulate_modes
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.shaping import impulses_of
from tfarm.dsp.simulation import final_value, settling_time
from tfarm.records import frozen
from tfarm.spectrum.table import first_frequency

TIP = "tip_displacement"


# records of a slew, in turn until the tip settles: times the first
LENGTHS = (1, 6)
# samples of a longer record: the time of a search
MOST_SAMPLES = 10_000


@frozen
class SlewMeasures:
    """The slew of an arm with references of the arm `known`, four records a sample between.

    By `count` modes, or as many as `simulate_modes` takes for enough.
    """

    arm: Arm
    known: Arm
    chain: Chain
    count: int | None = None

    @cached_property
    def tasks(self) -> list[Scenario]:
        """The slew without its shaper and as long again or four periods of mode 1, then a record for slow loops."""
        rise = self.chain.slew.rise_time
        period = self.chain.sampling.period
        left = max(2 * rise, 4 * 2 * np.pi / first_frequency(self.arm), 64 * period)
        if self.chain.reference.shaper != "none":
            # a shaper of two modes may be as long as a period and a half
            left += 3 * np.pi / first_frequency(self.arm)
        durations = [rise + length * left for length in LENGTHS]
        most = max(durations[0], MOST_SAMPLES * period)
        return [slew_scenario(self.known, self.chain, each) for each in durations if each <= most]

    def of(self, law: AnyLaw) -> dict[str, float]:
        """Return the figures by name of the measure, inf where the run stops or the tip does not settle.

        Those but the settling time are of the first record.
        """
        case = Case(self.arm, law, self.chain)
        found: dict[str, float] = {}
        impulses = impulses_of(self.known, self.chain, law)
        for plain in self.tasks:
            task = plain.through(impulses) if impulses.size > 1 else plain
            run, _ = simulate_modes(case, task, self.count, between=4, outputs=(TIP,))
            if run.stopped is not None:
                names = ("settling_time_s", "overshoot", "residual_moment", "peak_input")
                return dict.fromkeys(names, np.inf) | found
            t, y = traces.continuous(run, TIP)
            final = final_value(run.at_samples.t, run.at_samples.signal(TIP))
            travel = final - float(y[0])
            settled = settling_time(t, abs(y - final), abs(travel), task.busy_until)
            if not found:
                residual = run.residual_moment
                found = {
                    "settling_time_s": np.inf,
                    "overshoot": max(0.0, float((y / final).max()) - 1.0) if travel else 0.0,
                    "residual_moment": np.inf if residual is None else residual,
                    "peak_input": float(abs(run.torque).max()),
                }
            if settled is not None:
                found["settling_time_s"] = settled
                break
        return found
