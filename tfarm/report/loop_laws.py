"""The laws that the loop's sections speak of: the default gains, and the best that `tfarm design` finds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from tfarm.arm import Arm, HubFeedback
from tfarm.errors import ConvergenceError
from tfarm.loop.design import Design, design
from tfarm.loop.margins import Margins, margins
from tfarm.report.digits import plain
from tfarm.spectrum.scales import default_gains

MODES = 2  # flexible modes in the band of the damping that is drawn and designed for, as `tfarm design` has it
SIGN = (
    "Law: u = −K1 dθ/dt − K2 E I φ′(0) + r. Sign of K2: the strain gauge reads E I φ′(0), positive where it "
    "accelerates the hub; a torque u at rest gives −(J − I_h)/J u. With the gauge reversed every K2 changes its sign."
)


TYPESET = {
    "theta_t^2": "(dθ/dt)²", "theta_t": "dθ/dt", "phi_xt(0)": "∂φ′(0)/∂t", "L(iw)": "L(iω)",
    "J w1": "J ω₁", " = -": " = −",
}  # fmt: skip


def typeset(text: str) -> str:
    """A sentence of the loop room as a page shows it."""
    for plain_text, shown in TYPESET.items():
        text = text.replace(plain_text, shown)
    return text


@dataclass(frozen=True, slots=True)
class NamedLaw:
    """A law and what it is called in words and in keys."""

    name: str
    key: str
    law: HubFeedback

    @property
    def gains(self) -> str:
        """K1 = ..., K2 = ..., for reading."""
        return f"K1 = {plain(self.law.K1, 4)}, K2 = {plain(self.law.K2, 4)}"


def has_loop(arm: Arm) -> bool:
    """Whether both gains can be closed: the hub can turn, and has inertia."""
    return not arm.is_locked and arm.hub.inertia > 0


def why_no_loop(arm: Arm) -> str:
    """One sentence for an arm whose gains cannot be closed."""
    if arm.is_locked:
        return "The hub of this arm is locked: it takes no torque, so there is no loop to close and no gain to choose."
    return (
        "The hub of this arm has no inertia: its root moment is −u at every instant, so feeding it back by K2 would "
        "be an algebraic loop, and there is no map of K1 and K2."
    )


@lru_cache(maxsize=16)
def best(arm: Arm) -> Design | None:
    """What `tfarm design ARM` finds; None where no gains within its bounds are stable."""
    try:
        return design(arm, modes=MODES)
    except ConvergenceError:
        return None


@lru_cache(maxsize=64)
def margins_of(arm: Arm, law: HubFeedback) -> Margins:
    """Verdict and margins, computed once for all sections."""
    return margins(arm, law)


def laws(arm: Arm) -> tuple[NamedLaw, ...]:
    """The default gains, and the best ones if there are any."""
    found = best(arm)
    default = NamedLaw("default gains", "default", default_gains(arm))
    return (default,) if found is None else (default, NamedLaw("best damping", "best", found.law))
