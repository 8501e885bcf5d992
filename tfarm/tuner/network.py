"""The paper's network: 6-6-1, linear, sigmoid and softplus, thresholds zero; sizes are free, and so is a seventh input.

    K = ln(1 + e^z),   z = sum over j of w2_j sigmoid( sum over i of W1_ji p_i )

Inputs p: u(t), u(t-1), then e and x.  e(t) = u(t) - K(t) x(t) holds the gain that is to be found, an algebraic loop, so
the network gets the two values before: e(t-1), e(t-2).  Then x(t), x(t-1), and if asked K(t-1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tfarm.arm.checks import whole
from tfarm.arrays import Real
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.tuner import kernel

MOST_HIDDEN = 1000  # neurons; the paper has 6
PAPER_INPUTS, PAPER_HIDDEN = 6, 6  # of the paper's network; one input more, the gain before, where it is asked for
HALF_WIDTH = 0.5  # of the uniform distribution of the initial weights


@dataclass(frozen=True)
@record
class Network:
    """Weights `W1` (hidden, inputs) and `w2` (hidden,); `scales` (inputs,) divide the inputs, in N m (K in 1).

    Raises ParameterError for weights that are not finite or of shapes that do not fit.
    """

    W1: Real
    w2: Real
    scales: Real

    def __post_init__(self) -> None:
        for name in ("W1", "w2", "scales"):
            value = np.array(getattr(self, name), dtype=float)
            if not np.isfinite(value).all():
                odd = float(value[~np.isfinite(value)][0])
                raise ParameterError(key=name, value=odd, remedy="every weight and scale is a finite number")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        remedy = f"W1 is (hidden, 6 or 7), hidden from 1 to {MOST_HIDDEN}, with as many columns as scales"
        inputs = (PAPER_INPUTS, PAPER_INPUTS + 1)
        if self.W1.ndim != 2 or self.W1.shape[1] not in inputs or not 1 <= self.W1.shape[0] <= MOST_HIDDEN:
            raise ParameterError(key="W1", value=self.W1.shape, remedy=remedy)
        if self.w2.shape != self.W1.shape[:1]:
            raise ParameterError(key="w2", value=self.w2.shape, remedy=f"one weight a hidden neuron, {len(self.W1)}")
        if self.scales.shape != self.W1.shape[1:] or not (self.scales > 0).all():
            remedy = f"one positive scale an input, {self.W1.shape[1]}"
            raise ParameterError(key="scales", value=self.scales.tolist(), remedy=remedy)

    @property
    def weights(self) -> Real:
        """All weights in one vector: W1 row by row, then w2."""
        return np.r_[self.W1.ravel(), self.w2]

    def with_weights(self, weights: Real) -> Network:
        """The network of the same size with these weights (as `weights` lists them)."""
        first = self.W1.size
        return Network(weights[:first].reshape(self.W1.shape), weights[first:], self.scales)

    def gain(self, signals: Real, guard: kernel.Limits) -> float:
        """K for one row of inputs [N m], before they are scaled; `guard` as in `kernel.guarded`."""
        return self.gain_and_gradient(signals, guard)[0]

    def gain_and_gradient(self, signals: Real, guard: kernel.Limits) -> tuple[float, Real]:
        """K, and dK/dw by every weight as `weights` lists them."""
        weights, hidden, inputs = self.weights, np.zeros(self.w2.size), np.asarray(signals, dtype=float) / self.scales
        K, slope = kernel.network_gain(weights, inputs, hidden, guard)
        gradient = np.zeros(weights.size)
        kernel.gain_gradient(weights, inputs, hidden, slope, gradient)
        return float(K), gradient


def initial_network(seed: int, *, hidden: int = PAPER_HIDDEN, scales: Real | None = None) -> Network:
    """Weights uniform in (-0.5, 0.5), by NumPy's PCG64 of that seed; `scales` (6 or 7) are 1 N m unless given."""
    seed = whole("seed", seed, 0, 2**63 - 1, "a seed is a whole number from 0 to 2^63 - 1")
    hidden = whole("hidden", hidden, 1, MOST_HIDDEN, f"a whole number of neurons from 1 to {MOST_HIDDEN}")
    widths = np.ones(PAPER_INPUTS) if scales is None else np.asarray(scales, dtype=float)
    draw = np.random.default_rng(seed).uniform(-HALF_WIDTH, HALF_WIDTH, hidden * (widths.size + 1))
    return Network(draw[:-hidden].reshape(hidden, widths.size), draw[-hidden:], widths)
