"""The words that tfarm's answers use in a sense of their own, each once, for `tfarm glossary` and for pages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tfarm.errors import ParameterError, did_you_mean
from tfarm.schema import Quantity


@dataclass(frozen=True, slots=True)
class Term:
    """A word or two, and what they promise or mean."""

    name: Annotated[str, Quantity("term", key="term")]
    meaning: Annotated[str, Quantity("meaning")]


GLOSSARY_TERMS = (
    Term(
        "band",
        "the range of frequencies from 0 up to a printed one in which poles were counted or a margin was "
        "read. What is known beyond it stands beside it; where nothing is, the answer says so.",
    ),
    Term(
        "box",
        "a rectangle of the s-plane. A list that is complete in a box holds every pole or zero inside it, "
        "counted by the winding number around it.",
    ),
    Term(
        "certified",
        "proven in ball arithmetic: each frequency or eigenvalue is enclosed, and their number is certain. "
        "Asked for by --certify.",
    ),
    Term(
        "complete",
        "nothing is missing: a count that does not rest on finding things agrees with the list, in the band "
        "or box that is printed.",
    ),
    Term(
        "crossover",
        "a frequency where |L| = 1 (gain crossover, with its phase margin) or where L < 0 (phase crossover, "
        "with the factor on the whole law that puts a pole there).",
    ),
    Term(
        "default gains",
        "K1 = 0.00642 J w1 (J the arm's inertia, w1 its first flexible frequency) and K2 = 0.3, taken where "
        "none are given, and said. They are the paper's on its arm and a place to begin on another, no "
        "recommendation.",
    ),
    Term(
        "delay margin",
        "the least further delay in the loop that puts a pole on the imaginary axis; in seconds, or in "
        "samples of a sampled loop.",
    ),
    Term(
        "disk margin",
        "twice the least |(1 + L)/(1 - L)|: under a complex factor (2 + d)/(2 - d) on L, gain and phase at "
        "once, no pole becomes unstable while |d| is below it (Seiler, Packard and Gahinet 2020).",
    ),
    Term(
        "enclosed",
        "known to lie in a printed interval or disc, with rounding accounted for; exactly one root lies in each.",
    ),
    Term(
        "exact",
        "of the transcendental solution of the beam equations, with no modes cut off; computed to rounding, "
        "which every printed digit is clear of.",
    ),
    Term(
        "hub participation",
        "how much a mode turns the hub: the angle b of the hub in the mode's shape of unit modal mass. b^2 is "
        "the residue of hub angle over torque; a mode with b = 0 is neither driven nor seen there.",
    ),
    Term(
        "hub-locked frequency",
        "a natural frequency with the hub held still. A rig rings there when dry friction has stopped its hub.",
    ),
    Term(
        "Lyapunov region",
        "K1 > 0, K2 < 1, where the paper's energy argument proves the undamped arm (C = 0) stable. With C > 0 "
        "it proves K2 = 0 alone; on other rigs it proves what the answer says, often nothing. Outside it a "
        "loop need not be unstable.",
    ),
    Term(
        "marginal",
        "with poles on the imaginary axis to working precision: neither stable nor unstable.",
    ),
    Term(
        "passive",
        "of a law from the hub's own angle or rate to its torque that gives the arm no energy at any "
        "frequency: it drives no mode of any rig. A delay or a clock ends that.",
    ),
    Term(
        "proven",
        "shown by a theorem whose hypotheses hold here, or in arithmetic whose every rounding is bounded. A "
        "number in float64 is never called so.",
    ),
    Term(
        "settled",
        "of a sampled verdict: no mode of the printed band, in the computed loop or not, and no slow real "
        "pole can change it.",
    ),
    Term(
        "sign convention",
        "u = -Kp theta - K1 theta_t - K2 E I phi'(0): the root moment counts positive where it accelerates "
        "the hub. With the gauge the other way round K2 changes its sign.",
    ),
    Term(
        "small gain",
        "where |L| < 1 no pole can be unstable, whatever the phase: why nothing need be counted beyond a band "
        "in which |L| has become small and falls.",
    ),
    Term(
        "spectral abscissa",
        "the largest real part of the poles in the band; negative where they all decay.",
    ),
    Term(
        "spill-over",
        "a law that drives a mode which its design model leaves out: stable on the model, unstable on the rig.",
    ),
    Term(
        "verdict",
        "stable, unstable, marginal or undecided. It comes before any margin, as an unstable loop has none.",
    ),
    Term(
        "winding number",
        "how often D(s) turns around 0 as s goes around a box: the number of roots inside, found without "
        "looking for them (the argument principle).",
    ),
    Term(
        "window",
        "an interval of one gain, the others held, in which the loop is stable. A * marks an end up to which "
        "no limit was found, and beyond which none was looked for.",
    ),
)


@dataclass(frozen=True)
class Glossary:
    """Terms with their meanings."""

    terms: Annotated[tuple[Term, ...], Quantity("terms")]


def glossary(words: str | None = None) -> Glossary:
    """Every term with its meaning, or those whose name holds the words.  Raises ParameterError where there is none."""
    found = tuple(each for each in GLOSSARY_TERMS if words is None or words.casefold() in each.name.casefold())
    if not found:
        remedy = did_you_mean(str(words), [each.name for each in GLOSSARY_TERMS])
        raise ParameterError(key="term", value=words, remedy=remedy)
    return Glossary(found)
