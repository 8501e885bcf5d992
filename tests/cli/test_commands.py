"""The commands as a shell sees them: standard output, standard error, exit code."""

import csv
import json
import re
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tfarm
from tests.shell import answer, refused, run
from tfarm.arm.reading import PRESETS


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        (["--s", "0.3+57.1j"], [[0.3, 57.1]]),
        (["--s", "-1+2j,3"], [[-1.0, 2.0], [3.0, 0.0]]),
        (["--omega", "1,10,100"], [[0.0, 1.0], [0.0, 10.0], [0.0, 100.0]]),
        (["--from", "1", "--to", "100", "--points", "3"], [[0.0, 1.0], [0.0, 10.0], [0.0, 100.0]]),
    ],
)
def test_response_json(capsys, points, expected):
    result = answer(capsys, "response", "sasaki2012-lab", "--output", "root_moment", *points)
    assert (result["output"], result["unit"]) == ("root_moment", "N m")
    np.testing.assert_allclose(result["s"], expected)
    G = tfarm.transfer(tfarm.load("sasaki2012-lab"), "root_moment")
    assert [complex(*pair) for pair in result["value"]] == [G(complex(*pair)) for pair in result["s"]]


def test_csv_is_the_same_table(capsys, tmp_path):
    """A file with the usual permissions, and no other."""
    file = tmp_path / "root.csv"
    words = ("response", "sasaki2012", "--output", "root_moment", "--omega", "1,2", "--csv", str(file))
    code, out, err = run(capsys, *words)
    assert (code, err) == (0, f"written: {file}\n")
    value = tfarm.transfer(tfarm.load("sasaki2012"), "root_moment")(2j)
    assert re.search(rf"^largest magnitude +{abs(value):.6g} N m / N m\nat s +0\+2i 1/s$", out, re.MULTILINE)
    header, *rows = csv.reader(file.read_text().splitlines())
    assert header == ["re_s [1/s]", "im_s [1/s]", "re_root_moment [N m / N m]", "im_root_moment [N m / N m]"]
    assert [float(cell) for cell in rows[1]] == [0.0, 2.0, value.real, value.imag]
    assert list(tmp_path.iterdir()) == [file]
    other = tmp_path / "other"
    other.touch()
    assert stat.S_IMODE(file.stat().st_mode) == stat.S_IMODE(other.stat().st_mode)


def test_files_have_all_rows_of_which_a_person_reads_the_first_and_the_last(capsys, tmp_path):
    command = ("response", "sasaki2012", "--points", "1000")
    _, out, _ = run(capsys, *command)
    run(capsys, *command, "--csv", str(tmp_path / "root.csv"))
    _, *rows = csv.reader((tmp_path / "root.csv").read_text().splitlines())
    assert len(rows) == len(answer(capsys, *command)["value"]) == 1000
    *shown, last = out.splitlines()[-42:]
    assert last == "rows left out: 960 of 1000; --csv FILE writes all"
    values = [line.split()[2:] for line in shown if "..." not in line]
    assert values == [row[2:] for row in rows[:20] + rows[-20:]]


def test_presets_are_listed_with_their_assumptions(capsys):
    listed = answer(capsys, "new", "--list")["presets"]
    assert {arm["name"] for arm in listed} == set(tfarm.presets())
    assert all(arm["assumptions"] for arm in listed)
    _, out, _ = run(capsys, "new", "--list")
    assert "2766.7" in out


