"""Runs by the words of the command line: open and closed loops, periods, and laws that did not run."""

import numpy as np
import pytest
from scipy.signal import lfilter

import tfarm
from tests.fitting.test_recording import written
from tests.shared import refusal
from tfarm.cli.options import runs_of_options
from tfarm.fitting.run_files import runs_of, unexplained

LAB = tfarm.load("sasaki2012-lab")
T, N = 0.01, 1500
NUM, DEN = [3.0, -2.9], [1.0, -0.8]
LAW = """[law]
period = {period}
references = ["hub_angle"]
[law.hub_angle]
num = [3.0, -2.9]
den = [1.0, -0.8]
[law.root_moment]
gain = {gain}
"""


def record(folder, late=0, limit=np.inf, cut=0, period=T, bias=0.0):
    """A run under the law, of smooth noise as its signals: by SciPy's filter, from a state that is not at rest."""
    rng = np.random.default_rng(4)
    theta, moment, reference = (lfilter([0.1], [1.0, -0.9], rng.standard_normal(N)) for _ in range(3))
    u = -lfilter(NUM, DEN, theta - reference) - 0.4 * moment
    u = np.clip(np.r_[np.zeros(late), u][:N] + bias, -limit, limit)
    names = ("t", "reference:hub_angle", "hub_angle [deg]", "root_moment", "hub_torque", "note")
    columns = (period * np.arange(N), reference, np.degrees(theta), moment, u, u)
    return written(folder / "run=1.csv", names, *(each[cut:] for each in columns)), columns


def law(folder, period=T, gain=0.4):
    (folder / "law.toml").write_text(LAW.format(period=period, gain=gain))
    return folder / "law.toml"


def test_a_record_in_open_loop_and_one_under_its_law(tmp_path):
    path, (_, reference, degrees, moment, u, _) = record(tmp_path)
    signals = ["hub_angle~1e-4", "root_moment", "hub_torque", "reference:hub_angle"]
    one, other = runs_of_options(LAB, run=[str(path), f"{path}={law(tmp_path)}"], signal=signals, decimate=1)
    assert one.law is None
    assert not one.references
    assert other.law.period == T
    assert other.references["hub_angle"].tolist() == reference.tolist()
    for run in (one, other):
        assert run.names == ("hub_angle", "root_moment")
        assert run.outputs["hub_angle"] == pytest.approx(np.radians(degrees), rel=1e-15)
        assert run.outputs["root_moment"].tolist() == moment.tolist()
        assert run.input.tolist() == u.tolist()
        assert (run.sigma, run.period, run.source) == ({"hub_angle": 1e-4}, pytest.approx(T), str(path))
    assert runs_of_options(LAB) == []


@pytest.mark.parametrize("how", [{}, {"late": 1, "bias": 0.3}, {"cut": 700, "late": 2}, {"limit": 0.6}])
def test_the_law_that_was_running_explains_its_input_and_no_other_does(how, tmp_path):
    """Whatever delay, bias, first state and limit of the rig; half the gain of a signal, or a sign, does not."""
    path, _ = record(tmp_path, **how)
    assert runs_of([f"{path}={law(tmp_path)}"], LAB)[0].law is not None
    wrong = f"{path}={law(tmp_path, gain=-1.6)}"
    assert "law.toml': driven by the record's hub_angle, root_moment it leaves" in str(refusal(runs_of, [wrong], LAB))
    in_degrees = ["hub_angle=hub_angle[rad]", "root_moment", "hub_torque", "reference:hub_angle"]
    assert "% of" in str(refusal(runs_of, [f"{path}={law(tmp_path)}"], LAB, in_degrees))
    # of which the record shows less
    assert runs_of([wrong], LAB, ["hub_angle=root_moment*1", "hub_torque"])[0].references == {}


