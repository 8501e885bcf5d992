"""A shaped reference, and the residual that it leaves over the error of the frequency."""

from collections.abc import Sequence

from tfarm.plots.motion import over_time
from tfarm.plots.style import BLUE, GREY, Axes, picture, safe
from tfarm.references import ShapedReference


@picture(
    (ShapedReference, "tfarm.reference returns"),
    size=(7.0, 5.4),
    grid=lambda figure, _: figure.subplots(2, 1),
    title=lambda found: f"{safe(found.controller.arm)}: {found.profile} slew, shaper {found.shaper}",
)
def reference(found: ShapedReference, *, ax: Sequence[Axes]) -> None:
    """Draw the reference of the hub rate and the residual over frequency error (of `tfarm.reference`) in two axes.

    The profile alone is grey.
    """
    tasks = {"profile": (found.plain, GREY), f"shaper {found.shaper}": (found.nominal, BLUE)}
    t = found.nominal.t[found.nominal.t <= 1.2 * found.nominal.busy_until]
    over_time(ax[0], t, "hub rate [rad/s]")
    for label, (task, colour) in tasks.items():
        ax[0].plot(task.t[: t.size], task.hub_rate[: t.size], color=colour, lw=1.2, label=label)
    ax[1].plot(100 * found.errors, found.unshaped_residuals, color=GREY, lw=1.2)
    ax[1].plot(100 * found.errors, found.residuals, color=BLUE, lw=1.2)
    ax[1].set(xlabel="frequency error [%]", ylabel="residual moment [N m rms]", ylim=(0, None))
