"""Files that end their reader: one line, whatever it does, and no process is left when the command is stopped."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from tests.cli.stops import members
from tests.shared import refusal
from tests.shell import heard, refused
from tfarm.ensemble.space import listing_of
from tfarm.fitting.data import read_measured
from tfarm.fitting.recording import read_recording

DATA = Path(__file__).parent / "data" / "reproductions"
READER = """
import ctypes, os, resource, signal, sys, time
print("a reader that prints")
class UFF:
    def __init__(self, path):
        {}
"""
ENDS = {  # by the body of a reader: the one line
    "ctypes.string_at(0)": "its reader was ended by signal 11",
    "bytearray(5 << 30)": "MemoryError",
    "signal.alarm(1); time.sleep(60)": "its reader takes more than 120 s",
    "raise ValueError(*map(str, [signal.setitimer(signal.ITIMER_REAL, 9)[0] // 10, resource.getrlimit(4)]))":
        "ValueError: ('11.0', '(0, 0)')",
    "sys.exit(3)": "a reader that prints",
    "os._exit(3)": "a reader that prints",
    "raise OSError('two\\nlines\\x07')": "lines\\x07",
}  # fmt: skip


@pytest.fixture
def reader(tmp_path, monkeypatch):
    """Put a package pyuff with that body in the place of the true one, for this process and those that it starts."""

    def place(body):
        (tmp_path / "pyuff.py").write_text(READER.format(body))
        (tmp_path / "sweep.uff").touch()
        monkeypatch.syspath_prepend(tmp_path)
        return tmp_path / "sweep.uff"

    return place


@pytest.mark.parametrize("body", ENDS)
def test_a_reader_that_ends_is_one_line(body, reader, capfd):
    line = str(refusal(read_measured, reader(body), "tip_acceleration", "hub_torque"))
    assert "sweep.uff': no UFF file that can be read: " in line
    assert ENDS[body] in line
    assert capfd.readouterr() == ("", "")


def test_a_mat_file_that_crashes_its_reader_is_one_line(capsys):
    line = refused(capsys, "frf", str(DATA / "segfault.mat"), "--output", "tip_acceleration", "--input", "hub_torque")
    assert "segfault.mat': no .mat file that can be read (up to version 7.2)" in line


def test_sparse_matrices_structures_and_what_is_no_number():
    found = read_recording(DATA / "sparse.mat").signals
    dense = scipy.io.loadmat(DATA / "sparse.mat")
    assert found["hub_torque"].tolist() == dense["hub_torque"].ravel().tolist()
    assert [found[f"acc.{n}"][n - 1] for n in (1, 7)] == [dense["acc"].toarray()[n - 1, n - 1] for n in (1, 7)]


def test_a_record_among_cells_and_objects_is_read(tmp_path):
    t = 0.01 * np.arange(9.0)
    others = {"file": t**2, "cell": np.array([t, "x"], object), "s": {"in": {"t": t}}, "text": ["a", "bc"]}
    scipy.io.savemat(tmp_path / "a.mat", {"t": t, **others})
    assert {name: of.tolist() for name, of in read_recording(tmp_path / "a.mat").signals.items()} == {
        "file": (t**2).tolist(), "s.in.t": t.tolist(),
    }  # fmt: skip


def test_a_list_is_no_device_no_pipe_and_no_endless_line(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "pipe.parquet").symlink_to("/dev/zero")
    for name in ("pipe.csv", "pipe.parquet"):
        assert "is no regular file; give a CSV or Parquet file" in str(refusal(listing_of, tmp_path / name))
    with (tmp_path / "zeros.csv").open("wb") as file:
        file.truncate(3 << 30)
    assert "cannot be read (field larger than field limit" in str(refusal(listing_of, tmp_path / "zeros.csv"))
    os.truncate(tmp_path / "zeros.csv", 5 << 30)
    assert "size in bytes = 5368709120" in str(refusal(listing_of, tmp_path / "zeros.csv"))


@pytest.mark.parametrize("number", ["9" * 5000, "0", "3"])
def test_a_number_of_a_response_that_is_none_is_one_line(number, tmp_path):
    (tmp_path / "sweep.uff").write_text(f"    -1\n    58\n{number}\n    -1\n")
    assert refusal(read_measured, f"{tmp_path / 'sweep.uff'}#{number}", "tip_acceleration", "hub_torque")


def test_a_stopped_command_ends_its_reader(reader):
    """A terminal that is closed is a stop as any other."""
    file = reader("os.write(1, bytes(1)); open(path + '.begun', 'w'); time.sleep(60)")
    command = [sys.executable, "-m", "tfarm", "fit", "sasaki2012-lab", "--free", "hub.inertia", "--data",
               f"tip_acceleration/hub_torque={file}"]  # fmt: skip
    paths = os.pathsep.join([str(file.parent), os.getcwd(), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, start_new_session=True, env=os.environ | {"PYTHONPATH": paths}
    )
    deadline = time.monotonic() + 60
    while not Path(f"{file}.begun").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert len(members(process.pid)) == 2
    process.send_signal(signal.SIGHUP)
    _, err = process.communicate(timeout=30)
    assert (process.returncode, heard(err.decode())) == (128 + signal.SIGHUP, "tfarm: stopped\n")
    while (left := members(process.pid)) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert left == []
