"""Signals in the columns of a record: names, units and scales.

The unit of a column is in brackets after its name, "enc [deg]", in an attribute of its file, or in an option; a name
that ends in a known unit in parentheses, "enc (deg)", has that one.

    hub_angle                     the column of that name
    hub_angle=enc                 another one, in the unit that the file has for it, without one in SI units
    hub_angle=enc[deg]            in that unit, whatever the file has
    hub_angle=enc*0.00153         a number of SI units for each count, volt ... of the column
    strain@0.05=gauge[mV]*2e-3    a number of SI units for each volt
    hub_angle=enc~1e-4            with a known standard deviation, in SI units
    t=time[ms]                    the times

A column that no option names, and whose name is none of a signal, may have any unit until it is used.
"""

import math
import re
from collections.abc import Mapping
from types import MappingProxyType

from tfarm.arm import INPUTS
from tfarm.arm.law import REFERENCE
from tfarm.arrays import Real
from tfarm.errors import MISSING, list_within, require
from tfarm.exact.outputs import OUTPUTS, signal_words
from tfarm.fitting.data import NUMBER, check_signal
from tfarm.records import frozen

# names of a column of times
TIMES = ("t", "time")
# SI unit of each unit, and its size there; "um/m" is a microstrain
UNITS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "s": ("s", 1.0),
        "ms": ("s", 1e-3),
        "us": ("s", 1e-6),
        "rad": ("rad", 1.0),
        "mrad": ("rad", 1e-3),
        "deg": ("rad", math.pi / 180),
        "rev": ("rad", 2 * math.pi),
        "rad/s": ("rad/s", 1.0),
        "deg/s": ("rad/s", math.pi / 180),
        "rpm": ("rad/s", math.pi / 30),
        "m": ("m", 1.0),
        "cm": ("m", 1e-2),
        "mm": ("m", 1e-3),
        "um": ("m", 1e-6),
        "m/s": ("m/s", 1.0),
        "mm/s": ("m/s", 1e-3),
        "m/s^2": ("m/s^2", 1.0),
        "mm/s^2": ("m/s^2", 1e-3),
        # standard gravity, by definition
        "g": ("m/s^2", 9.80665),
        "N": ("N", 1.0),
        "mN": ("N", 1e-3),
        "N m": ("N m", 1.0),
        "mN m": ("N m", 1e-3),
        "N cm": ("N m", 1e-2),
        "N mm": ("N m", 1e-3),
        "A": ("A", 1.0),
        "mA": ("A", 1e-3),
        "V": ("V", 1.0),
        "mV": ("V", 1e-3),
        "1": ("1", 1.0),
        "%": ("1", 1e-2),
        "um/m": ("1", 1e-6),
    }
)


@frozen(slots=True, kw_only=True)
class RecordSignal:
    """A signal of a record: the `name` of the signal, and its `column` with unit, scale and standard deviation.

    `unit` is "" where it is that of the file.  `sigma` is in SI units.  `key` is the option that has named it.
    """

    name: str
    column: str
    unit: str = ""
    scale: float | None = None
    sigma: float | None = None
    key: str = "--signal"

    def check(self) -> None:
        """Raise ParameterError, with the nearest name, unless it is a time, a signal of an arm or its reference."""
        if self.name not in TIMES:
            check_signal(self.name.removeprefix(REFERENCE), self.key)

    def in_si(self, values: Real, own: str) -> Real:
        """Return the signal (n,) in SI units from its column, whose unit in the file is `own`.

        Raises ParameterError for an unknown unit, for one of another quantity, for a scale of a column whose unit is
        not the SI one, where either may be meant, and for an angle beyond 100 rad of a column without a unit.
        """
        # rad: 16 turns of a hub, or a third of one in degrees
        most_angle = 100.0
        key = f"unit of {self.column}"
        wanted = si_unit(self.name)
        parentheses = re.search(r"\(([^()]+)\)$", self.column)
        written = self.unit or own
        if not written and parentheses and known_unit(parentheses[1]):
            written = parentheses[1]
        known = known_unit(written)
        if self.scale is not None and not self.unit:
            # of counts, volts, or nothing
            is_plain = known is None or known[1] == 1.0
            remedy = (
                f"write {self.column}[{written}]*{self.scale:g} for SI values times the scale, or "
                f"{self.column}[1]*{self.scale:g} for the numbers of the file times it"
            )
            require(is_plain, key, written, remedy)
            return values * self.scale
        if not written:
            largest = float(abs(values).max(initial=0.0))
            remedy = (
                f"its largest value is {largest:.4g}: write {self.name}={self.column}[deg], or [rad] if it is"
            )
            require(wanted != "rad" or largest <= most_angle, key, MISSING, remedy)
            return values
        another = f"or give a scale: {self.name}={self.column}*NUMBER"
        require(known, key, written, f"known units are: {list_within(UNITS, 400)}; {another}")
        unit, size = known  # type: ignore[misc]
        is_same = self.scale is not None or wanted in ("", unit)
        require(is_same, key, written, f"{self.name} is in {wanted}; {another}")
        return values * (size * (self.scale or 1.0))


def signal_of(text: str, key: str = "--signal") -> RecordSignal:
    """Return the signal that the command line means by "hub_angle=enc[deg]"; without a column it is that of its name.

    Raises ParameterError for another form, for a scale of 0, and for a deviation that is not positive.
    """
    form = rf"""
        ([^=]+?) \s*
        (?: = \s* (.+?) \s* )?
        (?: \[ ([^][]+) \] \s* )?
        (?: \* \s* ({NUMBER}) \s* )?
        (?: ~ \s* ({NUMBER}) )?
    """
    found = re.fullmatch(form, text.strip(), re.VERBOSE | re.DOTALL)
    remedy = "write NAME=COLUMN, such as tip_acceleration=acc1, with a [unit], *scale or ~deviation"
    require(found, key, text, remedy)
    name, column, unit, scale, sigma = found.groups()  # type: ignore[union-attr]
    signal = RecordSignal(
        name=name,
        column=column or name,
        unit=unit or "",
        scale=None if scale is None else float(scale),
        sigma=None if sigma is None else float(sigma),
        key=key,
    )
    is_scale = signal.scale is None or 0 < abs(signal.scale) < math.inf
    require(is_scale, key, text, "a scale is a finite number, and not 0")
    require(signal.sigma is None or 0 < signal.sigma < math.inf, key, text, "a deviation is positive")
    return signal


def known_unit(text: str) -> tuple[str, float] | None:
    """Return SI unit and size of a unit, also as "m/s2", "N·m" or "µm"; None of an unknown one."""
    plain = re.sub(r"[\s*·]", "", text.replace("²", "^2").replace("°", "deg"))
    plain = re.sub(r"(?<=s)2$", "^2", re.sub("[µμ]", "u", plain))
    return {name.replace(" ", ""): of for name, of in UNITS.items()}.get(plain)


def si_unit(name: str) -> str:
    """Return the SI unit of a signal of an arm, of its reference or of a time; "" of any other name."""
    if name in TIMES:
        return "s"
    plain = name.removeprefix(REFERENCE)
    return signal_words(plain)[1] if plain.partition("@")[0] in (*OUTPUTS, *INPUTS) else ""
