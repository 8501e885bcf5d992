"""A measured frequency response: one signal of a rig over another, at frequencies of a swept sine or of an estimate.

Its noise is given by the file (sigma), by its coherence, or by its own scatter.

Columns of numbers are read from a text file as laboratories write them.  Comma, semicolon or tab separate the columns,
whichever the header has; with the last two a decimal comma is read.  A byte order mark, Windows line ends, empty lines
and lines that begin with # are passed over.  A unit in brackets after a name, "t [s]", is not part of it.

A response is read from CSV or from UFF 58:

    hz, re, im, coherence          hz or rad_s; re, im or abs, deg or db, deg; coherence or sigma and averages as known
    1.00, 0.312, -0.004, 0.998

Values are in SI units, sigma (of the real and of the imaginary part, each) in those of the response.
"""

import hashlib
import math
import os
import re
from collections.abc import Container, Sequence
from contextlib import suppress
from importlib.util import find_spec
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import INPUTS
from tfarm.arm.reading import decode_text
from tfarm.arrays import Complex, Real
from tfarm.digits import general, singly
from tfarm.errors import MISSING, ParameterError, did_you_mean, name_file, require
from tfarm.exact.outputs import OUTPUTS, signal_words, unit_over
from tfarm.files import read_file
from tfarm.foreign import read_arrays
from tfarm.records import frozen
from tfarm.response.frequency import HERTZ
from tfarm.schema import Column, Quantity, Table

# of every interval of a fit: the usual one
CONFIDENCE = 0.95


def require_all(key: str, values: Real, is_good: NDArray[np.bool_], remedy: str) -> None:
    """Raise ParameterError for the first of the values that is not good."""
    if not is_good.all():
        raise ParameterError(key=key, value=float(values[~is_good][0]), remedy=remedy)


@frozen(kw_only=True)
class Measured:
    """A measured response `output`/`input`: complex `values` (n,) in SI units at ascending `omega` (n,) [rad/s].

    Both signals are named as in `response.signals` ("tip_acceleration", "strain@0.05"), `input` also as an arm's input
    is ("hub_torque").  `sigma` (n,) is the standard deviation of the real and of the imaginary part, each; `coherence`
    (n,) between 0 and 1 is that of an estimate from a number of independent `averages`.  The input was `held` over each
    period [s] and the output sampled with it, or is continuous where that is None.  `source` names the file,
    `digest` is its SHA-256.

    Raises ParameterError for shapes that differ, frequencies that are not positive or do not ascend, values that are no
    numbers or 0 everywhere, a coherence out of [0, 1] or 0 everywhere, a sigma that is not positive.
    """

    output: Annotated[str, Quantity("output", help="measured signal in the numerator")]
    input: Annotated[str, Quantity("input", help="measured signal or input in the denominator")]
    omega: Real
    values: Complex
    sigma: Real | None = None
    coherence: Real | None = None
    averages: int | None = None
    held: Annotated[
        float | None,
        Quantity(key="held_s", help="period [s] over which the input is held; none where it is not"),
    ] = None
    source: Annotated[str, Quantity("file", help="file that the response was read from")] = "array"
    digest: Annotated[str, Quantity(key="sha256", help="SHA-256 of that file")] = ""

    def __post_init__(self) -> None:
        for name, kind in {"omega": float, "values": complex, "sigma": float, "coherence": float}.items():
            value = getattr(self, name)
            if value is not None:
                array: NDArray[Any] = np.array(value, dtype=kind, ndmin=1)
                object.__setattr__(self, name, array)
                remedy = f"one for each of the {self.omega.size} frequencies"
                require(array.shape == self.omega.shape, f"{self.name} {name}", array.shape, remedy)
        w = self.omega
        nothing = "0 everywhere: nothing was measured"
        ordered = "repeated or not in ascending order; sort the rows, and average those of one frequency"
        require_all("frequency", w, (w > 0) & np.isfinite(w), "positive and finite; leave other rows out")
        require_all("frequency", w[1:], np.diff(w) > 0, ordered)
        require_all(
            "frequency", w, np.isfinite(self.values), "has a value that is no number; leave the row out"
        )
        require(self.values.any(), f"{self.name} values", 0.0, nothing)
        sigma = self.sigma
        if sigma is not None:
            require_all("sigma", sigma, (sigma > 0) & np.isfinite(sigma), "a standard deviation is positive")
        coherence = self.coherence
        if coherence is not None:
            require_all("coherence", coherence, (coherence >= 0) & (coherence <= 1), "between 0 and 1")
            require(coherence.any(), "coherence", 0.0, f"{nothing}; leave it out")

    @property
    def name(self) -> str:
        """Output and input, as the command line has them: tip_acceleration/hub_angle."""
        return f"{self.output}/{self.input}"

    @property
    def label(self) -> str:
        """Output and input in words: tip acceleration over hub angle."""
        return f"{signal_words(self.output)[0]} over {signal_words(self.input)[0]}"

    @property
    def unit(self) -> str:
        """SI unit, such as m/s^2/rad."""
        return unit_over(signal_words(self.output)[1], signal_words(self.input)[1])

    @property
    def points(
        self,
    ) -> Annotated[int, Quantity("measured frequencies", key="points", help="number of frequencies")]:
        """The number of frequencies."""
        return int(self.omega.size)

    @property
    def band(self) -> tuple[float, float]:
        """The first and the last frequency [rad/s]."""
        return float(self.omega[0]), float(self.omega[-1])

    @property
    def range_hz(
        self,
    ) -> Annotated[
        tuple[float, float],
        Quantity("frequency range", "Hz", key="range_hz", help="first and last measured frequency"),
    ]:
        """The same [Hz]."""
        return self.band[0] / HERTZ, self.band[1] / HERTZ

    @property
    def csv_table(self) -> Table:
        """A row a frequency, in the columns that `read_measured` reads."""
        rows = [Column("hz", "frequency", "Hz", of=self.omega / HERTZ, digits=singly(general, 9))]
        for key, title, of in (
            ("re", f"Re {self.name}", self.values.real),
            ("im", f"Im {self.name}", self.values.imag),
            ("sigma", "sigma", self.sigma),
            ("coherence", "coherence", self.coherence),
        ):
            if of is not None:
                rows.append(Column(key, title, of=of, digits=singly(general, 6)))
        for key, value in (("averages", self.averages), ("held", self.held)):
            if value is not None:
                rows.append(Column(key, key, of=[value] * self.points))
        return Table(columns=tuple(rows))


