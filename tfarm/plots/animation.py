"""The arm in motion from above, as a GIF: hub, bent link and reference to scale, with the torque over time.

Frames are at least eight to a period of the first mode where that leaves the film short enough: a vibration that is
faster than the frames would be seen at a wrong frequency.
"""

import math
from base64 import b64encode
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Circle

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.digits import plain
from tfarm.dsp import Simulation, Simulator, traces
from tfarm.files import write_file
from tfarm.records import record
from tfarm.spectrum import modes

from .style import BLUE, FAINT, GREY, INK, Figure, check_records, picture, settled, style

STATIONS = 15  # along the link
BETWEEN = 4  # records between two samples: a frame is between two of them
RATE = 20  # frames a second of the film
PERIOD_FRAMES, MOST_FRAMES = 8, 240  # least frames in a period of the first mode, and most of a film
SEEN, DRAWN = 0.02, 0.1  # of the reach: largest deflection that is seen to scale, and largest of an exaggerated one
STEPS = (1, 2, 5)  # of each decade: exaggerations
DOTS, INKS = 80, 48  # an inch: 480 across; and colours
BEYOND = 1.07  # of the reach: end of the line of the reference
HUB = 0.05  # radius of the drawn hub where the link begins at the axis, as a share of the reach


class Motion(NamedTuple):
    """The motion at each frame: `t` (n,) [s], `torque` (n,), hub angle and its reference (n,) [rad].

    `deflection` (n, m) [m] is that at `x` (m,) [m] from the hub's axis; `factor` is that with which it is drawn,
    `speed` that of the film.
    """

    arm: Arm
    name: str
    t: Real
    torque: Real
    angle: Real
    reference: Real
    x: Real
    deflection: Real
    factor: int
    speed: float

    def link(self, frame: int) -> Real:
        """Both coordinates of the drawn link (2, m) [m], the hub's axis at the origin."""
        along, across = np.array([1.0, 1j]) * np.exp(1j * self.angle[frame])
        places = self.x * along + self.factor * self.deflection[frame] * across
        return np.array([places.real, places.imag])

    def wanted(self, frame: int) -> Real:
        """Both coordinates of the ends of a line along the reference (2, 2) [m], a little longer than the arm."""
        angle = self.reference[frame]
        return np.outer([math.cos(angle), math.sin(angle)], [self.x[0], BEYOND * self.x[-1]])

    def words(self, frame: int) -> str:
        """Time and input."""
        return f"t = {self.t[frame]:.2f} s,  u = {self.torque[frame]:.3g} {self.arm.input_unit}"


def motion_of(arm: Arm, run: Simulation) -> Motion:
    """The motion of a run at the frames of its film: its torques are applied to the arm again, with more outputs."""
    end, x, torque = float(run.t[-1]), np.linspace(0.0, arm.length, STATIONS), np.zeros(run.scenario.t.size)
    torque[: run.torque.size] = run.torque
    names = [f"deflection@{each!r}" for each in x.tolist()]
    again = Simulator(arm, run.chain, run.scenario, between=BETWEEN, outputs=names)
    found = again.controller(lambda measured: float(torque[measured.k]))
    wish = PERIOD_FRAMES * float(modes(arm, 1).natural_frequency_hz[-1]) / RATE
    slower = min(max(1.0, math.ceil(wish)), MOST_FRAMES / (RATE * end))
    t = np.arange(1 + round(RATE * slower * end)) / (RATE * slower)
    angle, *deflections = (np.interp(t, *traces.continuous(found, name)) for name in ("hub_angle", *names))
    deflection = np.stack(deflections, axis=-1)
    return Motion(
        arm, run.scenario.name, t, traces.held_at(run, run.torque, t), angle, traces.reference_angle(run.scenario, t),
        arm.hub.radius + x, deflection, exaggeration(float(abs(deflection).max()) / arm.reach), 1 / slower,
    )  # fmt: skip


def exaggeration(share: float) -> int:
    """The factor of a deflection that is this share of the reach: 1 where it is seen, else 2, 5, 10, 20, ..."""
    if not 0 < share < SEEN:
        return 1
    decade = 10 ** math.floor(math.log10(DRAWN / share))
    return max(step * decade for step in STEPS if step * decade * share <= DRAWN)


def _still(motion: Motion) -> int:
    """The frame with the largest deflection of the tip."""
    return int(np.argmax(abs(motion.deflection[:, -1])))


def _size(motion: Motion) -> tuple[float, float]:
    left, right, low, high = _frame(motion)
    return 6.0, 1.9 + min(4.5, 5.6 * (high - low) / (right - left))


def _frame(motion: Motion) -> tuple[float, float, float, float]:
    """Edges of the picture [m]: all that the link and its reference reach, and the hub."""
    every = range(motion.t.size)
    places = np.concatenate([part(each) for each in every for part in (motion.link, motion.wanted)], axis=1)
    rim, most = 0.12 * motion.arm.reach, 1.3 * motion.arm.reach  # a loop that diverges leaves the picture
    low, high = np.clip([places.min(axis=1), places.max(axis=1)], -most, most)
    (left, low), (right, high) = np.minimum(low, 0.0) - rim, np.maximum(high, 0.0) + rim
    return left, right, low, high


