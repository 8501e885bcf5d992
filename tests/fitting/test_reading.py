"""Measured responses from files: the same however a laboratory writes them, and one line for bad ones."""

import hashlib
import sys

import numpy as np
import pytest

from tests.fitting.uff import data_set as uff
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
