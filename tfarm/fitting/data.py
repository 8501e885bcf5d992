"""A measured frequency response: one signal of a rig over another, at frequencies of a swept sine or of an estimate.

How far a measured value may be from the true one: by what the file says, by its coherence, or by its own scatter.

Columns of numbers from a text file, as laboratories write them.

Comma, semicolon or tab separate the columns, whichever the header has; behind the last two a decimal comma is read.  A
byte order mark, Windows line ends, empty lines and lines that begin with # are passed over.  A unit in brackets behind
a name, "t [s]", is not part of it.

Measured responses from files: CSV, UFF 58.

    hz, re, im, coherence          hz or rad_s; re, im or abs, deg or db, deg; coherence or sigma and averages as known
    1.00, 0.312, -0.004, 0.998

Values are in SI units, sigma (of the real and of the imaginary part, each) in those of the response.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import INPUTS
from tfarm.arm.reading import decoded
from tfarm.arrays import Complex, Real
from tfarm.errors import MISSING, ParameterError, did_you_mean, naming
from tfarm.exact.outputs import OUTPUTS
from tfarm.files import read_file
from tfarm.records import record

CONFIDENCE = 0.95  # of every interval of a fit: the usual one
LEAST_SHARE = 1e-5  # of |H|: no measured response is better known than that, whatever its coherence says
SCATTER_NEIGHBOURS = 2  # neighbours on each side that a value is compared with
TYPICAL = 1.17741  # the median of |x + i y| of normal x and y of deviation 1: sqrt(2 ln 2)


@dataclass(frozen=True, kw_only=True)
@record
class Measured:
    """A measured response `output`/`input`: complex `values` (n,) in SI units at ascending `omega` (n,) [rad/s].

    Both signals are named as in `response.signals` ("tip_acceleration", "strain@0.05"), `input` also as an arm's input
    is ("hub_torque").  `sigma` (n,) is the standard deviation of the real and of the imaginary part, each; `coherence`
    (n,) between 0 and 1 is that of an estimate from so many independent `averages`.  `source` says where they are from,
    `digest` is the SHA-256 of the file.

    Raises ParameterError for what no measurement can be: shapes that differ, frequencies that are not positive or do
    not ascend, values that are no numbers or 0 everywhere, a coherence out of [0, 1] or 0 everywhere, a sigma that is
    not positive.
    """

    output: str
    input: str
    omega: Real
    values: Complex
    sigma: Real | None = None
    coherence: Real | None = None
    averages: int | None = None
    source: str = "array"
    digest: str = ""

    def __post_init__(self) -> None:
        for name, kind in {"omega": float, "values": complex, "sigma": float, "coherence": float}.items():
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, np.atleast_1d(np.asarray(given, dtype=kind)))
        for name in ("values", "sigma", "coherence"):
            held = getattr(self, name)
            if held is not None and held.shape != self.omega.shape:
                remedy = f"one for each of the {self.omega.size} frequencies"
                raise ParameterError(key=f"{self.name} {name}", value=held.shape, remedy=remedy)
        w, ordered = self.omega, "repeated or not in ascending order; sort the rows, and average those of one frequency"
        _check("frequency", w, (w > 0) & np.isfinite(w), "positive and finite; leave other rows out")
        _check("frequency", w[1:], np.diff(w) > 0, ordered)
        _check("frequency", w, np.isfinite(self.values), "has a value that is no number; leave the row out")
        nothing = "0 everywhere: nothing was measured"
        _check(f"{self.name} values", np.zeros(1), np.atleast_1d(self.values.any()), nothing)
        if self.sigma is not None:
            positive = (self.sigma > 0) & np.isfinite(self.sigma)
            _check("sigma", self.sigma, positive, "a standard deviation is positive")
        if self.coherence is not None:
            g = self.coherence
            _check("coherence", g, (g >= 0) & (g <= 1), "between 0 and 1")
            _check("coherence", np.zeros(1), np.atleast_1d(g.any()), f"{nothing}; leave it out")

    @property
    def name(self) -> str:
        """What is measured, as the command line has it: tip_acceleration/hub_angle."""
        return f"{self.output}/{self.input}"


def _check(key: str, values: Real, good: NDArray[np.bool_], remedy: str) -> None:
    """Raise ParameterError for the first of the values that is not good."""
    if not good.all():
        raise ParameterError(key=key, value=float(values[~good][0]), remedy=remedy)


def in_parts(values: Complex) -> Real:
    """Real parts, then imaginary ones, along the last axis: (..., n) becomes (..., 2 n)."""
    return np.concatenate([values.real, values.imag], axis=-1)


def must_be_measured(measured: object) -> None:
    """Raise ParameterError where a path or anything else stands in the place of a measured response."""
    if not isinstance(measured, Measured):
        remedy = "is no measured response; give what tfarm.read_measured returns, or a tfarm.Measured"
        raise ParameterError(key="measured", value=measured, remedy=remedy)


@dataclass(frozen=True, kw_only=True)
@record
class Noise:
    """The standard deviation `sigma` (n,) of real and imaginary part, each; infinite where nothing was measured.

    `is_known` is whether it is in the units of the values, or only up to a factor that the residuals have to say.
    `road` says where it is from.
    """

    sigma: Real
    is_known: bool
    road: str


def noise_of(data: Measured) -> Noise:
    """The noise of a measured response.

    With coherence g^2 of an estimate from n averages the relative deviation of a part is sqrt((1 - g^2)/(2 n g^2))
    (Bendat and Piersol 2010, (9.90)); without n it is known up to a factor.  With nothing given it is the scatter of
    the values about a parabola through their neighbours.
    """
    size = abs(data.values)
    if data.sigma is not None:
        return Noise(sigma=data.sigma, is_known=True, road="sigma of the file")
    if data.coherence is not None:
        g = data.coherence
        with np.errstate(divide="ignore"):
            share = np.sqrt((1.0 - g) / (2.0 * (data.averages or 1) * g))
        sigma = np.asarray(size * np.maximum(share, LEAST_SHARE), dtype=float)
        sigma[(g == 0) | (size == 0)] = np.inf  # a share of nothing says nothing
        known = data.averages is not None
        road = f"coherence of {data.averages} averages" if known else "coherence, up to a factor"
        return Noise(sigma=sigma, is_known=known, road=road)
    return Noise(sigma=_scatter(data.values), is_known=False, road="scatter of the values")


def _scatter(values: NDArray[Any]) -> Real:
    """The deviation of each value from a parabola through its four neighbours, smoothed.

    It is LEAST_SHARE of the value at least.
    """
    n = values.size
    if n < 2 * SCATTER_NEIGHBOURS + 1:
        return np.maximum(abs(values), LEAST_SHARE * abs(values).max())
    # x_k less the parabola through x_(k-2), x_(k-1), x_(k+1), x_(k+2): weights -1/6, 2/3, 2/3, -1/6 of these
    weights = np.array([1 / 6, -2 / 3, 1.0, -2 / 3, 1 / 6])
    away = np.convolve(values, weights, mode="valid") / np.sqrt((weights**2).sum())
    size, inside = abs(values), abs(values[SCATTER_NEIGHBOURS:-SCATTER_NEIGHBOURS])
    relative = abs(away[inside > 0]) / inside[inside > 0]
    typical = float(np.median(relative)) / TYPICAL if relative.size else 1.0
    least = max(1e-3 * float(np.median(size)), 1e-6 * float(size.max()))  # which a value of 0 is taken for
    return np.maximum(size, least) * max(typical, LEAST_SHARE)


MOST_RECORD_BYTES = 256 * 1024 * 1024  # of a record; an hour of two signals at 1 kHz as text has 150 MB
FREQUENCIES = {"hz": ("Hz", 2 * np.pi), "rad_s": ("rad/s", 1.0)}  # its unit, and rad/s in one
VALUE_PAIRS = (("re", "im"), ("abs", "deg"), ("db", "deg"))
KNOWN_COLUMNS = (*FREQUENCIES, "re", "im", "abs", "db", "deg", "coherence", "sigma", "averages")
DATA_FORM = "OUTPUT/INPUT=FILE, such as tip_acceleration/hub_angle=sweep.csv"
UFF = (".uff", ".unv", ".uf")
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"  # as it is written in a cell or an option
UFF_RESPONSE = 4  # in UFF 58 the type of a function that is a frequency response
UFF_FREQUENCY = 18  # and the kind of an abscissa that is a frequency


@dataclass(frozen=True, slots=True)
@record
class Sheet:
    """Columns of numbers by name, their `units` ("" where there is none), and the line of each row in the file."""

    columns: dict[str, Real]
    units: dict[str, str]
    lines: tuple[int, ...]
    digest: str

    def refuse(self, name: str, wrong: NDArray[np.bool_], remedy: str) -> None:
        """Raise ParameterError for the first row (rows,) in which a column is wrong, naming its line."""
        if wrong.any():
            at = int(wrong.argmax())
            value = float(self.columns[name][at])
            raise ParameterError(key=f"line {self.lines[at]}, {name}", value=value, remedy=remedy)


def digest_of(data: bytes) -> str:
    """The SHA-256 of a file's bytes."""
    return hashlib.sha256(data).hexdigest()


