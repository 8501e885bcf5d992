"""What stands between the controller and the arm: sampling, converters, actuator, and the slew it is asked to make.

Everything is ideal unless it is said otherwise.  Frozen records, checked once, SI units.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal

from tfarm.arm import Arm, schema, to_toml
from tfarm.arm.checks import extended, not_negative, number, positive, whole
from tfarm.arm.reading import load_tables
from tfarm.arm.schema import ArmTable, TomlTable, validated
from tfarm.errors import ParameterError, did_you_mean, must_be_known, naming
from tfarm.schema import Quantity

Reading = Literal["vibration", "total"]
LEAST_BITS, MOST_BITS = 2, 32  # of a converter: of one bit there are no steps, of more than 32 no part
MOST_DELAY = 100.0  # samples: each whole one is a state more
TIME_ROUNDING = 1e-12  # of a time: so little before a sample it is at it, as its quotient with the period is rounded
PAPER_ANGLE = 1.15  # rad, as tip travel over length: the paper moves the tip of its 1 m by 1.15 m
OF_AN_ARM = (*ArmTable.model_fields, "law")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """The clock: `period` T [s], `delay_samples` (any fraction) from a sample to the torque that answers it.

    `antialias_corner` [rad/s] is a first-order analog low-pass before the sampler, on the strain gauge and on an ideal
    (tachometer) hub rate; inf is none.  An encoder is digital and has none.
    """

    period: Annotated[float, Quantity("sampling period", "s")] = 0.01
    delay_samples: Annotated[float, Quantity("delay in samples")] = 0.0
    antialias_corner: float = math.inf

    def __post_init__(self) -> None:
        meaning = "a sample period is a positive, finite time in seconds, 0.01 for instance"
        object.__setattr__(self, "period", positive("sampling.period", self.period, meaning))
        meaning = f"a computational delay is zero or positive, in samples, at most {MOST_DELAY:g}"
        delay = not_negative("sampling.delay_samples", self.delay_samples, meaning)
        if delay > MOST_DELAY:
            raise ParameterError(key="sampling.delay_samples", value=delay, remedy=meaning)
        object.__setattr__(self, "delay_samples", delay)
        meaning = "an anti-alias corner is positive in rad/s, or inf for none"
        object.__setattr__(self, "antialias_corner", _above_zero("sampling.antialias_corner", self, meaning))

    @property
    def whole_delay(self) -> int:
        """d: the whole samples of delay."""
        return math.floor(self.delay_samples)

    @property
    def fraction(self) -> float:
        """f in [0, 1): what remains of the delay, in samples."""
        return self.delay_samples - self.whole_delay


RANGE_UNITS = {"moment": " of N m", "torque": " of N m (of V or A where that is the arm's input)"}  # of ranges


@dataclass(frozen=True, slots=True, kw_only=True)
class Converters:
    """The sensors and the DAC; what is left out (None) is ideal.

    `encoder_counts` a revolution of the hub; `hub_rate` "ideal" or "difference" (of the encoder, through a first-order
    filter of corner `rate_filter` [rad/s], inf for none); `moment_bits` over +-`moment_range` [N m] of the strain
    amplifier; `torque_bits` over +-`torque_range` of the DAC, in the unit of the arm's input (N m, V or A);
    `arithmetic` of the controller, "float64" or "float32" (as on a TMS320C31).  A signal beyond a range saturates, and
    the simulation says how often.
    """

    encoder_counts: int | None = None
    hub_rate: Literal["ideal", "difference"] = "ideal"
    rate_filter: float = math.inf
    moment_bits: int | None = None
    moment_range: float | None = None
    torque_bits: int | None = None
    torque_range: float | None = None
    arithmetic: Literal["float64", "float32"] = "float64"

    def __post_init__(self) -> None:
        _whole("converters.encoder_counts", self.encoder_counts, 2, 2**31, "counts a revolution")
        must_be_known("converters.hub_rate", self.hub_rate, ("ideal", "difference"))
        must_be_known("converters.arithmetic", self.arithmetic, ("float64", "float32"))
        meaning = "the corner of the rate filter is positive in rad/s, or inf for a plain difference"
        object.__setattr__(self, "rate_filter", _above_zero("converters.rate_filter", self, meaning))
        for signal in ("moment", "torque"):
            self._check_converter(signal)

    def _check_converter(self, signal: str) -> None:
        bits, span = getattr(self, f"{signal}_bits"), getattr(self, f"{signal}_range")
        _whole(f"converters.{signal}_bits", bits, LEAST_BITS, MOST_BITS, "bits")
        if span is not None:
            meaning = f"the range +-R of a converter is a positive, finite number{RANGE_UNITS[signal]}"
            object.__setattr__(self, f"{signal}_range", positive(f"converters.{signal}_range", span, meaning))
        elif bits is not None:
            unit = RANGE_UNITS[signal]
            remedy = f"{bits} bits of what? give the range +-R{unit} too, or leave converters.{signal}_bits out"
            raise ParameterError(key=f"converters.{signal}_range", value=span, remedy=remedy)


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator:
    """The motor: `torque_limit` (inf: none) in the unit of the arm's input, N m, V or A, and `motor_constant` [N m/V],
    so that volts = torque / constant where the input is a torque.

    `hub_damping` [N m s/rad] is analog: a back-EMF torque -hub_damping theta_t that acts between the samples too.
    """

    torque_limit: float = math.inf
    motor_constant: float | None = None
    hub_damping: float = 0.0

    def __post_init__(self) -> None:
        meaning = "a torque limit is positive (in N m; in V or A where that is the arm's input), or inf for none"
        object.__setattr__(self, "torque_limit", _above_zero("actuator.torque_limit", self, meaning))
        meaning = "hub damping is zero or positive, in N m s/rad"
        damping = not_negative("actuator.hub_damping", self.hub_damping, meaning)
        object.__setattr__(self, "hub_damping", damping)
        if self.motor_constant is not None:
            meaning = "a motor constant is a positive number of N m a volt; leave it out if there is none"
            constant = positive("actuator.motor_constant", self.motor_constant, meaning)
            object.__setattr__(self, "motor_constant", constant)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slew:
    """A bang-bang acceleration: tip `travel` [m] within `rise_time` [s], +a for the first half and -a for the second.

    Without a travel the tip goes 1.15 times the arm's length: the angle of the paper's slew, whatever the arm.
    `reading` says what the moment feedback sees: "vibration" (the moment less the rigid arm's) or "total" (all of it).
    """

    travel: float | None = None
    rise_time: float = 1.0
    reading: Reading = "vibration"

    def __post_init__(self) -> None:
        meaning = "tip travel is a finite number of metres, other than zero"
        if self.travel is not None:
            travel = number("slew.travel", self.travel, meaning)
            positive("slew.travel", abs(travel), meaning)
            object.__setattr__(self, "travel", travel)
        meaning = "a rise time is a positive, finite number of seconds"
        object.__setattr__(self, "rise_time", positive("slew.rise_time", self.rise_time, meaning))
        must_be_known("slew.reading", self.reading, ("vibration", "total"))

    def travel_of(self, reach: float) -> float:
        """Tip travel [m] of an arm whose tip is so far [m] from the axis."""
        return PAPER_ANGLE * reach if self.travel is None else self.travel

    def acceleration(self, reach: float) -> float:
        """The hub's angular acceleration [rad/s^2] in the first half, 4 travel/(reach rise^2)."""
        return 4 * self.travel_of(reach) / (reach * self.rise_time**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """All of it: what `[sampling]`, `[converters]`, `[actuator]` and `[slew]` of a file say."""

    sampling: Sampling = field(default_factory=Sampling)
    converters: Converters = field(default_factory=Converters)
    actuator: Actuator = field(default_factory=Actuator)
    slew: Slew = field(default_factory=Slew)

    @property
    def is_linear(self) -> bool:
        """Whether nothing is rounded to steps and nothing can be clipped."""
        c = self.converters
        steps = c.encoder_counts, c.moment_bits, c.moment_range, c.torque_bits, c.torque_range
        return steps == (None,) * len(steps) and self.actuator.torque_limit == math.inf


def chain_or_usual(chain: object) -> Chain:
    """The chain, the usual one for None.  Raises ParameterError for what is none."""
    if chain is None:
        return Chain()
    if isinstance(chain, Chain):
        return chain
    remedy = "give a tfarm.dsp.Chain, or what tfarm.dsp.load_chain reads; nothing for 10 ms and ideal converters"
    raise ParameterError(key="chain", value=chain, remedy=remedy)


def _above_zero(key: str, record: object, meaning: str) -> float:
    value = extended(key, getattr(record, key.split(".")[1]), meaning)
    if value == 0.0:
        raise ParameterError(key=key, value=value, remedy=meaning)
    return value


def _whole(key: str, value: object, least: int, most: int, what: str) -> None:
    if value is None:
        return
    remedy = f"a whole number of {what} from {least} to {most}; leave it out for an ideal converter"
    whole(key, value, least, most, remedy)


@schema.of(Sampling)
class SamplingTable(TomlTable):
    """[sampling]."""


@schema.of(Converters)
class ConvertersTable(TomlTable):
    """[converters]."""


@schema.of(Actuator)
class ActuatorTable(TomlTable):
    """[actuator]."""


@schema.of(Slew)
class SlewTable(TomlTable):
    """[slew]."""


CHAIN_TABLES: dict[str, type[TomlTable]] = {
    "sampling": SamplingTable,
    "converters": ConvertersTable,
    "actuator": ActuatorTable,
    "slew": SlewTable,
}


def load_chain(name_or_path: str | os.PathLike[str]) -> Chain:
    """The chain that an arm's file (or preset, or a file of its own) describes; ideal where it says nothing.

    Raises ParameterError for an unknown key, a wrong type or a value that cannot be.
    """
    tables, file = load_tables(name_or_path)
    with naming(file):
        return chain_of_tables(tables)


def chain_of_tables(tables: Mapping[str, Any]) -> Chain:
    """The chain of a parsed file; the tables of an arm may stand beside its own."""
    unknown = [key for key in tables if key not in CHAIN_TABLES and key not in OF_AN_ARM]
    if unknown:
        remedy = f"unknown table; {did_you_mean(unknown[0], CHAIN_TABLES)}"
        raise ParameterError(key=unknown[0], value=tables[unknown[0]], remedy=remedy)
    given = {name: table for name, table in CHAIN_TABLES.items() if name in tables}
    return Chain(**{name: validated(table, tables[name], name).build() for name, table in given.items()})


def file_text(arm: Arm, chain: Chain | None = None) -> str:
    """The arm's TOML file with those tables of the chain that say more than the defaults; none: the arm alone.

    Of [sampling], [converters], [actuator] and [slew] each key that differs from its default.  Python's shortest exact
    digits are TOML's too, and so is inf; a text needs its quotes.
    """
    lines: list[str] = []
    for table in () if chain is None else fields(chain):
        record = getattr(chain, table.name)
        default = type(record)()
        given = {f.name: getattr(record, f.name) for f in fields(record)}
        given = {name: value for name, value in given.items() if value != getattr(default, name)}
        texts = (json.dumps(value) if isinstance(value, str) else repr(value) for value in given.values())
        if given:
            lines += ["", f"[{table.name}]", *map(" = ".join, zip(given, texts, strict=True))]
    return to_toml(arm) + ("\n".join([*lines, ""]) if lines else "")
