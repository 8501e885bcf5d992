"""Signal chain between the controller and the arm: sampling, converters, actuator, and the reference of a slew.

By default everything is ideal.  Frozen records, checked once, SI units.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal, get_args

from tfarm.arm import schema
from tfarm.arm.checks import (
    above_zero,
    check_annotated,
    not_negative,
    number,
    positive,
    positive_if_given,
    whole,
)
from tfarm.arm.reading import AnyFile, load_tables
from tfarm.arm.records import Arm
from tfarm.arm.schema import ArmTable, TomlTable, validate_table
from tfarm.arm.stages import are_linear
from tfarm.arm.writing import to_toml, toml_tables, toml_text
from tfarm.errors import ParameterError, must_be_known, name_file, require, unknown_key
from tfarm.schema import Quantity

MomentReading = Literal["vibration", "total"]
Profile = Literal["bang-bang", "s-curve", "polynomial", "file"]
ShaperName = Literal["none", "ZV", "ZVD", "EI"]
FeedforwardName = Literal["rigid", "inverse", "none"]
# samples: each whole one is a state more
MOST_DELAY = 100.0
# of a time: by so little before a sample it is at it, as its quotient with the period is rounded
TIME_ROUNDING = 1e-12
PERIOD = Quantity("sampling period", "s", help="time between two samples of the controller")


def _delay(key: str, value: object, meaning: str) -> float:
    """Return a number of samples from 0 to `MOST_DELAY`."""
    x = not_negative(key, value, meaning)
    require(x <= MOST_DELAY, key, x, meaning)
    return x


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Sampling `period` T [s] and `delay_samples` (any fraction) from a sample to the torque computed from it.

    `antialias_corner` [rad/s] is a first-order analog low-pass before the sampler, on the strain gauge and on an ideal
    (tachometer) hub rate; inf is none.  An encoder is digital and has none.
    """

    period: Annotated[
        float, PERIOD, positive, "a sampling period is a positive, finite time in seconds, 0.01 for instance"
    ] = 0.01
    delay_samples: Annotated[
        float,
        Quantity(
            "delay in samples",
            help="time from a sample to the torque computed from it, over the sampling period",
        ),
        _delay,
        "a computational delay is zero or positive, in samples, at most 100",
    ] = 0.0
    antialias_corner: Annotated[float, above_zero, "a corner is positive in rad/s, or inf for no filter"] = (
        math.inf
    )

    def __post_init__(self) -> None:
        check_annotated(self, "sampling")

    @property
    def whole_delay(self) -> int:
        """d: whole samples of delay."""
        return math.floor(self.delay_samples)

    @property
    def fraction(self) -> float:
        """f in [0, 1): the remainder of the delay, in samples."""
        return self.delay_samples - self.whole_delay

    @property
    def late(self) -> float:
        """f T [s]: time within a sample under the torque from before."""
        return self.fraction * self.period

    @property
    def remaining(self) -> float:
        """(1 - f) T [s]: time within a sample under the new torque."""
        return (1 - self.fraction) * self.period


