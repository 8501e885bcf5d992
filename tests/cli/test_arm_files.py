"""`tfarm new` and `tfarm check`: files that load as required, questions on a terminal, and numbers of textbooks."""

import io
import math
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import tfarm
from tests.shell import answer, refused, run
from tfarm.arm.chain import chain_of_tables
from tfarm.arm.materials import materials
from tfarm.arm.schema import arm_of_table
from tfarm.assessment.arm_check import DEFAULTS
from tfarm.cli import arm_files
from tfarm.dsp import Chain

STEEL = ("--material", "steel", "--length", "0.8", "--width", "0.06", "--depth", "0.004", "--hub-inertia", "0.05")
MASS, EI = 7850 * 0.06 * 0.004 * 0.8, 2.1e11 * 0.06 * 0.004**3 / 12  # kg, N m^2


def written(capsys, file, *options):
    """The tables of a file that the command writes."""
    code, out, err = run(capsys, "new", str(file), *options)
    assert (code, out, err) == (0, f"written: {file}; next: tfarm check {file}\n", "")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def test_a_new_file_is_the_arm_of_its_options_whose_sizes_decide_the_shape(capsys, tmp_path):
    file = tmp_path / "my-arm.toml"
    options = ("--payload-mass", "0.2", "--payload-inertia", "1e-4", "--damping", "2e-5", "--period", "0.005")
    tables = written(capsys, file, *STEEL, *options)
    assert tables["sampling"] == {"period": 0.005}
    arm = tfarm.load(file)
    own = tfarm.Link.isotropic(length=0.8, density=7850.0, youngs_modulus=2.1e11, poissons_ratio=0.3, damping=2e-5,
                               section=tfarm.Section.rectangle(width=0.06, depth=0.004))  # fmt: skip
    assert (arm.name, arm.link, arm.hub.inertia) == ("my-arm", own, 0.05)
    assert arm.payload == tfarm.Payload(mass=0.2, inertia=1e-4)
    assert answer(capsys, "modes", str(file), "--count", "1")["modes"][1]["natural_frequency_rad_s"] > 0
    tube = tfarm.Section.tube(outer_diameter=0.02, inner_diameter=0.018)
    for section, *sizes in (
        (tfarm.Section.round(diameter=0.01), "--diameter", "0.01"),
        (tube, "--outer-diameter", "0.02", "--inner-diameter", "0.018"),
    ):
        given = ("--material", "brass", "--length", "0.3", "--hub-inertia", "inf", *sizes, "--force")
        written(capsys, file, *given)
        assert tfarm.load(file).link.section == section


def test_each_line_of_the_file_has_a_comment_and_the_examples_in_it_are_right(capsys, tmp_path):
    file = tmp_path / "c.toml"
    written(capsys, file, *STEEL)
    lines = file.read_text(encoding="utf-8").splitlines()
    bare = [line for line in lines if line and "#" not in line]
    assert bare == ["[link.section]"]
    assert "# material steel: ρ = 7850 kg/m^3, E = 210 GPa, ν = 0.3 (EN 1993-1-1:2005" in "\n".join(lines)
    spare = [line[2:] for line in lines if re.match(r"# (\[|\w+ = )", line)]
    damped = tomllib.loads("\n".join(line.replace("# damping", "damping") for line in lines))
    assert damped["link"]["damping"] == float(spare.pop(0).split()[2])
    top = [line for line in spare if line.startswith(("assumptions", "theory", "input"))]
    own = [line for line in lines if not line.startswith("#")]
    tables = tomllib.loads("\n".join([*top, *own, *spare[len(top) :]]))
    assert set(tables) == {"name", *("assumptions", "theory", "input", "link", "hub", "payload"), *DEFAULTS} - {
        "sampling"
    }
    arm = arm_of_table(tables)
    assert (arm.input, arm.attachments[0].x, arm.gauge.x) == ("motor_voltage", 0.1, 0.02)
    assert chain_of_tables(tables).converters.encoder_counts == 4096


