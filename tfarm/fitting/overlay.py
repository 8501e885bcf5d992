"""The exact response from any signal of an arm to any other: the ratio of two of its transfer functions.

    H(s) = T_out(s)/T_in(s)

Its zeros are those of T_out, its poles the zeros of T_in: the resonances while the signal T_in is held at zero.  The
arm's own poles are in neither.  Over an input of the hub (a torque, a voltage, the angle) H is a transfer function
itself: the angle as input and the angle as a signal that was measured give the same one.

A measured response is compared with the exact one mode by mode: the differences, and the single changes of the arm's
numbers that would explain them.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from tfarm.arm import INPUTS, Arm, Input, must_be_arm
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, ParameterError, require
from tfarm.exact.outputs import unit_over
from tfarm.fitting.data import Measured, Noise, check_signal, must_be_measured, noise_of, rms
from tfarm.fitting.model import FitResponse
from tfarm.fitting.resonances import (
    PARTNERS_BEYOND,
    Resonance,
    matched_peaks,
    must_be_in_unit,
    peaks_among,
    peaks_of,
    resonance_at,
)
from tfarm.records import frozen
from tfarm.response import TransferFunction, transfer
from tfarm.response.frequency import HERTZ, refined_grid, without_cancelled
from tfarm.response.signals import Signals, locate_output
from tfarm.response.transfer import Roots
from tfarm.schema import Column, Quantity, Table
from tfarm.spectrum import modes as modes_of
from tfarm.spectrum import modes_below


@frozen(slots=True, kw_only=True)
class RatioRoots:
    """Poles and zeros [1/s] of a ratio with 0 <= Im s <= `up_to` [rad/s], none at s = 0: complete in this range.

    `common` are those that both signals have, which cancel; at s = 0 the ratio goes as s^`at_zero`.
    """

    poles: Annotated[Complex, Quantity("s", "1/s", help="poles of the ratio", key="poles")]
    zeros: Annotated[Complex, Quantity("s", "1/s", help="zeros of the ratio", key="zeros")]
    common: Annotated[Complex, Quantity("s", "1/s", 6, "common to both signals: they cancel", "common")]
    at_zero: Annotated[int, Quantity(key="power_at_zero", help="order n of the response s^n near s = 0")]
    up_to: Annotated[
        float,
        Quantity(
            "poles and zeros up to",
            "rad/s",
            6,
            "imaginary part up to which the lists are complete",
            "roots_up_to_rad_s",
        ),
    ]


def _upper(roots: Complex) -> Complex:
    """Those with Im s >= 0 but s = 0, ascending in size: the others are their mirror images."""
    upper = roots[(roots.imag >= 0) & (roots != 0)]
    return upper[np.argsort(abs(upper), kind="stable")]


@frozen
class Ratio:
    """The response `output`/`input` of an arm, exact.  Raises ParameterError for signals that the arm does not have."""

    arm: Arm
    output: str
    input: str

    def __post_init__(self) -> None:
        check_signal(self.output, "output")
        check_signal(self.input, "input")
        require(self.output != self.input, "input", self.input, "a signal over itself is 1")
        for key, name, each in (("output", self.output, self.above), ("input", self.input, self.below)):
            # a response that is not 0 throughout is not 0 at this s [1/s]
            is_moving = each is None or each(0.37 + 0.73j)
            require(is_moving, key, name, "does not move on this arm: it is held")
        remedy = "drives no locked hub; name what was measured: hub_angle where the angle drives it, or another signal"
        is_felt = not self.is_driven or not self.driven.is_locked or self.input == "hub_angle"
        require(is_felt, "input", self.input, remedy)

    @property
    def is_driven(self) -> bool:
        """Whether the input drives the hub, as one of an arm does, so that the arm's modes are the poles."""
        return self.input in INPUTS

    @cached_property
    def driven(self) -> Arm:
        """The arm under the input of the ratio: its own where the ratio is of two signals."""
        if self.is_driven:
            return replace(self.arm, input=cast("Input", self.input))
        return self.arm

    @cached_property
    def above(self) -> TransferFunction:
        """From the input that drives to the output."""
        return _transfer(self.driven, self.output)

    @cached_property
    def below(self) -> TransferFunction | None:
        """The same to the input that was measured; None where it is the one that drives."""
        return None if self.is_driven else _transfer(self.arm, self.input)

    @property
    def unit(self) -> str:
        """SI unit, such as m/s^2/rad."""
        below = self.above.input_unit if self.below is None else self.below.units[0]
        return unit_over(self.above.units[0], below)

    def __call__(self, s: Any) -> Any:
        """H(s) at a complex scalar or array of s [1/s]."""
        return self.above(s) if self.below is None else self.above(s) / self.below(s)

    def roots(self, up_to: float) -> RatioRoots:
        """Poles and zeros with |Im s| <= up_to [rad/s], as each transfer function has them, complete."""
        own_poles, own_zeros = map(_upper, (self.poles(up_to).values, self.above.zeros(up_to=up_to).values))
        poles, zeros = without_cancelled(own_poles, own_zeros)
        if self.below is None:
            below = self.above.system.at_rest
        else:
            below = Signals(self.arm, (self.input,)).orders[0]
        return RatioRoots(
            poles=poles,
            zeros=zeros,
            common=own_poles[~np.isin(own_poles, poles)],
            at_zero=Signals(self.driven, (self.output,)).orders[0] - below,
            up_to=up_to,
        )

    def poles(self, up_to: float) -> Roots:
        """Its poles if the output had them all; with those at s = 0."""
        if self.below is None:
            return self.above.poles(up_to=up_to)
        return self.below.zeros(up_to=up_to)

    def residue(self, pole: complex, roots: RatioRoots) -> complex:
        """The residue at a simple pole: the mean of H (s - p) on a circle that no other of the roots is within.

        By the trapezoidal rule, whose error is (radius/distance)^16, 1e-10 at a quarter of it.
        """
        upper = np.r_[roots.poles, roots.zeros, 0.0]
        others = np.r_[upper, upper.conj()]
        radius = abs(pole - others[others != pole]).min() / 4
        turn = radius * np.exp(2j * np.pi * (np.arange(16) + 0.5) / 16)
        return complex(np.mean(self(pole + turn) * turn))


