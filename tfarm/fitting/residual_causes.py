"""What a prediction leaves of a run: whether it is noise, whether it follows from what moved the arm, and from what.

White noise has neither correlations in time nor a line in its spectrum (`chance_of_white`); noise of sensors that
went round a loop is taken back to what it was before, where the record has all that the controller reads.  A right
model leaves nothing that correlates with what moves the arm (Ljung 1999, section 16.6): with x the input of an open
loop, or the change of a reference from sample to sample,

    R(k) = 1/N sum of e(t + k) x(t),    within 2.58 sqrt(P/N) in 99 %,    P = sum over lags of R_e R_x.

Single changes of the model are tried by least squares, to first order: of the drive's gain and dead time, of each
sensor's gain, of the bending stiffness, of the hub's angle at the start, a torque against the hub's turning (dry
friction) or a constant one (bias), and one more mode under the same input.  The share of the residuals that a change
removes, of all signals over their noise, ranks the causes.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import AT_HUB, Arm
from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Real
from tfarm.digits import general
from tfarm.fitting.decays import NOT_WHITE
from tfarm.fitting.run_model import FitRun
from tfarm.fitting.whiteness import chance_of_white
from tfarm.records import frozen
from tfarm.response.frequency import HERTZ
from tfarm.schema import Percent, Quantity

# of the residuals: what removes less is no cause
ENOUGH = 1 / 3


class SignalResidual(NamedTuple):
    """What a prediction leaves of one signal."""

    signal: Annotated[str, Quantity("signal", help="output of the arm")]
    noise: Annotated[
        float, Quantity("noise", digits=3, help="standard deviation of its noise, known or by differences")
    ]
    white: Annotated[
        float,
        Quantity(
            "probability of white",
            digits=3,
            key="whiteness_probability",
            help="that white noise has such correlations, or such a line in its spectrum",
        ),
    ]
    correlation: Annotated[
        float,
        Quantity(
            "correlation over its bound",
            digits=3,
            key="correlation_over_bound",
            help="largest cross-correlation with what moves the arm, over its 99 % bound",
        ),
    ]
    lag: Annotated[
        float, Quantity("at lag", "s", 3, help="lag of that correlation: residual after the cause")
    ]
    inside: Annotated[
        Percent | None,
        Quantity("inside the band", digits=3, help="share of the samples inside the band of 95 %"),
    ]

    @property
    def is_noise(self) -> bool:
        """Whether the residual looks like white noise."""
        return self.white >= NOT_WHITE


class ResidualCause(NamedTuple):
    """A single change of the model, its size, and the share of the residuals that it removes."""

    change: Annotated[str, Quantity("change", help="what is changed alone")]
    size: Annotated[str, Quantity("size", help="of that change, by least squares to first order")]
    removed: Annotated[Percent, Quantity("removes", digits=3, help="share of the residuals' variance")]

    @property
    def in_words(self) -> str:
        """The change with its size."""
        return f"{self.change} ({self.size})"


@frozen
class Residual:
    """Measured less predicted `left` (outputs, n), how the arm was computed, and `sigma` (outputs,) of the noise.

    `by_offset` (outputs, outputs, n) is a unit of each offset; of those `fitted` the least squares are taken already.
    """

    arm: Arm
    of: FitRun
    numbers: tuple[float, ...]
    by_offset: Real
    fitted: tuple[int, ...]
    left: Real
    sigma: Real

    def value(self, place: int) -> float:
        """Return the number of a place of `FitRun`."""
        return self.numbers[place]

    @cached_property
    def offsets(self) -> Real:
        """The columns of the offsets that are fitted, over the noise."""
        return self.flat(self.by_offset[[*self.fitted]])

    def flat(self, parts: Real) -> Real:
        """Return signals (columns, outputs, n) over their noise as columns."""
        return np.asarray((parts / self.sigma[:, None]).reshape(len(parts), self.left.size).T)

    @cached_property
    def whole(self) -> Real:
        """The residuals over their noise, without what offsets explain."""
        flat = self.flat(self.left[None])[:, 0]
        return np.asarray(flat - self.offsets @ np.linalg.lstsq(self.offsets, flat)[0])

    def removal(self, part: Real) -> tuple[float, float]:
        """Return how much of a change (outputs, n) of signals the residuals have, and the share that it removes."""
        column = self.flat(part[None])[:, 0]
        column = column - self.offsets @ np.linalg.lstsq(self.offsets, column)[0]
        size = float(column @ column)
        if not size or not math.isfinite(size):
            return 0.0, 0.0
        many = float(column @ self.whole) / size
        return many, many**2 * size / float(self.whole @ self.whole)


def residual_of(residual: Residual, place: int, half_band: Real | None) -> SignalResidual:
    """Return what is left of one signal, and the share of its samples inside a band."""
    of = residual.of
    e = residual.left[place]
    white = chance_of_white(e)
    if of.reads_all:
        before = of.innovations(residual.arm, residual.value, residual.left[None])[0][place]
        white = max(white, chance_of_white(before))
    found = [cross_correlation(e, x) for x in of.run.driving_changes]
    largest, lag = max(found)
    inside = None if half_band is None else Percent(np.mean(abs(e) <= half_band[place]))
    return SignalResidual(
        of.run.names[place], float(residual.sigma[place]), white, largest, lag * of.run.period, inside
    )


def cross_correlation(e: Real, x: Real) -> tuple[float, int]:
    """Return the largest cross-correlation of e after x, over its bound of 99 % for independent ones, and its lag."""
    from scipy.signal import correlate

    # deviations of a normal distribution: 99 % of it
    reach = 2.58
    n = e.size
    e = e - e.mean()
    x = x - x.mean()
    R = correlate(e, x, method="fft")[n - 1 : n - 1 + max(1, min(n // 4, 10_000))] / n
    # by Parseval: the sum of R_e R_x over all lags, and of no taper, so that it is positive
    E = np.fft.rfft(e, 2 * n)
    X = np.fft.rfft(x, 2 * n)
    P = float(np.fft.irfft(abs(E) ** 2 * abs(X) ** 2, 2 * n)[0]) / n**2
    if P <= 0:
        return 0.0, 0
    lag = int(abs(R).argmax())
    return float(abs(R[lag])) / (reach * math.sqrt(P / n)), lag


# ------------------------------------------------------------ causes


def causes_of(residual: Residual) -> list[ResidualCause]:
    """Return the changes that were tried, the one that removes most first."""
    found = [*changes(residual), *torques(residual), another_mode(residual)]
    return sorted(found, key=lambda each: -each.removed)


def changes(residual: Residual) -> Iterator[ResidualCause]:
    """Yield the changes of numbers of drive, sensors and link: by differences of the linear loop."""
    of = residual.of
    arm = residual.arm
    run = of.run
    numbers = [*residual.numbers]
    here = of.respond(arm, residual.value).outputs
    # of a gain: its rounding over it and its square are both small
    step = 1e-5

    def with_gains(names: tuple[str, ...]) -> tuple[float, float]:
        """Return the removal by more gain of these signals, those that the controller reads of them too."""
        known = dict(of.gains)
        places = {name: len(numbers) + n for n, name in enumerate(dict.fromkeys((*known, *names)))}
        factors = [
            (numbers[known[name]] if name in known else 1.0) * (1 + step * (name in names)) for name in places
        ]
        more = replace(of, gains=tuple(places.items()))
        return residual.removal((more.respond(arm, [*numbers, *factors].__getitem__).outputs - here) / step)

    read = () if run.law is None else (*AT_HUB, *run.law.signals)
    many, share = with_gains(tuple(dict.fromkeys((*read, *run.names))))
    yield ResidualCause("gain of the drive", f"{100 * many:+.3g} %", Percent(share))
    for name in run.names:
        many, share = with_gains((name,))
        yield ResidualCause(f"gain of {name}", f"{100 * many:+.3g} %", Percent(share))
    sampling = of.chain.sampling
    later = replace(sampling, delay_samples=sampling.delay_samples + step)
    late = replace(of, chain=replace(of.chain, sampling=later))
    period = sampling.period if run.law is not None else run.period
    many, share = residual.removal((late.respond(arm, residual.value).outputs - here) / (step * period))
    yield ResidualCause("dead time of the drive", f"{1e3 * many:+.3g} ms", Percent(share))
    yield other_stiffness(residual, here)


def other_stiffness(residual: Residual, here: Real) -> ResidualCause:
    """Return the bending stiffness of least squares, up to a fifth more or less: a resonance is no straight line of it.

    `here` are the outputs (outputs, n) of the linear loop.
    """
    from scipy.optimize import minimize_scalar

    total = float(residual.whole @ residual.whole)

    def left(exponent: float) -> float:
        found = residual.of.respond(stiffened(residual.arm, math.exp(exponent)), residual.value).outputs
        if not np.isfinite(found).all():
            return math.inf
        e = residual.whole - residual.flat((found - here)[None])[:, 0]
        e = e - residual.offsets @ np.linalg.lstsq(residual.offsets, e)[0]
        return float(e @ e)

    grid = np.linspace(-0.2, 0.2, 21)
    squares = [left(each) for each in grid.tolist()]
    near = int(np.argmin(squares))
    ends = (float(grid[max(near - 1, 0)]), float(grid[min(near + 1, grid.size - 1)]))
    best = minimize_scalar(left, bounds=ends, method="bounded", options={"xatol": 1e-4})
    size = f"{100 * math.expm1(float(best.x)):+.3g} %"
    return ResidualCause("bending stiffness E I", size, Percent(1 - float(best.fun) / total))


def torques(residual: Residual) -> Iterator[ResidualCause]:
    """Yield another start of the hub, and torques on it: against its turning, and constant."""
    of = residual.of
    arm = residual.arm
    run = of.run
    rate = predicted_rate(residual)
    # of the fastest: slower, the hub is taken for resting
    slowest = 0.02
    against = -np.sign(rate) * (abs(rate) > slowest * abs(rate).max())
    loop = None if run.law is None else of.loop(arm, residual.value)
    pulse = of.pulse(arm, residual.value)
    for place in set(range(len(run.names))) - {*residual.fitted}:
        many, share = residual.removal(residual.by_offset[place])
        yield ResidualCause("start of the hub angle", f"{general(many, 3)} rad", Percent(share))
    for name, torque in (("dry friction of the hub", against), ("bias of the drive", np.ones(run.count))):
        many, share = residual.removal(of.on_torque(pulse, loop, torque)[of.rows(pulse)])
        yield ResidualCause(name, f"{general(many, 3)} {arm.input_unit}", Percent(share))


def predicted_rate(residual: Residual) -> Real:
    """Return the hub's rate (n,) of the linear loop."""
    of = residual.of
    outputs = dict.fromkeys((*of.run.names, "hub_rate"), np.zeros(of.run.count))
    seen = replace(of, run=replace(of.run, outputs=outputs, sigma={}), sigma=(1.0,) * len(outputs))
    return np.asarray(seen.respond(residual.arm, residual.value).outputs[[*outputs].index("hub_rate")])


