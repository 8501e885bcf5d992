"""The five words of certainty and the terms of the results, for `tfarm glossary`, the pages and the documentation.

The quantities of all results, with label, unit and meaning, are read where each record declares them.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated

from tfarm.errors import ParameterError, did_you_mean
from tfarm.schema import Quantity, quantities


@dataclass(frozen=True, slots=True)
class Term:
    """A term and its meaning; of a word of certainty what has to be shown for it."""

    name: Annotated[str, Quantity("term", key="term")]
    meaning: Annotated[str, Quantity("meaning")]


@dataclass(frozen=True, slots=True)
class Declared:
    """A quantity of the results."""

    label: Annotated[str, Quantity("quantity", key="quantity")]
    unit: Annotated[str, Quantity("unit")]
    meaning: Annotated[str, Quantity("meaning")]


CERTAINTY = (
    Term(
        "exact",
        "Solution of the beam equations without truncation of modes. Shown: it is evaluated from the "
        "transcendental solution, and the rounding error is below the last printed digit.",
    ),
    Term(
        "certified",
        "Proven, rounding included. Shown: an enclosure in ball arithmetic and a proven count of the roots in it, "
        "or a theorem whose hypotheses were checked.",
    ),
    Term(
        "converged",
        "A limit was reached within a stated tolerance. Shown: more modes, points or starts changed the result by "
        "less than the tolerance.",
    ),
    Term(
        "approximate",
        "The result of a model that is not exact. Shown: its error was measured against the exact solution, and is "
        "printed with the result.",
    ),
    Term(
        "not determined",
        "No statement. Shown: the search or the proof stopped short, and the reason is printed.",
    ),
)
TERMS = (
    Term("band", "The frequency range from 0 to a printed limit in which poles were counted or a margin was read."),
    Term("box", "A rectangle of the s-plane. A list that is complete in a box has every pole or zero inside it."),
    Term(
        "complete",
        "No entry is missing: a count that is independent of the search agrees with the list, in the printed "
        "frequency range or box.",
    ),
    Term(
        "crossover",
        "A frequency where |L| = 1 (gain crossover, of the phase margin) or where L < 0 (phase crossover, of the "
        "gain margin).",
    ),
    Term(
        "default gains",
        "K1 = 0.00642 J w1 (J the arm's inertia, w1 its first flexible frequency) and K2 = 0.3, where none are "
        "given. They are the paper's on its arm and a first guess on another one, no recommendation.",
    ),
    Term(
        "delay margin",
        "The smallest additional loop delay that brings a pole to the stability boundary, in s or in samples.",
    ),
    Term(
        "disk margin",
        "Twice the minimum of |(1 + L)/(1 - L)|. With a complex factor (2 + d)/(2 - d) on L the loop stays stable "
        "while |d| is smaller (Seiler, Packard and Gahinet 2020).",
    ),
    Term("enclosed", "In a printed interval or disc, with rounding accounted for; exactly one root is in each."),
    Term("gain margin", "The factor on L, in dB, at which a pole reaches the stability boundary."),
    Term(
        "hub participation",
        "The hub angle b of a mode's shape of unit modal mass; b^2 is the residue of hub angle over torque. A mode "
        "with b = 0 is neither controllable nor observable at the hub.",
    ),
    Term(
        "hub-locked frequency",
        "A natural frequency with the hub fixed. A rig vibrates there when dry friction has stopped its hub.",
    ),
    Term(
        "Lyapunov region",
        "K1 > 0, K2 < 1, where the paper's energy argument proves the undamped arm (C = 0) stable. It is sufficient, "
        "not necessary. With C > 0 it proves K2 = 0 alone.",
    ),
    Term("marginal", "With poles on the stability boundary to working precision: neither stable nor unstable."),
    Term(
        "passive",
        "Of a law from the hub's angle or rate to its torque that supplies no energy to the arm at any frequency. "
        "It destabilises no mode of any rig; a delay or sampling ends that.",
    ),
    Term("peak sensitivity Ms", "The maximum of |1/(1 + L)|, one over the smallest distance of L from -1."),
    Term("phase margin", "The smallest phase lag, in deg, that brings a pole to the stability boundary."),
    Term("proven", "Certified: shown by a theorem whose hypotheses were checked, or with every rounding bounded."),
    Term("settled", "Certified, of a sampled verdict: no mode of the printed frequency range can change it."),
    Term(
        "sign convention",
        "u = -Kp theta - K1 theta_t - K2 E I phi'(0): the root moment is positive where it accelerates the hub. With "
        "the gauge reversed K2 changes its sign.",
    ),
    Term(
        "small gain",
        "Where |L| < 1 no pole can be unstable, whatever the phase. Beyond a frequency range in which |L| has become "
        "small and falls, no poles need be counted.",
    ),
    Term("spectral abscissa", "The largest real part of the poles in the frequency range; negative if all decay."),
    Term("spillover", "A law destabilises a mode that its design model leaves out."),
    Term("verdict", "Stable, unstable, marginal or not determined. An unstable loop has no margins."),
    Term(
        "winding number",
        "The number of encirclements of 0 by D(s) along a box: the number of roots inside it (argument principle).",
    ),
    Term(
        "window",
        "A stability interval of one gain, the others fixed. An end with < or > is that of the search range: no limit "
        "was found up to there.",
    ),
)
GLOSSARY_TERMS = tuple(sorted((*CERTAINTY, *TERMS), key=lambda term: term.name.casefold()))


def declared_records() -> Iterator[tuple[type, dict[str, Quantity]]]:
    """Return every class of records with its quantities by attribute; imports the whole package."""
    for module in pkgutil.walk_packages([str(Path(__file__).parent)], "tfarm."):
        if module.name in ("tfarm.__main__", "tfarm.grouped"):  # these act when they are imported
            continue
        for kind in vars(import_module(module.name)).values():
            with suppress(NameError):  # of a class whose annotations are for type checkers alone
                if isinstance(kind, type) and kind.__module__ == module.name and quantities(kind):
                    yield kind, quantities(kind)


@dataclass(frozen=True)
class Glossary:
    """The words of certainty and terms, and the quantities that have a meaning of their own."""

    terms: Annotated[tuple[Term, ...], Quantity("terms")]
    quantities: Annotated[tuple[Declared, ...], Quantity("quantities of the results")]


def glossary(words: str | None = None) -> Glossary:
    """Return every term and quantity, or those whose name contains the words.

    Raises ParameterError where there is none.
    """
    every = {Declared(of.label, of.unit, of.help) for _, all_of in declared_records() for of in all_of.values()
             if of.label and of.help}  # fmt: skip
    part = (words or "").casefold()
    terms = tuple(each for each in GLOSSARY_TERMS if part in each.name.casefold())
    known = sorted(every, key=lambda each: (each.label.casefold(), each.unit, each.meaning))
    found = tuple(each for each in known if part in each.label.casefold())
    if not (terms or found):
        remedy = did_you_mean(part, [each.name for each in GLOSSARY_TERMS])
        raise ParameterError(key="term", value=words, remedy=remedy)
    return Glossary(terms, found)
