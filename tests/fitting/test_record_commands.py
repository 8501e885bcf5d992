"""`tfarm frf` and `tfarm ring` from a file to a file, and what they refuse in one line."""

import re

import numpy as np
import pytest
from scipy import signal

from tests.shell import answer, run
from tfarm.fitting.data import data_of

B, A, T = [0.0, 0.5, 0.2], [1.0, -0.8, 0.4], 0.01


@pytest.fixture
def record(tmp_path):
    x = np.random.default_rng(1).standard_normal(1600)
    y = signal.lfilter(B, A, x)
    path = tmp_path / "run.csv"
    rows = (f"{T * n:.2f},{u:.9g},{v:.9g}" for n, (u, v) in enumerate(zip(x, y, strict=True)))
    path.write_text("\n".join(["t,hub_torque,acc1", *rows]))
    return path


NAMED = ("--input", "hub_torque", "--output", "tip_acceleration=acc1")


def test_a_record_becomes_a_file_that_the_other_commands_read(record, tmp_path, capsys):
    save = tmp_path / "sweep.csv"
    code, out, err = run(capsys, "frf", str(record), *NAMED, "--save", str(save))
    assert (code, err) == (0, f"written: {save}\n")
    assert re.search(r"^independent averages +14.2", out, re.MULTILINE)
    data = data_of(f"tip_acceleration/hub_torque={save}")
    found = answer(capsys, "frf", str(record), *NAMED)
    assert [row["hz"] for row in found["response"]] == pytest.approx(list(data.omega / 2 / np.pi), rel=1e-15)
    assert [row["re"] for row in found["response"]] == data.values.real.tolist()
    assert data.coherence.tolist() == [row["coherence"] for row in found["response"]]
    assert data.averages == int(found["independent_averages"])
    H = signal.freqz(B, A, worN=data.omega * T)[1]
    inside = slice(1, 90)
    assert abs(data.values / H - 1)[inside].max() < 0.05  # what hann segments of 200 samples leave of a ring of ten


def test_the_table_is_printed_where_no_file_is_asked_for(record, capsys):
    code, out, _ = run(capsys, "frf", str(record), *NAMED, "--segment", "0.2", "--estimator", "Hv")
    assert code == 0
    table = out[out.index("frequency [Hz]") :].splitlines()
    assert len(table) == 1 + 9
    assert re.search(r"^segments +159$", out, re.MULTILINE)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("frf", "RUN", "--input", "hub_torque", "--output", "tip_acceleration"), "--output = 'tip_acceleration'"),
        (("frf", "RUN", "--input", "torque=hub_torque", "--output", "tip_acceleration=acc1"), "--input = 'torque'"),
        (("frf", "RUN", "--input", "hub_torque", "--output", "tip_acceleration="), "write NAME=COLUMN"),
        (("frf", "RUN", *NAMED, "--segment", "9"), "--segment = 9.0"),
        (("frf", "/nowhere.csv", *NAMED), "does not exist"),
        (("ring", "RUN", "--signal", "acc2"), 'did you mean "acc1"'),
        (("ring", "RUN", "--signal", "acc1", "--from", "20"), "0 samples from 20 to 15.99 s"),
        (("ring", "RUN", "--signal", "acc1", "--modes", "0"), "--modes = '0'"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, said, record, capsys):
    code, out, err = run(capsys, *(str(record) if each == "RUN" else each for each in arguments))
    assert (code, out) == (2, "")
    assert err.startswith("tfarm: ")
    assert len(err.splitlines()) == 1
    assert said in err
