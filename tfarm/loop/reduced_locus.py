"""The same locus by python-control on the modal model, and how far it is from the exact one.

Where a gain varies it is `control.root_locus_map` on the loop opened at that gain, the other gains closed before; for a
parameter of the arm, which python-control cannot vary, the poles of a reduced closed loop at a few values.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from tfarm.arm import FED_BACK, Arm, HubFeedback
from tfarm.arm.blocks import Matrices
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.reduced import ModalModel, modal_model
from tfarm.spectrum import modes

from .locus import Locus
from .variation import OF_THE_LAW, Variation

if TYPE_CHECKING:
    import control

LEAST_ORDER = 20  # of the model, ten modes, where no order is asked for
MODES_BEYOND_BRANCHES = 2  # modes of the reduced model above the last branch, if the order is not said
POLISHING = 4  # steps of Newton's method: they start from a dozen right digits
OWN_POLE = 1e-6  # of its size: a pole that Newton's method would move further is none of its own
REDUCED_VALUES = 9  # values at which an arm is reduced anew, where a parameter of it varies


@dataclass(frozen=True)
@record
class ReducedLocus:
    """Poles of a reduced closed loop of that `order`, next to the exact branches, at the values `gain` (m,).

    `branches` (b, m) [1/s] are the reduced poles paired one to one with the exact ones so that the sum of distances is
    least; `gap` (b,) is the largest distance of each branch, as a share of |s| or, if that is more, of the arm's first
    flexible frequency.
    """

    order: int
    gain: Real
    branches: Complex
    gap: Real

    @property
    def worst(self) -> float:
        """The largest gap of all branches."""
        return float(self.gap.max())


def reduced_locus(exact: Locus, order: int | None = None) -> ReducedLocus:
    """The locus by python-control on a modal model of that order, or of one two modes beyond the last branch.

    Raises ParameterError if the order is odd or has no room for as many poles as there are branches.
    """
    arm, rigid = exact.arm, exact.arm.has_rigid_mode
    least = int(exact.mode.max()) + rigid
    if order is None:
        order = max(LEAST_ORDER, 2 * (least + MODES_BEYOND_BRANCHES))
    remedy = f"an even number from {2 * least}: two a mode"
    order = whole("order", order, 2 * least, math.inf, remedy)
    if order % 2:
        raise ParameterError(key="order", value=order, remedy=remedy)
    count = order // 2 - rigid
    if exact.vary in OF_THE_LAW:
        which = np.arange(exact.gain.size)
        poles = _polished(exact.variation, exact.gain, root_locus(arm, exact.law, exact.vary, exact.gain, count), count)
    else:
        which = np.unique(np.linspace(0, exact.gain.size - 1, REDUCED_VALUES).round().astype(int))
        loops = [exact.variation.at(float(value)) for value in exact.gain[which]]
        none = np.zeros(len(FED_BACK))
        closed = [_closed(each.arm, np.array((each.gains or HubFeedback()).row), count, none)[0][0] for each in loops]
        poles = np.array([np.linalg.eigvals(A) for A in closed])
    branches = exact.branches[:, which]
    paired = np.full(branches.shape, np.nan, complex)
    for n, (zeros, found) in enumerate(zip(branches.T, poles, strict=True)):
        _, chosen = linear_sum_assignment(np.nan_to_num(abs(zeros[:, None] - found)))
        paired[:, n] = np.where(np.isnan(zeros), np.nan, found[chosen])
    size = np.maximum(abs(branches), modes(arm, 1).natural_frequency[-1])
    return ReducedLocus(order, exact.gain[which], paired, np.fmax.reduce(abs(paired - branches) / size, axis=1))


def root_locus(arm: Arm, law: HubFeedback, vary: str, gain: Real, count: int) -> Complex:
    """`control.root_locus_map` of the loop opened at what varies, a modal model of `count` modes: (gains, order)."""
    import control

    try:
        return np.asarray(control.root_locus_map(open_loop(arm, law, vary, count), gain).loci)
    except np.linalg.LinAlgError as error:  # it works with coefficients of s^n, which overflow at high frequencies
        raise ConvergenceError(f"python-control cannot follow a model of this arm: {error}", arm.name, count) from None


def _polished(variation: Variation, gain: Real, poles: Complex, count: int) -> Complex:
    """The same poles (gains, order) to the last digits that float64 has of them, by Newton's method.

    What an eigenvalue solver gives depends on the processor in its last four digits.  Solved for is 1 + law . G(s) = 0
    on the model's partial fractions; a pole where that has no slope, or that would move, stays as it is.
    """
    model = modal_model(variation.arm, FED_BACK, count)
    laws = np.array([(variation.at(float(value)).gains or HubFeedback()).row for value in gain])
    found = poles.astype(complex)
    for _ in range(POLISHING):
        value, slope = _return_difference(model, laws, found)
        with np.errstate(all="ignore"):
            move = value / slope
        near = abs(move) <= OWN_POLE * abs(found)
        found = np.where(near, found - np.where(found.imag == 0, move.real, move), found)
    return found


def _return_difference(model: ModalModel, laws: Real, s: Complex) -> tuple[Complex, Complex]:
    """1 + law . G(s) and its derivative, at s (gains, order), each row under its own law (gains, 3)."""
    pole, parts = model.eigenvalues.ravel(), model.residues.reshape(len(FED_BACK), -1)
    if model.single_residues is not None:
        pole, parts = np.r_[pole, model.single], np.c_[parts, model.single_residues]
    residues = laws @ parts
    rigid, static = laws @ model.rigid, laws @ model.static
    with np.errstate(all="ignore"):  # at a pole of the model: no number, and the pole is left alone
        away = 1 / (s[..., None] - pole)
        parts = residues[:, None, :] * away
        value = 1 + static[:, None] + parts.sum(axis=2) + rigid[:, :1] / s**2 + rigid[:, 1:] / s
        slope = -(parts * away).sum(axis=2) - 2 * rigid[:, :1] / s**3 - rigid[:, 1:] / s**2
    return value, slope


def open_loop(arm: Arm, law: HubFeedback, vary: str, count: int) -> control.StateSpace:
    """The loop function to be multiplied by the varied gain, all other gains closed; state space of a modal model."""
    import control

    moving = np.array(law.row) if vary == "all" else np.array(HubFeedback().having(vary, 1.0).row)
    fixed = np.zeros(moving.size) if vary == "all" else np.array(law.having(vary, 0.0).row)
    (A, B, C, D), row = _closed(arm, fixed, count, moving)
    return control.StateSpace(A, B, row @ C, row @ D)


def _closed(arm: Arm, fixed: Real, count: int, moving: Real) -> tuple[Matrices, Real]:
    """The model of the outputs that either row of gains uses, closed by the fixed one, and the other on its outputs."""
    used = (fixed != 0) | (moving != 0)
    used[FED_BACK.index("hub_rate")] |= not used.any()
    used[FED_BACK.index("hub_angle")] |= bool(arm.rate_loss) and arm.has_rigid_mode  # or its pole at 0 is not a state
    model = modal_model(arm, [name for name, is_used in zip(FED_BACK, used, strict=True) if is_used], count)
    return model.closed(fixed[used]), moving[None, used]