def test_the_damping_ratio_is_that_of_the_damped_mode(capsys, tmp_path):
    """0.5 %: C of E (1 + C s) with -Re s/|s| = 0.005, of a stocky arm too, whose shear is undamped."""
    for name, sizes in {"slender": STEEL, "stocky": (*STEEL[:3], "0.2", *STEEL[4:7], "0.05", *STEEL[8:])}.items():
        file = tmp_path / f"{name}.toml"
        written(capsys, file, *sizes, "--damping-ratio", "0.005")
        damped = tfarm.damped_modes(tfarm.modes(tfarm.load(file), 1))
        assert damped.damping_ratio[-1] == pytest.approx(0.005, rel=2e-3)
        assert answer(capsys, "check", str(file))["damping_ratio"] == pytest.approx(damped.damping_ratio[-1])
    assert "--damping-ratio = 1.5" in refused(capsys, "new", str(tmp_path / "d.toml"), *STEEL, "--damping-ratio", "1.5")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ((), "--material is missing: give the material (steel, spring steel,"),
        (("--material", "gold"), "--material = 'gold': known are: steel, spring steel"),
        (STEEL[:2], "--length is missing: give the length of the link [m]"),
        (STEEL[:4], "--width is missing: give the section: rectangle (--width, --depth), round (--diameter) or tube"),
        (
            STEEL[:6],
            "--depth is missing: give the depth of the section (side of the rectangle in the plane of bending) [m]; on",
        ),
        (
            (*STEEL[:6], "--diameter", "0.1"),
            "--diameter = 0.1: give the sizes of one section: rectangle (--width, --depth)",
        ),
        (STEEL[:8], "--hub-inertia is missing: give the inertia of the hub"),
        ((*STEEL, "--width", "0"), "link.section.width = 0.0: the width is a positive"),
        ((*STEEL, "--length", "-1"), "link.length = -1.0: a length is a positive"),
        ((*STEEL, "--damping", "1e-5", "--damping-ratio", "0.1"), "--damping-ratio = 0.1: give it or --damping"),
        ((*STEEL, "--period", "0"), "sampling.period = 0.0: "),
    ],
)
def test_without_a_terminal_what_is_missing_or_wrong_is_one_line_and_nothing_is_written(
    capsys, tmp_path, options, text
):
    file = tmp_path / "e.toml"
    assert text in refused(capsys, "new", str(file), *options)
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_replaced_only_by_force(capsys, tmp_path):
    file = tmp_path / "f.toml"
    file.write_text("mine")
    assert "exists already; --force replaces it" in refused(capsys, "new", str(file), *STEEL)
    assert "--length" in refused(capsys, "new", str(file), *STEEL, "--force", "--length", "x")
    assert file.read_text() == "mine"
    written(capsys, file, *STEEL, "--force")
    assert "name that ends with .toml" in refused(capsys, "new", str(tmp_path / "sasaki2012"), *STEEL)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_on_a_terminal_it_asks_for_what_is_missing_and_again_where_an_answer_is_no_number(
    capsys, tmp_path, monkeypatch
):
    file = tmp_path / "g.toml"
    monkeypatch.setattr(sys, "stdin", Terminal("\n0.3\ntube\nwide\n0.02\n0.018\n0.05\n"))
    code, out, err = run(capsys, "new", str(file))
    assert (code, out.strip()) == (0, f"written: {file}; next: tfarm check {file}")
    questions = re.findall(r"(length of the link \[m\]|section:|outer diameter|inner diameter|inertia of the hub)", err)
    assert [*dict.fromkeys(questions)] == ["length of the link [m]", "section:", "outer diameter", "inner diameter",
                                       "inertia of the hub"]  # fmt: skip
    arm = tfarm.load(file)
    assert arm.link.section == tfarm.Section.tube(outer_diameter=0.02, inner_diameter=0.018)
    assert (arm.length, arm.link.density, arm.hub.inertia) == (0.3, 7850.0, 0.05)
    # a question without an answer ends the command
    monkeypatch.setattr(sys, "stdin", Terminal("\n0.3\n"))
    code, out, err = run(capsys, "new", str(tmp_path / "h.toml"))
    assert (code, out.strip()) == (130, "")
    assert err.endswith("tfarm: stopped\n")
    assert list(tmp_path.iterdir()) == [file]


