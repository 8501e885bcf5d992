"""The damping of a band's modes for many gains at once: eigenvalues of a modal model, made exact by Newton's method.

The modal model only says where to start: each closed-loop eigenvalue is corrected on the transcendental characteristic
function, all gains and modes together.  Where one did not settle near its start a larger model is asked, and at last
all are found again in a box.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, as_law, law_of
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import dimensionless, loop_system, quick_characteristics
from tfarm.reduced import ModalModel, tailed_model

from .frequencies import band_of
from .loop import Loop
from .poles import poles_below

Kind = Callable[[Complex, float], NDArray[np.bool_]]  # which poles below a top frequency are meant

MODES_BEYOND_BAND = (5, 30)  # of the model; 30 where 5 do not do, and a box where these do not
CORRECTIONS = 6  # of Newton's method: the start is right to a few digits, so the last ones change nothing
LONGEST_CORRECTION = 0.1  # of |s|: a longer one would land anywhere, and more than WHOLE_CORRECTION in all is refused
MODEL_REACH = 1.2  # of the top of the band: poles of the model up to there may be of exact ones below it
NO_PART = 1e-9  # of a pole's size: a smaller real or imaginary part is rounding, as is a smaller distance of two
NEAREST_POLE = 1e-9  # of the top of the band: nearer to 0 is what rounding makes of a pole there
SAME_POLE = 1e-7  # of its size: so near to each other two starts found one pole, or two that rounding cannot tell apart
MODELS_KEPT = 16  # asked for again and again: memory against time, of no effect on an answer
LAST_CORRECTION = 1e-9  # of |s|: squared by the quadratic convergence, far below the last digit
WHOLE_CORRECTION = 0.05  # of |s|: farther from its start a pole may be another's
GAINS_AT_A_TIME = 4000  # memory, whatever the grid


def band_poles(arm: Arm, laws: Real, number: int) -> Complex:
    """The poles [1/s] with 0 < Im s below half-way to mode number + 1: (n, slots), nan where there are fewer.

    `laws` (gains, n) are those of `many_laws`.  Real poles are not among them (see `band_and_real_poles`).
    """
    return _in_blocks(_oscillating, arm, laws, number)


def band_and_real_poles(arm: Arm, laws: Real, number: int) -> Complex:
    """Those of `band_poles`, and the real poles but 0 of size below the same frequency: (n, slots), with nan."""
    return _in_blocks(_either, arm, laws, number)


def _in_blocks(kind: Kind, arm: Arm, laws: Real, number: int) -> Complex:
    Loop(arm, as_law(law_of(abs(laws).max(axis=1))))
    top = band_of(arm, number)
    parts = [slice(i, i + GAINS_AT_A_TIME) for i in range(0, laws.shape[1], GAINS_AT_A_TIME)]
    found = [_of_block(kind, arm, laws[:, part], number, top) for part in parts]
    slots = max(part.shape[1] for part in found)
    padded = [np.pad(part, ((0, 0), (0, slots - part.shape[1])), constant_values=np.nan) for part in found]
    return np.concatenate(padded)


def least_damping(arm: Arm, laws: Real, number: int) -> Real:
    """The damping ratio of the least damped oscillating pole of the band, for each law; negative if one is unstable."""
    poles = band_poles(arm, laws, number)
    ratio = -poles.real / abs(poles)
    ratio = np.where(np.isnan(ratio), 1.0, ratio)
    return np.asarray(ratio.min(axis=1, initial=1.0))


def is_oscillating(s: Complex) -> NDArray[np.bool_]:
    """Whether poles lie above the real axis by more than rounding does it."""
    return np.asarray(s.imag > NO_PART * abs(s))


def _oscillating(s: Complex, top: float) -> NDArray[np.bool_]:
    return is_oscillating(s) & (s.imag < top)


def _either(s: Complex, top: float) -> NDArray[np.bool_]:
    """Those, and real ones apart from 0 and from what rounding makes of it."""
    real = (abs(s.imag) <= NO_PART * abs(s)) & (abs(s) > NEAREST_POLE * top) & (abs(s) < top)
    return _oscillating(s, top) | real


def _of_block(kind: Kind, arm: Arm, laws: Real, number: int, top: float) -> Complex:
    """The poles (n, slots) of one block."""
    poles, left = np.empty((laws.shape[1], 0), complex), np.arange(laws.shape[1])
    for beyond in MODES_BEYOND_BAND:
        model = _model(arm, number + beyond)
        if isinstance(model, ConvergenceError):
            if beyond == MODES_BEYOND_BAND[0]:  # boxes for all of them would take minutes
                raise model
            break
        found, is_done = _corrected(kind, model, laws[:, left], top)
        poles, left = _filled(poles, left[is_done], found[is_done]), left[~is_done]
        if not left.size:
            return poles
    for n in left:
        exact = poles_below(Loop(arm, as_law(law_of(laws[:, n]))), top).values
        poles = _filled(poles, np.array([n]), exact[kind(exact, top)][None])
    return poles


def _filled(poles: Complex, rows: NDArray[np.int64], found: Complex) -> Complex:
    """`poles` with those rows filled in, padded with nan to the wider of the two."""
    wider = max(0, found.shape[1] - poles.shape[1])
    poles = np.pad(poles, ((0, 0), (0, wider)), constant_values=np.nan)
    poles[rows] = np.nan
    poles[rows, : found.shape[1]] = found
    return poles


def _corrected(kind: Kind, model: ModalModel, laws: Real, top: float) -> tuple[Complex, NDArray[np.bool_]]:
    """The exact poles next to those of a model, and for which laws all settled apart."""
    starts = np.linalg.eigvals(model.closed(laws.T)[0]).astype(complex)
    wanted = kind(starts, MODEL_REACH * top)
    order = np.argsort(~wanted, axis=1, kind="stable")[:, : max(1, int(wanted.sum(1).max()))]
    s = np.where(np.take_along_axis(wanted, order, 1), np.take_along_axis(starts, order, 1), np.nan)
    polished, settled = exact_poles_next_to(model.arm, s, laws)
    poles = np.where(kind(polished, top), polished, np.nan)
    apart = abs(poles[:, :, None] - poles[:, None, :]) / abs(poles[:, :, None])
    apart[:, np.arange(poles.shape[1]), np.arange(poles.shape[1])] = np.nan
    is_twice = np.where(np.isnan(apart), 1.0, apart) < SAME_POLE
    return poles, np.asarray(settled.all(1) & ~is_twice.any(axis=(1, 2)))


@lru_cache(maxsize=MODELS_KEPT)
def _model(arm: Arm, count: int) -> ModalModel | ConvergenceError:
    """The model with so many modes, or why they cannot be followed to the arm's damping: asked for again and again."""
    try:
        return tailed_model(arm, count)
    except ConvergenceError as error:
        return error


