"""Two loops compared; each is computed by the functions for one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from tfarm.arm import PLANE, AnyLaw, Arm, HubFeedback, Law, arm_and_law, as_law, must_be_arm
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real
from tfarm.crossing import Window
from tfarm.dsp import Chain
from tfarm.dsp.chain import chain_or_usual
from tfarm.dsp.crossings import circle_grid, stable_factors
from tfarm.dsp.verdict import Analysis, SampledBrief, brief_of, sampled_verdict
from tfarm.errors import ConvergenceError, ParameterError, one_line
from tfarm.loop.loop import Loop
from tfarm.loop.margins import Margins, dense
from tfarm.loop.margins import margins as margins_of
from tfarm.loop.plane import Plane, between, gain_map, plane, ranges_of
from tfarm.loop.poles import closed_loop_poles
from tfarm.records import record
from tfarm.response.frequency import Bode, bode, resonant_band
from tfarm.schema import Difference, Quantity
from tfarm.schema import compare as compare_records
from tfarm.spectrum import Modes, damped_modes
from tfarm.spectrum import modes as modes_of
from tfarm.spectrum.table import default_gains

MOST_COMPARED = 30  # flexible modes of a table that is read side by side
LONGEST_SIDE_NAME = 60  # characters of a name: of two in one legend
POLES_BEYOND_MODES = 6  # poles with Im s >= 0 beyond the modes: real ones, those of the hub, the motor and a law
REGION_COLUMNS, REGION_ROWS = 80, 40  # of the plane of both gains; its edges upwards are exact
FIRST_COLUMN = 1e-6  # of the largest rate gain: where the first column beyond 0 is, from which most regions begin
BEYOND_LAWS = 1.5  # how far the plane reaches beyond the laws' own gains
FURTHER_DELAYS = 25  # of which the plane of a factor on each law and its further delay consists
MOST_FACTOR, FACTORS = 4.0, 40  # of a continuous-time law: where that plane ends, and values at which it is counted
LONGEST_WAIT, BORNE = 2.0, 1.2  # samples up to which these go, or times the larger delay margin
MOST_DELAYED = 10.0  # samples at most
CURVE_FROM = 0.05  # of the first mode: where the curve of a loop begins
FARTHEST = 1.0  # |ln s - ln p|: by more a law moves no mode here, a factor e of its frequency or 57 deg of its angle
HUB = 0  # the number of the pole below the first mode that no mode of the link is near
GONE_AFTER_SAMPLE = 1e-3  # |z| of a pole that leaves this much of itself after a sample: of those nothing is compared
REAL_Z = 1e-12  # imaginary part of a real z: rounding


@dataclass(frozen=True)
@record
class Reach:
    """The intervals of a factor on a law in which its loop is stable, at each further delay [s]."""

    delay: Real
    stable_intervals: tuple[tuple[Window, ...], ...]


@dataclass(frozen=True, kw_only=True)
@record
class ComparedSide:
    """One of the two: what it is called, its arm and law, the modes of the arm, and what the loop is worth.

    `damping_ratio` is that of each flexible mode of the arm by itself, None where a mode could not be followed; `poles`
    are closed-loop poles with Im s >= 0, complete in their box; `open_loop` those of the arm with Im s > 0 by flexible
    mode; `sampled` is the verdict at the chain's period.  Where one of the laws compared is a law in z there is no
    continuous-time loop on either side: no `margins`, and `analysis` is of the sampled loop, with poles s = ln(z)/T.
    """

    name: str
    arm: Arm
    law: AnyLaw
    modes: Modes
    damping_ratio: tuple[float | None, ...]
    poles: Complex
    open_loop: dict[int, complex]
    margins: Margins | None
    sampled: SampledBrief
    analysis: Analysis | None = None

    @property
    def gains(self) -> HubFeedback | None:
        """The law as gains at the hub; None where it is more than these."""
        return as_law(self.law).gains

    @property
    def verdict(self) -> str:
        """Of the continuous-time loop, or of the sampled one where there is no other."""
        if self.analysis is not None:
            return self.analysis.verdict.word
        return "undecided" if self.margins is None else self.margins.stability.verdict

    @property
    def oscillating(self) -> Complex:
        """The closed-loop poles with Im s > 0, ascending in Im s."""
        return self.poles[self.poles.imag > 0]

    @cached_property
    def by_mode(self) -> dict[int, complex]:
        """The oscillating pole of each mode, 0 the hub's; those of no mode are left out."""
        return poles_by_mode(self.oscillating, self.open_loop)

    @property
    def loop_function(self) -> tuple[Real, Complex]:
        """Frequencies [rad/s] (n,) about every steep place of the loop, and L(i w) there, as far as that is finite.

        L(e^{iwT}), up to half the sample rate, of a sampled loop.
        """
        if self.analysis is not None:
            loop, grid = self.analysis.loop, circle_grid(self.analysis.loop)
            omega = grid.q / loop.chain.sampling.period
            with np.errstate(all="ignore"):
                L = np.asarray(loop.weights @ grid.terms[1:] / grid.terms[0], dtype=np.complex128)
        else:
            assert self.margins is not None
            omega = dense(self.margins.stability)
            L = np.asarray(self.margins.stability.loop.loop_function(1j * omega), dtype=np.complex128)
        flexible = self.modes.natural_frequency[self.modes.index > 0]
        shown = np.isfinite(L) & (L != 0) & (omega > CURVE_FROM * flexible[0])
        return omega[shown], L[shown]

    @property
    def delay_margin(self) -> float | None:
        """How much later its law may act [s]; of the continuous-time loop as far as that is known."""
        if self.margins is not None:
            in_band = self.margins.in_band
            return None if in_band is None else self.margins.exact_delay or in_band.delay
        assert self.analysis is not None
        return self.analysis.delay_margin_seconds if self.analysis.verdict.is_stable else None

    @property
    def range_words(self) -> str:
        """The frequency range of the continuous-time verdict where nothing is known beyond it."""
        verdict = None if self.margins is None else self.margins.stability
        if verdict is None or verdict.verdict == "unstable" or verdict.is_known_beyond:
            return ""
        return f"up to {verdict.band:.4g} rad/s, not determined beyond"

    @property
    def sampled_margins(self) -> tuple[float | None, float | None, float | None]:
        """Of a sampled loop: the largest and the least stable factor on its law, and its delay margin [s]."""
        assert self.analysis is not None
        low, high = self.analysis.gain_factors or (None, None)
        return high, low, self.delay_margin

    def reach(self, delay: Real) -> Reach:
        """The stable factors on the law with so much further delay each [s]."""
        if self.analysis is None:
            loop, factors = Loop(self.arm, as_law(self.law)), between(0.0, MOST_FACTOR, FACTORS)
            found = plane(loop, ("delay", "gain"), loop.law.delay + delay, factors)
            return Reach(delay, tuple(map(tuple, found.stable_intervals)))
        sampling, late = self.analysis.loop.chain.sampling, self.analysis.loop.with_delay
        now = [late(sampling.delay_samples + more) for more in (delay / sampling.period).tolist()]
        return Reach(delay, tuple(tuple(stable_factors(each)) for each in now))


