"""Pictures of records of tfarm: records in, matplotlib axes in and out::

    tfarm.plots.bode(tfarm.bode(arm, "root_moment"))              # a figure of its own; the axes are returned
    tfarm.plots.nyquist(tfarm.nyquist(arm, law), ax=axes)         # or in axes that are there

    with tfarm.plots.column(): ...                                # at the width of a paper's column

In the look of the report's pages, whose pictures these are.  This is the only room with matplotlib.
"""

from tfarm.plots.animation import animate
from tfarm.plots.arm_sketch import sketch
from tfarm.plots.frequency import bode, measured
from tfarm.plots.loop_function import disc, loop, nichols, nyquist, sensitivity
from tfarm.plots.motion import modes, slew, step, tuned_gain
from tfarm.plots.regions import comparison, gain_map, overlay
from tfarm.plots.roots import locus
from tfarm.plots.studies import study, study_band, study_scatter
from tfarm.plots.style import column

__all__ = [
    "animate",
    "bode",
    "column",
    "comparison",
    "disc",
    "gain_map",
    "locus",
    "loop",
    "measured",
    "modes",
    "nichols",
    "nyquist",
    "overlay",
    "sensitivity",
    "sketch",
    "slew",
    "step",
    "study",
    "study_band",
    "study_scatter",
    "tuned_gain",
]
