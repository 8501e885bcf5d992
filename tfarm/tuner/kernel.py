"""The compiled heart of the tuner: a trial forward, and its cost's gradient backward.

N samples, n states, m inputs of the network and h hidden neurons; its weights are W1 (h, m) row by row, then w2 (h,).
With u = (torque counted) + (reference of servo.s) - servo.s and e = u - K x the torque is e + (torque not counted).

The paper's network: 6-6-1, linear, sigmoid and softplus, thresholds zero; sizes are free, and so is a seventh input.

    K = ln(1 + e^z),   z = sum over j of w2_j sigmoid( sum over i of W1_ji p_i )

Inputs p: u(t), u(t-1), then e and x.  e(t) = u(t) - K(t) x(t) depends on the gain itself, an algebraic loop, so the
inputs are the two values before: e(t-1), e(t-2).  Then x(t), x(t-1), and optionally K(t-1).
"""

from __future__ import annotations

from enum import IntEnum
from math import exp, inf, log1p
from typing import NamedTuple

import numpy as np

from tfarm.arm.checks import whole
from tfarm.arm.stages import Consumer
from tfarm.arrays import Real
from tfarm.errors import require
from tfarm.exact.compiled import compiled, inlined
from tfarm.records import frozen

CONSUMER = Consumer(
    "tune",
    acts=(
        "reference",
        "shaper",
        "anti-alias filter",
        "hub rate",
        "law",
        "hold",
        "delay",
        "hub damping",
        "plant",
    ),
    partly=(
        "encoder",
        "amplifier steps",
        "amplifier range",
        "DAC steps",
        "DAC range",
        "torque limit",
        "arithmetic",
    ),
    none=("volts",),
)


class NetworkInput(IntEnum):
    """Inputs of the network; the last is optional."""

    U_NOW = 0
    U_BEFORE = 1
    E_BEFORE = 2
    E_TWO_BEFORE = 3
    X_NOW = 4
    X_BEFORE = 5
    K_BEFORE = 6


class Limits(NamedTuple):
    """The ends of the guard of a gain; 0 and inf without one."""

    lo: float
    hi: float


class TrialModel(NamedTuple):
    """s' = A s + B torque from sample to sample; servo.s are angle and rate by their gains, moment.s is the moment.

    `own`.s is the arm's own root moment, before the anti-alias filter.
    """

    # A^T (n, n)
    turned: Real
    # (n, n)
    A: Real
    # (n,)
    B: Real
    # (n,)
    servo: Real
    # (n,)
    moment: Real
    # (n,)
    own: Real


class Reference(NamedTuple):
    """At each sample (N,): references of servo.s, torque counted in u and not counted, reference of the moment."""

    servo: Real
    counted: Real
    rest: Real
    rigid: Real


class Numbers(NamedTuple):
    """Weights `a` and `b` of the cost, period `T` [s], the largest |moment| [N m], samples from a torque to its x.

    `reply` is dx/d(torque) at that sample, the first where it is not 0: the one-step sensitivity of the plant.
    """

    a: float
    b: float
    T: float
    bound: float
    lag: int
    reply: float


class Setting(NamedTuple):
    """Constants of the training; `scales` (m,) divide the network's inputs."""

    model: TrialModel
    reference: Reference
    numbers: Numbers
    scales: Real
    limits: Limits


class TrialSignals(NamedTuple):
    """Record of a trial, one row for each sample: the network's inputs (N, m) and hidden neurons (N, h), signals (N,).

    These are x, u, e [N m], gain K, its slope dK/dz by the output neuron's sum, and the arm's own root moment [N m].
    """

    inputs: Real
    hidden: Real
    x: Real
    u: Real
    e: Real
    K: Real
    slope: Real
    moment: Real


class SampleBuffers(NamedTuple):
    """Buffers of one sample: `state` and `spare` (n,), `by_input` (m,)."""

    state: Real
    spare: Real
    by_input: Real


@inlined
def logistic(z: float) -> float:
    """Return 1/(1 + e^-z), without overflow."""
    if z >= 0.0:
        return 1.0 / (1.0 + exp(-z))
    small = exp(z)
    return small / (1.0 + small)


@compiled
def guard_gain(z: float, limits: Limits) -> tuple[float, float]:
    """Return the gain and its derivative for the output neuron's sum z.

    kappa = ln(1 + e^z) without a guard; lo + (hi - lo)(1 - e^-kappa) with one.
    """
    s = logistic(z)
    if limits.hi == inf:
        return max(z, 0.0) + log1p(exp(-abs(z))), s
    span = limits.hi - limits.lo
    return min(max(limits.lo + span * s, limits.lo), limits.hi), span * s * logistic(-z)


