"""The live page of an arm's loop: what it carries as numbers, and the script that all such pages share."""

import base64
import hashlib
import json
import math
import re
import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from tempfile import mkdtemp
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
    arm_and_law,
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
from tfarm.crossing import pieces
from tfarm.digits import kept_digits, scientific
from tfarm.dsp import Chain, PulseTransfer, Simulator, scenario, traces
from tfarm.dsp.plant import Plant, sensed_plant
from tfarm.dsp.results import enough_modes, ideal_chain
from tfarm.dsp.simulate import FOLDED_UP, quantisers
from tfarm.dsp.stages import admit
from tfarm.errors import TfarmError, require
from tfarm.loop.circle_crossings import GainMap
from tfarm.loop.edges import LONGEST_DELAY_SAMPLES
from tfarm.loop.loop import Loop, steep_places
from tfarm.loop.panels import PANEL_SAMPLES, Sensor, loop_panels, positions, sensed_places
from tfarm.loop.plane import gain_map, moment_axis, rate_axis, rate_columns
from tfarm.loop.sampled import Sampled
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import band_of_family, stability
from tfarm.loop.windows import windows_of
from tfarm.plots.regions import BEYOND_PICTURE, sampled_region
from tfarm.plots.style import GOOD, LOW, MARGINAL, POOR, STABLE, UNSTABLE
from tfarm.report.page import TEMPLATES, Case, GivenLaw, argument, has_loop, is_preset, render, sign_words, write_text
from tfarm.response import transfer
from tfarm.spectrum.table import angle_unit, default_gains

CONSUMER = Consumer(
    "live page",
    acts=(
        "reference", "anti-alias filter", "encoder", "hub rate", "amplifier steps", "amplifier range", "law",
        "arithmetic", "DAC steps", "DAC range", "torque limit", "hold", "delay", "hub damping", "plant",
    ),
    none=("volts",),
)  # fmt: skip
MOST_LIVE_SAMPLES = 5000  # of a slew: 160 kB of references; a longer one is left to `tfarm simulate`
LIVE_COLUMNS = 90  # values of the gain across at which the continuous region is cut
SENSED_MODES = 6  # whose frequencies and zeros the chart of sensors has
SENSOR_DIGITS = 6  # of the numbers of that chart: far more than a screen has
FRAME = 780  # pixels: height of the page in a notebook
LIVE_PAGE, ASSETS, SCRIPT = "live.html", "assets", "live.js"
SCRIPTS = "script-src 'self'"  # in the policy of a page, from the folder of its script
BEYOND = "|L| < 0.5 beyond the frequency range at all gains of this page: no unstable pole there (small gain)"
AT_HUB = {  # `rows`: of each gain a part of the samples, and the power of s on it
    "names": ["K1", "K2", "Kp"],
    "labels": {"K1": "hub rate", "K2": "root moment", "Kp": "hub angle"},
    "plane": PLANE,
    "rows": [[1, 1], [2, 2], [1, 0]],
    "of_law": None,
}
MOST_PARTS = 4  # of a law: |L| beyond the frequency range is bounded at all 2^n corners of their ranges
REACH = 10.0  # of a gain of a law, up and down: the range of its slider


def packed(values: Any) -> str:
    """The bytes of doubles; of complex numbers real and imaginary parts in turn."""
    array = np.ascontiguousarray(values)
    doubles = array.view(float) if np.iscomplexobj(array) else array.astype(float)
    return base64.b64encode(doubles.astype("<f8").tobytes()).decode("ascii")


def sampled_numbers(loop: Sampled) -> dict[str, Any]:
    """The sampled loop with the modes that it has; `states`: poles at z = 1 that the hub's own motion has.

    These are 2, 1 where it is damped or driven through a motor, or 0.
    """
    plant = sensed_plant(loop.plant.arm, loop.chain, FED_BACK, loop.plant.count).together
    return {
        **_sampling(loop.chain),
        **_plant(PulseTransfer(plant, loop.chain.sampling).folded().plant),
        "states": _orders(plant)[0],
        "modes": plant.count,
    }


def law_in_page(loop: Sampled, names: Sequence[str]) -> dict[str, Any]:
    """The sampled loop of a law: `columns` are its parts by name, in delta = z - 1; `ones` poles at z = 1."""
    plant, in_z = loop.pulse.plant, loop.in_z
    return {
        **_sampling(loop.chain),
        **_plant(plant),
        "ones": max(0, *(_orders(plant)[row] - int((zeros == 0).sum()) for _, row, _, zeros in in_z.columns)),
        "modes": loop.plant.count,
        "columns": [
            {"name": names[n], "row": row, "g": g, "zeros": _pairs(zeros), "poles": _pairs(in_z.part_poles[n])}
            for n, row, g, zeros in in_z.columns
        ],
    }


