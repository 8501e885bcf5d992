"""The commands on rigs: every part that the paper's arm does not have, from a file to what is printed."""

import math
from pathlib import Path

import numpy as np
import pytest

import tfarm
from tests import chain_elements
from tests.shell import answer, run

RIGS = {name: f"tests/rigs/{name}.toml" for name in ("bench-rig", "quanser-2dsfl", "quanser-flexlink")}


@pytest.fixture(params=RIGS)
def rig(request):
    return RIGS[request.param]


def test_hub_locked_frequencies_stand_beside_the_free_ones_and_between_them(rig, capsys):
    """Elements of another kind have the same locked hub, and one constraint parts the frequencies (Rayleigh)."""
    found = answer(capsys, "modes", rig, "--count", "4")
    rigid, *flexible = found["modes"]
    free, locked = ([row[key] for row in flexible] for key in ("natural_frequency_rad_s", "hub_locked_rad_s"))
    assert "hub_locked_rad_s" not in rigid
    assert all(low < high for low, high in zip(locked, free, strict=True))
    assert all(low < high for low, high in zip(free, locked[1:], strict=False))
    elements = chain_elements.natural_frequencies(tfarm.load(rig).having(hub_inertia=math.inf), 4)
    np.testing.assert_allclose(locked, elements, rtol=1e-8)
    assert "dry friction" in found["hub_locked_note"]


def test_a_locked_hub_has_digits_as_the_free_one(rig, capsys):
    found = answer(capsys, "modes", rig, "--count", "2", "--digits", "25", "--theory", "rayleigh")
    assert found["theory"] == "rayleigh"
    for row in found["modes"][1:]:
        assert len(row["hub_locked_rad_s"].replace(".", "")) >= 25


def test_what_friction_makes_of_a_rigid_body_is_its_second_eigenvalue(capsys):
    found = answer(capsys, "modes", RIGS["quanser-flexlink"], "--count", "2", "--certify")
    standing, turning = found["modes"][0]["eigenvalues"]
    assert standing == 0 > turning
    (disc,) = found["modes"][0]["discs"]
    assert abs(float(disc["re"]) - turning) <= float(disc["radius"]) + 1e-12 * abs(turning)
    arm = tfarm.load(RIGS["quanser-flexlink"])
    assert found["circuit_eigenvalues"][0] == pytest.approx(-arm.motor.resistance / arm.motor.inductance, rel=0.02)
    _, out, _ = run(capsys, "modes", RIGS["quanser-flexlink"], "--count", "2")
    assert "0 and -18.486" in out
    assert "motor's circuit" in out
    assert "-1/C" not in out


def test_theory_is_the_files_own_unless_another_is_asked_for(capsys, tmp_path):
    file = tmp_path / "rig.toml"
    file.write_text(
        f'theory = "euler-bernoulli"\n{Path(RIGS["bench-rig"]).read_text(encoding="utf-8")}', encoding="utf-8"
    )
    assert answer(capsys, "modes", str(file), "--count", "1")["theory"] == "euler-bernoulli"
    assert answer(capsys, "modes", str(file), "--count", "1", "--theory", "shear")["theory"] == "shear"