def poles_by_mode(poles: Complex, open_loop: Mapping[int, complex]) -> dict[int, complex]:
    """The poles s with Im s > 0 by the mode whose open-loop pole p is theirs; a single one below all of these is `HUB`.

    One a mode, by the least sum of |ln s - ln p|; what is farther than `FARTHEST` from its own belongs to no mode.
    """
    modes, own = list(open_loop), np.array(list(open_loop.values()))
    apart = np.minimum(abs(np.log(poles)[:, None] - np.log(own)), FARTHEST)
    rows, columns = linear_sum_assignment(apart)
    near = apart[rows, columns] < FARTHEST
    found = {modes[column]: complex(poles[row]) for row, column in zip(rows[near], columns[near], strict=True)}
    others = np.delete(poles, rows[near])
    below = others[abs(others) < min((abs(s) for s in found.values()), default=0.0)]
    return dict(sorted([*found.items(), *([(HUB, complex(below[0]))] if below.size == 1 else [])]))


class SideRow(NamedTuple):
    """One side in a line."""

    side: Annotated[str, Quantity("side")]
    name: Annotated[str, Quantity("name")]
    verdict: Annotated[str, Quantity("stability")]
    reach: Annotated[str, Quantity("frequency range")]
    sampled: Annotated[str, Quantity("sampled loop")]