def read_sheet(path: str | os.PathLike[str], key: str) -> Sheet:
    """The columns of a text file.

    Raises ParameterError naming the line for a missing or doubled name, a row of another length, or what is no finite
    number; naming `key` where the file cannot be read.
    """
    data = read_file(path, MOST_RECORD_BYTES, key=key, what="a .csv file")
    with naming(path):
        text = decoded(data, "is not UTF-8 text; save the file as CSV in UTF-8")
        numbered = enumerate(text.splitlines(), start=1)
        rows = [(number, line) for number, line in numbered if line.strip() and not line.lstrip().startswith("#")]
        if not rows:
            remedy = "the file is empty; begin with the names of columns"
            raise ParameterError(key="header", value=MISSING, remedy=remedy)
        separator = next((each for each in "\t;" if each in rows[0][1]), ",")
        units = _header(_cells(rows[0][1], separator))
        if len(rows) == 1:
            raise ParameterError(key="rows", value=0, remedy="a header and nothing below it")
        values = _numbers(list(units), rows[1:], separator)
    return Sheet(
        columns=dict(zip(units, values.T, strict=True)),
        units=units,
        lines=tuple(number for number, _ in rows[1:]),
        digest=digest_of(data),
    )


def _header(cells: Sequence[str]) -> dict[str, str]:
    """The unit of each column by its name; a first line of numbers is a header left out."""
    units: dict[str, str] = {}
    for place, cell in enumerate(cells, start=1):
        found = re.fullmatch(r"(.*?)\s*(?:\[(.*)\])?", cell)
        name, unit = found.groups() if found else (cell, None)
        if math.isfinite(_number(name)):
            remedy = "the first line holds numbers; begin the file with the names of its columns"
            raise ParameterError(key="header", value=MISSING, remedy=remedy)
        if not name or name in units:
            remedy = "each column has a name of its own"
            raise ParameterError(key=f"header, column {place}", value=name, remedy=remedy)
        units[name] = (unit or "").strip()
    return units


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def _numbers(names: Sequence[str], rows: Sequence[tuple[int, str]], separator: str) -> Real:
    """The cells (rows, columns) of numbered lines as numbers."""
    values = np.empty((len(rows), len(names)))
    for at, (line, text) in enumerate(rows):
        cells = _cells(text, separator)
        if len(cells) != len(names):
            remedy = f"{len(cells)} columns where the header names {len(names)}"
            raise ParameterError(key=f"line {line}", value=text, remedy=remedy)
        values[at] = [_number(cell if separator == "," else cell.replace(",", ".")) for cell in cells]
        if not np.isfinite(values[at]).all():
            wrong = int(np.isnan(values[at]).argmax())
            remedy = "no finite number; leave the row out, or write numbers as 50, 0.5 or 5e1"
            raise ParameterError(key=f"line {line}, {names[wrong]}", value=cells[wrong], remedy=remedy)
    return values


