"""The numbers of a loop for its live page, which computes every margin, pole and response from them alone.

Continuous-time: samples of the parts of the loop function on Chebyshev panels, and what theorems decide.  Sampled and
in time: the poles and residues of the plant, the chain, and the shapes of the arm.
"""

import base64
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any, cast, get_args

import numpy as np

from tfarm.arm import FED_BACK, MOMENT_GAIN, NAMES, PLANE, Arm, HubFeedback, Law, unit_of
from tfarm.arm.blocks import Rational
from tfarm.arm.feedback import OUTPUT_OF
from tfarm.arm.stages import Consumer
from tfarm.arm.writing import law_toml
from tfarm.arrays import Complex
from tfarm.assessment.card import (
    GRADE_LIMITS,
    GRADED,
    graded_arm,
)
from tfarm.case import Case
from tfarm.crossing import pieces
from tfarm.digits import kept_digits
from tfarm.dsp import Chain, PulseTransfer, Simulator, scenario
from tfarm.dsp.plant import Plant
from tfarm.dsp.results import enough_modes, ideal_chain
from tfarm.dsp.scenarios import TRIAL_SLEWS
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.simulate import largest_moment, quantisers
from tfarm.errors import TfarmError
from tfarm.loop.circle_crossings import GainMap
from tfarm.loop.continuous import ContinuousLoop, steep_places
from tfarm.loop.edges import LONGEST_DELAY_SAMPLES
from tfarm.loop.panels import Sensor, loop_panels, positions, sensed_places
from tfarm.loop.plane import Plane, gain_map, moment_axis
from tfarm.loop.plane_axes import Axis, rate_axis, rate_columns
from tfarm.loop.sampled import Sampled
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import band_of_family, stability
from tfarm.loop.windows import windows_of
from tfarm.response import transfer
from tfarm.spectrum.gains import angle_unit, default_gains
from tfarm.synthesis.design import recommended_gains
from tfarm.synthesis.good_region import GoodRegion, good_region
from tfarm.synthesis.stability_map import BEYOND_PICTURE, sampled_region

CONSUMER = Consumer(
    "live page",
    acts=(
        "reference",
        "shaper",
        "anti-alias filter",
        "encoder",
        "hub rate",
        "amplifier steps",
        "amplifier range",
        "law",
        "arithmetic",
        "DAC steps",
        "DAC range",
        "torque limit",
        "hold",
        "delay",
        "hub damping",
        "plant",
    ),
    none=("volts",),
)
# values of the gain across at which the continuous region is cut
LIVE_COLUMNS = 90
LiveNumbers = dict[str, Any]


def pack_doubles(values: Any) -> str:
    """Return the bytes of doubles; of complex numbers real and imaginary parts in turn."""
    array = np.ascontiguousarray(values)
    doubles = array.view(float) if np.iscomplexobj(array) else array.astype(float)
    return base64.b64encode(doubles.astype("<f8").tobytes()).decode("ascii")


# ------------------------------------------------------------ of gains at the hub, and of a law of rational parts


def live_data(case: Case) -> LiveNumbers:
    """Return all numbers of the page of a loop, which begins with the law of the case.

    That of gains at the hub has their plane and the slew.  That of a law of rational parts varies the gain of each.
    Raises ParameterError for other laws, and what `gain_map` and `loop_panels` raise.
    """
    return _of_parts(case) if case.gains is None else _of_gains(case, case.gains)


