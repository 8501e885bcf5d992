"""The continuous loops of a case: verdict and margins, Nyquist plots, poles; and its laws as they were read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import cancelled
from tfarm.arm.blocks import Rational, StateSpace
from tfarm.arm.law import REFERENCE, is_measured
from tfarm.digits import plain, singly
from tfarm.dsp.discretise import rule_in_words
from tfarm.errors import TfarmError
from tfarm.loop.margins import Margins, loop_curve
from tfarm.loop.nyquist import nyquist_of
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.loop.stability import spill
from tfarm.plots.frequency import draw_loop, draw_nyquist
from tfarm.report.cases import Case, Controller, brief_on, margins_of, why_no_loop
from tfarm.report.sections import Fact, PageSection, Picture, prose, upper
from tfarm.response.signals import Signals, sign_convention
from tfarm.schema import Column, Quantity, Table, across, curve_table, quantities, roots_table, table

MOST_SPILLED = 12  # flexible modes of the largest model that is compared with the exact loop


def no_loop_section(case: Case) -> PageSection:
    """One sentence for an arm that has no loop."""
    return PageSection(anchor="no-loop", title="The loop", answer=why_no_loop(case.arm))


# ------------------------------------------------------------ margins


def margins_section(case: Case) -> PageSection:
    """Verdict, margins, crossings and spillover of each controller, with the verdict on its sampled loop."""
    found = [(each, margins_of(each.arm, each.law)) for each in case.in_s]
    sampled = [brief_on(each.arm, each.law, case.chain).short for each, _ in found]
    words: list[str] = []
    blocks: list[Picture | Table] = [*(_bode_picture(*pair) for pair in found), margin_table(found)]
    for each, it in found:
        blocks += tables_of(each, it)
        try:
            spilled = spill(each.arm, each.law, MOST_SPILLED)
        except TfarmError as error:
            words.append(f"Spillover of {each.name} is not determined: {error}.")
            continue
        blocks.append(
            table(
                spilled.models,
                stem=each.stem("spill"),
                title=f"Models of few modes under {each.name}",
                caption=prose("spill", found=spilled.in_words),
            )
        )
    return PageSection(
        anchor="margins",
        title="Stability and stability margins",
        answer=prose("margins_lead", found=[(*pair, brief) for pair, brief in zip(found, sampled, strict=True)]),
        facts=[verdict_fact(*pair, brief) for pair, brief in zip(found, sampled, strict=True)],
        words=words,
        blocks=[block for block in blocks if not isinstance(block, Table) or block.columns],
    )


def verdict_fact(each: Controller, found: Margins, sampled: str) -> Fact:
    """The verdict, the number of unstable poles in the frequency range, and the verdict on the sampled loop."""
    it = found.stability
    return Fact(label=each.title, value=it.verdict.upper(), note=prose("verdict", it=it, sampled=sampled))


def margin_table(found: Sequence[tuple[Controller, Margins]]) -> Table:
    """A row a quantity, a column a controller."""
    leads = [each.name for each, it in found if it.in_band is not None and it.in_band.phase < 0]
    undamped = any(it.stability.loop.arm.is_undamped for _, it in found)
    return across(
        {each.title: it for each, it in found}, keys=[each.key for each, _ in found], stem="margins",
        title="Verdict and margins", caption=prose("margins", undamped=undamped, leads=leads),
    )  # fmt: skip


def _bode_picture(each: Controller, found: Margins) -> Picture:
    omega, L = loop_curve(found)
    title, stem = f"The loop function of {each.name}", each.stem("bode")
    columns = (
        Column("omega_rad_s", "angular frequency", "rad/s", of=omega),
        Column("re_L", "Re L", of=L.real),
        Column("im_L", "Im L", of=L.imag),
    )
    return Picture(
        stem=stem,
        title=title,
        caption=prose("loop_function", has_margins=found.in_band is not None),
        alt=f"Bode plot of the loop function of {each.name}, {found.stability.verdict}.",
        figure=draw_loop(found, each.name),
        data=Table(stem=f"{stem}-data", title=title, columns=columns),
    )


def tables_of(each: Controller, found: Margins) -> Iterator[Table]:
    """Every crossing of |L| = 1 and of L < 0 in the range, ascending, and the stability interval of each number."""
    for kind, rows in {"gain": found.gain_crossovers, "phase": found.phase_crossovers}.items():
        title, caption = f"{upper(kind)} crossovers of {each.name}", prose(f"{kind}_crossovers")
        yield table(rows, stem=each.stem(f"{kind}-crossovers"), title=title, caption=caption)
    title, caption = f"Stability intervals of {each.name}", prose("intervals", note=upper(found.intervals_note or ""))
    yield table(found.stability_intervals, stem=each.stem("windows"), title=title, caption=caption)


# ------------------------------------------------------------ Nyquist


def nyquist_section(case: Case) -> PageSection:
    """The loop function of each controller on a contour that hides nothing, its encirclements counted."""
    plots = [(each, nyquist_of(margins_of(each.arm, each.law).stability)) for each in case.in_s]
    own = any(found.unstable_open for _, found in plots)
    pictures = [
        Picture(
            stem=each.stem("nyquist"),
            title=f"Nyquist plot of the exact loop function, {each.name}",
            caption=prose("nyquist_rings"),
            alt=prose("nyquist_alt", name=each.name, found=found),
            figure=draw_nyquist(case.arm.name, {each.name: found}),
            data=curve_table(found, stem=each.stem("nyquist-data"), title="The loop function on the contour"),
        )
        for each, found in plots
    ]
    counts = across(
        {each.title: found for each, found in plots}, stem="nyquist-count",
        title="Encirclements and unstable poles", caption=prose("nyquist_count", own=own),
    )  # fmt: skip
    return PageSection(
        anchor="margins-nyquist",
        title="Nyquist plot: encirclements of −1",
        words=[prose("nyquist", own=own)],
        blocks=[*pictures, counts],
    )


# ------------------------------------------------------------ poles


def poles_tables(case: Case) -> tuple[list[str], list[Table]]:
    """The first closed-loop poles of each controller, complete in a box; a sentence where they are not determined."""
    words, tables = [], []
    for each in case.in_s:
        try:
            poles = closed_loop_poles(each.arm, each.law)
        except TfarmError as error:
            words.append(f"{upper(each.name)}: poles not determined, {error}.")
            continue
        title, caption = f"Closed-loop poles under {each.name}", prose("poles", box=poles.box)
        of = quantities(Poles)["values"]
        tables.append(roots_table(poles.values, of, stem=each.stem("poles"), title=title, caption=caption))
    return words, tables


# ------------------------------------------------------------ laws


def law_section(case: Case) -> PageSection:
    """Each law: its signals and input, its entries, its discretisation, and its warnings."""
    named = case.controllers
    words = [
        prose("law", each=each, convention=sign_convention(each.law, each.arm), warnings=cancelled(each.law),
              rule=rule_in_words(each.law), period=case.chain.sampling.period)
        for each in named
    ]  # fmt: skip
    words.append(prose("not_on_page", discrete=[each.name for each in named if each.law.is_discrete]))
    entries = [entry for each in named for entry in entries_of(each)]
    blocks = [table(entries, stem="law-entries", title="Transfer function from each signal", caption=prose("entries"))]
    blocks += [matrices for each in named for matrices in matrices_tables(each)]
    title = "The controller" if len(named) == 1 else "The controllers"
    return PageSection(anchor="law", title=title, answer=prose("laws", each=named), words=words, blocks=blocks)


class Entry(NamedTuple):
    """A signal of a law: how it enters, and its numerator and denominator in descending powers."""

    law: Annotated[str, Quantity("controller", help="controller that reads the signal")]
    signal: Annotated[str, Quantity("signal", help="output of the arm that the controller reads")]
    unit: Annotated[str, Quantity("unit", help="unit of the signal")]
    enters: Annotated[str, Quantity("enters", help="whether the reference is subtracted from the signal")]
    sign: Annotated[str, Quantity("sign in the input", help="sign of the signal's part in the control law")]
    variable: Annotated[str, Quantity("in powers of", help="s in continuous time, z at the samples")]
    numerator: Annotated[list[float] | str, Quantity("numerator", help="coefficients in descending powers")]
    denominator: Annotated[list[float] | str, Quantity("denominator", help="coefficients in descending powers")]
    delay: Annotated[float, Quantity("delay", "s", help="delay of the controller itself")]
    period: Annotated[float | None, Quantity("period", "s", help="sampling period of a discrete-time controller")]


def entries_of(each: Controller) -> Iterator[Entry]:
    """Every signal of a law with every digit; matrices have tables of their own."""
    law, sign, variable = each.law, "−" if each.law.sign < 0 else "+", "z" if each.law.is_discrete else "s"
    for part in law.parts:
        num: list[float] | str = "matrices, below"
        den: list[float] | str = ""
        if isinstance(part.block, Rational):
            num, den = (list(map(float, row)) for row in (part.block.num, part.block.den))
        for name in filter(None, part.signals):
            signal = name.removeprefix(REFERENCE)
            enters = "less its reference" if name in law.references else "as it is"
            enters = enters if is_measured(name) else "its reference alone"
            unit = Signals(each.arm, (signal,)).units[0]
            yield Entry(each.name, signal, unit, enters, sign, variable, num, den, law.delay, law.period)


def matrices_tables(each: Controller) -> Iterator[Table]:
    """A, B, C and D of each part of a law that has matrices, as [A B; C D]; columns without a signal are left out."""
    for number, part in enumerate(each.law.parts, 1):
        if not isinstance(part.block, StateSpace):
            continue
        A, B, C, D = part.block.matrices()
        led = [i for i, name in enumerate(part.signals) if name]
        whole = np.block([[A, B[:, led]], [C, D[:, led]]])
        states = [f"x{i}" for i in range(1, len(A) + 1)]
        titles = {x: x for x in states} | {f"{i + 1}_{part.signals[i]}": part.signals[i] for i in led}
        step = "next " if each.law.is_discrete else "d/dt "
        columns = [Column("row", "", of=[*(step + x for x in states), "input"])]
        columns += [
            Column(key, title, of=values, digits=singly(plain, 5))
            for (key, title), values in zip(titles.items(), whole.T, strict=True)
        ]
        stem = each.stem("matrices") + f"-{number}" * (number > 1)
        title, caption = f"Matrices of {each.name}", prose("matrices", name=each.name)
        yield Table(stem=stem, title=title, caption=caption, columns=tuple(columns))
