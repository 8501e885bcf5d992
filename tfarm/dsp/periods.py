"""The same gains at other sample periods: verdict, growth, and how far each gain may go."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from tfarm.arm import PLANE, Arm, HubFeedback
from tfarm.crossing import Window
from tfarm.dsp.chain import Chain
from tfarm.dsp.crossings import stable_windows
from tfarm.dsp.verdict import sampled_verdict

PERIOD_SHARES = (0.1, 0.5, 1.0, 2.0, 5.0)  # of the chain's own period


@dataclass(frozen=True)
class AtPeriod:
    """One sample period [s]: its verdict, and every stable interval of each gain, by name, through `gains`."""

    period: float
    analysis_modes: int
    is_settled: bool
    log_radius: float
    gains: HubFeedback
    windows: Mapping[str, tuple[Window, ...]]


def at_periods(arm: Arm, gains: HubFeedback, chain: Chain) -> tuple[AtPeriod, ...]:
    """The gains from a tenth to five times the chain's own period.  Raises ParameterError for an arm without a loop."""
    rows = []
    for share in PERIOD_SHARES:
        period = float(f"{share * chain.sampling.period:.12g}")  # 1 ms, and no 1.0000000000000002 ms
        verdict = sampled_verdict(arm, gains, replace(chain, sampling=replace(chain.sampling, period=period)))
        windows = {name: tuple(stable_windows(verdict.full, name)) for name in PLANE}
        growth = verdict.log_radius
        rows.append(AtPeriod(period, verdict.modes_used, verdict.is_settled, growth, gains, windows))
    return tuple(rows)
