"""Records over time: the same from CSV and .mat, and one line where the samples are not even."""

import numpy as np
import pytest
import scipy.io

from tfarm.errors import ParameterError
from tfarm.fitting.recording import read_recording

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


def test_times_in_few_digits_are_even_and_a_wandering_clock_is_said(tmp_path):
    rounded = read_recording(written(tmp_path / "a.csv", ("t", "x"), np.round(T / 3, 6), X))
    assert rounded.note == ""
    wandering = T + 5e-5 * np.sin(40 * T)
    found = read_recording(written(tmp_path / "b.csv", ("t", "x"), wandering, X))
    assert found.note.startswith("sampled unevenly, by up to")


BAD = {
    "none": (("x", "y"), (X, Y), "t is missing: a record has a column t, in seconds; this one has x, y"),
    "alone": (("t",), (T,), "signals is missing"),
    "dropped": (("t", "x"), (np.delete(T, 20), np.delete(X, 20)), "t of sample 21"),
    "doubled": (("t", "x"), (np.insert(T, 20, T[20]), np.insert(X, 20, 0)), "t of sample 22"),
    "short": (("t", "x"), (T[:7], X[:7]), "samples = 7"),
    "milliseconds": (("t [ms]", "x"), (T, X), "unit of t = 'ms': times are in seconds"),
}


@pytest.mark.parametrize("what", BAD)
def test_a_record_that_is_none_is_one_line_with_the_file(what, tmp_path):
    names, columns, said = BAD[what]
    path = written(tmp_path / "bad.csv", names, *columns)
    with pytest.raises(ParameterError) as error:
        read_recording(path)
    assert str(error.value).startswith(f"{path}: {said}")


def test_mat_files_that_are_none_are_one_line(tmp_path):
    path = tmp_path / "bad.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file")
    with pytest.raises(ParameterError, match=r"no \.mat file that can be read"):
        read_recording(path)
    scipy.io.savemat(path, {"t": T, "x": np.where(T > 1.05, np.nan, X)})
    with pytest.raises(ParameterError, match="x, sample 27 = nan: no finite number"):
        read_recording(path)
    with pytest.raises(ParameterError, match="record = '/nowhere"):
        read_recording("/nowhere/a.mat")