def _of_gains(case: Case, start: HubFeedback) -> LiveNumbers:
    """Return the numbers of the page of gains at the hub."""
    arm = case.arm
    x = rate_axis(arm)
    y = moment_axis(arm, x)
    stiffest = 0.1 * angle_unit(arm)
    axes = dict(zip(NAMES, (*map(_range, (x, y)), _range(Axis(0.0, stiffest, 1e-4 * stiffest))), strict=True))
    ends = [(of["low"], of["high"]) for of in axes.values()]
    corners = [case.under(HubFeedback(K1=K1, K2=K2, Kp=Kp)) for K1, K2, Kp in product(*ends)]
    reference = default_gains(arm)
    across = np.unique(np.r_[rate_columns(arm, x, LIVE_COLUMNS), x.high])
    continuous = gain_map(arm, across, np.array([y.low - BEYOND_PICTURE, y.high + BEYOND_PICTURE]))
    sampled = sampled_region(arm, x, y, case.chain)
    good = good_region(arm, x, y, case.chain)
    chosen, _ = recommended_gains(arm, case.chain)
    return {
        **_of_any_law(case.under(reference), corners),
        "names": NAMES,
        "labels": {"K1": "hub rate", "K2": "root moment", "Kp": "hub angle"},
        "plane": PLANE,
        # of each gain a part of the samples, and the power of s on it
        "rows": [[1, 1], [2, 2], [1, 0]],
        "of_law": None,
        "units": {name: unit_of(name, arm) for name in NAMES},
        "axes": axes,
        "start": start.by_name,
        "reference": {name: reference[name] for name in PLANE},
        "continuous": _areas(continuous),
        "sampled_map": None if sampled is None else _sampled_map(sampled),
        "good": None if good is None else _areas(good),
        "recommended": chosen.law.by_name if chosen is not None and chosen.is_met else None,
        "sampled_loop": None if sampled is None else sampled_numbers(sampled.loop),
        "slew": slew_numbers(case),
        "lyapunov": arm.is_uniform,
        "default": reference.by_name,
        "outputs": OUTPUT_OF,
    }


def _range(axis: Axis) -> LiveNumbers:
    """Return the range of a gain."""
    return {"low": axis.low, "high": axis.high, "linear": None if axis.is_linear else axis.linear}


def _of_parts(case: Case) -> LiveNumbers:
    """Return the numbers of the page of a law of rational parts: each gain from a tenth to ten times its value."""
    law = case.law
    gains = {name: value for name, (_, value) in law.part_gains.items()}
    corners = [case.under(law.with_factors(each)) for each in product((0.1, 10.0), repeat=len(gains))]
    unit = law.with_factors([1.0 / value for value in gains.values()])
    blocks = zip(gains, unit.signals, _blocks(unit), strict=True)
    return {
        **_of_any_law(case, corners, unit),
        "names": list(gains),
        "labels": {name: "" if name in law.signals else "factor" for name in gains},
        "plane": list(gains)[:2] if len(gains) > 1 else None,
        "rows": [[place, 0] for place in range(1, 1 + len(gains))],
        "of_law": {
            "head": law_toml(law).partition("\n\n")[0],
            "parts": [
                {"name": name, "signal": of, "num": each.num, "den": each.den} for name, of, each in blocks
            ],
        },
        "units": dict.fromkeys(gains, "1"),
        # without 0, at which poles may join those at s = 0
        "axes": {name: range_around(value) for name, value in gains.items()},
        "start": gains,
        "reference": gains,
        **dict.fromkeys(
            ("continuous", "sampled_map", "good", "recommended", "slew", "lyapunov", "default", "outputs")
        ),
        "sampled_loop": _in_page(case, unit),
    }


def range_around(value: float) -> LiveNumbers:
    """Return the range of a gain around its value."""
    low, high = sorted((value / 10, value * 10))
    return _range(Axis(low, high, abs(value) / 10))


def _blocks(law: Law) -> list[Rational]:
    return [cast(Rational, part.block) for part in law.parts]