def in_parts(values: Complex) -> Real:
    """Return real parts, then imaginary ones, along the last axis: (..., n) becomes (..., 2 n)."""
    return np.concatenate([values.real, values.imag], axis=-1)


def rms(values: NDArray[Any]) -> float:
    """Return the root mean square."""
    return float(np.sqrt((abs(values) ** 2).mean()))


def must_be_measured(measured: object) -> None:
    """Raise ParameterError for a path or anything else in the place of a measured response."""
    require(
        isinstance(measured, Measured),
        "measured",
        measured,
        "is no measured response; give what tfarm.read_measured returns, or a tfarm.Measured",
    )


@frozen(kw_only=True)
class Noise:
    """The standard deviation `sigma` (n,) of real and imaginary part, each; infinite where nothing was measured.

    `is_known` is whether it is in the units of the values, or only up to a factor that the residuals determine.
    """

    sigma: Real
    is_known: bool
    source: Annotated[
        str,
        Quantity(
            "noise by",
            key="noise",
            help="origin of the standard deviation: sigma or coherence of the file, or scatter of the values",
        ),
    ]

    @property
    def is_finite(self) -> NDArray[np.bool_]:
        """Whether anything was measured, at each frequency (n,)."""
        return np.isfinite(self.sigma)


def noise_of(data: Measured) -> Noise:
    """Return the noise of a measured response.

    With coherence g^2 of an estimate from n averages the relative deviation of a part is sqrt((1 - g^2)/(2 n g^2))
    (Bendat and Piersol 2010, (9.90)); without n it is known up to a factor.  With nothing given it is the scatter of
    the values about a parabola through their neighbours.
    """
    # of |H|: no measured response is better known than that, whatever its coherence
    least_share = 1e-5
    if data.sigma is not None:
        return Noise(sigma=data.sigma, is_known=True, source="sigma of the file")
    if data.coherence is None:
        sigma = scatter_of(data.values, least_share)
        return Noise(sigma=sigma, is_known=False, source="scatter of the values")
    g = data.coherence
    size = abs(data.values)
    with np.errstate(divide="ignore"):
        share = np.maximum(np.sqrt((1.0 - g) / (2.0 * (data.averages or 1) * g)), least_share)
    # a share of nothing is no deviation
    sigma = np.where((g == 0) | (size == 0), np.inf, size * share)
    if data.averages is None:
        return Noise(sigma=sigma, is_known=False, source="coherence, up to a factor")
    return Noise(sigma=sigma, is_known=True, source=f"coherence of {data.averages} averages")