class LonePole(NamedTuple):
    """An oscillating closed-loop pole that one side alone has, of a mode or of none."""

    side: Annotated[str, Quantity("side")]
    mode: Annotated[str, Quantity("mode")]
    pole: Annotated[complex, Quantity("pole", "1/s", 8)]


@dataclass(frozen=True)
@record
class Comparison:
    """Two sides, the first the one that differences are from.  `output` is what the Bode plot of two arms shows."""

    one: ComparedSide
    other: ComparedSide
    output: str

    @property
    def rows(self) -> Annotated[list[SideRow], Quantity("compared", key="sides")]:
        """A row a side."""
        return [
            SideRow(which, side.name, side.verdict, side.range_words, side.sampled.words)
            for which, side in zip(("first", "second"), self.sides, strict=True)
        ]

    @property
    def of(self) -> Annotated[str, Quantity()]:
        """Whether two arms or two laws are compared."""
        return "arms" if self.is_of_arms else "laws"

    @property
    def is_sampled(
        self,
    ) -> Annotated[bool, Quantity("loops compared at their samples, s = ln(z)/T", key="at_samples")]:
        """Whether the loops are compared at their samples, one of the laws being a law in z."""
        return self.one.analysis is not None

    @property
    def mode_differences(self) -> Annotated[list[Difference], Quantity("modes", key="modes")]:
        """Natural frequencies and damping ratios of both arms, by mode; of one arm none."""
        if not self.is_of_arms:
            return []
        frequencies = (side.modes.natural_frequency[side.modes.index > 0].tolist() for side in self.sides)
        ratios = (side.damping_ratio for side in self.sides)
        return [
            Difference(f"{what} of mode {n}", unit, *pair)
            for what, unit, both in (("frequency", "rad/s", frequencies), ("damping ratio", "", ratios))
            for n, pair in enumerate(zip(*both, strict=True), 1)
        ]

    @property
    def pole_differences(self) -> Annotated[list[Difference], Quantity("oscillating closed-loop poles", key="poles")]:
        """Those that both sides have, paired by mode."""
        pairs = [(m, self.one.by_mode[m], self.other.by_mode[m]) for m in self.one.by_mode if m in self.other.by_mode]
        sizes = [Difference(f"abs(s) of {_mode(m)}", "rad/s", abs(a), abs(b)) for m, a, b in pairs]
        ratio = [Difference(f"damping ratio of {_mode(m)}", "", _ratio(a), _ratio(b)) for m, a, b in pairs]
        return [*sizes, *ratio]

    @property
    def unpaired_poles(self) -> Annotated[list[LonePole], Quantity("poles of one side alone")]:
        """The other oscillating poles."""
        rows = [
            (which, next((n for n, s in side.by_mode.items() if s == pole), None), pole, other)
            for which, side, other in (("first", self.one, self.other), ("second", self.other, self.one))
            for pole in side.oscillating.tolist()
        ]
        return [
            LonePole(which, "none" if mode is None else _mode(mode), pole)
            for which, mode, pole, other in rows if mode not in other.by_mode
        ]  # fmt: skip

    @property
    def margin_differences(self) -> Annotated[list[Difference], Quantity("stability and margins", key="margins")]:
        """Every quantity that both loops have."""
        if self.one.margins is not None and self.other.margins is not None:
            return compare_records(self.one.margins, self.other.margins)
        names = (("largest stable factor on the law", ""), ("least stable factor", ""), ("delay margin", "s"))
        both = zip(names, self.one.sampled_margins, self.other.sampled_margins, strict=True)
        return [Difference(label, unit, one, other) for (label, unit), one, other in both]

    @property
    def loops(self) -> Annotated[list[Any], Quantity()]:
        """Both loops with all that is known of them."""
        return [side.analysis or side.margins for side in self.sides]

    @property
    def sides(self) -> tuple[ComparedSide, ComparedSide]:
        """Both."""
        return self.one, self.other

    @property
    def verdict(self) -> str:
        """Both verdicts in a line."""
        each = ("" if self.is_sampled else f"{side.verdict}, " for side in self.sides)
        return "; ".join(f"{s.name}: {verdict}{s.sampled.short}" for s, verdict in zip(self.sides, each, strict=True))

    @property
    def is_of_arms(self) -> bool:
        """Whether two arms are compared, not two laws on one."""
        return self.one.arm != self.other.arm

    @cached_property
    def responses(self) -> tuple[Bode, Bode]:
        """The exact response of both arms over one band, which holds ten flexible modes of each."""
        bands = [resonant_band(side.arm) for side in self.sides]
        band = min(low for low, _ in bands), max(high for _, high in bands)
        first, second = (bode(side.arm, self.output, band) for side in self.sides)
        return first, second

    @cached_property
    def regions(self) -> tuple[Plane, Plane] | None:
        """The plane of both gains for each, on one grid that holds both laws; None where a law is not these gains."""
        laws = [side.gains for side in self.sides if side.gains is not None]
        if len(laws) < 2:
            return None
        ranges = [ranges_of(side.arm) for side in self.sides]
        x, y = (
            between(
                min([pair[n][0] for pair in ranges] + [BEYOND_LAWS * law[name] for law in laws]),
                max([pair[n][1] for pair in ranges] + [BEYOND_LAWS * law[name] for law in laws]),
                number,
            )
            for n, (name, number) in enumerate(zip(PLANE, (REGION_COLUMNS, REGION_ROWS), strict=True))
        )
        x = np.union1d(x, [FIRST_COLUMN * x[-1]])
        first, second = (gain_map(side.arm, x, y, law.Kp) for side, law in zip(self.sides, laws, strict=True))
        return first, second

    @cached_property
    def reaches(self) -> tuple[Reach, Reach]:
        """Of each loop the factors on its law that keep it stable, over further delays."""
        T = self.one.sampled.sampling.period
        borne = [each.delay_margin for each in self.sides]
        longest = max([LONGEST_WAIT * T, *(BORNE * each for each in borne if each is not None)])
        delay = np.linspace(0.0, min(longest, MOST_DELAYED * T), FURTHER_DELAYS)
        return self.one.reach(delay), self.other.reach(delay)


