"""Pages about laws: their numbers are the commands', their names are text, and bad input is one line."""

import json
import math
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest

import tfarm
from tests.hostile import check_page
from tests.report.written import blocks_of, values_of
from tests.shared import sized
from tests.shell import answer, run
from tfarm import HubFeedback, Law, ParameterError
from tfarm.arm.law_tables import load_law
from tfarm.assessment.card import margins_of
from tfarm.case import Case
from tfarm.dsp import Chain, Simulator, load_chain
from tfarm.dsp.scenarios import Scenario
from tfarm.errors import one_line
from tfarm.fitting.prediction import overshoot
from tfarm.fitting.run_files import load_run
from tfarm.loop.sampled import sampled_loop
from tfarm.report import writing
from tfarm.report.arm_file import file_of
from tfarm.report.loop_section import law_section, margins_section
from tfarm.report.measured_section import measured_runs_section
from tfarm.report.page import ArmReport, GivenLaw
from tfarm.report.sampled_section import sampled_section
from tfarm.report.sections import pieces_of
from tfarm.schema import to_json

LAB, BARE, PRESET = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "quanser-2dsfl"))
DATA = Path(__file__).parent.parent / "data" / "quanser-2dsfl"
HOSTILE = "<script>alert(1)</script> & $x$ \\frac{ \u202e{{7+7}} <evil"
ORDER_8 = f"""[law]
name = {json.dumps(HOSTILE)}
delay = 0.0005
references = ["hub_angle"]
[law.hub_angle]
num = [2.0, 8.0]
den = [0.002, 1.0]
[law.hub_rate]
num = [1.0e-4, 0.02, 1.0]
den = [2.0e-6, 2.8e-3, 1.0]
[law.root_moment]
zeros = [-30.0, [-5.0, 71.0], [-5.0, -71.0], [-20.0, 200.0], [-20.0, -200.0]]
poles = [-60.0, [-50.0, 71.0], [-50.0, -71.0], [-90.0, 200.0], [-90.0, -200.0]]
gain = 0.2
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("laws") / "law.toml"
    path.write_text(ORDER_8, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def given(file):
    law = load_law(file)
    assert law.order == 8
    return (GivenLaw(law, file=file.name),)


def table(section, stem):
    return values_of(blocks_of(section)[stem])


# ------------------------------------------------------------ numbers


@pytest.mark.parametrize("rows", sized([1], [0, 1, 2]), ids=str)
def test_radii_on_the_page_are_those_of_the_command_at_each_delay(capsys, file, given, rows):
    section = sampled_section(ArmReport(LAB, Chain(), given))
    shown = table(section, "sampled-delays")
    for row in rows:
        late = (0.0, 0.5, 1.0)[row]
        found = answer(capsys, "sampled", LAB.name, "--law", str(file), "--delay-samples", str(late))
        assert shown["further_delay_ms"][row] == 10 * late
        assert (shown["verdict"][row], shown["spectral_radius"][row]) == (found["verdict"], found["spectral_radius"])
    assert len(set(shown["verdict"])) == 2  # half a sample more stabilises this one
    assert "Tustin" in law_section(ArmReport(LAB, Chain(), given)).words[0]


def test_the_loop_function_of_an_unstable_loop_has_no_margins(given):
    law = Law({"hub_angle": -5.0, "hub_rate": ([1.0], [0.01, 1.0])}, name="backwards")
    section = margins_section(ArmReport(LAB, Chain(), (GivenLaw(law),)))
    assert margins_of(LAB, law).stability.word == "unstable"
    assert set(blocks_of(section)) == {"law-bode", "margins", "law-spill", "law-windows"}
    assert "interval" not in table(section, "law-windows")


# ------------------------------------------------------------ pages


def test_a_page_of_several_laws_has_the_verdict_of_each_of_their_loops(tmp_path):
    """Continuous-time and sampled, two of them unstable in both; of a controller in z the sampled one alone."""
    gains = [HubFeedback(K1=0.3, K2=0.3), HubFeedback(K1=0.3, K2=1.5), HubFeedback(K1=-0.1, K2=0.3)]
    laws = [*gains, Law({"hub_rate": 0.3}, period=0.01, name="z")]
    page = writing.write([LAB], tmp_path, laws=[tuple(map(GivenLaw, laws))], only=("law",))
    words = re.findall(r'<span class="verdict [\w-]+">(\w+)', page.read_text(encoding="utf-8"))
    verdicts = [tfarm.sampled(LAB, law).verdict for law in laws]
    verdicts += [tfarm.margins(LAB, law).stability for law in gains]
    assert Counter(words) == Counter(each.word for each in verdicts) == {"stable": 3, "unstable": 4}


def test_a_page_is_about_its_law_and_its_file_repeats_it(file, tmp_path, capsys):
    code, out, err = run(
        capsys, "report", LAB.name, "--law", str(file), "--period", "0.004", "--only", "law", "--out", str(tmp_path)
    )
    assert (code, err) == (0, "")
    page = (tmp_path / LAB.name / "law.html").read_text(encoding="utf-8")
    assert out.strip().endswith("law.html")
    check_page(page, one_line(HOSTILE, 60))
    assert "\u202e" not in page  # which would turn the line around
    assert "sampled every 4 ms" in page
    made = tmp_path / LAB.name / "arm.toml"
    assert load_law(made) == load_law(file)
    assert load_chain(made).sampling.period == 0.004
    assert tfarm.load(made) == LAB
    assert HOSTILE.split(" &")[0] in json.loads((tmp_path / LAB.name / "card.json").read_text())["summary"]
    (tmp_path / "again").mkdir()
    assert run(capsys, "report", str(made), "--only", "law", "--out", str(tmp_path / "again"))[0] == 0
    again = (tmp_path / "again" / LAB.name / "law.html").read_text(encoding="utf-8")
    assert again == page.replace(" (law.toml)", "")  # a law of the arm's own file has no other file


def test_gains_typed_are_in_the_file_of_the_page():
    gains = HubFeedback(K1=0.5, K2=-0.1)
    text = file_of(ArmReport(LAB, Chain(), (GivenLaw(gains),)))
    assert "[law.hub_rate]\ngain = 0.5" in text
    assert "[law]" not in file_of(ArmReport(LAB, Chain()))


def test_a_page_of_laws_has_a_section_on_each_and_none_of_the_arms_gains():
    subject = ArmReport(LAB, Chain(), (GivenLaw(Law({"hub_rate": ([1.0], [0.01, 1.0])})),))
    assert [each.page for each in pieces_of(subject) if each.anchor == "law"] == ["law"]
    discrete = ArmReport(LAB, Chain(), (GivenLaw(Law({"hub_rate": 0.3}, period=0.01)),))
    anchors = {each.anchor for each in pieces_of(discrete)}
    assert not anchors & {"margins", "margins-nyquist", "locus", "margins-map", "tune"}
    assert "sampled loop" in law_section(discrete).words[-1]
    held = replace(LAB, hub=tfarm.Hub(inertia=math.inf))
    assert {each.page for each in pieces_of(ArmReport(held, Chain(), subject.laws))} == {"bode", "modes", "assumptions"}


@pytest.mark.parametrize(
    ("text", "typed", "shown"),
    [
        ("[law.hub_spin]\ngain = 1.0\n", (), "hub_spin"),
        ("[law.hub_rate]\nnum = [1.0, 0.0, 0.0]\n", (), "num"),
        ("[law.hub_rate]\ngain = 1.0\n", ("--K1", "0.3"), "--K1"),
        ("[slew]\nrise_time = 1.0\n", (), "[law]"),
        ("[law.hub_rate]\ngain = 1.0\n[measured]\nfile = 'none.csv'\n", (), "none.csv"),
        ("[law.hub_rate]\ngain = 1.0\n[measured]\nfiles = 'x.csv'\n", (), 'unknown key; did you mean "file"?'),
        ("[law.hub_rate]\ngain = 1.0\n[measured]\nfile = 'words.csv'\n", (), "words.csv"),
        ("[law.hub_rate]\ngain = 1.0\n[measured]\nfile = 'other.csv'\n", (), "reference:hub_angle"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(capsys, tmp_path, text, typed, shown):
    (tmp_path / "law.toml").write_text(text)
    (tmp_path / "words.csv").write_text("t,reference:hub_angle,hub_angle\n0,0,0\n1,one,0\n")
    (tmp_path / "other.csv").write_text("time,angle\n" + "".join(f"{n},0\n" for n in range(9)))
    out = tmp_path / "out"
    code, _, err = run(capsys, "report", LAB.name, "--law", str(tmp_path / "law.toml"), *typed, "--out", str(out))
    assert code == 2
    assert err.count("\n") == 1
    assert shown in err
    assert not out.exists()


# ------------------------------------------------------------ a real rig


def real(name):
    return load_law(DATA / f"{name}.toml"), load_run(DATA / f"{name}.toml")


@pytest.mark.parametrize("name", ["lqg", "hinf"])
def test_a_prediction_is_that_of_python_control(name):
    """The sampled plant and the controller's matrices closed by hand, from the first angle, sensors off by offsets."""
    law, measured = real(name)
    mine = tfarm.predict(PRESET, measured.run, Chain())
    count = 8
    start = measured.run.outputs["hub_angle"][0]
    led = measured.run.references["hub_angle"] - start
    off = np.array([mine.offsets["hub_angle"] - start, mine.offsets["root_moment"]])
    A, B, C, D = law.matrices((*law.signals, *law.wanted))
    plant = sampled_loop(Case(PRESET, law, Chain()), count=count).pulse.state_space()
    t = np.arange(led.size) * 0.01
    driving = np.vstack([np.outer(off, np.ones(t.size)), led])
    given = control.forced_response(control.ss(A, -B, C, -D, 0.01), t, driving)
    closed = control.feedback(plant, control.ss(A, B[:, :2], C, D[:, :2], 0.01))
    found = control.forced_response(closed, t, given.outputs).outputs[0] + off[0] + start
    assert abs(mine.predicted[0] - found).max() < 1e-3 * abs(led).max()  # modes beyond the eighth