@compiled
def network_gain(weights: Real, inputs: Real, hidden: Real, limits: Limits) -> tuple[float, float]:
    """Return the network's gain and its derivative by the output neuron's sum; fill `hidden`."""
    m = inputs.size
    h = hidden.size
    z = 0.0
    for j in range(h):
        net = 0.0
        for i in range(m):
            net += weights[j * m + i] * inputs[i]
        hidden[j] = logistic(net)
        z += weights[h * m + j] * hidden[j]
    return guard_gain(z, limits)


@compiled
def gain_gradient(
    weights: Real, inputs: Real, hidden: Real, by_sum: float, out: Real, by_input: Real
) -> None:
    """Add by_sum times the derivative of the output neuron's sum by every weight to `out`; set that by each input."""
    m = inputs.size
    h = hidden.size
    by_input.fill(0.0)
    for j in range(h):
        out[h * m + j] += by_sum * hidden[j]
        by_net = by_sum * weights[h * m + j] * hidden[j] * (1.0 - hidden[j])
        for i in range(m):
            out[j * m + i] += by_net * inputs[i]
            by_input[i] += by_net * weights[j * m + i]


@inlined
def copy_into(source: Real, target: Real) -> None:
    """Set target = source, element by element: numba takes seconds to compile an assignment of arrays, a loop none."""
    for i in range(target.size):
        target[i] = source[i]


@inlined
def turn(rows: Real, vector: Real, out: Real) -> None:
    """Set out = rows^T vector, in the order of memory."""
    out.fill(0.0)
    for j in range(vector.size):
        v = vector[j]
        if v != 0.0:
            for i in range(out.size):
                out[i] += rows[j, i] * v


@inlined
def dot(a: Real, b: Real) -> float:
    """Return a . b."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@inlined
def sense(k: int, setting: Setting, run: TrialSignals, work: SampleBuffers) -> bool:
    """Read x and u at sample k and fill the network's inputs there; False where the moment passes the bound."""
    model = setting.model
    reference = setting.reference
    inputs = run.inputs[k]
    moment = dot(model.moment, work.state)
    if not abs(moment) <= setting.numbers.bound:
        return False
    run.x[k] = moment - reference.rigid[k]
    run.moment[k] = dot(model.own, work.state)
    run.u[k] = reference.counted[k] + reference.servo[k] - dot(model.servo, work.state)
    inputs.fill(0.0)
    inputs[NetworkInput.U_NOW] = run.u[k]
    inputs[NetworkInput.X_NOW] = run.x[k]
    if k >= 1:
        inputs[NetworkInput.U_BEFORE] = run.u[k - 1]
        inputs[NetworkInput.E_BEFORE] = run.e[k - 1]
        inputs[NetworkInput.X_BEFORE] = run.x[k - 1]
        if inputs.size > NetworkInput.K_BEFORE:
            inputs[NetworkInput.K_BEFORE] = run.K[k - 1]
    if k >= 2:
        inputs[NetworkInput.E_TWO_BEFORE] = run.e[k - 2]
    for i in range(inputs.size):
        inputs[i] /= setting.scales[i]
    return True


@inlined
def act(k: int, setting: Setting, weights: Real, run: TrialSignals, work: SampleBuffers) -> None:
    """Set the gain, e and the torque at sample k; advance by one sample."""
    model = setting.model
    state = work.state
    spare = work.spare
    run.K[k], run.slope[k] = network_gain(weights, run.inputs[k], run.hidden[k], setting.limits)
    run.e[k] = run.u[k] - run.K[k] * run.x[k]
    torque = run.e[k] + setting.reference.rest[k]
    turn(model.turned, state, spare)
    for i in range(state.size):
        state[i] = spare[i] + model.B[i] * torque


@compiled
def trial_cost(done: int, numbers: Numbers, run: TrialSignals) -> float:
    """Return T times the sum of a x^2/2 + b e^2/2 over the first `done` samples."""
    total = 0.0
    for k in range(done):
        total += 0.5 * numbers.a * run.x[k] ** 2 + 0.5 * numbers.b * run.e[k] ** 2
    return total * numbers.T


@compiled
def forward(setting: Setting, weights: Real, run: TrialSignals, work: SampleBuffers) -> int:
    """Run one trial with fixed weights into `run`; return the number of samples before the bound is passed."""
    work.state.fill(0.0)
    n = run.x.size
    for k in range(n):
        if not sense(k, setting, run, work):
            return k
        act(k, setting, weights, run, work)
    return n


