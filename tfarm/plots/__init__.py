"""Pictures of records of tfarm: records in, matplotlib axes in and out::

    tfarm.plots.bode(tfarm.bode(arm, "root_moment"))              # a figure of its own; the axes are returned
    tfarm.plots.nyquist(tfarm.nyquist(arm, law), ax=axes)         # or in axes that are there

In the look of the report's pages, whose pictures these are.  This is the only room with matplotlib.
"""

from tfarm.plots.frequency import bode, measured, nyquist
from tfarm.plots.motion import modes, sketch, slew, step, tuned_gain
from tfarm.plots.regions import comparison, gain_map, overlay
from tfarm.plots.roots import locus

__all__ = [
    "bode",
    "comparison",
    "gain_map",
    "locus",
    "measured",
    "modes",
    "nyquist",
    "overlay",
    "sketch",
    "slew",
    "step",
    "tuned_gain",
]
