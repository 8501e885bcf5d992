"""The loop function of the continuous-time loop and of the sampled one, with its margins.

The loop is broken at the actuator.  The loop function of a sampled loop is that of the samples, L(e^{i w T}), up to
half the sampling rate.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AnyLaw, Arm, as_law
from tfarm.arrays import Complex
from tfarm.dsp import Chain, Sampled
from tfarm.dsp.chain import chain_or_usual
from tfarm.dsp.crossings import CircleGrid, circle_grid
from tfarm.dsp.verdict import Analysis, sampled
from tfarm.loop.curve import LoopCurve, curve_of, lowest_drawn, refined
from tfarm.loop.margins import LoopMargins, margins, margins_of_curve
from tfarm.loop.stability import stability
from tfarm.spectrum import modes

REFERENCE_RATIO = 1e-3  # damping ratio of mode 1 with which an undamped arm is graded
UNDAMPED = (
    "undamped model: margins and grades are those with C = {:.4g} s, 0.1 % of critical damping in mode 1; "
    "at C = 0 the exact delay and disk margins are 0 for every gain"
)


def loop_function(arm: Arm, law: AnyLaw, chain: Chain | None = None) -> LoopCurve:
    """Return the loop function L(i w) of an arm under a law, or that of the sampled loop, with its margins.

    Parameters
    ----------
    arm, law
        The arm and the controller.
    chain
        Sampling: the curve is then L(e^{i w T}) up to pi/T, and `continuous` the continuous-time loop, None under a law
        in z.  A law in z has the usual chain where none is given.

    Returns
    -------
    LoopCurve
        L (n,) at frequencies (n,) [rad/s].  An arm without damping is that of the result card, with 0.1 % of critical
        damping in mode 1; its stability is that of the arm as it is.

    Raises
    ------
    ParameterError
        Where there is no loop.
    ConvergenceError
        Where its stability is not determined.
    """
    law = as_law(law)
    damped, note = arm, ""
    if arm.has_elastic_link:
        reference = reference_damping(arm)
        damped, note = arm.having(damping=reference), UNDAMPED.format(reference)

    def as_card(curve: LoopCurve, own: str) -> LoopCurve:
        return replace(curve, stability=own, note=note, margins=None if own == "unstable" else curve.margins)

    found = None
    if not law.is_discrete:
        own = margins(damped, law)
        found = as_card(curve_of(own), (own.stability if damped is arm else stability(arm, law)).verdict)
    if found is not None and chain is None:
        return found
    chain = chain_or_usual(chain)
    at_samples = sampled(damped, law, chain)
    word = (at_samples if damped is arm else sampled(arm, law, chain)).verdict.word
    return replace(as_card(sampled_curve(at_samples), word), continuous=found)


def sampled_curve(found: Analysis) -> LoopCurve:
    """The curve of a sampled loop."""
    loop, band, T = found.verdict.full, None, found.verdict.full.chain.sampling.period
    curve = SampledCurve(loop)
    if found.verdict.is_stable:
        own = sampled_margins(curve)
        band = replace(own, gain=found.gain_factors or own.gain)
    omega = curve.grid.q / T
    omega, L = refined(curve.loop_function, omega[omega >= lowest_drawn(loop.plant.arm, band)])
    return LoopCurve(
        arm=loop.plant.arm, law=loop.given, stability=found.verdict.word, period=T, omega=omega, L=L, margins=band
    )


def sampled_margins(curve: "SampledCurve") -> LoopMargins:
    """The margins of a stable sampled loop up to half its sampling rate."""
    T = curve.loop.chain.sampling.period
    return margins_of_curve(curve, curve.grid.q / T, math.pi / T)


def reference_damping(arm: Arm) -> float:
    """Kelvin-Voigt damping C [s] with which the first mode of an undamped arm has the damping ratio 0.1 %."""
    return 2 * REFERENCE_RATIO / float(modes(arm, 1).natural_frequency[-1])


@dataclass(frozen=True)
class SampledCurve:
    """L(e^{i w T}) of a sampled loop as a function of s = i w."""

    loop: Sampled

    @cached_property
    def grid(self) -> CircleGrid:
        """Angles w T that resolve L."""
        return circle_grid(self.loop)

    @property
    def feeds_back(self) -> bool:
        """Whether a gain of the law is other than 0."""
        return any(self.loop.weights)

    def parts(self, s: NDArray[Any]) -> tuple[Complex, Complex]:
        """Denominator and numerator of L at s = i w."""
        q = np.ravel(np.imag(s)) * self.loop.chain.sampling.period
        base = self.grid.base[np.minimum(np.searchsorted(self.grid.q, q), self.grid.q.size - 1)]
        own, *rows = self.grid.at(base, q - self.grid.angles[base])
        fed_back = np.asarray(np.array(self.loop.weights) @ np.array(rows), dtype=np.complex128)
        return own.reshape(np.shape(s)), fed_back.reshape(np.shape(s))

    def loop_function(self, s: NDArray[Any]) -> Complex:
        """L at s = i w."""
        own, fed_back = self.parts(s)
        return np.asarray(np.divide(fed_back, own, out=np.full(own.shape, np.inf + 0j), where=own != 0))
