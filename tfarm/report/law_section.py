"""What a law is, on the page that is about it: every number as it was read, and what the page leaves out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tfarm.arm import PLANE, Arm, cancelled
from tfarm.arm.blocks import Rational, StateSpace
from tfarm.arm.law import REFERENCE, is_measured
from tfarm.columns import Column, Table
from tfarm.digits import plain, singly
from tfarm.dsp import Chain
from tfarm.dsp.discretise import rule_in_words
from tfarm.report.cases import GivenLaw, LawOnArm, on_arm
from tfarm.report.sections import PageSection, typeset, upper
from tfarm.response.controller import sign_convention
from tfarm.response.signals import Signals

NOT_LED = "open"  # a column that nothing is led to
RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
NOT_ON_PAGE = (
    f"This page is about what stands here, not about the default gains. The map of {' and '.join(PLANE)}, the loci "
    "along them and the gain tuner are of the paper's two gains and are left out; tfarm map --law FILE counts unstable "
    "poles over any two numbers of a law, tfarm locus --law FILE follows them along one."
)
IN_Z_ALONE = (
    "A law in z acts at its samples alone: the sections on {which} are of the sampled loop, without a loop function of "
    "s, its margins and poles."
)
ENTRIES_CAPTION = (
    "As it was read, in the files with every digit: coefficients in descending powers of s, of z where the law is "
    "discrete. The input is the sum of the signals times these, with the sign that stands under “in the input”."
)


def law_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> PageSection:
    """Each law: what it reads and drives, its entries, how it is sampled, and what a person should know of it."""
    named, ms, words = on_arm(arm, laws), plain(1e3 * chain.sampling.period), []
    for each in named:
        law, file = each.law, f" ({each.given.file})" * bool(each.given.file)
        told = typeset(sign_convention(law, each.arm))
        enter = f" {', '.join(law.references)} enter{'s' * (len(law.references) == 1)} less what it should be."
        led = enter * bool(law.references)
        warned = "".join(f" Warning: {typeset(text)}." for text in cancelled(law))
        rule = f"On the loop sampled every {ms} ms it is {rule_in_words(law)}."
        words.append(f"{upper(each.name)}{file}, order {law.order}: {told}.{led} {rule}{warned}")
    discrete = [each for each in named if each.law.is_discrete]
    if discrete:
        which = "it" if len(named) == 1 else " and of ".join(each.name for each in discrete)
        words.append(IN_Z_ALONE.format(which=which))
    blocks = [entries_table(named), *(table for each in named for table in matrices_tables(each))]
    title = "The law" if len(named) == 1 else "The laws"
    return PageSection(anchor="law", title=title, words=[*words, NOT_ON_PAGE], blocks=blocks)


def entries_table(laws: Sequence[LawOnArm]) -> Table:
    """A row a signal of each law: how it enters, and its numerator and denominator."""
    rows = [row for each in laws for row in _entries(each)]
    name, signal, unit, enters, sign, num, den, delay, period = ([row[i] for row in rows] for i in range(9))
    columns = (
        Column("law", "law", of=name),
        Column("signal", "signal", of=signal),
        Column("unit", "unit", of=unit),
        Column("enters", "enters", of=enters),
        Column("sign", "in the input", of=sign),
        Column("numerator", "numerator", of=num, shown=[written_polynomial(str(text)) for text in num]),
        Column("denominator", "denominator", of=den, shown=[written_polynomial(str(text)) for text in den]),
        Column("delay_s", "delay", "s", of=delay, digits=singly(plain)),
        Column("period_s", "period", "s", of=period, digits=singly(plain)),
    )
    title = "What each signal is multiplied by"
    return Table(stem="law-entries", title=title, caption=ENTRIES_CAPTION, columns=columns)


EntryRow = tuple[str, str, str, str, str, str, str, float | str, float | str]


def _entries(each: LawOnArm) -> Iterator[EntryRow]:
    """Of each signal: numerator and denominator with every digit, their letter before them, or where matrices stand."""
    law, letter = each.law, "z" if each.law.is_discrete else "s"
    sign, period = "−" if law.sign < 0 else "+", "" if law.period is None else law.period
    for part in law.parts:
        num, den = "matrices, below", ""
        if isinstance(part.block, Rational):
            num, den = (
                f"{letter}: {' '.join(repr(float(c)) for c in row)}" for row in (part.block.num, part.block.den)
            )
        for name in filter(None, part.signals):
            plain_name = name.removeprefix(REFERENCE)
            unit = Signals(each.arm, (plain_name,)).units[0]
            led = "less its reference" if name in law.references else "as it is"
            how = led if is_measured(name) else "its reference alone"
            yield each.name, plain_name, unit, how, sign, num, den, law.delay, period


def written_polynomial(text: str) -> str:
    """Coefficients as a person writes the polynomial: "s: 0.02 1.0" is 0.02 s + 1."""
    letter, _, numbers = text.partition(": ")
    if not numbers:
        return text
    coefficients = [float(each) for each in numbers.split()]
    top, terms = len(coefficients) - 1, []
    for power, value in zip(range(top, -1, -1), coefficients, strict=True):
        if not value and top:
            continue
        size = plain(abs(value), 6)
        number = "" if size == "1" and power else f"{size} " if power else size
        term = number + (letter + str(power).translate(RAISED) * (power > 1)) * (power > 0)
        terms.append(("− " if value < 0 else "+ ") + term)
    first, *others = terms or ["+ 0"]
    return " ".join([first.removeprefix("+ ").replace("− ", "−"), *others])


def matrices_tables(each: LawOnArm) -> list[Table]:
    """A, B, C and D of each part of a law that has matrices, as one block [A B; C D]; its columns by their signals."""
    found = []
    for number, part in enumerate(each.law.parts, 1):
        if not isinstance(part.block, StateSpace):
            continue
        A, B, C, D = part.block.matrices()
        n, whole = len(A), np.block([[A, B], [C, D]])
        step = "next " if each.law.is_discrete else "d/dt "
        titles = [f"x{i}" for i in range(1, n + 1)] + [name or NOT_LED for name in part.signals]
        keys = [f"x{i}" for i in range(1, n + 1)] + [f"{i}_{name or 'open'}" for i, name in enumerate(part.signals, 1)]
        columns = (
            Column("row", "", of=[*(f"{step}x{i}" for i in range(1, n + 1)), "input"]),
            *(
                Column(key, title, of=whole[:, i], digits=singly(plain, 5))
                for i, (key, title) in enumerate(zip(keys, titles, strict=True))
            ),
        )
        caption = f"{each.name}: A and C under the states, B and D under the signals; the files have every digit."
        stem = f"{each.key.replace('_', '-')}-matrices" + f"-{number}" * (number > 1)
        found.append(Table(stem=stem, title=f"Matrices of {each.name}", caption=caption, columns=columns))
    return found
