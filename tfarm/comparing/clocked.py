"""A loop at its samples: what is compared of two laws where one of them is a law in z, and acts there alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tfarm.arm import AnyLaw, Arm, as_law
from tfarm.arrays import Complex, Real
from tfarm.crossing import Window
from tfarm.dsp import Chain
from tfarm.dsp.crossings import circle_grid, stable_factors
from tfarm.dsp.verdict import Analysis, sampled_verdict
from tfarm.records import record

GONE_AFTER_SAMPLE = 1e-3  # |z| of a pole that leaves this much of itself after a sample: of those nothing is compared
REAL_Z = 1e-12  # imaginary part of a real z: rounding
CLOCKED_MARGINS = {"gain_factor_up": ("stable up to this factor on the law", ""),
          "gain_factor_down": ("and down to this one", ""), "delay_margin_s": ("delay margin", "s")}  # fmt: skip


@dataclass(frozen=True)
@record
class Reach:
    """The intervals of a factor on a law in which its loop is stable, at each further delay [s]."""

    delay: Real
    stable_intervals: tuple[tuple[Window, ...], ...]


@dataclass(frozen=True)
@record
class Clocked:
    """A rig under a law at the samples of a chain, gains at the hub taken as a law like any other."""

    analysis: Analysis

    @property
    def period(self) -> float:
        """[s]"""
        return float(self.analysis.loop.chain.sampling.period)

    @property
    def poles(self) -> Complex:
        """The poles s = ln(z)/T [1/s] with Im s >= 0, ascending in Im s, of all that outlives a sample."""
        z = self.analysis.loop.poles.z
        z = np.where(abs(z.imag) <= REAL_Z, z.real, z)
        s = np.log(z[(abs(z) > GONE_AFTER_SAMPLE) & (z.imag >= 0)]) / self.period
        return np.asarray(s[np.lexsort((s.real, s.imag))])

    @property
    def open_loop(self) -> dict[int, complex]:
        """The poles ln(z)/T [1/s] of the rig by itself with Im z > 0, by flexible mode."""
        pulse = self.analysis.loop.pulse
        z, mode = pulse.multipliers, pulse.mode
        upper = np.nonzero((mode > 0) & (pulse.poles.imag > 0))[0]
        s = np.log(z[upper]) / self.period
        return dict(zip(mode[upper].tolist(), (s.real + 1j * abs(s.imag)).tolist(), strict=True))

    @property
    def loop_function(self) -> tuple[Real, Complex]:
        """Frequencies [rad/s] (n,) up to half the sample rate, and L(e^{iwT}) there."""
        loop = self.analysis.loop
        grid = circle_grid(loop)
        with np.errstate(all="ignore"):
            L = np.asarray(loop.weights @ grid.terms[1:] / grid.terms[0], dtype=np.complex128)
        return grid.q / self.period, L

    @property
    def margins(self) -> dict[str, float | None]:
        """By `CLOCKED_MARGINS`: between which factors on the law, and up to what more delay [s], the loop is stable."""
        low, high = self.analysis.gain_factors or (None, None)
        delay = self.analysis.delay_margin.samples * self.period if self.analysis.verdict.is_stable else None
        return dict(zip(CLOCKED_MARGINS, (high, low, delay), strict=True))

    @cached_property
    def known(self) -> str:
        """What the margins hold for."""
        return f"with {self.analysis.verdict.modes_used} modes"

    def reach(self, samples: Real) -> Reach:
        """The stable factors with so much further delay each [samples]."""
        loop = self.analysis.loop
        now = loop.chain.sampling.delay_samples
        return Reach(
            self.period * samples,
            tuple(tuple(stable_factors(loop.with_delay(now + more))) for more in samples.tolist()),
        )


def clocked(arm: Arm, law: AnyLaw, chain: Chain) -> Clocked:
    """The law at the clock of a chain.  Raises what `tfarm.sampled` raises."""
    return Clocked(Analysis(sampled_verdict(arm, as_law(law), chain)))
