"""Every command on an arm with a spring to ground, with a pinned hub, and with a locked one: figures, or the reason."""

import json
import re
from pathlib import Path

import pytest

from tests.shell import run
from tfarm.cli.running import whole_command

PIN = Path("tests/golden/files/pin.toml").read_text(encoding="utf-8")
HUBS = {"pinned": "inertia = 0.0", "locked": "inertia = inf", "spring": "inertia = 0.05\nstiffness = 20.0"}
OF_AN_ARM = {
    "check": "",
    "modes": "--count 3",
    "response": "--output root_moment --omega 1,30",
    "bode": "",
    "reduce": "--outputs root_moment --order 6",
    "poles": "--count 3",
    "margins": "",
    "nyquist": "",
    "nichols": "",
    "sensitivity": "",
    "spill": "",
    "locus": "--vary K1 --from 0 --to 1 --points 3 --branches 2",
    "map": "--K1 -1,3 --K2 -2,2 --points 5",
    "step": "--duration 1",
    "sampled": "--modes 3",
    "simulate": "--scenario decay --duration 0.2 --modes 3",
    "design": "--structure PD",
    "export": "--what plant --as py --out OUT",
    "tune": "--trials 1",
    "compare": "sasaki2012-lab --modes 2",
    "study": "--over payload.mass=uniform:0,0.1 --ask modes --draws 2 --workers 1 --out OUT",
    "fit": "--mode 1=11hz --free link.youngs_modulus --covariance",
    "report": "--only modes --out OUT",
    "assumptions": "",
}
OF_NO_ARM = {"new", "presets", "frf", "ring", "audit", "validate", "glossary", "completion"}
REASONS = {
    "locked": r"hub\.inertia = inf|locked hub",
    "spring": r"spring to ground|paper's",
    "pinned": r"hub\.inertia = 0",
}


def test_every_command_is_among_them():
    assert whole_command().commands.keys() == OF_AN_ARM.keys() | OF_NO_ARM


LIKE_OTHERS = {("report", "pinned"), ("report", "spring"), ("sensitivity", "pinned"), ("nichols", "pinned")}
CASES = [
    pytest.param(command, hub, marks=[pytest.mark.survey] * ((command, hub) in LIKE_OTHERS))
    for command in OF_AN_ARM for hub in HUBS
]  # fmt: skip


@pytest.mark.parametrize(("command", "hub"), CASES)
def test_a_command_has_finite_figures_or_names_the_reason(command, hub, tmp_path, capfd):
    """Exit code 0 and no NaN, or 2 and one line that names what stands against it; never a warning or a traceback."""
    arm = tmp_path / f"{hub}.toml"
    arm.write_text(PIN.replace("inertia = 0.0", HUBS[hub]).replace("free-pin", hub))
    options = [str(tmp_path / "out") if each == "OUT" else each for each in OF_AN_ARM[command].split()]
    as_json = [] if command in ("report", "export") else ["--json"]
    code, out, err = run(capfd, command, str(arm), *options, *as_json)
    assert "Warning" not in err
    if code == 0:
        assert not re.search(r"\bnan\b", out, re.IGNORECASE)
        assert not as_json or json.loads(out)
    else:
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert re.search(REASONS[hub], err)
