"""Stability of the sampled loop: certified for every mode of a band, or converged for the first N modes."""

import math
from functools import cached_property
from typing import Annotated

import numpy as np

from tfarm.arm.checks import whole
from tfarm.arm.stages import Consumer
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.crossing import Window
from tfarm.dsp.discretise import RULE, rule_in_words
from tfarm.dsp.stages import admit_case, not_covered
from tfarm.loop.circle import Band, complete_band
from tfarm.loop.circle_crossings import FACTOR, interval_around, stable_windows
from tfarm.loop.curve import LoopContour, LoopVerdict, next_limits
from tfarm.loop.edges import whole_loop
from tfarm.loop.loop_margins import PhaseCrossover
from tfarm.loop.sampled import OfLoop, Sampled, sampled_loop, with_more_modes
from tfarm.loop.sampled_modes import dominant
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum import modes

SAMPLED_LOOP = Consumer(
    "sampled loop",
    acts=("anti-alias filter", "hub rate", "law", "hold", "delay", "hub damping", "plant"),
    named=("encoder", "amplifier steps", "amplifier range", "DAC steps", "DAC range", "torque limit"),
    partly=("arithmetic",),
    none=("reference", "shaper", "volts"),
)
# of an undamped arm, whose verdict is of the first modes alone
UNDAMPED_MODES = 20


@frozen
class Verdict(OfLoop, LoopVerdict):
    """Whether a sampled loop is stable, without z = 1 of a free hub angle.

    `band` is the part of the arm for which it is certified (`loop.circle`).  Without one, as at C = 0, the verdict
    holds for the first `modes_used` modes, those of `loop`, and high ones may grow by 1e-9 a sample.  It `is_converged`
    where that loop's count of unstable poles and largest radius are those of the loop with every mode searched.
    """

    loop: Sampled
    band: Band | None = None
    is_converged: bool = False

    consumer = SAMPLED_LOOP

    @property
    def rule(self) -> Annotated[str, RULE]:
        """The discretisation of the law."""
        return rule_in_words(self.loop.law)

    @property
    def is_settled(
        self,
    ) -> Annotated[
        bool,
        Quantity(key="certified", help="whether the verdict is certified for every mode up to a frequency"),
    ]:
        """Whether the verdict is certified for every mode of the band and every slow real pole."""
        return self.band is not None

    @property
    def band_rad_s(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            "certified up to",
            "rad/s",
            key="up_to_rad_s",
            help="end of the frequency range in which the verdict is certified",
        ),
    ]:
        """End of the range in which the verdict is certified [rad/s]; None without one."""
        return None if self.band is None else self.band.top

    @property
    def is_stable(
        self,
    ) -> Annotated[bool, Quantity(key="stable", help="whether every pole lies inside the unit circle")]:
        """Whether every pole lies inside the unit circle."""
        return self.loop.poles.is_stable

    @property
    def log_radius(
        self,
    ) -> Annotated[
        float,
        Quantity(
            key="log_spectral_radius",
            help="ln of the largest |z| of the closed-loop poles; below 0 of a stable loop",
        ),
    ]:
        """ln of the spectral radius, of every mode of the band, or of the first `modes_used` without a band.

        The verdict needs few modes, but not the later digits of this number.
        """
        return self.full.poles.log_spectral_radius

    @property
    def spectral_radius(
        self,
    ) -> Annotated[
        float,
        Quantity(
            "spectral radius",
            digits=12,
            help="largest |z| of the closed-loop poles but z = 1 of a free hub angle; below 1 if stable",
        ),
    ]:
        """Largest |z|; infinity where it overflows."""
        # of 700 the exponential is a double
        return math.exp(self.log_radius) if self.log_radius < 700.0 else math.inf

    @property
    def unstable_poles(
        self,
    ) -> Annotated[int, Quantity("unstable poles", help="closed-loop poles outside the unit circle")]:
        """Number of poles outside the unit circle."""
        return self.loop.poles.unstable

    @property
    def full(self) -> Sampled:
        """The loop with every mode of the band, for other gains; that of the verdict without a band."""
        return self.loop if self.band is None else self.band.full

    @property
    def word(  # type: ignore[override]
        self,
    ) -> Annotated[
        str,
        Quantity(
            "stability",
            key="verdict",
            help="stable, marginal (largest |z| = 1 within its rounding error) or unstable",
        ),
    ]:
        """stable, marginal or unstable."""
        growth = self.log_radius
        if growth > 0:
            return "unstable"
        if growth < 0:
            return "stable"
        return "marginal"

    @property
    def sentence(
        self,
    ) -> Annotated[
        str, Quantity(key="verdict_in_words", help="stability, its certainty and the dominant pole")
    ]:
        """Stability, its certainty, and the dominant pole."""
        return f"{self.word} ({self.holds_for}); dominant pole: {self.slowest}"

    @property
    def slowest(
        self,
    ) -> Annotated[
        str,
        Quantity(
            "dominant pole",
            key="dominant",
            help="origin of the pole of largest |z|: a mode, the hub or the controller",
        ),
    ]:
        """Origin of the pole of largest radius: a mode, the hub, or a pole of the law."""
        return dominant(self.loop)

    @property
    def holds_for(
        self,
    ) -> Annotated[
        str,
        Quantity(
            "certainty",
            key="certainty",
            help="frequency range or number of modes for which the verdict was shown",
        ),
    ]:
        """The modes for which the verdict is certified."""
        if self.band is not None:
            shown = f"certified up to {self.band.top:.3g} rad/s"
        else:
            shown = (
                f"{'converged for' if self.is_converged else 'model of'} the first {self.modes_used} modes"
            )
        return f"{shown}, not determined beyond{not_covered(self.consumer, self.loop.chain)}"

    @property
    def range_words(self) -> str:
        """The same in short."""
        if self.band is not None:
            return f"certified to {self.band.top:.3g} rad/s"
        return f"{'converged' if self.is_converged else 'approximate'}, first {self.modes_used} modes"

    @property
    def time_constant(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            "dominant time constant",
            "s",
            help="time constant of the pole of largest |z|, negative of a growing one",
        ),
    ]:
        """Time constant of the dominant pole, below 0 where it grows."""
        if self.log_radius:
            return -self.loop.chain.sampling.period / self.log_radius
        return None

    @property
    def oscillating_poles(self) -> list[tuple[int, complex]]:
        """The oscillating poles s = ln(z)/T by mode, each at the frequency that is nearest to that of its mode."""
        return [*unaliased_poles(self.full).items()]

    @property
    def frequencies(self) -> Real:
        """The grid of the circle, w = q/T."""
        return self.full.rig.grid.q / self.full.period

    @property
    def margins_end(self) -> float:
        """Half the sampling rate."""
        return math.pi / self.full.period

    @cached_property
    def contour(self) -> LoopContour:
        """Around the upper half of the circle, as s = ln(z)/T, and outside the poles on it."""
        # of ln|z|: an open-loop pole so near to the circle is on it
        on_circle = 1e-12
        loop = self.full
        poles = loop.poles
        open_loop = loop.rig.open_loop
        s = np.log(1 + open_loop[open_loop != -1])
        is_near = abs(s.real) <= on_circle
        is_upper = (s.imag >= 0) & (s.imag < math.pi)
        closed = np.asarray(poles.log_radius + 1j * abs(np.angle(poles.z)), dtype=np.complex128)
        return LoopContour(
            grid=self.frequencies,
            on_curve=np.unique(s.imag[is_near & is_upper]) / loop.period,
            closed=closed / loop.period,
            closing=np.empty(0, complex),
            unstable_open=int((s.real > on_circle).sum()),
            unstable=poles.unstable,
            clear=poles.unstable,
            near_axis=int((poles.log_radius == 0).sum()),
        )

    @cached_property
    def factors(self) -> list[Window]:
        """Every stability interval of a factor on the whole law, with every mode of the range.

        Modes that a verdict needs no more may be those that a larger factor destabilises.
        """
        return stable_windows(self.full, FACTOR)

    def gain_limits(self, by_phase: tuple[PhaseCrossover, ...]) -> tuple[float, float]:
        """Return the stability interval of that factor, or that of the phase crossovers."""
        return interval_around(self.factors, 1.0) or next_limits(t for _, t in by_phase)


