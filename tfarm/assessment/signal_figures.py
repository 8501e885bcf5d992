"""Figures of the signals of a loop over time: peak, final value, rise and settling times, overshoot, residual.

Figures, as in textbooks (Ogata, Modern Control Engineering, 2010, sec. 5-3): the final value is the mean of the last
tenth of the record; rise time from 10 to 90 % of it; overshoot beyond it, over it.  Settling counts from the end of the
motion, within 2 % of the travel as in python-control and MATLAB.  Of a signal without a reference, and of root moment
and torque, the share is of the largest deviation from the final value: as for `tfarm simulate`, which reads the samples
alone.

A figure is not determined where the bound on the error of the signal leaves 1 % of it open.  A peak is enclosed between
the largest |y| less its bound there and the largest |y| plus bound of the whole record, on both sides of its jumps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.chain import TIME_ROUNDING
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.digits import general
from tfarm.dsp.simulation import final_value, settling_time
from tfarm.loop.time_response import TORQUE, Peak
from tfarm.records import frozen
from tfarm.response.signals import locate_output
from tfarm.schema import Percent, Quantity

PARTS = ("hub", "tip", "root_moment", "torque")


class Millimetres(float):
    """A length [m] that a person reads in mm."""

    def as_text(self, digits: int) -> str:
        """Return the number of mm."""
        return general(1e3 * self, digits)


@dataclass(frozen=True, kw_only=True)
class SignalFigures:
    """Figures of one signal over time, in its own unit; None where the signal, or the record, has none."""

    signal: Annotated[str, Quantity(help="output of the arm, or torque for its input")]
    unit: Annotated[str, Quantity(help="SI unit of the values of the signal")]
    peak: Annotated[
        float | None,
        Quantity(
            "peak",
            digits=6,
            unit_of="unit",
            help="largest value in size, with its sign, on both sides of jumps",
        ),
    ]
    peak_time: Annotated[float | None, Quantity("peak time", "s", 4, help="time of the peak")]
    final_value: Annotated[
        float | None,
        Quantity(
            "final value",
            digits=4,
            unit_of="unit",
            help="mean over the last tenth of the record; none where the signal has not settled",
        ),
    ]
    rise_time: Annotated[
        float | None,
        Quantity(
            "rise time (10-90 %)",
            "s",
            4,
            help="time from 10 to 90 % of the final value, of a signal with a reference",
        ),
    ]
    overshoot: Annotated[
        Percent | None,
        Quantity(
            "overshoot", "", 4, help="excess of the largest value over the final one, as a share of that"
        ),
    ]
    settling_time: Annotated[
        float | None,
        Quantity(
            "settling time",
            "s",
            4,
            help="time from the end of the motion after which deviations stay within the settling band of the travel, "
            "or of the largest deviation where there is no reference",
        ),
    ]
    at_rest_after: Annotated[
        float | None, Quantity("at rest after", "s", 4, help="end of the motion plus settling time")
    ]
    steady_state_error: Annotated[
        float | None,
        Quantity("steady-state error", digits=4, unit_of="unit", help="reference less final value"),
    ]
    residual_rms: Annotated[
        float | None,
        Quantity(
            "residual vibration (rms)",
            digits=4,
            unit_of="residual_unit",
            help="rms about the final value once the slew or the pulse is over",
        ),
    ]
    remainder_bound: Annotated[
        float | None,
        Quantity(
            "remainder bound at the peak",
            digits=2,
            unit_of="unit",
            help="of the error at the peak, as measured; at least the rounding of the peak",
        ),
    ]
    note: Annotated[
        str | None, Quantity("not determined", help="figures without a value, with their reason")
    ] = None

    @property
    def residual_unit(self) -> str:
        """Unit of the residual for a person."""
        return "mm" if isinstance(self.residual_rms, Millimetres) else self.unit


@frozen(kw_only=True)
class LoopResponse:
    """Figures of one loop, not defined of an unstable one, and its signals by name, "torque" being the input."""

    stability: Annotated[str, Quantity("stability", help="stable, marginal or unstable")]
    certainty: Annotated[
        str,
        Quantity("certainty", help="by the remainder of the poles or by twice the modes, with their number"),
    ]
    signals: dict[str, Real]
    hub: Annotated[
        SignalFigures | None, Quantity("hub", help="hub angle, or hub rate where that is the reference")
    ] = None
    tip: Annotated[
        SignalFigures | None, Quantity("tip", help="tip displacement, or its velocity under a hub rate")
    ] = None
    root_moment: Annotated[
        SignalFigures | None, Quantity("root moment", help="elastic moment at the root")
    ] = None
    torque: Annotated[
        SignalFigures | None,
        Quantity("torque", help="input of the arm by the motor: torque, voltage or current"),
    ] = None


class SignalCurve(NamedTuple):
    """Values `y` of a signal at times `t` [s], bounds of their errors, and the peak where known."""

    t: Real
    y: Real
    bound: Real
    peak: Peak | None = None

    @property
    def largest(self) -> Peak:
        """The peak; that of the values where no other is known."""
        if self.peak is not None:
            return self.peak
        n = int(abs(self.y).argmax())
        value = float(self.y[n])
        return Peak(float(self.t[n]), value, 0.0, abs(value))

    @property
    def is_converged(self) -> bool:
        """Whether the error is at most 1e-6 of the peak, everywhere in the record."""
        peak = self.largest
        most = 1e-6 * abs(peak.value)
        return bool((self.bound <= most).all()) and peak.bound <= most


@frozen
class LoopRecord:
    """Times [s] of the signals of a loop, the names of those of hub and tip, root moment and torque, and references.

    `busy_until` [s] is the end of the input, `band` the share of the travel within which a signal settles.
    """

    arm: Arm
    names: tuple[str, ...]
    busy_until: float
    t: Real
    reference: Mapping[str, Real]
    band: float

    def of_loop(
        self, stability: str, is_converged: bool, count: str, curves: Mapping[str, SignalCurve]
    ) -> LoopResponse:
        """Return the figures of a loop; of an unstable one those of its signals are left out."""
        figures = {}
        if stability != "unstable":
            figures = {
                part: self.figures(name, curves[name]) for part, name in zip(PARTS, self.names, strict=True)
            }
        word = "converged" if is_converged else "approximate"
        return LoopResponse(
            stability=stability,
            certainty=f"{word}, {count}",
            signals={name: curve.y[np.isin(curve.t, self.t)] for name, curve in curves.items()},
            **figures,
        )

    def figures(self, name: str, curve: SignalCurve) -> SignalFigures:
        """Return the figures of one signal; those that its error leaves open are None."""
        # share of a figure: more than its error may be is not determined
        most_open = 0.01
        peak = curve.largest
        known = self._values(name, curve, 0 * curve.bound)
        known |= {"peak": peak.value, "peak_time": peak.time}
        words = []
        for key, share in self._errors(name, curve, known, most_open).items():
            if share > most_open:
                known[key] = None
                words.append(f"{key.replace('_', ' ')}: remainder {100 * share:.2g} %")
        if math.isinf(peak.most):
            known |= dict.fromkeys(("peak", "peak_time", "settling_time"))
            words = ["impulse"]
        settled = known["settling_time"]
        return SignalFigures(
            signal=name,
            unit=signal_unit(self.arm, name),
            **known,
            note="; ".join(words) or None,
            at_rest_after=None if settled is None else self.busy_until + settled,
            remainder_bound=peak.bound or None,
        )

    def _errors(
        self, name: str, curve: SignalCurve, known: Mapping[str, Any], most_open: float
    ) -> dict[str, float]:
        """Return the share of each known figure that the bounds on the signal leave open."""
        peak = curve.largest
        size = max(abs(peak.value), LEAST_SIZE)
        step = float(self.t[1])
        # errors of smaller values are shares of a thousandth of the largest one
        resolved = 1e-3 * size
        floors = {"overshoot": 0.01, "settling_time": step / most_open, "rise_time": step / most_open}
        below = self._values(name, curve, -curve.bound)
        above = self._values(name, curve, curve.bound)
        errors = {
            key: _relative_change(known[key], (below[key], above[key]), floors.get(key, resolved))
            for key in below
        }
        errors["peak"] = (peak.most - abs(peak.value) + peak.bound) / size
        span = 0.0
        if peak.bound > most_open * resolved:
            times = curve.t[abs(curve.y) + curve.bound >= abs(peak.value) - peak.bound]
            span = float(np.ptp(np.append(times, peak.time)))
        errors["peak_time"] = (span - 2 * step) / max(peak.time, self.t[-1] / 10)
        return errors

    def _values(self, name: str, curve: SignalCurve, more: Real) -> dict[str, Any]:
        """Return the figures but the peak of a signal, `more` being added to it and to its deviations."""
        t, y, *_ = curve
        final, away, scale = self.deviations(name, t, y)
        settled = settling_time(t, np.maximum(away + more, 0), scale, self.busy_until, self.band)
        names = ("final_value", "rise_time", "overshoot", "steady_state_error", "residual_rms")
        values: dict[str, Any] = {**dict.fromkeys(names), "settling_time": settled}
        after = t >= self.busy_until * (1 - TIME_ROUNDING)
        if self.busy_until and after.sum() > 1:
            unit = Millimetres if name == "tip_displacement" else float
            left = (y - final)[after] ** 2
            values["residual_rms"] = unit(np.sqrt(np.trapezoid(left, t[after]) / np.ptp(t[after])))
        if settled is None:
            return values
        final += float(more.mean())
        # of an arm that turns freely the root moment ends at 0
        if name != "root_moment" or not self.arm.has_rigid_mode:
            values["final_value"] = final
        if final and name in self.reference:
            share = (y + more) / final
            values["rise_time"] = _time_at(t, share, 0.9) - _time_at(t, share, 0.1)
            values["overshoot"] = Percent(max(0.0, float(share.max()) - 1))
            values["steady_state_error"] = float(self.reference[name][-1]) - final
        return values

    def deviations(self, name: str, t: Real, y: Real) -> tuple[float, Real, float]:
        """Return the final value of a signal, deviations from it, and the scale of its settling band."""
        is_even = np.isin(t, self.t)
        final = final_value(t[is_even], y[is_even])
        away = abs(y - final)
        if name in self.reference:
            return final, away, abs(final - float(y[0]))
        return final, away, float(away.max())


def signal_unit(arm: Arm, name: str) -> str:
    """Return the SI unit of a signal, or of the input as "torque"."""
    if name == TORQUE:
        return arm.input_unit
    return locate_output(name, arm.length)[0].unit


def _relative_change(value: float | None, others: Sequence[float | None], floor: float) -> float:
    """Return the largest change from a value to others, over its size or a floor; inf where one of both is None."""
    if value is None or None in others:
        return 0.0 if {value, *others} == {None} else math.inf
    return max(abs((each or 0.0) - value) for each in others) / max(abs(value), floor, LEAST_SIZE)


def _time_at(t: Real, share: Real, level: float) -> float:
    """Return the time [s] at which a signal first reaches a level, by a line between two records."""
    n = int((share >= level).argmax())
    if n:
        return float(np.interp(level, share[n - 1 : n + 1], t[n - 1 : n + 1]))
    return float(t[0])
