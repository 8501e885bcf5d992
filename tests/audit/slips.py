"""A sign turned in any formula of the audit is caught, by a check that never reads the right one.

    python -m tests.audit.slips SIZE SEED

Up to SIZE signs between two terms of each formula, chosen by SEED, turned one at a time: the formula's check must
find a residual, and read what is wrong and nothing of what is right.  Budget: half a minute of CPU for all signs
(there are fewer than 100 in each formula).
"""

import random
import re
from unittest.mock import patch

from tests import survey
from tests.survey import Finding
from tfarm import audit
from tfarm.audit import appendix, energy, formulas, motion

CLAIMS = {claim.equation: claim for claim in audit.claims()}
NOT_FORMULAS = {"section 5: inputs", "section 5: alpha_c", "section 5: eta_c"}
FORMULAS = {
    name: claim.corrected or claim.printed
    for name, claim in CLAIMS.items()
    if not name.startswith("Table") and name not in NOT_FORMULAS and "order of" not in name
}
CACHES = (formulas.parsed, motion.solved_motion, energy.energy_of, appendix.wave_determinant, appendix.relation)


def flips(text):
    """The text with one of its signs turned, for every sign between two terms (but that of a ±)."""
    for sign in re.finditer(r" ([-+]) (?!pm)", text):
        turned = {"+": "-", "-": "+"}[sign[1]]
        yield text[: sign.start(1)] + turned + text[sign.end(1) :]


SIGNED = [name for name, text in FORMULAS.items() if any(flips(text))]


class Watched:
    """The pattern by which `formulas.parsed` finds derivatives in a text, and the texts in which it has."""

    def __init__(self, pattern):
        self.pattern, self.texts = pattern, set()

    def sub(self, replace, text):
        self.texts.add(text)
        return self.pattern.sub(replace, text)

    def fullmatch(self, text):
        return self.pattern.fullmatch(text)


def texts_read_by(check, text):
    """Every formula that a check reads, from empty caches, and the residual that it finds."""
    for cached in CACHES:
        cached.cache_clear()
    with patch.object(formulas, "JET", Watched(formulas.JET)) as watched:
        residual = check(text)
    return watched.texts, residual


def parts(text):
    return {part.strip() for part in re.split(r" = |;", text)}


def faults(name, turned):
    """What is wrong with how a formula's check takes the formula with a turned sign."""
    right, wrong = parts(FORMULAS[name]) - parts(turned), parts(turned) - parts(FORMULAS[name])
    seen, residual = texts_read_by(CLAIMS[name].check, turned)
    if not wrong <= seen:
        yield f"not read: {wrong - seen}"
    if right & seen:
        yield f"compared with itself: {right & seen}"
    if name != "(20), (23): K" and audit.is_zero(residual):  # dimensions, which part the two K, have no sign
        yield f"not caught: {turned}"


def signs(size, seed):
    """Of each formula up to `size` signs."""
    rng = random.Random(seed)
    for name in SIGNED:
        turned_signs = list(flips(FORMULAS[name]))
        for turned in rng.sample(turned_signs, min(size, len(turned_signs))):
            wrong = "; ".join(faults(name, turned))
            yield Finding("fault" if wrong else "caught", f"{name}: {wrong}" if wrong else "", bool(wrong))


if __name__ == "__main__":
    survey.main(signs)
