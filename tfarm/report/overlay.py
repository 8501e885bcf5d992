"""The plane of both gains twice on the same axes: where the continuous loop is stable, and where the sampled one is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tfarm.arm import PLANE, shown_unit
from tfarm.columns import Column, Table
from tfarm.comparing.regions import K2_RANGE, StableRegions
from tfarm.digits import plain
from tfarm.plots import regions
from tfarm.plots.style import blank, headline, style

if TYPE_CHECKING:
    from tfarm.plots.style import Figure


def draw_overlay(data: StableRegions) -> Figure:
    """The picture of this tool: a continuous region and a sampled one on the same axes."""
    with style():
        figure = blank(9.0, 5.4)
        unit = data.continuous.arm.input_per_torque
        regions.overlay(*data, ax=figure.subplots()).set_ylim(*(unit * end for end in K2_RANGE))
        ms = plain(1e3 * data.sampled[0].loop.chain.sampling.period)
        name = data.continuous.arm.name
        headline(figure, f"{name}: gains that keep the loop stable, continuous and sampled every {ms} ms")
    return figure


def overlay_table(data: StableRegions, stem: str) -> Table:
    """The numbers of the picture: at each value of the gain across the ends of the stable intervals of the other."""
    own = data.continuous.arm.damping
    each = {"continuous_K2_intervals": data.continuous.stable_intervals}
    for plane in data.sampled:
        C = plane.loop.plant.arm.damping
        each["sampled_K2_intervals" if own == C else f"sampled_at_C_{C:g}_s"] = plane.stable_intervals
    columns = [
        Column(key, key, of=[tuple(float(end) for window in column for end in window) for column in intervals])
        for key, intervals in each.items()
    ]
    across, up = PLANE
    values = Column(across, across, shown_unit(across, data.continuous.arm), of=data.continuous.axes[0])
    title = f"Stable intervals of {up}, continuous and sampled"
    return Table(stem=stem, title=title, columns=(values, *columns))
