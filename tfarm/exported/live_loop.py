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

from tfarm.arm import (
    ANGLE_GAIN,
    FED_BACK,
    GAINS,
    MOMENT_GAIN,
    PLANE,
    AnyLaw,
    Arm,
    HubFeedback,
    Law,
    as_law,
    unit_of,
)
from tfarm.arm.blocks import Rational
from tfarm.arm.stages import Consumer
from tfarm.arm.writing import law_toml
from tfarm.arrays import Complex
from tfarm.assessment.card import (
    GAIN_LIMITS,
    GRADED,
    PEAK_LIMITS,
    PERIOD_LIMITS,
    PHASE_LIMITS,
    UNDAMPED,
    reference_damping,
)
from tfarm.assessment.stability_map import BEYOND_PICTURE, sampled_region
from tfarm.case import Case
from tfarm.crossing import pieces
from tfarm.digits import kept_digits
from tfarm.dsp import Chain, PulseTransfer, Simulator, scenario, traces
from tfarm.dsp.plant import Plant, sensed_plant
from tfarm.dsp.results import enough_modes, ideal_chain
from tfarm.dsp.simulate import FOLDED_UP, quantisers
from tfarm.errors import TfarmError
from tfarm.loop.circle_crossings import GainMap
from tfarm.loop.continuous import ContinuousLoop, steep_places
from tfarm.loop.edges import LONGEST_DELAY_SAMPLES
from tfarm.loop.panels import Sensor, loop_panels, positions, sensed_places
from tfarm.loop.plane import Plane, gain_map, moment_axis, rate_axis, rate_columns
from tfarm.loop.sampled import Sampled
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import band_of_family, stability
from tfarm.loop.windows import windows_of
from tfarm.response import transfer
from tfarm.spectrum.gains import angle_unit, default_gains

CONSUMER = Consumer(
    "live page",
    acts=(
        "reference", "anti-alias filter", "encoder", "hub rate", "amplifier steps", "amplifier range", "law",
        "arithmetic", "DAC steps", "DAC range", "torque limit", "hold", "delay", "hub damping", "plant",
    ),
    none=("volts",),
)  # fmt: skip
LIVE_COLUMNS = 90  # values of the gain across at which the continuous region is cut
LiveNumbers = dict[str, Any]


def packed(values: Any) -> str:
    """Return the bytes of doubles; of complex numbers real and imaginary parts in turn."""
    array = np.ascontiguousarray(values)
    doubles = array.view(float) if np.iscomplexobj(array) else array.astype(float)
    return base64.b64encode(doubles.astype("<f8").tobytes()).decode("ascii")


# ------------------------------------------------------------ of gains at the hub, and of a law of rational parts


def live_data(arm: Arm, chain: Chain, law: HubFeedback | None = None) -> LiveNumbers:
    """Return all numbers of a loop of gains at the hub.  `law` is where the page begins, else the default gains.

    Raises what `gain_map` and `loop_panels` raise.
    """
    x = rate_axis(arm)
    y = moment_axis(arm, x)
    axes: dict[str, LiveNumbers] = {
        name: {"low": axis.low, "high": axis.high, "linear": None if axis.is_linear else axis.linear}
        for name, axis in zip(PLANE, (x, y), strict=True)
    }
    stiffest = 0.1 * angle_unit(arm)
    axes[ANGLE_GAIN] = {"low": 0.0, "high": stiffest, "linear": 1e-4 * stiffest}
    ends = product(*((of["low"], of["high"]) for of in axes.values()))
    corners = [as_law(HubFeedback(**dict(zip(axes, each, strict=True)))) for each in ends]
    reference = default_gains(arm)
    start = law or reference
    across = np.unique(np.r_[rate_columns(arm, x, LIVE_COLUMNS), x.high])
    continuous = gain_map(arm, across, np.array([y.low - BEYOND_PICTURE, y.high + BEYOND_PICTURE]))
    sampled = sampled_region(arm, x, y, chain)
    return {
        **_of_any_law(arm, chain, corners, reference),
        "names": ["K1", "K2", "Kp"],
        "labels": {"K1": "hub rate", "K2": "root moment", "Kp": "hub angle"},
        "plane": PLANE,
        # of each gain a part of the samples, and the power of s on it
        "rows": [[1, 1], [2, 2], [1, 0]],
        "of_law": None,
        "units": {gain.name: unit_of(gain.name, arm) for gain in GAINS},
        "axes": axes,
        "start": {gain.name: start[gain.name] for gain in GAINS},
        "reference": {name: reference[name] for name in PLANE},
        "continuous": _areas(continuous),
        "sampled_map": None if sampled is None else _sampled_map(sampled),
        "sampled_loop": None if sampled is None else sampled_numbers(sampled.loop),
        "slew": slew_numbers(arm, chain, start),
        "lyapunov": arm.is_uniform,
        "default": {gain.name: reference[gain.name] for gain in GAINS},
        "outputs": {gain.name: gain.output for gain in GAINS},
    }


