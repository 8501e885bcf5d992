"""A road to the sampled arm that shares no code with tfarm.dsp: the exact transfer function, aliased.

A sample sees every frequency s + 2 pi i n/T at once: with a zero-order hold and a delay tau the pulse transfer function
is

    H(z) = sum over n of G(s_n) (1 - 1/z)/(s_n T) e^{-s_n tau},   z = e^{s T}, s_n = s + 2 pi i n/T

(the torque e^{-s tau} is shifted, so that for a whole delay e^{-s_n tau} is a power of 1/z).
"""

import numpy as np

import tfarm


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
