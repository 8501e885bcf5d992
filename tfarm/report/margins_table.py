"""Verdict, windows and margins of each law, in this order: no margin stands without its verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from tfarm.arm import MOMENT_GAIN
from tfarm.columns import Column, Table
from tfarm.digits import how_many, plain, significant, singly
from tfarm.loop.answers import MARGIN_COLUMNS, NOT_STABLE, WINDOW_COLUMNS, gain_rows, margin_rows, unsettled
from tfarm.loop.margins import Margins
from tfarm.loop.theorem import lyapunov, signs_of_loop
from tfarm.report.loop_laws import Named
from tfarm.report.sections import Fact
from tfarm.report.words import typeset, upper

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


def verdict_fact(named: Named, found: Margins, more: str) -> Fact:
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
    apart = ", the one at 0 that the hub angle leaves apart" if free else ""
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


def margin_table(laws: Sequence[Named], found: Sequence[Margins], is_undamped: bool) -> Table:
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


def window_table(laws: Sequence[Named], found: Sequence[Margins]) -> Table:
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
