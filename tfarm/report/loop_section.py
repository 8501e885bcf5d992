"""The continuous loop on an arm's page: verdict and margins, Nyquist plot, poles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tfarm.arm import Arm
from tfarm.columns import Column, Table
from tfarm.digits import how_many, plain, significant
from tfarm.dsp import Chain
from tfarm.errors import TfarmError
from tfarm.loop.margins import Margins, loop_curve
from tfarm.loop.nyquist import Nyquist, nyquist_of
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.loop.spill import Spill, spill
from tfarm.loop.theorem import lyapunov, signs_of_loop
from tfarm.plots.frequency import draw_loop, draw_nyquist
from tfarm.report.cases import GivenLaw, LawOnArm, brief_on, continuous_cases, margins_of, why_no_loop
from tfarm.report.sections import Fact, PageSection, Picture, typeset, upper
from tfarm.schema import across, curve_table, quantities, roots_table, table

MARGINS_CAPTION = (
    "Exact: of the infinite-dimensional loop; not known where nothing bounds L beyond the band. "
    "In the band: as far as the poles were computed{undamped}. Gain margin: "
    "factors on the whole law between which the loop stays stable. Phase margin: where |L| = 1, the angle from −1 "
    "to L of least size, above 0 for lag that the loop bears and below 0 for lead; lag and lead: the least of each. "
    "Delay: what may be lost at the worst frequency. Disk margin: gain and phase may be off together by "
    "(2 + αδ)/(2 − αδ), |δ| < 1."
)
DELAY_UNDAMPED = (
    "; without damping (C = 0) any delay, however short, destabilises some mode far enough up, so the exact delay and "
    "disk margins are 0, and only a band gives them a size"
)
CAPTION_OF_WINDOWS = (
    "Each gain or coefficient alone, the others fixed. Ends ±∞ are exact; an end with < or > is that of the search "
    "range: no limit was found up to there."
)
COUNT_CAPTION = (
    "{open}, so each clockwise turn around −1 (counted negative) is one unstable "
    "closed-loop pole. The count in a box was made without Nyquist, by finding every pole; poles whose real part is "
    "less than 10⁻¹² of their size are not told apart from the axis there (undecided), though their turns around −1 "
    "are counted."
)
NO_OPEN, OWN_OPEN = "L has no pole right of the contour", "Beside the poles that a law itself has right of the contour"
RINGS_CAPTION = "Rings: sizes of L; −1 lies on the ring 1. Broad: ω > 0, arrows as ω rises; thin: its mirror image."
NYQUIST_WORDS = (
    "Every size r of L(iω) is drawn as r/(1 + r): nothing is cut off, infinity is the outer rim. The loop is stable "
    "where the curve encircles −1 counter-clockwise as often as L has poles right of the axis{own}. Poles of L on the "
    "imaginary axis are passed on their right: there the curve turns clockwise through half a circle at infinity (a "
    "quarter at a single pole at s = 0), drawn dashed beyond the rim, one arc for all that turn alike, with its number."
)
MOST_SPILLED = 12  # flexible modes of the largest model that is put beside the exact loop
CROSSINGS_CAPTION = (
    "Every frequency up to the band where |L| = 1, with the phase margin there, above 0 for lag that the loop bears "
    "and below 0 for lead; and every one where L is real and below 0, with the factor on the whole law that puts a "
    "pole there."
)
BODE_CAPTION = (
    "Diamonds: |L| = 1, green for lag and purple for lead; dashed lines below them are phase margins. Dots: L is real "
    "and below 0; dashed lines from them are gain margins. The legend has the least of each."
)
SPILL_CAPTION = (
    "What models of so many flexible modes say of the same law: how many poles are unstable, and the rightmost."
)
POLES_CAPTION = (
    "Poles with Im s ≥ 0, those below the real axis being their mirror images. All of the box {box} 1/s are here, by "
    "the winding number around it."
)


def verdict_fact(named: LawOnArm, found: Margins, more: str) -> Fact:
    """The verdict, large, how many poles are unstable up to where, and what more is to be said beside it."""
    it = found.stability
    number = how_many(it.unstable_roots, "unstable pole")
    count = "infinitely many unstable poles" if it.unstable_roots_infinite else number
    beside = f"{count}, up to {significant(it.band, 5)} rad/s{more}"
    return Fact(label=f"{named.name}: {named.gains}", value=it.verdict.upper(), beside=beside)


def verdict_words(name: str, found: Margins) -> str:
    """The verdict on the law of that name, what is known beyond the band, and what Lyapunov or the law's sign adds."""
    it, loop = found.stability, found.stability.loop
    free = it.poles.moving.size < it.poles.values.size
    apart = ", apart from the pole at 0 of the free hub angle" if free else ""
    if loop.gains is None:
        signs = signs_of_loop(loop)
        kind = f"it is {signs.kind}" if signs.kind else "no theorem on its sign helps"
        theorem = f"Beside that, {kind}: {typeset(signs.reason)}."
        theorem += "".join(f" Warning: {typeset(text)}." for text in loop.warnings)
    else:
        proof = lyapunov(loop.arm, loop.gains)
        theorem = f"Lyapunov: {'proven' if proof.proven else 'no proof'}, {typeset(proof.reason)}."
    poles = f"{how_many(it.unstable_roots, 'unstable pole')} up to {significant(it.band, 5)} rad/s"
    return f"{name}: {it.verdict.upper()}, with {poles}{apart}; {typeset(it.tail)}. {theorem}"


