"""What several pictures write."""

from __future__ import annotations

from matplotlib.axes import Axes

from tfarm.arm import GAINS, LISTED, PLANE, AnyLaw, Arm, as_law, shown_unit
from tfarm.digits import plain

LYAPUNOV = "{} > 0, {} < 1".format(*PLANE)  # what the paper's argument proves at C = 0
NOT_THE_PAPERS = ("hub_angle",)  # outputs whose gain is an extension of the paper's law: named where it is used


def gains_words(law: AnyLaw, digits: int = 4, but: str = "") -> str:
    """Each gain with its value, for reading; `but` names one that varies and is left out.  Another law by its name."""
    any_law = as_law(law)
    if any_law.gains is None:
        return f"{any_law.name}, of {', '.join(any_law.signals)}"
    gains = any_law.gains
    named = [gain.name for gain in LISTED if gains[gain.name] or gain.output not in NOT_THE_PAPERS]
    return ", ".join(f"{name} = {plain(gains[name], digits)}" for name in named if name != but)


def name_axes(arm: Arm, ax: Axes) -> None:
    """Along the axes of the plane of gains: their names, what they act on, and their units."""
    outputs = {gain.name: gain.output.replace("_", " ") for gain in GAINS}
    across, up = (f"{name}, gain on the {outputs[name]} [{shown_unit(name, arm) or '−'}]" for name in PLANE)
    ax.set(xlabel=across, ylabel=up)