def law_data(arm: Arm, chain: Chain, law: Law, reach: float = 10.0) -> LiveNumbers:
    """Return the same for a law of rational parts: the gain of each part is a number of the page.

    `reach` is the range of each gain, up and down.  The slew is of gains at the hub alone.  Raises ParameterError for
    other laws.
    """
    gains = {name: value for name, (_, value) in law.part_gains.items()}
    corners = [law.weighted(each) for each in product((1 / reach, reach), repeat=len(gains))]
    unit = law.weighted([1.0 / value for value in gains.values()])
    blocks = zip(gains, unit.signals, _blocks(unit), strict=True)
    return {
        **_of_any_law(arm, chain, corners, law, unit),
        "names": list(gains),
        "labels": {name: "" if name in law.signals else "factor" for name in gains},
        "plane": list(gains)[:2] if len(gains) > 1 else None,
        "rows": [[place, 0] for place in range(1, 1 + len(gains))],
        "of_law": {
            "head": law_toml(law).partition("\n\n")[0],
            "parts": [{"name": name, "signal": of, "num": each.num, "den": each.den} for name, of, each in blocks],
        },
        "units": dict.fromkeys(gains, "1"),
        # without 0, at which poles may join those at s = 0
        "axes": {name: _slider(value, reach) for name, value in gains.items()},
        "start": gains,
        "reference": gains,
        **dict.fromkeys(("continuous", "sampled_map", "slew", "lyapunov", "default", "outputs")),
        "sampled_loop": law_in_page(sampled_verdict(Case(arm, law, chain)).full, list(gains)),
    }


def _slider(value: float, reach: float) -> LiveNumbers:
    low, high = sorted((value / reach, value * reach))
    return {"low": low, "high": high, "linear": abs(value) / reach}


def _blocks(law: Law) -> list[Rational]:
    return [cast(Rational, part.block) for part in law.parts]


def _of_any_law(arm: Arm, chain: Chain, corners: Sequence[Law], law: AnyLaw, unit: Law | None = None) -> LiveNumbers:
    """Return what every page has: `corners` of its gains, `law` its reference, `unit` one with gains of 1.

    Gains at the hub have no `unit`.
    """
    samples, is_quiet = _samples(arm, corners, unit)
    return {
        **sensor_numbers(arm),
        "period": chain.sampling.period,
        "longest_delay": LONGEST_DELAY_SAMPLES * chain.sampling.period,
        "limits": {"gain": GAIN_LIMITS, "phase": PHASE_LIMITS, "periods": PERIOD_LIMITS, "peak": PEAK_LIMITS},
        **samples,
        **_known(arm, is_quiet, unit is None),
        "reference_count": stability(Case(arm, law), samples["band"]).unstable_roots,
        "graded": _graded(arm, corners, chain, law, unit) if arm.has_elastic_link else None,
        "margin_names": dict(zip(("up", "down", "phase", "delay", "peak"), GRADED.values(), strict=True)),
    }


# ------------------------------------------------------------ in continuous time


def _samples(arm: Arm, corners: Sequence[Law], law: Law | None = None) -> tuple[LiveNumbers, bool]:
    """Return samples of the loop's parts in the band of these laws, and whether small gain holds beyond it.

    They are those of hub angle and gauge, or of each part of `law`, whose poles and zeros are steep places too.
    """
    band, is_quiet = band_of_family(ContinuousLoop(Case(arm, each)) for each in corners)
    samples = loop_panels(arm, band, None if law is None else ContinuousLoop(Case(arm, law)))
    blocks = [] if law is None else _blocks(law)
    own = [abs(s) for block in blocks for s in (*block.poles, *block.zeros) if s]
    return {
        # by panel, part and point
        "samples": packed(samples.values.transpose(1, 0, 2)),
        "low": samples.low.tolist(),
        "high": samples.high.tolist(),
        "order": samples.order,
        "error": float(f"{samples.error:.0e}"),
        "places": np.unique(np.r_[steep_places(arm, 1.05 * samples.band), own]).tolist(),
        "band": samples.band,
    }, is_quiet


def _graded(arm: Arm, corners: Sequence[Law], chain: Chain, law: AnyLaw, unit: Law | None) -> LiveNumbers:
    """Return the loop with whose damping an undamped arm is graded, and the words for that: `tfarm.assessment.card`."""
    C = reference_damping(arm)
    damped = arm.having(damping=C)
    sampled = sampled_verdict(Case(damped, law, chain)).full
    samples, _ = _samples(damped, corners, unit)
    return samples | {
        "kind": "band",
        "reference_count": stability(Case(damped, law), samples["band"]).unstable_roots,
        "sampled_loop": sampled_numbers(sampled) if unit is None else law_in_page(sampled, list(unit.part_gains)),
        "words": UNDAMPED.format(C),
    }


