"""The sampled loop on the page of a law: verdict, further delay, the slew in time, and a run measured on the rig."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tfarm.arm import Arm, HubFeedback, written_unit
from tfarm.columns import Column, Table
from tfarm.digits import how_many, plain, scientific, significant, singly
from tfarm.dsp import Chain, Simulation, Verdict, sampled_verdict
from tfarm.dsp.chain import MOST_DELAY
from tfarm.dsp.edges import DelayMargin
from tfarm.dsp.results import drawn, residual_moment_rms
from tfarm.dsp.traces import RECORD_LENGTH
from tfarm.dsp.verdict import SAMPLED_NUMBER_COLUMNS, SampledNumber, sampled
from tfarm.errors import ParameterError
from tfarm.plots.motion import draw_responses
from tfarm.plots.style import safe
from tfarm.records import record
from tfarm.report.given_laws import GivenLaw, LawOnArm, on_arm
from tfarm.report.law_measured import measured_blocks
from tfarm.report.sampled_words import in_ms, spans
from tfarm.report.sections import Fact, PageSection, Picture
from tfarm.report.time_responses import clipped_words, resolution_words, responses_table
from tfarm.report.words import residual_words, typeset, upper

SMALL_GROWTH = 0.05  # a sample: growth up to which damping is first order
MORE_DELAY = (0.5, 1.0)  # samples of further delay that the verdict is asked for again
LATER_CAPTION = (
    "The exact loop with so much more delay between reading and acting. |z| is the largest of its poles{apart}; below "
    "1 the loop is stable. {held}"
)
NUMBERS_CAPTION = (
    "The gain of each part of a law alone, as it is sampled; a name that ends in “gain” is a factor on that part. "
    "At an edge a pole of the sampled loop is on the unit circle ({modes})."
)
APART_FROM_FREE = ", that at z = 1 of a hub that nothing holds apart"


@dataclass(frozen=True)
@record
class LawAtClock:
    """What is said of a law at a clock: its verdict, in words where it is stable, and what further delay it bears.

    `margin` is None where nothing is proven: up to where it is right that would be of the first modes alone.
    `numbers` are those of a law other than gains at the hub, each with its stable windows.
    """

    each: LawOnArm
    verdict: Verdict
    stable_for: str
    margin: DelayMargin | None
    numbers: Sequence[SampledNumber] = ()


@dataclass(frozen=True)
@record
class Later:
    """The verdict on a law with so much more delay [samples]."""

    name: str
    more: float
    verdict: Verdict


def law_sampled_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> PageSection:
    """Does each law hold at the chain's clock, how much later may it act, and what does it do in time?

    In time: runs that were measured under every law with the exact loop over them, else the slew.
    """
    named = on_arm(arm, laws)
    found = [held_by(each, chain) for each in named]
    rows = [row for each in found for row in verdicts_later(each, chain)]
    blocks: list[Picture | Table] = [delays_table(rows, chain), *numbers_tables(found)]
    words = [*(_answer(each) + cured(each, chain) for each in found), chain_told(arm, chain)]
    if any(each.measured is not None for each in named):
        blocks += measured_blocks(named, chain)
    if arm.has_rigid_mode and any(each.measured is None for each in named):
        slew, said = _slew(arm, chain, named)
        blocks += slew
        words += said
    facts = [
        Fact(
            label=f"{it.each.name}: {it.each.gains}",
            value=it.verdict.word.upper(),
            beside=typeset(f"|z| = {plain(math.exp(it.verdict.log_radius), 10)}, {it.verdict.holds_for}"),
        )
        for it in found
    ]
    title = f"The sampled loop: does it hold at {in_ms(chain)} ms?"
    return PageSection(anchor="sampled", title=title, facts=facts, words=words, blocks=blocks)


def held_by(each: LawOnArm, chain: Chain) -> LawAtClock:
    """The verdict on a law, and the room that it leaves."""
    analysis = sampled(each.arm, each.law, chain)
    margin = analysis.delay_margin if analysis.verdict.is_settled else None
    if isinstance(each.law, HubFeedback):
        told = [
            f"{name} {spans(windows, each.law[name], analysis.interval(name))}{written_unit(name, each.arm)}"
            for name, windows in analysis.windows.items()
        ]
        words = f"Stable, the others held: {'; '.join(told)}."
        return LawAtClock(each, analysis.verdict, words, margin)
    factors = [f"{plain(low, 5)} to {plain(high, 5)}" for low, high in analysis.factors]
    words = f"Stable with the whole law times {' and '.join(factors)}." if factors else "No factor on it is stable."
    return LawAtClock(each, analysis.verdict, words, margin, analysis.numbers)


# ------------------------------------------------------------ verdict


def chain_told(arm: Arm, chain: Chain) -> str:
    """What stands between the law and the rig, every part that is not ideal."""
    sampling, converters, actuator = chain.sampling, chain.converters, chain.actuator
    told = [f"sampled every {in_ms(chain)} ms"]
    told += [f"{how_many(sampling.delay_samples, 'sample')} late"] * bool(sampling.delay_samples)
    if not math.isinf(sampling.antialias_corner):
        told.append(f"through an anti-alias filter at {plain(sampling.antialias_corner)} rad/s")
    told += [f"an encoder of {converters.encoder_counts} counts a turn"] * (converters.encoder_counts is not None)
    told += ["the hub rate differenced from it"] * (converters.hub_rate == "difference")
    told += [f"a moment read with {converters.moment_bits} bits"] * (converters.moment_bits is not None)
    if not math.isinf(actuator.torque_limit):
        told.append(f"an input of at most {plain(actuator.torque_limit)} {arm.input_unit}")
    told += [f"hub damping of {plain(actuator.hub_damping)} N m s/rad"] * bool(actuator.hub_damping)
    steps = " Verdicts are of the linear loop; steps and limits act in the simulations." * (not chain.is_linear)
    return f"The chain: {', '.join(told)}.{steps}"


def _answer(found: LawAtClock) -> str:
    """The verdict, the room for the gain and for delay."""
    bound, verdict = found.margin, found.verdict
    told = f"{upper(found.each.name)}: {typeset(verdict.sentence)}. {found.stable_for}"
    if not verdict.is_stable or bound is None:
        return told
    ms = 1e3 * verdict.loop.chain.sampling.period * bound.samples
    return f"{told} It bears {'more than ' if bound.is_bound else ''}{significant(ms, 4)} ms of further delay."


def cured(found: LawAtClock, chain: Chain) -> str:
    """What a little Kelvin-Voigt damping makes of an arm without any: twice what balances the growth to first order.

    A mode at w that grows by g a sample of T is balanced by C = 2 g/(T w^2).  Empty where that is no answer.
    """
    verdict, arm = found.verdict, found.each.arm
    poles, plant = verdict.loop.poles, verdict.loop.plant
    worst = int(np.argmax(poles.log_radius))
    mode, growth = int(poles.mode[worst]), float(poles.log_radius[worst])
    if not arm.has_elastic_link or mode == 0 or not 0 < growth < SMALL_GROWTH:
        return ""
    w = float(abs(plant.poles[plant.mode == mode]).max())
    C = float(f"{2 * 2 * growth / (chain.sampling.period * w * w):.1g}")
    damped = sampled_verdict(arm.having(damping=C), found.each.law, chain)
    ratio = significant(100 * C * w / 2, 2)
    return (
        f" Real arms have some damping: with C = {plain(C)} s, {ratio} % of critical in mode {mode}, it is "
        f"{typeset(damped.sentence)}."
    )


def verdicts_later(found: LawAtClock, chain: Chain) -> list[Later]:
    """The verdict on a law as it is, and with half a sample and a whole one of further delay."""
    each = found.each
    rows = [Later(each.name, 0.0, found.verdict)]
    for more in MORE_DELAY:
        delay = chain.sampling.delay_samples + more
        if delay + each.any_law.delay / chain.sampling.period > MOST_DELAY:
            continue
        late = replace(chain, sampling=replace(chain.sampling, delay_samples=delay))
        rows.append(Later(each.name, more, sampled_verdict(each.arm, each.law, late)))
    return rows


def delays_table(rows: Sequence[Later], chain: Chain) -> Table:
    """A row a law and delay: verdict, largest |z|, what has it, and how far that is known."""
    T = chain.sampling.period
    free = any(getattr(row.verdict.loop, "has_free_angle", False) for row in rows)
    held = dict.fromkeys(f"{row.verdict.holds_for[0].upper()}{row.verdict.holds_for[1:]}." for row in rows)
    return Table(
        stem="sampled-delays",
        title="With more delay",
        caption=LATER_CAPTION.format(apart=APART_FROM_FREE * free, held=typeset(" ".join(held))),
        columns=(
            Column("law", "law", of=[row.name for row in rows]),
            Column("further_delay_ms", "further delay", "ms", of=[1e3 * T * row.more for row in rows],
                   digits=singly(plain)),
            Column("verdict", "verdict", of=[row.verdict.word for row in rows]),
            Column("spectral_radius", "largest |z|", of=[math.exp(row.verdict.log_radius) for row in rows],
                   digits=singly(plain, 10)),
            Column("log_spectral_radius", "ln|z| a sample", of=[row.verdict.log_radius for row in rows],
                   digits=singly(scientific, 4)),
            Column("slowest", "decides", of=[row.verdict.slowest for row in rows]),
            Column("modes_used", "modes", of=[row.verdict.modes_used for row in rows]),
        ),
    )  # fmt: skip


def numbers_tables(found: Sequence[LawAtClock]) -> list[Table]:
    """A row a number of a law, with the windows in which the sampled loop is stable; none of gains at the hub."""
    told = [(it, number) for it in found for number in it.numbers]
    if not told:
        return []
    modes = ", ".join(dict.fromkeys(f"{it.each.name} with {it.verdict.modes_used} flexible modes" for it, _ in told))
    return [
        Table(
            stem="sampled-numbers",
            title="How far each number of a law may go",
            caption=NUMBERS_CAPTION.format(modes=modes),
            record=[number for _, number in told],
            columns=(Column("law", "law", of=[it.each.name for it, _ in told]), *SAMPLED_NUMBER_COLUMNS),
            keys=2,
        )
    ]


# ------------------------------------------------------------ in time


def _slew(arm: Arm, chain: Chain, named: Sequence[LawOnArm]) -> tuple[list[Picture | Table], list[str]]:
    """The slew of the chain under each law, and why one is not there."""
    runs: dict[str, Simulation] = {}
    words, slew = [], chain.slew
    for each in named:
        try:
            runs[each.name] = drawn(each.arm, each.law, chain, "slew", RECORD_LENGTH * slew.rise_time)
        except ParameterError as error:
            words.append(f"No slew of {each.name} is simulated: {typeset(str(error))}.")
    if not runs:
        return [], words
    driven = next(each.arm for each in named if each.name in runs)
    if any(each.arm.input_unit != driven.input_unit for each in named):
        return [], [*words, "The laws drive inputs of different units: their slews are not drawn together."]
    what = f"{plain(slew.travel_of(arm.reach), 3)} m of tip travel in {plain(slew.rise_time, 3)} s"
    shown = {safe(name): run for name, run in runs.items()}
    caption = " ".join(_slewed(each, runs[each.name]) for each in named if each.name in runs)
    keys = {each.key: runs[each.name] for each in named if each.name in runs}
    picture = Picture(
        stem="sampled-slew",
        title="The slew",
        caption=(
            f"{caption}{clipped_words(runs)}{resolution_words(runs.values())} A bang-bang slew with the rigid arm's "
            "feedforward; the dotted line is its end; the tip is shown against a rigid arm's on its reference."
        ),
        alt=f"Root moment, tip and motor in a slew of {what}.",
        figure=draw_responses(driven, shown, what),
        data=responses_table("sampled-slew-data", "The slew in time", driven, keys),
    )
    return [picture], words


def _slewed(each: LawOnArm, run: Simulation) -> str:
    """What a law leaves of the moment, and where the hub ends."""
    if run.stopped is not None:
        return f"{upper(each.name)}: runs away until the arm is folded up, at {significant(run.stopped.time, 3)} s."
    law = each.any_law
    led = [*law.references, *(name.partition(":")[2] for name in law.wanted)]
    end = math.degrees(run.at_samples.hub_angle[-1] - run.scenario.hub_angle[-1])
    what = f"led by {', '.join(dict.fromkeys(led))}" if led else "led by nothing but the feedforward"
    return (
        f"{upper(each.name)}, {what}: {residual_words(residual_moment_rms(run))} left after the slew, the hub "
        f"{plain(end, 3)} deg off at the end."
    )
