"""The control law, as a record.

    u = -Kp theta - K1 theta_t - K2 E I phi'(0) + r                                                            (19)

Sign convention, everywhere in tfarm: E I phi'(0) is the elastic moment at the root as a strain gauge reads it, positive
where it accelerates the hub; a static torque u gives it the value -(J - I_h)/J u.  Reversing the gauge mirrors K2.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from tfarm.arm.checks import LARGEST, number
from tfarm.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class HubFeedback:
    """Feedback at the hub: `K1` [N m s/rad] on the hub rate, `K2` [-] on the root moment, `Kp` [N m/rad] on the angle.

    Kp is an extension of the paper's law (19), which leaves the angle itself alone.  Raises ParameterError for what is
    no finite number or would overflow; whether a gain is too large for an arm is judged in that arm's own units, where
    the loop is closed.
    """

    K1: float = 0.0
    K2: float = 0.0
    Kp: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            remedy = f"a gain is a finite number, at most {LARGEST:g} in size"
            value = number(field.name, getattr(self, field.name), remedy)
            if not abs(value) <= LARGEST:
                raise ParameterError(key=field.name, value=value, remedy=remedy)
            object.__setattr__(self, field.name, value)