def _orders(plant: Plant) -> list[int]:
    """The order of the pole of each output at s = 0."""
    return [2 if twice else 1 if once else 0 for twice, once in plant.rigid.tolist()]


def _pairs(values: Complex) -> list[list[float]]:
    """Real and imaginary parts."""
    return [[float(each.real), float(each.imag)] for each in values]


def slew_numbers(arm: Arm, chain: Chain, law: HubFeedback) -> dict[str, Any] | None:
    """The slew of the chain for three times as long as it takes, with the modes that it takes under `law`, and the
    arm's shapes; None where there is no such slew."""
    try:
        task = scenario("slew", arm, chain, traces.RECORD_LENGTH * chain.slew.rise_time)
        if task.t.size > MOST_LIVE_SAMPLES:
            return None
        count = enough_modes(lambda number: Simulator(arm, ideal_chain(chain), task, count=number).linear(law)).modes
        plant = _upper(Simulator(arm, chain, task, count=count).plant)
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


def _sampling(chain: Chain) -> dict[str, Any]:
    """The period [s], the delay in samples, and how the hub rate is had: `smoothing` is the rate filter's pole."""
    T, of = chain.sampling.period, chain.converters
    return {
        "period": T,
        "delay": chain.sampling.whole_delay,
        "fraction": chain.sampling.fraction,
        "smoothing": math.exp(-of.rate_filter * T) if of.hub_rate == "difference" else None,
    }


def _plant(plant: Plant) -> dict[str, Any]:
    """Poles (m,) [1/s] but s = 0, the outputs' residues (outputs, m), and what they have of 1/s^2, 1/s and 1."""
    return {
        "eigenvalues": packed(plant.poles.astype(complex)),
        "residues": packed(plant.residues.astype(complex)),
        "rigid": plant.rigid.tolist(),
        "static": plant.static.tolist(),
    }


def _upper(plant: Plant) -> Plant:
    """The same with the poles whose imaginary part is not negative alone, those with a conjugate counted twice."""
    upper = plant.poles.imag >= 0
    residues = plant.residues * np.where(plant.poles.imag > 0, 2.0, 1.0)
    return replace(plant, poles=plant.poles[upper], residues=residues[:, upper], mode=plant.mode[upper])


def _shapes(arm: Arm, plant: Plant) -> dict[str, Any]:
    """Displacement along the arm over that of the tip, (stations, m) at each pole, that of the clamp first.

    The ratio of residues is that of the numerators, whatever drives the hub.
    """
    s = plant.poles.astype(complex) * (1 + 1e-9)  # off poles of both outputs; the ratio is off by as much
    x = np.linspace(0.0, arm.length, 25)
    shapes = [np.divide(*transfer(arm, ["displacement", "tip_displacement"], x=each)(s)) for each in x.tolist()]
    return {"x": x.tolist(), "offset": arm.reach - arm.length, "shapes": packed(shapes)}


def live_data(arm: Arm, chain: Chain, law: HubFeedback | None = None) -> dict[str, Any]:
    """Everything as plain numbers and words.  `law` is where the page begins: the default gains if not given.

    Raises what `gain_map` and `loop_panels` raise.
    """
    x = rate_axis(arm)
    y, stiffest = moment_axis(arm, x), 0.1 * angle_unit(arm)
    axes: dict[str, dict[str, Any]] = {
        name: {"low": axis.low, "high": axis.high, "linear": None if axis.is_linear else axis.linear}
        for name, axis in zip(PLANE, (x, y), strict=True)
    } | {ANGLE_GAIN: {"low": 0.0, "high": stiffest, "linear": 1e-4 * stiffest}}
    reference = default_gains(arm)
    laws = [
        as_law(HubFeedback(**dict(zip(axes, each, strict=True))))
        for each in product(*((of["low"], of["high"]) for of in axes.values()))
    ]
    across = np.r_[rate_columns(arm, x, LIVE_COLUMNS), x.high]
    continuous = gain_map(arm, np.unique(across), np.array([y.low - BEYOND_PICTURE, y.high + BEYOND_PICTURE]))
    sampled = sampled_region(arm, x, y, chain)
    return {
        **_page(arm, chain, laws, reference),
        **AT_HUB,
        "units": {gain.name: unit_of(gain.name, arm) for gain in GAINS},
        "axes": axes,
        "start": {gain.name: (law or reference)[gain.name] for gain in GAINS},
        "reference": {name: reference[name] for name in PLANE},
        "continuous": _areas(continuous.axes[0], continuous.stable_intervals),
        "sampled_map": None if sampled is None else _sampled(sampled),
        "sampled_loop": None if sampled is None else sampled_numbers(sampled.loop),
        "slew": slew_numbers(arm, chain, law or reference),
        "lyapunov": arm.is_uniform,
        "default": {gain.name: reference[gain.name] for gain in GAINS},
        "outputs": {gain.name: gain.output for gain in GAINS},
    }


