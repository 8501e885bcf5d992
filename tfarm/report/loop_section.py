"""The continuous loops of a report: margins, Nyquist plots, poles, laws; of both gains the map and the root loci."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Annotated, Any, NamedTuple

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, unit_of, warn_of_cancellations
from tfarm.arm.blocks import Rational
from tfarm.arm.law import REFERENCE, is_measured
from tfarm.arrays import Real
from tfarm.digits import plain
from tfarm.dsp.discretise import rule_in_words
from tfarm.errors import ConvergenceError, TfarmError
from tfarm.loop.loci import Loci, round_branches
from tfarm.loop.margins import Margins
from tfarm.loop.nyquist import Nyquist
from tfarm.loop.poles import Poles
from tfarm.plots import loop_function, regions, roots
from tfarm.report.blocks import (
    Fact,
    PageSection,
    Picture,
    columns_of,
    picture_block,
    prose,
    record_sheet,
    sheet,
    upper,
)
from tfarm.report.overview import results
from tfarm.report.page import ArmReport, PageCase, has_loop, sign_words
from tfarm.response.signals import Signals, sign_convention
from tfarm.schema import Column, Quantity, Table, across, curve_table, quantities, roots_table, table, text
from tfarm.synthesis.structures import TYPED_DIGITS

# ------------------------------------------------------------ margins


def margins_section(report: ArmReport) -> PageSection:
    """Verdict, margins, crossings and spillover of each controller."""
    found = [(each, each.margins) for each in report.in_s]
    words = []
    if not report.has_loop:
        words.append(prose("no_loop", arm=report.arm))
    if not report.laws:
        words.append(sign_words(report.arm))
    blocks: list[Picture | Table] = [*(_bode_picture(each) for each, _ in found), margin_table(found)]
    for each, it in found:
        crossovers = {"gain_crossovers": it.gain_crossovers, "phase_crossovers": it.phase_crossovers}
        for kind, rows in crossovers.items():
            blocks.append(record_sheet(kind, rows, stem=each.stem(kind.replace("_", "-")), each=each))
        own = table(it.stability_intervals)
        blocks.append(sheet("intervals", own, stem=each.stem("windows"), each=each, note=it.intervals_note))
        try:
            few = each.spillover
            blocks.append(record_sheet("spill", few.models, stem=each.stem("spill"), each=each, found=few))
        except TfarmError as error:
            words.append(f"Spillover of {each.name} is not determined: {error}.")
    return PageSection(title="Stability and stability margins", words=words, blocks=blocks)


def margin_table(found: Sequence[tuple[PageCase, Margins]]) -> Table:
    """Return a row a quantity, a column a controller."""
    leads = [each.name for each, it in found if it.in_band is not None and it.in_band.phase < 0]
    undamped = any(it.stability.loop.arm.is_undamped for _, it in found)
    own = across({each.title: it for each, it in found}, keys=[each.key for each, _ in found])
    return sheet("margins", own, undamped=undamped, leads=leads)


def _bode_picture(each: PageCase) -> Picture:
    """Bode plot of the continuous-time and the sampled loop function; of the first alone where the other has none."""
    curve = each.loop_function
    rows = (
        (own.period or 0.0, *row)
        for own in curve.sides
        for row in zip(own.omega, own.L.real, own.L.imag, strict=True)
    )
    data = columns_of(("period_s", "omega_rad_s", "re_L", "im_L"), rows)
    return picture_block(
        "loop_function",
        loop_function.loop.figure(curve),
        stem=each.stem("bode"),
        data=data,
        each=each,
        curve=curve,
    )


# ------------------------------------------------------------ Nyquist


def nyquist_section(report: ArmReport) -> PageSection:
    """Return the loop function of each controller on a contour that hides nothing, its encirclements counted."""
    blocks: list[Picture | Table] = []
    counts: dict[str, Nyquist] = {}
    shown = report.in_s
    for each in shown:
        counts[each.title] = found = each.nyquist
        # next to recommended gains, the default ones have the numbers of their Bode plot, and large arcs alike
        is_full = bool(report.laws) or each is shown[-1]
        linear = loop_function.nyquist.figure(found, name=each.name)
        data = curve_table(found) if is_full else ()
        stem = each.stem("nyquist")
        blocks.append(picture_block("nyquist_plot", linear, stem=stem, data=data, each=each, found=found))
        if is_full:
            disc = loop_function.disc.figure(found, name=each.name)
            blocks.append(picture_block("nyquist_disc", disc, stem=f"{stem}-disc", each=each, found=found))
    own = any(found.unstable_open for found in counts.values())
    blocks.append(sheet("nyquist_count", across(counts), own=own))
    return PageSection(
        title="Nyquist plot: encirclements of −1", words=[prose("nyquist", own=own)], blocks=blocks
    )


# ------------------------------------------------------------ laws


def law_section(report: ArmReport) -> PageSection:
    """Return each law: its signals and input, its entries, its discretisation, and its warnings."""
    named = report.cases
    words = [
        prose(
            "law",
            each=each,
            convention=sign_convention(each.law, each.arm),
            warnings=warn_of_cancellations(each.law),
            rule=rule_in_words(each.law),
            period=report.chain.sampling.period,
        )
        for each in named
    ]
    words.append(sign_words(report.arm))
    words.append(prose("not_on_page", discrete=[each.name for each in named if each.law.is_discrete]))
    blocks = [record_sheet("law_entries", [entry for each in named for entry in signal_entries(each)])]
    return PageSection(
        title="The controller" + "s" * (len(named) > 1),
        answer=prose("laws", each=named),
        words=words,
        blocks=blocks,
    )


class LawEntry(NamedTuple):
    """A signal of a law: how it enters, and its numerator and denominator in descending powers."""

    law: Annotated[str, Quantity("controller", help="controller that reads the signal")]
    signal: Annotated[str, Quantity("signal", help="output of the arm that the controller reads")]
    unit: Annotated[str, Quantity("unit", help="unit of the signal")]
    enters: Annotated[str, Quantity("enters", help="whether the reference is subtracted from the signal")]
    numerator: Annotated[list[float] | str, Quantity("numerator", help="coefficients in descending powers")]
    denominator: Annotated[
        list[float] | str, Quantity("denominator", help="coefficients in descending powers")
    ]


def signal_entries(each: PageCase) -> Iterator[LawEntry]:
    """Yield every signal of a law with every digit; matrices are in its file alone."""
    law = each.law
    for part in law.parts:
        num: list[float] | str = "matrices, in its file"
        den: list[float] | str = ""
        if isinstance(part.block, Rational):
            num, den = (list(map(float, row)) for row in (part.block.num, part.block.den))
        for name in filter(None, part.signals):
            signal = name.removeprefix(REFERENCE)
            enters = "less its reference" if name in law.references else "as it is"
            enters = enters if is_measured(name) else "its reference alone"
            yield LawEntry(each.name, signal, Signals(each.arm, (signal,)).units[0], enters, num, den)


# ------------------------------------------------------------ the map of both gains


def map_section(report: ArmReport) -> PageSection:
    """Return the stability regions of both gains, continuous and sampled."""
    arm = report.arm
    data = report.map
    laws = []
    points = [report.gains.point]
    if report.recommended is not None and report.recommended.is_met:
        points.append(report.recommended.law.point)
    for each, point in zip(report.in_s, points, strict=True):
        is_best = each.key == "recommended"
        origin = "" if is_best else ", the paper's, scaled"
        label = f"{each.name}{origin}: {each.gains};\n{each.brief.short}"
        laws.append(regions.MarkedLaw(point, label, is_best))
    drawn = picture_block(
        "map",
        regions.draw_stability_map.figure(data, laws),
        data=data.columns,
        found=data,
        arm=arm,
        chain=report.chain,
        band=report.band,
        unit=f"{plain(report.rate_unit, 4)} {unit_of(RATE_GAIN, arm)}",
        deepest=report.deepest_moment_gain,
    )
    return PageSection(
        title="Stability region of both gains", facts=continuous_interval_facts(report), blocks=(drawn,)
    )


def continuous_interval_facts(report: ArmReport) -> list[Fact]:
    """Return the stability intervals of each gain of the continuous-time loop, the other at its default."""
    return [
        Fact(f"{row.name}, continuous", text(row.intervals, 4) or "no value", row.unit)
        for row in report.cases[0].margins.stability_intervals
        if row.name in PLANE
    ]


def recommended_section(report: ArmReport) -> PageSection:
    """Return the design by default: gains that meet the requirements of the grade good, with their result card.

    Where none meet them all, those nearest to it with the requirements that they do not meet, and what would help.
    """
    title = "Recommended gains"
    found = report.recommended
    if found is None:
        return PageSection(title=title, answer=prose("no_stable_gains", why=report.why_none))
    gains = ", ".join(
        found.law.gain_text(name, partial(plain, digits=TYPED_DIGITS), report.arm) for name in PLANE
    )
    answer = prose("recommended", found=found, gains=gains, command=report.command_name)
    card: list[dict[str, Any]] = []
    if found.is_met:
        each = report.in_s[-1]
        card = results(each.card, each.title)
    rows = table(found.requirements, ("requirement", "sampled", "continuous"))
    return PageSection(
        title=title,
        answer=answer,
        card=card,
        blocks=(sheet("requirements", rows, stem="requirements"),),
    )


# ------------------------------------------------------------ root loci


def locus_section(report: ArmReport) -> PageSection:
    """Return poles of the controllers; of an arm's own page root loci along each gain too."""
    words: list[str] = []
    tables: list[Table] = []
    of = quantities(Poles)["values"]
    for each in report.in_s:
        try:
            listed = each.poles
            shown = roots_table(listed.values, of)
            tables.append(sheet("poles", shown, stem=each.stem("poles"), each=each, box=listed.box))
        except TfarmError as error:
            words.append(f"{upper(each.name)}: poles not determined, {error}.")
    if report.laws:
        return PageSection(title="Closed-loop poles", words=words, blocks=tables)
    blocks: list[Picture | Table] = []
    found: dict[str, Loci] = {}
    for name in (RATE_GAIN, MOMENT_GAIN) if has_loop(report.arm) else (RATE_GAIN,):
        try:
            found[name] = own = report.locus(name)
        except ConvergenceError:
            words.append(prose("not_followed", name=name))
            continue
        stem = f"locus-{name}"
        blocks += [
            picture_block("locus", roots.draw_loci.figure(own), stem=stem, data=locus_data(own), found=own),
            record_sheet("branches", own.rows, stem=f"{stem}-branches", found=own),
            record_sheet("crossings", own.exact.crossings, stem=f"{stem}-crossings", found=own),
        ]
    first, second = (report.gains.gain_text(name, partial(plain, digits=4), report.arm) for name in PLANE)
    others = dict(zip(PLANE, (second, first), strict=True))
    answer = prose("locus_lead", found=found, gains=others)
    return PageSection(title="Root loci", answer=answer, words=words, blocks=[*blocks, *tables])


def locus_data(data: Loci) -> Sequence[Column]:
    """Return the poles of the exact and of the reduced locus, to the digits that hold on every processor."""
    columns = [Column(data.name, of=data.exact.gain)]
    for which, branches in (("exact", data.exact.branches), ("reduced", data.reduced.branches)):
        for n, row in enumerate(round_branches(branches)):
            columns.append(Column(f"{which}_{n}_re", of=numbers_or_blanks(row.real)))
            columns.append(Column(f"{which}_{n}_im", of=numbers_or_blanks(row.imag)))
    return columns


def numbers_or_blanks(values: Real) -> list[Any]:
    """Return numbers, nothing in the place of those that are none."""
    return ["" if math.isnan(value) else value for value in values.tolist()]
