"""Requirements on a loop: limits of the quantities of result card and step, by their names or short forms.

A requirement is a quantity, a sense and a limit, "phase_margin_deg >= 45" or "PM>=45".  Those of the card hold for the
sampled loop, and for the continuous-time one where the law is in s; those of the slew for the sampled loop, which runs.
`GOOD` are the limits of the grade *good*: 6 dB, 45 deg, Ms = 2 and one sampling period.

The violation of a requirement is its excess over the limit in units of that limit, so that 10 % too little phase counts
as much as 10 % too high a peak.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np

from tfarm.arm.reading import AnyFile, load_tables
from tfarm.arrays import Real
from tfarm.assessment.card import GRADE_LIMITS
from tfarm.assessment.signal_figures import LoopResponse, SignalFigures
from tfarm.errors import ParameterError, did_you_mean, name_file, require
from tfarm.schema import Quantity, quantities

Sense = Literal[">=", "<="]


class Measure(NamedTuple):
    """A quantity that a requirement limits: its title, unit, short forms, and the sense of a good value.

    `scale` is the size [unit] of a violation of 1 where the limit is 0; a percentage is read as a share.  Those of the
    slew, and `of_samples`, are of the sampled loop alone.
    """

    title: str
    unit: str
    short: tuple[str, ...]
    sense: Sense
    scale: float = 1.0
    of_slew: bool = False
    is_share: bool = False
    of_samples: bool = False

    def is_of(self, loop: int) -> bool:
        """Whether the models of the sampled (0) or the continuous-time loop (1) have it."""
        return not (self.of_slew or (self.of_samples and loop))


INPUT_UNIT = "of the arm"
NORM = "stacked_norm"


def _figures() -> dict[str, Measure]:
    """Return the figures of `tfarm step` in the slew that are small of a good law, by their names there."""
    of_figures = quantities(SignalFigures)
    units = {"hub": "rad", "tip": "m", "root_moment": "N m", "torque": INPUT_UNIT}
    names = ["peak", "settling_time", "at_rest_after", "residual_rms"]
    # of a signal with a reference
    followed = ["rise_time", "overshoot", "steady_state_error"]
    found = {}
    for part, unit in units.items():
        for name in names + followed * (part in ("hub", "tip")):
            of = of_figures[name]
            title = f"{of.label}, {quantities(LoopResponse)[part].label}"
            own_unit = unit if of.unit_of else of.unit
            key = f"{part}.{of.key}"
            found[key] = Measure(
                title, own_unit, (key,), "<=", 0.1, of_slew=True, is_share=name == "overshoot"
            )
    # which have short names
    return {key: each for key, each in found.items() if key not in ("tip.settling_time_s", "tip.overshoot")}


MEASURES = {
    "gain_margin_db": Measure("gain margin", "dB", ("GM", "gain_margin"), ">="),
    "gain_reduction_db": Measure("gain margin, downwards", "dB", ("gain_reduction",), ">="),
    "phase_margin_deg": Measure("phase margin", "deg", ("PM", "phase_margin"), ">="),
    "delay_margin_periods": Measure("delay margin", "periods", ("delay", "delay_margin"), ">="),
    "delay_margin_ms": Measure("delay margin", "ms", ("delay_margin_ms",), ">="),
    "peak_sensitivity": Measure("peak sensitivity", "", ("Ms", "sensitivity"), "<="),
    "disk_margin": Measure("disk margin", "", ("disk",), ">="),
    "least_damping": Measure("least damping ratio", "", ("damping",), ">=", 0.01, is_share=True),
    "time_constant_s": Measure("dominant time constant", "s", ("time-constant", "time_constant"), "<="),
    "bandwidth_rad_s": Measure("bandwidth", "rad/s", ("bandwidth",), ">="),
    "inverse_bandwidth_s": Measure("inverse of the bandwidth", "s", ("bandwidth^-1",), "<="),
    NORM: Measure("weighted H-infinity norm", "", ("norm",), "<=", of_samples=True),
    "settling_time_s": Measure(
        "settling time of the tip", "s", ("settling", "tip.settling_time_s"), "<=", 0.1, of_slew=True
    ),
    "overshoot": Measure(
        "overshoot of the tip", "", ("overshoot", "tip.overshoot"), "<=", 0.01, of_slew=True, is_share=True
    ),
    "residual_moment": Measure(
        "residual root moment", "N m", ("residual", "residual_moment_rms"), "<=", of_slew=True
    ),
    "residual_raw_moment_rms": Measure(
        "rms of the root moment after the slew", "N m", ("residual_raw",), "<=", of_slew=True
    ),
    "peak_input": Measure("largest input", INPUT_UNIT, ("torque", "input"), "<=", of_slew=True),
    **_figures(),
}
# largest limits: no loop has more, and models of up to twice the delay are searched, of at most 100
MOST = {
    "phase_margin_deg": 360.0,
    "delay_margin_periods": 40.0,
    "disk_margin": 2.0,
    "least_damping": 1.0,
}
NAMES = {word: key for key, each in MEASURES.items() for word in (key, *each.short)}


class Requirement(NamedTuple):
    """A limit of a quantity, in its unit; `sense` is the allowed side."""

    name: Annotated[str, Quantity("requirement", key="name", help="quantity of the card or of the slew")]
    sense: Annotated[Sense, Quantity(help="side of the limit that is allowed")]
    limit: Annotated[float, Quantity("limit", digits=4, help="in the unit of the quantity")]

    @property
    def measure(self) -> Measure:
        """The quantity."""
        return MEASURES[self.name]

    def violations(self, values: Real) -> Real:
        """Return the excess over the limit in units of the limit, negative where it is met, at least -1."""
        size = abs(self.limit) or self.measure.scale
        sign = 1.0 if self.sense == ">=" else -1.0
        excess = sign * (self.limit - np.asarray(values, dtype=float)) / size
        return np.maximum(np.nan_to_num(excess, nan=np.inf, posinf=np.inf, neginf=-1.0), -1.0)

    def violation(self, value: float) -> float:
        """Return the excess of one value."""
        return float(self.violations(np.array([value]))[0])

    def __str__(self) -> str:
        """As it is written in a file or after --require."""
        measure = self.measure
        value = f"{100 * self.limit:g}%" if measure.is_share else f"{self.limit:g}"
        return f"{measure.short[0]}{self.sense}{value}"


def limits_of_good(robustness: float = 1.0) -> tuple[Requirement, ...]:
    """Return the limits of the grade good, made laxer by a robustness below 1 and stricter by one above."""
    gain, phase, periods, peak = (GRADE_LIMITS[each][0] for each in ("gain", "phase", "periods", "peak"))
    return (
        Requirement("gain_margin_db", ">=", gain * robustness),
        Requirement("phase_margin_deg", ">=", phase * robustness),
        Requirement("delay_margin_periods", ">=", periods * robustness),
        Requirement("peak_sensitivity", "<=", 1.0 + (peak - 1.0) / robustness),
    )


GOOD = limits_of_good()


def measure_named(word: str, key: str) -> str:
    """Return the name of the quantity with this name or short form.  Raises ParameterError for an unknown one."""
    names = dict.fromkeys(re.sub(r"^\w+\.", "SIGNAL.", each.short[0]) for each in MEASURES.values())
    require(word in NAMES, key, word, did_you_mean(word, names))
    return NAMES[word]


# a list in a text, a limit for each name, or requirements
RequirementList = str | Mapping[str, float | str] | Sequence[Requirement]


def requirements_of(wanted: RequirementList, key: str = "require") -> tuple[Requirement, ...]:
    """Return the requirements of a text, a table, or a sequence of them; `key` names it in a refusal.

    A text is a list such as "GM>=6, PM>=45, damping>=2%"; "good" is the limits of the grade, but of quantities that
    have one of their own.  A table has a limit for each name, {"phase_margin": 45}; its sense is that of a good value.
    Raises ParameterError for an unknown name, a limit that no loop can have, the sense that is never good, two limits
    of a quantity, and none at all.
    """
    good: tuple[Requirement, ...] = ()
    if isinstance(wanted, str):
        texts = [each.strip() for each in wanted.split(",")]
        good = GOOD if "good" in texts else ()
        found = [_of_text(key, text) for text in texts if text != "good"]
    elif isinstance(wanted, Mapping):
        found = [
            _requirement(f"{key}.{name}", limit, measure_named(name, key), str(limit))
            for name, limit in wanted.items()
        ]
    else:
        found = list(wanted)
    names = [each.name for each in found]
    twice = [str(each) for each in found if names.count(each.name) > 1]
    require(not twice, key, ", ".join(twice), "two limits of one quantity: keep one")
    require(good or found, key, wanted, "give a limit, such as PM>=45, or good")
    return tuple({each.name: each for each in (*good, *found)}.values())


def load_requirements(name_or_path: AnyFile) -> tuple[Requirement, ...] | None:
    """Return the requirements of a file's table [requirements], a limit for each name; None where it has none.

    Raises ParameterError, naming the file, for what `requirements_of` refuses.
    """
    tables, file = load_tables(name_or_path)
    if "requirements" not in tables:
        return None
    table = tables["requirements"]
    with name_file(file):
        require(isinstance(table, dict), "requirements", table, "give a table, headed [requirements]")
        for key, value in table.items():
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            require(is_number, f"requirements.{key}", value, "a number, such as PM = 45 or damping = 0.02")
        return requirements_of(table, "requirements")


def _of_text(key: str, text: str) -> Requirement:
    """Return the requirement of one text."""
    parts = re.fullmatch(r"([\w.^-]+?)\s*(>=|<=)\s*([-+.\deE]+\s*%?)", text)
    form = "a quantity, >= or <=, and a number, such as PM>=45 or damping>=2%"
    if parts is None:
        raise ParameterError(key=key, value=text, remedy=form)
    word, sense, number = parts.groups()
    name = measure_named(word, key)
    measure = MEASURES[name]
    require(sense == measure.sense, key, text, f"{measure.title} is limited by {measure.sense}")
    return _requirement(key, text, name, number)


def _requirement(key: str, value: object, name: str, number: str) -> Requirement:
    """Return the requirement on a quantity with this limit, a number or a percentage; `value` is it as given."""
    measure = MEASURES[name]
    is_percentage = number.endswith("%")
    unit = measure.unit or "units of 1"
    require(measure.is_share or not is_percentage, key, value, f"{measure.title} is in {unit}: leave out %")
    try:
        limit = float(number.rstrip("% ")) / (100.0 if is_percentage else 1.0)
    except ValueError:
        limit = math.nan
    least = 1.0 if name == "peak_sensitivity" else 0.0
    most = MOST.get(name, math.inf)
    words = [f"at least {least:g}"]
    if name in MOST:
        words.append(f"at most {most:g}")
    if measure.is_share:
        words.append("such as 2% or 0.02")
    is_possible = least <= limit <= most and limit < math.inf
    require(is_possible, key, value, f"{measure.title} is limited by a number, {', '.join(words)}")
    return Requirement(name, measure.sense, limit)
