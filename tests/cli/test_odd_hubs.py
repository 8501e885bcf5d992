"""Every command on an arm with a spring to ground, with a pinned hub, and with a locked one: figures, or the reason."""

import json
import re
from pathlib import Path

import pytest

from tests.cli.shortest import OF_AN_ARM
from tests.shell import run
from tfarm.cli.running import commands_of, whole_command

PIN = Path("tests/golden/files/pin.toml").read_text(encoding="utf-8")
HUBS = {"pinned": "inertia = 0.0", "locked": "inertia = inf", "spring": "inertia = 0.05\nstiffness = 20.0"}
OF_NO_ARM = {"new", "frf", "ring", "predict", "proof audit", "proof validate", "proof glossary", "completion"}
REASONS = {
    "locked": r"hub\.inertia = inf|locked hub",
    "spring": r"spring to ground|paper's",
    "pinned": r"hub\.inertia = 0",
}


def test_every_command_is_among_them():
    assert commands_of(whole_command()).keys() == OF_AN_ARM.keys() | OF_NO_ARM


ON_PINNED = ("report", "sensitivity", "nichols", "design")
LIKE_OTHERS = {("report", "spring"), *((command, "pinned") for command in ON_PINNED)}
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
    code, out, err = run(capfd, *command.split(), str(arm), *options, *as_json)
    assert "Warning" not in err
    if code == 0:
        assert not re.search(r"\bnan\b", out, re.IGNORECASE)
        assert not as_json or json.loads(out)
    else:
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert re.search(REASONS[hub], err)