def _number(text: str) -> float:
    """The finite number that a cell holds; nan for anything else."""
    value = float(text) if re.fullmatch(NUMBER, text, re.ASCII) else math.nan
    return value if math.isfinite(value) else math.nan


def data_of(text: str, key: str = "--data") -> Measured:
    """The measured response that the command line means by "tip_acceleration/hub_angle=sweep.csv".

    Raises ParameterError for another form, a signal that is none, and for what `read_measured` refuses.
    """
    names, given, path = text.partition("=")
    output, slash, input = (part.strip() for part in names.partition("/"))
    if not (given and slash and path.strip()):
        raise ParameterError(key=key, value=text, remedy=f"write {DATA_FORM}")
    return read_measured(path.strip(), output, input)


def read_measured(path: str | os.PathLike[str], output: str, input: str) -> Measured:
    """The response `output`/`input` of a CSV file, or of a UFF file with a data set 58 (its number behind a #).

    Raises ParameterError, naming file and line, for a header without frequency or value, for frequencies that are
    repeated or not sorted, a coherence that is 0 everywhere, and for what else no measurement can be.
    """
    check_signal(output, "output")
    check_signal(input, "input")
    name = os.fspath(path)
    if re.sub(r"#\d+$", "", name).lower().endswith(UFF):
        return _of_uff(name, output, input)
    sheet = read_sheet(path, key=f"{output}/{input}")
    with naming(name):
        omega, values = _frequencies(sheet), _values(sheet)
        return Measured(
            output=output,
            input=input,
            omega=omega,
            values=values,
            sigma=sheet.columns.get("sigma"),
            coherence=sheet.columns.get("coherence"),
            averages=_averages(sheet),
            source=name,
            digest=sheet.digest,
        )


def check_signal(name: str, key: str) -> None:
    """Raise ParameterError, with the nearest name, for what is neither an output of an arm nor an input of its hub.

    Where along the link it is, and whether the arm has it, is seen when the arm is known.
    """
    plain, known = name.partition("@")[0], (*OUTPUTS, *(each for each in INPUTS if each not in OUTPUTS))
    if plain not in known:
        raise ParameterError(key=key, value=name, remedy=did_you_mean(plain, known))


