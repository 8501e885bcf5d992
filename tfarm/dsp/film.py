"""The motion of a simulation from above, at the frames of a film: places of the link and of its reference.

Frames are at least eight to a period of the first mode where that leaves the film short enough: a vibration that is
faster than the frames would be seen at a wrong frequency.
"""

import math
from typing import NamedTuple

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.dsp import traces
from tfarm.dsp.simulate import Simulation, Simulator
from tfarm.errors import require
from tfarm.spectrum import modes

RATE = 20  # frames a second
MOST_FRAMES = 240  # of a film


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
    """Return the motion of a run up to a time [s]: its torques are applied to the arm again, with more outputs."""
    require(run.t.size > 1, "run", run.t.size, "give a simulation with more than one sample")
    end = min(until, float(run.t[-1]))
    # stations along the link
    x = np.linspace(0.0, arm.length, 15)
    names = [f"deflection@{each!r}" for each in x.tolist()]
    torque = np.pad(run.torque, (0, run.scenario.t.size - run.torque.size))
    # records between two samples, between two of which is a frame
    again = Simulator(arm, run.chain, run.scenario, between=4, outputs=names)
    found = again.controller(lambda measured: float(torque[measured.k]))
    # eight frames to a period of the first mode, as far as the film may be that long
    wish = math.ceil(8 * float(modes(arm, 1).natural_frequency_hz[-1]) / RATE)
    slower = min(max(1.0, wish), most / (RATE * end))
    t = np.arange(1 + round(RATE * slower * end)) / (RATE * slower)
    angle, *each = (np.interp(t, *traces.continuous(found, name)) for name in ("hub_angle", *names))
    deflection = np.stack(each, axis=-1)
    factor = exaggeration(float(abs(deflection).max()) / arm.reach)
    link = np.exp(1j * angle)[:, None] * (arm.hub.radius + x + 1j * factor * deflection)
    wanted = np.exp(1j * traces.reference_angle(run.scenario, t))
    reference = np.outer(wanted, [arm.hub.radius, 1.07 * arm.reach])
    return Motion(arm, run, t, link, reference, factor, 1 / slower, int(np.argmax(abs(deflection[:, -1]))))


def exaggeration(share: float) -> int:
    """Return the factor of a deflection that is this share of the reach: 1 where it is seen, else 2, 5, 10, 20, ...

    A deflection of 2 % of the reach is seen to scale; an exaggerated one is drawn as 10 % at most.
    """
    if not 0 < share < 0.02:
        return 1
    decade = 10 ** math.floor(math.log10(0.1 / share))
    return max((step * decade for step in (1, 2, 5) if step * decade * share <= 0.1), default=decade)
