"""The arm in motion from above, as a GIF: hub, bent link and reference to scale, with time and torque.

Frames are at least eight to a period of the first mode where that leaves the film short enough: a vibration that is
faster than the frames would be seen at a wrong frequency.
"""

import io
import math
from base64 import b64encode
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Circle
from PIL import Image

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.digits import plain
from tfarm.dsp import Simulation, Simulator, traces
from tfarm.errors import require
from tfarm.files import write_file
from tfarm.records import record
from tfarm.spectrum import modes

from .style import BLUE, GREY, INK, check_records, picture, settled, style

STATIONS, BETWEEN = 15, 4  # along the link; records between two samples, between two of which is a frame
RATE, PERIOD_FRAMES, MOST_FRAMES = 20, 8, 240  # frames: a second, least in a period of the first mode, most of a film
SEEN, DRAWN = 0.02, 0.1  # of the reach: largest deflection that is seen to scale, and largest of an exaggerated one
HUB, BEYOND, RIM, MOST = 0.05, 1.07, 0.1, 1.3  # of the reach: hub, end of the reference, edge, and largest picture
WIDTH, LETTERS, DOTS, INKS, WHITE = 4.6, 1.0, 104, 48, 250  # inches across, above and below; dots an inch; colours


class Motion(NamedTuple):
    """The motion of a run at each frame: `t` (n,) [s], and places x + i y [m] with the hub's axis at 0.

    `link` (n, m) are those of the drawn link, whose deflection is `factor` times the arm's, `reference` (n, 2) the ends
    of a line along the reference.  `speed` is that of the film, `still` the frame with the largest deflection.
    """

    arm: Arm
    run: Simulation
    t: Real
    link: Complex
    reference: Complex
    factor: int
    speed: float
    still: int

    def words(self, frame: int) -> str:
        """Time and input."""
        u = traces.held_at(self.run, self.run.torque, self.t[frame])
        return f"t = {self.t[frame]:.2f} s,  u = {u:.3g} {self.arm.input_unit}"


def motion_of(arm: Arm, run: Simulation, until: float = math.inf, most: int = MOST_FRAMES) -> Motion:
    """The motion of a run up to a time [s]: its torques are applied to the arm again, with more outputs."""
    require(run.t.size > 1, "run", run.t.size, "give a simulation with more than one sample")
    end, x = min(until, float(run.t[-1])), np.linspace(0.0, arm.length, STATIONS)
    torque = np.pad(run.torque, (0, run.scenario.t.size - run.torque.size))
    names = [f"deflection@{each!r}" for each in x.tolist()]
    again = Simulator(arm, run.chain, run.scenario, between=BETWEEN, outputs=names)
    found = again.controller(lambda measured: float(torque[measured.k]))
    wish = math.ceil(PERIOD_FRAMES * float(modes(arm, 1).natural_frequency_hz[-1]) / RATE)
    slower = min(max(1.0, wish), most / (RATE * end))
    t = np.arange(1 + round(RATE * slower * end)) / (RATE * slower)
    angle, *each = (np.interp(t, *traces.continuous(found, name)) for name in ("hub_angle", *names))
    deflection, from_axis = np.stack(each, axis=-1), arm.hub.radius + x
    factor = exaggeration(float(abs(deflection).max()) / arm.reach)
    link = np.exp(1j * angle)[:, None] * (from_axis + 1j * factor * deflection)
    wanted = np.exp(1j * traces.reference_angle(run.scenario, t))
    reference, still = np.outer(wanted, [arm.hub.radius, BEYOND * arm.reach]), int(np.argmax(abs(deflection[:, -1])))
    return Motion(arm, run, t, link, reference, factor, 1 / slower, still)


def exaggeration(share: float) -> int:
    """The factor of a deflection that is this share of the reach: 1 where it is seen, else 2, 5, 10, 20, ..."""
    decade = 10 ** math.floor(math.log10(DRAWN / share)) if 0 < share < SEEN else 0
    return max((step * decade for step in (1, 2, 5) if step * decade * share <= DRAWN), default=1) or 1


def _edges(motion: Motion) -> Real:
    """Least and largest x, and those of y [m]: all that the link and its reference reach, and the hub."""
    reach, places = motion.arm.reach, np.r_[motion.link.ravel(), motion.reference.ravel(), 0.0]
    ends = [[each.min() - RIM * reach, each.max() + RIM * reach] for each in (places.real, places.imag)]
    return np.clip(ends, -MOST * reach, MOST * reach)  # a loop that diverges leaves the picture


def _size(motion: Motion) -> tuple[float, float]:
    across, up = np.ptp(_edges(motion), axis=1)
    return WIDTH, LETTERS + WIDTH * min(1.0, up / across)


@picture(size=_size, title=lambda motion: f"{motion.arm.name}: {motion.run.scenario.name}, from above")
def draw_motion(motion: Motion, *, ax: Axes) -> None:
    """The arm from above at its largest deflection [m], thin its reference."""
    xlim, ylim = _edges(motion)
    ax.set(aspect="equal", xlim=xlim, ylim=ylim, xticks=[], yticks=[])
    ax.add_patch(Circle((0, 0), max(motion.arm.hub.radius, HUB * motion.arm.reach), fc="#e9e9e9", ec=INK, zorder=3))
    for places, colour, lw, mark in ((motion.reference, GREY, 0.9, ""), (motion.link, BLUE, 3.0, "s")):
        here = places[motion.still]
        ax.plot(here.real, here.imag, color=colour, lw=lw, solid_capstyle="butt", marker=mark, ms=6.0, markevery=[-1])
    scale = "deflection to scale" if motion.factor == 1 else f"deflection × {motion.factor}"
    speed = "" if motion.speed == 1 else f", speed × {plain(motion.speed, 2)}"
    ax.set_xlabel(f"hub to tip {plain(motion.arm.reach, 3)} m, thin: reference,\n{scale}{speed}")
    ax.set_title(motion.words(motion.still), loc="left", fontsize=9.0, color=INK)


@dataclass(frozen=True)
@record
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


def film(motion: Motion) -> Animation:
    """The film of a motion: the background is drawn once, all that moves or lies on what moves in each frame."""
    figure, stream, frames = draw_motion.figure(motion), io.BytesIO(), list[Image.Image]()
    with style():
        settled(figure)
        figure.set_dpi(DOTS)
        ax = figure.axes[0]
        canvas: Any = FigureCanvasAgg(figure)
        title = ax.set_title(motion.words(0), loc="left", fontsize=9.0, color=INK)
        drawn = sorted([*ax.lines, *ax.patches, *ax.spines.values(), title], key=lambda each: each.zorder)
        for each in drawn:
            each.set_animated(True)
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
        for frame in range(motion.t.size):
            canvas.restore_region(still)
            for line, places in zip(ax.lines, (motion.reference[frame], motion.link[frame]), strict=True):
                line.set_data(places.real, places.imag)
            title.set_text(motion.words(frame))
            for each in drawn:
                ax.draw_artist(each)
            frames.append(Image.fromarray(np.array(canvas.buffer_rgba())).convert("RGB"))
    # the colours of the first frame are those of all, where Pillow chooses 256 new ones for each
    colours = frames[0].quantize(INKS)
    colours.putpalette([255 if each >= WHITE else each for each in colours.getpalette() or ()])  # as the page's
    frames = [each.quantize(palette=colours, dither=Image.Dither.NONE) for each in frames]
    frames[0].save(stream, "gif", save_all=True, append_images=frames[1:], duration=1000 // RATE, loop=0)
    return Animation(motion.t.size, stream.getvalue())
