"""Two loops compared; each is computed by the functions for one, and `schema.compare_records` finds the differences."""

from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import PLANE, AnyLaw, Arm, HubFeedback, must_have_free_hub
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real
from tfarm.case import Case
from tfarm.crossing import Window
from tfarm.dsp import Chain
from tfarm.dsp.stages import admit_case
from tfarm.errors import ConvergenceError, one_line, require
from tfarm.loop.margins import Margins
from tfarm.loop.margins import margins as margins_of
from tfarm.loop.plane import Plane, gain_map
from tfarm.loop.plane_axes import cell_middles, ranges_of
from tfarm.loop.poles import HUB, closed_loop_poles, poles_by_mode
from tfarm.loop.sampled_analysis import Analysis
from tfarm.loop.sampled_brief import SampledBrief, brief_of, sampled_brief
from tfarm.loop.sampled_verdict import SAMPLED_LOOP, sampled_verdict
from tfarm.records import frozen
from tfarm.response.frequency import Bode, bode, resonant_band
from tfarm.schema import Difference, Percent, Quantity, compare_records
from tfarm.spectrum import damped_modes
from tfarm.spectrum import modes as modes_of
from tfarm.spectrum.gains import default_gains


class ArmMode(NamedTuple):
    """A flexible mode of an arm by itself."""

    mode: Annotated[int, Quantity("mode", help="number of the flexible mode, ascending in frequency")]
    frequency: Annotated[
        float, Quantity("natural frequency", "rad/s", help="without damping and without controller")
    ]
    damping_ratio: Annotated[
        Percent | None, Quantity("damping ratio", help="share of critical damping, no controller")
    ]


class PoleOfMode(NamedTuple):
    """An oscillating closed-loop pole, the upper one of its pair, and the mode that it comes from."""

    mode: Annotated[str, Quantity("mode", help="mode whose open-loop pole is nearest; the hub, or none")]
    size: Annotated[float, Quantity("abs(s)", "rad/s", help="natural frequency of the closed-loop pole pair")]
    damping_ratio: Annotated[Percent, Quantity("damping ratio", help="-Re s / |s|, below 0 where it grows")]
    pole: complex


@frozen(kw_only=True)
class ComparedSide:
    """One of the two: its name and case, the modes of the arm, and poles, verdicts and margins of the loop.

    `poles` are closed-loop poles with Im s >= 0, complete in their box; `open_loop` those of the arm with Im s > 0 by
    flexible mode; `sampled` is the verdict at the chain's period; `loop` has verdict and margins, `range_words` the
    frequency range of a continuous-time verdict beyond which nothing is known.  Where one of the laws compared is a law
    in z there is no continuous-time loop on either side: `loop` is the sampled one, with poles s = ln(z)/T.
    """

    name: str
    case: Case
    arm_modes: list[ArmMode]
    poles: Complex
    open_loop: dict[int, complex]
    loop: Margins | Analysis
    sampled: SampledBrief
    range_words: str = ""

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.case.arm

    @property
    def law(self) -> AnyLaw:
        """The law, as gains at the hub where it is no more than these."""
        return self.case.gains or self.case.law

    @property
    def gains(self) -> HubFeedback | None:
        """The law as gains at the hub; None where it is more than these."""
        return self.case.gains

    @property
    def is_sampled(self) -> bool:
        """Whether the loop is that of the samples."""
        return self.loop.verdict.full.period is not None

    @property
    def verdict(self) -> str:
        """Verdict on the continuous-time loop, or on the sampled one where there is no other."""
        return self.loop.verdict.word

    @property
    def oscillating_poles(self) -> Complex:
        """The closed-loop poles with Im s > 0, ascending in Im s."""
        return self.poles[self.poles.imag > 0]

    @cached_property
    def named_poles(self) -> list[PoleOfMode]:
        """The oscillating poles by mode, then those of none, ascending in Im s."""
        found = poles_by_mode(self.oscillating_poles, self.open_loop)
        names = {s: f"mode {mode}" if mode != HUB else "the hub" for mode, s in found.items()}
        for s in self.oscillating_poles.tolist():
            names.setdefault(s, "none")
        return [PoleOfMode(name, abs(s), Percent(-s.real / abs(s) + 0.0), s) for s, name in names.items()]

    @property
    def loop_function(self) -> tuple[Real, Complex]:
        """Frequencies [rad/s] (n,) about every steep place of the loop, and L(i w) there, as far as that is finite.

        L(e^{iwT}), up to half the sample rate, of a sampled loop.
        """
        omega = self.loop.verdict.frequencies
        L = np.asarray(self.loop.verdict.full.loop_function(1j * omega), dtype=np.complex128)
        shown = np.isfinite(L) & (L != 0) & (omega > 0.05 * self.arm_modes[0].frequency)
        return omega[shown], L[shown]

    @property
    def delay_margin(self) -> float | None:
        """The smallest further delay [s] that destabilises the loop, as far as it is known."""
        in_band = self.loop.in_band
        if in_band is None:
            return None
        return self.loop.delay_margin_seconds or in_band.delay


