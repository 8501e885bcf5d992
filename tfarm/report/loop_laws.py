"""The laws that the loop's sections speak of: the default gains, and the best that `tfarm design` finds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, HubFeedback, input_words
from tfarm.digits import plain, significant
from tfarm.dsp import Chain
from tfarm.dsp.verdict import SampledBrief, sampled_brief
from tfarm.errors import ConvergenceError
from tfarm.loop.margins import Margins, margins
from tfarm.plots.words import gains_words
from tfarm.response import transfer
from tfarm.spectrum.table import default_gains
from tfarm.synthesis.design import Design, design

DESIGNED_MODES = 2  # flexible modes in the band of the damping that is drawn and designed for, as `tfarm design` has it
SIGN_WORDS = (
    f"Law: u = −{RATE_GAIN} dθ/dt − {MOMENT_GAIN} E I φ′(0) + r. Sign of {MOMENT_GAIN}: the strain gauge reads "
    f"E I φ′(0), positive where it accelerates the hub; {{rest}}. With the gauge reversed every "
    f"{MOMENT_GAIN} changes its sign."
)
TORQUE_AT_REST = "a torque u at rest gives −(J − I_h)/J u"
NO_PLACE_FOR_K2 = (
    f"The hub of this arm has no inertia: {{gauge}}, so feeding it back by {MOMENT_GAIN} would be an algebraic loop. "
    f"There is no map of {' and '.join(PLANE)}; what {RATE_GAIN} does at {MOMENT_GAIN} = 0 is said below."
)


class Named(Protocol):
    """A law as tables and pictures name it."""

    @property
    def name(self) -> str:
        """In words."""

    @property
    def key(self) -> str:
        """In keys."""

    @property
    def gains(self) -> str:
        """Its gains with their values, or what it reads."""


@dataclass(frozen=True, slots=True)
class NamedLaw:
    """A law and what it is called in words and in keys."""

    name: str
    key: str
    law: HubFeedback

    @property
    def gains(self) -> str:
        """Each gain with its value, for reading."""
        return gains_words(self.law)


def has_loop(arm: Arm) -> bool:
    """Whether both gains can be closed: the hub can turn, and has inertia."""
    return not (arm.is_locked or arm.has_massless_hub)


def has_rate_loop(arm: Arm) -> bool:
    """Whether the hub rate can be fed back: the hub can turn."""
    return not arm.is_locked


def why_no_loop(arm: Arm) -> str:
    """One sentence for an arm whose gains cannot both be closed."""
    if arm.is_locked:
        return "The hub of this arm is locked: it takes no torque, so there is no loop to close and no gain to choose."
    whole = "its gauge reads −u at every instant"
    damped = "its gauge reads −u/(1 + C s), the torque itself through a short lag"
    return NO_PLACE_FOR_K2.format(gauge=damped if arm.damping else whole)


def sign_words(arm: Arm) -> str:
    """The law, and the sign of its moment gain."""
    if arm.is_uniform and arm.has_rigid_mode:
        return SIGN_WORDS.format(rest=TORQUE_AT_REST)
    if arm.has_rigid_mode:
        share = significant(arm.gauged_inertia / arm.total_inertia, 5)
        rest = f"a torque that turns the whole arm gives −{share} times as much"
    else:
        static = transfer(arm, "root_moment").static * arm.input_per_torque
        rest = (
            f"a torque that lasts gives {plain(static, 5)} times as much" if static else "a torque that lasts gives 0"
        )
    driven = "" if arm.is_uniform else f"Here u is {input_words(arm)}. "
    return driven + SIGN_WORDS.format(rest=rest)


def what_holds(arm: Arm) -> str:
    """Why an arm without a rigid mode makes no slew."""
    return "The tip of this arm is held" if math.isinf(arm.payload.mass) else "Springs hold this arm"


def edge_of_K2(arm: Arm, law: HubFeedback) -> float | None:
    """The moment gain at which the loop loses its stability as it grows alone; None where none was found."""
    windows = margins_of(arm, law).windows[MOMENT_GAIN]
    top = math.inf if windows.around is None else windows.around[1]
    return top if windows.around is not None and windows.end(top) == "edge" else None


@lru_cache(maxsize=16)
def best(arm: Arm, chain: Chain) -> Design | None:
    """What `tfarm design ARM` finds; None where no gains within its bounds hold, or the moment has no place."""
    if not has_loop(arm):
        return None
    try:
        found = design(arm, modes=DESIGNED_MODES, chain=chain)
    except ConvergenceError:
        return None
    return None if found.at_limit else found  # the gain at which the hub stands still is no law to draw


@lru_cache(maxsize=64)
def brief_on(arm: Arm, law: HubFeedback, chain: Chain) -> SampledBrief:
    """Whether gains hold when sampled, computed once for all sections."""
    return sampled_brief(arm, law, chain)


@lru_cache(maxsize=64)
def margins_of(arm: Arm, law: HubFeedback) -> Margins:
    """Verdict and margins, computed once for all sections."""
    return margins(arm, law)


def laws(arm: Arm, chain: Chain) -> tuple[NamedLaw, ...]:
    """The default gains, and the best ones at the clock of a chain if there are any."""
    found = best(arm, chain)
    default = NamedLaw("default gains", "default", default_gains(arm))
    return (default,) if found is None else (default, NamedLaw("best damping", "best", found.law))
