"""What is asked of a loop, of whatever law: gains at the hub have theorems of their own, any other law has none.

A law that is no more than these gains is taken for them.
"""

from __future__ import annotations

from tfarm.arm import AnyLaw, Arm, HubFeedback, arm_and_law

from .law_loop import LawLoop
from .law_poles import law_poles
from .law_stability import is_quiet_above, law_stability
from .margins import Margins, loop_margins, margins_of_gains
from .nyquist import Nyquist, nyquist_of
from .poles import Poles, poles_of_gains
from .stability import stability


def closed_loop_poles(arm: Arm, law: AnyLaw, count: int | None = None) -> Poles | Poles[LawLoop]:
    """The first `count` closed-loop poles with Im >= 0, ascending in Im s, complete in the box of the record.

    Without a count the first ten, or so.  Raises ParameterError where there is no loop, ConvergenceError where the box
    cannot be completed.
    """
    arm, law = arm_and_law(arm, law)
    return poles_of_gains(arm, law, count) if isinstance(law, HubFeedback) else law_poles(arm, law, count)


def margins(arm: Arm, law: AnyLaw, band: float | None = None) -> Margins | Margins[LawLoop]:
    """Verdict first, then the margins of the loop; of gains at the hub the stable windows of each too.

    Raises ParameterError where there is no loop, ConvergenceError where poles cannot be counted, or where with damping
    one is on the axis to working precision.
    """
    arm, law = arm_and_law(arm, law)
    if isinstance(law, HubFeedback):
        return margins_of_gains(arm, law, band)
    verdict = law_stability(arm, law, band)
    if not verdict.is_stable:
        return Margins(verdict, {}, None, None, None, None)
    found = loop_margins(verdict)
    if arm.least_damping and is_quiet_above(verdict.loop, verdict.band):
        return Margins(verdict, {}, found, found.delay, found.disk, found.peak_sensitivity)
    return Margins(verdict, {}, found, None, None, None)


def nyquist(arm: Arm, law: AnyLaw) -> Nyquist | Nyquist[LawLoop]:
    """The loop function of a law on Nyquist's contour, its turns around -1 counted up to the verdict's band.

    Raises what the verdict raises, and ConvergenceError where the curve passes -1 so close that its turns cannot be
    counted, or where the two counts differ.
    """
    arm, law = arm_and_law(arm, law)
    return nyquist_of(stability(arm, law)) if isinstance(law, HubFeedback) else nyquist_of(law_stability(arm, law))
