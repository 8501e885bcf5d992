"""A measured response compared with the exact one, mode by mode.

A row has the differences of a pole of the arm from the peak measured in its place; the single changes of the arm's
numbers that would explain them are listed too.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import Arm, must_be_arm
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.fitting.data import Measured, Noise, must_be_measured, noise_of, rms
from tfarm.fitting.model import FitResponse
from tfarm.fitting.ratio import Ratio, RatioRoots, check_unit, ratio_of
from tfarm.fitting.resonances import (
    PARTNERS_BEYOND,
    Resonance,
    matched_peaks,
    peaks_among,
    peaks_of,
    resonance_at,
)
from tfarm.records import frozen
from tfarm.response.frequency import HERTZ, refined_grid
from tfarm.schema import Column, Quantity, Table
from tfarm.spectrum import modes as modes_of
from tfarm.spectrum import modes_below


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
        ratios = {row.mode: row.frequency_ratio for row in self.modes if row.mode and row.frequency_ratio}
        if not ratios:
            return ()
        table = modes_of(self.ratio.driven_arm, max(ratios))
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
    """Return a measured response and the exact one of that arm.

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
        modes=counterparts(ratio, roots, measured, noise, shown),
        unmatched=np.delete(measured.omega[places], [i for i, _ in pairs]),
    )


def counterparts(
    ratio: Ratio, roots: RatioRoots, measured: Measured, noise: Noise, shown: list[tuple[complex, int | None]]
) -> tuple[Counterpart, ...]:
    """Return the rows of the poles [1/s] that are shown, each with the place of its measured peak, if it has one.

    The arm's modes are named where they are the poles of the ratio, each by the nearest natural frequency.
    """
    # of its frequency: how near a pole of a damped arm is to that mode of the arm without damping
    same = 0.1
    up_to = (1 + same) * max((abs(pole) for pole, _ in shown), default=0.0)
    are_modes = ratio.is_driven and up_to > 0 and modes_below(ratio.driven_arm, up_to) > 0
    table = modes_of(ratio.driven_arm, up_to=up_to) if are_modes else None
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
        found.append(
            row if place is None else with_peak(row, ratio.residue(pole, roots), measured, noise, place)
        )
    return tuple(found)


def with_peak(
    row: Counterpart, residue: complex, measured: Measured, noise: Noise, place: int
) -> Counterpart:
    """Return the row of a pole with its measured peak, and the pole that is fitted there."""
    own = resonance_at(measured, noise.sigma, place)
    peak = float(measured.omega[place])
    at = peak if own is None else abs(own.pole)
    share = at / abs(row.pole)
    row = replace(row, peak=peak, frequency=at / HERTZ, frequency_ratio=share, off=100 * (share - 1))
    if own is None:
        return replace(row, is_peak_only=True)
    of_damping, of_frequency = own.std.tolist()
    level = own.residue / residue if residue else 0.0
    if level:
        decibels = 20 * math.log10(abs(level))
        row = replace(row, level=level, level_db=decibels, level_degrees=math.degrees(np.angle(level)))
    return replace(
        row,
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
    """Return each measured peak of all responses, with those of the arm before and after a fit.

    A peak is a pole of its response: a natural frequency, with the hub held where the response is over the hub's angle.
    Of a response whose poles are not found completely no peak is listed.
    """
    found = {}
    for one in responses:
        data = one.data
        with suppress(ConvergenceError):
            up_to = PARTNERS_BEYOND * data.band[1]
            old, new = (peaks_among(ratio_of(arm, data).poles(up_to).values) for arm in (before, after))
            w = abs(new)
            peaks = data.omega[peaks_of(data, one.noise.sigma)]
            places = dict(matched_peaks(peaks, w, data.band)[0])
            earlier = dict(matched_peaks(w, abs(old), data.band)[0])
            for n, peak in enumerate(peaks.tolist()):
                start = end = None
                own = places.get(n, abs(np.log(w / peak)).argmin() if w.size else None)
                # of ln w: a peak farther from all of the arm's is none of them, a broad one by twice its damping ratio
                if own is not None and abs(math.log(w[own] / peak)) < 0.1 - 2.0 * new[own].real / w[own]:
                    end = float(w[own]) / HERTZ
                    if own in earlier:
                        start = float(abs(old[earlier[own]])) / HERTZ
                # peaks of two responses that are nearer, of ln w, are one
                found[data.input, round(math.log(peak) / 0.02)] = ResonanceShift(start, end, peak / HERTZ)
    return sorted(found.values(), key=lambda row: row.measured)
