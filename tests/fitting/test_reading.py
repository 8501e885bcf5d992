"""Measured responses and records from files: the same however a laboratory writes them, and one line for bad ones."""

import hashlib
import sys

import numpy as np
import pytest
import scipy.io

from tests.shared import refusal
from tfarm.errors import ParameterError
from tfarm.fitting.data import data_of, read_measured
from tfarm.fitting.recording import read_recording

HZ = np.array([1.0, 1.5, 2.25, 40.0])
VALUES = np.array([1.0 + 2.0j, -0.25 - 0.5j, 3.0e-5 - 4.0e-5j, -2.0 + 0.0j])
NAMES = ("tip_acceleration", "hub_angle")


def text(names, columns, separator=",", end="\n", decimal="."):
    rows = [separator.join(f"{x:.17g}".replace(".", decimal) for x in row) for row in zip(*columns, strict=True)]
    return end.join([separator.join(names), *rows, ""])


def polar(decibels=False):
    size = abs(VALUES)
    return 20 * np.log10(size) if decibels else size, np.degrees(np.angle(VALUES))


WRITTEN = {
    "plain": text(("hz", "re", "im"), (HZ, VALUES.real, VALUES.imag)),
    "rad/s": text(("rad_s", "re", "im"), (2 * np.pi * HZ, VALUES.real, VALUES.imag)),
    "abs": text(("hz", "abs", "deg"), (HZ, *polar())),
    "db": text(("deg", "db", "hz"), (polar(True)[1], polar(True)[0], HZ)),
    "excel": "\ufeff" + text(("hz [Hz]", '"re"', "im"), (HZ, VALUES.real, VALUES.imag), ";", "\r\n", ","),
    "comments": "# by hand\n\n" + text(("hz", "re", "im"), (HZ, VALUES.real, VALUES.imag), "\t").replace("\n", "\n#\n"),
}


@pytest.mark.parametrize("how", WRITTEN)
def test_every_way_to_write_a_response_is_the_same_response(how, tmp_path):
    """To rounding: a phase of half a turn in degrees is 4e-16 off, its logarithm by 200 dB times epsilon."""
    path = tmp_path / "sweep.csv"
    path.write_bytes(WRITTEN[how].encode())
    found = data_of(f"tip_acceleration/hub_angle={path}")
    assert (found.output, found.input, found.source) == (*NAMES, str(path))
    assert found.omega == pytest.approx(2 * np.pi * HZ, rel=4e-16)
    assert found.values == pytest.approx(VALUES, rel=1e-14)
    assert found.digest == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (found.sigma, found.coherence, found.averages) == (None, None, None)


def test_coherence_and_sigma_are_read(tmp_path):
    path = tmp_path / "sweep=1.csv"
    path.write_text(text(("hz", "re", "im", "coherence", "averages"), (HZ, *[HZ / 40] * 3, [12] * 4)))
    found = data_of(f"tip_acceleration/hub_angle={path}")
    assert found.coherence.tolist() == (HZ / 40).tolist()
    assert found.averages == 12
    path.write_text(text(("hz", "re", "im", "sigma"), (HZ, *[HZ / 40] * 3)))
    assert read_measured(path, *NAMES).sigma.tolist() == (HZ / 40).tolist()
    path.write_text("hz,re,im,coherence,averages\n1,2,3,0.9,5")
    assert read_measured(path, *NAMES).averages == 5


BAD = {
    "hz,re,im\n1,2,3\n1,2,3": "line 3, hz = 1.0: is there twice",
    "hz,re,im\n# a sweep down\n2,2,3\n1,2,3": "line 4, hz = 1.0: is below the one before; sort the rows",
    "hz,re,im\n0,2,3\n1,2,3": "line 2, hz = 0.0: a frequency is positive",
    "1,2,3\n2,2,3": "header is missing: the first line holds numbers",
    "": "header is missing: the file is empty",
    "hz,re,im": "rows = 0",
    "frequency,re,im\n1,2,3": "header = 'frequency': known are: hz, rad_s",
    "Hz,re,im\n1,2,3": "header = 'Hz': did you mean \"hz\"?",
    "re,im\n1,2": "header = ['re', 'im']: one column of frequencies: hz or rad_s",
    "hz,rad_s,re,im\n1,1,1,2": "one column of frequencies",
    "hz [rad/s],re,im\n1,1,2": "unit of hz = 'rad/s': hz is in Hz",
    "hz,re,im,db\n1,2,3,4": "one pair of columns",
    "hz,re,im,deg\n1,2,3,4": "leave others out",
    "hz,re,re\n1,2,3": "header, column 3 = 're'",
    "hz,re,im\n1,2,x": "line 2, im = 'x': no finite number",
    "hz,re,im\n1,2,1_0": "line 2, im = '1_0'",
    "hz,re,im\n1,2": "line 2 = '1,2': 2 columns where the header names 3",
    "hz,abs,deg\n1,-20,3": "line 2, abs = -20.0: a magnitude is not negative; is it db?",
    "hz,re,im,coherence\n1,2,3,0\n2,2,3,0": "coherence = 0.0: 0 everywhere",
    "hz,re,im\n1,0,0\n2,0,0": "values = 0.0: 0 everywhere: nothing was measured",
    "hz,re,im,coherence\n1,2,3,1.2": "coherence = 1.2: between 0 and 1",
    "hz,re,im,sigma\n1,2,3,0": "sigma = 0.0: a standard deviation is positive",
    "hz,re,im,averages\n1,2,3,2\n2,2,3,4": "line 3, averages = 4.0",
}