@picture(
    size=_size, title=lambda motion: f"{motion.arm.name}: {motion.name}, from above",
    grid=lambda figure, motion: figure.subplots(2, height_ratios=(_size(motion)[1] - 1.9, 0.75)),
)  # fmt: skip
def draw_motion(motion: Motion, *, ax: tuple[Axes, Axes]) -> None:
    """The arm from above at its largest deflection [m], thin its reference; below the input over time."""
    above, below = ax
    left, right, low, high = _frame(motion)
    above.set(aspect="equal", xlim=(left, right), ylim=(low, high), xlabel="[m]")
    frame, hub = _still(motion), max(motion.arm.hub.radius, HUB * motion.arm.reach)
    above.add_patch(Circle((0, 0), hub, fc="#e9e9e9", ec=INK, lw=1.2, zorder=3))
    above.plot(*motion.wanted(frame), color=GREY, lw=0.9)
    above.plot(*motion.link(frame), color=BLUE, lw=3.0, solid_capstyle="butt", marker="s", ms=6.0, markevery=[-1])
    scale = "deflection to scale" if motion.factor == 1 else f"deflection × {motion.factor}"
    speed = "" if motion.speed == 1 else f",  speed × {plain(motion.speed, 2)}"
    above.set_title(scale + speed, loc="right", fontsize=9.0, color=INK)
    above.text(0.0, 1.02, motion.words(frame), transform=above.transAxes, fontsize=9.0, color=INK)
    below.axhline(0.0, color=FAINT, lw=0.8)
    below.step(motion.t, motion.torque, where="post", color=INK, lw=1.0)
    below.plot(motion.t[[frame]], motion.torque[[frame]], "o", color=BLUE, ms=5.0)
    below.set(xlim=(0.0, motion.t[-1]), xlabel="time [s]", ylabel=f"u [{motion.arm.input_unit}]")


def move_to(motion: Motion, frame: int, figure: Figure) -> None:
    """Move what is drawn to another frame."""
    above, below = figure.axes
    for line, places in zip(above.lines, (motion.wanted(frame), motion.link(frame)), strict=True):
        line.set_data(*places)
    above.texts[0].set_text(motion.words(frame))
    below.lines[-1].set_data(motion.t[[frame]], motion.torque[[frame]])


def keep_still(figure: Figure) -> None:
    """Make one image of all that does not move: axes with their numbers take ten times as long as the rest."""
    settled(figure)
    figure.set_dpi(DOTS)
    canvas: Any = FigureCanvasAgg(figure)
    above, below = figure.axes
    moving = [*above.lines, *above.texts, below.lines[-1]]
    for each in moving:
        each.set_visible(False)
    canvas.draw()
    image = np.array(canvas.buffer_rgba())
    for each in (*figure.texts, *below.lines[:-1]):
        each.remove()
    for ax in figure.axes:
        ax.set_title("", loc="right")
        ax.set_axis_off()
    for each in moving:
        each.set_visible(True)
    figure.figimage(image, zorder=-1)  # below the axes


@dataclass(frozen=True)
@record
class Animation:
    """A film of a run: the bytes of a GIF of `frames` frames, 20 a second; a notebook plays it."""

    arm: Arm
    frames: int
    gif: bytes

    def save(self, file: str | Path) -> None:
        """Write the GIF.  Raises ParameterError where it cannot be written."""
        write_file(Path(file), self.gif, key="--animate")

    def _repr_html_(self) -> str:
        text = b64encode(self.gif).decode("ascii")
        return f'<img src="data:image/gif;base64,{text}" alt="The arm in motion, from above">'


def animate(arm: Arm, run: Simulation) -> Animation:
    """Return a film of a simulation: hub, bent link and reference from above, and the input over time.

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
        For other records.

    Examples
    --------
    >>> arm = tfarm.load("sasaki2012-lab")
    >>> tfarm.plots.animate(arm, tfarm.simulate(arm, tfarm.default_gains(arm))).save("slew.gif")
    """
    check_records(((Arm, "tfarm.load returns"), (Simulation, "tfarm.simulate returns")), (arm, run))
    return film(motion_of(arm, run))


def film(motion: Motion) -> Animation:
    """The film of a motion."""
    figure, writer = draw_motion.figure(motion), Writer(fps=RATE)
    with style(), TemporaryDirectory() as folder:
        keep_still(figure)
        file = Path(folder, "film.gif")
        with writer.saving(figure, str(file), DOTS):
            for frame in range(motion.t.size):
                move_to(motion, frame, figure)
                writer.grab_frame()
        return Animation(motion.arm, motion.t.size, file.read_bytes())


class Writer(PillowWriter):
    """One that writes the colours of the first frame once, where Pillow chooses 256 new ones for each."""

    _frames: list[Any]

    def finish(self) -> None:
        """Write the file."""
        first, *others = self._frames
        palette = first.quantize(INKS)
        self._frames = [palette, *(each.quantize(palette=palette, dither=0) for each in others)]
        super().finish()
