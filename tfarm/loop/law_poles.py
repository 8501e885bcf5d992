"""Poles of the exact loop under any law: zeros of its characteristic function, as many as the winding number says."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from tfarm.arm import Arm, Law
from tfarm.arm.blocks import Matrices
from tfarm.arm.checks import whole
from tfarm.arrays import Complex
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.reduced.sensed import closed, in_series, pade, sensed_model
from tfarm.spectrum import modes_below
from tfarm.spectrum.box import Box, complete
from tfarm.spectrum.complete_box import HEIGHTS_LEFT, RIGHT_OF_AXIS, TOWARD_SINGULAR
from tfarm.spectrum.scales import first_frequency

from .frequencies import band_of, steep_places
from .loop import UNDISPERSED, Loop
from .poles import (
    MOST_POLES,
    STARTS_REACH,
    USUAL_POLES,
    Poles,
    first_poles,
    near_modes,
    quiet_edge,
    real_starts,
)

PADE = 8  # order of the approximation of a delay in the model that starts are taken from
LATE = 2.0  # of 1/delay: further left a delayed loop has ever more poles, and all of them are fast
BEYOND_OWN = 1.1  # times the rightmost pole of a law, where L is infinite: the nearest right edge that is tried
LAW_RIGHT_POINTS = 60  # of half that edge, where Re L is looked at: more than under gains, as a law has its own poles
FARTHER_OWN, NEARER_OWN, ASIDE_OWN = 1.01, 0.9, 0.1j  # of a law's pole: starts beside it, as on it D is infinite
LEAST_START = 1e-100  # 1/s: zeros at 0 are divided out
LAW_RIGHT = 1e8  # heights that a box reaches right under a law, at most: an improper one may have poles so far right
MODES_ABOVE_BOX, MOST_MODEL_MODES = 4, 40  # modes of the model above the box, and at most
MOST_LAW_BOX_MODES = 150  # flexible, below the highest box of a law that is searched for as many poles as are asked for


def law_poles(arm: Arm, law: Law, count: int | None = None) -> Poles[Loop]:
    """The first `count` poles with Im s >= 0 of the loop under a law, complete in the box of the record.

    Raises ParameterError where there is no loop, ConvergenceError where the box cannot be completed.
    """
    remedy = f"a whole number from 1 to {MOST_POLES}"
    wanted = USUAL_POLES if count is None else whole("count", count, 1, MOST_POLES, remedy)
    loop, number = Loop(arm, law), wanted + 2
    while True:
        poles = law_poles_below(loop, band_of(loop.arm, number))
        if poles.values.size >= wanted:
            return first_poles(poles, count)
        if 2 * number > MOST_LAW_BOX_MODES:
            if count is None:
                return poles
            left, _, _, top = poles.box
            text = f"only {poles.values.size} poles right of {left:.4g} 1/s lie below {top:.4g} rad/s, not {wanted}"
            raise ConvergenceError(text, poles.values, wanted)
        number *= 2


def law_poles_below(loop: Loop, height: float, late: float = LATE) -> Poles[Loop]:
    """All poles with |Im s| <= height [rad/s] in a box that reaches right of every unstable one.

    Left it reaches to -late/delay at most.
    """
    at_zero, starts = loop.zeros_at_origin, starting_points_of(loop, STARTS_REACH * height)
    found, box = complete(loop.function, lambda top: law_box(loop, top, late), height, starts)
    upper = found[found.imag >= 0]
    upper = upper[np.lexsort((upper.real, upper.imag))]
    return Poles(loop, np.r_[np.zeros(at_zero, complex), upper], box)


def law_box(loop: Loop, height: float, late: float = LATE) -> Box:
    """A box of that height, right of the law's poles and until |L| is small; left short of -1/C and -late/delay."""
    own, C = loop.law.poles, loop.arm.damping
    if own.real.max(initial=0.0) > UNDISPERSED * first_frequency(loop.arm):
        fastest = complex(own[own.real.argmax()])
        why = f"the law has a pole at {fastest:.3g} 1/s, farther right than a box reaches: its den begins next to 0"
        raise ConvergenceError(f"{why}; begin it with 0, which is another law, or a larger number", fastest, height)
    right = BEYOND_OWN * max([RIGHT_OF_AXIS * height, *own.real.tolist()])
    right = quiet_edge(loop, right, height, LAW_RIGHT_POINTS, LAW_RIGHT, float(abs(own).max(initial=0.0)))
    clear = TOWARD_SINGULAR / C if C else np.inf
    left = min(HEIGHTS_LEFT * height, clear, late / loop.law.delay if loop.law.delay else np.inf)
    return Box(-float(left), right, -height, height)


def starting_points_of(loop: Loop, up_to: float) -> Complex:
    """Where Newton's method starts: the loop of a modal model, the arm's own frequencies, and the law's poles."""
    omega, C = np.asarray(steep_places(loop.arm, up_to)), loop.arm.damping
    near = near_modes(omega, C)
    real, own, of_model = real_starts(up_to), loop.law.poles, np.empty(0, complex)
    if not loop.law.is_improper:  # else it has no states
        count = min(modes_below(loop.arm, up_to) + MODES_ABOVE_BOX, MOST_MODEL_MODES)
        with suppress(ParameterError, ConvergenceError):  # the winding number says whether something is missing
            of_model = poles_of_model(loop, _lightly_damped(loop, count))
    starts = np.concatenate(
        [near, near.conj(), real, -real, own * FARTHER_OWN, own * NEARER_OWN + ASIDE_OWN * abs(own), of_model]
    )
    return starts[abs(starts) > LEAST_START]


def _lightly_damped(loop: Loop, count: int) -> Matrices:
    """A model of the rig in its undamped modes, each with the damping of its own C w, and what the hub loses.

    Bending of one C has just that; the damped modes themselves take far longer to be followed than starts are worth.
    """
    arm, signals = loop.arm, loop.law.signals
    A, B, C, D = sensed_model(arm.lossless, (*signals, "hub_rate"), count)
    omega = np.diag(A, 1)
    (pair,) = np.nonzero((omega > 0) & (np.diag(A, -1) == -omega))
    A[pair + 1, pair + 1] -= arm.damping * omega[pair] ** 2
    return A - arm.rate_loss * B @ C[-1:], B, C[:-1], D[:-1]


def poles_of_model(loop: Loop, plant: Matrices) -> Complex:
    """Poles of a model of the rig, from its input to the law's signals, under the law, a delay by Pade's fraction."""
    law = loop.law.matrices()
    if loop.law.delay:
        law = in_series(law, pade(loop.law.delay, PADE).matrices())
    return np.linalg.eigvals(closed(plant, law)).astype(complex)