def margin_table(laws: Sequence[LawOnArm], found: Sequence[Margins], is_undamped: bool) -> Table:
    """A row a quantity, a column a law."""
    leads = ""
    for named, each in zip(laws, found, strict=True):
        if each.in_band is not None and each.in_band.phase < 0:
            leads += f" {upper(named.name)}: a phase margin below 0 is lead; not an instability."
    caption = MARGINS_CAPTION.format(undamped=DELAY_UNDAMPED if is_undamped else "") + leads
    names = [f"{named.name}: {named.gains}" for named in laws]
    of = dict(zip(names, found, strict=True))
    return across(of, keys=[each.key for each in laws], stem="margins", title="Verdict and margins", caption=caption)


def window_tables(laws: Sequence[LawOnArm], found: Sequence[Margins]) -> list[Table]:
    """Of each law a row a gain or number."""
    return [
        table(
            each.stability_intervals, stem=f"{law.key.replace('_', '-')}-windows",
            title=f"Stability intervals of {law.name}",
            caption=f"{CAPTION_OF_WINDOWS} {upper(typeset(each.intervals_note or ''))}".strip(),
        )
        for law, each in zip(laws, found, strict=True) if each.windows
    ]  # fmt: skip


def count_table(names: Sequence[str], plots: Sequence[Nyquist]) -> Table:
    """Encirclements and unstable poles of each law."""
    caption = COUNT_CAPTION.format(open=NO_OPEN if not any(plot.unstable_open for plot in plots) else OWN_OPEN)
    of = dict(zip(names, plots, strict=True))
    return across(of, stem="nyquist-count", title="Encirclements and unstable poles", caption=caption)


def no_loop_section(arm: Arm) -> PageSection:
    """One sentence for an arm that has no loop."""
    return PageSection(anchor="no-loop", title="The loop", words=(why_no_loop(arm),))


# ------------------------------------------------------------ the map


# ------------------------------------------------------------ margins


def margins_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw] = ()) -> PageSection:
    """Verdict, margins, crossings and spillover of each case, with the verdict on its sampled loop."""
    cases = continuous_cases(arm, chain, laws)
    found = [margins_of(each.arm, each.law) for each in cases]
    both = list(zip(cases, found, strict=True))
    undamped = arm.has_lyapunov_theorem and all(it.stability.loop.gains is not None for it in found)
    blocks: list[Picture | Table] = [_bode_picture(*each) for each in both]
    if any(it.in_band is not None for it in found):
        blocks.append(margin_table(cases, found, undamped))
    blocks += [each_table for each, it in both for each_table in crossings_tables(each, it)]
    blocks += window_tables(cases, found)
    facts, words = [], []
    for each, it in both:
        far = "" if it.stability.is_known_beyond or it.stability.verdict == "unstable" else ", not known beyond"
        facts.append(verdict_fact(each, it, f"{far}; {brief_on(each.arm, each.law, chain).short}"))
        words.append(verdict_words(f"{upper(each.name)}, {each.gains}", it))
        try:
            spilled = spill(each.arm, each.law, MOST_SPILLED)
        except TfarmError as error:
            words.append(f"Spillover of {each.name} is not determined: {typeset(str(error))}.")
            continue
        words.append(f"Spillover of {each.name}: {typeset(spilled.in_words)}.")
        blocks.append(spill_table(each, spilled))
    title = "Stability and stability margins"
    return PageSection(anchor="margins", title=title, facts=facts, words=words, blocks=blocks)


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


def crossings_tables(each: LawOnArm, found: Margins) -> list[Table]:
    """Every crossing of |L| = 1 and of L < 0 in the range, ascending."""
    stem, kinds = each.key.replace("_", "-"), {"gain": found.gain_crossovers, "phase": found.phase_crossovers}
    return [
        table(rows, stem=f"{stem}-{kind}-crossovers", title=f"{upper(kind)} crossovers of {each.name}",
              caption=CROSSINGS_CAPTION)
        for kind, rows in kinds.items() if rows
    ]  # fmt: skip