def _transfer(arm: Arm, name: str) -> TransferFunction:
    """To a signal with its place after an @."""
    wanted, x = locate_output(name, arm.length)
    return transfer(arm, wanted, x=x if wanted.place == "x" else None)


@frozen(kw_only=True)
class Counterpart:
    """A pole of the exact response and the resonance that was measured in its place, if one was.

    `peak` [rad/s] is that of the measured curve; `measured` is the pole fitted there, None where its lines do not
    determine one.  `mode` is the number of the arm's mode, from 1; None where the ratio's poles are no modes.
    `frequency_ratio` is |s| measured over exact, by the peak where there is no pole.  `level` is the measured residue
    over the exact one: the sensor's gain and sign, and what shifts the mode besides.
    """

    pole: complex
    peak: float | None = None
    measured: Resonance | None = None
    frequency_ratio: float | None = None
    level: complex | None = None
    mode: Annotated[
        int | None,
        Quantity(
            "mode",
            help="number of the arm's mode; none where the poles of the response are no modes of the arm",
        ),
    ]
    exact: Annotated[
        float, Quantity("exact", "Hz", 7, "natural frequency abs(s) of the exact response's pole")
    ]
    frequency: Annotated[
        float | None,
        Quantity(
            "measured", "Hz", 7, "abs(s) of the pole fitted to the peak, or the peak itself", "measured_hz"
        ),
    ] = None
    frequency_std: Annotated[
        float | None,
        Quantity(
            "deviation",
            "Hz",
            2,
            key="measured_std_hz",
            help="standard deviation of the fitted pole's frequency",
        ),
    ] = None
    off: Annotated[
        float | None,
        Quantity(
            "difference", "%", 3, "measured over exact frequency, less one", "frequency_residual_percent"
        ),
    ] = None
    measured_damping: Annotated[
        float | None,
        Quantity(
            "measured damping ratio",
            digits=4,
            key="measured_damping_ratio",
            help="of the pole fitted to the measured peak",
        ),
    ] = None
    damping_std: Annotated[
        float | None,
        Quantity(
            "deviation",
            digits=2,
            key="measured_damping_ratio_std",
            help="standard deviation of the measured damping ratio",
        ),
    ] = None
    level_db: Annotated[
        float | None,
        Quantity(
            "residue, measured over exact", "dB", 3, "gain error of the sensor and shift of the mode shape"
        ),
    ] = None
    level_degrees: Annotated[
        float | None,
        Quantity("turned", "deg", 3, "phase of the residue; 180 deg is a reversed sign", "level_degrees"),
    ] = None
    is_peak_only: Annotated[bool, Quantity(help="whether the lines around the peak determine no pole")] = (
        False
    )
    damping_ratio: Annotated[
        float,
        Quantity(
            "exact damping ratio",
            digits=4,
            key="exact_damping_ratio",
            help="of the pole of the exact response",
        ),
    ]


