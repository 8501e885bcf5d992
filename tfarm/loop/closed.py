"""What is asked of a loop, of whatever law: gains at the hub have theorems of their own, any other law has none.

A law that is no more than these gains is taken for them.
"""

from __future__ import annotations

from tfarm.arm import AT_HUB, FED_BACK, NAMES, PLANE, AnyLaw, Arm, HubFeedback, Law, arm_and_law, as_law
from tfarm.arrays import Real
from tfarm.errors import ParameterError, must_be_known

from .law_map import LawMap, law_map
from .law_poles import law_poles
from .law_stability import is_quiet_above, law_stability
from .law_windows import law_windows
from .locus import Locus
from .locus import locus as followed_locus
from .loop import Loop
from .margins import Margins, loop_margins, margins_of_gains
from .nyquist import Nyquist, nyquist_of
from .poles import Poles, poles_of_gains
from .regions import Region, region
from .stability import Stability, stability
from .varied import ARM_PARAMETERS, OF_THE_LAW

LOCUS_VALUES, LAW_LOCUS_VALUES = 500, 100  # values of a locus unless so many are asked for: of gains, of any other law


def closed_loop_poles(arm: Arm, law: AnyLaw, count: int | None = None) -> Poles | Poles[Loop]:
    """The first `count` closed-loop poles with Im >= 0, ascending in Im s, complete in the box of the record.

    Without a count the first ten, or so.  Raises ParameterError where there is no loop, ConvergenceError where the box
    cannot be completed.
    """
    arm, law = arm_and_law(arm, law)
    return poles_of_gains(arm, law, count) if isinstance(law, HubFeedback) else law_poles(arm, law, count)


def margins(arm: Arm, law: AnyLaw, band: float | None = None) -> Margins | Margins[Loop]:
    """Verdict first, then the stable windows of each gain, or of each number of a law, and the margins of the loop.

    Raises ParameterError where there is no loop, ConvergenceError where poles cannot be counted, or where with damping
    one is on the axis to working precision.
    """
    arm, law = arm_and_law(arm, law)
    if isinstance(law, HubFeedback):
        return margins_of_gains(arm, law, band)
    verdict = law_stability(arm, law, band)
    windows = law_windows(verdict)
    if not verdict.is_stable:
        return Margins(verdict, windows, None, None, None, None)
    found = loop_margins(verdict)
    if arm.least_damping and is_quiet_above(verdict.loop, verdict.band):
        return Margins(verdict, windows, found, found.delay, found.disk, found.peak_sensitivity)
    return Margins(verdict, windows, found, None, None, None)


def verdict_on(arm: Arm, law: AnyLaw) -> Stability | Stability[Loop]:
    """The verdict alone.  Raises what `margins` raises."""
    arm, law = arm_and_law(arm, law)
    return stability(arm, law) if isinstance(law, HubFeedback) else law_stability(arm, law)


def nyquist(arm: Arm, law: AnyLaw) -> Nyquist | Nyquist[Loop]:
    """The loop function of a law on Nyquist's contour, its turns around -1 counted up to the verdict's band.

    Raises what the verdict raises, and ConvergenceError where the curve passes -1 so close that its turns cannot be
    counted, or where the two counts differ.
    """
    arm, law = arm_and_law(arm, law)
    return nyquist_of(stability(arm, law)) if isinstance(law, HubFeedback) else nyquist_of(law_stability(arm, law))


def locus(
    arm: Arm, law: AnyLaw, vary: str, start: float, stop: float, points: int | None = None, branches: int = 10
) -> Locus:
    """The closed-loop poles of the exact arm as one number goes from `start` to `stop`, at equally spaced values.

    `vary` is a gain, "all" (a scale on the gains), payload_mass, payload_inertia, hub_inertia, length or damping; of a
    law of signals "gain" (a factor on it), "delay", a signal, "SIGNAL.num.N" or "SIGNAL.den.N", too.  Along these, and
    of any other `Law` than gains at the hub, the record has all poles of a box as high as the first `branches` flexible
    modes, with 100 values unless `points` says otherwise.
    Raises ParameterError for what is no law, no loop or no range, ConvergenceError where branches cannot be told apart.
    """
    arm, plain = arm_and_law(arm, law)
    if not isinstance(vary, str):
        raise ParameterError(key="vary", value=vary, remedy=f"the name of what varies, such as {PLANE[1]} or length")
    is_of_signals = isinstance(law, Law) or vary.partition(".")[0] in {"gain", "delay", *FED_BACK}
    if isinstance(plain, HubFeedback) and (vary in OF_THE_LAW or not is_of_signals):
        must_be_known("vary", vary, (*OF_THE_LAW, *ARM_PARAMETERS))
        if vary == "all" and plain == HubFeedback():
            raise ParameterError(
                key="vary", value="all", remedy=f"every gain is 0: give {' or '.join(NAMES)} to be scaled"
            )
        return followed_locus(arm, plain, vary, start, stop, LOCUS_VALUES if points is None else points, branches)
    values = LAW_LOCUS_VALUES if points is None else points
    return followed_locus(arm, as_law(law), vary, start, stop, values, branches, in_box=True)


def gain_map(
    arm: Arm, K1: Real, K2: Real, Kp: float = 0.0, *, law: AnyLaw | None = None, vary: tuple[str, str] | None = None
) -> Region | LawMap:
    """How many poles are unstable over the plane of K1 and K2 (1-D, ascending), and its exact boundary.

    Of a `law` `vary` names two of its numbers ("gain", "delay", a signal, "SIGNAL.num.N", "SIGNAL.den.N"): the values
    are theirs then, first across and then up.
    Raises ParameterError for what is no law, no loop or no range, ConvergenceError where poles cannot be counted.
    """
    if isinstance(K1, HubFeedback | Law):
        raise ParameterError(key="K1", value=K1, remedy="a range of values; give the law as law=, its numbers as vary=")
    if law is None:
        if vary is not None:
            raise ParameterError(key="law", value=None, remedy="give the HubFeedback or Law whose numbers vary names")
        return region(arm, K1, K2, HubFeedback(Kp=Kp))
    arm, plain = arm_and_law(arm, law)
    if Kp:
        raise ParameterError(key="Kp", value=Kp, remedy="the law holds the angle: give Kp in it, or no law")
    if isinstance(plain, HubFeedback) and vary in (None, PLANE):
        if plain.is_at_hub:
            return region(arm, K1, K2, plain)
        law, vary = as_law(plain.at(1.0, 1.0)), (AT_HUB[1], AT_HUB[2])  # of signals: no theorem tells its plane
    if not isinstance(vary, tuple | list) or len(vary) != 2 or not all(isinstance(each, str) for each in vary):
        raise ParameterError(key="vary", value=vary, remedy='two numbers of the law, such as ("gain", "delay")')
    return law_map(arm, law, (vary[0], vary[1]), K1, K2)
