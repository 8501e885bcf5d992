"""The arm in motion from above, as a GIF: hub, bent link and reference to scale, with time and torque."""

import io
from base64 import b64encode
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Circle
from PIL import Image

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.digits import plain
from tfarm.dsp import Simulation
from tfarm.dsp.traces import RATE, Motion, motion_of
from tfarm.files import write_file
from tfarm.plots.files import fix_layout
from tfarm.plots.style import BLUE, GREY, INK, check_records, picture, plot_complex, style
from tfarm.records import frozen


def _edges(motion: Motion) -> Real:
    """Return least and largest x, and those of y [m]: all that the link and its reference reach, and the hub."""
    reach = motion.arm.reach
    places = np.r_[motion.link.ravel(), motion.reference.ravel(), 0.0]
    low = np.array([places.real.min(), places.imag.min()])
    high = np.array([places.real.max(), places.imag.max()])
    ends = np.column_stack([low - 0.1 * reach, high + 0.1 * reach])
    # a loop that diverges leaves the picture
    return np.clip(ends, -1.3 * reach, 1.3 * reach)


def _size(motion: Motion, width: float = 4.6) -> tuple[float, float]:
    across, up = np.ptp(_edges(motion), axis=1)
    # an inch of letters above and below
    return width, 1.0 + width * min(1.0, up / across)


@picture(size=_size, title=lambda motion: f"{motion.arm.name}: {motion.run.scenario.name}, from above")
def draw_motion(motion: Motion, *, ax: Axes) -> None:
    """Draw the arm from above at its largest deflection [m], thin its reference."""
    arm = motion.arm
    xlim, ylim = _edges(motion)
    ax.set(aspect="equal", xlim=xlim, ylim=ylim, xticks=[], yticks=[])
    ax.add_patch(Circle((0, 0), max(arm.hub.radius, 0.05 * arm.reach), fc="#e9e9e9", ec=INK, zorder=3))
    plot_complex(motion.reference[motion.still], ax, color=GREY, lw=0.9, solid_capstyle="butt")
    link = motion.link[motion.still]
    plot_complex(link, ax, color=BLUE, lw=3.0, solid_capstyle="butt", marker="s", ms=6.0, markevery=[-1])
    scale = "deflection to scale"
    if motion.factor != 1:
        scale = f"deflection × {motion.factor}"
    speed = ""
    if motion.speed != 1:
        speed = f", speed × {plain(motion.speed, 2)}"
    ax.set_xlabel(f"hub to tip {plain(arm.reach, 3)} m, thin: reference,\n{scale}{speed}")
    ax.set_title(motion.words(motion.still), loc="left", fontsize=9.0, color=INK)


@frozen
class Animation:
    """A film of a run: the bytes of a GIF of `frames` frames, 20 a second; a notebook plays it."""

    frames: int
    gif: bytes

    def save(self, file: str | Path) -> None:
        """Write the GIF.  Raises ParameterError where it cannot be written."""
        write_file(Path(file), self.gif, key="--animate")

    def _repr_html_(self) -> str:
        text = b64encode(self.gif).decode("ascii")
        return f'<img src="data:image/gif;base64,{text}" alt="The arm in motion, from above">'


def animate(arm: Arm, run: Simulation) -> Animation:
    """Return a film of a simulation: hub, bent link and reference from above, with time and input.

    Parameters
    ----------
    arm
        The arm of the simulation.
    run
        What `tfarm.simulate` returns.

    Returns
    -------
    Animation
        A GIF with 20 frames a second, the same bytes on every run.  The link is to scale; where its deflection would
        not be seen it is drawn larger by a factor which the picture names, as it does the speed of the film: at most
        240 frames, and eight to a period of the first mode where these suffice.

    Raises
    ------
    ParameterError
        For other records, and for a simulation of a single sample.

    Examples
    --------
    >>> arm = tfarm.load("sasaki2012-lab")
    >>> tfarm.plots.animate(arm, tfarm.simulate(arm, tfarm.default_gains(arm))).save("slew.gif")
    """
    check_records(((Arm, "tfarm.load returns"), (Simulation, "tfarm.simulate returns")), (arm, run))
    return film(motion_of(arm, run))


def film(motion: Motion, dpi: int = 104) -> Animation:
    """Return the film of a motion, of `dpi` dots an inch.

    The background is drawn once, all that moves or lies on it in each frame.
    """
    figure = draw_motion.figure(motion)
    frames: list[Image.Image] = []
    with style():
        fix_layout(figure)
        figure.set_dpi(dpi)
        canvas: Any = FigureCanvasAgg(figure)
        (ax,) = figure.axes
        title = ax.set_title(motion.words(0), loc="left", fontsize=9.0, color=INK)
        drawn = sorted([*ax.lines, *ax.patches, *ax.spines.values(), title], key=lambda each: each.zorder)
        for each in drawn:
            each.set_animated(True)
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
        for frame in range(motion.t.size):
            canvas.restore_region(still)
            for line, places in zip(ax.lines, (motion.reference, motion.link), strict=True):
                here = places[frame]
                line.set_data(here.real, here.imag)
            title.set_text(motion.words(frame))
            for each in drawn:
                ax.draw_artist(each)
            pixels = np.array(canvas.buffer_rgba())
            frames.append(Image.fromarray(pixels).convert("RGB"))
    # the 48 colours of the first frame are those of all, where Pillow chooses 256 new ones for each
    # almost white is white, as the page is
    colours = frames[0].quantize(48)
    colours.putpalette([255 if each >= 250 else each for each in colours.getpalette() or ()])
    first, *others = (each.quantize(palette=colours, dither=Image.Dither.NONE) for each in frames)
    stream = io.BytesIO()
    first.save(stream, "gif", save_all=True, append_images=others, duration=1000 // RATE, loop=0)
    return Animation(motion.t.size, stream.getvalue())