@compiled
def backward(setting: Setting, weights: Real, run: TrialSignals, work: SampleBuffers, gradient: Real) -> None:
    """Set the gradient of the cost of the trial in `run`, through network, plant and time (reverse accumulation).

    `back` is the derivative by the state of the next sample.  `late_e`, `late_u`, `late_x`, `late_K` are derivatives
    by e, u, x and K of this sample through the inputs of later ones, `later_e` by e of the sample before.
    """
    model = setting.model
    a, b, T, _, _, _ = setting.numbers
    n, m = run.inputs.shape
    back, spare, by_input = work
    late_e = later_e = late_u = late_x = late_K = 0.0
    gradient.fill(0.0)
    back.fill(0.0)
    for k in range(n - 1, -1, -1):
        by_e = T * b * run.e[k] + dot(model.B, back) + late_e
        by_sum = (late_K - run.x[k] * by_e) * run.slope[k]
        gain_gradient(weights, run.inputs[k], run.hidden[k], by_sum, gradient, by_input)
        for i in range(m):
            by_input[i] /= setting.scales[i]
        by_u = by_e + by_input[NetworkInput.U_NOW] + late_u
        by_x = T * a * run.x[k] - run.K[k] * by_e + by_input[NetworkInput.X_NOW] + late_x
        turn(model.A, back, spare)
        for i in range(back.size):
            back[i] = spare[i] + model.moment[i] * by_x - model.servo[i] * by_u
        late_e = later_e + by_input[NetworkInput.E_BEFORE]
        later_e = by_input[NetworkInput.E_TWO_BEFORE]
        late_u = by_input[NetworkInput.U_BEFORE]
        late_x = by_input[NetworkInput.X_BEFORE]
        late_K = by_input[NetworkInput.K_BEFORE] if m > NetworkInput.K_BEFORE else 0.0


@compiled
def sample_gradient(
    k: int, numbers: Numbers, x_next: float, run: TrialSignals, weights: Real, out: Real, by_input: Real
) -> None:
    """Set the gradient of a x_next^2/2 + b e^2/2 by the weights of K at sample k."""
    by_gain = -run.x[k] * (numbers.a * x_next * numbers.reply + numbers.b * run.e[k])
    out.fill(0.0)
    gain_gradient(weights, run.inputs[k], run.hidden[k], by_gain * run.slope[k], out, by_input)


# neurons; the paper has 6
MOST_HIDDEN = 1000
# of the paper's network; one input more, the gain before, is optional
PAPER_INPUTS = 6
PAPER_HIDDEN = 6


@frozen
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
            require(
                np.isfinite(value).all(), name, value.tolist(), "every weight and scale is a finite number"
            )
            object.__setattr__(self, name, value)
        remedy = f"W1 is (hidden, 6 or 7), hidden from 1 to {MOST_HIDDEN}, with as many columns as scales"
        hidden, *inputs = self.W1.shape
        is_network = inputs in ([6], [7]) and 1 <= hidden <= MOST_HIDDEN
        require(is_network, "W1", self.W1.shape, remedy)
        require(self.w2.shape == (hidden,), "w2", self.w2.shape, f"one weight a hidden neuron, {hidden}")
        are_scales = self.scales.shape == (*inputs,) and (self.scales > 0).all()
        require(are_scales, "scales", self.scales.tolist(), f"one positive scale an input, {inputs[0]}")

    @property
    def weights(self) -> Real:
        """All weights in one vector: W1 row by row, then w2."""
        return np.r_[self.W1.ravel(), self.w2]

    def with_weights(self, weights: Real) -> Network:
        """Return the network of the same size with these weights (in the order of `weights`)."""
        first = self.W1.size
        return Network(weights[:first].reshape(self.W1.shape), weights[first:], self.scales)

    def gain(self, signals: Real, guard: Limits) -> float:
        """Return K for one row of inputs [N m], not scaled; `guard` as in `guard_gain`."""
        return float(network_gain(self.weights, signals / self.scales, np.zeros(self.w2.size), guard)[0])


def initial_network(seed: int, *, hidden: int = PAPER_HIDDEN, scales: Real | None = None) -> Network:
    """Return weights uniform in (-0.5, 0.5), by NumPy's PCG64 of that seed; `scales` (6 or 7) default to 1 N m."""
    seed = whole("seed", seed, 0, 2**63 - 1, "a seed is a whole number from 0 to 2^63 - 1")
    hidden = whole("hidden", hidden, 1, MOST_HIDDEN, f"a whole number of neurons from 1 to {MOST_HIDDEN}")
    widths = np.ones(PAPER_INPUTS) if scales is None else np.asarray(scales, dtype=float)
    draw = np.random.default_rng(seed).uniform(-0.5, 0.5, hidden * (widths.size + 1))
    return Network(draw[:-hidden].reshape(hidden, widths.size), draw[-hidden:], widths)
