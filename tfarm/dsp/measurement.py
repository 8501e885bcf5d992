"""What a controller gets at each sample, and the torque that gains at the hub ask for of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from tfarm.arm import ANGLE_GAIN, RATE_GAIN, HubFeedback
from tfarm.errors import ParameterError


class Measurement(NamedTuple):
    """What a controller gets at sample `k`, time `t` [s]: what the sensors read, and what is wanted.

    `vibration` is the root moment less `rigid_moment` (the paper's x under either reading of it); `feedforward` is r.
    """

    k: int
    t: float
    hub_angle: float
    hub_rate: float
    root_moment: float
    vibration: float
    feedforward: float
    angle_reference: float
    rate_reference: float
    rigid_moment: float

    def servo(self, law: HubFeedback) -> float:
        """What a law asks of the input [N m] for the hub's angle and rate, as they are off what is wanted.

        Raises ParameterError for a law with a gain on what is not measured here.
        """
        if not law.is_at_hub:
            name = law.elsewhere[0].name
            remedy = "a controller of samples has hub angle, hub rate and root moment alone; set it to 0"
            raise ParameterError(key=name, value=law[name], remedy=remedy)
        angle_off, rate_off = self.angle_reference - self.hub_angle, self.rate_reference - self.hub_rate
        return law[ANGLE_GAIN] * angle_off + law[RATE_GAIN] * rate_off

    def asked(self, law: HubFeedback, moment_gain: float) -> float:
        """What is fed forward and what the servo asks, less the gain at this sample times the vibration."""
        return self.feedforward + self.servo(law) - moment_gain * self.vibration


Controller = Callable[[Measurement], float]