def _mode(mode: int) -> str:
    return f"mode {mode}" if mode else "the hub"


def _ratio(s: complex) -> float:
    return -s.real / abs(s) + 0.0


def compare(
    arms: Arm | Sequence[Arm], laws: AnyLaw | Sequence[AnyLaw] | None = None, *, names: Sequence[str] = (),
    modes: int = 10, output: str = "root_moment", chain: Chain | None = None,
) -> Comparison:  # fmt: skip
    """Two arms under one law, or each under its own, or one arm under two laws.

    Without a law each arm has its default gains.  `names` are what the two are called, if not by their arms or laws;
    the sampled verdicts are those at the period of `chain`, 10 ms unless given.  Where a law is one in z both loops are
    compared at their samples.  Raises ParameterError where there are not two, or where their laws close through
    different inputs, and what `tfarm.margins`, or then `tfarm.sampled`, raises for either.
    """
    pairs = _pairs(arms, laws)
    modes = whole("modes", modes, 1, MOST_COMPARED, f"a whole number from 1 to {MOST_COMPARED}")
    called = tuple(one_line(name, LONGEST_SIDE_NAME) for name in names) or _names(pairs)
    if len(called) != 2:
        raise ParameterError(key="names", value=list(called), remedy="two names")
    (first, _), (second, _) = pairs
    if first.input_unit != second.input_unit:
        remedy = f"gains of {called[0]} are in another unit, its input being {first.input}: give both one input"
        raise ParameterError(key="input", value=second.input, remedy=remedy)
    is_sampled, chain = any(as_law(law).is_discrete for _, law in pairs), chain_or_usual(chain)
    one, other = (_side(name, *pair, modes, chain, is_sampled) for name, pair in zip(called, pairs, strict=True))
    return Comparison(one, other, output)


