"""Input shaping: impulses that a reference passes, whose sum vanishes at poles of the sampled loop.

A reference through impulses c_k leaves of a mode with the pole z the share |sum of c_k z^-k| (Singer and Seering,
1990).
On the sample grid a zero-vibration shaper (ZV) has three impulses: now, n and n + 1 samples later, with n the whole
samples of half a period:

    c_0 + c_n z^-n + c_{n+1} z^-(n+1) = 0,   c_0 + c_n + c_{n+1} = 1

exactly zero for that mode of the linear loop, for any period: the two last stand for one between the samples.  ZVD is
ZV twice, a double zero: its share has no slope over the frequency there.  The extra-insensitive one (EI; Singhose,
Seering and Singer, 1994) leaves a share V of the vibration at the mode itself, and is zero at two frequencies next to
it, w (1 +- d) with cos(pi d) = (1 - V)/(1 + V): five impulses, now and around half and whole the period.  Those of
several modes are in a row.

The poles are those of the loop under its whole law, each followed from that of the arm alone as the law grows from 0.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from tfarm.arm import AT_HUB, AnyLaw, Arm
from tfarm.arm.chain import TIME_ROUNDING, Chain
from tfarm.arrays import Complex, Real
from tfarm.case import Case
from tfarm.dsp.branches import follow_branches, match_poles
from tfarm.dsp.discretise import acting_law, law_in_z
from tfarm.dsp.plant import USUAL_MODES
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.sensed import sensed_plant

MOMENT = AT_HUB[2]
# of the law, over which the poles are followed from those of the arm alone
SHARES = np.linspace(0.0, 1.0, 25)


def zero_vibration(z: complex) -> Real:
    """Return the impulses (n + 2,) of the shaper with zeros at z and its conjugate, 0 < arg z < pi."""
    n = samples_of_half_period(z)
    return impulses_with_zeros([z], [0, n, n + 1])


def impulses_with_zeros(zeros: Sequence[complex], at: Sequence[int]) -> Real:
    """Return impulses at these samples, of sum 1, that vanish at these zeros and their conjugates."""
    powers = np.array(zeros)[:, None] ** -np.array(at, dtype=float)
    wanted = np.zeros(len(at))
    wanted[-1] = 1.0
    impulses = np.zeros(at[-1] + 1)
    impulses[list(at)] = np.linalg.solve(np.r_[powers.real, powers.imag, np.ones((1, len(at)))], wanted)
    return impulses


def samples_of_half_period(z: complex, share: float = 1.0) -> int:
    """Return the whole samples of half a period of a pole times a share, at least one."""
    return max(1, math.floor(share * math.pi / abs(np.angle(z)) * (1 + TIME_ROUNDING)))


def zero_vibration_and_slope(z: complex) -> Real:
    """Return the impulses of the shaper with double zeros at z and its conjugate."""
    once = zero_vibration(z)
    return np.convolve(once, once)


def extra_insensitive(z: complex) -> Real:
    """Return the impulses of the shaper with zeros next to the frequency of z, and that of its authors on samples."""
    # V, the share of the vibration that is left at the mode itself, is that of its authors
    V = 0.05
    d = math.acos((1 - V) / (1 + V)) / math.pi
    # in rad a sample, below pi
    turns = (min(float(np.angle(z)) * factor, 0.999 * math.pi) for factor in (1 - d, 1 + d))
    zeros = [complex(abs(z) * np.exp(1j * turn)) for turn in turns]
    n = samples_of_half_period(z)
    # those of a whole period, beyond those of half of one
    whole = max(n + 2, samples_of_half_period(z, 2.0))
    return impulses_with_zeros(zeros, [0, n, n + 1, whole, whole + 1])


BUILDERS: dict[str, Callable[[complex], Real]] = {
    "ZV": zero_vibration,
    "ZVD": zero_vibration_and_slope,
    "EI": extra_insensitive,
}


def share_left(impulses: Real, z: Complex | complex) -> Any:
    """Return |sum of c_k z^-k|, the share of a mode's vibration that impulses leave."""
    return abs(np.polyval(impulses[::-1], 1 / z))


def loop_modes(case: Case, count: int = USUAL_MODES) -> dict[int, complex]:
    """Return the pole z, Im z > 0, of each flexible mode of the loop below half the sampling rate, by its number.

    An overdamped one has none.
    """
    acting, chain = acting_law(case, case.feedback)
    in_z = law_in_z(case.feedback, acting, chain)
    sensed = sensed_plant(case.arm, chain, in_z.signals, count)
    pulse = PulseTransfer(sensed.together, chain.sampling).without_fast_poles()
    A, B, C = pulse.matrices()
    own, read, row, through = in_z.matrices
    open_loop = np.block([[A, np.zeros((len(A), len(own)))], [read @ C, own]])
    push = np.r_[B, np.zeros(len(own))]
    fed_back = np.outer(push, np.r_[through.sum(axis=0) @ C, row.sum(axis=0)])
    return modes_under(open_loop - np.multiply.outer(SHARES, fed_back), modes_alone(pulse))


def modes_alone(pulse: PulseTransfer) -> dict[int, complex]:
    """Return the pole z, Im z > 0, of each mode of an arm alone below half the sampling rate, by its number."""
    is_below = (pulse.poles.imag > 0) & (pulse.poles.imag * pulse.sampling.period < math.pi)
    upper = is_below & (pulse.mode > 0)
    return dict(zip(pulse.mode[upper].tolist(), pulse.multipliers[upper].tolist(), strict=True))


def modes_under(matrices: Real, alone: dict[int, complex]) -> dict[int, complex]:
    """Return the same of a loop, followed from those of the arm alone over matrices (shares, n, n) of a growing law.

    An overdamped mode has none, and one that decays to 0.1 % in half a period.
    """
    poles = np.linalg.eigvals(matrices).astype(complex)
    starts = match_poles(np.array([*alone.values()], complex), poles[0])
    ends = follow_branches([*poles], SHARES)[-1][starts].tolist()
    # a shaper for the conjugate is the same
    found = {mode: complex(z.real, abs(z.imag)) for mode, z in zip(alone, ends, strict=True)}
    # 0.1 % of its vibration is left after half a period: a shaper would only take time
    fastest = math.log(1e3) / math.pi
    return {mode: found[mode] for mode in sorted(found) if decay_of(found[mode]) < fastest}


def decay_of(z: complex) -> float:
    """Return the decay of a pole over its angle, -ln|z|/arg z; infinite of a real one."""
    # 1e-9: of a real pole
    return -math.log(abs(z)) / float(np.angle(z)) if z.imag > 1e-9 else math.inf


def impulses_at(poles: dict[int, complex], kind: str, modes: int) -> Real:
    """Return the impulses of a shaper for the first modes of those whose poles are given; one impulse without any."""
    impulses = np.ones(1)
    for mode in range(1, modes + 1):
        if mode in poles and kind in BUILDERS:
            impulses = np.convolve(impulses, BUILDERS[kind](poles[mode]))
    return impulses


def impulses_of(arm: Arm, chain: Chain, law: AnyLaw) -> Real:
    """Return the impulses of the shaper of a chain for an arm under a law."""
    reference = chain.reference
    if reference.shaper == "none":
        return np.ones(1)
    return impulses_at(loop_modes(Case(arm, law, chain)), reference.shaper, reference.modes)