def law_data(arm: Arm, chain: Chain, law: Law) -> dict[str, Any]:
    """The same for a law of rational parts: the gain of each part is a number of the page.

    The slew is of gains at the hub alone.  Raises ParameterError for other laws.
    """
    gains = {name: value for name, (_, value) in law.part_gains.items()}
    corners = [law.weighted(each) for each in product((1 / REACH, REACH), repeat=len(law.parts))]
    unit = law.weighted([1.0 / value for value in gains.values()])
    blocks = zip(gains, unit.signals, (cast(Rational, part.block) for part in unit.parts), strict=True)
    tables = [{"name": name, "signal": signal, "num": of.num, "den": of.den} for name, signal, of in blocks]
    return {
        **_page(arm, chain, corners, law, unit),
        "names": list(gains),
        "labels": {name: "" if name in law.signals else "factor" for name in gains},
        "plane": list(gains)[:2] if len(gains) > 1 else None,
        "rows": [[place, 0] for place in range(1, 1 + len(gains))],
        "of_law": {"head": law_toml(law).partition("\n\n")[0], "parts": tables},
        "units": dict.fromkeys(gains, "1"),
        "axes": {  # without 0, at which poles may join those at s = 0
            name: {
                "low": min(value / REACH, value * REACH),
                "high": max(value / REACH, value * REACH),
                "linear": abs(value) / REACH,
            }
            for name, value in gains.items()
        },
        "start": gains,
        "reference": gains,
        **dict.fromkeys(("continuous", "sampled_map", "slew", "lyapunov", "default", "outputs")),
        "sampled_loop": law_in_page(sampled_verdict(arm, law, chain).full, list(gains)),
    }


def _page(arm: Arm, chain: Chain, laws: Sequence[Law], law: AnyLaw, unit: Law | None = None) -> dict[str, Any]:
    """What every live page has: `laws` are the corners of its gains, `law` its reference, `unit` one with gains of 1.

    Gains at the hub have no `unit`.
    """
    samples, is_quiet = _samples(arm, laws, unit)
    return {
        "name": arm.name,
        "command_name": argument(arm.name, is_preset(arm, chain)),
        **sensor_numbers(arm),
        "period": chain.sampling.period,
        "longest_delay": LONGEST_DELAY_SAMPLES * chain.sampling.period,
        "limits": {"gain": GAIN_LIMITS, "phase": PHASE_LIMITS, "periods": PERIOD_LIMITS, "peak": PEAK_LIMITS},
        **samples,
        **_known(arm, is_quiet, unit is None),
        "reference_count": stability(arm, law, samples["band"]).unstable_roots,
        "graded": _graded(arm, laws, chain, law, unit) if arm.has_elastic_link else None,
        "margin_names": dict(zip(("up", "down", "phase", "delay", "peak"), GRADED.values(), strict=True)),
    }


def _samples(arm: Arm, laws: Sequence[Law], law: Law | None = None) -> tuple[dict[str, Any], bool]:
    """Samples of the loop's parts in the band of these laws, and whether small gain holds beyond it.

    They are those of hub angle and gauge, or of each part of `law`, whose poles and zeros are steep places too.
    """
    band, is_quiet = band_of_family(Loop(arm, each) for each in laws)
    samples = loop_panels(arm, band, None if law is None else Loop(arm, law))
    blocks = () if law is None else (cast(Rational, part.block) for part in law.parts)
    own = [abs(s) for block in blocks for s in (*block.poles, *block.zeros) if s]
    return {
        "samples": packed(samples.values.transpose(1, 0, 2)),  # the bytes of doubles, by panel, part and point
        "low": samples.low.tolist(),
        "high": samples.high.tolist(),
        "order": samples.order,
        "error": float(f"{samples.error:.0e}"),
        "places": np.unique(np.r_[steep_places(arm, 1.05 * samples.band), own]).tolist(),
        "band": samples.band,
    }, is_quiet