def test_what_is_measured_and_predicted_of_the_real_controllers():
    chain = load_chain(DATA / "chain.toml")
    for name, (over, end) in {"lqg": (0.40895, 0.04873), "hinf": (4.84993, 0.48027)}.items():  # all of theta11
        measured = real(name)[1].run
        found = tfarm.predict(PRESET, measured, chain)
        reference = measured.references["hub_angle"]
        goal = reference[-1]
        step = goal - reference[0]
        angle = measured.outputs["hub_angle"]
        assert np.degrees(step) == pytest.approx(30.0, abs=1e-5)
        assert 100 * overshoot(angle, step, goal) == pytest.approx(over, abs=1e-3)
        assert np.degrees(angle[-1] - goal) == pytest.approx(end, abs=1e-4)
        on_rig, computed = (row for row in found.rows[:2])
        assert (on_rig.origin, computed.origin) == ("measured", "predicted")
        assert 100 * on_rig.overshoot == pytest.approx(over, abs=1e-3)
        assert computed.rms == pytest.approx(np.sqrt(np.mean((found.predicted[0] - angle) ** 2)))
        for moment in (found.measured[1], found.predicted[1]):
            assert moment[np.flatnonzero(abs(moment) > 0.5)[0]] < 0  # the tip lags behind first, there and here
        # dry friction: no linear change makes the prediction that of the rig, and the page says so
        assert found.residuals[0].white < 1e-9
        assert 0.3 < found.causes[0].removed < 0.75