class RequiredChange(NamedTuple):
    """A change of one number of the arm that alone would explain one measured mode."""

    parameter: Annotated[str, Quantity("parameter", help="number of the arm that is changed alone")]
    mode: Annotated[int, Quantity("mode", help="number of the mode whose measured frequency is met")]
    change: Annotated[
        float,
        Quantity(
            "change",
            "%",
            4,
            "relative change that moves the mode to its measured frequency",
            "change_percent",
        ),
    ]


@frozen(kw_only=True)
class Overlay:
    """A measured response of an arm and the exact one.

    `exact` is at the measured frequencies, `curve` at those of a grid `omega` [rad/s] that misses no peak.  `modes`
    has a row a pole in the range; `unmatched` [rad/s] are measured peaks that the arm does not have.
    """

    arm: Arm
    measured: Annotated[Measured, Quantity(flat=True, help="measured response and its file")]
    noise: Annotated[Noise, Quantity(flat=True, help="standard deviation of the measured values")]
    ratio: Ratio
    roots: Annotated[RatioRoots, Quantity(flat=True, help="poles and zeros of the exact response")]
    exact: Complex
    omega: Real
    curve: Complex
    modes: Annotated[
        tuple[Counterpart, ...],
        Quantity("mode by mode", help="exact and measured poles, a row a pole in the range"),
    ]
    unmatched: Real

    @property
    def arm_name(self) -> Annotated[str, Quantity("arm", key="arm", help="arm of the exact response")]:
        """The name of the arm."""
        return self.arm.name

    @property
    def unit(self) -> Annotated[str, Quantity("unit", help="SI unit of the response")]:
        """The unit of the response."""
        return self.ratio.unit

    @property
    def unmatched_hz(
        self,
    ) -> Annotated[
        list[float],
        Quantity(
            "measured peaks far from every pole of the arm [Hz]",
            key="unmatched_peaks_hz",
            help="measured peaks without a pole of the arm near them",
        ),
    ]:
        """Measured peaks that the arm does not have."""
        return (self.unmatched / HERTZ).tolist()

    @property
    def csv_table(self) -> Table:
        """A row a frequency: measured and exact."""
        values = self.measured.values
        exact = self.exact
        columns = {"re": values.real, "im": values.imag, "exact_re": exact.real, "exact_im": exact.imag}
        first = Column("hz", "", "Hz", of=self.measured.omega / HERTZ)
        return Table(columns=(first, *(Column(name, name, of=column) for name, column in columns.items())))

    @property
    def finding(self) -> str:
        """The number of poles of the arm that were measured, and the difference."""
        seen = sum(each.peak is not None for each in self.modes)
        return f"{seen} of {len(self.modes)} poles measured, ln |measured/exact| {self.rms_log_error:.2g} rms"

    @property
    def rms_log_error(
        self,
    ) -> Annotated[
        float,
        Quantity(
            "rms of ln(measured/exact)", digits=4, help="root mean square over frequencies above the noise"
        ),
    ]:
        """The root mean square of ln |measured/exact|, over frequencies above the noise."""
        values = self.measured.values
        kept = (abs(values) > self.noise.sigma) & np.isfinite(self.exact) & (self.exact != 0)
        if kept.any():
            return rms(np.log(abs(values[kept] / self.exact[kept])))
        return math.inf

    @cached_property
    def required_changes(
        self,
    ) -> Annotated[
        tuple[RequiredChange, ...],
        Quantity(
            "single changes that explain a mode",
            key="required_percent",
            help="change of one number that alone moves a mode to its measured frequency",
        ),
    ]:
        """A row a parameter of `Modes.sensitivity` and mode: the change of it that alone would explain the mode.

        It is exp(ln(measured/exact)/S) - 1 with S = d ln w/d ln p: exact for a power law, as of Young's modulus or the
        density, else to first order.  Without factors beyond 3, or of a number that hardly moves the mode.
        """
        ratios = {
            row.mode: row.frequency_ratio
            for row in self.modes
            if row.mode and row.frequency_ratio is not None
        }
        if not ratios:
            return ()
        table = modes_of(self.ratio.driven, max(ratios))
        found = []
        for name, slopes in table.sensitivity.items():
            for mode, ratio in ratios.items():
                slope = slopes[table.index == mode][0]
                # a number with a smaller d ln w/d ln p does not move the mode
                exponent = math.log(ratio) / slope if abs(slope) > 1e-3 else math.inf
                # a larger factor on a number is no explanation
                if abs(exponent) <= math.log(3.0):
                    found.append(RequiredChange(name, mode, 100 * (math.exp(exponent) - 1)))
        return tuple(found)