class SideRow(NamedTuple):
    """One side in a line."""

    side: Annotated[str, Quantity()]
    name: Annotated[str, Quantity("name", help="arm, controller, or file of the controller")]
    verdict: Annotated[
        str, Quantity("stability", help="of the continuous-time loop; of a law in z at its samples")
    ]
    reach: Annotated[
        str, Quantity("frequency range", help="range of the verdict where nothing is known beyond it")
    ]
    sampled: Annotated[str, Quantity("sampled loop", help="verdict at the sampling period of the chain")]


class LonePole(NamedTuple):
    """An oscillating closed-loop pole that one side alone has, of a mode or of none."""

    side: Annotated[str, Quantity()]
    name: Annotated[str, Quantity("of", help="side that has this pole")]
    mode: Annotated[str, Quantity("mode", help="mode whose open-loop pole is nearest, or none")]
    pole: Annotated[complex, Quantity("pole", "1/s", 8, "closed-loop pole with Im s > 0")]


@frozen
class Comparison:
    """Two sides, the first the one that differences are from.  `output` is that of the Bode plot of two arms."""

    one: ComparedSide
    other: ComparedSide
    output: str

    @property
    def of(self) -> Annotated[str, Quantity()]:
        """Whether two arms or two laws are compared."""
        return "arms" if self.is_of_arms else "laws"

    @property
    def is_sampled(
        self,
    ) -> Annotated[
        bool,
        Quantity(
            "discrete-time comparison",
            key="at_samples",
            help="where a law is in z: both loops at their samples, s = ln(z)/T",
        ),
    ]:
        """Whether the loops are compared at their samples, one of the laws being a law in z."""
        return self.one.is_sampled

    @property
    def rows(
        self,
    ) -> Annotated[
        list[SideRow],
        Quantity(
            "stability of both loops", first=True, key="sides", help="verdicts of both loops, a row each"
        ),
    ]:
        """A row a side."""
        return [
            SideRow(which, side.name, side.verdict, side.range_words, side.sampled.words)
            for which, side in zip(("first", "second"), self.sides, strict=True)
        ]

    @property
    def mode_differences(
        self,
    ) -> Annotated[
        list[Difference],
        Quantity("modes of the arms", key="modes", help="flexible modes by number; none of one arm"),
    ]:
        """Natural frequencies and damping ratios of both arms, by mode; of one arm none."""
        if self.is_of_arms:
            return compare_records(self.one.arm_modes, self.other.arm_modes, self.names)
        return []

    @property
    def pole_differences(
        self,
    ) -> Annotated[
        list[Difference],
        Quantity(
            "oscillating closed-loop poles", key="poles", help="pole pairs of both loops, by the nearest mode"
        ),
    ]:
        """Those that both sides have, paired by mode."""
        one, other = ([row for row in side.named_poles if row.mode != "none"] for side in self.sides)
        return compare_records(one, other, self.names)

    @property
    def unpaired_poles(
        self,
    ) -> Annotated[
        list[LonePole],
        Quantity(
            "unpaired closed-loop poles",
            help="pole pairs of a mode that the other loop has none of, or of no mode",
        ),
    ]:
        """Oscillating poles of one side alone, or of no mode."""
        first, second = ({row.mode for row in side.named_poles} - {"none"} for side in self.sides)
        paired = first & second
        found = []
        for which, side in zip(("first", "second"), self.sides, strict=True):
            alone = (row for row in side.named_poles if row.mode not in paired)
            found += [LonePole(which, side.name, row.mode, row.pole) for row in alone]
        return found

    @property
    def margin_differences(
        self,
    ) -> Annotated[
        list[Difference],
        Quantity(
            "stability and margins",
            key="margins",
            first=True,
            help="every quantity that both loops have, an interval as text",
        ),
    ]:
        """Every quantity that both loops have."""
        return compare_records(self.one.loop, self.other.loop, self.names)

    @property
    def loops(self) -> Annotated[list[Any], Quantity()]:
        """Both loops with all that is known of them."""
        return [side.loop for side in self.sides]

    @property
    def sides(self) -> tuple[ComparedSide, ComparedSide]:
        """Both sides."""
        return self.one, self.other

    @property
    def names(self) -> tuple[str, str]:
        """The names of both sides."""
        return self.one.name, self.other.name

    @property
    def verdict(self) -> str:
        """Both verdicts, a line each."""
        lines = []
        for side in self.sides:
            continuous = "" if self.is_sampled else f"{side.verdict}, "
            lines.append(f"{side.name}: {continuous}{side.sampled.short}")
        return "\n".join(lines)

    @property
    def is_of_arms(self) -> bool:
        """Whether two arms are compared, not two laws on one."""
        return self.one.arm != self.other.arm

    @cached_property
    def responses(self) -> list[Bode]:
        """The exact response of both arms over one band, which holds ten flexible modes of each."""
        lows, highs = zip(*(resonant_band(side.arm) for side in self.sides), strict=True)
        return [bode(side.arm, self.output, (min(lows), max(highs))) for side in self.sides]

    @cached_property
    def regions(self) -> list[Plane] | None:
        """The plane of both gains for each, on one grid that holds both laws; None where a law is not these gains."""
        laws = [side.gains for side in self.sides if side.gains is not None]
        if len(laws) < 2:
            return None
        axes = []
        # edges upwards are exact
        for n, (name, number) in enumerate(zip(PLANE, (80, 40), strict=True)):
            # the plane reaches that far beyond the controllers' own gains
            own = [1.5 * law[name] for law in laws]
            low, high = zip(*(ranges_of(side.arm)[n] for side in self.sides), strict=True)
            axes.append(cell_middles(min(*low, *own), max(*high, *own), number))
        x, y = axes
        # a column just beyond 0, from which most regions begin
        x = np.union1d(x, [1e-6 * x[-1]])
        return [gain_map(side.arm, x, y, law.Kp) for side, law in zip(self.sides, laws, strict=True)]

    @cached_property
    def reaches(self) -> tuple[Real, list[list[Sequence[Window]]]]:
        """Further delays [s], to two samples or beyond both margins, and the stable factors on each law there."""
        T = self.one.sampled.period
        margins = [each.delay_margin or 0.0 for each in self.sides]
        delay = np.linspace(0.0, min(max(2.0 * T, 1.2 * max(margins)), 10.0 * T), 25)
        return delay, [each.loop.factor_intervals(delay) for each in self.sides]