def _known(arm: Arm, is_quiet: bool, are_gains: bool) -> LiveNumbers:
    """Return theorems on gains at the hub, bounds beyond the frequency range, and the static balance."""
    is_reactive = are_gains and arm.is_reactive
    kind = "reactive" if is_reactive else "quiet" if is_quiet else "band"
    beyond = "|L| < 0.5 beyond the frequency range at all gains of this page: no unstable pole there (small gain)"
    if are_gains and kind != "quiet":
        beyond = (
            "C = 0: no mode of the frequency range is driven; not determined beyond"
            if arm.is_reactive and not arm.reads_hub_moment
            else "C = 0: every mode beyond the frequency range is damped (Lyapunov), with a decay rate that tends to 0"
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
    found = windows_of(stability(Case(arm, default_gains(arm).having(MOMENT_GAIN, 0.0))), [MOMENT_GAIN])[MOMENT_GAIN]
    return [end if found.end(end) == "edge" else None for end in found.around or (-math.inf, math.inf)]


def _areas(plane: Plane | GainMap) -> list[dict[str, float]]:
    """Return rows across, low, high of the parts of the stable region, each part with its number."""
    return [
        {"part": number, PLANE[0]: x, "low": low, "high": high}
        for number, piece in enumerate(pieces(plane.x, plane.stable_intervals))
        for x, low, high in (kept_digits(point, 7) for point in piece.points)
    ]


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
    folded = PulseTransfer(plant, loop.chain.sampling).folded().plant
    return {**_sampling(loop.chain), **_plant(folded), "states": _orders(plant)[0], "modes": plant.count}


def law_in_page(loop: Sampled, names: Sequence[str]) -> LiveNumbers:
    """Return the sampled loop of a law: `columns` are its parts by name, in delta = z - 1; `ones` poles at z = 1."""
    plant = loop.pulse.plant
    in_z = loop.in_z
    orders = _orders(plant)
    return {
        **_sampling(loop.chain),
        **_plant(plant),
        "ones": max(0, *(orders[row] - int((zeros == 0).sum()) for _, row, _, zeros in in_z.columns)),
        "modes": loop.plant.count,
        "columns": [
            {"name": names[n], "row": row, "g": g, "zeros": _pairs(zeros), "poles": _pairs(in_z.part_poles[n])}
            for n, row, g, zeros in in_z.columns
        ],
    }


def _sampling(chain: Chain) -> LiveNumbers:
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
        "eigenvalues": packed(plant.poles.astype(complex)),
        "residues": packed(plant.residues.astype(complex)),
        "rigid": plant.rigid.tolist(),
        "static": plant.static.tolist(),
    }


def _orders(plant: Plant) -> list[int]:
    """Return the order of the pole of each output at s = 0."""
    return [2 if twice else 1 if once else 0 for twice, once in plant.rigid.tolist()]


def _pairs(values: Complex) -> list[list[float]]:
    """Return real and imaginary parts."""
    return [[float(each.real), float(each.imag)] for each in values]


# ------------------------------------------------------------ in time


def slew_numbers(arm: Arm, chain: Chain, law: HubFeedback, most: int = 5000) -> LiveNumbers | None:
    """Return the slew of the chain for three times as long as it takes, with the modes that it takes under `law`.

    None where there is no such slew, and of one of more than `most` samples, 160 kB of references: it is left to
    `tfarm simulate`.
    """
    try:
        task = scenario("slew", arm, chain, traces.RECORD_LENGTH * chain.slew.rise_time)
        if task.t.size > most:
            return None
        case = Case(arm, law, chain)
        ideal_case = case.through(ideal_chain(chain))
        count = enough_modes(lambda number: Simulator(ideal_case, task, count=number).run()).modes
        plant = _upper(Simulator(case, task, count=count).plant)
        ideal = np.c_[task.feedforward, task.hub_angle, task.hub_rate, task.moment_reference, task.rigid_moment]
        return {
            **_sampling(chain),
            **_plant(plant),
            **_shapes(arm, plant),
            "ideal": packed(ideal),
            "converters": [[x if math.isfinite(x) else None for x in row] for row in quantisers(chain).tolist()],
            "single": chain.converters.is_single,
            "bound": FOLDED_UP * arm.bending_scale,
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
    shapes = [np.divide(*transfer(arm, ["displacement", "tip_displacement"], x=each)(s)) for each in x.tolist()]
    return {"x": x.tolist(), "offset": arm.reach - arm.length, "shapes": packed(shapes)}


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