def overlay(arm: Arm, measured: Measured) -> Overlay:
    """A measured response and the exact one of that arm.

    Raises ParameterError for signals that the arm does not have, and where the frequencies of the file are in another
    unit than its header has (see `must_be_in_unit`).
    """
    must_be_arm(arm)
    must_be_measured(measured)
    ratio = ratio_of(arm, measured)
    noise = noise_of(measured)
    low, high = measured.band
    roots = ratio.roots(PARTNERS_BEYOND * high)
    places = peaks_of(measured, noise.sigma)
    own = peaks_among(roots.poles)
    own = own[abs(own) >= low / PARTNERS_BEYOND]
    is_inside = (abs(own) >= low) & (abs(own) <= high)
    pairs, _ = matched_peaks(measured.omega[places], abs(own), measured.band)
    if len(pairs) < max(places.size, is_inside.sum()):
        check_unit(arm, measured)
    at = {j: int(places[i]) for i, j in pairs}
    shown = [(pole, at.get(j)) for j, pole in enumerate(own.tolist()) if j in at or is_inside[j]]
    omega = refined_grid(measured.band, np.r_[roots.poles, roots.zeros]) if low < high else measured.omega
    return Overlay(
        arm=arm,
        measured=measured,
        noise=noise,
        ratio=ratio,
        roots=roots,
        exact=ratio(1j * measured.omega),
        omega=omega,
        curve=ratio(1j * omega),
        modes=_counterparts(ratio, roots, measured, noise, shown),
        unmatched=np.delete(measured.omega[places], [i for i, _ in pairs]),
    )


def _counterparts(
    ratio: Ratio, roots: RatioRoots, measured: Measured, noise: Noise, shown: list[tuple[complex, int | None]]
) -> tuple[Counterpart, ...]:
    """A row a pole: of each pole [1/s] that is shown, with the place of its measured peak, if it has one.

    The arm's modes are named where they are the poles of the ratio, each by the nearest natural frequency.
    """
    # of its frequency: how near a pole of a damped arm is to that mode of the arm without damping
    same = 0.1
    up_to = (1 + same) * max((abs(pole) for pole, _ in shown), default=0.0)
    are_modes = ratio.is_driven and up_to > 0 and modes_below(ratio.driven, up_to) > 0
    table = modes_of(ratio.driven, up_to=up_to) if are_modes else None
    found = []
    for pole, place in shown:
        mode = 0
        size = abs(pole)
        if table is not None:
            away = abs(table.natural_frequency / size - 1)
            mode = int(table.index[away.argmin()]) * (away.min() < same)
        row = Counterpart(
            pole=pole, mode=mode or None, exact=size / HERTZ, damping_ratio=-pole.real / size + 0.0
        )
        found.append(row if place is None else _seen(row, ratio.residue(pole, roots), measured, noise, place))
    return tuple(found)


