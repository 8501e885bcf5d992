"""What several sections say the same way."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from tfarm.crossing import Window
from tfarm.digits import plain, significant
from tfarm.dsp.chain import Chain
from tfarm.dsp.crossings import around

EVERYWHERE = (-math.inf, math.inf)  # gains of any size: an interval that has no end but its own

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


def in_ms(chain: Chain) -> str:
    """The sampling period in ms."""
    return plain(1e3 * chain.sampling.period)


def spans(windows: Sequence[Window], gain: float, here: Window | None = None) -> str:
    """The interval around a gain in a few digits, or the others where there is none around it."""
    here = here or around(list(windows), gain)
    if here is not None:
        return span(here)
    others = " or ".join(span(window) for window in windows)
    return f"{others}, not {plain(gain, 3)}" if others else "none"


def span(window: Window | None, looked_at: Window = EVERYWHERE) -> str:
    """An interval of a gain in a few digits; an end of what was looked at is no end."""
    if window is None:
        return "none"
    low, high = window
    no_low, no_high = low <= looked_at[0], high >= looked_at[1]
    if no_low:
        return "any" if no_high else f"< {significant(high, 4)}"
    lower = f"{low:.2g}".replace("-", "−") if 1e-4 < abs(low) < 1e-3 else significant(low, 3)
    return f"> {lower}" if no_high else f"{lower} … {significant(high, 4)}"