@dataclass(frozen=True, slots=True, kw_only=True)
class Converters:
    """The sensors and the DAC; None is an ideal converter.

    `encoder_counts` a revolution of the hub; `hub_rate` "ideal" or "difference" (of the encoder, through a first-order
    filter of corner `rate_filter` [rad/s], inf for none); `moment_bits` over +-`moment_range` [N m] of the strain
    amplifier; `torque_bits` over +-`torque_range` of the DAC, in the unit of the arm's input (N m, V or A);
    `arithmetic` of the controller, "float64" or "float32" (as on a TMS320C31).  A signal beyond a range saturates; the
    simulation counts these samples.
    """

    encoder_counts: int | None = None
    hub_rate: Literal["ideal", "difference"] = "ideal"
    rate_filter: Annotated[
        float, above_zero, "the corner of the rate filter is positive in rad/s, or inf for a plain difference"
    ] = math.inf
    moment_bits: int | None = None
    moment_range: Annotated[
        float | None, positive_if_given, "the range +-R of a converter is a positive, finite number of N m"
    ] = None
    torque_bits: int | None = None
    torque_range: Annotated[
        float | None,
        positive_if_given,
        "the range +-R of a converter is a positive, finite number of N m (of V or A where that is the arm's input)",
    ] = None
    arithmetic: Literal["float64", "float32"] = "float64"

    def __post_init__(self) -> None:
        # of a converter: of one bit there are no steps, of more than 32 no part
        least_bits = 2
        most_bits = 32
        _whole("converters.encoder_counts", self.encoder_counts, 2, 2**31, "counts a revolution")
        must_be_known("converters.hub_rate", self.hub_rate, ("ideal", "difference"))
        must_be_known("converters.arithmetic", self.arithmetic, ("float64", "float32"))
        check_annotated(self, "converters")
        for signal in ("moment", "torque"):
            key = f"converters.{signal}_bits"
            bits = getattr(self, f"{signal}_bits")
            _whole(key, bits, least_bits, most_bits, "bits")
            is_bounded = bits is None or getattr(self, f"{signal}_range")
            remedy = f"{bits} bits need a range +-R: give it, or leave {key} out"
            require(is_bounded, f"converters.{signal}_range", None, remedy)

    @property
    def is_single(self) -> bool:
        """Whether the controller calculates in float32."""
        return self.arithmetic == "float32"


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator:
    """The motor: `torque_limit` (inf: none) in the unit of the arm's input, N m, V or A, and `motor_constant` [N m/V],
    so that volts = torque / constant where the input is a torque.

    `hub_damping` [N m s/rad] is analog: a back-EMF torque -hub_damping theta_t that acts between the samples too.
    """

    torque_limit: Annotated[
        float,
        above_zero,
        "a torque limit is positive (in N m; in V or A where that is the arm's input), or inf for none",
    ] = math.inf
    motor_constant: Annotated[
        float | None,
        positive_if_given,
        "a motor constant is a positive number of N m a volt; leave it out if there is none",
    ] = None
    hub_damping: Annotated[float, not_negative, "hub damping is zero or positive, in N m s/rad"] = 0.0

    def __post_init__(self) -> None:
        check_annotated(self, "actuator")


