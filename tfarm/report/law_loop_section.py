"""The continuous loop on the page of a law: verdict and margins with every crossing, spill-over, Nyquist, poles."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from tfarm.arm import Arm, HubFeedback
from tfarm.columns import Column, Table
from tfarm.digits import how_many, plain, significant
from tfarm.dsp import Chain
from tfarm.errors import ParameterError
from tfarm.loop.answers import CROSSOVERS, POLE_COLUMNS, crossovers
from tfarm.loop.margins import Margins, loop_curve
from tfarm.loop.margins import margins as margins_under
from tfarm.loop.nyquist import nyquist as nyquist_under
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.loop.spill import SPILL, Spill, spill
from tfarm.loop.stability import Stability
from tfarm.plots.disc import draw_nyquist
from tfarm.plots.frequency import draw_loop
from tfarm.report.given_laws import GivenLaw, LawOnArm, continuous_laws, on_arm
from tfarm.report.margins_table import margin_table, verdict_fact, verdict_words, window_table
from tfarm.report.nyquist import RINGS_CAPTION, PlotOfLaw, count_table, curve_data
from tfarm.report.sections import PageSection, Picture
from tfarm.report.words import typeset, upper

MOST_SPILLED = 12  # flexible modes of the largest model that is put beside the exact loop
CROSSINGS_CAPTION = (
    "Every frequency up to the band where |L| = 1, with the phase margin there, above 0 for lag that the loop bears "
    "and below 0 for lead; and every one where L is real and below 0, with the factor on the whole law that puts a "
    "pole there."
)
BODE_CAPTION = (
    "Diamonds: |L| = 1, with the phase margin there, green for lag and purple for lead. Dots: L is real and below 0, "
    "and the dashed line is the way to −1, with the factor on the whole law that goes it."
)
SPILL_CAPTION = (
    "What models of so many flexible modes say of the same law: how many poles are unstable, and the rightmost."
)
NYQUIST_OF_LAW = (
    "Every size of L(iω) from 0 to infinity is in the picture: a size r is drawn as r/(1 + r). The loop is stable "
    "where the curve turns around −1 counter-clockwise as often as L has poles right of the axis{own}."
)
POLES_CAPTION = (
    "Poles with Im s ≥ 0, those below the real axis being their mirror images. All of the box {box} 1/s are here, by "
    "the winding number around it."
)


# ------------------------------------------------------------ verdict and margins


def law_margins_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> PageSection:
    """The verdict on each law, what is known beyond its band, its margins and crossings, and what spills over."""
    named = continuous_laws(on_arm(arm, laws))
    found: list[Margins] = [margins_under(each.arm, each.law) for each in named]
    both = list(zip(named, found, strict=True))
    undamped = arm.is_told_by_lyapunov and all(isinstance(each.law, HubFeedback) for each in named)
    blocks: list[Picture | Table] = [_bode_picture(*each) for each in both]
    if any(it.in_band is not None for it in found):
        blocks.append(margin_table(named, found, undamped))
    blocks += [crossings_table(each, it) for each, it in both if it.in_band is not None]
    gains = [(each, it) for each, it in both if it.windows]
    if gains:
        blocks.append(window_table([each for each, _ in gains], [it for _, it in gains]))
    words: list[str] = []
    for each, it in both:
        spilled = _spilled(each)
        words.append(verdict_words(upper(each.name), it))
        if isinstance(spilled, Spill):
            words.append(f"Spill-over of {each.name}: {typeset(spilled.in_words)}.")
            blocks.append(spill_table(each, spilled))
        else:
            words.append(f"Models of few modes are not put beside {each.name}: {typeset(spilled)}.")
    facts = [verdict_fact(each, it, _far(it.stability)) for each, it in both]
    title = "Is the loop stable, and by how much?"
    return PageSection(anchor="margins", title=title, facts=facts, words=words, blocks=blocks)


def _far(it: Stability) -> str:
    """Said beside a verdict that holds in the band alone."""
    return "" if it.is_known_beyond or it.verdict == "unstable" else ", not known beyond"


def _bode_picture(each: LawOnArm, found: Margins) -> Picture:
    omega, L = loop_curve(found)
    stem = f"{each.key.replace('_', '-')}-bode"
    none = "" if found.in_band is not None else " No margin is marked: the loop is not stable, and has none."
    columns = (
        Column("omega_rad_s", "angular frequency", "rad/s", of=omega),
        Column("re_L", "Re L", of=L.real),
        Column("im_L", "Im L", of=L.imag),
    )
    return Picture(
        stem=stem,
        title=f"The loop function of {each.name}",
        caption=(BODE_CAPTION if found.in_band is not None else "Size and phase of L(iω).") + none,
        alt=f"Bode plot of the loop function of {each.name}, {found.stability.verdict}.",
        figure=draw_loop(found, each.name),
        data=Table(stem=f"{stem}-data", title=f"The loop function of {each.name}", columns=columns),
    )


def crossings_table(each: LawOnArm, found: Margins) -> Table:
    """Every crossing of |L| = 1 and of L < 0 in the band, ascending."""
    assert found.in_band is not None
    rows = sorted(itertools.chain(*crossovers(found.in_band)), key=lambda row: row.omega_rad_s)
    return Table(
        stem=f"{each.key.replace('_', '-')}-crossings",
        title=f"Every crossing of {each.name}",
        caption=CROSSINGS_CAPTION if rows else "Nowhere in the band is |L| = 1, or L real and below 0.",
        columns=CROSSOVERS,
        record=rows,
    )


# ------------------------------------------------------------ spill-over


def _spilled(each: LawOnArm) -> Spill | str:
    """The exact loop beside models of few modes, or why there is no model."""
    try:
        return spill(each.arm, each.any_law, MOST_SPILLED)
    except ParameterError as error:
        return str(error)


def spill_table(each: LawOnArm, found: Spill) -> Table:
    """A row a model, what the exact loop says in the caption."""
    return Table(
        stem=f"{each.key.replace('_', '-')}-spill",
        title=f"Models of few modes under {each.name}",
        caption=f"{SPILL_CAPTION} {upper(typeset(found.in_words))}.",
        columns=SPILL,
        record=found,
    )


# ------------------------------------------------------------ Nyquist


def law_nyquist_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> PageSection:
    """The loop function of each law on a contour that hides nothing, two in a picture, its turns counted."""
    plots = [PlotOfLaw(each, nyquist_under(each.arm, each.law)) for each in continuous_laws(on_arm(arm, laws))]
    turns = {}  # of each law: turns counted, poles of its own, and the unstable poles that follow
    for named, found in plots:
        own = f", {how_many(found.unstable_open, 'unstable pole')} of its own" if found.unstable_open else ""
        poles, around = (
            how_many(found.verdict.unstable_roots, "unstable pole"),
            how_many(abs(found.encirclements), "turn"),
        )
        turns[named.name] = f"{named.name}: {found.verdict.verdict}, {around} around −1{own}, {poles} of the loop."
    blocks: list[Picture | Table] = []
    for first in range(0, len(plots), 2):
        pair = plots[first : first + 2]
        stem = "nyquist" if first == 0 else f"nyquist-{1 + first // 2}"
        blocks.append(Picture(
            stem=stem, title="Nyquist plots of the exact loop function", caption=RINGS_CAPTION,
            alt="; ".join(turns[plot.named.name] for plot in pair),
            figure=draw_nyquist(arm.name, {plot.named.name: plot.data for plot in pair}),
            data=curve_data(pair, f"{stem}-data"),
        ))  # fmt: skip
    own = "" if any(plot.data.unstable_open for plot in plots) else ", which here is never"
    names = [f"{plot.named.name}: {plot.named.gains}" for plot in plots]
    return PageSection(
        anchor="margins-nyquist",
        title="Nyquist: does the loop function turn around −1?",
        words=[*map(upper, turns.values()), NYQUIST_OF_LAW.format(own=own)],
        blocks=[*blocks, count_table(plots, names)],
    )


# ------------------------------------------------------------ poles


def law_poles_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> PageSection:
    """The first closed-loop poles of each law, complete in a box."""
    words, blocks = [], []
    for each in continuous_laws(on_arm(arm, laws)):
        poles = closed_loop_poles(each.arm, each.law)
        moving = poles.moving
        if moving.size:
            furthest = moving[int(np.argmax(moving.real))]
            beside = f" ± {significant(furthest.imag, 6)} i" if furthest.imag else ""
            told = f"furthest right of these lies {significant(furthest.real, 6)}{beside} 1/s"
        else:
            told = "no pole but those at 0 lies in the box"
        words.append(f"{upper(each.name)}: {told}.")
        blocks.append(law_poles_table(each, poles))
    return PageSection(anchor="locus", title="Where are the poles?", words=words, blocks=blocks)


def law_poles_table(each: LawOnArm, poles: Poles) -> Table:
    """Poles with Im s >= 0, with their damping ratio."""
    left, right, _, top = poles.box
    box = f"{plain(left, 5)} < Re s < {plain(right, 5)} and |Im s| < {plain(top, 6)}"
    return Table(
        stem=f"{each.key.replace('_', '-')}-poles",
        title=f"Closed-loop poles under {each.name}",
        caption=POLES_CAPTION.format(box=box),
        columns=POLE_COLUMNS,
        record=poles.values.tolist(),
    )
