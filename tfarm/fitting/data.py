"""A measured frequency response: one signal of a rig over another, at frequencies of a swept sine or of an estimate.

How far a measured value may be from the true one: by what the file says, by its coherence, or by its own scatter.

Columns of numbers from a text file, as laboratories write them.

Comma, semicolon or tab separate the columns, whichever the header has; behind the last two a decimal comma is read.  A
byte order mark, Windows line ends, empty lines and lines that begin with # are passed over.  A unit in brackets behind
a name, "t [s]", is not part of it.

Measured responses from files: CSV, UFF 58; and from arrays of python-control.

    hz, re, im, coherence          hz or rad_s; re, im or abs, deg or db, deg; coherence or sigma and averages as known
    1.00, 0.312, -0.004, 0.998

Values are in SI units, sigma (of the real and of the imaginary part, each) in those of the response.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import INPUTS
from tfarm.arm.reading import decoded
from tfarm.arrays import Complex, Real
from tfarm.errors import MISSING, ParameterError, did_you_mean, naming
from tfarm.exact.outputs import OUTPUTS
from tfarm.files import read_file
from tfarm.records import record

if TYPE_CHECKING:
    import control

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
        if not (self.omega > 0).all() or not np.isfinite(self.omega).all():
            bad = float(self.omega[~((self.omega > 0) & np.isfinite(self.omega))][0])
            raise ParameterError(key="frequency", value=bad, remedy="positive and finite; leave other rows out")
        steps = np.diff(self.omega)
        if (steps <= 0).any():
            at = float(self.omega[1:][steps <= 0][0])
            remedy = "repeated or not in ascending order; sort the rows, and average those of one frequency"
            raise ParameterError(key="frequency", value=at, remedy=remedy)
        if not np.isfinite(self.values).all():
            at = float(self.omega[~np.isfinite(self.values)][0])
            raise ParameterError(key=f"value at {at:g} rad/s", value="no number", remedy="leave the row out")
        if not self.values.any():
            raise ParameterError(key=f"{self.name} values", value=0.0, remedy="0 everywhere: nothing was measured")
        if self.sigma is not None and not ((self.sigma > 0) & np.isfinite(self.sigma)).all():
            raise ParameterError(key="sigma", value=float(self.sigma.min()), remedy="a standard deviation is positive")
        if self.coherence is not None:
            if not ((self.coherence >= 0) & (self.coherence <= 1)).all():
                raise ParameterError(key="coherence", value=float(self.coherence.max()), remedy="between 0 and 1")
            if not self.coherence.any():
                remedy = "0 everywhere: nothing was measured; leave it out"
                raise ParameterError(key="coherence", value=0.0, remedy=remedy)

    @property
    def name(self) -> str:
        """What is measured, as the command line has it: tip_acceleration/hub_angle."""
        return f"{self.output}/{self.input}"


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
OTHER_COLUMNS = ("coherence", "sigma", "averages")
KNOWN_COLUMNS = (*FREQUENCIES, "re", "im", "abs", "db", "deg", *OTHER_COLUMNS)
DATA_FORM = "OUTPUT/INPUT=FILE, such as tip_acceleration/hub_angle=sweep.csv"
UFF = (".uff", ".unv", ".uf")
UFF_RESPONSE = 4  # in UFF 58 the type of a function that is a frequency response
UFF_FREQUENCY = 18  # and the kind of an abscissa that is a frequency


@dataclass(frozen=True, slots=True)
@record
class Sheet:
    """Columns `values` (columns, rows) with their `names` and `units` ("" where there is none) and each row's line."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Real
    lines: tuple[int, ...]
    digest: str

    def __getitem__(self, name: str) -> Real:
        return self.values[self.names.index(name)]

    def get(self, name: str) -> Real | None:
        """The column of that name, if there is one."""
        return dict(zip(self.names, self.values, strict=True)).get(name)

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def refuse(self, name: str, wrong: NDArray[np.bool_], remedy: str) -> None:
        """Raise ParameterError for the first row (rows,) in which a column is wrong, naming its line."""
        if wrong.any():
            at = int(wrong.argmax())
            raise ParameterError(key=f"line {self.lines[at]}, {name}", value=float(self[name][at]), remedy=remedy)


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
        return sheet_of(data)


def sheet_of(data: bytes) -> Sheet:
    """The columns of a text file's bytes; errors name no file."""
    text = decoded(data, "is not UTF-8 text; save the file as CSV in UTF-8")
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise ParameterError(key="header", value=MISSING, remedy="the file is empty; begin with the names of columns")
    head = lines[0][1]
    separator = next((each for each in "\t;" if each in head), ",")
    names, units = _header(_cells(head, separator))
    rows = []
    for number, line in lines[1:]:
        cells = _cells(line, separator)
        if len(cells) != len(names):
            remedy = f"{len(cells)} columns where the header names {len(names)}"
            raise ParameterError(key=f"line {number}", value=line, remedy=remedy)
        rows.append(cells if separator == "," else [cell.replace(",", ".") for cell in cells])
    if not rows:
        raise ParameterError(key="rows", value=0, remedy="a header and nothing below it")
    numbers = tuple(number for number, _ in lines[1:])
    return Sheet(names, units, _numbers(names, numbers, rows).T, numbers, digest_of(data))


