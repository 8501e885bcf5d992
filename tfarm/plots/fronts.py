"""Picture of the front of speed against robustness."""

import numpy as np

from tfarm.plots.style import BLUE, GREY, INK, Axes, picture, plain_ticks
from tfarm.synthesis.trade_off import TradeOff


@picture(
    (TradeOff, "tfarm.trade_off returns"),
    title=lambda found: f"{found.arm}: speed against robustness, {found.structure}",
)
def trade_off(found: TradeOff, *, ax: Axes) -> None:
    """Draw the dominant time constant over the robustness: met limits as dots, others as rings, good as a line."""
    robustness = np.array([each.robustness for each in found.points])
    speed = np.array([each.time_constant for each in found.points])
    is_met = np.array([each.is_met for each in found.points])
    ax.set(yscale="log", xlabel="robustness, limits over those of the grade good [−]")
    ax.set(ylabel="dominant time constant of the sampled loop [s]")
    ax.axvline(1.0, color=GREY, lw=1.0, ls=(0, (5, 3)), label="good: 6 dB, 45°, one period, Ms 2")
    ax.plot(
        robustness[is_met],
        speed[is_met],
        "o-",
        color=BLUE,
        ms=6,
        lw=1.2,
        label="limits met by the exact loops",
    )
    if not is_met.all():
        label = "not met: least violation"
        ax.plot(robustness[~is_met], speed[~is_met], "o", mfc="white", mec=INK, ms=6, label=label)
    plain_ticks(ax.yaxis)
    ax.legend()
