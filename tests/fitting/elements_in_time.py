"""A sampled rig of finite elements (`tests.chain_elements`) in time, for the tests only: it has nothing of tfarm.

    x' = A x + B (gain u(t - delay) + bias),    y = C x,    x exact between the samples

The computer's u is held from a sample to the next.  Signals are read just before a sample, each with its offset, noise
and steps, and a law is a difference equation of each of its signals, e = reference - signal:

    den_0 v_k = num_0 e_k + num_1 e_{k-1} + ... - den_1 v_{k-1} - ...,    u_k = sum of v_k

Several runs of one rig are columns (m,): each has its own start, bias, factor of the input and offsets.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import schur

from tests.dsp.independent import held
from tests.loop.rig_loops import RigLoop

# derivatives of a motion in signals
ORDER = {"hub_rate": 1, "tip_acceleration": 2}
# signals that pass the analog filter
ANALOG = ("hub_rate", "root_moment", "tip_acceleration")


@dataclass(frozen=True)
class Body:
    """A part of the payload on a spring: `share` of its mass, whose own frequency on a tip at rest is `frequency`."""

    share: float
    frequency: float  # rad/s
    damping: float  # of its spring, s


class Plant:
    """A, B, C of a rig from its input to signals, through a first-order filter of that corner [rad/s]."""

    def __init__(self, arm, names, up_to, *, body=None, corner=math.inf):
        loop = RigLoop(arm, up_to)
        full, output = loop.system.full, loop.system.model.output
        if body is not None:
            _hang(loop, output("payload_displacement", 1.0) @ full, body.share * arm.payload.mass, body)
        A, B, rows = loop.state_space()
        C = []
        for name in names:
            row = np.zeros(len(loop.K))
            row[: full.shape[1]] = output(name, 1.0) @ full
            still, rate = rows(row)
            # waves take their time: no signal follows the torque at once
            C.append((still, rate, rate @ A)[ORDER.get(name, 0)])
        self.names = tuple(names)
        self.A, self.B, self.C = A, B, np.array(C)
        if math.isfinite(corner):
            self._filter([n for n, name in enumerate(names) if name in ANALOG], corner)

    def _filter(self, analog, corner):
        """y_f' = corner (y - y_f) of these signals."""
        n, m = len(self.A), len(analog)
        self.A = np.block([[self.A, np.zeros((n, m))], [corner * self.C[analog], -corner * np.eye(m)]])
        self.B = np.r_[self.B, np.zeros(m)]
        self.C = np.hstack([self.C, np.zeros((len(self.C), m))])
        self.C[analog] = np.eye(n + m)[n:]

    def slow_states(self, below):
        """A basis (states, k) of the motions in all modes with |s| < below."""
        _, vectors, count = schur(self.A, sort=lambda re, im: math.hypot(re, im) < below)
        return vectors[:, :count]

    def pushed(self, duration, quiet):
        """The states after a smooth push of that duration [s] and a time of rest."""
        return held(self.A, self.B, quiet)[0] @ self._after(np.hanning, duration)

    def settled(self, duration):
        """The states under a unit input that has come up smoothly in that duration [s]: of modes, those at rest."""
        return self._after(lambda pieces: (1 - np.cos(np.pi * np.arange(pieces) / pieces)) / 2, duration)

    def _after(self, shape, duration, pieces=100):
        """The states after an input of that shape, from rest."""
        whole, part = held(self.A, self.B, duration / pieces)
        x = np.zeros(len(self.A))
        for each in shape(pieces):
            x = whole @ x + part * each
        return x


def _hang(loop, tip, mass, body):
    """A further motion, that of a body on a spring from the payload's centre."""
    tip = np.r_[tip, np.zeros(len(loop.K) - tip.size)]
    stretch = np.r_[tip, -1.0]
    spring = mass * body.frequency**2 * np.outer(stretch, stretch)
    for name, more in (("K", spring), ("D", body.damping * spring), ("M", np.diag(np.r_[0 * tip, mass]))):
        setattr(loop, name, np.pad(getattr(loop, name), (0, 1)) + more)
    loop.M[:-1, :-1] -= mass * np.outer(tip, tip)
    for name in ("hub", "gauge", "works"):
        setattr(loop, name, np.r_[getattr(loop, name), 0.0])