def spill_table(each: LawOnArm, found: Spill) -> Table:
    """A row a model, the finding in the caption."""
    return table(
        found.models,
        stem=f"{each.key.replace('_', '-')}-spill",
        title=f"Models of few modes under {each.name}",
        caption=f"{SPILL_CAPTION} {upper(typeset(found.in_words))}.",
    )


# ------------------------------------------------------------ Nyquist


def nyquist_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw] = ()) -> PageSection:
    """The loop function of each case on a contour that hides nothing, two in a picture, its encirclements counted."""
    cases = continuous_cases(arm, chain, laws)
    plots = [(each, nyquist_of(margins_of(each.arm, each.law).stability)) for each in cases]
    counts = {}  # of each case: encirclements, poles of its own, and the unstable poles that follow
    for named, found in plots:
        own = f", {how_many(found.unstable_open, 'unstable pole')} of its own" if found.unstable_open else ""
        poles = how_many(found.verdict.unstable_roots, "unstable pole")
        turns = how_many(abs(found.encirclements), "encirclement")
        counts[named.name] = f"{named.name}: {found.verdict.verdict}, {turns} of −1{own}, {poles} of the loop."
    blocks: list[Picture | Table] = []
    for first in range(0, len(plots), 2):
        pair = plots[first : first + 2]
        stem = "nyquist" if first == 0 else f"nyquist-{1 + first // 2}"
        blocks.append(Picture(
            stem=stem, title="Nyquist plots of the exact loop function", caption=RINGS_CAPTION,
            alt="; ".join(counts[named.name] for named, _ in pair),
            figure=draw_nyquist(arm.name, {named.name: data for named, data in pair}),
            data=contour_table([data for _, data in pair], [named.key for named, _ in pair], stem=f"{stem}-data"),
        ))  # fmt: skip
    own = "" if any(data.unstable_open for _, data in plots) else ", which here is never"
    table = count_table([f"{named.name}: {named.gains}" for named, _ in plots], [data for _, data in plots])
    words = [*map(upper, counts.values()), NYQUIST_WORDS.format(own=own)]
    title = "Nyquist plot: encirclements of −1"
    return PageSection(anchor="margins-nyquist", title=title, words=words, blocks=[*blocks, table])


def contour_table(found: Sequence[Nyquist], laws: Sequence[str], *, stem: str) -> Table:
    """L on the contour of each loop, a row a point."""
    each = [curve_table(one).columns for one in found]
    names = [name for name, columns in zip(laws, each, strict=True) for _ in columns[0].values]
    joined = [
        replace(columns[0], of=[value for column in columns for value in column.values])
        for columns in zip(*each, strict=True)
    ]
    title = "The loop function on the contour"
    return Table(stem=stem, title=title, columns=(Column("law", "law", of=names), *joined))


# ------------------------------------------------------------ poles


def poles_of(cases: Sequence[LawOnArm]) -> tuple[list[str], list[Table]]:
    """The first closed-loop poles of each case, complete in a box: the dominant one in words, and the tables."""
    words, tables = [], []
    for each in cases:
        try:
            poles = closed_loop_poles(each.arm, each.law)
        except TfarmError as error:
            words.append(f"{upper(each.name)}: poles not determined, {typeset(str(error))}.")
            continue
        moving = poles.moving
        found = "no pole but those at 0 lies in the box"
        if moving.size:
            furthest = moving[int(np.argmax(moving.real))]
            imaginary = f" ± {significant(furthest.imag, 6)} i" if furthest.imag else ""
            found = f"rightmost pole {significant(furthest.real, 6)}{imaginary} 1/s"
        words.append(f"{upper(each.name)}: {found}.")
        tables.append(_poles_table(each, poles))
    return words, tables


def poles_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> PageSection:
    """The closed-loop poles of the laws given."""
    words, tables = poles_of(continuous_cases(arm, chain, laws))
    return PageSection(anchor="locus", title="Closed-loop poles", words=words, blocks=tables)


def _poles_table(each: LawOnArm, poles: Poles) -> Table:
    """Poles with Im s >= 0, with their damping ratio."""
    left, right, _, top = poles.box
    box = f"{plain(left, 5)} < Re s < {plain(right, 5)} and |Im s| < {plain(top, 6)}"
    return roots_table(
        poles.values, quantities(Poles)["values"],
        stem=f"{each.key.replace('_', '-')}-poles", title=f"Closed-loop poles under {each.name}",
        caption=POLES_CAPTION.format(box=box),
    )  # fmt: skip
