"""Result card: stability, margins and damping of the loop, continuous-time and sampled, each margin with its grade.

The loop is broken at the actuator.  A grade is *good*, *low* or *poor*; the limits are usual ones of the textbooks:

* gain margin 6 dB and 3 dB, phase margin 45 deg and 30 deg: Ogata, Modern Control Engineering, 2010, sec. 7-7, and
  Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems, 2015, sec. 6.4;
* peak sensitivity Ms 2 and 3: Astrom and Murray, Feedback Systems, 2008, sec. 11.5 (1.2 to 2 is usual);
* delay margin one sampling period and half of one: one more sample of computing time keeps a good loop stable.

The loop function of the sampled loop is that of the samples, L(e^{i w T}), up to half the sampling rate.

Without damping of the link any delay destabilises some mode, and the exact delay and disk margins are 0 for every gain.
Such an arm is graded with 0.1 % of critical damping in its first mode; its stability remains that of the arm as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Any, NamedTuple, TypeVar

from tfarm.arm import AnyLaw, Arm
from tfarm.case import Case
from tfarm.digits import general
from tfarm.dsp import Chain
from tfarm.dsp.stages import admit_case, not_covered
from tfarm.errors import ConvergenceError
from tfarm.loop.curve import LoopCurve, LoopVerdict, gain_margin
from tfarm.loop.loop_margins import LoopMargins
from tfarm.loop.margins import Margins, margins
from tfarm.loop.poles import HUB
from tfarm.loop.sampled_analysis import Analysis, sampled
from tfarm.loop.sampled_verdict import SAMPLED_LOOP
from tfarm.records import frozen
from tfarm.schema import Percent, Quantity, Table, Tabled, across, text
from tfarm.schema.html import as_html, with_symbols
from tfarm.spectrum import modes
from tfarm.spectrum.gains import default_gains

_AnyLoop = TypeVar("_AnyLoop")
# names of the graded margins in the grade of the loop
GRADED = {
    "gain_margin": "gain margin",
    "gain_reduction": "gain margin downwards",
    "phase_margin": "phase margin",
    "delay_margin": "delay margin",
    "peak_sensitivity": "Ms",
}
# of good and of low: gain margins [dB], phase margin [deg], delay margin in sampling periods, Ms
GRADE_LIMITS = {"gain": (6.0, 3.0), "phase": (45.0, 30.0), "periods": (1.0, 0.5), "peak": (2.0, 3.0)}


class Graded(NamedTuple):
    """A margin, the frequency [rad/s] that limits it, and its grade."""

    value: Annotated[
        float | None, Quantity(help="size of the margin; inf without a limit, null where not defined")
    ]
    omega: Annotated[float | None, Quantity(key="at_rad_s", help="frequency at which the margin is reached")]
    grade: Annotated[str, Quantity(help="good, low, poor, or - where not defined")]

    def as_text(self, digits: int) -> str:
        """Return value, frequency and grade."""
        if self.value is None:
            return "-"
        size = "no limit" if math.isinf(self.value) else text(self.value, digits)
        place = "" if self.omega is None else f" at {general(self.omega, digits)} rad/s"
        return f"{size}{place}, {self.grade}"


class LeastDamped(NamedTuple):
    """The least damping ratio of the oscillating closed-loop poles, and the mode of that pole."""

    ratio: Annotated[Percent, Quantity(help="-Re s / abs(s); below 0 where the mode grows")]
    mode: Annotated[str, Quantity(help="flexible mode whose pole is nearest; else the hub or the controller")]

    def as_text(self, digits: int) -> str:
        """Return ratio and mode."""
        return f"{self.ratio.as_text(digits)}, {self.mode}"


# card and curve of a page
margins_of = lru_cache(maxsize=64)(margins)
sampled_of = lru_cache(maxsize=16)(sampled)


def loops_by_name(
    period: float, continuous: _AnyLoop | None, sampled: _AnyLoop | None
) -> dict[str, _AnyLoop]:
    """Return the continuous-time loop and the one sampled every `period` [s], without None, as tables name them."""
    both = {"continuous-time": continuous, f"sampled, {1e3 * period:g} ms": sampled}
    return {name: loop for name, loop in both.items() if loop is not None}


@frozen(kw_only=True)
class LoopCard:
    """The numbers of one loop; its margins are not defined unless it is stable."""

    stability: Annotated[str, Quantity("stability", help="stable, marginal or unstable")]
    grade: Annotated[
        str, Quantity("grade", help="worst grade of the margins: good, low, poor, or - without margins")
    ]
    limited_by: Annotated[
        tuple[str, ...], Quantity("limited by", help="margins with that grade, unless it is good")
    ]
    certainty: Annotated[str, Quantity("certainty", help="range of the verdict with its word of certainty")]
    gain_margin: Annotated[
        Graded,
        Quantity(
            "gain margin, upwards",
            "dB",
            4,
            key="gain_margin_db",
            help="increase of the loop gain up to which the loop stays stable",
        ),
    ]
    gain_reduction: Annotated[
        Graded,
        Quantity(
            "gain margin, downwards",
            "dB",
            4,
            key="gain_reduction_db",
            help="reduction of the loop gain down to which the loop stays stable",
        ),
    ]
    phase_margin: Annotated[
        Graded,
        Quantity(
            "phase margin",
            "deg",
            4,
            key="phase_margin_deg",
            help="least over all gain crossovers, of lag or of lead",
        ),
    ]
    delay_margin: Annotated[
        Graded,
        Quantity(
            "delay margin",
            "ms",
            4,
            key="delay_margin_ms",
            help="smallest additional loop delay that destabilises the loop",
        ),
    ]
    delay_margin_periods: Annotated[
        float | None,
        Quantity("delay margin over sampling period", "", 4, help="delay margin in sampling periods"),
    ]
    peak_sensitivity: Annotated[
        Graded,
        Quantity(
            "peak sensitivity Ms",
            "",
            4,
            help="largest abs(1/(1 + L)); its inverse is the distance of L from -1",
        ),
    ]
    disk_margin: Annotated[
        float | None,
        Quantity(
            "disk margin", "", 4, help="gain and phase together: factors (2 + d)/(2 - d), abs(d) < margin"
        ),
    ]
    least_damping: Annotated[
        LeastDamped | None,
        Quantity(
            "least damping ratio",
            "",
            4,
            help="of the oscillating closed-loop poles in the range of the verdict",
        ),
    ]
    time_constant: Annotated[
        float | None,
        Quantity(
            "dominant time constant",
            "s",
            4,
            key="time_constant_s",
            help="of the slowest closed-loop pole of a stable loop; without a free hub angle",
        ),
    ]
    minimum_damping: Annotated[
        float | None,
        Quantity(
            "minimum structural damping for stability",
            "s",
            4,
            help="Kelvin-Voigt damping C of the link from which on the loop is stable",
        ),
    ]

    @property
    def finding(self) -> str:
        """Stability, and of a stable loop the grade with the margins that have it."""
        if self.grade in ("-", "good"):
            return self.stability
        return f"{self.stability}, {self.grade}: {', '.join(self.limited_by)}"


@frozen(kw_only=True)
class ResultCard(Tabled):
    """The card of an arm under a controller: the continuous-time loop, None under a law in z, and the sampled one."""

    continuous: Annotated[LoopCard | None, Quantity(help="continuous-time loop; null under a law in z")]
    sampled: Annotated[LoopCard | None, Quantity(help="sampled loop; null where it is not determined")]
    period: Annotated[float, Quantity(unit="s", help="sampling period")]
    notes: Annotated[
        tuple[str, ...], Quantity(help="conditions of margins and grades, reasons of a missing loop")
    ]

    @property
    def loops(self) -> dict[str, LoopCard]:
        """The loops that are determined, by name."""
        return loops_by_name(self.period, self.continuous, self.sampled)

    @property
    def finding(self) -> str:
        """Stability and grade of each loop."""
        return "; ".join(f"{name} {each.finding}" for name, each in self.loops.items())

    @property
    def table(self) -> Table:
        """A row a quantity, a column a loop."""
        return across(self.loops, title="result")

    def _repr_html_(self) -> str:
        return as_html(self.table) + "".join(f"<p>{with_symbols(note)}</p>" for note in self.notes)


def result_card(
    arm: Arm,
    law: AnyLaw,
    chain: Chain | None = None,
    *,
    continuous: Margins | None = None,
    at_samples: Analysis | None = None,
) -> ResultCard:
    """Return the result card of an arm under a law, sampled by a chain (every 10 ms unless given).

    `continuous` (of `margins`) and `at_samples` (of `sampled`) are what is known of these loops already.  Raises
    ParameterError where there is no loop.
    """
    case = admit_case(SAMPLED_LOOP, Case(arm, law, chain))
    _, undamped = graded_arm(case.arm)
    notes = [undamped] if undamped else []
    if case.gains == default_gains(case.arm):
        advice = "`tfarm design` finds gains that are good"
        if undamped:
            advice = "without damping of the link no design is robust"
        notes.insert(0, f"default gains: scaled from the paper's, not a design; {advice}")
    known = {"continuous": continuous, "sampled": at_samples}
    cards: dict[str, LoopCard | None] = dict.fromkeys(known)
    if case.law.is_discrete:
        del known["continuous"]
    for name in known:
        try:
            cards[name] = loop_card(name, case, known[name])
        except ConvergenceError as error:
            notes.append(f"{name} loop not determined: {error}")
    return ResultCard(**cards, period=case.chain.sampling.period, notes=tuple(notes))


def analysis_of(name: str, case: Case) -> Margins | Analysis:
    """Return the margins of the continuous loop of a case, or the analysis of its sampled one."""
    if name == "sampled":
        return sampled_of(case.arm, case.law, case.chain)
    return margins_of(case.arm, case.law)


def loop_card(name: str, case: Case, known: Margins | Analysis | None = None) -> LoopCard:
    """Return the card of the continuous or the sampled loop, of `known` margins or analysis where these are its own.

    Raises ConvergenceError where the loop is not determined.
    """
    case = admit_case(SAMPLED_LOOP, case)
    is_own = known is not None and known.verdict.full.arm.hub == case.arm.hub
    found = known if known is not None and is_own else analysis_of(name, case)
    damped, _ = graded_arm(case.arm)
    is_graded = damped is case.arm or found.verdict.word == "unstable"
    return card_of(found, case.chain, found if is_graded else analysis_of(name, case.on(damped)))


def reference_damping(arm: Arm, ratio: float = 1e-3) -> float:
    """Return the Kelvin-Voigt damping C [s] with which mode 1 of an undamped arm has a damping ratio.

    With 0.1 % an undamped arm is graded; less is small damping.
    """
    return 2 * ratio / float(modes(arm, 1).natural_frequency[-1])


def graded_arm(arm: Arm) -> tuple[Arm, str]:
    """Return the arm that is graded, with damping of reference where its link has none, and the note of that."""
    if not arm.has_elastic_link:
        return arm, ""
    reference = reference_damping(arm)
    note = (
        f"undamped model: margins and grades are those with C = {reference:.4g} s, 0.1 % of critical damping "
        "in mode 1; at C = 0 the exact delay and disk margins are 0 for every gain"
    )
    return arm.with_numbers(damping=reference), note


def card_of(found: Margins | Analysis, chain: Chain, graded: Margins | Analysis | None = None) -> LoopCard:
    """Return the card of a loop; its delay margin is graded by the sampling period of a chain.

    Margins and poles are those of a loop with more damping, where that is `graded` in its place.
    """
    graded = graded or found
    arm = found.verdict.full.arm
    slowest = graded.verdict.time_constant
    limit = found.damping_limit if arm.least_damping < reference_damping(arm) else None
    return LoopCard(
        **words_of(found.verdict, chain),
        **_margins(graded.in_band, graded.delay_margin_seconds, chain.sampling.period),
        least_damping=_least_damped(graded.verdict.oscillating_poles),
        time_constant=slowest if slowest is not None and slowest > 0 else None,
        minimum_damping=None if limit is None else limit.value,
    )


def words_of(verdict: LoopVerdict, chain: Chain) -> dict[str, Any]:
    """Return stability and certainty of a verdict on the loop of a chain."""
    return {
        "stability": verdict.word,
        "certainty": verdict.range_words + not_covered(verdict.consumer, chain),
    }


def loop_function(arm: Arm, law: AnyLaw, chain: Chain | None = None) -> LoopCurve:
    """Return the loop function L(i w) of an arm under a law, or that of the sampled loop, with its margins.

    Parameters
    ----------
    arm, law
        The arm and the controller.
    chain
        Sampling: the curve is then L(e^{i w T}) up to pi/T, and `continuous` the continuous-time loop, None under a law
        in z.  A law in z has the usual chain where none is given.

    Returns
    -------
    LoopCurve
        L (n,) at frequencies (n,) [rad/s].  An arm without damping is that of the result card, with 0.1 % of critical
        damping in mode 1; its stability is that of the arm as it is.

    Raises
    ------
    ParameterError
        Where there is no loop.
    ConvergenceError
        Where its stability is not determined.
    """
    case = admit_case(SAMPLED_LOOP, Case(arm, law, chain))
    damped, note = graded_arm(case.arm)

    def as_card(name: str) -> LoopCurve:
        word = analysis_of(name, case).verdict.word
        curve = analysis_of(name, case.on(damped)).curve
        found = None if word == "unstable" else curve.margins
        return replace(curve, stability=word, note=note, margins=found)

    found = None if case.law.is_discrete else as_card("continuous")
    if found is not None and chain is None:
        return found
    return replace(as_card("sampled"), continuous=found)


def _least_damped(poles: Iterable[tuple[int, complex]]) -> LeastDamped | None:
    """Return the pole of least damping ratio among some with their modes."""
    ratios = [(Percent(-s.real / abs(s) + 0.0), n) for n, s in poles]
    if not ratios:
        return None
    ratio, n = min(ratios)
    return LeastDamped(ratio, "the hub or the controller" if n == HUB else f"mode {n}")


def _margins(band: LoopMargins | None, delay: float | None, period: float) -> dict[str, Any]:
    """Return the graded margins from those of a stable loop function and its delay margin [s]."""
    if band is None:
        undefined = {"grade": "-", "limited_by": (), "delay_margin_periods": None, "disk_margin": None}
        return dict.fromkeys(GRADED, Graded(None, None, "-")) | undefined
    periods = None
    milliseconds = None
    if delay is not None:
        # also of a lower bound
        number = type(delay)
        periods = number(delay / period)
        milliseconds = number(1e3 * delay)
    down, up = (gain_margin(band, factor) for factor in band.gain)
    phase = abs(band.phase_margin.value)
    peak = band.sensitivity_peak
    graded = {
        "gain_margin": Graded(*up, grade_of(up[0], "gain")),
        "gain_reduction": Graded(*down, grade_of(down[0], "gain")),
        "phase_margin": Graded(phase, band.phase_margin.omega, grade_of(phase, "phase")),
        "delay_margin": Graded(milliseconds, None, grade_of(periods, "periods")),
        "peak_sensitivity": Graded(*peak, grade_of(peak.value, "peak")),
    }
    # "-" of a margin that is not defined
    worst = max((each.grade for each in graded.values()), key=("-", "good", "low", "poor").index)
    return graded | {
        "grade": worst,
        "limited_by": tuple(GRADED[key] for key, each in graded.items() if each.grade == worst != "good"),
        "delay_margin_periods": periods,
        "disk_margin": band.disk,
    }


def grade_of(size: float | None, margin: str) -> str:
    """Return the grade of a margin by its `GRADE_LIMITS`: least values where they descend, else greatest ones."""
    if size is None:
        return "-"
    good, low = GRADE_LIMITS[margin]
    sign = math.copysign(1.0, good - low)
    if sign * size >= sign * good:
        return "good"
    if sign * size >= sign * low:
        return "low"
    return "poor"
