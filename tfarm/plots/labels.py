"""Words of pictures: a controller with its gains, and numbers of a controller or an arm with their units."""

from collections.abc import Sequence

from matplotlib.axes import Axes

from tfarm.arm import GAINS, LISTED, Arm, Law, shown_unit
from tfarm.arm.law import NUMBER
from tfarm.digits import plain
from tfarm.exact.outputs import signal_words, unit_over
from tfarm.loop.sampled import Sampled
from tfarm.loop.varied import ARM_PARAMETERS
from tfarm.plots.style import safe


def law_words(law: Law) -> str:
    """Return the name of a controller, where it has one of its own."""
    # which is that of one without a name
    return "the controller" if law.name == "law" else law.name


def gains_words(law: Law, digits: int = 4, but: str = "") -> str:
    """Return each gain with its value; `but` names one that varies and is left out.  Of another law its name."""
    gains = law.gains
    if gains is None:
        return f"{law_words(law)}, of {', '.join(law.signals)}"
    # beyond the paper's law
    named = [gain.name for gain in LISTED if gains[gain.name] or gain.output != "hub_angle"]
    return ", ".join(f"{name} = {plain(gains[name], digits)}" for name in named if name != but)


def number_label(name: str, arm: Arm, law: Law) -> str:
    """Return a number of a controller or of the arm with its SI unit, for an axis.

    The coefficient of s^k in the denominator counts as s^k, in the numerator as the unit of a gain times s^k.
    """
    for gain in GAINS:
        if gain.name == name:
            return with_unit(f"{name}, gain on the {signal_words(gain.output)[0]}", shown_unit(name, arm))
    other_units = ARM_PARAMETERS | {"delay": "s"}
    if name in other_units:
        return with_unit(name.replace("_", " "), other_units[name])
    signal, of, place = NUMBER.fullmatch(name).groups("")  # type: ignore[union-attr]
    if not place and signal not in law.part_gains:
        words = "controller" if signal in ("gain", "all") else signal_words(signal)[0]
        return with_unit(f"{name}, factor on the {words}")
    (block,) = (part.block for part in law.parts if part.signals == (signal,))
    power = 0
    if place and not law.is_discrete:
        power = len(getattr(block, of)) - 1 - int(place)
    time = {0: "", 1: "s"}.get(power, f"s^{power}")
    if of == "den":
        return with_unit(name, time)
    unit = unit_over(arm.input_unit, signal_words(signal)[1])
    if unit and time:
        return with_unit(name, f"({unit}) {time}")
    return with_unit(name, unit or time)


def with_unit(label: str, unit: str | None = "") -> str:
    """Return a label with its unit in brackets, a dash where there is none."""
    return f"{label} [{unit or '−'}]"


def period_words(loop: Sampled) -> str:
    """Return the sampling period of a loop."""
    return f"every {plain(1e3 * loop.chain.sampling.period)} ms"


def name_axes(vary: Sequence[str], arm: Arm, law: Law, ax: Axes) -> None:
    """Write along the axes of a plane of two numbers their names and units."""
    across, up = (safe(number_label(name, arm, law)) for name in vary)
    ax.set(xlabel=across, ylabel=up)