def _of_any_law(case: Case, corners: Sequence[Case], unit: Law | None = None) -> LiveNumbers:
    """Return what every page has: `case` is its reference, `corners` are of its gains, `unit` the law with gains of 1.

    Gains at the hub have no `unit`.
    """
    arm = case.arm
    period = case.chain.sampling.period
    samples, is_quiet = _samples(case, corners, unit)
    return {
        **sensor_numbers(arm),
        "period": period,
        "longest_delay": LONGEST_DELAY_SAMPLES * period,
        "limits": GRADE_LIMITS,
        **samples,
        **theorem_numbers(arm, is_quiet, unit is None),
        "graded": graded_loop(case, corners, unit) if arm.has_elastic_link else None,
        "margin_names": dict(zip(("up", "down", "phase", "delay", "peak"), GRADED.values(), strict=True)),
    }


# ------------------------------------------------------------ in continuous time


def _samples(case: Case, corners: Sequence[Case], unit: Law | None) -> tuple[LiveNumbers, bool]:
    """Return samples of the loop's parts in the band of these cases, and whether small gain holds beyond it.

    They are those of hub angle and gauge, or of each part of `unit`, whose poles and zeros are steep places too.
    """
    arm = case.arm
    band, is_quiet = band_of_family(map(ContinuousLoop, corners))
    samples = loop_panels(arm, band, None if unit is None else ContinuousLoop(case.under(unit)))
    own: list[float] = []
    for block in _blocks(unit) if unit else ():
        own += [abs(s) for s in (*block.poles, *block.zeros) if s]
    return {
        # by panel, part and point
        "samples": pack_doubles(samples.values.transpose(1, 0, 2)),
        "low": samples.low.tolist(),
        "high": samples.high.tolist(),
        "order": samples.order,
        "error": float(f"{samples.error:.0e}"),
        "places": np.unique(np.r_[steep_places(arm, 1.05 * samples.band), own]).tolist(),
        "band": samples.band,
        "reference_count": stability(case, samples.band).unstable_roots,
    }, is_quiet


def graded_loop(case: Case, corners: Sequence[Case], unit: Law | None) -> LiveNumbers:
    """Return the loop with whose damping an undamped arm is graded, and the words for that: `tfarm.assessment.card`."""
    damped, words = graded_arm(case.arm)
    samples, _ = _samples(case.on(damped), [each.on(damped) for each in corners], unit)
    return samples | {
        "kind": "band",
        "sampled_loop": _in_page(case.on(damped), unit),
        "words": words,
    }


def theorem_numbers(arm: Arm, is_quiet: bool, are_gains: bool) -> LiveNumbers:
    """Return theorems on gains at the hub, bounds beyond the frequency range, and the static balance."""
    is_reactive = are_gains and arm.is_reactive
    if is_reactive:
        kind = "reactive"
    elif is_quiet:
        kind = "quiet"
    else:
        kind = "band"
    beyond = (
        "|L| < 0.5 beyond the frequency range at all gains of this page: no unstable pole there (small gain)"
    )
    if are_gains and kind != "quiet":
        if arm.is_reactive and not arm.reads_hub_moment:
            beyond = "C = 0: no mode of the frequency range is driven; not determined beyond"
        else:
            beyond = (
                "C = 0: every mode beyond the frequency range is damped (Lyapunov), "
                "with a decay rate that tends to 0"
            )
    return {
        "kind": kind,
        "beyond": beyond,
        "moments": _stable_moments(arm) if is_reactive else [None, None],
        "by_sign": are_gains and arm.has_elastic_link and arm.reads_hub_moment and not arm.input_lags,
        "hub_alone": arm.loses_at_hub_alone,
        "whole": arm.input_per_torque,
        "rate_loss": arm.rate_loss,
        "inertia": arm.turned_inertia,
        "gauged": arm.gauged_inertia,
    }


def _stable_moments(arm: Arm) -> list[float | None]:
    """Return between which K2 no mode is driven by K1 > 0 without damping; None where no limit was found."""
    found = windows_of(stability(Case(arm, default_gains(arm).with_number(MOMENT_GAIN, 0.0))), [MOMENT_GAIN])[
        MOMENT_GAIN
    ]
    return [end if found.end(end) == "edge" else None for end in found.around or (-math.inf, math.inf)]