def _graded(arm: Arm, laws: Sequence[Law], chain: Chain, law: AnyLaw, unit: Law | None = None) -> dict[str, Any]:
    """The loop with whose damping an undamped arm is graded, and the words for that: `tfarm.assessment.card`."""
    C = reference_damping(arm)
    damped = arm.having(damping=C)
    sampled = sampled_verdict(damped, law, chain).full
    samples, _ = _samples(damped, laws, unit)
    return samples | {
        "kind": "band",
        "reference_count": stability(damped, law, samples["band"]).unstable_roots,
        "sampled_loop": sampled_numbers(sampled) if unit is None else law_in_page(sampled, list(unit.part_gains)),
        "words": UNDAMPED.format(C),
    }


def _known(arm: Arm, is_quiet: bool, are_gains: bool) -> dict[str, Any]:
    """Theorems on gains at the hub, bounds beyond the frequency range, and the static balance: they decide verdicts."""
    is_reactive = are_gains and arm.is_reactive
    kind = "reactive" if is_reactive else "quiet" if is_quiet else "band"
    by_energy = (
        "C = 0: no mode of the frequency range is driven; not determined beyond"
        if arm.is_reactive and not arm.reads_hub_moment
        else "C = 0: every mode beyond the frequency range is damped (Lyapunov), with a decay rate that tends to 0"
    )
    return {
        "kind": kind,
        "beyond": by_energy if are_gains and kind != "quiet" else BEYOND,
        "moments": _stable_moments(arm) if is_reactive else [None, None],
        "by_sign": are_gains and arm.has_elastic_link and arm.reads_hub_moment and not arm.input_lags,
        "hub_alone": arm.loses_at_hub_alone,
        "whole": arm.input_per_torque,
        "rate_loss": arm.rate_loss,
        "inertia": arm.turned_inertia,
        "gauged": arm.gauged_inertia,
    }


def _stable_moments(arm: Arm) -> list[float | None]:
    """Between which K2 no mode is driven by K1 > 0 without damping; None where no limit was found."""
    found = windows_of(stability(arm, default_gains(arm).having(MOMENT_GAIN, 0.0)), [MOMENT_GAIN])[MOMENT_GAIN]
    return [end if found.end(end) == "edge" else None for end in found.around or (-math.inf, math.inf)]


def _areas(across: Any, intervals: Sequence[Sequence[tuple[float, float]]]) -> list[dict[str, float]]:
    """Rows across, low, high of the parts of a region, each part with its number."""
    return [
        {"part": number, PLANE[0]: x, "low": low, "high": high}
        for number, piece in enumerate(pieces(across, intervals))
        for x, low, high in (kept_digits(point, 7) for point in piece.points)
    ]


def _sampled(plane: GainMap) -> dict[str, Any]:
    """The sampled region, its columns with exact ends, and what it holds for."""
    loop = plane.loop
    modes = "" if loop.plant.arm.damping else f", of the first {plane.modes_used} modes"
    return {
        "areas": _areas(plane.axes[0], plane.stable_intervals),
        PLANE[0]: plane.axes[0].tolist(),
        "intervals": plane.stable_intervals,
        "words": f"every {1e3 * loop.chain.sampling.period:g} ms{modes}",
    }


# ------------------------------------------------------------ sensors along the arm


def sensor_numbers(arm: Arm) -> dict[str, Any]:
    """`sensor`: participation and zeros at every position, by the kind of sensor, without ends that sense nothing.

    None where they cannot be had, and then `no_sensor` is the reason.
    """
    try:
        return {"sensor": {kind: _positions(arm, kind) for kind in get_args(Sensor)}}
    except TfarmError as error:
        return {"sensor": None, "no_sensor": str(error)}


def _positions(arm: Arm, kind: Sensor) -> dict[str, Any]:
    """The positions of one kind of sensor in a few digits."""
    x = sensed_places(arm, kind, np.linspace(0.0, arm.length, 17), SENSED_MODES)
    found = positions(arm, kind, x, SENSED_MODES)
    return {
        "x": kept_digits(found.x, SENSOR_DIGITS),
        "band": found.band,
        "modes": kept_digits(found.natural_frequency, SENSOR_DIGITS),
        "participation": [kept_digits(column, SENSOR_DIGITS) for column in found.participation.T],
        "zeros": [[kept_digits(zero, SENSOR_DIGITS) for zero in _pairs(each)] for each in found.known_zeros],
    }


def is_live(case: Case) -> bool:
    """Whether the arm has such a page: its hub turns freely and has inertia."""
    return has_loop(case.arm) and case.arm.has_rigid_mode


