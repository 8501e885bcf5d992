"""Effect of sampling on each mode, to first order in the gains, and exact at finite gains.

To first order a gain K adds Re[-K (z - z_p) H(z)/z_p] to ln|z| per sample of the mode with the open-loop pole z_p, H
the signal of the gain, through filters, differences and delay.  Without any of these it is for an undamped arm, w its
frequency, b its hub participation, q = w T and delay d samples (any fraction),

    -b^2 sin(q/2) (K1/w) cos((d + 1/2) q)   and   -b^2 sin(q/2) K2 I_h sin((d + 1/2) q):

at d = 0 the hub rate damps from 0 to 1/(2T) [Hz] and destabilises from there to 1/T, and so on in bands, and K2 > 0
never destabilises.  At finite gains the closed-loop pole itself is followed from zero gain.  A locus along one gain has
enough values to be smooth, and each branch is named after the mode where it begins.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import MOMENT_GAIN, RATE_GAIN
from tfarm.arrays import Complex, Real, Whole
from tfarm.crossing.turning import loose
from tfarm.dsp.branches import follow_branches, match_poles
from tfarm.loop.sampled import Sampled
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum import modes

# of a gain along its locus, to begin with
SAMPLED_LOCUS_VALUES = 61
# radius up to which the z-plane is shown
RIM = 1.12
# and up to which a branch is drawn, so that its line runs out of the picture
DRAWN_RADIUS = 1.2 * RIM
# times the rate gain of a loop, below and above, its locus reaches at least
STRONGER = 10.0


@frozen
class ModeTable:
    """One row for each mode that does not decay within a sample.

    `log_radius`: ln|z| of its closed-loop pole, the larger where its pair has become two real poles.  `first_order` is
    the change of it to first order in the law, the sum of `by_rate` (parts on the hub rate alone, K1), `by_moment` (on
    the root moment, K2) and `by_others`; `by_damping`: Re(p) T, from the arm's own C (and analog hub damping).
    `band`: 0 from 0 to 1/(2T) [Hz], and so on; `aliased`: the apparent frequency of the mode [rad/s].
    """

    is_table = True

    index: Annotated[NDArray[np.int64], Quantity("mode", help="number of the flexible mode")]
    natural_frequency: Annotated[
        Real,
        Quantity(
            "natural frequency", "rad/s", help="undamped natural frequency of the mode without the controller"
        ),
    ]
    band: Annotated[
        NDArray[np.int64],
        Quantity("Nyquist zone", help="0 from 0 to half the sampling rate, 1 from there to the whole rate"),
    ]
    aliased: Annotated[
        Real,
        Quantity(
            "aliased to", "rad/s", help="apparent frequency of the sampled mode, below half the sampling rate"
        ),
    ]
    by_rate: Annotated[
        Real,
        Quantity(
            "by K1",
            digits=3,
            key="first_order_by_K1",
            help="change of ln|z| per sample by hub-rate feedback, to first order; below 0 damps",
        ),
    ]
    by_moment: Annotated[
        Real,
        Quantity(
            "by K2",
            digits=3,
            key="first_order_by_K2",
            help="change of ln|z| per sample by root-moment feedback, to first order",
        ),
    ]
    by_others: Real
    by_damping: Annotated[
        Real,
        Quantity(
            "open loop",
            digits=4,
            key="open_loop_log_radius",
            help="ln|z| per sample of the mode without the controller, by damping of the arm",
        ),
    ]
    log_radius: Annotated[
        Real,
        Quantity(
            "closed loop",
            digits=4,
            key="log_radius_per_sample",
            help="ln|z| per sample of the closed-loop pole; above 0 it is unstable",
        ),
    ]

    @property
    def first_order(
        self,
    ) -> Annotated[
        Real,
        Quantity(
            "first order",
            digits=3,
            key="first_order_log_radius",
            help="change of ln|z| per sample by the whole controller, to first order",
        ),
    ]:
        """Change of ln|z| per sample by all gains."""
        return self.by_rate + self.by_moment + self.by_others


def first_order(loop: Sampled, poles: Whole) -> Real:
    """Return the first-order change of ln|z| (parts, poles) by each part of the law, at open-loop poles by number."""
    z = loop.pulse.multipliers[poles]
    _, *rows = loop.rig.terms(z, poles, np.zeros(z.size))
    whole = (loop.pulse.shifts[poles][:, None] - loop.in_z.poles).prod(axis=1)
    # -0.0 where a weight is 0
    return np.asarray(-(np.array(loop.weights)[:, None] * rows / (z * whole)).real) + 0.0


def mode_table(loop: Sampled) -> ModeTable:
    """Return the modes of a loop one by one."""
    pulse = loop.pulse
    own = np.asarray(pulse.poles.real * pulse.sampling.period, dtype=float)
    # -20.0: modes that lose more than this in ln|a| between two samples are not listed
    upper = np.nonzero((pulse.poles.imag > 0) & (pulse.mode > 0) & (own > -20.0))[0]
    upper = upper[np.argsort(pulse.mode[upper])]
    index = pulse.mode[upper]
    table = modes(pulse.plant.arm, int(index.max(initial=1)))
    T = pulse.sampling.period
    w = table.natural_frequency[np.searchsorted(table.index, index)]
    by = first_order(loop, upper)
    is_of_rate = [part.signals == ("hub_rate",) for part in loop.law.parts]
    is_of_moment = [part.signals == ("root_moment",) for part in loop.law.parts]
    turns = np.round(w * T / (2 * np.pi))
    origin = origins(loop)
    # poles from a mode's pole and its conjugate: two radii where both have become real
    conjugate = abs(pulse.poles - pulse.poles[upper].conj()[:, None]).argmin(axis=1)
    log_radius = loop.poles.log_radius
    radii = [log_radius[np.isin(origin, pair)].max() for pair in zip(upper, conjugate, strict=True)]
    return ModeTable(
        index=index,
        natural_frequency=w,
        band=np.floor(w * T / np.pi).astype(np.int64),
        aliased=abs(w - turns * 2 * np.pi / T),
        by_rate=by[is_of_rate].sum(axis=0),
        by_moment=by[is_of_moment].sum(axis=0),
        by_others=by[~np.logical_or(is_of_rate, is_of_moment)].sum(axis=0),
        by_damping=own[upper],
        log_radius=np.array(radii),
    )


# four loops are kept: memory against time, of no effect on a result
@lru_cache(maxsize=4)
def origins(loop: Sampled) -> NDArray[np.int64]:
    """Return for each closed-loop pole the open-loop pole where its branch begins, or -1.

    These are numbered as in `PulseTransfer.poles`, those of the law after them.  A factor on the law grows from nearly
    0, and each pole is followed.
    """
    # of the continuation from zero gain
    following_steps = 24
    open_loop = np.r_[loop.pulse.multipliers, 1 + loop.in_z.poles]
    labels = np.flatnonzero(np.r_[loop.pulse.poles != 0, loop.in_z.poles + 1 != 0])
    # 1e-6 of the gains: there each pole is still at that of the plant
    scales = np.r_[1e-6, np.arange(1, following_steps) / following_steps, 1.0]
    first, *others = (loop.times(scale).eigenvalues for scale in scales[:-1].tolist())
    poles = [first[match_poles(open_loop[labels], first)], *others, loop.eigenvalues]
    ends = follow_branches(poles, scales)[-1]
    origin = np.full(loop.eigenvalues.size, -1)
    origin[match_poles(ends, loop.eigenvalues)] = labels
    origin.flags.writeable = False
    return origin


def dominant(loop: Sampled) -> str:
    """Return the origin of the pole of largest radius: a mode, a pole of the law, or the hub (a filter, the delay).

    A pole of the plant that rings and is assigned to no mode is an unassigned mode.
    """
    origin = int(origins(loop)[loop.poles.log_radius.argmax()])
    if origin >= loop.pulse.poles.size:
        return "a pole of the law"
    if origin >= 0 and loop.pulse.mode[origin]:
        return f"mode {loop.pulse.mode[origin]}"
    if origin >= 0 and loop.pulse.poles[origin].imag:
        return "an unassigned mode"
    return "the hub"


# ------------------------------------------------------------ loci


@frozen
class SampledLocus:
    """The locus of one number of a law, the others those of `loop`: `z` (values, branches), and each branch's mode.

    The mode is 0 for a branch from the hub, a filter, the delay or the law.
    """

    loop: Sampled
    gain: str
    values: Real
    z: Complex
    mode: NDArray[np.int64]


@frozen
class SampledLoci:
    """Loci of a loop along each of both gains, `by` the gain's name."""

    loop: Sampled
    by: Mapping[str, SampledLocus]

    @property
    def half_rate(self) -> float:
        """1/(2T) [Hz], above which modes are aliased."""
        return 0.5 / self.loop.chain.sampling.period

    def is_aliased(self, mode: int) -> bool:
        """Return whether a flexible mode lies above half the sample rate."""
        pulse = self.loop.pulse
        return bool((pulse.poles.imag[pulse.mode == mode] > 2 * np.pi * self.half_rate).any())