def test_help_lists_the_materials_of_the_library():
    _, text = arm_files.link_table.__doc__.split("material: ")
    assert text.split("\n")[0].replace(" or ", ", ").split(", ") == list(materials())


# ------------------------------------------------------------------------------------------------------------- check


def test_check_has_the_numbers_of_a_textbook(capsys, tmp_path):
    """rho A L, J = I_h + rho A L^3/3 + rho I L, L sqrt(12)/d, and the free-hub Euler-Bernoulli frequency.

    The beam (b/L)^2 sqrt(EI/rhoA) on a hub of inertia I_h, hinged at its axis: with r = I_h/(rho A L^3),
    (1 + cos b cosh b) r b^3 + sin b cosh b - cos b sinh b = 0 (e.g. Bellezza, Lanari, Ulivi, 1990, no payload).
    """
    file = tmp_path / "a.toml"
    written(capsys, file, *STEEL)
    found = answer(capsys, "check", str(file))
    assert found["mass_kg"] == pytest.approx(MASS, rel=1e-12)
    assert found["total_inertia_kg_m2"] == pytest.approx(0.05 + MASS * 0.8**2 / 3 + MASS * 0.004**2 / 12, rel=1e-12)
    assert found["slenderness"] == pytest.approx(0.8 * math.sqrt(12) / 0.004, rel=1e-12)
    r = 0.05 / (MASS * 0.8**2)
    b = brentq(
        lambda b: (1 + np.cos(b) * np.cosh(b)) * r * b**3 + np.sin(b) * np.cosh(b) - np.cos(b) * np.sinh(b), 1.9, 4
    )
    omega = b**2 * math.sqrt(EI / (MASS * 0.8**3))
    assert found["euler_bernoulli_rad_s"] == pytest.approx(omega, rel=1e-9)
    assert found["first_frequency_rad_s"] == pytest.approx(omega, rel=1e-4)
    assert found["first_frequency_hz"] == found["first_frequency_rad_s"] / (2 * math.pi)
    assert found["euler_bernoulli_error"] == pytest.approx(omega / found["first_frequency_rad_s"] - 1, rel=1e-6)
    assert 0 < found["euler_bernoulli_error"] < 1e-4
    assert (found["damping_ratio"], found["law"]) == (0.0, [])
    assert found["next_command"] == f"tfarm design {file} --save law.toml"
    # with a locked hub 1.8751^2 sqrt(EI/(rho A L^4)), and no margins to look at
    written(capsys, file, *STEEL[:-1], "inf", "--force")
    found = answer(capsys, "check", str(file))
    assert found["euler_bernoulli_rad_s"] == pytest.approx(1.8751040687**2 * math.sqrt(EI / (MASS * 0.8**3)), rel=1e-9)
    assert (found["total_inertia_kg_m2"], found["next_command"]) == ("inf", f"tfarm modes {file}")


def test_check_lists_missing_tables_with_the_defaults_that_other_commands_use(capsys):
    found = answer(capsys, "check", "sasaki2012-lab")
    missing = {each["name"]: each["text"] for each in found["missing"]}
    assert set(missing) == {f"[{name}]" for name in DEFAULTS} - {"[payload]"}
    sampling = answer(capsys, "sampled", "sasaki2012-lab", "--modes", "4")
    assert missing["[sampling]"].startswith(f"period {sampling['period_s']:g} s, no computational delay")
    usual = Chain()
    assert (usual.sampling.delay_samples, usual.sampling.antialias_corner) == (0.0, math.inf)
    assert usual.is_linear
    assert usual.actuator.hub_damping == 0.0
    assert usual.slew.travel_of(1.0) == 1.15
    assert f"in {usual.slew.rise_time:g} s" in missing["[slew]"]
    given = answer(capsys, "check", "quanser-2dsfl")
    assert not {"[motor]"} & {each["name"] for each in given["missing"]}


