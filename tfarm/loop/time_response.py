"""Time responses of the exact loop in continuous time: sums of exponentials from its poles.

An input is sum_i w_i e^{-s t_i} X(s), with X rational: at the actuator, X_u, or the reference X_k of a signal.  So

    y(t) = sum_i w_i h(t - t_i),    h(t) = sum_m A_m e^{z_m t},
    H(s) = N_y (q X_u + e^{-s tau} sum_k p_k X_k)/D,    D = drive q + e^{-s tau} sum_k p_k N_k

with numerators N, law p_k/q and delay tau of `loop`.  The poles z_m are those of D, complete in a box, and those of X.
Residues are trapezoidal sums on circles, which converge geometrically (Trefethen and Weideman, SIAM Review 56, 2014).
Poles that are closer than 1/T, T the duration, cancel in a sum of residues, as do those at s = 0: there the terms are
the nodes s_j of one circle around all of them, with H(s_j) (s_j - c)/n.

Remainder, the poles outside the box.  Above its top: residues fall from octave to octave of frequency by a factor that
is measured in the last ones, and the sum goes on as a geometric series.  Left of it: h(0+) = lim s H(s) is known, so
the sum of all omitted residues is, and these decay at least as fast as the left edge.  This is a measured bound and no
proof.  Shear modes above the shear cut-off of a damped arm are not in it.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse.csgraph import connected_components

from tfarm.arrays import LEAST_SIZE, MACHINE_EPS, Complex, Real
from tfarm.errors import require
from tfarm.records import record
from tfarm.response.signals import Signals
from tfarm.spectrum.table import first_frequency

from .loop import FAR_RIGHT, Loop, band_of
from .poles import Poles, poles_below

ACTUATOR, TORQUE = "actuator", "torque"  # the input of the arm as a place of excitation, and as a signal
USUAL_COUNT = 80  # flexible modes below the top of the box
CLOSE, MOST_CLOSE = 3.0, 0.1  # poles closer than 3/T are one circle, but no farther apart than 0.1 of the first mode
SLOW_RADIUS = 2.0  # over T, of a circle around s = 0, on which e^{s T} is moderate; or times the extent of its poles
POLE_RADIUS = 0.25  # of the way to the next pole: radius of the circle of one pole
POLE_NODES, FEWEST_NODES, MOST_NODES, NODE_LOG = 32, 128, 512, 40.0  # of circles; e^-40 is below the rounding
ON_AXIS = 1e-9  # of the least distance of two circles: by so little a centre is off the real axis
LEAST_FALL, MOST_FALL = 0.5, 0.9  # of the sum of residues from one octave of frequency to the next
IDENTITY_FACTOR = 2.0  # on the sum of the omitted residues at t = 0+, whose signs differ
BLOCK = 20_000  # times that are evaluated together: with 200 terms 64 MB
MOST_GROWTH = 500.0  # exponent of the fastest growing pole at the end of a record
ZOOM_POINTS, ZOOMS = 41, 5  # of the search for a peak: each narrows the interval by a factor of 20

Transform = Callable[[Complex], Complex]


@dataclass(frozen=True)
class Excitation:
    """Inputs sum_i w_i e^{-s t_i} X(s) of a loop: `inputs` are X by place, `poles` those of all X [1/s] but 0.

    A place is `ACTUATOR`, a signal whose reference it is, or a column of references of the law (with the minus of its
    sign).  `free` is a motion that is added to signals, and which the law feeds back.
    """

    inputs: Mapping[str, Transform]
    times: tuple[float, ...] = (0.0,)
    weights: tuple[float, ...] = (1.0,)
    poles: tuple[complex, ...] = ()
    free: Mapping[str, Transform] = field(default_factory=dict)


@dataclass(frozen=True)
@record
class TimeResponse:
    """Signals over time by name, "torque" being the input: h is Re of the sum of `amplitudes` (signals, m) e^{z t}.

    `initial` is h(0+) (signals,).
    """

    names: tuple[str, ...]
    excitation: Excitation
    poles: Poles
    z: Complex
    amplitudes: Complex
    initial: Real

    def at(self, t: Real) -> Real:
        """Return the signals (signals, n) at times t [s]."""
        return self._summed(t, lambda tau: (self.amplitudes @ np.exp(np.outer(self.z, tau))).real)

    def remainder(self, t: Real) -> Real:
        """Return the bound (signals, n) on the contribution of the poles outside the box at times t [s]."""
        left, _, _, top = self.poles.box
        last, before = ((self.z.imag > top / 2 ** (n + 1)) & (self.z.imag <= top / 2**n) for n in (0, 1))
        sizes = abs(self.amplitudes)
        fall = sizes[:, last].sum(axis=1) / np.maximum(sizes[:, before].sum(axis=1), LEAST_SIZE)
        fall = np.clip(fall, LEAST_FALL, MOST_FALL)[:, None]
        slowest = self.z[last].real.max(initial=left)
        omitted = IDENTITY_FACTOR * abs(self.amplitudes.sum(axis=1).real - self.initial)[:, None]

        def bound(tau: Real) -> Real:
            above = fall / (1 - fall) * (sizes[:, last] @ np.exp(np.outer(self.z[last].real, tau)))
            return np.asarray(np.maximum(above, omitted * np.exp(slowest * tau)))

        return self._summed(t, bound, np.abs)

    def _summed(self, t: Real, h: Callable[[Real], Real], size: Callable[[float], float] = float) -> Real:
        """Sum of w_i h(t - t_i), the weights or their sizes, in blocks of times."""
        found = np.zeros((len(self.names), t.size))
        for start, weight in zip(self.excitation.times, self.excitation.weights, strict=True):
            later = np.flatnonzero(t >= start)
            for part in np.array_split(later, 1 + later.size // BLOCK):
                found[:, part] += size(weight) * h(t[part] - start)
        return found

    def peak(self, name: str, t: Real) -> tuple[float, float, float]:
        """Return time [s] and value of a signal where it is largest in size, near that of `t`, and the bound there.

        A bound below the rounding of the value, 2.2e-16 of its size, is that.
        """
        row = self.names.index(name)
        for _ in range(ZOOMS):
            n = int(abs(self.at(t)[row]).argmax())
            t = np.linspace(t[max(n - 1, 0)], t[min(n + 1, t.size - 1)], ZOOM_POINTS)
        y = self.at(t)[row]
        n = int(abs(y).argmax())
        return float(t[n]), float(y[n]), max(float(self.remainder(t[[n]])[row, 0]), MACHINE_EPS * abs(float(y[n])))


def usual_poles(loop: Loop, count: int = USUAL_COUNT) -> Poles:
    """Return the poles of a response: those below a frequency with `count` flexible modes, complete in their box.

    Raises ConvergenceError where they are not complete.
    """
    return poles_below(loop, band_of(loop.arm, count))


def time_response(poles: Poles, names: tuple[str, ...], excitation: Excitation, duration: float) -> TimeResponse:
    """Return the signals of these names and "torque" over `duration` [s] from the poles of the loop.

    Raises ParameterError for a loop that grows beyond a double.
    """
    growth = float(poles.values.real.max(initial=0.0)) * duration
    require(
        growth < MOST_GROWTH, "duration", duration,
        f"the loop is unstable and grows by e^{growth:.0f}; at most {MOST_GROWTH * duration / max(growth, 1):.3g} s",
    )  # fmt: skip

    def transform(s: Complex) -> Complex:
        return transformed(poles.loop, names, excitation, s)

    z, amplitudes = zip(*_terms(poles, excitation, transform, duration), strict=True)
    far = np.array([FAR_RIGHT[1] * first_frequency(poles.loop.arm)], complex)
    initial = (transform(far) * far).real[:, 0]
    return TimeResponse((*names, TORQUE), excitation, poles, np.concatenate(z), np.hstack(amplitudes), initial)


def transformed(loop: Loop, names: tuple[str, ...], excitation: Excitation, s: Complex) -> Complex:
    """Return H (signals and torque, n) at s (n,)."""
    law, of = loop.law, Signals(loop.arm, tuple(dict.fromkeys((*loop.law.signals, *names))))
    drive, numerators, _ = of.parts(s)
    row, columns = dict(zip(of.names, numerators, strict=True)), (*law.signals, *law.wanted)
    shares, whole = law.shares(s, columns)
    entries = dict(zip(columns, np.exp(-s * law.delay) * shares.sum(axis=0), strict=True))
    D = drive * whole + sum(entries[name] * row[name] for name in law.signals)
    free = {name: motion(s) for name, motion in excitation.free.items()}
    driven = sum(X(s) * (whole if place == ACTUATOR else entries[place]) for place, X in excitation.inputs.items())
    driven = driven - sum(entries[name] * free[name] for name in law.signals if name in free)
    found = np.array([*(row[name] for name in names), drive]) * driven / D
    return found + np.array([free.get(name, 0 * s) for name in (*names, TORQUE)])


def _terms(
    poles: Poles, excitation: Excitation, transform: Transform, duration: float
) -> Iterator[tuple[Complex, Complex]]:
    """Exponents (m,) and amplitudes (signals, m) of each pole or circle with Im >= 0, twice those with a conjugate."""
    known = np.r_[poles.values, np.array(excitation.poles, complex)]
    every = np.unique(np.r_[0, known, known.conj()])
    reach = min(CLOSE / duration, MOST_CLOSE * first_frequency(poles.loop.arm))
    _, label = connected_components(abs(every[:, None] - every) <= reach)
    left, _, _, top = poles.box
    for n in range(label.max() + 1):
        own = every[label == n]
        c = complex(own.mean())
        edges = [*poles.loop.k.singular, complex(left, c.imag), complex(c.real, top)]
        room = float(abs(np.r_[every[label != n], edges] - c).min())
        if c.imag >= -ON_AXIS * reach:
            z, amplitudes = _circle(own, c, room, transform, duration)
            yield z, amplitudes * (2.0 if c.imag > ON_AXIS * reach else 1.0)


def _circle(own: Complex, c: complex, room: float, transform: Transform, duration: float) -> tuple[Complex, Complex]:
    """The nodes of a circle around poles, to a distance of `room` from others; of a simple pole its residue."""
    is_simple, extent, radius = own.size == 1 and c != 0, float(abs(own - c).max()), POLE_RADIUS * room
    if not is_simple:
        radius = min(math.sqrt(extent * room) or radius, SLOW_RADIUS * max(extent, 1 / duration))
    ratio = max(extent / radius, radius / room)
    nodes = int(np.clip(-NODE_LOG / math.log(ratio), POLE_NODES if is_simple else FEWEST_NODES, MOST_NODES))
    arrow = radius * np.exp(2j * np.pi * (np.arange(nodes) + 0.5) / nodes)
    values = transform(c + arrow) * arrow / nodes
    return (own, values.sum(axis=1)[:, None]) if is_simple else (c + arrow, values)