def _areas(plane: Plane | GainMap | GoodRegion) -> list[dict[str, float]]:
    """Return rows across, low, high of the parts of the stable region, each part with its number."""
    rows = []
    for number, piece in enumerate(pieces(plane.x, plane.stable_intervals)):
        for point in piece.points:
            x, low, high = kept_digits(point, 7)
            rows.append({"part": number, PLANE[0]: x, "low": low, "high": high})
    return rows


# ------------------------------------------------------------ at the samples


def _sampled_map(plane: GainMap) -> LiveNumbers:
    """Return the sampled region, its columns with exact ends, and what it holds for."""
    loop = plane.loop
    modes = "" if loop.plant.arm.damping else f", of the first {plane.modes_used} modes"
    return {
        "areas": _areas(plane),
        PLANE[0]: plane.x.tolist(),
        "intervals": plane.stable_intervals,
        "words": f"every {1e3 * loop.chain.sampling.period:g} ms{modes}",
    }


def sampled_numbers(loop: Sampled) -> LiveNumbers:
    """Return the sampled loop with the modes that it has; `states`: poles at z = 1 that the hub's own motion has.

    These are 2, 1 where it is damped or driven through a motor, or 0.
    """
    plant = sensed_plant(loop.plant.arm, loop.chain, FED_BACK, loop.plant.count).together
    folded = PulseTransfer(plant, loop.chain.sampling).without_fast_poles().plant
    return {
        **sampling_numbers(loop.chain),
        **_plant(folded),
        "states": _orders(plant)[0],
        "modes": plant.count,
    }


def _in_page(case: Case, unit: Law | None) -> LiveNumbers:
    """Return the sampled loop of a case, of gains at the hub or of the parts of `unit`."""
    loop = sampled_verdict(case).full
    if unit is None:
        return sampled_numbers(loop)
    return law_in_page(loop, list(unit.part_gains))


def law_in_page(loop: Sampled, names: Sequence[str]) -> LiveNumbers:
    """Return the sampled loop of a law: `columns` are its parts by name, in delta = z - 1; `ones` poles at z = 1."""
    plant = loop.pulse.plant
    in_z = loop.in_z
    orders = _orders(plant)
    return {
        **sampling_numbers(loop.chain),
        **_plant(plant),
        "ones": max(0, *(orders[row] - int((zeros == 0).sum()) for _, row, _, zeros in in_z.columns)),
        "modes": loop.plant.count,
        "columns": [
            {
                "name": names[n],
                "row": row,
                "g": g,
                "zeros": _pairs(zeros),
                "poles": _pairs(in_z.part_poles[n]),
            }
            for n, row, g, zeros in in_z.columns
        ],
    }


def sampling_numbers(chain: Chain) -> LiveNumbers:
    """Return the period [s], the delay in samples, and how the hub rate is had: `smoothing` is its filter's pole."""
    T = chain.sampling.period
    of = chain.converters
    return {
        "period": T,
        "delay": chain.sampling.whole_delay,
        "fraction": chain.sampling.fraction,
        "smoothing": math.exp(-of.rate_filter * T) if of.hub_rate == "difference" else None,
    }


def _plant(plant: Plant) -> LiveNumbers:
    """Return poles (m,) [1/s] but s = 0, the outputs' residues (outputs, m), and their shares of 1/s^2, 1/s and 1."""
    return {
        "eigenvalues": pack_doubles(plant.poles.astype(complex)),
        "residues": pack_doubles(plant.residues.astype(complex)),
        "rigid": plant.rigid.tolist(),
        "static": plant.static.tolist(),
    }


def _orders(plant: Plant) -> list[int]:
    """Return the order of the pole of each output at s = 0."""
    twice, once = (plant.rigid != 0).T
    return np.where(twice, 2, once).tolist()


