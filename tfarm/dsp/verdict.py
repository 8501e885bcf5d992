"""Is the sampled loop stable?  With as many modes as it takes for the answer not to change."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from tfarm.arm import Arm, HubFeedback
from tfarm.dsp.chain import Chain
from tfarm.dsp.law import ModeTable, growing_mode, mode_table
from tfarm.dsp.loop import SampledLoop, sampled_loop
from tfarm.dsp.margins import DelayMargin, Window, alive, around, delay_margin, required_damping, stable_windows
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record

UNDAMPED_MODES = 20
FEW, MOST = 4, 128
AGREE, NOISE = 1e-4, 1e-12
FEWER = (0.85, 0.72, 0.61, 0.54)
MOST_ASKED = 400


@dataclass(frozen=True)
@record
class Verdict:
    """Whether a sampled loop is stable, apart from z = 1 of a hub angle that nothing regulates.

    `loop` has the modes that the verdict holds for; `is_settled` says that more of them do not change it, which at C =
    0 can never be said: there it holds for the first `modes_used` modes, and high ones may grow by 1e-9 a sample.
    """

    loop: SampledLoop
    is_settled: bool

    @property
    def modes_used(self) -> int:
        """How many flexible modes the loop has."""
        return self.loop.plant.count

    @property
    def is_stable(self) -> bool:
        """Whether every pole lies inside the unit circle."""
        return self.loop.poles.is_stable

    @property
    def word(self) -> str:
        """stable, marginal or unstable."""
        return self.sentence.split(":")[0]

    @property
    def sentence(self) -> str:
        """The verdict in words, beginning with stable, unstable or marginal."""
        poles = self.loop.poles
        growth, mode = poles.log_spectral_radius, growing_mode(self.loop)
        what = f"mode {mode}" if mode else "the hub"
        held = "" if self.is_settled else f" (holds for the first {self.modes_used} modes)"
        if growth > 0:
            return f"unstable: {what} grows by {_change(growth)} a sample{held}"
        if growth == 0:
            return f"marginal: {what} neither grows nor decays{held}"
        return f"stable: {what} decays most slowly, by {_change(growth)} a sample{held}"


def _change(log_radius: float) -> str:
    """|z| - 1 in size, which for a small ln|z| is ln|z| itself; a factor where it is no small change."""
    return (
        f"{abs(math.expm1(log_radius)):.3g}"
        if log_radius < 1
        else f"a factor of {math.exp(min(log_radius, 700.0)):.3g}"
    )


def sampled_verdict(arm: Arm, gains: HubFeedback, chain: Chain | None = None, *, count: int | None = None) -> Verdict:
    """The verdict, with `count` modes, or as many as it takes (C > 0), or the first 20 (C = 0).

    Raises ParameterError for a locked hub, for I_h = 0 with K2 != 0 (an algebraic loop), and a count outside 1..400.
    """
    chain = Chain() if chain is None else chain
    if count is not None:
        if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MOST_ASKED:
            remedy = f"a whole number of flexible modes from 1 to {MOST_ASKED}"
            raise ParameterError(key="modes", value=count, remedy=remedy)
        return Verdict(sampled_loop(arm, gains, chain, count=count), False)
    if arm.link.damping == 0.0:
        return Verdict(sampled_loop(arm, gains, chain, count=UNDAMPED_MODES), False)
    fewest, *more = _counts(arm, chain)
    loop = sampled_loop(arm, gains, chain, count=fewest)
    for number in more:
        before, loop = loop, _larger(arm, gains, chain, loop.plant.count, number)
        if _agree(before, loop):
            return Verdict(loop, True)
    return Verdict(loop, False)


def _larger(arm: Arm, gains: HubFeedback, chain: Chain, before: int, count: int) -> SampledLoop:
    """The loop with `count` modes, or somewhat fewer (above `before`) where two damped modes cannot be told apart."""
    numbers = [number for number in (count, *(int(share * count) for share in FEWER)) if number > before]
    for number in numbers:
        try:
            return sampled_loop(arm, gains, chain, count=number)
        except ConvergenceError:
            if number == numbers[-1]:
                raise
    raise AssertionError("unreachable")


def _counts(arm: Arm, chain: Chain) -> list[int]:
    """Numbers of modes to try: doubled up to those that outlive a sample and a few, for the others are static then."""
    most = min(MOST, FEW + alive(arm, chain))
    tried = [number for number in (8, 16, 32, 64) if number < most]
    return [*(tried or [most // 2]), most]


def _agree(before: SampledLoop, after: SampledLoop) -> bool:
    old, new = before.poles, after.poles
    close = abs(old.log_spectral_radius - new.log_spectral_radius) <= AGREE * abs(new.log_spectral_radius) + NOISE
    return close and (old.log_radius > 0).sum() == (new.log_radius > 0).sum()


@dataclass(frozen=True)
@record
class Analysis:
    """Everything that is said of a sampled loop at its gains."""

    verdict: Verdict
    K1_windows: list[Window]
    K2_windows: list[Window]
    modes: ModeTable
    delay_margin: DelayMargin
    required_damping: float

    @property
    def first_unstable_mode(self) -> int | None:
        """The lowest mode that grows."""
        grows = self.modes.index[self.modes.log_radius > 0]
        return int(grows[0]) if grows.size else None


def analyse(arm: Arm, gains: HubFeedback, chain: Chain | None = None, *, count: int | None = None) -> Analysis:
    """Verdict, stable intervals of both gains, modes one by one, delay margin, and the damping that makes it safe."""
    chain = Chain() if chain is None else chain
    verdict = sampled_verdict(arm, gains, chain, count=count)
    loop = verdict.loop
    has_moment = arm.hub.inertia > 0
    return Analysis(
        verdict,
        stable_windows(loop, "K1"),
        stable_windows(loop, "K2") if has_moment else [],
        mode_table(loop),
        delay_margin(loop),
        required_damping(arm, gains, chain, count=count or max(verdict.modes_used, UNDAMPED_MODES)),
    )


def sampled_answer(analysis: Analysis) -> dict[str, Any]:
    """The analysis as a dictionary of plain numbers, texts and lists."""
    verdict, gains = analysis.verdict, analysis.verdict.loop.gains
    poles, sampling = verdict.loop.poles, verdict.loop.chain.sampling
    return {
        "arm": verdict.loop.plant.arm.name,
        "law": "u = -Kp theta - K1 theta_t - K2 M; a positive root moment M accelerates the hub",
        "K1": gains.K1,
        "K2": gains.K2,
        "Kp": gains.Kp,
        "period_s": sampling.period,
        "delay_samples": sampling.delay_samples,
        "verdict": verdict.word,
        "verdict_in_words": verdict.sentence,
        "stable": verdict.is_stable,
        "spectral_radius": math.exp(poles.log_spectral_radius),
        "log_spectral_radius": poles.log_spectral_radius,
        "unstable_poles": int((poles.log_radius > 0).sum()),
        "modes_used": verdict.modes_used,
        "settled": verdict.is_settled,
        "K1_interval": _listed(around(analysis.K1_windows, gains.K1)),
        "K2_interval": _listed(around(analysis.K2_windows, gains.K2)),
        "K1_intervals": [list(window) for window in analysis.K1_windows],
        "K2_intervals": [list(window) for window in analysis.K2_windows],
        "first_unstable_mode": analysis.first_unstable_mode,
        "delay_margin_samples": analysis.delay_margin.samples,
        "delay_margin_is_lower_bound": analysis.delay_margin.is_bound,
        "required_damping_s": analysis.required_damping,
        "modes": _rows(analysis.modes),
    }


def _listed(window: Window | None) -> list[float] | None:
    return None if window is None else list(window)


def _rows(table: ModeTable) -> list[dict[str, Any]]:
    return [
        {
            "index": int(table.index[i]),
            "natural_frequency_rad_s": float(table.natural_frequency[i]),
            "band": int(table.band[i]),
            "aliased_rad_s": float(table.aliased[i]),
            "log_radius_per_sample": float(table.log_radius[i]),
            "first_order_log_radius": float(table.first_order[i]),
            "first_order_by_K1": float(table.by_rate[i]),
            "first_order_by_K2": float(table.by_moment[i]),
            "open_loop_log_radius": float(table.by_damping[i]),
        }
        for i in range(table.index.size)
    ]
