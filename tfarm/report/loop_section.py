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
from tfarm.loop import margins, nyquist, poles, stability
from tfarm.plots import frequency
from tfarm.report.cases import Case, Controller, brief_on, margins_of
from tfarm.report.sections import Fact, PageSection, Picture, picture, prose, sheet, upper
from tfarm.response.signals import Signals, sign_convention
from tfarm.schema import Column, Quantity, Table, across, curve_table, quantities, roots_table, table

MOST_SPILLED = 12  # flexible modes of the largest model that is compared with the exact loop


def no_loop_section(case: Case) -> PageSection:
    """One sentence for an arm that has no loop."""
    return PageSection(anchor="no-loop", title="The loop", answer=prose("no_loop", arm=case.arm))


# ------------------------------------------------------------ margins


def margins_section(case: Case) -> PageSection:
    """Verdict, margins, crossings and spillover of each controller, with the verdict on its sampled loop."""
    found = [(each, margins_of(each.arm, each.law)) for each in case.in_s]
    briefs = [(*pair, brief_on(pair[0].arm, pair[0].law, case.chain).short) for pair in found]
    words: list[str] = []
    blocks: list[Picture | Table] = [*(_bode_picture(*pair) for pair in found), margin_table(found)]
    for each, it in found:
        blocks += tables_of(each, it)
        try:
            few = stability.spill(each.arm, each.law, MOST_SPILLED)
            blocks.append(sheet("spill", table(few.models).columns, stem=each.stem("spill"), each=each, found=few))
        except TfarmError as error:
            words.append(f"Spillover of {each.name} is not determined: {error}.")
    return PageSection(
        anchor="margins", title="Stability and stability margins", answer=prose("margins_lead", found=briefs),
        facts=[verdict_fact(*each) for each in briefs], words=words, blocks=blocks,
    )  # fmt: skip


def verdict_fact(each: Controller, found: margins.Margins, sampled: str) -> Fact:
    """The verdict, the number of unstable poles in the frequency range, and the verdict on the sampled loop."""
    it = found.stability
    return Fact(each.title, it.verdict.upper(), note=prose("verdict", it=it, sampled=sampled))


def margin_table(found: Sequence[tuple[Controller, margins.Margins]]) -> Table:
    """A row a quantity, a column a controller."""
    leads = [each.name for each, it in found if it.in_band is not None and it.in_band.phase < 0]
    undamped = any(it.stability.loop.arm.is_undamped for _, it in found)
    own = across({each.title: it for each, it in found}, keys=[each.key for each, _ in found])
    return sheet("margins", own.columns, undamped=undamped, leads=leads)


def _bode_picture(each: Controller, found: margins.Margins) -> Picture:
    omega, L = margins.loop_curve(found)
    columns = (
        Column("omega_rad_s", "angular frequency", "rad/s", of=omega),
        Column("re_L", "Re L", of=L.real),
        Column("im_L", "Im L", of=L.imag),
    )
    figure, stem = frequency.draw_loop(found, each.name), each.stem("bode")
    return picture("loop_function", figure, stem=stem, data=columns, each=each, found=found)


def tables_of(each: Controller, found: margins.Margins) -> Iterator[Table]:
    """Every crossing of |L| = 1 and of L < 0 in the range, ascending, and the stability interval of each number."""
    for kind, rows in (("gain_crossovers", found.gain_crossovers), ("phase_crossovers", found.phase_crossovers)):
        yield sheet(kind, table(rows).columns, stem=each.stem(kind.replace("_", "-")), each=each)
    columns = table(found.stability_intervals).columns
    yield sheet("intervals", columns, stem=each.stem("windows"), each=each, note=found.intervals_note)


# ------------------------------------------------------------ Nyquist


def nyquist_section(case: Case) -> PageSection:
    """The loop function of each controller on a contour that hides nothing, its encirclements counted."""
    plots = [(each, nyquist.nyquist_of(margins_of(each.arm, each.law).stability)) for each in case.in_s]
    own = any(found.unstable_open for _, found in plots)
    blocks: list[Picture | Table] = [
        picture("nyquist_plot", frequency.draw_nyquist(case.arm.name, {each.name: found}), stem=each.stem("nyquist"),
                data=curve_table(found).columns, each=each, found=found)
        for each, found in plots
    ]  # fmt: skip
    blocks.append(sheet("nyquist_count", across({each.title: found for each, found in plots}).columns, own=own))
    title, words = "Nyquist plot: encirclements of −1", [prose("nyquist", own=own)]
    return PageSection(anchor="margins-nyquist", title=title, words=words, blocks=blocks)


# ------------------------------------------------------------ poles


def poles_tables(case: Case) -> tuple[list[str], list[Table]]:
    """The first closed-loop poles of each controller, complete in a box; a sentence where they are not determined."""
    words, tables, of = list[str](), list[Table](), quantities(poles.Poles)["values"]
    for each in case.in_s:
        try:
            found = poles.closed_loop_poles(each.arm, each.law)
            columns = roots_table(found.values, of).columns
            tables.append(sheet("poles", columns, stem=each.stem("poles"), each=each, box=found.box))
        except TfarmError as error:
            words.append(f"{upper(each.name)}: poles not determined, {error}.")
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
    blocks = [sheet("law_entries", table(entries).columns), *(own for each in named for own in matrices_tables(each))]
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
        columns = (
            Column("row", "", of=[*(step + x for x in states), "input"]),
            *(Column(key, title, of=values, digits=singly(plain, 5))
              for (key, title), values in zip(titles.items(), whole.T, strict=True)),
        )  # fmt: skip
        stem = each.stem("matrices") + f"-{number}" * (number > 1)
        yield sheet("matrices", columns, stem=stem, name=each.name)
