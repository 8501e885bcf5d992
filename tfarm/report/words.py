"""What several sections say the same way."""

from __future__ import annotations

import re

from tfarm.digits import plain, significant

TYPESET = {
    "theta_t^2": "(dθ/dt)²", "theta_t": "dθ/dt", "phi_xt(0)": "∂φ′(0)/∂t", "L(iw)": "L(iω)", "J w1": "J ω₁",
    "(alpha_c, eta_c)": "momentum and learning rate",
}  # fmt: skip
POWER_WRITTEN, MINUS_WRITTEN = re.compile(r"\d(?:\.\d+)?e[-+]\d+"), re.compile(r"(?<= )-(?=\w)")


def typeset(text: str) -> str:
    """A sentence of the rooms below as a page shows it: Greek letters, powers of ten, and minus signs."""
    for plain_text, shown in TYPESET.items():
        text = text.replace(plain_text, shown)
    return MINUS_WRITTEN.sub("−", POWER_WRITTEN.sub(lambda number: plain(float(number[0])), text))


def residual_words(rms: float | None) -> str:
    """The root moment left after a slew [N m]; None where the loop ran away."""
    return "not computed (the loop ran away)" if rms is None else f"{significant(rms, 3)} N m rms"


def upper(text: str) -> str:
    """A text as it begins a sentence."""
    return text[:1].upper() + text[1:]