def has_sliders(law: Law) -> bool:
    """Whether a page can have a slider for each part of a law: gains at the hub, or few rational parts in s."""
    return (
        not law.is_discrete
        and len(law.part_gains) == len(law.parts) <= MOST_PARTS
        and all(hasattr(part.block, "num") for part in law.parts)
    )


def save_live(case: Case, folder: Path) -> None:
    """live.html in the arm's folder.  It begins at the first law of its pages that has sliders, else at default gains.

    Where its numbers cannot be made the page has the reason.
    """
    arm, chain, laws = case.arm, case.chain, case.laws
    title, out = f"{arm.name}: live loop", folder / LIVE_PAGE
    law = next((law for each in laws if has_sliders(law := as_law(each.law))), as_law(default_gains(arm)))
    arm, _ = arm_and_law(arm, law)
    try:
        admit(CONSUMER, arm, chain)
        data = law_data(arm, chain, law) if law.gains is None else live_data(arm, chain, law.gains)
    except TfarmError as error:
        write_text(out, render("live_failed.html", title=title, why=str(error)))
        return
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False).replace("<", "\\u003c")
    colours = {"stable": STABLE, "marginal": MARGINAL, "unstable": UNSTABLE, "good": GOOD, "low": LOW, "poor": POOR}
    page = render("live.html", title=title, data=data, text=text, sign=sign_words(arm), columns=LIVE_COLUMNS,
                  samples=PANEL_SAMPLES * len(data["low"]), error=scientific(data["error"], 1),
                  assets=f"../{ASSETS}", script=SCRIPT, colours=colours)  # fmt: skip
    styles = " ".join(_source(each) for each in re.findall("<style>(.*?)</style>", page, re.DOTALL))
    policy = f"default-src 'none'; base-uri 'none'; form-action 'none'; style-src {styles}; {SCRIPTS}"
    first = '<meta charset="utf-8">'
    write_text(out, page.replace(first, f'{first}\n<meta http-equiv="Content-Security-Policy" content="{policy}">', 1))


def _source(text: str) -> str:
    """The source of a policy that allows an element with that text."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def write_assets(folder: Path) -> None:
    """The script of the live pages."""
    folder.mkdir(exist_ok=True)
    scripts = "".join(
        (TEMPLATES / f"live_{name}.js").read_text(encoding="utf-8")
        for name in ("loop", "sampled", "locus", "sets", "chart", "player", "sensor", "page")
    )
    write_text(folder / SCRIPT, f"(() => {{\n{scripts}}})();\n")


# ------------------------------------------------------------ from Python


@dataclass(frozen=True)
class LivePage:
    """A live page on this computer, its `path`; a notebook shows it."""

    path: Path

    def _repr_html_(self) -> str:
        """The page in a frame, with its script in it: a notebook serves no other file."""
        script = (self.path.parents[1] / ASSETS / SCRIPT).read_text(encoding="utf-8")
        page = self.path.read_text(encoding="utf-8").replace(SCRIPTS, f"script-src {_source(script)}", 1)
        page = page.replace(f'<script src="../{ASSETS}/{SCRIPT}">', f"<script>{script}")
        text = base64.b64encode(page.encode()).decode("ascii")  # no srcdoc: its links lead into the notebook's own page
        return (
            f'<iframe src="data:text/html;charset=utf-8;base64,{text}" title="live page" '
            f'style="width:100%;height:{FRAME}px;border:0"></iframe>'
        )


def explore(arm: Arm, law: AnyLaw | None = None, chain: Chain | None = None) -> LivePage:
    """Show the live page of an arm: in a notebook as the output of a cell, else in the browser.

    The page is a file of its own with its script, in a temporary folder that stays; nothing is served.

    Parameters
    ----------
    arm
        The arm.
    law
        The controller at which the page begins; the default gains unless given, and for one that has no sliders.
    chain
        Sampling; every 10 ms unless given.

    Returns
    -------
    LivePage
        With the `path` of the page.

    Raises
    ------
    ParameterError
        For what is no arm, and one whose hub does not turn freely or has no inertia.
    """
    case = Case(*admit(CONSUMER, arm, chain), () if law is None else (GivenLaw(law),))
    require(is_live(case), "arm", arm.name, "give one whose hub turns freely and has inertia")
    place = Path(mkdtemp(prefix="tfarm-"))
    (folder := place / "arm").mkdir()
    save_live(case, folder)
    write_assets(place / ASSETS)
    if "ipykernel" not in sys.modules:
        webbrowser.open((folder / LIVE_PAGE).as_uri())
    return LivePage(folder / LIVE_PAGE)