def unaliased_poles(loop: Sampled) -> dict[int, complex]:
    """Return the poles s = ln(z)/T [1/s], Im s > 0, by mode, each at the frequency nearest to that of its mode.

    Of several poles of a mode it is the least damped one.
    """
    poles = loop.poles
    table = modes(loop.arm, int(poles.mode.max(initial=1)))
    z = poles.z
    rounding = 1e-9 * abs(z)
    # a real z < 0 oscillates at half the sampling rate, one > 0 never does, whatever rounding leaves of Im z
    is_negative = (z.real < 0) & (abs(z.imag) <= rounding)
    upper = (z.imag > rounding) | is_negative
    mode = poles.mode[upper]
    q = abs(np.angle(z[upper]))
    own = np.where(mode > 0, np.interp(mode, table.index, table.natural_frequency) * loop.period, q)
    turns = 2 * math.pi * np.round((own + [[-1], [1]] * q) / (2 * math.pi))
    aliases = abs([[1], [-1]] * q + turns)
    nearest = abs(aliases - own).argmin(axis=0)
    s = (poles.log_radius[upper] + 1j * aliases[nearest, np.arange(q.size)]) / loop.period
    order = np.argsort(s.real / abs(s))
    return dict(zip(mode[order].tolist(), s[order].tolist(), strict=True))


def sampled_verdict(case: Case, *, count: int | None = None, tolerance: float = 1e-4) -> Verdict:
    """Return the verdict on a case, with `count` modes, or enough of them (C > 0), or the first 20 (C = 0).

    They are enough when the number of poles outside the circle is that certified for the whole band, and the logarithm
    of the largest radius differs by at most a share of `tolerance` from that of the loop with every mode of the band.
    Raises ParameterError as `sampled_loop` does, and for a count outside 1..400.
    """
    # rounding error of that logarithm
    radius_noise = 1e-12
    # modes that may be asked for
    most_count = 400
    case = admit_case(SAMPLED_LOOP, case)
    if count is not None:
        form = f"a whole number of flexible modes from 1 to {most_count}"
        count = whole("modes", count, 1, most_count, form)
    elif case.arm.has_elastic_link:
        count = UNDAMPED_MODES
    if count is not None:
        return Verdict(sampled_loop(case, count=count))
    largest = whole_loop(case)
    band = complete_band(largest)
    full = largest if band is None else band.full
    proven = None if band is None else band.circle.count(full.weights)
    radius = full.poles.log_spectral_radius

    def agrees(fewer: Sampled) -> bool:
        unstable = fewer.poles.unstable
        is_near = abs(fewer.poles.log_spectral_radius - radius) <= tolerance * abs(radius) + radius_noise
        return is_near and unstable == full.poles.unstable and proven in (None, unstable)

    # 8 modes of the smallest loop, twice as many in each next
    most = full.plant.count
    few = min(8, most // 2)
    loop = full
    while 0 < few < most:
        fewer = with_more_modes(full, few)
        if agrees(fewer):
            loop = fewer
            break
        few *= 2
    poles = loop.poles
    is_proven = proven is not None and poles.is_determined and (proven == 0) == (poles.unstable == 0)
    return Verdict(loop, band if is_proven else None, is_converged=loop is not full)
