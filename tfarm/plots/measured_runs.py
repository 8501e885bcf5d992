"""Measured runs on a rig, and over each the exact sampled loop that was led by the same reference."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from tfarm.fitting.runs import Beside

from .style import BLUE, GREY, ORANGE, blank, headline, safe, style


def draw_beside(title: str, each: Mapping[str, Beside]) -> Figure:
    """A column a law: hub angle above, root moment below where it was measured."""
    moment = any(found.measured.root_moment.size for found in each.values())
    with style():
        figure = blank(max(4.7 * len(each), 6.0), 6.0 if moment else 3.6)
        axes = figure.subplots(1 + moment, len(each), sharex="col", sharey="row", squeeze=False)
        for column, (name, found) in enumerate(each.items()):
            measured, ax = found.measured, axes[0, column]
            ax.plot(measured.t, np.degrees(measured.reference), color=GREY, lw=1.0, ls=(0, (4, 3)), label="reference")
            if measured.hub_angle.size:
                ax.plot(measured.t, np.degrees(measured.hub_angle), color=ORANGE, label="measured")
            ax.plot(found.run.t, np.degrees(found.hub_angle), color=BLUE, lw=1.2, label="exact sampled loop")
            ax.set_xlim(0.0, float(measured.t[-1]))
            if moment and measured.root_moment.size:
                axes[1, column].plot(measured.t, measured.root_moment, color=ORANGE)
            if moment:
                axes[1, column].plot(found.run.t, found.run.at_samples.root_moment, color=BLUE, lw=1.2)
                axes[1, column].axhline(0.0, color=GREY, lw=0.6)
            ax.set_title(safe(name), fontsize=9.5)
            axes[-1, column].set_xlabel("time  [s]")
        axes[0, 0].set_ylabel("hub angle  [deg]")
        if moment:
            axes[1, 0].set_ylabel("root moment  [N m]")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
        headline(figure, title)
    return figure