@dataclass(frozen=True)
class Drive:
    """What acts on the rig is gain u(t - delay) + bias."""

    gain: float = 1.0
    delay: float = 0.0
    bias: float = 0.0


@dataclass(frozen=True)
class Computer:
    """The period [s], the input (n,) of an open loop, or a law {signal: (num, den)} in z and references {signal: (n,)}.

    `offset`, `noise` (deviation) and `step` are by signal.  `before` is the input that acts until the first reaches the
    drive.
    """

    period: float
    count: int
    input: np.ndarray | None = None
    law: dict = field(default_factory=dict)
    references: dict = field(default_factory=dict)
    offset: dict = field(default_factory=dict)
    noise: dict = field(default_factory=dict)
    step: dict = field(default_factory=dict)
    before: float = 0.0


class Filter:
    """One signal's difference equation, of m columns."""

    def __init__(self, num, den, m):
        self.num, self.den = np.asarray(num, float) / den[0], np.asarray(den, float) / den[0]
        # a numerator of lower degree is late
        self.num = np.r_[np.zeros(self.den.size - self.num.size), self.num]
        self.errors = np.zeros((self.num.size, m))
        self.values = np.zeros((self.den.size - 1, m))

    def __call__(self, error):
        self.errors = np.vstack([error, self.errors[:-1]])
        value = self.num @ self.errors - self.den[1:] @ self.values
        self.values = np.vstack([value, self.values[:-1]])[: len(self.values)]
        return value


def simulate(plant, drive, computer, *, start=None, rng=None, factor=1.0, bias=None, offset=None):
    """What the computer read (signals, n, m), its inputs u (n, m), and the states at the end, from a start (states, m).

    `factor` (m,) is one on input and references, `bias` (m,) that of the drive, `offset` (signals, m) that of sensors.
    """
    T, names = computer.period, plant.names
    x = np.zeros((len(plant.A), 1)) if start is None else np.reshape(start, (len(plant.A), -1))
    offset = np.array([[computer.offset.get(name, 0.0)] for name in names]) if offset is None else offset
    bias = np.atleast_1d(drive.bias if bias is None else bias)
    factor = np.atleast_1d(factor)
    m = max(x.shape[1], bias.size, factor.size, np.shape(offset)[1])
    x = x * np.ones(m)
    late = drive.delay / T
    d = math.floor(late)
    first, of_old = held(plant.A, plant.B, (late - d) * T)
    second, of_new = held(plant.A, plant.B, (1 - late + d) * T)
    whole, of_old = second @ first, (second @ of_old)[:, None]
    of_new = of_new[:, None]
    deviation = np.array([[computer.noise.get(name, 0.0)] for name in names])
    noise = np.zeros((computer.count, len(names), 1))
    if rng is not None:
        noise = deviation * rng.standard_normal((computer.count, len(names), 1))
    steps = [(n, computer.step[name]) for n, name in enumerate(names) if computer.step.get(name)]
    filters = [(names.index(name), name, Filter(*of, m)) for name, of in computer.law.items()]
    read, inputs = np.zeros((len(names), computer.count, m)), np.zeros((computer.count, m))
    # the last d + 1 inputs of the drive, the newest first
    queue = [drive.gain * computer.before * factor + bias] * (d + 1)
    for k in range(computer.count):
        y = plant.C @ x + offset + noise[k]
        for n, step in steps:
            y[n] = np.rint(y[n] / step) * step
        read[:, k] = y
        u = computer.input[k] * factor if not filters else 0.0
        for n, name, of in filters:
            wanted = computer.references.get(name)
            u = u + of((0.0 if wanted is None else wanted[k] * factor) - y[n])
        inputs[k] = u
        queue.insert(0, drive.gain * u + bias)
        old = queue.pop()
        x = whole @ x + of_old * old + of_new * queue[-1]
    return read, inputs, x
