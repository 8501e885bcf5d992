"""Stable windows of each gain, the others held: from the crossings along it and one count of unstable poles."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tfarm.arm import GAINS, MOMENT_GAIN, RATE_GAIN
from tfarm.crossing import Crossing, Crossings, Window, counts_over
from tfarm.exact.outputs import OUTPUTS
from tfarm.records import record
from tfarm.spectrum import modes
from tfarm.spectrum.scales import gain_unit, most_gain

from .lines import along, line_crossings, static_crossings
from .lossless import locked_edges, stable_moments
from .plant import HubLoop
from .stability import Stability, loop_band, stability

End = Literal["edge", "search bound", "no limit"]

WINDOW_REACH, FARTHER_REACH = 20.0, {MOMENT_GAIN: 50.0}  # how far windows are looked for, times `gain_unit`
BEYOND_STATIC = 2.0  # times J/(J - I_h), where K2 cancels the inertia: windows are looked for at least so far
BEYOND_LAW = 10.0  # times the gain that there is: at least so far too
STATIC_AT = 1e-9  # of the lowest frequency: L there is that of an arm at rest


@dataclass(frozen=True)
@record
class Windows:
    """Stable windows of one gain, or one number of a law: that around the point (None if it is not stable) and all in
    `looked_at`.

    What an end of a window means says `end`: poles on the axis there ("edge"), an end of `looked_at`, up to which no
    limit was found and beyond which none was looked for ("search bound"), or infinity, which is a theorem ("no limit").
    Crossings are those up to `band` [rad/s], inf where no pole crosses beyond any.
    """

    name: str
    around: Window | None
    all: tuple[Window, ...]
    looked_at: Window
    crossings: Crossings
    band: float = math.inf

    def end(self, value: float) -> End:
        """What an end of one of the windows is."""
        return "no limit" if math.isinf(value) else "search bound" if value in self.looked_at else "edge"


def gain_windows(verdict: Stability, name: str) -> Windows:
    """The windows of the gain of that name through the loop whose verdict is given."""
    loop, law, free = verdict.loop, verdict.loop.law, verdict.loop.freed
    value = law[name]
    if name == "K2" and loop.arm.has_massless_hub:
        return Windows(name, None, (), (0.0, 0.0), Crossings.of([]))  # an algebraic loop but for K2 = 0
    low, high = looked_at(loop, name)
    if _is_lossless_line(loop, name):
        found, told = _undamped(loop, name).within(low, high), name != "K2" and law.K2 == 0
        told = told or free.arm.is_told_by_lyapunov  # every mode, by a theorem
        band = math.inf if told else float(locked_edges(free.arm).at.max())
    else:
        ends = (HubLoop(loop.arm, law.having(name, end)) for end in (low, high))
        band = max(verdict.band, *(loop_band(end)[0] for end in ends))
        found = _as_mirrored(loop, name, line_crossings(loop.arm, along(name, law), band)).within(low, high)
    pairs = list(itertools.pairwise([low, *np.unique(found.gain).tolist(), high]))
    stable = [pair for pair, count in zip(pairs, _counts(verdict, name, pairs, found), strict=True) if count == 0]
    if (
        name == RATE_GAIN and not loop.arm.hub_side_inertia
    ):  # where nothing is lost a pole of such a hub passes infinity
        least = 0.0 - loop.arm.rate_loss
        stable = [(max(start, least), end) for start, end in stable if end > least]
    stable = [_with_proven_ends(loop, name, pair, (low, high)) for pair in stable]
    at_edge = name == "Kp" and value == 0  # there the pole at 0 is, apart from which the verdict is
    inside = (pair for pair in stable if pair[0] < value < pair[1] or (at_edge and pair[0] == 0))
    around = next(inside, None) if verdict.is_stable else None
    return Windows(name, around, tuple(stable), (low, high), found, band)


def _is_lossless_line(loop: HubLoop, name: str) -> bool:
    """Whether theorems without losses tell the loop, whatever value the gain of that name takes."""
    return loop.freed.arm.is_reactive and loop.law.having(name, 1.0).is_at_hub


def _as_mirrored(loop: HubLoop, name: str, found: Crossings) -> Crossings:
    """The crossings along a gain, rounding taken off where without losses D is even in s but for that gain's part.

    Then poles are on the axis where an odd part vanishes with its gain, or by itself; an even part leaves every pole
    its mirror image, and no value of its gain makes the loop stable.
    """
    odd = {gain.name for gain in GAINS if OUTPUTS[gain.output].power % 2}
    if not loop.freed.arm.is_reactive or any(loop.freed.law[other] for other in odd - {name}):
        return found
    at = 0.0 - loop.arm.rate_loss if name == RATE_GAIN else 0.0
    unit = gain_unit(loop.arm, name)
    return Crossings.of(each._replace(t=at) for each in found if name in odd and abs(each.t - at) < unit)


def looked_at(loop: HubLoop, name: str) -> Window:
    """The range of a gain that is searched, symmetric and well beyond what matters to the first mode."""
    arm, law = loop.arm, loop.law
    reach = max(FARTHER_REACH.get(name, WINDOW_REACH) * gain_unit(arm, name), BEYOND_LAW * abs(law[name]))
    carried = arm.gauged_inertia
    if name == "K2" and 0 < carried < math.inf:
        reach = max(reach, BEYOND_STATIC * arm.turned_inertia / carried)
    most = min(most_gain(arm, name), reach)
    return -most, most


def _undamped(loop: HubLoop, name: str) -> Crossings:
    """Without losses: every mode at once at K2 = 1 (or each at its own K2, see `lossless`) and where K1 makes up for
    what the hub loses, 0 or below.

    A real pole passes through 0 where stiffness or inertia vanishes.
    """
    arm, K1, at = loop.freed.arm, loop.freed.law.K1, 0.0 - loop.arm.rate_loss
    found = static_crossings(loop.arm, along(name, loop.law))
    if name == "K2" and arm.is_told_by_lyapunov:
        found.append(Crossing(arm.input_per_torque, math.inf, 1 if K1 > 0 else -1))
    elif name == "K2" and K1:
        found += [each._replace(change=each.change * int(math.copysign(1, K1))) for each in locked_edges(arm)]
    if name == "K1" and not any(each.t == at for each in found):
        found.append(Crossing(at, math.inf, -1 if _is_braked(loop.freed) else 1))
    return Crossings.of(found)


def reach_words(windows: Iterable[Windows]) -> str:
    """A sentence about window ends that are those of a band alone; empty where all are known."""
    bands = [each.band for each in windows if math.isfinite(each.band)]
    if not bands:
        return ""
    return f"window ends are those of poles up to {max(bands):.4g} rad/s: beyond, some may cross inside them"


def _counts(verdict: Stability, name: str, pairs: list[Window], found: Crossings) -> list[int]:
    """Unstable poles in each window: counted in one, by the crossings in the others; at C = 0 whether there are any."""
    loop, value = verdict.loop, verdict.loop.law[name]
    if _is_lossless_line(loop, name):
        laws = [loop.law.having(name, (low + high) / 2) for low, high in pairs]
        return [int(not holds_undamped(HubLoop(loop.arm, law).freed)) for law in laws]
    middles = np.array([(low + high) / 2 for low, high in pairs])
    if verdict.verdict != "marginal" and any(low < value < high for low, high in pairs):
        known = verdict.unstable_roots
    else:
        value = float(middles[middles.size // 2])
        there = stability(loop.arm, loop.law.having(name, value))
        known = 0 if there.is_stable else max(1, there.unstable_roots)
    (counts,) = counts_over(middles, [found], value, np.array([known]))
    return [int(count) for count in counts]


def _is_braked(loop: HubLoop) -> bool:
    """Whether K1 > 0 takes energy from every mode by a theorem: at K2 = 0, or without losses (`lossless`)."""
    if loop.law.K2 == 0 or not loop.arm.is_reactive:
        return loop.law.K2 == 0
    low, high = stable_moments(loop.arm)
    return low < loop.law.K2 < high


def holds_undamped(loop: HubLoop) -> bool:
    """Whether no pole is right of the axis without losses: K1 > 0, K2 < 1 (Lyapunov), and nothing falls statically.

    K2 is between `stable_moments` where the gauge does not read the hub's moment: no pole of the modes looked at then.
    """
    (low, high), law = stable_moments(loop.arm), loop.law
    if not (law.K1 > 0 and low < law.K2 < high):
        return False
    small = np.array([STATIC_AT * float(modes(loop.arm, 1).natural_frequency[-1])], dtype=complex)
    return bool((1 + loop.loop_function(small)[0]).real > 0)


def _with_proven_ends(loop: HubLoop, name: str, pair: Window, limits: Window) -> Window:
    """Ends at the edge of the search replaced by infinity where a theorem says that nothing changes beyond it.

    At C = 0 the Lyapunov argument holds for every K1 > 0, Kp >= 0, K2 < 1; at C > 0 for K2 = 0 (a passive hub).
    Without losses no pole crosses at any K1 > 0 or Kp > 0, whatever the gauge reads (`lossless`).
    """
    low, high = pair
    free, law = loop.freed.arm, loop.freed.law
    if free.input_lags or not law.having(name, 1.0).is_at_hub:
        return low, high  # a voltage reaches the hub late: it is not passive, nor is what is fed back from elsewhere
    if name == "K2":
        is_proven = free.is_told_by_lyapunov and law.K1 > 0 and law.Kp >= 0
        return (-math.inf if is_proven and low == limits[0] else low), high
    is_proven = _is_braked(loop.freed) and (name == "K1" or law.K1 > 0) and (name == "Kp" or law.Kp >= 0)
    return low, (math.inf if is_proven and high == limits[1] else high)