def test_check_names_warnings_and_the_controller(capsys, tmp_path):
    file = tmp_path / "rig.toml"
    text = """name = "rig"
[link]
length = 0.2
density = 7.85
youngs_modulus = 2.1e11
poissons_ratio = 0.3
section = { shape = "rectangle", width = 0.03, depth = 0.03 }
[hub]
inertia = 0.01
[motor]
resistance = 2.0
torque_constant = 0.1
[law]
name = "PD"
[law.hub_angle]
num = [1.0, 2.0]
den = [0.01, 1.0]
"""
    file.write_text(text)
    found = answer(capsys, "check", str(file))
    names = [each["name"] for each in found["warnings"]]
    assert names[:2] == ["input", "link.density = 7.85"]
    assert [each.split(" = ")[0] for each in names[2:]] == ["slenderness", "link.damping", "sampling.period"]
    assert found["period_s"] == 0.01
    assert found["law"] == [{"name": "hub_angle", "text": "([1, 2], [0.01, 1])"}]
    _, out, err = run(capsys, "check", str(file))
    assert err == ""
    assert re.search(r"controller\nitem +note\nhub_angle +\(\[1, 2\], \[0\.01, 1\]\)", out)
    file.write_text(text + "[sampling]\nperiod = -1.0\n")
    assert "sampling.period = -1.0" in refused(capsys, "check", str(file))
    file.write_text(text.replace("num", "nun"))
    assert "law.hub_angle.nun" in refused(capsys, "check", str(file))


@pytest.mark.parametrize(("periods", "is_slow"), [(0.49, False), (0.51, True)])
def test_check_prints_period_and_limit_and_warns_of_an_aliased_first_mode(tmp_path, capsys, periods, is_slow):
    """Half the period of the first mode is pi/w: a longer sampling period aliases it."""
    period = periods * 2 * math.pi / 71.505682466890
    file = tmp_path / "arm.toml"
    preset = Path(tfarm.__file__).parent / "arm/presets/sasaki2012-lab.toml"
    limits = f"\n[sampling]\nperiod = {period!r}\n[actuator]\ntorque_limit = 5.0\n"
    file.write_text(preset.read_text() + limits)
    found = answer(capsys, "check", str(file))
    assert (found["period_s"], found["torque_limit"], found["input_unit"]) == (period, 5.0, "N m")
    assert [each["name"].startswith("sampling.period") for each in found["warnings"]] == [True] * is_slow
    assert re.search(r"limit of the input +5 N m\n", run(capsys, "check", str(file))[1])


PHYSICS = "[gravity]\ng = 9.81\n", "[hub]\ncoulomb_friction = 0.1\n", "[actuator]\nbacklash = 0.1\n"


@pytest.mark.parametrize("text", PHYSICS)
def test_physics_that_is_left_out_is_called_not_modelled(tmp_path, capsys, text):
    file = tmp_path / "arm.toml"
    preset = (Path(tfarm.__file__).parent / "arm/presets/sasaki2012-lab.toml").read_text()
    head = text.partition("\n")[0]
    file.write_text(preset.replace(f"{head}\n", text) if head in preset else preset + text)
    assert ": not modelled: " in refused(capsys, "check", str(file))


@pytest.mark.parametrize("name", tfarm.presets())
def test_check_of_a_preset_has_its_first_mode(capsys, name):
    found = answer(capsys, "check", name, "--theory", "euler-bernoulli")
    assert found["euler_bernoulli_error"] == 0.0
    assert found["theory"] == "euler-bernoulli"
    first = float(tfarm.modes(tfarm.load(name), 1).natural_frequency[-1])
    assert answer(capsys, "check", name)["first_frequency_rad_s"] == first