def test_a_law_is_left_nothing_of_its_own_input_whatever_its_first_state():
    """A slow pole whose first state is all but the whole input, by SciPy's filter, two samples late: to rounding."""
    y = np.random.default_rng(5).standard_normal(400)
    u, _ = lfilter([0.5, -0.2], [1.0, -0.99], y, zi=[80.0])
    slow = tfarm.Law({"hub_angle": ([0.5, -0.2], [1.0, -0.99])}, period=T)
    assert unexplained(slow, y[None], np.r_[7.0, 3.0, -u[:-2]] + 4.0) == pytest.approx(0.0, abs=1e-12)
    assert unexplained(slow, -y[None], np.r_[7.0, 3.0, -u[:-2]] + 4.0) > 0.05


@pytest.mark.parametrize("share", [1.0, 3.0, 1.0005, 0.5, 1.5])
def test_the_period_of_a_law_is_a_multiple_of_that_of_its_record(share, tmp_path):
    path, _ = record(tmp_path)
    text = f"{path}={law(tmp_path, period=share * T)}"
    if share in (0.5, 1.5):
        message = f"record = '0.01 s': is sampled every 0.01 s, and the law of {tmp_path}/law.toml every {share * T} s"
        assert message in str(refusal(runs_of, [text], LAB))
    else:
        assert runs_of([text], LAB)[0].law.period == share * T


def test_a_law_in_s_is_checked_by_its_rule_at_the_period_of_the_record(tmp_path):
    """The law of the record by the inverse of Tustin's rule, z = (1 + s T/2)/(1 - s T/2)."""
    path, _ = record(tmp_path)
    (file := tmp_path / "s.toml").write_text(
        'law = { references = ["hub_angle"], root_moment = { gain = 0.4 }, '
        f"hub_angle = {{ num = [{5.9 * T / 2}, 0.1], den = [{1.8 * T / 2}, 0.2] }} }}"
    )
    assert runs_of([f"{path}={file}"], LAB)[0].law.period is None
    file.write_text(file.read_text().replace(", 0.1]", ", -0.1]").replace("0.4", "-0.4"))
    assert "of 50 % at most: another law was running" in str(refusal(runs_of, [f"{path}={file}"], LAB))


def test_runs_are_decimated_where_their_input_is_held(tmp_path):
    u = np.repeat([0.0, 1.0, -1.0, 0.5, 0.2, 0.1, 0.7, 0.3, 1.0], 5)
    path = written(tmp_path / "a.csv", ("t", "hub_torque", "hub_angle"), 1e-3 * np.arange(45), u, np.arange(45.0))
    (run,) = runs_of([str(path)], LAB, decimate=5)
    assert run.outputs["hub_angle"].tolist() == np.arange(0.0, 45.0, 5.0).tolist()
    assert run.period == pytest.approx(5e-3)
    assert run.note == "one sample of 5, without a filter: hub_torque is constant in between"
    message = str(refusal(runs_of, [str(path)], LAB, (), 2))
    assert f"{path}: decimate = 2: hub_torque changes within 2 samples" in message


BAD_RUNS = {
    "=law.toml": "--run = '=law.toml': write FILE, or FILE=LAW.toml",
    "RUN=/nowhere.toml": "/nowhere.toml",
    "RUN=EMPTY.toml": "law is missing: give the file of the controller that was running",
    "/nowhere.csv": "record = '/nowhere.csv': cannot be read",
}


@pytest.mark.parametrize("text", BAD_RUNS)
def test_a_run_that_is_none_is_one_line(text, tmp_path):
    path, _ = record(tmp_path)
    (tmp_path / "empty.toml").write_text("")
    text_of = text.replace("RUN", str(path)).replace("EMPTY", str(tmp_path / "empty"))
    assert BAD_RUNS[text] in str(refusal(runs_of, [text_of], LAB))


def test_signals_of_runs_are_those_of_an_arm(tmp_path):
    path, _ = record(tmp_path)
    for signal, message in (
        ("hub_angel=hub_angle", "--signal = 'hub_angel': did you mean \"hub_angle\"?"),
        ("hub_angle", "input is missing: an open loop has its commanded input"),
        ("hub_torque~1", "record = "),
    ):
        assert message in str(refusal(runs_of, [str(path)], LAB, [signal]))
    text = str(refusal(runs_of_options, LAB, signal=["hub_angle"]))
    assert text == "--signal = ['hub_angle']: is of a record: give --run too"
