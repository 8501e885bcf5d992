"""Figures of the slew of a law in the sampled loop: settling time, overshoot, residual moment, largest input."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.arrays import Real
from tfarm.assessment.signal_figures import PARTS, LoopRecord, SignalCurve
from tfarm.case import Case
from tfarm.dsp import Chain, Scenario, traces
from tfarm.dsp.results import simulate_modes
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.shaping import impulses_of
from tfarm.dsp.simulation import SETTLING_BAND, Simulation, final_value, settling_time
from tfarm.loop.time_response import TORQUE
from tfarm.records import frozen
from tfarm.schema.quantities import to_dict
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.requirements import MEASURES

TIP = "tip_displacement"


# records of a slew, in turn until the tip settles: times the first
LENGTHS = (1, 6)
# samples of a longer record: the time of a search
MOST_SAMPLES = 10_000
# the figures of `near_settling`, and the widths of their slopes in bands
SLOPES = {"nearer_settling_s": 0.01, "near_settling_s": 0.2}


@frozen
class SlewMeasures:
    """The slew of an arm with references of the arm `known`, four records a sample between.

    By `count` modes, or as many as `simulate_modes` takes for enough; `parts` are those with figures of `tfarm step`.
    """

    arm: Arm
    known: Arm
    chain: Chain
    count: int | None = None
    parts: tuple[str, ...] = PARTS

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

        Those but the settling time, and those of parts, are of the first record.
        """
        names = [*SLOPES, *(name for name, each in MEASURES.items() if each.of_slew)]
        case = Case(self.arm, law, self.chain)
        found: dict[str, float] = {}
        impulses = impulses_of(self.known, self.chain, law)
        for plain in self.tasks:
            task = plain.through(impulses) if impulses.size > 1 else plain
            run, _ = simulate_modes(case, task, self.count, between=4, outputs=(TIP,))
            if run.stopped is not None:
                return dict.fromkeys(names, np.inf) | found
            t, y = traces.continuous(run, TIP)
            final = final_value(run.at_samples.t, run.at_samples.signal(TIP))
            travel = final - float(y[0])
            settled = settling_time(t, abs(y - final), abs(travel), task.busy_until)
            if not found:
                residuals = [
                    np.inf if each is None else each for each in (run.residual_moment, run.residual_raw)
                ]
                found = {
                    "settling_time_s": np.inf,
                    **dict.fromkeys(SLOPES, np.inf),
                    "overshoot": max(0.0, float((y / final).max()) - 1.0) if travel else 0.0,
                    "residual_moment": residuals[0],
                    "residual_raw_moment_rms": residuals[1],
                    "peak_input": float(abs(run.torque).max()),
                }
            if self.parts:
                found |= self._figures(run)
            if settled is not None:
                found["settling_time_s"] = settled
                for name, width in SLOPES.items():
                    found[name] = near_settling(
                        t - task.busy_until, abs(y - final), abs(travel), settled, width
                    )
                break
        return found

    def _figures(self, run: Simulation) -> dict[str, float]:
        """Return the sizes of the figures of `tfarm step` of the parts, inf where one is not defined."""
        names = dict(zip(PARTS, ("hub_angle", TIP, "root_moment", TORQUE), strict=True))
        t, _ = traces.continuous(run, TIP)
        angle = traces.reference_angle(run.scenario, t)
        reference = {"hub_angle": angle, TIP: self.arm.reach * angle}
        record = LoopRecord(
            self.arm, tuple(names.values()), run.scenario.busy_until, t, reference, SETTLING_BAND
        )
        found = {}
        for part in self.parts:
            if part == "torque":
                y = traces.held_at(run, run.torque, t)
            else:
                y = traces.continuous(run, names[part])[1]
            for key, value in to_dict(record.figures(names[part], SignalCurve(t, y, 0 * y))).items():
                if f"{part}.{key}" in MEASURES:
                    found[f"{part}.{key}"] = np.inf if value is None else abs(value)
        return found


def near_settling(t: Real, away: Real, scale: float, settled: float, width: float) -> float:
    """Return the least of t + (settled - t) min(1, v/w) over times `t` (n,) up to that at which a signal settles [s].

    v is by how much the largest deviation from t on is above the band, in bands: a time of settling that jumps where a
    peak leaves the band goes up along a slope of that width w.
    """
    largest = np.maximum.accumulate(away[::-1])[::-1]
    excess = largest / (SETTLING_BAND * (scale or float(away.max()))) - 1
    is_before = (t >= 0) & (t < settled)
    left = settled - t[is_before]
    return settled + float((left * np.minimum(0, excess[is_before] / width - 1)).min(initial=0.0))