def compare(
    arms: Arm | Sequence[Arm],
    laws: AnyLaw | Sequence[AnyLaw] | None = None,
    *,
    names: Sequence[str] = (),
    modes: int = 10,
    output: str = "root_moment",
    chain: Chain | None = None,
) -> Comparison:
    """Return two arms under one law, or each under its own, or one arm under two laws.

    Without a law each arm has its default gains.  `names` are those of the two, if not those of their arms or laws;
    the sampled verdicts are those at the period of `chain`, 10 ms unless given.  Where a law is one in z both loops are
    compared at their samples.  Raises ParameterError where there are not two, or where their laws close through
    different inputs, and what `tfarm.margins`, or then `tfarm.sampled`, raises for either.
    """
    # flexible modes of a table that a person reads
    most_compared = 30
    # characters of a name: of two in one legend
    longest_side_name = 60
    cases = _cases(arms, laws, chain)
    modes = whole("modes", modes, 1, most_compared, f"a whole number from 1 to {most_compared}")
    called = [one_line(name, longest_side_name) for name in names or _names(cases)]
    require(len(called) == 2, "names", called, "two names")
    first, second = (case.arm for case in cases)
    for arm in (first, second):
        must_have_free_hub(arm)
    remedy = f"gains of {called[0]} are in another unit, its input being {first.input}: give both one input"
    require(first.input_unit == second.input_unit, "input", second.input, remedy)
    is_sampled = any(case.law.is_discrete for case in cases)
    one, other = (_side(name, case, modes, is_sampled) for name, case in zip(called, cases, strict=True))
    return Comparison(one, other, output)


