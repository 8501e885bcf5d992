"""Where the poles of the sampled loop go as a gain grows: three loci of one loop, each branch named after its mode.

Branches are followed by `law.followed_branches`, through as many values as it takes to be round; each is named after
the mode that it comes from at zero gain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN
from tfarm.arrays import Complex, Real
from tfarm.crossing.turning import loose
from tfarm.dsp.modes import followed_branches, origins
from tfarm.dsp.sampled import Sampled
from tfarm.records import record

SAMPLED_LOCUS_VALUES = 61  # of a gain along its locus, to begin with
BRANCH_ROUNDS = 24  # of halving the steps where a branch bends, at most
IMAGINARY_ROUNDING = 1e-12  # imaginary part of a real z: rounding
RIM = 1.12  # radius up to which the z-plane is shown
DRAWN_RADIUS = 1.2 * RIM  # and up to which a branch is drawn, so that its line runs out of the picture
RATE_DECADES = 3  # of the rate gain
STRONGER = 10.0  # how many times its own rate gain the locus of that alone goes
WEAKEST = 1e-3  # of it, where that locus begins


@dataclass(frozen=True)
@record
class SampledLocus:
    """The locus of one number of a law, the others those of `loop`: `z` (values, branches), and each branch's mode.

    The mode is 0 for one that comes from the hub, a filter, the delay or the law.
    """

    loop: Sampled
    gain: str
    values: Real
    z: Complex
    mode: NDArray[np.int64]


@dataclass(frozen=True)
@record
class SampledLoci:
    """Loci of the rate gain alone, and `by` each of both gains through those of the loop; `poles` [1/s] are the arm's
    own, one a flexible mode, `mode` their numbers.
    """

    loop: Sampled
    alone: SampledLocus
    by: Mapping[str, SampledLocus]
    poles: Complex
    mode: NDArray[np.int64]

    @property
    def half_rate(self) -> float:
        """1/(2T) [Hz]: what lies above is aliased."""
        return 0.5 / self.loop.chain.sampling.period

    def is_aliased(self, mode: int) -> bool:
        """Whether a flexible mode lies above half the sample rate."""
        at = np.nonzero(self.mode == mode)[0]
        return bool(at.size and self.poles[at[0]].imag > 2 * math.pi * self.half_rate)


def sampled_loci(loop: Sampled, top: float, moments: tuple[float, float]) -> SampledLoci:
    """The loci of the rate gain from nearly 0 to `top` and of the moment gain over `moments`, the other as it is.

    Both begin below the gains of the loop.
    """
    own = loop.number(RATE_GAIN)
    values = (
        np.geomspace(min(top / 10**RATE_DECADES, own / STRONGER), top, SAMPLED_LOCUS_VALUES),
        np.linspace(*moments, SAMPLED_LOCUS_VALUES),
    )
    upper = np.nonzero((loop.pulse.poles.imag > 0) & (loop.pulse.mode > 0))[0]
    upper = upper[np.argsort(loop.pulse.mode[upper])]
    small = np.geomspace(WEAKEST, STRONGER, SAMPLED_LOCUS_VALUES) * own
    alone = sampled_locus(loop.having(**{MOMENT_GAIN: 0.0}), RATE_GAIN, small)
    by = {name: sampled_locus(loop, name, each) for name, each in zip(PLANE, values, strict=True)}
    return SampledLoci(loop, alone, by, loop.pulse.poles[upper], loop.pulse.mode[upper])


def sampled_locus(loop: Sampled, gain: str, values: Real) -> SampledLocus:
    """The locus of a number at these values, that of the loop, and those between at which a branch turns."""

    def poles(value: float) -> Complex:
        z = loop.having(**{gain: value}).poles.z
        return np.where(abs(z.imag) <= IMAGINARY_ROUNDING, z.real, z)

    known: dict[float, Complex] = {}
    own = loop.number(gain)
    wanted = np.union1d(values, own) if values[0] < own < values[-1] else values
    for _ in range(BRANCH_ROUNDS):
        known |= {value: poles(value) for value in wanted.tolist() if value not in known}
        values = np.array(sorted(known))
        z = followed_branches([known[value] for value in values.tolist()], values)
        bent = loose(np.where((z.imag >= 0) & (abs(z) < DRAWN_RADIUS), z, np.nan).T, 2 * RIM, 2 * RIM)
        if not bent.any():
            break
        wanted = (values[:-1] + values[1:])[bent] / 2
    first = loop.having(**{gain: float(values[0])})
    origin = origins(first)
    modes = np.r_[loop.pulse.mode, np.zeros(loop.in_z.poles.size, np.int64)]
    mode = np.where(origin < 0, 0, modes[origin])
    return SampledLocus(loop, gain, values, z, mode[[abs(first.poles.z - start).argmin() for start in z[0]]])
