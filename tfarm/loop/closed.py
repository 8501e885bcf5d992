"""The root locus of whatever law and number: gains at the hub are followed by pairs, any other law in a box."""

from __future__ import annotations

from tfarm.arm import FED_BACK, PLANE, AnyLaw, Arm, HubFeedback, Law, arm_and_law, as_law
from tfarm.errors import ParameterError

from .law_locus import LawLocus, law_locus
from .locus import Locus
from .locus import locus as locus_of_gains
from .variation import OF_THE_LAW

LOCUS_VALUES, LAW_LOCUS_VALUES = 500, 100  # values of a locus by default: of gains, of any other law


def locus(
    arm: Arm, law: AnyLaw, vary: str, start: float, stop: float, points: int | None = None, branches: int = 10
) -> Locus | LawLocus:
    """The closed-loop poles of the exact arm as one number goes from `start` to `stop`, at equally spaced values.

    `vary` is a gain, "all" (a scale on the gains), payload_mass, payload_inertia, hub_inertia, length or damping; of a
    law of signals "gain" (a factor on it), "delay", a signal, "SIGNAL.num.N" or "SIGNAL.den.N", too.  Along these, and
    of any other `Law` than gains at the hub, the record is a `LawLocus`, of the first `branches` (60 at most) flexible
    modes, with 100 values unless `points` says otherwise.
    Raises ParameterError for what is no law, no loop or no range, ConvergenceError where branches cannot be told apart.
    """
    arm, plain = arm_and_law(arm, law)
    if not isinstance(vary, str):
        raise ParameterError(key="vary", value=vary, remedy=f"the name of what varies, such as {PLANE[1]} or length")
    is_of_signals = isinstance(law, Law) or vary.partition(".")[0] in {"gain", "delay", *FED_BACK}
    if isinstance(plain, HubFeedback) and (vary in OF_THE_LAW or not is_of_signals):
        return locus_of_gains(arm, plain, vary, start, stop, LOCUS_VALUES if points is None else points, branches)
    values = LAW_LOCUS_VALUES if points is None else points
    return law_locus(arm, as_law(law), vary, start, stop, values, branches)