def stiffened(arm: Arm, factor: float) -> Arm:
    """Return the arm with Young's and shear modulus of its links times a factor."""
    keys = [f"link.{n}.youngs_modulus" for n in range(1, len(arm.links) + 1)]
    if not arm.outer:
        keys = ["link.youngs_modulus"]
    family = KeyedArms(arm, keys)
    return family.at({key: factor * family.value(key) for key in keys})


def another_mode(residual: Residual) -> ResidualCause:
    """Return one more mode under the input of the linear loop: the pole of least squares, by lines of the residuals."""
    from scipy.optimize import minimize

    of = residual.of
    run = of.run
    T = run.period
    loop = None if run.law is None else of.loop(residual.arm, residual.value)
    u = of.commands(loop)
    scaled = residual.whole.reshape(len(run.names), -1)
    total = float((scaled**2).sum())
    # turns in the record: fewer are a drift, and no mode
    lowest = 3 * HERTZ / (run.count * T)
    # nearer to half the rate of sampling it is a share of the input, and no mode
    highest = 0.8 * math.pi / T

    def left(x: Real) -> float:
        omega, ratio = np.exp(x)
        if not (lowest <= omega <= highest and 1e-4 < ratio < 0.1):
            return total
        columns = mode_columns(complex(-ratio, 1.0) * omega, u, T)
        e = scaled - (columns @ np.linalg.lstsq(columns, scaled.T)[0]).T
        return float((e**2).sum())

    power = (abs(np.fft.rfft(scaled * np.hanning(run.count))) ** 2).sum(axis=0)
    omega = HERTZ * np.fft.rfftfreq(run.count, T)
    peaks = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])) + 1
    peaks = peaks[(omega[peaks] >= lowest) & (omega[peaks] <= highest)]
    lines = omega[peaks[np.argsort(-power[peaks])[:5]]]
    starts = [np.log([line, ratio]) for line in lines.tolist() for ratio in (0.003, 0.02, 0.08)]
    if not starts:
        return ResidualCause("another mode", "none found", Percent(0.0))
    best = minimize(left, min(starts, key=left), method="Nelder-Mead", options={"maxiter": 80, "xatol": 1e-4})
    frequency, ratio = map(math.exp, best.x)
    # at the end of the search: a smooth curve that fits anything slow, and no mode
    if ratio > 0.095:
        return ResidualCause("another mode", "none of a damping ratio below 0.1", Percent(0.0))
    size = f"{general(frequency / HERTZ, 4)} Hz, damping ratio {general(ratio, 2)}"
    return ResidualCause("another mode", size, Percent(1 - best.fun / total))


def mode_columns(pole: complex, u: Real, period: float) -> Real:
    """Return real and imaginary part of a pole's amplitude (n, 2) from rest under a held input, and 1."""
    from scipy.signal import lfilter

    z = cmath.exp(pole * period)
    amplitude = lfilter([0.0, 1.0], [1.0, -z], u)
    # of the size of the input, for the sake of the least squares
    scale = abs(amplitude).max() or 1.0
    return np.c_[amplitude.real / scale, amplitude.imag / scale, np.ones(u.size)]
