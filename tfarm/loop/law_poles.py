"""Poles of the exact loop under any law: zeros of its characteristic function, as many as the winding number says."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arm.checks import whole
from tfarm.arm.law import Law
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.reduced.sensed import closed, in_series, pade, sensed_model
from tfarm.spectrum import modes_below
from tfarm.spectrum.box import Box, complete
from tfarm.spectrum.damped import CLEAR

from .frequencies import band_of, steep_places
from .law_loop import LawLoop
from .poles import MOST_POLES, USUAL, Poles, first_poles

Complex = NDArray[np.complexfloating[Any, Any]]

PADE = 8  # order of the approximation of a delay in the model that starts are taken from
LEFT = 1.5  # heights that a box reaches left
LATE = 2.0  # of 1/delay: further left a delayed loop has ever more poles, and all of them are fast
BEYOND = (2.0, 5.0, 20.0)  # of its right edge, where the loop function is looked at again
QUIET = 0.5  # |L| there, so that 1 + L has no zero
WIDEST = 1e8  # heights that a box reaches right
MORE, LARGEST = 4, 40  # modes of the model above the box, and at most
MOST_MODES = 150  # flexible modes below the highest box that is searched for as many poles as are asked for


def law_poles(arm: Arm, law: Law, count: int | None = None) -> Poles[LawLoop]:
    """The first `count` poles with Im s >= 0 of the loop under a law, complete in the box of the record.

    Raises ParameterError where there is no loop, ConvergenceError where the box cannot be completed.
    """
    remedy = f"a whole number from 1 to {MOST_POLES}"
    wanted = USUAL if count is None else whole("count", count, 1, MOST_POLES, remedy)
    loop, number = LawLoop(arm, law), wanted + 2
    while True:
        poles = law_poles_below(loop, band_of(loop.arm, number))
        if poles.values.size >= wanted:
            real = int((poles.values.imag == 0).sum())
            return first_poles(poles, wanted if count is not None else max(wanted, real))
        if 2 * number > MOST_MODES:
            if count is None:
                return poles
            left, _, _, top = poles.box
            text = f"only {poles.values.size} poles right of {left:.4g} 1/s lie below {top:.4g} rad/s, not {wanted}"
            raise ConvergenceError(text, poles.values, wanted)
        number *= 2


def law_poles_below(loop: LawLoop, height: float, late: float = LATE) -> Poles[LawLoop]:
    """All poles with |Im s| <= height [rad/s] in a box that reaches right of every unstable one.

    Left it reaches to -late/delay at most.
    """
    at_zero, starts = loop.zeros_at_origin, starting_points_of(loop, 1.3 * height)
    found, box = complete(loop.function, lambda top: law_box(loop, top, late), height, starts)
    upper = found[found.imag >= 0]
    upper = upper[np.lexsort((upper.real, upper.imag))]
    return Poles(loop, np.r_[np.zeros(at_zero, complex), upper], box)


def law_box(loop: LawLoop, height: float, late: float = LATE) -> Box:
    """A box of that height, right of the law's poles and until |L| is small; left short of -1/C and -late/delay."""
    own, C = loop.law.poles, loop.arm.damping
    right = 1.1 * max([0.1 * height, *own.real.tolist()])
    edge = 1j * np.linspace(0.0, height, 60)
    while right < WIDEST * height:
        L = loop.loop_function(np.r_[right + edge, right * np.array(BEYOND)])
        if L.real.min() > -QUIET:
            break
        right *= 1.7
    left = min(LEFT * height, CLEAR / C if C else np.inf, late / loop.law.delay if loop.law.delay else np.inf)
    return Box(-float(left), float(right), -height, height)


def starting_points_of(loop: LawLoop, up_to: float) -> Complex:
    """Where Newton's method starts: the loop of a modal model, the arm's own frequencies, and the law's poles."""
    omega, C = np.asarray(steep_places(loop.arm, up_to)), loop.arm.damping
    shift = np.array([0.0, 0.02, 0.3])[:, None]
    decay = C * omega**2 / 2
    near = (-decay - shift * omega + 1j * omega * np.sqrt(np.maximum(1 - (C * omega / 2) ** 2, 0.0))).ravel()
    real = np.geomspace(up_to / 300, 1.4 * up_to, 25)
    own = loop.law.poles
    starts = np.concatenate(
        [near, near.conj(), real, -real, own * 1.01, own * 0.9 + 0.1j * abs(own), _of_model(loop, up_to)]
    )
    return starts[abs(starts) > 1e-100]


def _of_model(loop: LawLoop, up_to: float) -> Complex:
    """Poles of a modal model under the law, its delay a Pade approximation; none where the law has no states."""
    if loop.law.is_improper:
        return np.empty(0, complex)
    count = min(modes_below(loop.arm, up_to) + MORE, LARGEST)
    try:
        plant, law = sensed_model(loop.arm, loop.law.signals, count), loop.law.matrices()
        if loop.law.delay:
            law = in_series(law, pade(loop.law.delay, PADE).matrices())
        return np.linalg.eigvals(closed(plant, law)).astype(complex)
    except (ParameterError, ConvergenceError):
        return np.empty(0, complex)  # starts alone: the winding number says whether something is missing