def test_a_measured_run_is_put_in_the_place_of_the_slew():
    laws = tuple(GivenLaw(*_with_run(name)) for name in ("lqg", "hinf"))
    report = ArmReport(tfarm.load(DATA / "rig.toml"), load_chain(DATA / "rig.toml"), laws)
    section = sampled_section(report)
    assert list(blocks_of(section)) == ["sampled", "sampled-delays", "sampled-modes-law-1", "sampled-modes-law-2"]
    shown = table(section, "sampled-delays")
    assert shown["verdict"] == ["unstable"] * 3 + ["stable"] * 3
    assert shown["further_delay_ms"] == [0.0, 5.0, 10.0] * 2
    assert not section.facts
    grows, shows, ends = (float(x) for x in re.findall(r"([\d.]+) s[.;,]", section.words[0]))
    assert _growth(*real("lqg"), ends) == (pytest.approx(grows, rel=0.005), pytest.approx(shows, rel=0.05))
    runs = measured_runs_section(report)
    blocks = blocks_of(runs)
    assert [stem for stem in blocks if "law-2" in stem] == [
        "measured-law-2", "measured-residuals-law-2", "measured-causes-law-2",
    ]  # fmt: skip
    assert "MIT" in blocks["measured-runs"].caption
    assert "unstable" in runs.answer
    assert "no posterior" in runs.words[1]
    mine = tfarm.predict(report.arm, real("hinf")[1].run, report.chain)
    assert table(runs, "measured-law-2")["rms"] == [row.rms for row in mine.rows]