def scatter_of(values: NDArray[Any], least_share: float) -> Real:
    """Return the deviation of each value from a parabola through its four neighbours, smoothed.

    It is the least share of the value at least.
    """
    size = abs(values)
    if size.size < 5:
        return np.maximum(size, least_share * size.max())
    # x_k less the parabola through x_(k-2), x_(k-1), x_(k+1), x_(k+2): weights -1/6, 2/3, 2/3, -1/6 of these
    weights = np.array([1, -4, 6, -4, 1]) / 6
    inside = size[2:-2]
    away = abs(np.convolve(values, weights, mode="valid"))[inside > 0] / np.linalg.norm(weights)
    # the median of |x + i y| of normal x and y of deviation 1 is sqrt(2 ln 2)
    typical = np.median(away / inside[inside > 0]) / 1.17741 if away.size else 1.0
    # which a value of 0 is taken for
    least = max(1e-3 * np.median(size), 1e-6 * size.max())
    return np.maximum(size, least) * max(typical, least_share)


# of a record; an hour of two signals at 1 kHz as text has 150 MB
MOST_RECORD_BYTES = 256 * 1024 * 1024
VALUES = ("re", "im", "abs", "db", "deg")
# as it is written in a cell or an option
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


@frozen(slots=True)
class Sheet:
    """Columns of numbers by name, their `units` ("" where there is none), and the line of each row in the file."""

    columns: dict[str, Real]
    units: dict[str, str]
    lines: tuple[int, ...]
    digest: str

    def refuse(self, name: str, wrong: NDArray[np.bool_], remedy: str) -> None:
        """Raise ParameterError for the first row (rows,) in which a column is wrong, naming its line."""
        at = int(wrong.argmax())
        require(not wrong[at], f"line {self.lines[at]}, {name}", float(self.columns[name][at]), remedy)


def read_sheet(path: str | os.PathLike[str], key: str, wanted: Container[str] | None = None) -> Sheet:
    """Return the columns of a text file, or the `wanted` ones: cells of the others may hold anything.

    Raises ParameterError naming the line for a missing or doubled name, a row of another length, or what is no finite
    number; naming `key` where the file cannot be read.
    """
    data = read_file(path, MOST_RECORD_BYTES, key=key, what="a .csv file")
    with name_file(path):
        numbered = enumerate(
            decode_text(data, "is not UTF-8 text; save the file as CSV in UTF-8").splitlines(), start=1
        )
        rows = [
            (number, line) for number, line in numbered if line.strip() and not line.lstrip().startswith("#")
        ]
        require(rows, "header", MISSING, "the file is empty; begin with the names of columns")
        separator = next((each for each in "\t;" if each in rows[0][1]), ",")
        units = _header(list(map(_cell, rows[0][1].split(separator))))
        require(len(rows) > 1, "rows", 0, "a header and nothing below it")
        values = _numbers(list(units), rows[1:], separator, wanted)
    lines = tuple(number for number, _ in rows[1:])
    return Sheet(values, units, lines, hashlib.sha256(data).hexdigest())


def _header(cells: Sequence[str]) -> dict[str, str]:
    """Return the unit of each column by its name; a first line of numbers is a missing header."""
    units: dict[str, str] = {}
    for place, cell in enumerate(cells, start=1):
        name, unit = name_and_unit(cell)
        require(
            math.isnan(_number(name)),
            "header",
            MISSING,
            "the first line holds numbers; begin the file with the names of its columns",
        )
        require(
            name and name not in units, f"header, column {place}", name, "each column has a name of its own"
        )
        units[name] = unit
    return units