def _header(cells: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units; a first line of numbers is a header left out."""
    found = [re.fullmatch(r"(.*?)\s*(?:\[(.*)\])?", cell.strip()) for cell in cells]
    names = tuple(each[1] if each else cell for each, cell in zip(found, cells, strict=True))
    units = tuple((each[2] or "").strip() if each else "" for each in found)
    if any(_is_number(name) for name in names):
        remedy = "the first line holds numbers; begin the file with the names of its columns"
        raise ParameterError(key="header", value=MISSING, remedy=remedy)
    for place, name in enumerate(names, start=1):
        if not name or name in names[: place - 1]:
            remedy = "each column has a name of its own"
            raise ParameterError(key=f"header, column {place}", value=name, remedy=remedy)
    return names, units


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _numbers(names: Sequence[str], lines: Sequence[int], rows: list[list[str]]) -> Real:
    """The cells (rows, columns) as numbers, all at once; one by one only to say which of them is none."""
    try:
        values = np.array(rows, dtype=float)
    except ValueError:
        values = np.full((1, 1), np.nan)
    if np.isfinite(values).all() and all(cell.isascii() and "_" not in cell for row in rows for cell in row):
        return values
    at, name, cell = next(
        (number, name, cell)
        for number, row in zip(lines, rows, strict=True)
        for name, cell in zip(names, row, strict=True)
        if not _is_number(cell)
    )
    remedy = "no finite number; leave the row out, or write numbers as 50, 0.5 or 5e1"
    raise ParameterError(key=f"line {at}, {name}", value=cell, remedy=remedy)


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text))) and text.isascii() and "_" not in text
    except ValueError:
        return False


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
            sigma=sheet.get("sigma"),
            coherence=sheet.get("coherence"),
            averages=_averages(sheet),
            source=name,
            digest=sheet.digest,
        )


def measured_of(
    response: control.FrequencyResponseData,
    output: str,
    input: str,
    *,
    sigma: Real | None = None,
    coherence: Real | None = None,
    averages: int | None = None,
) -> Measured:
    """One response of `control.FrequencyResponseData`, by its signals' names where it has several.

    Raises ParameterError where it has several and none is of these names, and for what no measurement can be.
    """
    data = np.asarray(response.frdata)
    places = []
    for labels, wanted, size, key in (
        (response.output_labels, output, data.shape[0], "output"),
        (response.input_labels, input, data.shape[1], "input"),
    ):
        if wanted not in labels and size > 1:
            raise ParameterError(key=key, value=wanted, remedy=did_you_mean(wanted, labels))
        places.append(labels.index(wanted) if wanted in labels else 0)
    return Measured(
        output=output,
        input=input,
        omega=np.asarray(response.omega, dtype=float),
        values=data[places[0], places[1]],
        sigma=sigma,
        coherence=coherence,
        averages=averages,
        source=str(response.name),
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
    for name in sheet.names:
        if name not in KNOWN_COLUMNS:
            raise ParameterError(key="header", value=name, remedy=did_you_mean(name.lower(), KNOWN_COLUMNS))
    given = [name for name in FREQUENCIES if name in sheet]
    if len(given) != 1:
        remedy = "one column of frequencies: hz or rad_s"
        raise ParameterError(key="header", value=", ".join(sheet.names), remedy=remedy)
    (name,) = given
    unit, scale = FREQUENCIES[name]
    if sheet.units[sheet.names.index(name)].lower() not in ("", unit.lower()):
        said = sheet.units[sheet.names.index(name)]
        raise ParameterError(key=f"unit of {name}", value=said, remedy=f"{name} is in {unit}")
    frequency = sheet[name]
    sheet.refuse(name, ~(frequency > 0), "a frequency is positive; leave the row out")
    back = np.r_[False, np.diff(frequency) <= 0]
    at = int(back.argmax())
    again = bool(np.any(frequency[:at] == frequency[at]))
    sheet.refuse(name, back, "is there twice; average its rows" if again else "is below the one before; sort the rows")
    return frequency * scale


def _values(sheet: Sheet) -> Complex:
    """The complex response, of whichever two columns there are."""
    given = [pair for pair in VALUE_PAIRS if pair[0] in sheet or (pair[1] in sheet and pair[1] != "deg")]
    if len(given) != 1 or not all(name in sheet for name in given[0]):
        remedy = "one pair of columns for the value: re, im or abs, deg or db, deg"
        raise ParameterError(key="header", value=", ".join(sheet.names), remedy=remedy)
    first, second = (sheet[name] for name in given[0])
    if given[0] == ("re", "im"):
        if "deg" in sheet:
            raise ParameterError(key="header", value="deg", remedy="re and im say it all; leave deg out")
        return np.asarray(first + 1j * second)
    if given[0][0] == "abs":
        sheet.refuse("abs", first < 0, "a magnitude is not negative; is it db?")
    with np.errstate(over="ignore"):
        size = first if given[0][0] == "abs" else 10.0 ** (first / 20)
    return np.asarray(size * np.exp(1j * np.radians(second)))


def _averages(sheet: Sheet) -> int | None:
    """The number of independent averages, which is one for all rows."""
    if "averages" not in sheet:
        return None
    found = sheet["averages"]
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