def _pairs(arms: Arm | Sequence[Arm], laws: AnyLaw | Sequence[AnyLaw] | None) -> list[tuple[Arm, AnyLaw]]:
    """Both arms with their laws."""
    given: list[Any] = list(arms) if isinstance(arms, list | tuple) else [arms]
    for arm in given:
        must_be_arm(arm)
    some: list[Any] = [] if laws is None else list(laws) if isinstance(laws, list | tuple) else [laws]
    if not (1 <= len(given) <= 2 and len(some) <= 2 and max(len(given), len(some)) == 2):
        counts = f"{len(given)} arms, {len(some)} laws"
        raise ParameterError(key="compare", value=counts, remedy="give two arms, or one arm and two laws")
    pair = given if len(given) == 2 else given * 2
    each = [default_gains(arm) for arm in pair] if not some else some if len(some) == 2 else some * 2
    return [arm_and_law(arm, law) for arm, law in zip(pair, each, strict=True)]


def _names(pairs: list[tuple[Arm, AnyLaw]]) -> tuple[str, ...]:
    """The arms' names where they differ, else the laws', else their numbers."""
    arms = [one_line(arm.name, LONGEST_SIDE_NAME) for arm, _ in pairs]
    laws = [one_line(_called(as_law(law)), LONGEST_SIDE_NAME) for _, law in pairs]
    return tuple(next((names for names in (arms, laws) if names[0] != names[1]), ["first", "second"]))


def _called(law: Law) -> str:
    gains = law.gains
    return law.name if gains is None else ", ".join(gains.gain_text(name, "{:.4g}".format) for name in PLANE)


def _side(name: str, arm: Arm, law: AnyLaw, count: int, chain: Chain, is_sampled: bool) -> ComparedSide:
    """All that is compared of one arm under its law; a verdict or a damping that cannot be settled is left open."""
    most = count + POLES_BEYOND_MODES
    found, more = modes_of(arm, count), modes_of(arm, most)
    open_loop = dict(zip(more.index.tolist(), (1j * more.natural_frequency).tolist(), strict=True))
    ratio: dict[int, float] = {}
    with suppress(ConvergenceError):
        for damped in map(damped_modes, [] if arm.is_undamped else [found, more]):
            known, ratios = damped.is_assigned, damped.damping_ratio
            ratio = dict(zip(damped.index[known].tolist(), ratios[known].tolist(), strict=True)) | ratio
            open_loop |= dict(zip(damped.index[known].tolist(), damped.eigenvalues[known, 0].tolist(), strict=True))
    analysis, margins = None, None
    try:
        verdict = sampled_verdict(arm, as_law(law) if is_sampled else law, chain)
        sampled = brief_of(verdict, law, chain)
        analysis = Analysis(verdict) if is_sampled else None
    except ConvergenceError as error:
        if is_sampled:
            raise
        sampled = brief_of(error, law, chain)
    if analysis is None:
        margins, poles = margins_of(arm, law), closed_loop_poles(arm, law, most).values
    else:
        poles, open_loop = _sampled_poles(analysis)
    return ComparedSide(
        name=name,
        arm=arm,
        law=law,
        modes=found,
        damping_ratio=tuple(0.0 if arm.is_undamped else ratio.get(n) for n in range(1, count + 1)),
        poles=poles[:most] if is_sampled else poles,
        open_loop={n: s for n, s in open_loop.items() if n and s.imag > 0},
        margins=margins,
        sampled=sampled,
        analysis=analysis,
    )


def _sampled_poles(found: Analysis) -> tuple[Complex, dict[int, complex]]:
    """The poles s = ln(z)/T [1/s] of a sampled loop with Im s >= 0, ascending in Im s, of all that outlives a sample.

    And those of the rig by itself with Im z > 0, by flexible mode.
    """
    T, pulse, z = found.loop.chain.sampling.period, found.loop.pulse, found.loop.poles.z
    z = np.where(abs(z.imag) <= REAL_Z, z.real, z)
    s = np.log(z[(abs(z) > GONE_AFTER_SAMPLE) & (z.imag >= 0)]) / T
    upper = np.nonzero((pulse.mode > 0) & (pulse.poles.imag > 0))[0]
    own = np.log(pulse.multipliers[upper]) / T
    by_mode = zip(pulse.mode[upper].tolist(), (own.real + 1j * abs(own.imag)).tolist(), strict=True)
    return np.asarray(s[np.lexsort((s.real, s.imag))]), dict(by_mode)