def name_and_unit(text: str) -> tuple[str, str]:
    """Return the name of a column and its unit, "" where there is none: "t [s]"."""
    name, unit = re.fullmatch(r"(.*?)\s*(?:\[(.*)\])?", text, re.DOTALL).groups("")  # type: ignore[union-attr]
    return name, unit.strip()


def _cell(text: str) -> str:
    return text.strip().strip('"').strip()


def _numbers(
    names: Sequence[str], rows: Sequence[tuple[int, str]], separator: str, wanted: Container[str] | None
) -> dict[str, Real]:
    """Return the wanted columns of numbered lines, by NumPy; the line of a cell that is no number is named."""
    for line, text in rows:
        if (count := text.count(separator) + 1) != len(names):
            raise ParameterError(
                key=f"line {line}", value=text, remedy=f"{count} columns where the header names {len(names)}"
            )
    chosen = [place for place, name in enumerate(names) if wanted is None or name in wanted]
    if not chosen:
        return {}
    lines = [text for _, text in rows]
    # decimal commas
    plain = lines if separator == "," else [text.replace(",", ".") for text in lines]
    how: dict[str, Any] = {"delimiter": separator, "comments": None, "ndmin": 2, "usecols": chosen}
    values = np.full((1, 1), math.nan)
    # of quoted cells, and of what is no number
    with suppress(ValueError):
        values = np.loadtxt(plain, **how)
    if not np.isfinite(values).all():
        # ten times slower
        values = np.loadtxt(lines, converters=_number, **how)
    for row, column in np.argwhere(np.isnan(values))[:1]:
        remedy = "no finite number; leave the row out, or write numbers as 50, 0.5 or 5e1"
        place = chosen[column]
        cell = lines[row].split(separator)[place]
        raise ParameterError(key=f"line {rows[row][0]}, {names[place]}", value=_cell(cell), remedy=remedy)
    return dict(zip((names[place] for place in chosen), values.T, strict=True))


def _number(text: str) -> float:
    """Return the finite number that a cell holds, with a decimal point or comma; nan for anything else."""
    plain = _cell(text).replace(",", ".")
    value = float(plain) if re.fullmatch(NUMBER, plain, re.ASCII) else math.nan
    return value if math.isfinite(value) else math.nan


def data_of(text: str, key: str = "--data") -> Measured:
    """Return the measured response that the command line means by "tip_acceleration/hub_angle=sweep.csv".

    Raises ParameterError for another form, a signal that is none, and for what `read_measured` refuses.
    """
    names, _, path = text.partition("=")
    output, slash, input = (part.strip() for part in names.partition("/"))
    require(
        slash and path.strip(),
        key,
        text,
        "write OUTPUT/INPUT=FILE, such as tip_acceleration/hub_angle=sweep.csv",
    )
    return read_measured(path.strip(), output, input)


def read_measured(path: str | os.PathLike[str], output: str, input: str) -> Measured:
    """Return the response `output`/`input` of a CSV file, or of a UFF file with a data set 58 (its number after a #).

    Raises ParameterError, naming file and line, for a header without frequency or value, for frequencies that are
    repeated or not sorted, a coherence that is 0 everywhere, and for what else no measurement can be.
    """
    check_signal(output, "output")
    check_signal(input, "input")
    name = os.fspath(path)
    if uff := re.fullmatch(r"(.*\.(?:uff|unv|uf))(?:#(\d{1,9}))?", name, re.DOTALL | re.IGNORECASE):
        return _of_uff(uff[1], uff[2] or "", output, input)
    sheet = read_sheet(path, key=f"{output}/{input}")
    with name_file(name):
        omega = _frequencies(sheet)
        values = _values(sheet)
        averages = sheet.columns.get("averages")
        if averages is not None:
            wrong = (averages != averages[0]) | (averages < 1) | (averages != np.round(averages))
            sheet.refuse("averages", wrong, "a whole number of averages, the same in every row")
        held = sheet.columns.get("held")
        if held is not None:
            sheet.refuse("held", (held != held[0]) | (held <= 0), "a positive period, the same in every row")
        return Measured(
            output=output,
            input=input,
            omega=omega,
            values=values,
            held=None if held is None else float(held[0]),
            sigma=sheet.columns.get("sigma"),
            coherence=sheet.columns.get("coherence"),
            averages=None if averages is None else int(averages[0]),
            source=name,
            digest=sheet.digest,
        )


