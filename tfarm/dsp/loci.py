"""Where the poles of the sampled loop go as a gain grows: three loci of one loop, each branch named after its mode.

Branches are followed by `dsp.law.followed`, through as many values as it takes to be round; each is named after the
mode that it comes from at zero gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import HubFeedback
from tfarm.crossing.turning import loose
from tfarm.dsp.law import followed, origins
from tfarm.dsp.loop import SampledLoop
from tfarm.records import record

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

VALUES = 61  # of a gain along its locus, to begin with
ROUNDS = 24  # of halving the steps where a branch bends, at most
REAL = 1e-12  # imaginary part of a real z: rounding
RIM = 1.12  # radius up to which the z-plane is shown
BEYOND = 1.2 * RIM  # and up to which a branch is drawn, so that its line runs out of the picture
DECADES = 3  # of K1
STRONGER = 10.0  # how many times its own K1 the locus of K1 alone goes


@dataclass(frozen=True)
@record
class Locus:
    """One gain's locus, the others those of `law`: `z` (values, branches), and the flexible mode of each branch.

    The mode is 0 for one that comes from the hub, a filter or the delay.
    """

    law: HubFeedback
    gain: str
    values: Real
    z: Complex
    mode: NDArray[np.int64]


@dataclass(frozen=True)
@record
class Loci:
    """Loci of K1 alone (K2 = 0), and of both gains through those of the loop; `poles` [1/s] are the arm's own,
    one a flexible mode, `mode` their numbers.
    """

    loop: SampledLoop
    alone: Locus
    by_K1: Locus
    by_K2: Locus
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


def loci(loop: SampledLoop, K1_top: float, K2_range: tuple[float, float]) -> Loci:
    """The loci of K1 from nearly 0 to `K1_top` and of K2 over `K2_range`, the other gain as it is.

    Both begin below the gains of the loop.
    """
    K1 = np.geomspace(min(K1_top / 10**DECADES, loop.gains.K1 / STRONGER), K1_top, VALUES)
    K2 = np.linspace(*K2_range, VALUES)
    upper = np.nonzero((loop.pulse.poles.imag > 0) & (loop.pulse.mode > 0))[0]
    upper = upper[np.argsort(loop.pulse.mode[upper])]
    small = np.geomspace(1e-3, STRONGER, VALUES) * loop.gains.K1
    alone = _locus(loop.having(K2=0.0), "K1", small)
    by_K1, by_K2 = _locus(loop, "K1", K1), _locus(loop, "K2", K2)
    return Loci(loop, alone, by_K1, by_K2, loop.pulse.poles[upper], loop.pulse.mode[upper])


def _locus(loop: SampledLoop, gain: str, values: Real) -> Locus:
    """The locus at these values, that of the loop, and those between at which a branch turns in its picture."""

    def poles(value: float) -> Complex:
        z = loop.having(**{gain: value}).poles.z
        return np.where(abs(z.imag) <= REAL, z.real, z)

    known: dict[float, Complex] = {}
    wanted = np.union1d(values, loop.gains[gain]) if values[0] < loop.gains[gain] < values[-1] else values
    for _ in range(ROUNDS):
        known |= {value: poles(value) for value in wanted.tolist() if value not in known}
        values = np.array(sorted(known))
        z = followed([known[value] for value in values.tolist()], values)
        bent = loose(np.where((z.imag >= 0) & (abs(z) < BEYOND), z, np.nan).T, 2 * RIM, 2 * RIM)
        if not bent.any():
            break
        wanted = (values[:-1] + values[1:])[bent] / 2
    first = loop.having(**{gain: float(values[0])})
    origin = origins(first)
    mode = np.where(origin < 0, 0, loop.pulse.mode[origin])
    return Locus(loop.gains, gain, values, z, mode[[abs(first.poles.z - start).argmin() for start in z[0]]])
