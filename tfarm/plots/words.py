"""What several pictures write."""

from __future__ import annotations

from tfarm.arm import HubFeedback
from tfarm.arm.feedback import LISTED
from tfarm.arm.law import Law
from tfarm.digits import plain

NOT_THE_PAPERS = ("hub_angle",)  # outputs whose gain is an extension of the paper's law: named where it is used


def gains_words(law: HubFeedback | Law, digits: int = 4, but: str = "") -> str:
    """Each gain with its value, for reading; `but` names one that varies and is left out.  Another law by its name."""
    if isinstance(law, Law):
        return f"{law.name}, of {', '.join(law.signals)}"
    named = [gain.name for gain in LISTED if law[gain.name] or gain.output not in NOT_THE_PAPERS]
    return ", ".join(f"{name} = {plain(law[name], digits)}" for name in named if name != but)