# ------------------------------------------------------------ CSV
def _frequencies(sheet: Sheet) -> Real:
    """The frequencies [rad/s], once the header is known to be one and they ascend."""
    for name in sheet.columns:
        if name not in KNOWN_COLUMNS:
            raise ParameterError(key="header", value=name, remedy=did_you_mean(name.lower(), KNOWN_COLUMNS))
    given = [name for name in FREQUENCIES if name in sheet.columns]
    if len(given) != 1:
        remedy = "one column of frequencies: hz or rad_s"
        raise ParameterError(key="header", value=", ".join(sheet.columns), remedy=remedy)
    (name,) = given
    unit, scale = FREQUENCIES[name]
    if sheet.units[name].lower() not in ("", unit.lower()):
        raise ParameterError(key=f"unit of {name}", value=sheet.units[name], remedy=f"{name} is in {unit}")
    frequency = sheet.columns[name]
    sheet.refuse(name, ~(frequency > 0), "a frequency is positive; leave the row out")
    back = np.r_[False, np.diff(frequency) <= 0]
    again = frequency[back.argmax()] in frequency[: back.argmax()]
    sheet.refuse(name, back, "is there twice; average its rows" if again else "is below the one before; sort the rows")
    return frequency * scale


def _values(sheet: Sheet) -> Complex:
    """The complex response, of whichever two columns there are."""
    given = tuple(name for name in KNOWN_COLUMNS if name in sheet.columns and name in itertools.chain(*VALUE_PAIRS))
    if given not in VALUE_PAIRS:
        remedy = "one pair of columns for the value: re, im or abs, deg or db, deg; leave others out"
        raise ParameterError(key="header", value=", ".join(sheet.columns), remedy=remedy)
    first, second = (sheet.columns[name] for name in given)
    if given == ("re", "im"):
        return np.asarray(first + 1j * second)
    if given == ("abs", "deg"):
        sheet.refuse("abs", first < 0, "a magnitude is not negative; is it db?")
    with np.errstate(over="ignore"):
        size = first if given == ("abs", "deg") else 10.0 ** (first / 20)
    return np.asarray(size * np.exp(1j * np.radians(second)))


def _averages(sheet: Sheet) -> int | None:
    """The number of independent averages, which is one for all rows."""
    if "averages" not in sheet.columns:
        return None
    found = sheet.columns["averages"]
    wrong = (found != found[0]) | (found < 1) | (found != np.round(found))
    sheet.refuse("averages", wrong, "a whole number of averages, the same in every row")
    return int(found[0])


# ------------------------------------------------------------ UFF
def _of_uff(name: str, output: str, input: str) -> Measured:
    """The response of a UFF file: the one it has, or that of the number behind a # (from 1, as they stand there)."""
    path, _, number = name.partition("#")
    data = read_file(path, MOST_RECORD_BYTES, key=f"{output}/{input}", what="a .uff file")
    with naming(path):
        found = _responses(path)
        if not found:
            remedy = "the file holds no frequency response function (type 58, function 4)"
            raise ParameterError(key="data set", value=58, remedy=remedy)
        if not number and len(found) > 1:
            remedy = f"the file holds {len(found)} responses; choose one by its number, as file.uff#2"
            raise ParameterError(key="data set", value=MISSING, remedy=remedy)
        place = int(number or 1)
        if not 1 <= place <= len(found):
            remedy = f"from 1 to {len(found)}, the responses of the file"
            raise ParameterError(key="data set", value=place, remedy=remedy)
        omega = 2 * np.pi * np.asarray(found[place - 1]["x"], dtype=float)
        values: NDArray[Any] = np.asarray(found[place - 1]["data"], dtype=complex)
        kept = slice(int(omega.size > 0 and omega[0] == 0), None)  # the line at 0 Hz that spectra begin with
        return Measured(
            output=output, input=input, omega=omega[kept], values=values[kept], source=name, digest=digest_of(data)
        )


def _responses(path: str) -> list[dict[str, Any]]:
    """The frequency response functions of a UFF file, as pyuff has them."""
    try:
        import pyuff
    except ImportError:
        remedy = "is not installed, and reads UFF files: pip install 'tfarm[uff]', or export the response as CSV"
        raise ParameterError(key="package", value="pyuff", remedy=remedy) from None
    try:
        file = pyuff.UFF(path)
        sets = [file.read_sets(n) for n, kind in enumerate(file.get_set_types()) if int(kind) == 58]
    except Exception as error:  # a parser that is not ours, on data from outside: it may raise anything
        remedy = f"no UFF file that can be read: {str(error)[:80]}"
        raise ParameterError(key="data set", value=58, remedy=remedy) from None
    return [
        cast("dict[str, Any]", each)
        for each in sets
        if each.get("func_type") == UFF_RESPONSE and each.get("abscissa_spec_data_type", UFF_FREQUENCY) == UFF_FREQUENCY
    ]