def _seen(row: Counterpart, residue: complex, measured: Measured, noise: Noise, place: int) -> Counterpart:
    """The row of a pole with its measured peak, and the pole that is fitted there."""
    own = resonance_at(measured, noise.sigma, place)
    peak = float(measured.omega[place])
    at = peak if own is None else abs(own.pole)
    share = at / abs(row.pole)
    found: dict[str, Any] = {
        "peak": peak,
        "frequency": at / HERTZ,
        "frequency_ratio": share,
        "off": 100 * (share - 1),
    }
    if own is None:
        return replace(row, **found, is_peak_only=True)
    of_damping, of_frequency = own.std.tolist()
    level = own.residue / residue if residue else 0.0
    if level:
        degrees = math.degrees(np.angle(level))
        found |= {"level": level, "level_db": 20 * math.log10(abs(level)), "level_degrees": degrees}
    return replace(
        row,
        **found,
        measured=own,
        frequency_std=of_frequency / HERTZ,
        measured_damping=own.damping_ratio,
        damping_std=of_damping / at,
    )


class ResonanceShift(NamedTuple):
    """A measured peak [Hz] and that of the arm before and after the fit; None where it has none there."""

    before: Annotated[float | None, Quantity("start", "Hz", help="pole of the arm at the start of the fit")]
    after: Annotated[
        float | None,
        Quantity("fitted", "Hz", help="pole of the fitted arm; none where it has none near the peak"),
    ]
    measured: Annotated[float, Quantity("measured", "Hz", help="peak of the measured response")]


def resonance_shifts(before: Arm, after: Arm, responses: Sequence[FitResponse]) -> list[ResonanceShift]:
    """Each measured peak of all responses, with those of the arm before and after a fit.

    A peak is a pole of its response: a natural frequency, with the hub held where the response is over the hub's angle.
    Of a response whose poles are not found completely no peak is listed.
    """
    found = {}
    for one in responses:
        data = one.data
        with suppress(ConvergenceError):
            old, new = (
                peaks_among(Ratio(arm, data.output, data.input).poles(PARTNERS_BEYOND * data.band[1]).values)
                for arm in (before, after)
            )
            w = abs(new)
            peaks = data.omega[peaks_of(data, one.noise.sigma)]
            places = dict(matched_peaks(peaks, w, data.band)[0])
            earlier = dict(matched_peaks(w, abs(old), data.band)[0])
            for n, peak in enumerate(peaks.tolist()):
                start = end = None
                own = places.get(n, abs(np.log(w / peak)).argmin() if w.size else None)
                # of ln w: a peak farther from all of the arm's is none of them, a broad one by twice its damping ratio
                if own is not None and abs(math.log(w[own] / peak)) < 0.1 - 2.0 * new[own].real / w[own]:
                    start = float(abs(old[earlier[own]])) / HERTZ if own in earlier else None
                    end = float(w[own]) / HERTZ
                # peaks of two responses that are nearer, of ln w, are one
                found[data.input, round(math.log(peak) / 0.02)] = ResonanceShift(start, end, peak / HERTZ)
    return sorted(found.values(), key=lambda row: row.measured)


def check_unit(arm: Arm, measured: Measured) -> None:
    """Raise ParameterError where the file's frequencies are in another unit than its header has (`must_be_in_unit`).

    Nothing is checked where the arm's poles up to there are not found.
    """
    ratio = ratio_of(arm, measured)
    with suppress(ConvergenceError):
        poles = ratio.poles(PARTNERS_BEYOND * HERTZ * measured.omega[-1]).values
        must_be_in_unit(measured, noise_of(measured).sigma, poles)


def ratio_of(arm: Arm, measured: Measured) -> Ratio:
    """The exact response of what was measured; ParameterError, naming it, where the arm has no such response."""
    try:
        return Ratio(arm, measured.output, measured.input)
    except ParameterError as error:
        raise ParameterError(
            key=f"{measured.name} {error.key}", value=error.value, remedy=error.remedy, file=error.file
        ) from None