@dataclass(frozen=True, slots=True, kw_only=True)
class Slew:
    """A bang-bang acceleration: tip `travel` [m] within `rise_time` [s], +a for the first half and -a for the second.

    By default the tip travels 1.15 times the arm's length, the angle of the paper's slew.
    `reading` is the moment that is fed back: "vibration" (the moment less the rigid arm's) or "total" (all of it).
    """

    travel: float | None = None
    rise_time: Annotated[float, positive, "a rise time is a positive, finite number of seconds"] = 1.0
    reading: MomentReading = "vibration"

    def __post_init__(self) -> None:
        if self.travel is not None:
            remedy = "tip travel is a finite number of metres, other than zero"
            object.__setattr__(self, "travel", number("slew.travel", self.travel, remedy))
            positive("slew.travel", abs(self.travel), remedy)
        check_annotated(self, "slew")
        must_be_known("slew.reading", self.reading, ("vibration", "total"))

    def travel_of(self, reach: float) -> float:
        """Return the tip travel [m] of an arm whose tip is so far [m] from the axis."""
        # rad, as tip travel over length: the paper moves the tip of its 1 m by 1.15 m
        paper_angle = 1.15
        return paper_angle * reach if self.travel is None else self.travel

    def acceleration(self, reach: float) -> float:
        """Return the hub's angular acceleration [rad/s^2] in the first half, 4 travel/(reach rise^2)."""
        return 4 * self.travel_of(reach) / (reach * self.rise_time**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceShaping:
    """The reference of a slew: the `profile` of its motion, and the `shaper` for the first `modes` of the loop.

    A profile "file" is read from the CSV `file`, time [s] and angle or travel in any unit: it is scaled to `Slew`.
    `feedforward` is the torque of the rigid arm or of the exact one at its hub.
    """

    profile: Profile = "bang-bang"
    shaper: ShaperName = "none"
    modes: int = 2
    file: str | None = None
    feedforward: FeedforwardName = "rigid"

    def __post_init__(self) -> None:
        must_be_known("reference.profile", self.profile, get_args(Profile))
        must_be_known("reference.shaper", self.shaper, get_args(ShaperName))
        # each mode more is half a period of it more
        whole("reference.modes", self.modes, 1, 10, "a whole number of flexible modes to shape for, 1 to 10")
        remedy = 'the path of a CSV file of time and angle, with profile = "file"; leave it out otherwise'
        must_be_known("reference.feedforward", self.feedforward, get_args(FeedforwardName))
        is_smooth = self.feedforward != "inverse" or self.profile in ("s-curve", "polynomial")
        smooth = 'the inverse at the hub is of a profile of limited jerk: "s-curve" or "polynomial"'
        require(is_smooth, "reference.feedforward", self.feedforward, smooth)
        is_named = isinstance(self.file, str) and bool(self.file.strip())
        is_right = is_named if self.profile == "file" else self.file is None
        require(is_right, "reference.file", self.file, remedy)


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """The whole chain: `[sampling]`, `[converters]`, `[actuator]`, `[slew]` and `[reference]` of a file.

    `period_from` is the origin of its sampling period in words, "the file's period"; "" where none was stated.
    """

    sampling: Sampling = field(default_factory=Sampling)
    converters: Converters = field(default_factory=Converters)
    actuator: Actuator = field(default_factory=Actuator)
    slew: Slew = field(default_factory=Slew)
    reference: ReferenceShaping = field(default_factory=ReferenceShaping)
    period_from: str = field(default="", compare=False, repr=False)

    @property
    def is_linear(self) -> bool:
        """Whether all of its stages are: there is neither quantisation nor saturation."""
        return are_linear(stated_keys(self))


def chain_or_usual(chain: object) -> Chain:
    """Return the chain; for None 10 ms and ideal converters.  Raises ParameterError for anything else."""
    chain = Chain() if chain is None else chain
    if isinstance(chain, Chain):
        return chain
    remedy = (
        "give a tfarm.dsp.Chain, as tfarm.dsp.load_chain reads one; nothing for 10 ms and ideal converters"
    )
    raise ParameterError(key="chain", value=chain, remedy=remedy)


def _whole(key: str, value: object, least: int, most: int, unit: str) -> None:
    remedy = f"a whole number of {unit} from {least} to {most}; leave it out for an ideal converter"
    if value is not None:
        whole(key, value, least, most, remedy)


CHAIN_TABLES: dict[str, type[TomlTable]] = {
    name: schema.of(kind)(TomlTable)
    for name, kind in {
        "sampling": Sampling,
        "converters": Converters,
        "actuator": Actuator,
        "slew": Slew,
        "reference": ReferenceShaping,
    }.items()
}


def load_chain(name_or_path: AnyFile) -> Chain:
    """Read the chain of an arm's file (or preset, or a file of its own); ideal without these tables.

    A file of a profile is found from the folder of that file.

    Raises ParameterError for an unknown key, a wrong type or an invalid value.
    """
    tables, file = load_tables(name_or_path)
    with name_file(file):
        chain = chain_of_tables(tables)
    if chain.reference.file is None:
        return chain
    profile = os.path.join(os.path.dirname(file), chain.reference.file)
    return replace(chain, reference=replace(chain.reference, file=profile))


def chain_of_tables(tables: Mapping[str, Any]) -> Chain:
    """Return the chain of a parsed file, which may also have the tables of an arm."""
    known = {*CHAIN_TABLES, *ArmTable.model_fields, "law", "weights", "requirements"}
    for key, value in tables.items():
        require(key in known, key, value, unknown_key(key, CHAIN_TABLES))
    records = {}
    for name, model in CHAIN_TABLES.items():
        if name in tables:
            records[name] = validate_table(model, tables[name], name).build()
    has_period = "period" in tables.get("sampling", {})
    return Chain(**records, period_from="the file's period" if has_period else "")


def stated_keys(chain: Chain) -> dict[str, dict[str, Any]]:
    """Return the keys of each table of a chain that are no default."""
    found: dict[str, dict[str, Any]] = {}
    for table in CHAIN_TABLES:
        record = getattr(chain, table)
        values = ((each, getattr(record, each.name)) for each in fields(record))
        found[table] = {each.name: value for each, value in values if value != each.default}
    return found


def file_text(arm: Arm, chain: Chain | None = None) -> str:
    """Return the arm's TOML file with each key of the tables of a chain that is no default.

    Python's shortest exact digits are TOML's too, and so is inf; a text needs its quotes.
    """
    text = to_toml(arm)
    for table, given in stated_keys(chain or Chain()).items():
        if given:
            (lines,) = toml_tables(given, table)
            text += f"\n{toml_text([lines])}"
    return text
