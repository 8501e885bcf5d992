"""What the live page of an arm's loop carries: exact samples, the map's regions, and what is known beyond the band.

And of sensors along the arm, at many x what they see of each mode, and their zeros.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Any, get_args

import numpy as np

from tfarm.arm import ANGLE_GAIN, GAINS, MOMENT_GAIN, PLANE, Arm, HubFeedback, as_law, unit_of
from tfarm.comparing.regions import BEYOND_PICTURE, sampled_region
from tfarm.crossing import pieces
from tfarm.digits import kept_digits
from tfarm.dsp import Chain
from tfarm.dsp import GainMap as SampledMap
from tfarm.errors import TfarmError
from tfarm.loop.loop import Loop, steep_places
from tfarm.loop.panels import Panels, Positions, Sensor, loop_panels, positions, sensed_places
from tfarm.loop.plane import gain_map, moment_axis, rate_axis, rate_columns
from tfarm.loop.stability import band_of_family, stability
from tfarm.loop.windows import windows_of
from tfarm.report.live_sampled import packed, sampled_numbers, slew_numbers
from tfarm.spectrum.scales import angle_unit, default_gains

LIVE_COLUMNS = 90  # values of the gain across at which the continuous region is cut
ANGLE_RANGE = 0.1  # of J w1^2: the largest gain on the hub angle of the page
ANGLE_LINEAR = 1e-4  # of that: where its slider begins to be logarithmic
EDGE_DIGITS = 7  # of the edges of the map's regions: far more than a screen has
SENSOR_PIECES = 16  # pieces of the arm between two positions
SENSED_MODES = 6  # whose frequencies and zeros the chart of sensors has
SENSOR_DIGITS = 6  # of what that chart draws and tells: far more than a screen has


def live_data(arm: Arm, chain: Chain, law: HubFeedback | None = None) -> dict[str, Any]:
    """Everything as plain numbers and words.  `law` is where the page begins: the default gains if not given.

    Raises what `gain_map` and `loop_panels` raise.
    """
    x = rate_axis(arm)
    y, stiffest = moment_axis(arm, x), ANGLE_RANGE * angle_unit(arm)
    axes: dict[str, dict[str, Any]] = {
        name: {"low": axis.low, "high": axis.high, "linear": None if axis.is_linear else axis.linear}
        for name, axis in zip(PLANE, (x, y), strict=True)
    } | {ANGLE_GAIN: {"low": 0.0, "high": stiffest, "linear": ANGLE_LINEAR * stiffest}}
    reference = default_gains(arm)
    laws = (dict(zip(axes, each, strict=True)) for each in product(*((of["low"], of["high"]) for of in axes.values())))
    band, is_quiet = band_of_family(Loop(arm, as_law(HubFeedback(**law))) for law in laws)
    samples, across = loop_panels(arm, band), rate_columns(arm, x, LIVE_COLUMNS)
    beyond = np.array([y.low - BEYOND_PICTURE, y.high + BEYOND_PICTURE])
    continuous = gain_map(arm, np.unique(np.r_[across, x.high]), beyond)
    sampled = sampled_region(arm, x, y, chain)
    return {
        "name": arm.name,
        "units": {gain.name: unit_of(gain.name, arm) for gain in GAINS},
        "axes": axes,
        "start": {gain.name: (law or reference)[gain.name] for gain in GAINS},
        **_samples(samples),
        **_known(arm, is_quiet),
        "reference": {name: reference[name] for name in PLANE},
        "reference_count": stability(arm, reference, band).unstable_roots,
        "continuous": _areas(continuous.axes[0], continuous.stable_intervals),
        "sampled_map": None if sampled is None else _sampled(sampled, chain),
        "sampled_loop": None if sampled is None else sampled_numbers(sampled.loop),
        "slew": slew_numbers(arm, chain, law or reference),
        **sensor_numbers(arm),
        "lyapunov": arm.is_uniform,
    }


def _samples(panels: Panels) -> dict[str, Any]:
    """The samples as the bytes of doubles, by panel, part and point, and where they are."""
    return {
        "samples": packed(panels.values.transpose(1, 0, 2)),
        "low": panels.low.tolist(),
        "high": panels.high.tolist(),
        "order": panels.order,
        "error": float(f"{panels.error:.0e}"),
        "places": np.asarray(steep_places(panels.arm, 1.05 * panels.band)).tolist(),
        "band": panels.band,
    }


def _known(arm: Arm, is_quiet: bool) -> dict[str, Any]:
    """What a verdict on any gains rests on: theorems and bounds beyond the band, and the static balance."""
    kind = "reactive" if arm.is_reactive else "quiet" if is_quiet else "band"
    by_energy = "C = 0: every mode beyond the band is damped (Lyapunov), with a decay rate that tends to 0"
    beyond = "beyond the band |L| stays below one half at all gains of this page: no unstable pole there (small gain)"
    if arm.is_reactive and not arm.is_told_by_lyapunov:
        by_energy = "C = 0: none of the modes looked at is driven; no theorem tells the others"
    moments = _stable_moments(arm) if arm.is_reactive else (-math.inf, math.inf)
    return {
        "kind": kind,
        "beyond": beyond if kind == "quiet" else by_energy,
        "moments": [None if math.isinf(end) else end for end in moments],  # JSON has no infinity
        "told": arm.has_elastic_link and arm.reads_hub_moment and not arm.input_lags,
        "hub_alone": arm.loses_at_hub_alone,
        "whole": arm.input_per_torque,
        "rate_loss": arm.rate_loss,
        "inertia": arm.turned_inertia,
        "gauged": arm.gauged_inertia,
    }


def _stable_moments(arm: Arm) -> tuple[float, float]:
    """Between which K2 no mode is driven by K1 > 0 without damping; infinite where no limit was found."""
    found = windows_of(stability(arm, default_gains(arm).having(MOMENT_GAIN, 0.0)), [MOMENT_GAIN])[MOMENT_GAIN]
    low, high = found.around or (-math.inf, math.inf)
    return low if found.end(low) == "edge" else -math.inf, high if found.end(high) == "edge" else math.inf


def _areas(across: Any, intervals: Sequence[Sequence[tuple[float, float]]]) -> list[dict[str, float]]:
    """Rows across, low, high of the parts of a region, each part with its number."""
    parts = enumerate(pieces(across, intervals))
    keys = ("part", PLANE[0], "low", "high")
    return [
        dict(zip(keys, (number, *kept_digits(point, EDGE_DIGITS)), strict=True))
        for number, piece in parts
        for point in piece.points
    ]


def _sampled(plane: SampledMap, chain: Chain) -> dict[str, Any]:
    """The sampled region, its columns with exact ends, and what it holds for."""
    ms = f"{1e3 * chain.sampling.period:g} ms"
    C = plane.loop.plant.arm.damping
    return {
        "areas": _areas(plane.axes[0], plane.stable_intervals),
        PLANE[0]: plane.axes[0].tolist(),
        "intervals": plane.stable_intervals,
        "words": f"every {ms}" + ("" if C else f", of the first {plane.modes_used} modes"),
    }


# ------------------------------------------------------------ sensors along the arm


def sensor_numbers(arm: Arm) -> dict[str, Any]:
    """`sensor`: participation and zeros at every position, by the kind of sensor, without ends that sense nothing.

    None where they cannot be had, and then `no_sensor` says why.
    """
    x, sensors = np.linspace(0.0, arm.length, SENSOR_PIECES + 1), {}
    try:
        for kind in get_args(Sensor):
            places = sensed_places(arm, kind, x, SENSED_MODES)
            sensors[kind] = _numbers(positions(arm, kind, places, SENSED_MODES))
    except TfarmError as error:
        return {"sensor": None, "no_sensor": str(error)}
    return {"sensor": sensors}


def _numbers(found: Positions) -> dict[str, Any]:
    """The positions in a few digits."""
    zeros = [np.c_[each.real, each.imag].tolist() for each in found.known_zeros]
    return {
        "x": kept_digits(found.x, SENSOR_DIGITS),
        "band": found.band,
        "modes": kept_digits(found.natural_frequency, SENSOR_DIGITS),
        "participation": [kept_digits(column, SENSOR_DIGITS) for column in found.participation.T],
        "zeros": [[kept_digits(zero, SENSOR_DIGITS) for zero in each] for each in zeros],
    }
