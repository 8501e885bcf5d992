"""Methods for the sampled arm that share no code with tfarm.dsp: the exact transfer function, aliased; expm.

A sample sees every frequency s + 2 pi i n/T at once: with a zero-order hold and a delay tau the pulse transfer function
is

    H(z) = sum over n of G(s_n) (1 - 1/z)/(s_n T) e^{-s_n tau},   z = e^{s T}, s_n = s + 2 pi i n/T

(the torque e^{-s tau} is shifted, so that for a whole delay e^{-s_n tau} is a power of 1/z).
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

import tfarm
from tfarm.dsp.plant import is_analog
from tfarm.reduced.modal import sensed_model
from tfarm.response.signals import Signals

MODES = 40
AT_ONE = 1e-4  # as near to 1 is an eigenvalue that is there three times


def aliased(G, z, period, delay=0.0, terms=20_000):
    """The symmetric partial sum over n = -terms..terms of a callable G(s) -> (outputs, n) at one complex z."""
    n = np.arange(-terms, terms + 1)
    s = (np.log(complex(z)) + 2j * np.pi * n) / period
    hold = (1 - 1 / z) / (s * period) * np.exp(-s * delay * period)
    return (np.atleast_2d(G(s)) * hold).sum(axis=1)


def aliased_loop(arm, z, period, delay=0.0, terms=20_000):
    """R(z) and M(z), hub rate and root moment per torque, on the exact arm: (2,).

    The rate's slow tail 1/(I_h s) is the hub alone, whose pulse transfer function is known: T/(I_h (z - 1)) z^-d, the
    fraction f taking its share from one sample earlier.
    """
    exact, inertia = tfarm.transfer(arm, ["hub_rate", "root_moment"]), arm.hub.inertia

    def rest(s):
        values = exact(s)
        values[0] -= 1 / (inertia * s)
        return values

    whole = int(np.floor(delay))
    f = delay - whole
    hub = period * ((1 - f) + f / z) / (z - 1) / inertia / z**whole
    return aliased(rest, z, period, delay, terms) + np.array([hub, 0])


def read_analog(arm, law, chain, count):
    """A, B, C, D to what is sampled: the actuator's damping as friction of the hub, the anti-alias filter as states."""
    damping, corner = chain.actuator.hub_damping, chain.sampling.antialias_corner
    if damping:
        arm = replace(arm, hub=replace(arm.hub, friction=arm.hub.friction + damping))
    A, B, C, D = sensed_model(arm, law.signals, count)
    rows = [n for n, each in enumerate(Signals(arm, law.signals).outputs) if is_analog(each, chain)]
    if np.isinf(corner) or not rows:
        return A, B, C, D
    n, m = len(A), len(rows)
    whole = np.block([[A, np.zeros((n, m))], [corner * C[rows], -corner * np.eye(m)]])
    seen, through = np.hstack([C, np.zeros((len(C), m))]), D.copy()
    seen[rows], through[rows] = np.eye(n + m)[n:], 0.0
    return whole, np.vstack([B, corner * D[rows]]), seen, through


def held(A, B, duration):
    """What a time [s] makes of the states, and what a unit input held so long adds."""
    n = len(A)
    both = expm(duration * np.block([[A, np.reshape(B, (n, 1))], [np.zeros((1, n + 1))]]))
    return both[:n, :n], both[:n, n]


def stepped(arm, law, chain, count=MODES):
    """The closed loop's matrix of a modal model: matrix exponentials, held inputs and the law's states."""
    A, B, C, D = read_analog(arm, law, chain, count)
    T, d = chain.sampling.period, chain.sampling.whole_delay
    f = chain.sampling.fraction
    n = len(A)
    (first, late), (second, early) = held(A, B, f * T), held(A, B, (1 - f) * T)
    Ak, Bk, Ck, Dk = law.matrices()
    m = len(Ak)
    size = n + d + 1 + m  # the arm, u_{k-1} .. u_{k-d-1}, the law
    states, inputs, own = np.arange(n), n + np.arange(d + 1), n + d + 1 + np.arange(m)
    read = np.zeros((len(C), size))
    read[:, states], read[:, inputs[-1]] = C, D[:, 0]
    u = -Dk @ read
    u[:, own] -= Ck
    M = np.zeros((size, size))
    M[np.ix_(states, states)] = second @ first
    M[states, inputs[-1]] += second @ late
    M[states] += np.outer(early, u[0]) if d == 0 else 0.0
    if d:
        M[states, inputs[-2]] += early
        M[inputs[1:], inputs[:-1]] = 1.0
    M[inputs[0]] = u[0]
    M[own] = Bk @ read
    M[np.ix_(own, own)] += Ak
    return M


def radius_of(M, at_one=0):
    """ln of the spectral radius without `at_one` poles at z = 1, that of a free hub angle among them."""
    z = np.linalg.eigvals(M)
    near = np.argsort(abs(z - 1), kind="stable")[:at_one]
    assert (abs(z[near] - 1) < AT_ONE).all()
    return float(np.log(abs(np.delete(z, near)).max()))
