"""The trial again, in plain NumPy and from nothing but the modal model: matrix exponential, slew, loop, network.

Every formula is analytic, so that weights may be complex: the derivative by complex step is right to the last digits.
"""

import numpy as np
from scipy.linalg import expm

from tfarm.reduced import modal_model
from tfarm.tuner import kernel

RISE, TRAVEL = 1.0, 1.15


class PlainTrial:
    """3 s of the slew with `count` modes at T = 10 ms."""

    def __init__(self, arm, count=6, K1=0.3, a=1.0, b=2.6, signals="vibration", T=0.01, n=301, Kp=0.0):
        self.Kp, self.K1, self.a, self.b, self.T, self.n, self.total = Kp, K1, a, b, T, n, signals == "total"
        model = modal_model(arm, ["hub_angle", "hub_rate", "root_moment"], count)
        A, B, C, D = model.matrices()
        size = len(A)
        block = expm(np.block([[A, B], [np.zeros((1, size + 1))]]) * T)
        self.A, self.B, self.C, self.D = block[:size, :size], block[:size, size], C, D[:, 0]
        half, whole = round(RISE / 2 / T), round(RISE / T)
        acceleration = np.zeros(n)
        acceleration[:half], acceleration[half:whole] = 1.0, -1.0
        acceleration *= 4 * TRAVEL / arm.link.length / RISE**2
        self.rate = np.r_[0.0, np.cumsum(acceleration)[:-1]] * T
        self.angle = np.r_[0.0, np.cumsum(self.rate * T + acceleration * T**2 / 2)[:-1]]
        self.torque = arm.total_inertia * acceleration
        inertia = arm.total_inertia - arm.hub.inertia
        self.rigid = np.zeros(n) if self.total else -inertia * np.r_[0.0, acceleration[:-1]]

    def run(self, gain):
        """Signals x, u, e, K (n, 4) with K = gain(row of seven inputs), and the cost."""
        state = np.zeros(len(self.A), complex)
        before, signals = 0.0, np.zeros((self.n + 2, 4), complex)  # two empty samples first
        for k in range(self.n):
            angle, rate, moment = self.C @ state + self.D * before
            x = moment - self.rigid[k]
            servo = self.Kp * (self.angle[k] - angle) + self.K1 * (self.rate[k] - rate)
            u = servo + (self.torque[k] if self.total else 0.0)
            (_, _, e2, _), (x1, u1, e1, K1) = signals[k], signals[k + 1]
            K = gain(np.array([u, u1, e1, e2, x, x1, K1]))
            signals[k + 2] = x, u, u - K * x, K
            before = signals[k + 2, 2] + (0.0 if self.total else self.torque[k])
            state = self.A @ state + self.B * before
        signals = signals[2:]
        cost = self.T * np.sum(self.a * signals[:, 0] ** 2 + self.b * signals[:, 2] ** 2) / 2
        return signals, cost

    def cost(self, weights, hidden, scales, guard):
        """The cost with a network, its weights in the order of `Network.weights`."""
        return self.run(lambda row: plain_gain(row, weights, hidden, scales, guard))[1]


def gradient_of(trial, network, guard):
    """The cost of a trial and its derivative by every weight, as learning has them."""
    setting, weights, (run, work) = trial.setting(network, guard), network.weights, trial.room(network)
    done, gradient = kernel.forward(setting, weights, run, work), np.zeros(weights.size)
    kernel.backward(setting, weights, run, work, gradient)
    return kernel.trial_cost(done, trial.numbers, run), gradient


def gradient_of_sample(trial, network, guard, k):
    """The delta rule's gradient: of a x^2/2 at the first sample that answers the torque of sample k, plus b e^2/2."""
    weights, (run, work) = network.weights, trial.room(network)
    kernel.forward(trial.setting(network, guard), weights, run, work)
    gradient, answer = np.zeros(weights.size), run.x[k + trial.numbers.lag]
    kernel.sample_gradient(k, trial.numbers, answer, run, weights, gradient, work.by_input)
    return gradient


def plain_gain(row, weights, hidden, scales, guard):
    """The paper's network: K = ln(1 + e^z), or bent into the guard by 1 - e^-K."""
    m = len(scales)
    W1, w2 = weights[: hidden * m].reshape(hidden, m), weights[hidden * m :]
    z = w2 @ (1 / (1 + np.exp(-W1 @ (row[:m] / scales))))
    kappa = np.log(1 + np.exp(z))
    return kappa if np.isinf(guard.hi) else guard.lo + (guard.hi - guard.lo) * (1 - np.exp(-kappa))


def complex_step(f, weights, step=1e-30):
    """df/dw of an analytic real function: the imaginary part at w + i h, no difference taken."""
    gradient = np.zeros(weights.size)
    for i in range(weights.size):
        shifted = weights.astype(complex)
        shifted[i] += 1j * step
        gradient[i] = f(shifted).imag / step
    return gradient