@pytest.mark.parametrize("content", BAD)
def test_a_file_that_is_none_is_one_line_with_the_file(content, tmp_path):
    path = tmp_path / "bad.csv"
    path.write_text(content)
    message = str(refusal(read_measured, path, *NAMES))
    assert message.startswith(f"{path}: ")
    assert BAD[content] in message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("sweep.csv", "--data = 'sweep.csv': write OUTPUT/INPUT=FILE"),
        ("tip_acceleration=sweep.csv", "write OUTPUT/INPUT=FILE"),
        ("tip_acceleration/hub_angle=", "write OUTPUT/INPUT=FILE"),
        ("tip_accelerometer/hub_angle=sweep.csv", "output = 'tip_accelerometer': did you mean \"tip_acceleration\"?"),
        ("tip_acceleration/torque=sweep.csv", "input = 'torque'"),
        ("tip_acceleration/hub_angle=/nowhere/sweep.csv", "tip_acceleration/hub_angle = '/nowhere/sweep.csv'"),
        ("tip_acceleration/hub_angle=/", "is a folder"),
    ],
)
def test_a_wrong_option_is_refused(options, message):
    assert message in str(refusal(data_of, options))


def uff(values, start, step, function=4):
    """A data set 58 by the format's own table: complex, double precision, even spacing (4E20.12)."""
    flat = [f"{x:20.12E}" for value in values for x in (value.real, value.imag)]
    body = ["".join(flat[i : i + 4]) for i in range(0, len(flat), 4)]
    place = f"{function:5d}{0:10d}{0:5d}{0:10d} {'NONE':10s}{1:10d}{3:4d} {'NONE':10s}{2:10d}{3:4d}"
    form = f"{6:10d}{len(values):10d}{1:10d}{start:13.5E}{step:13.5E}{0.0:13.5E}"
    axes = [f"{kind:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}" for kind in (18, 12, 13, 0)]
    return "\n".join(["    -1", "    58", *["NONE"] * 5, place, form, *axes, *body, "    -1", ""])


def test_a_uff_file_is_read_and_its_responses_are_chosen_by_number(tmp_path):
    path = tmp_path / "sweep.uff"
    path.write_text(uff(VALUES, 0.0, 0.5))
    found = data_of(f"tip_acceleration/hub_angle={path}")
    assert found.omega == pytest.approx(2 * np.pi * np.array([0.5, 1.0, 1.5]), rel=1e-15)  # without 0 Hz
    assert found.values == pytest.approx(VALUES[1:], rel=1e-12)
    path.write_text(uff(VALUES, 1.0, 0.5) + uff(VALUES, 1.0, 0.5, function=6) + uff(2 * VALUES, 1.0, 0.5))
    assert data_of(f"tip_acceleration/hub_angle={path}#2").values == pytest.approx(2 * VALUES, rel=1e-12)
    for options, message in ((path, "holds 2 responses; choose one"), (f"{path}#3", "data set = 3: from 1 to 2")):
        assert message in str(refusal(data_of, f"tip_acceleration/hub_angle={options}"))


def test_a_uff_file_without_its_package_or_without_a_response_is_one_line(tmp_path, monkeypatch):
    path = tmp_path / "sweep.uff"
    named = f"tip_acceleration/hub_angle={path}"
    path.write_text(uff(VALUES, 1.0, 0.5, function=6))
    assert "holds no frequency response function" in str(refusal(data_of, named))
    path.write_text("    -1\n    58\nNONE\n    -1\n")
    assert "no UFF file that can be read" in str(refusal(data_of, named))
    monkeypatch.setitem(sys.modules, "pyuff", None)
    assert "pip install 'tfarm[uff]', or export the response as CSV" in str(refusal(data_of, named))