BENCH = str(Path(__file__).parents[1] / "rigs" / "bench-rig.toml")
BAD = [
    (["modes", "sasaki2021"], 'did you mean "sasaki2012"'),
    (["modes", "sasaki2012", "--count", "0"], "--count = '0'"),
    (["modes", "sasaki2012", "--count", "5_0"], "--count = '5_0'"),
    (["margins", "sasaki2012", "--law="], "--law = '': give a path"),
    (["sampled", "sasaki2012", "--Ts", "0.01"], "Did you mean --period?"),
    (["margins", "sasaki2012", "--period", "0.01"], "tfarm sampled ARM --period 0.01"),
    (["rlocus", "sasaki2012"], 'Did you mean "locus"?'),
    (["lqr", "sasaki2012"], 'Did you mean "design"?'),
    (["damp", "sasaki2012"], 'Did you mean "poles"?'),
    (["c2d", "sasaki2012"], 'Did you mean "sampled"?'),
    (["margin", "sasaki2012"], 'Did you mean "margins"?'),
    (["proof", "audt"], "Did you mean 'audit'?"),
    (["prests"], 'Did you mean "new --list"?'),
    (["proof", "glossry"], "Did you mean 'glossary'?"),
    (["new"], "FILE is missing: give a name that ends with .toml, or --list"),
    (["new", "--list", "my-arm.toml"], "--list writes no file"),
    (["new", "my-arm.toml", "--json"], "a file is written: give --list"),
    (["new", "--presets"], "Did you mean --list?"),
    (["response", "sasaki2012", "--output", "tip"], 'did you mean "tip_displacement"'),
    (["modes", "sasaki2012", "--cuont", "3"], "Possible options: --count"),
    (["modes", "sasaki2012", "--theory", "timo"], "'timoshenko', 'shear', 'rayleigh', 'euler-bernoulli'"),
    (["mode", "sasaki2012"], "Did you mean 'modes'"),
    (["modes"], "ARM"),
    (["modes", "./no-such-file.toml"], "No such file"),
    (["response", "sasaki2012", "--output", "moment"], "x is missing"),
    (["response", "sasaki2012", "--output", "moment", "--x", "3"], "between 0 and 1 m"),
    (["response", "sasaki2012", "--output", "root_moment", "--side", "inner", "--s", "1j"], "has a fixed place"),
    (["response", "sasaki2012", "--output", "moment", "--x", "0.4", "--side", "left", "--s", "1j"], "outer, inner"),
    (["response", "sasaki2012", "--output", "root_moment", "--from", "10", "--to", "1"], "--to = 1.0"),
    (["response", "sasaki2012", "--output", "root_moment", "--from", "0"], "--from = 0.0"),
    (["response", "sasaki2012", "--output", "root_moment", "--s", "abc"], "--s: 'abc': write"),
    (["response", "sasaki2012", "--output", "root_moment", "--s", "1j", "--omega", "1"], "not both"),
    (["response", "sasaki2012", "--output", "hub_angle", "--s", "0"], "rigid body"),
    (["response", "sasaki2012", "--output", "hub_angle", "--s", "1e300j"], "at most 1e+20 1/s"),
    (["response", "sasaki2012", "--output", "root_moment", "--s", "71.50568246689015j"], "a natural frequency"),
    (["response", "sasaki2012", "--output", "root_moment", "--csv", "/no/such/folder/a.csv"], "--csv"),
    (["bode", "sasaki2012-lab", "--K1", "1"], "give --loop too"),
    (["bode", "sasaki2012-lab", "--loop", "--output", "hub_rate"], "the loop function has no output"),
    (["bode", "sasaki2012-lab", "--from", "-1"], "--from = -1.0: a positive frequency"),
    (["margins", "sasaki2012", "--K1", "nan"], "K1 = nan"),
    (["margins", "sasaki2012", "--Kp", "1e30"], "Kp = 1e+30"),
    (["margins", "sasaki2012", "--K1", "much"], "--K1 = 'much'"),
    (["map", "sasaki2012", "--K1", "3,-1"], "'3,-1': write LOW,HIGH"),
    (["map", "sasaki2012", "--K1", "-1e300,1e300"], "at most 1e+150"),
    (["sampled", "sasaki2012", "--period", "0"], "sampling.period = 0.0"),
    (["simulate", "sasaki2012", "--duration", "1e300"], "duration"),
    (["simulate", "sasaki2012", "--dsp", "./nothing.toml"], "No such file"),
    (["design", "sasaki2012", "--objective", "beauty"], "'beauty'"),
    (["design", "sasaki2012", "--K1", "0,1e300"], "K1"),
    (["proof", "assumptions", "sasaki2012", "--count", "many"], "--count = 'many': should be "),
    (["proof", "assumptions", BENCH], "one Timoshenko beam on a hub"),
    (["response", "sasaki2012-lab", "--s", "1j", "--theory", "shear", "--method", "appendix"], "Timoshenko"),
    (["completion", "fsh"], "'fish'"),
    (["step", "sasaki2012-lab", "--figure", "t.pdf", "--csv", "t.pdf"], "two results in one file"),
    (["simulate", "sasaki2012-lab", "--animate", "x.gif", "--figure", "nowhere/a.png"], "is in no folder"),
    (["compare", "sasaki2012"], "compare = '1 arms, 1 laws': give two arms, or one arm and two laws"),
    (["compare", "sasaki2012", "sasaki2012-lab", "stocky-steel"], "'3 arms, 3 laws': give two arms"),
    (["compare", "sasaki2012", "--law", "a.toml"], "does not exist"),
    (["compare", "sasaki2012", "sasaki2012-lab", "--modes", "31"], "1 to 30"),
    (["compare", "sasaki2012", "quanser-2dsfl"], "gains of sasaki2012 are in another unit"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=[" ".join(arguments) for arguments, _ in BAD])
def test_bad_input_is_one_line_and_exit_2(capsys, arguments, message):
    assert message in refused(capsys, *arguments)


OPENED = """
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
opened = []
sys.addaudithook(lambda event, of: opened.append(Path(of[0]).name) if event == "open" and ".toml" in str(of[0]) else 0)
from tfarm.cli.running import run
for line in sys.argv[1:]:
    opened.clear()
    with redirect_stdout(StringIO()):
        assert run(line.split()) == 0
    print(*sorted(name for name in opened if name.startswith("my-")))
"""


def test_a_file_is_read_once_in_a_command(tmp_path):
    """Arm, law and chain of one file are made of what is read of it once."""
    tables = "[sampling]\nperiod = 0.005\n[law.hub_rate]\ngain = 0.3\n"
    (tmp_path / "my-arm.toml").write_text(PRESETS.joinpath("sasaki2012-lab.toml").read_text("utf-8") + tables)
    (tmp_path / "my-law.toml").write_text("[law.hub_rate]\ngain = 0.3\n")
    lines = {
        "margins my-arm.toml": "my-arm.toml",
        "sampled my-arm.toml --law my-law.toml --modes 3": "my-arm.toml my-law.toml",
        "check my-arm.toml": "my-arm.toml",
        "compare sasaki2012 my-arm.toml --law my-law.toml --modes 2": "my-arm.toml my-law.toml",
        "design my-arm.toml --modes 1 --minimise damping": "my-arm.toml",
    }
    words = [sys.executable, "-c", OPENED, *lines]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == list(lines.values())


def test_modes_that_cannot_be_followed_are_listed_with_a_note(capsys, monkeypatch):
    monkeypatch.setattr("tfarm.spectrum.damped.MOST_MODES", 4)
    result = answer(capsys, "modes", "sasaki2012-lab", "--count", "6")
    assert [mode["index"] for mode in result["modes"] if mode["damping_ratio"] is not None] == [0, 1, 2, 3, 4]
    assert len(result["modes"]) == 7
    assert "up to mode 4 only" in result["damped_note"]


def test_a_slip_of_units_is_a_warning_and_no_error(capsys, tmp_path):
    """One line for all of them; the result is that of the file unchanged."""
    text = PRESETS.joinpath("stocky-steel.toml").read_text(encoding="utf-8")
    slips = {"length = 0.5": "length = 500.0", "density = 7850.0": "density = 7.85"}
    for right, slip in slips.items():
        assert right in text
        text = text.replace(right, slip)
    file = tmp_path / "arm.toml"
    file.write_text(text, encoding="utf-8")
    code, out, err = run(capsys, "modes", str(file), "--count", "1", "--json")
    assert code == 0
    assert json.loads(out)["count"] == 1
    assert err.startswith("tfarm: warning: stocky-steel: ")
    assert err.count("\n") == 1
    assert "link.length = 500.0" in err
    assert "link.density = 7.85" in err


@pytest.mark.parametrize("command", ["modes --count 1", "response --output hub_angle --omega 3"])
def test_a_motor_without_an_input_is_named_once(command, capsys, tmp_path):
    """One line with key and remedy, and the answer under hub torque; none where file or option has the input."""
    verb, *options = command.split()
    text = PRESETS.joinpath("quanser-flexlink.toml").read_text(encoding="utf-8")
    silent, named = tmp_path / "silent.toml", tmp_path / "named.toml"
    silent.write_text(text.replace('input = "motor_voltage"', ""), encoding="utf-8")
    named.write_text(text.replace("motor_voltage", "hub_torque"), encoding="utf-8")
    code, out, err = run(capsys, verb, str(silent), *options, "--json")
    expected = "input: not given with a [motor], hub_torque is assumed. Set input to hub_torque, motor_voltage or"
    assert (code, err) == (0, f"tfarm: warning: {silent}: {expected} motor_current at the top of the file.\n")
    assert json.loads(out) == answer(capsys, verb, str(named), *options)
    if verb == "response":
        code, _, err = run(capsys, verb, str(silent), *options, "--input", "motor_voltage")
        assert (code, err) == (0, "")


@pytest.mark.parametrize(
    ("preset", "lines", "command", "expected"),
    [
        (
            "stocky-steel",
            {"youngs_modulus": "1e40"},
            "locus --vary K2 --from 0 --to 0.5 --points 5 --branches 3",
            (3, "python-control cannot follow a model of this arm"),
        ),
        ("sasaki2012-lab", {"damping": "1e-40"}, "sampled --K1 0.3 --K2 0.3 --modes 3", (0, "")),
        (
            "sasaki2012-as-printed",
            {"youngs_modulus": "16.0", "shear_modulus": "1e-40"},
            "reduce --outputs root_moment --order 6",
            (0, ""),
        ),
    ],
)
def test_numbers_that_no_arm_has_end_in_one_line(tmp_path, capsys, preset, lines, command, expected):
    text = (PRESETS / f"{preset}.toml").read_text()
    for key, value in lines.items():
        text = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
    (tmp_path / "odd.toml").write_text(text)
    verb, *options = command.split()
    code, _, err = run(capsys, verb, str(tmp_path / "odd.toml"), *options)
    errors = [line for line in err.splitlines() if line and "warning" not in line and "compiling" not in line]
    assert code == expected[0]
    assert [expected[1] in line for line in errors] == [True] * (expected[0] != 0)