def check_signal(name: str, key: str) -> None:
    """Raise ParameterError, with the nearest name, for what is neither an output of an arm nor an input of its hub.

    Its place along the link, and whether the arm has it, are checked when the arm is known.
    """
    plain = name.partition("@")[0]
    known = tuple(dict.fromkeys((*OUTPUTS, *INPUTS)))
    require(plain in known, key, name, did_you_mean(plain, known))


# ------------------------------------------------------------ CSV
def _frequencies(sheet: Sheet) -> Real:
    """Return the frequencies [rad/s], once the header is known to be one and they ascend."""
    # its unit, and rad/s in one
    frequencies = {"hz": ("Hz", 2 * np.pi), "rad_s": ("rad/s", 1.0)}
    known = (*frequencies, *VALUES, "coherence", "sigma", "averages", "held")
    for name in sheet.columns:
        require(name in known, "header", name, did_you_mean(name.lower(), known))
    found = [name for name in frequencies if name in sheet.columns]
    require(len(found) == 1, "header", [*sheet.columns], "one column of frequencies: hz or rad_s")
    (name,) = found
    unit, scale = frequencies[name]
    own = sheet.units[name]
    require(own.lower() in ("", unit.lower()), f"unit of {name}", own, f"{name} is in {unit}")
    frequency = sheet.columns[name]
    sheet.refuse(name, ~(frequency > 0), "a frequency is positive; leave the row out")
    back = np.r_[False, np.diff(frequency) <= 0]
    again = frequency[back.argmax()] in frequency[: back.argmax()]
    sheet.refuse(
        name, back, "is there twice; average its rows" if again else "is below the one before; sort the rows"
    )
    return frequency * scale


def _values(sheet: Sheet) -> Complex:
    """Return the complex response, of whichever two columns there are."""
    pair = tuple(name for name in VALUES if name in sheet.columns)
    remedy = "one pair of columns for the value: re, im or abs, deg or db, deg; leave others out"
    require(pair in (("re", "im"), ("abs", "deg"), ("db", "deg")), "header", [*sheet.columns], remedy)
    first, second = (sheet.columns[name] for name in pair)
    if "re" in pair:
        return first + 1j * second
    if "abs" in pair:
        sheet.refuse("abs", first < 0, "a magnitude is not negative; is it db?")
    else:
        with np.errstate(over="ignore"):
            first = 10.0 ** (first / 20)
    return np.asarray(first * np.exp(1j * np.radians(second)))


# ------------------------------------------------------------ UFF
def _of_uff(path: str, number: str, output: str, input: str) -> Measured:
    """Return the response of a UFF file: the only one, or that of a number from 1 in their order there."""
    key = f"{output}/{input}"
    data = read_file(path, MOST_RECORD_BYTES, key=key, what="a .uff file")
    remedy = "is not installed, and reads UFF files: pip install 'tfarm[uff]', or export the response as CSV"
    require(find_spec("pyuff"), "package", "pyuff", remedy)
    found = read_arrays("uff", path, key=key, remedy="no UFF file that can be read")
    with name_file(path):
        # frequencies and values of each
        count = len(found) // 2
        require(count, "data set", 58, "the file holds no frequency response function (type 58, function 4)")
        remedy = f"the file holds {count} responses; choose one by its number, as file.uff#2"
        require(number or count == 1, "data set", MISSING, remedy)
        place = int(number or 1)
        require(1 <= place <= count, "data set", place, f"from 1 to {count}, the responses of the file")
        omega = 2 * np.pi * np.asarray(found[f"x{place - 1}"], dtype=float)
        values = found[f"data{place - 1}"]
        # the line at 0 Hz that spectra begin with
        kept = slice(int(omega.size > 0 and omega[0] == 0), None)
        return Measured(
            output=output,
            input=input,
            omega=omega[kept],
            values=values[kept],
            source=f"{path}#{number}" if number else path,
            digest=hashlib.sha256(data).hexdigest(),
        )
