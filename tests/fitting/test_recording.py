"""Records from files: the same in every format, with units and scales; timing, decimation; one line for bad ones."""

import hashlib
import json
import sys

import numpy as np
import pytest
import scipy.io
from scipy.signal import cont2discrete, dlsim, tf2ss

from tests.fitting.uff import data_set
from tests.shared import refusal
from tests.shell import answer, refused, run
from tfarm.fitting.recording import Recording, decimated, read_recording
from tfarm.fitting.run_files import load_run

T = 0.002 * np.arange(50) + 1.0
X, Y = np.sin(T), np.cos(T)
COLUMNS = {"t": T, "hub_torque [N m]": X, "hub_angle [deg]": Y}


def written(path, names, *columns, separator=",", decimal="."):
    rows = (separator.join(f"{x:.17g}".replace(".", decimal) for x in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join([separator.join(names), *rows]))
    return path


def csv(folder):
    return written(folder / "a.csv", COLUMNS, *COLUMNS.values())


def excel(folder):
    """Semicolons, decimal commas, and a column of texts, quoted numbers among the others."""
    path = written(folder / "a.csv", COLUMNS, *COLUMNS.values(), separator=";", decimal=",")
    first, *lines = path.read_text().splitlines()
    quoted = (";".join(f'"{cell}"' for cell in line.split(";")) for line in lines)
    path.write_text("\r\n".join([f"state;{first}", *(f"IDLE;{line}" for line in quoted)]))
    return path


def mat(folder):
    scipy.io.savemat(folder / "a.mat", {"time": T, "log": {"both": np.c_[X, Y]}})
    return folder / "a.mat"


def hdf5(folder):
    with pytest.importorskip("h5py").File(folder / "a.h5", "w") as file:
        file["run/t"] = T
        file["run/log"] = np.array(list(zip(X, Y, strict=True)), [("u", float), ("name", float)])
        file["run/enc"] = np.c_[X, Y]
        file["run/enc"].attrs["units"] = "deg"
        file["text"] = "by hand"
    return folder / "a.h5"


def parquet(folder):
    arrow = pytest.importorskip("pyarrow")
    enc = arrow.field("hub_angle", arrow.float64(), metadata={"unit": "deg"})
    fields = [arrow.field("t", arrow.float64()), arrow.field("hub_torque [N m]", arrow.float64()), enc]
    table = arrow.table([T, X, Y], schema=arrow.schema(fields)).append_column("state", arrow.array(["IDLE"] * T.size))
    pytest.importorskip("pyarrow.parquet").write_table(table, folder / "a.parquet")
    return folder / "a.parquet"


def uff(folder):
    kinds = {"function": 1, "abscissa": 17}
    sets = [data_set(values, 1.0, 0.002, name=name, unit=unit, **kinds) for values, name, unit in (
        (X, "hub_torque", "Nm"), (Y, "hub_angle", "deg"), (X, "NONE", "NONE"),
    )]  # fmt: skip
    (folder / "a.unv").write_text(data_set(X + 1j * Y, 1.0, 0.5) + "".join(sets))
    return folder / "a.unv"


FORMATS = [
    (csv, ()),
    (excel, ("hub_torque", "hub_angle")),
    (mat, ("hub_torque=log.both.1", "hub_angle=log.both.2[deg]")),
    (hdf5, ("t=run/t", "hub_torque=run/log.u", "hub_angle=run/enc.2")),
    (parquet, ()),
    (uff, ("hub_torque", "hub_angle")),
]


@pytest.mark.parametrize(("write", "signals"), FORMATS)
def test_every_format_holds_the_same_record(write, signals, tmp_path):
    """To the last bit but for UFF, which has 13 digits; degrees are converted."""
    path = write(tmp_path)
    found = read_recording(path, signals)
    assert found.signals.keys() == {"hub_torque", "hub_angle"}
    rel = 1e-12 if write is uff else 4e-16
    assert found.signals["hub_torque"] == pytest.approx(X, rel=rel)
    assert found.signals["hub_angle"] == pytest.approx(Y * np.pi / 180, rel=rel)
    assert found.times == pytest.approx(T, rel=4e-16)
    assert (found.period, found.note) == (pytest.approx(0.002, rel=1e-13), "")
    assert (found.source, found.digest) == (str(path), hashlib.sha256(path.read_bytes()).hexdigest())


def test_columns_of_matrices_and_records_without_a_name(tmp_path):
    scipy.io.savemat(
        tmp_path / "a.mat", {"time": T, "torque": X[:, None], "both": np.c_[X, Y], "rate": 500, "name": "a"}
    )
    found = read_recording(tmp_path / "a.mat")
    assert list(found.signals) == ["torque", "both.1", "both.2"]
    assert found.signals["both.2"].tolist() == Y.tolist()
    assert list(read_recording(uff(tmp_path)).signals) == ["hub_torque", "hub_angle", "signal3"]


CONVERTED = {
    ("x [deg]", "hub_angle=x"): np.pi / 180,
    ("x [°/s]", "hub_rate=x"): np.pi / 180,
    ("x [rpm]", "hub_rate=x"): 2 * np.pi / 60,
    ("x", "hub_angle=x[rev]"): 2 * np.pi,
    ("x [rad]", "hub_angle=x[mrad]"): 1e-3,
    ("x [counts]", "hub_angle=x*-0.00153"): -0.00153,
    ("x", "reference:hub_angle=x*1e-3~1e-4"): 1e-3,
    ("x [mV]", "strain@0.05=x[mV]*2e-3"): 2e-6,
    ("x [mV]", "strain@0.05=x[1]*2e-3"): 2e-3,
    ("x [V]", "root_moment=x*0.5"): 0.5,
    ("x [g]", "tip_acceleration=x"): 9.80665,
    ("x (deg)", "hub_angle=x (deg)"): np.pi / 180,
    ("x (deg) [rad]", "hub_angle=x (deg)"): 1.0,
    ("x (left)", "hub_angle=x (left)"): 1.0,
    ("x [m/s2]", "tip_acceleration=x"): 1.0,
    ("x [m/s²]", "tip_acceleration=x"): 1.0,
    ("x [µm]", "tip_deflection=x"): 1e-6,
    ("x [N·m]", "hub_torque=x"): 1.0,
    ("x [mN m]", "hub_torque=x"): 1e-3,
    ("x [mA]", "motor_current=x"): 1e-3,
    ("x [um/m]", "strain@0.05=x"): 1e-6,
    ("x [mm]", "laser=x"): 1e-3,
    ("hub_angle [deg]", None): np.pi / 180,
    ("laser [mm]", None): 1e-3,
}


@pytest.mark.parametrize(("header", "signal"), CONVERTED)
def test_units_and_scales_are_those_of_their_definitions(header, signal, tmp_path):
    found = read_recording(written(tmp_path / "a.csv", ("t", header), T, X), signal and [signal])
    ((_, values),) = found.signals.items()
    assert values == pytest.approx(CONVERTED[header, signal] * X, rel=1e-15)
    assert list(found.sigma.values()) == ([1e-4] if "~" in str(signal) else [])


def test_times_in_other_units_or_by_a_counter(tmp_path):
    path = written(tmp_path / "a.csv", ("n", "clock [ms]", "x"), np.arange(50), 1e3 * T, X)
    for signal, start in (("t=clock", 1.0), ("t=n*0.002", 0.0), ("time=clock[ms]", 1.0)):
        found = read_recording(path, [signal, "hub_angle=x"])
        assert (found.start, found.period) == (pytest.approx(start), pytest.approx(0.002, rel=1e-12))
        assert list(found.signals) == ["hub_angle"]


def test_a_unit_that_is_unknown_is_refused_where_its_column_is_used(tmp_path):
    found = read_recording(written(tmp_path / "a.csv", ("t", "x [furlong]", "hub_angle"), T, X, Y))
    assert found.signal("hub_angle", "--output").tolist() == Y.tolist()
    text = str(refusal(found.signal, "x", "--output"))
    assert text.startswith("unit of x = 'furlong': known units are: s, ms, us, rad, mrad, deg, rev")
    assert text.endswith("um/m; or give a scale: x=x*NUMBER")


BAD_SIGNALS = {
    ("x [furlong]", "hub_angle=x"): "unit of x = 'furlong': known units are: s, ms",
    ("hub_angle [furlong]", None): "unit of hub_angle = 'furlong': known units are: s, ms",
    ("x [mm]", "hub_angle=x"): "unit of x = 'mm': hub_angle is in rad; or give a scale: hub_angle=x*NUMBER",
    ("hub_angle [mm]", None): "unit of hub_angle = 'mm': hub_angle is in rad",
    ("x", "hub_angle=x[1]"): "unit of x = '1': hub_angle is in rad",
    ("x [deg]", "hub_angle=x*-1"): "unit of x = 'deg': write x[deg]*-1 for SI values times the scale, or x[1]*-1",
    ("x", "hub_angle=y"): "--signal = 'y': known are: t, x",
    ("x", "t=x[deg]"): "unit of x = 'deg': t is in s",
    ("x", "t=clock"): "clock is missing: a record has a column t",
    ("t [min]", None): "header, column 2",
    ("x", ""): "--signal = '': write NAME=COLUMN",
    ("x", "hub_angle="): "write NAME=COLUMN",
    ("x", "hub_angle=x=y~"): "--signal = 'x=y~': known are: t, x",
    ("x", "hub_angle=x*0"): "a scale is a finite number, and not 0",
    ("x", "hub_angle=x*1e999"): "a scale is a finite number",
    ("x", "hub_angle=x~-1"): "a deviation is positive",
}


@pytest.mark.parametrize(("header", "signal"), BAD_SIGNALS)
def test_a_signal_that_is_none_is_one_line(header, signal, tmp_path):
    path = written(tmp_path / "a.csv", ("t", header), T, X)
    assert BAD_SIGNALS[header, signal] in str(refusal(read_recording, path, None if signal is None else [signal]))


def test_an_angle_of_many_turns_without_a_unit_is_asked_for_one(tmp_path):
    path = written(tmp_path / "a.csv", ("t", "x"), T, 120 * X)
    assert "unit of x is missing: its largest value is 106.8" in str(refusal(read_recording, path, ["hub_angle=x"]))
    for unit, size in (("rad", 1.0), ("deg", np.pi / 180)):
        found = read_recording(path, [f"hub_angle=x[{unit}]"])
        assert found.signals["hub_angle"] == pytest.approx(120 * size * X, rel=1e-15)
    assert read_recording(path, ["hub_torque=x"]).count == T.size
    doubled = refusal(read_recording, path, ["hub_torque=x", "hub_torque=x*2"])
    assert "--signal = 'hub_torque': is given twice" in str(doubled)


# ------------------------------------------------------------ timing


def test_times_in_few_digits_are_even_and_uneven_sampling_is_noted(tmp_path):
    rounded = read_recording(written(tmp_path / "a.csv", ("t", "x"), np.round(T / 3, 6), X))
    assert rounded.note == ""
    wandering = T + 5e-5 * np.sin(40 * T)
    found = read_recording(written(tmp_path / "b.csv", ("t", "x"), wandering, X))
    assert found.note.startswith("sampled unevenly, by up to")


GAPS = np.delete(T, [20, 21, 40])
DOUBLED = np.insert(T, [20, 30], T[[20, 30]])
BAD_RECORDS = {
    "none": (("x", "y"), (X, Y), "t is missing: a record has a column t, in seconds; this one has x, y"),
    "alone": (("t",), (T,), "signals is missing"),
    "dropped": (("t", "x"), (GAPS, X[:47]), "t of sample 21 = 1.044: 0.006 s after the one before, where 0.002 s is "
                "usual: 3 samples are missing in 2 gaps; cut the record there (nothing is resampled)"),
    "doubled": (("t", "x"), (DOUBLED, np.r_[X, 0, 0]), "t of sample 22 = 1.04: is that of the sample before too, as of "
                "2 samples: leave doubled ones out"),
    "back": (("t", "x"), (np.where(T > 1.05, T - 0.02, T), X), "t of sample 27 = 1.032: is earlier than the sample "
             "before, at 1.05 s: sort the rows, or cut the record there"),
    "jitter": (("t", "x"), (T + 4e-4 * np.sin(1500 * T), X), "usual: samples are off even ones by up to"),
    "short": (("t", "x"), (T[:7], X[:7]), "samples = 7"),
    "minutes": (("t [min]", "x"), (T, X), "unit of t = 'min': known units are: s, ms, us"),
    "huge": (("t", "x"), (T, np.where(T > 1.05, 1e300, X)), "x, sample 27 = 1e+300: no finite number up to 1e+70"),
    "long": (("t", "x"), (np.where(T > 1.05, 1e300, T), X), "t, sample 27 = 1e+300: no finite number up to 1e+70"),
    "instant": (("t", "x"), (5e-324 * np.arange(50), X), "period of t = 5e-324: times are in seconds"),
    "nan": (("t", "x"), (T, np.where(T > 1.05, np.nan, X)), "line 28, x = 'nan': no finite number"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD_RECORDS)
def test_a_record_that_is_none_is_one_line_with_the_file(what, tmp_path):
    names, columns, message = BAD_RECORDS[what]
    path = written(tmp_path / "bad.csv", names, *columns)
    text = str(refusal(read_recording, path))
    assert text.startswith(f"{path}: ")
    assert message in text


def test_binary_files_that_are_none_are_one_line(tmp_path, monkeypatch):
    path = tmp_path / "bad.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file")
    assert "no .mat file that can be read" in str(refusal(read_recording, path))
    scipy.io.savemat(path, {"t": T, "x": np.where(T > 1.05, np.nan, X)})
    assert "x, sample 27 = nan: no finite number" in str(refusal(read_recording, path))
    for suffix, package, extra in (("mat", "", ""), ("h5", "h5py", "hdf5"), ("parquet", "pyarrow", "study"),
                                   ("uff", "pyuff", "uff")):  # fmt: skip
        assert "record = '/nowhere" in str(refusal(read_recording, f"/nowhere/a.{suffix}"))
        if package:
            (tmp_path / f"a.{suffix}").write_text("t,x")
            monkeypatch.setitem(sys.modules, package, None)
            text = str(refusal(read_recording, tmp_path / f"a.{suffix}"))
            assert f"package = '{package}': is not installed: pip install 'tfarm[{extra}]'" in text


@pytest.mark.parametrize(("package", "suffix"), [("h5py", "h5"), ("pyarrow", "parquet"), ("pyuff", "uff")])
def test_bytes_that_are_no_file_of_their_name_are_one_line(package, suffix, tmp_path):
    pytest.importorskip(package)
    path = tmp_path / f"a.{suffix}"
    for content in (b"", b"\x89HDF\r\n\x1a\n" + bytes(90), b"PAR1" + bytes(90) + b"PAR1", b"    -1\n    58\n"):
        path.write_bytes(content)
        text = str(refusal(read_recording, path))
        assert "file of a record that can be read: " in text or "t is missing" in text


def test_a_record_of_hdf5_shows_no_other_file_and_no_more_than_the_memory(tmp_path):
    h5py = pytest.importorskip("h5py")
    (tmp_path / "secret").write_bytes(T.tobytes())
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = X
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"] = T
        file.create_dataset("raw", (50,), float, external=[(str(tmp_path / "secret"), 0, 400)])
        layout = h5py.VirtualLayout((50,), float)
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", shape=(50,))
        file.create_virtual_dataset("virtual", layout)
        file["link"] = h5py.ExternalLink("other.h5", "x")
    assert "signals is missing" in str(refusal(read_recording, tmp_path / "a.h5"))
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("t", (1 << 30,), float, compression="gzip", chunks=(1 << 20,))
    assert "file of a record that can be read: " in str(refusal(read_recording, tmp_path / "b.h5"))


def test_times_of_a_uff_file_that_differ_are_refused(tmp_path):
    path = tmp_path / "a.uff"
    kinds = {"function": 1, "abscissa": 17}
    path.write_text(data_set(X, 1.0, 0.002, **kinds) + data_set(X, 1.0, 0.004, **kinds))
    assert "ValueError: the times of its record 2 are others than those of the first" in str(
        refusal(read_recording, path)
    )


# ------------------------------------------------------------ decimation


def recorded(period, **signals):
    return Recording(signals=signals, start=3.0, period=period, jitter=0.0, source="made", digest="")


@pytest.mark.parametrize("by", [2, 7, 20])
def test_a_decimation_keeps_what_is_below_and_removes_what_is_beyond_half_the_new_rate(by):
    """Amplitude and phase of sines by least squares at the new times; the gain is within 1e-4 of 1, or of 0."""
    period = 1e-3
    t = 3.0 + period * np.arange(200 * by)
    half = 0.5 / (by * period)
    for share, gain in ((0.0, 1.0), (0.1, 1.0), (0.79, 1.0), (1.01, 0.0), (1.9, 0.0)):
        if share * half < 0.5 / period:
            sine = np.cos(2 * np.pi * share * half * t + 0.3)
            found = decimated(recorded(period, x=sine, y=2 * sine), by)
            expected = np.cos(2 * np.pi * share * half * found.times + 0.3)
            assert abs(found.signals["x"] - gain * expected).max() < 1.1e-4
            assert found.signals["y"].tolist() == (2 * found.signals["x"]).tolist()
    assert found.period == pytest.approx(by * period, rel=1e-15)
    assert found.count == 150
    assert f"of {50 * by + 1} taps (Kaiser) on every signal: gain 1 within 1e-4 up to {0.8 * half:.4g} Hz" in found.note
    assert decimated(recorded(period, x=t), 1).signals["x"].tolist() == t.tolist()


def test_a_held_input_is_decimated_where_it_is_held_and_then_the_model_is_that_of_the_longer_period():
    """An oscillator under an input of a slow controller, by its exact sampled models at both periods.

    Unfiltered samples are those of the slow model to rounding; filtered ones are no answer of it to a filtered input.
    """
    by, period = 10, 1e-3
    system = ([1.0], [1.0, 2.0, 400.0])
    fast, slow = (cont2discrete(tf2ss(*system), each) for each in (period, by * period))
    u = np.repeat(np.random.default_rng(8).standard_normal(300), by)[3:]
    _, y, _ = dlsim(fast, u)
    record = recorded(period, hub_torque=u, hub_angle=y[:, 0])
    found = decimated(record, by, held="hub_torque")
    # the first change of the input, after 7 samples
    assert found.times[0] == pytest.approx(3.007, rel=1e-15)
    *_, states = dlsim(fast, u[: by - 2])
    _, expected, _ = dlsim(slow, found.signals["hub_torque"], x0=states[-1])
    assert found.signals["hub_angle"] == pytest.approx(expected[:, 0], abs=1e-12 * abs(y).max())
    assert found.note == "one sample of 10, without a filter: hub_torque is constant in between"
    filtered = decimated(record, by)
    start = [filtered.signals["hub_angle"][0], np.diff(filtered.signals["hub_angle"][:2])[0] / (by * period)]
    _, wrong, _ = dlsim(slow, filtered.signals["hub_torque"], x0=start)
    assert abs(wrong[:, 0] - filtered.signals["hub_angle"]).max() > 0.05 * abs(y).max()


def test_a_decimation_that_would_be_wrong_is_refused():
    u = np.random.default_rng(8).standard_normal(400)
    record = recorded(1e-3, hub_torque=u, hub_angle=u)
    for by, held, message in (
        (4, "hub_torque", "decimate = 4: hub_torque changes within 4 samples: a filtered input is held no longer"),
        (4, "motor_current", "decimate = 4: needs motor_current, by which the samples"),
        (8, "", "decimate = 8: leaves 0 of 400 samples; at least 8"),
        (0, "", "decimate = 0: a whole number"),
    ):
        assert message in str(refusal(decimated, record, by, held))


def test_a_measured_run_of_a_law_file_names_its_columns(tmp_path):
    written(tmp_path / "a.csv", ("t", "ref [deg]", "enc"), T, X, Y)
    (tmp_path / "law.toml").write_text(
        '[law.hub_rate]\ngain = 1.0\n[measured]\nfile = "a.csv"\n'
        'signals = ["reference:hub_angle=ref", "hub_angle=enc*-0.5"]\n'
    )
    found = load_run(tmp_path / "law.toml").run
    assert found.t == pytest.approx(T - 1.0, abs=1e-15)
    assert found.references["hub_angle"] == pytest.approx(np.radians(X), rel=1e-15)
    assert found.outputs["hub_angle"].tolist() == (-0.5 * Y).tolist()
    assert found.names == ("hub_angle",)
    assert found.law.signals == ("hub_rate",)


def test_commands_read_signals_and_decimate(tmp_path, capsys):
    """A decay of 5 Hz in degrees on a clock in ms, and a response that is a constant by a scale."""
    t = 1e-3 * np.arange(8000)
    ring = np.exp(-0.6 * t) * np.cos(2 * np.pi * 5 * t)
    u = np.random.default_rng(2).standard_normal(t.size)
    path = written(tmp_path / "a.csv", ("ms", "tip [deg]", "u", "acc [g]"), 1e3 * t, ring, u, 2 * u)
    signals = ("--signal", "tip", "--signal", "t=ms[ms]")
    code, out, err = run(capsys, "ring", str(path), *signals, "--decimate", "10", "--json")
    (mode,) = json.loads(out)["modes"]
    assert (code, err.count("\n")) == (0, 1)
    assert err.startswith("tfarm: one sample of 10, after a symmetric FIR filter of 501 taps")
    assert mode["frequency_hz"] == pytest.approx(5.0, rel=1e-6)
    # of what is left of it at the first sample that the filter has neighbours for, 0.25 s
    assert mode["amplitude"] == pytest.approx(np.pi / 180 * np.exp(-0.6 * 0.25), rel=1e-4)
    named = ("--signal", "t=ms*1e-3", "--signal", "tip_acceleration=acc", "--input", "hub_torque=u*0.5")
    response = answer(capsys, "frf", str(path), *named, "--output", "tip_acceleration")["response"]
    assert {round(row["re"], 9) for row in response} == {round(4 * 9.80665, 9)}
    for arguments, message in (
        (("ring", str(path), "--signal", "tip", "--signal", "u"), "--signal = ['tip', 'u']: one signal decays"),
        (("ring", str(path), "--signal", "tip~1"), "--signal = '~1.0': a standard deviation is for runs"),
        (("frf", str(path), "--input", "hub_torque=u", "--output", "hub_angle=tip"), "t is missing: a record has a"),
    ):
        assert message in refused(capsys, *arguments)