def exact_poles_next_to(arm: Arm, starts: Complex, laws: Real) -> tuple[Complex, NDArray[np.bool_]]:
    """The exact poles next to the starts (n, slots), and which settled there; nan where there is no start.

    `laws` (gains, n) are those of `many_laws`.
    """
    k = loop_system(arm)
    laws = dimensionless(k, laws)
    rows, columns = np.nonzero(~np.isnan(starts))
    s = starts[rows, columns]
    begin, move = s.copy(), np.zeros_like(s)
    for _ in range(CORRECTIONS):
        at = quick_characteristics(k, s, laws[:, rows])
        with np.errstate(all="ignore"):  # a start that runs away has not settled
            move = at.value / at.slope
        most = LONGEST_CORRECTION * abs(s)
        move = np.where(np.isfinite(move), move, LONGEST_CORRECTION * s)
        s = s - np.where(abs(move) > most, move * (most / np.maximum(abs(move), LEAST_SIZE)), move)
    polished, settled = np.full(starts.shape, np.nan, complex), np.ones(starts.shape, bool)
    polished[rows, columns] = s
    settled[rows, columns] = (abs(move) < LAST_CORRECTION * abs(s)) & (abs(s - begin) < WHOLE_CORRECTION * abs(s))
    return polished, settled