def _cases(
    arms: Arm | Sequence[Arm], laws: AnyLaw | Sequence[AnyLaw] | None, chain: Chain | None
) -> list[Case]:
    """Return both arms with their laws."""
    given = _as_list(arms)
    some = [] if laws is None else _as_list(laws)
    counts = len(given), len(some)
    is_two = counts[0] > 0 and max(counts) == 2
    require(is_two, "compare", "{} arms, {} laws".format(*counts), "give two arms, or one arm and two laws")
    pair = given * (2 // len(given))
    some = some or [default_gains(arm) for arm in pair]
    each = some * (2 // len(some))
    return [Case(arm, law, chain) for arm, law in zip(pair, each, strict=True)]


def _as_list(given: Any) -> list[Any]:
    """Return one or several as a list."""
    return list(given) if isinstance(given, list | tuple) else [given]


def _names(cases: list[Case]) -> Sequence[str]:
    """Return the arms' names where they differ, else the laws', else their numbers."""
    names = [case.arm.name for case in cases]
    if names[0] == names[1]:
        names = [_law_name(case) for case in cases]
    return ("first", "second") if names[0] == names[1] else names


def _law_name(case: Case) -> str:
    """Return the gains of a law at the hub in words, the name of another one."""
    gains = case.gains
    if gains is None:
        return case.law.name
    return ", ".join(gains.gain_text(n, "{:.4g}".format) for n in PLANE)


def _side(name: str, case: Case, count: int, is_sampled: bool) -> ComparedSide:
    """Return all that is compared of one case; a sampled verdict that is not determined is left open."""
    # poles with Im s >= 0: also real ones, those of the hub, the motor and a controller
    most = count + 6
    case = admit_case(SAMPLED_LOOP, case)
    rows, open_loop = _modes_of_arm(case.arm, count, most)
    range_words = ""
    loop: Margins | Analysis
    if is_sampled:
        loop = Analysis(sampled_verdict(case))
        sampled = brief_of(loop.verdict, case)
        poles, open_loop = _sampled_poles(loop, most)
    else:
        sampled = sampled_brief(case)
        loop = margins_of(case.arm, case.law)
        verdict = loop.stability
        if verdict.word != "unstable" and not verdict.is_known_beyond:
            range_words = f"up to {verdict.band:.4g} rad/s, not determined beyond"
        poles = closed_loop_poles(case.arm, case.law, most).values
    return ComparedSide(
        name=name,
        case=case,
        arm_modes=rows,
        poles=poles,
        open_loop={n: s for n, s in open_loop.items() if n and s.imag > 0},
        loop=loop,
        sampled=sampled,
        range_words=range_words,
    )


def _modes_of_arm(arm: Arm, count: int, most: int) -> tuple[list[ArmMode], dict[int, complex]]:
    """Return the first `count` flexible modes of an arm, and its poles [1/s] by mode, of `most` flexible ones.

    Damping ratios that could not be found, or not for one mode, are None; the poles are then the undamped ones.
    """
    found = modes_of(arm, count)
    more = modes_of(arm, most)
    poles = dict(zip(more.index.tolist(), (1j * more.natural_frequency).tolist(), strict=True))
    ratio = {}
    if arm.is_undamped:
        ratio = dict.fromkeys(poles, Percent(0.0))
    else:
        with suppress(ConvergenceError):
            for damped in map(damped_modes, (found, more)):
                known = damped.is_assigned
                index = damped.index[known].tolist()
                ratio = dict(zip(index, map(Percent, damped.damping_ratio[known]), strict=True)) | ratio
                poles |= dict(zip(index, damped.eigenvalues[known, 0].tolist(), strict=True))
    flexible = zip(found.index.tolist(), found.natural_frequency.tolist(), strict=True)
    return [ArmMode(n, omega, ratio.get(n)) for n, omega in flexible if n > 0], poles


def _sampled_poles(found: Analysis, most: int) -> tuple[Complex, dict[int, complex]]:
    """Return the first poles s = ln(z)/T [1/s] of a sampled loop with Im s >= 0, ascending in Im s.

    They are those of which more than a thousandth is left after a sample; and return those of the rig by itself, by
    flexible mode, 0 for none.
    """
    T = found.loop.chain.sampling.period
    pulse = found.loop.pulse
    z = found.loop.poles.z
    # but for rounding
    z = np.where(abs(z.imag) <= 1e-12, z.real, z)
    s = np.log(z[(abs(z) > 1e-3) & (z.imag >= 0)]) / T
    upper = pulse.poles.imag > 0
    own = np.log(pulse.multipliers[upper]) / T
    own = own.real + 1j * abs(own.imag)
    by_mode = dict(zip(pulse.mode[upper].tolist(), own.tolist(), strict=True))
    return np.asarray(s[np.lexsort((s.real, s.imag))][:most]), by_mode