ODD = (
    "", "nan", "inf", "1e400", "-1", "1_0", "é", '"', "\0", "1e-320", "9" * 300, "hz", "#", "[", ";", "\t",
    "1;2", "\u2028",
)  # fmt: skip


def test_whatever_is_in_a_file_it_is_read_or_refused_in_one_line(tmp_path):
    """Cells, lines and bytes of a good file changed at random, 300 times: a record or a ParameterError, never more."""
    rng, path, found = np.random.default_rng(6), tmp_path / "odd.csv", 0
    refusals: list[str] = []
    for _ in range(300):
        lines = [line.split(",") for line in text(("hz", "re", "im", "coherence"), (HZ, *[HZ / 40] * 3)).splitlines()]
        for _ in range(rng.integers(1, 3)):
            row = lines[rng.integers(len(lines))]
            row[rng.integers(len(row))] = ODD[rng.integers(len(ODD))]
        content = bytearray("\n".join(map(",".join, lines)).encode())
        if rng.random() < 0.2:
            content[rng.integers(len(content))] = rng.integers(256)
        path.write_bytes(bytes(content))
        for read in (lambda: read_measured(path, *NAMES), lambda: read_recording(path)):
            try:
                read()
                found += 1
            except ParameterError as error:
                refusals.append(str(error))
    assert found > 10
    assert not any("\n" in each for each in refusals)


T = 0.002 * np.arange(50) + 1.0
X, Y = np.sin(T), np.cos(T)


def written(path, names, *columns):
    rows = (",".join(f"{x:.17g}" for x in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join([",".join(names), *rows]))
    return path


def test_csv_and_mat_hold_the_same_record(tmp_path):
    text = written(tmp_path / "a.csv", ("torque", "t [s]", "acc [m/s^2]"), X, T, Y)
    scipy.io.savemat(
        tmp_path / "a.mat", {"time": T, "torque": X[:, None], "both": np.c_[X, Y], "rate": 500, "name": "a"}
    )
    one, other = read_recording(text), read_recording(tmp_path / "a.mat")
    assert (list(one.signals), list(other.signals)) == (["torque", "acc"], ["torque", "both.1", "both.2"])
    for found, name in ((one, "acc"), (other, "both.2")):
        assert found.signal(name, "--signal").tolist() == Y.tolist()
        assert found.times == pytest.approx(T, rel=4e-16)
        assert (found.period, found.note) == (pytest.approx(0.002, rel=1e-13), "")


def test_times_in_few_digits_are_even_and_uneven_sampling_is_noted(tmp_path):
    rounded = read_recording(written(tmp_path / "a.csv", ("t", "x"), np.round(T / 3, 6), X))
    assert rounded.note == ""
    wandering = T + 5e-5 * np.sin(40 * T)
    found = read_recording(written(tmp_path / "b.csv", ("t", "x"), wandering, X))
    assert found.note.startswith("sampled unevenly, by up to")


BAD_RECORDS = {
    "none": (("x", "y"), (X, Y), "t is missing: a record has a column t, in seconds; this one has x, y"),
    "alone": (("t",), (T,), "signals is missing"),
    "dropped": (("t", "x"), (np.delete(T, 20), np.delete(X, 20)), "t of sample 21"),
    "doubled": (("t", "x"), (np.insert(T, 20, T[20]), np.insert(X, 20, 0)), "t of sample 22"),
    "short": (("t", "x"), (T[:7], X[:7]), "samples = 7"),
    "milliseconds": (("t [ms]", "x"), (T, X), "unit of t = 'ms': times are in seconds"),
    "huge": (("t", "x"), (T, np.where(T > 1.05, 1e300, X)), "x, sample 27 = 1e+300: no finite number up to 1e+70"),
    "long": (("t", "x"), (np.where(T > 1.05, 1e300, T), X), "t, sample 27 = 1e+300: no finite number up to 1e+70"),
    "instant": (("t", "x"), (5e-324 * np.arange(50), X), "period of t = 5e-324: times are in seconds"),
}


@pytest.mark.parametrize("what", BAD_RECORDS)
def test_a_record_that_is_none_is_one_line_with_the_file(what, tmp_path):
    names, columns, message = BAD_RECORDS[what]
    path = written(tmp_path / "bad.csv", names, *columns)
    assert str(refusal(read_recording, path)).startswith(f"{path}: {message}")


def test_mat_files_that_are_none_are_one_line(tmp_path):
    path = tmp_path / "bad.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file")
    assert "no .mat file that can be read" in str(refusal(read_recording, path))
    scipy.io.savemat(path, {"t": T, "x": np.where(T > 1.05, np.nan, X)})
    assert "x, sample 27 = nan: no finite number" in str(refusal(read_recording, path))
    assert "record = '/nowhere" in str(refusal(read_recording, "/nowhere/a.mat"))
