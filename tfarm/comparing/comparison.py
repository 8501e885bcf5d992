"""What is computed of two loops to set them beside each other; each by the very functions that answer for it alone."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tfarm.arm import PLANE, AnyLaw, Arm, HubFeedback, Law, arm_and_law, as_law, must_be_arm
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real
from tfarm.dsp import Chain
from tfarm.dsp.chain import chain_or_usual
from tfarm.dsp.verdict import SampledBrief, brief_of, sampled_verdict
from tfarm.errors import ConvergenceError, ParameterError, one_line
from tfarm.loop.loop import Loop
from tfarm.loop.margins import Margins, dense
from tfarm.loop.margins import margins as margins_of
from tfarm.loop.plane import Plane, between, gain_map, plane, ranges_of
from tfarm.loop.poles import closed_loop_poles
from tfarm.records import record
from tfarm.response.frequency import Bode, bode, resonant_band
from tfarm.spectrum import Modes, damped_modes
from tfarm.spectrum import modes as modes_of
from tfarm.spectrum.table import default_gains

from .clocked import Clocked, Reach, clocked
from .pairing import poles_by_mode

MOST_COMPARED = 30  # flexible modes of a table that is read side by side
LONGEST_SIDE_NAME = 60  # characters of a name: of two in one legend
POLES_BEYOND_MODES = 6  # poles with Im s >= 0 beyond the modes: real ones, those of the hub, the motor and a law
REGION_COLUMNS, REGION_ROWS = 80, 40  # of the plane of both gains; its edges upwards are exact
FIRST_COLUMN = 1e-6  # of the largest rate gain: where the first column beyond 0 is, from which most regions begin
BEYOND_LAWS = 1.5  # how far the plane reaches beyond the laws' own gains
DELAY_PLANE_POINTS = 40  # values along each axis of the plane of a factor and a delay
MOST_FACTOR, DELAY_SHOWN = 4.0, 0.02  # where that plane ends: factor on the law, delay [s] where no law has more
FURTHER_DELAYS = 25  # further delays of which the plane of a loop at its samples consists
LONGEST_WAIT, BORNE = 2.0, 1.2  # samples up to which these go, or this much beyond what either loop bears
MOST_DELAYED = 10.0  # samples at most
CURVE_FROM = 0.05  # of the first mode: where the curve of a loop begins


@dataclass(frozen=True, kw_only=True)
@record
class ComparedSide:
    """One of the two: what it is called, its arm and law, the modes of the arm, and what the loop is worth.

    `damping_ratio` is that of each flexible mode of the arm by itself, None where a mode could not be followed; `poles`
    are closed-loop poles with Im s >= 0, complete in their box; `open_loop` those of the arm with Im s > 0 by flexible
    mode; `sampled` is the verdict at the chain's clock.  Where one of the laws compared is a law in z there is no loop
    without a clock on either side: no `margins`, and `clocked` is the loop at its samples, with poles as s = ln(z)/T.
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
    clocked: Clocked | None = None

    @property
    def verdict(self) -> str:
        """Of the loop without a clock, or of that at its samples where there is no other."""
        if self.margins is None:
            return "undecided" if self.clocked is None else self.clocked.analysis.verdict.word
        return self.margins.stability.verdict

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

        L(e^{iwT}), up to half the sample rate, where the loop is one at its samples.
        """
        if self.margins is None:
            assert self.clocked is not None
            omega, L = self.clocked.loop_function
        else:
            omega = dense(self.margins.stability)
            L = np.asarray(self.margins.stability.loop.loop_function(1j * omega), dtype=np.complex128)
        flexible = self.modes.natural_frequency[self.modes.index > 0]
        told = np.isfinite(L) & (L != 0) & (omega > CURVE_FROM * flexible[0])
        return omega[told], L[told]


@dataclass(frozen=True)
@record
class Comparison:
    """Two sides, the first the one that differences are from.  `output` is what the Bode plot of two arms shows."""

    one: ComparedSide
    other: ComparedSide
    output: str

    @property
    def sides(self) -> tuple[ComparedSide, ComparedSide]:
        """Both."""
        return self.one, self.other

    @property
    def verdict(self) -> str:
        """Both verdicts in a line."""
        if self.is_clocked:
            return "; ".join(f"{side.name}: {side.sampled.short}" for side in self.sides)
        return "; ".join(f"{side.name}: {side.verdict}, {side.sampled.short}" for side in self.sides)

    @property
    def is_clocked(self) -> bool:
        """Whether the loops are compared at their samples, one of the laws being a law in z."""
        return self.one.clocked is not None

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
        laws = [side.law for side in self.sides if isinstance(side.law, HubFeedback)]
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
        """Of each loop at its samples the factors on its law that keep it stable, over further delays."""
        each = [side.clocked for side in self.sides]
        assert each[0] is not None
        assert each[1] is not None
        borne = [found.analysis.delay_margin.samples for found in each if found is not None]
        samples = np.linspace(0.0, min(max(LONGEST_WAIT, BORNE * max(borne)), MOST_DELAYED), FURTHER_DELAYS)
        return each[0].reach(samples), each[1].reach(samples)

    @cached_property
    def delays(self) -> tuple[Plane, Plane]:
        """The plane of a factor on each law and its whole delay [s]: for laws that are more than gains at the hub."""
        laws = [as_law(side.law) for side in self.sides]
        longest = max(DELAY_SHOWN, *(2 * law.delay for law in laws))
        x, y = between(0.0, MOST_FACTOR, DELAY_PLANE_POINTS), between(0.0, longest, DELAY_PLANE_POINTS)
        first, second = (
            plane(Loop(side.arm, law), ("gain", "delay"), x, y) for side, law in zip(self.sides, laws, strict=True)
        )
        return first, second


def compare(
    arms: Arm | Sequence[Arm], laws: AnyLaw | Sequence[AnyLaw] | None = None, *, names: Sequence[str] = (),
    modes: int = 10, output: str = "root_moment", chain: Chain | None = None,
) -> Comparison:  # fmt: skip
    """Two arms under one law, or each under its own, or one arm under two laws.

    Without a law each arm has its default gains.  `names` are what the two are called, if not by their arms or laws;
    the sampled verdicts are those at the clock of `chain`, 10 ms unless given.  Where a law is one in z both loops are
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
    is_clocked = any(isinstance(law, Law) and law.is_discrete for _, law in pairs)
    one, other = (
        _side(name, arm, law, modes, chain_or_usual(chain), is_clocked)
        for name, (arm, law) in zip(called, pairs, strict=True)
    )
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
    laws = [
        one_line(law.name, LONGEST_SIDE_NAME)
        if isinstance(law, Law)
        else ", ".join(law.told(name, "{:.4g}".format) for name in PLANE)
        for _, law in pairs
    ]
    return tuple(next((names for names in (arms, laws) if names[0] != names[1]), ["first", "second"]))


