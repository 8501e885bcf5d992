"""The continuous loop on an arm's page: verdict and margins, Nyquist plot, poles."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.columns import Column, Table
from tfarm.digits import how_many, plain, significant, singly
from tfarm.dsp import Chain
from tfarm.errors import TfarmError
from tfarm.loop.answers import (
    CROSSOVERS,
    MARGIN_COLUMNS,
    NOT_STABLE,
    POLE_COLUMNS,
    WINDOW_COLUMNS,
    crossovers,
    gain_rows,
    margin_rows,
    unsettled,
)
from tfarm.loop.margins import Margins, loop_curve
from tfarm.loop.nyquist import Nyquist, nyquist_of, nyquist_table
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.loop.spill import SPILL, Spill, spill
from tfarm.loop.theorem import lyapunov, signs_of_loop
from tfarm.plots.disc import draw_nyquist
from tfarm.plots.frequency import draw_loop
from tfarm.report.cases import GivenLaw, LawOnArm, brief_on, continuous_cases, margins_of, why_no_loop
from tfarm.report.sections import Fact, PageSection, Picture, typeset, upper

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
    "The others held, each gain, or number of a law, may move within its window before the first pole reaches the "
    "axis. Ends ±∞ are proven; an end with a star is no edge: up to there none was found, and beyond none was looked "
    "for."
)
MARGIN_TITLES = {"disk": "disk margin α"}
QUANTITIES = (
    "gain margin, down",
    "gain margin, up",
    *(MARGIN_TITLES.get(each.of, each.title) for each in MARGIN_COLUMNS),
)
MarginRow = tuple[str, str, float | str, float | str, float | str]  # quantity, unit, exact, in the band, at
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
    "Diamonds: |L| = 1, with the phase margin there, green for lag and purple for lead. Dots: L is real and below 0, "
    "and the dashed line is the way to −1, with the factor on the whole law that goes it."
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
    """A row a quantity, the verdict first; for each law the exact value, that in the band, and where.

    The caption says what a phase margin below 0 means, for each law that has one.
    """
    rows, leads = [list(_rows(each)) for each in found], ""
    columns = [
        Column("quantity", "quantity", of=[row[0] for row in rows[0]]),
        Column("unit", "unit", of=[row[1] for row in rows[0]]),
    ]
    number = singly(lambda value: plain(value, 6) if value.is_integer() else significant(value, 5))
    for named, each, part in zip(laws, found, rows, strict=True):
        group, band = f"{named.name}: {named.gains}", each.in_band
        for i, (key, title) in enumerate((("exact", "exact"), ("band", "in the band"), ("at_rad_s", "at rad/s")), 2):
            columns.append(Column(f"{named.key}_{key}", title, of=[row[i] for row in part], digits=number, group=group))
        if band is not None and band.phase < 0:
            lead = f"{significant(band.phase, 5)} deg at {significant(band.at['phase'], 5)} rad/s"
            leads += f" {upper(named.name)}: {lead} is lead; not an instability."
    return Table(
        stem="margins",
        title="Verdict and margins",
        caption=MARGINS_CAPTION.format(undamped=DELAY_UNDAMPED if is_undamped else "") + leads,
        columns=tuple(columns),
    )


def _rows(found: Margins) -> Iterator[MarginRow]:
    """The verdict before any margin."""
    it, band = found.stability, found.in_band
    count = math.inf if it.unstable_roots_infinite else float(it.unstable_roots)
    yield "verdict", "", it.verdict, "", ""
    yield "unstable poles", "", count, float(it.unstable_roots), ""
    yield "band", "rad/s", "", it.band, ""
    if band is None:
        for name in QUANTITIES:
            yield name, "", NOT_STABLE, "", ""
        return
    yield "gain margin, down", "factor", band.gain[0], "", ""
    yield "gain margin, up", "factor", band.gain[1], "", ""
    for name, row in zip(QUANTITIES[2:], margin_rows(found, band), strict=True):
        yield name, row.column.unit, row.exact, row.in_band, row.at


def window_table(laws: Sequence[LawOnArm], found: Sequence[Margins]) -> Table:
    """A row a law and gain; none for the moment on a free pin, where it has no loop."""
    rows = [
        (law.name, each.stability.verdict, row)
        for law, each in zip(laws, found, strict=True)
        for row in gain_rows(each)
        if row.gain != MOMENT_GAIN or not each.stability.loop.arm.has_massless_hub
    ]
    names, verdicts, gains = zip(*rows, strict=True)
    open_ends = ((law.name, unsettled(each)) for law, each in zip(laws, found, strict=True))  # windows of a band
    more = "".join(f" {upper(name)}: {typeset(text)}." for name, text in open_ends if text)
    return Table(
        stem="windows",
        title="How far each gain may go alone",
        caption=CAPTION_OF_WINDOWS + more,
        columns=(Column("law", "law", of=names), Column("verdict", "verdict", of=verdicts), *WINDOW_COLUMNS),
        record=gains,
    )


def count_table(names: Sequence[str], plots: Sequence[Nyquist]) -> Table:
    """Verdict, encirclements and unstable poles of each law."""
    whole = partial(Column, digits=singly(lambda n: str(n).replace("-", "−")))
    unstable = partial(whole, group="unstable poles")
    words = [
        f"{it.verdict}{', infinitely many in all' * it.unstable_roots_infinite}"
        for it in (plot.verdict for plot in plots)
    ]
    return Table(
        stem="nyquist-count",
        title="Encirclements and unstable poles",
        caption=COUNT_CAPTION.format(open=NO_OPEN if not any(plot.unstable_open for plot in plots) else OWN_OPEN),
        columns=(
            Column("law", "law", of=names),
            Column("verdict", "verdict", of=words),
            whole("encirclements", "turns around −1", of="encirclements"),
            unstable("unstable_by_nyquist", "by Nyquist", of="expected"),
            unstable("unstable_in_box", "in a box", of="verdict.unstable_roots"),
            unstable("on_axis_in_box", "undecided", of="on_axis"),
            Column("band_rad_s", "up to", "rad/s", of="verdict.band", digits=singly(significant, 6)),
        ),
        record=list(plots),
    )


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
    undamped = arm.is_told_by_lyapunov and all(it.stability.loop.gains is not None for it in found)
    blocks: list[Picture | Table] = [_bode_picture(*each) for each in both]
    if any(it.in_band is not None for it in found):
        blocks.append(margin_table(cases, found, undamped))
    blocks += [crossings_table(each, it) for each, it in both if it.in_band is not None]
    if windowed := [(each, it) for each, it in both if it.windows]:
        blocks.append(window_table([each for each, _ in windowed], [it for _, it in windowed]))
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
            data=nyquist_table(*(data for _, data in pair), stem=f"{stem}-data", laws=[named.key for named, _ in pair]),
        ))  # fmt: skip
    own = "" if any(data.unstable_open for _, data in plots) else ", which here is never"
    table = count_table([f"{named.name}: {named.gains}" for named, _ in plots], [data for _, data in plots])
    words = [*map(upper, counts.values()), NYQUIST_WORDS.format(own=own)]
    title = "Nyquist plot: encirclements of −1"
    return PageSection(anchor="margins-nyquist", title=title, words=words, blocks=[*blocks, table])


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
    return Table(
        stem=f"{each.key.replace('_', '-')}-poles",
        title=f"Closed-loop poles under {each.name}",
        caption=POLES_CAPTION.format(box=box),
        columns=POLE_COLUMNS,
        record=poles.values.tolist(),
    )