def sampled_loci(loop: Sampled, top: float, moments: tuple[float, float]) -> SampledLoci:
    """Return the loci of the rate gain, nearly 0 to `top`, and of the moment gain over `moments`, the other constant.

    That of the rate gain begins below the gain of the loop.
    """
    # three decades below the end of the locus
    lowest = min(top / 1000, loop.number(RATE_GAIN) / STRONGER)
    by = {
        RATE_GAIN: np.geomspace(lowest, top, SAMPLED_LOCUS_VALUES),
        MOMENT_GAIN: np.linspace(*moments, SAMPLED_LOCUS_VALUES),
    }
    return SampledLoci(loop, {name: sampled_locus(loop, name, values) for name, values in by.items()})


def sampled_locus(loop: Sampled, gain: str, values: Real) -> SampledLocus:
    """Return the locus of a number at these values, at that of the loop, and between where a branch turns."""

    def poles_at(value: float) -> Complex:
        z = loop.with_number(gain, value).poles.z
        # 1e-12: imaginary part of a real z: rounding
        return np.where(abs(z.imag) <= 1e-12, z.real, z)

    known: dict[float, Complex] = {}
    own = loop.number(gain)
    wanted = np.union1d(values, own) if values[0] < own < values[-1] else values
    # 24 of halving the steps where a branch bends, at most
    for _ in range(24):
        known |= {value: poles_at(value) for value in wanted.tolist() if value not in known}
        values = np.array(sorted(known))
        z = follow_branches([known[value] for value in values.tolist()], values)
        bent = loose(np.where((z.imag >= 0) & (abs(z) < DRAWN_RADIUS), z, np.nan).T, 2 * RIM, 2 * RIM)
        if not bent.any():
            break
        wanted = (values[:-1] + values[1:])[bent] / 2
    first = loop.with_number(gain, float(values[0]))
    origin = origins(first)
    modes = np.r_[loop.pulse.mode, np.zeros(loop.in_z.poles.size, np.int64)]
    mode = np.where(origin < 0, 0, modes[origin])
    return SampledLocus(loop, gain, values, z, mode[[abs(first.poles.z - start).argmin() for start in z[0]]])