def _growth(law, measured, ends):
    """Growth [s] by the eigenvalues, and the time [s] at which the hub angle leaves its end, of 24 modes."""
    arm, chain = tfarm.load(DATA / "rig.toml"), load_chain(DATA / "rig.toml")
    reference = measured.run.references["hub_angle"]
    led = np.append(reference, np.full(2800, reference[-1])) - reference[0]
    case = Case(arm, law, chain)
    none = 0 * led
    run = Simulator(case, Scenario("measured", 0.01, none, led, none, none, none), count=24).run().at_samples
    radius = abs(sampled_loop(case, count=24).eigenvalues).max()
    away = abs(run.hub_angle - run.hub_angle[run.t < ends][-1]) > 0.05 * abs(led[-1])
    return 0.01 / np.log(radius), run.t[away & (run.t > ends)][0]


def test_a_posterior_and_the_arm_before_the_fit_are_named_with_the_run(tmp_path):
    for name in ("hinf.toml", "hinf_step_20deg.csv", "orr_controllers.mat"):
        (tmp_path / name).write_bytes((DATA / name).read_bytes())
    (tmp_path / "before.toml").write_bytes((DATA / "rig.toml").read_bytes())
    number = {"key": "hub.friction", "value": 4.0, "low": 3.8, "high": 4.2, "size": 0.0}
    posterior = {
        "format": "tfarm posterior 1", "arm": "rig", "numbers": [number], "covariance": [[6e-4]], "not_determined": [],
    }  # fmt: skip
    (tmp_path / "rig.posterior.json").write_text(json.dumps(posterior))
    law = tmp_path / "hinf.toml"
    text = law.read_text(encoding="utf-8")
    law.write_text(f'{text}posterior = "rig.posterior.json"\nbefore = "before.toml"\n', encoding="utf-8")
    given = GivenLaw(load_law(law), "hinf.toml", load_run(law))
    section = measured_runs_section(ArmReport(tfarm.load(DATA / "rig.toml"), load_chain(DATA / "rig.toml"), (given,)))
    assert "hub.friction = 4.000 (3.800 to 4.200), by the posterior of a fit" in section.words[1]
    assert "before the fit" in table(section, "measured-law")["origin"]
    assert "band of 95 %" in blocks_of(section)["measured-runs"].caption
    law.write_text(f'{text}posterior = "none.json"\n', encoding="utf-8")
    with pytest.raises(ParameterError, match=r"none\.json"):
        load_run(law)


def _with_run(name):
    law, measured = real(name)
    return law, f"{name}.toml", measured


def test_laws_of_one_name_are_numbered_and_a_signal_that_no_arm_has_is_refused():
    two = tuple(GivenLaw(Law({"hub_rate": ([gain], [0.01, 1.0])}, name="PD")) for gain in (0.3, 0.6))
    assert [each.name for each in ArmReport(LAB, Chain(), two).cases] == ["PD", "PD (2)"]
    assert to_json({"rows": law_section(ArmReport(LAB, Chain(), two)).blocks[0]}).count("PD (2)") == 1
    with pytest.raises(ParameterError, match="hub_spin"):
        writing.write([LAB], Path("nowhere"), laws=[(GivenLaw(Law({"hub_spin": 1.0})),)])


# ------------------------------------------------------------ measured responses


FILE = "tests/data/sweep/tip.csv"
GIVEN = f"tip_acceleration/hub_torque={FILE}"


def test_the_page_has_the_command_that_makes_it(tmp_path, capsys):
    given = ("report", "sasaki2012-lab", "--only", "bode", "--measured", GIVEN, "--out", str(tmp_path))
    code, out, _ = run(capsys, *given)
    assert code == 0
    page = (tmp_path / "sasaki2012-lab" / "bode.html").read_text()
    assert out.strip().endswith("bode.html")
    assert f"--measured {GIVEN} --only bode" in page
    assert "Single changes that explain a mode" in page
