"""Pictures of records of tfarm: records in, matplotlib axes in and out::

    tfarm.plots.bode(tfarm.bode(arm, "root_moment"))              # a figure of its own; the axes are returned
    tfarm.plots.nyquist(tfarm.nyquist(arm, law), ax=axes)         # or in axes that are there

    with tfarm.plots.column(): ...                                # at the width of a paper's column

In the look of the report's pages, whose pictures these are.  This is the only room with matplotlib.

- `style`: colours, figures for a page, a phone or a column, legends, notes and ticks
- `labels`: words for controllers, and numbers with their units
- `files`: figures as PNG, SVG and PDF
- `arm_sketch`: the arm to scale
- `frequency`: responses, exact and measured
- `loop_function`: Bode, Nichols and Nyquist plots of the loop function, and sensitivities
- `roots`: root loci in the s-plane and the z-plane
- `regions`: stability regions of two gains
- `motion`: mode shapes, time responses, the gain tuner
- `animation`: the arm in motion, a GIF
- `studies`: distributions of a study
- `fronts`: speed against robustness
- `references`: a shaped reference, and its residual over the error of the frequency
"""

from tfarm.moved import moved
from tfarm.plots.animation import animate
from tfarm.plots.arm_sketch import sketch
from tfarm.plots.frequency import bode, measured_response
from tfarm.plots.fronts import trade_off
from tfarm.plots.loop_function import disc, loop, nichols, nyquist, sensitivity
from tfarm.plots.motion import modes, prediction, slew, step, tuned_gain
from tfarm.plots.references import reference
from tfarm.plots.regions import comparison, gain_map, gain_regions
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
    "gain_regions",
    "locus",
    "loop",
    "measured_response",
    "modes",
    "nichols",
    "nyquist",
    "prediction",
    "reference",
    "sensitivity",
    "sketch",
    "slew",
    "step",
    "study",
    "study_band",
    "study_scatter",
    "trade_off",
    "tuned_gain",
]

# names of version 1.0
__getattr__ = moved(
    __name__,
    {"measured": f"{__name__}:measured_response", "overlay": f"{__name__}:gain_regions"},
)