def _pairs(values: Complex) -> list[list[float]]:
    """Return real and imaginary parts."""
    return [[float(each.real), float(each.imag)] for each in values]


# ------------------------------------------------------------ in time


def slew_numbers(case: Case) -> LiveNumbers | None:
    """Return the slew of the chain for three times as long as it takes, with the modes that it takes under the gains.

    None where there is no such slew, and of one of more than 5000 samples, 160 kB of references: it is left to
    `tfarm simulate`.
    """
    arm = case.arm
    chain = case.chain
    try:
        task = scenario("slew", arm, chain, TRIAL_SLEWS * chain.slew.rise_time, case.law)
        if task.t.size > 5000:
            return None
        ideal = case.through(ideal_chain(chain))
        count = enough_modes(lambda number: Simulator(ideal, task, count=number).run()).modes
        plant = _upper(Simulator(case, task, count=count).plant)
        signals = task.feedforward, task.hub_angle, task.hub_rate, task.moment_reference, task.rigid_moment
        return {
            **sampling_numbers(chain),
            **_plant(plant),
            **_shapes(arm, plant),
            "ideal": pack_doubles(np.stack(signals, axis=1)),
            "converters": [
                [x if math.isfinite(x) else None for x in row] for row in quantisers(chain).tolist()
            ],
            "single": chain.converters.is_single,
            "bound": largest_moment(arm),
            "rise": task.busy_until,
            "drive": arm.input.split("_")[1],
            "unit": arm.input_unit,
            "reach": arm.reach,
            "length": arm.length,
            "travel": chain.slew.travel_of(arm.reach),
            "modes": count,
            "mode": plant.mode.tolist(),
        }
    except TfarmError:
        return None


def _upper(plant: Plant) -> Plant:
    """Return the same with the poles of Im p >= 0 alone, those with a conjugate counted twice."""
    upper = plant.poles.imag >= 0
    residues = plant.residues * np.where(plant.poles.imag > 0, 2.0, 1.0)
    return replace(plant, poles=plant.poles[upper], residues=residues[:, upper], mode=plant.mode[upper])


def _shapes(arm: Arm, plant: Plant) -> LiveNumbers:
    """Return displacement along the arm over that of the tip, (stations, m) at each pole, that of the clamp first.

    The ratio of residues is that of the numerators, whatever drives the hub.
    """
    # off poles of both outputs; the ratio is off by as much
    s = plant.poles.astype(complex) * (1 + 1e-9)
    x = np.linspace(0.0, arm.length, 25)
    shapes = [
        np.divide(*transfer(arm, ["displacement", "tip_displacement"], x=each)(s)) for each in x.tolist()
    ]
    return {"x": x.tolist(), "offset": arm.reach - arm.length, "shapes": pack_doubles(shapes)}


# ------------------------------------------------------------ sensors along the arm


def sensor_numbers(arm: Arm) -> LiveNumbers:
    """Return participation and zeros at every position, by the kind of sensor, without ends that sense nothing.

    None where they cannot be had, and then `no_sensor` is the reason.
    """
    try:
        return {"sensor": {kind: _positions(arm, kind) for kind in get_args(Sensor)}}
    except TfarmError as error:
        return {"sensor": None, "no_sensor": str(error)}


def _positions(arm: Arm, kind: Sensor, modes: int = 6) -> LiveNumbers:
    """Return the positions of one kind of sensor in six digits, far more than a screen has."""
    x = sensed_places(arm, kind, np.linspace(0.0, arm.length, 17), modes)
    found = positions(arm, kind, x, modes)
    return {
        "x": kept_digits(found.x, 6),
        "band": found.band,
        "modes": kept_digits(found.natural_frequency, 6),
        "participation": [kept_digits(column, 6) for column in found.participation.T],
        "zeros": [[kept_digits(zero, 6) for zero in _pairs(each)] for each in found.known_zeros],
    }