def _side(name: str, arm: Arm, law: AnyLaw, count: int, chain: Chain, is_clocked: bool) -> ComparedSide:
    """All that is compared of one arm under its law; a verdict or a damping that cannot be settled is left open."""
    found, more = modes_of(arm, count), modes_of(arm, count + POLES_BEYOND_MODES)
    open_loop = dict(zip(more.index.tolist(), (1j * more.natural_frequency).tolist(), strict=True))
    ratio = dict.fromkeys(range(1, count + 1), 0.0 if arm.is_undamped else None)
    if not arm.is_undamped:
        with suppress(ConvergenceError):
            damped = damped_modes(found)
            known = damped.is_assigned
            ratio |= dict(zip(damped.index[known].tolist(), damped.damping_ratio[known].tolist(), strict=True))
            damped = damped_modes(more)
            known = damped.is_assigned
            open_loop |= dict(zip(damped.index[known].tolist(), damped.eigenvalues[known, 0].tolist(), strict=True))
    try:
        sampled = brief_of(sampled_verdict(arm, law, chain), chain)
    except ConvergenceError as error:
        sampled = SampledBrief(sampling=chain.sampling, is_stable=None, log_radius=None, sentence=f"undecided: {error}")
    at, most = clocked(arm, law, chain) if is_clocked else None, count + POLES_BEYOND_MODES
    open_loop = open_loop if at is None else at.open_loop
    return ComparedSide(
        name=name,
        arm=arm,
        law=law,
        modes=found,
        damping_ratio=tuple(ratio[n] for n in range(1, count + 1)),
        poles=closed_loop_poles(arm, law, most).values if at is None else at.poles[:most],
        open_loop={n: s for n, s in open_loop.items() if n and s.imag > 0},
        margins=margins_of(arm, law) if at is None else None,
        sampled=sampled,
        clocked=at,
    )
