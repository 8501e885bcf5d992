"""--theory on every command that takes an arm, and --side of a joint of two segments."""

from dataclasses import replace

import pytest

import tfarm
from tests.shared import thinned
from tests.shell import answer
from tfarm.arm.reading import PRESETS
from tfarm.arm.writing import to_toml
from tfarm.cli.running import whole_command

VERBS = {  # of those that take an arm, as short as they go; others take long, or a file: the option is one for all
    "modes": ("--count", "2"),
    "response": ("--output", "root_moment", "--omega", "3,70"),
    "poles": ("--count", "3"),
    "margins": (),
    "locus": ("--vary", "K2", "--from", "0", "--to", "0.2", "--points", "3", "--branches", "2"),
    "reduce": ("--order", "4"),
    "sampled": ("--modes", "4"),
    "spill": ("--modes", "3"),
    "simulate": ("--modes", "4", "--duration", "0.05"),
}
ARM = "sasaki2012-lab"


@pytest.fixture(scope="module")
def slender(tmp_path_factory):
    """The same arm as a file with another theory."""
    file = tmp_path_factory.mktemp("theory") / f"{ARM}.toml"
    file.write_bytes(b'theory = "euler-bernoulli"\n' + PRESETS.joinpath(f"{ARM}.toml").read_bytes())
    return str(file)


def test_every_command_that_takes_an_arm_has_the_option():
    commands = whole_command().commands
    takes_arm = {name for name, each in commands.items() if any(p.name in ("arm", "arms") for p in each.params)}
    has_option = {name for name, each in commands.items() if any("--theory" in p.opts for p in each.params)}
    assert takes_arm == has_option
    assert takes_arm > set(VERBS)


@pytest.mark.parametrize("verb", thinned(VERBS, 4))
def test_the_option_does_what_the_files_key_does(verb, slender, capsys):
    """All numbers are those of the file with that theory, and not those of the arm's own."""
    given = answer(capsys, verb, ARM, *VERBS[verb], "--theory", "euler-bernoulli")
    assert given == answer(capsys, verb, slender, *VERBS[verb])
    assert given != answer(capsys, verb, ARM, *VERBS[verb])


@pytest.fixture(scope="module")
def stepped(tmp_path_factory):
    """Two segments of different E I and a mass at their joint."""
    arm = tfarm.load(ARM)
    thick = tfarm.Section.rectangle(width=0.02, depth=0.01)
    inner = replace(arm.link, length=0.4, section=thick, damping=0.0)
    rig = replace(
        arm, link=inner, outer=(replace(arm.link, length=0.6, damping=2e-4),),
        attachments=(tfarm.Attachment(x=0.4, mass=0.3, inertia=2e-3),), name="stepped",
    )  # fmt: skip
    file = tmp_path_factory.mktemp("side") / "stepped.toml"
    file.write_text(to_toml(rig), encoding="utf-8")
    return str(file), rig


@pytest.mark.parametrize(("output", "jump"), [("moment", 2e-3), ("full_moment", 2e-3), ("shear", 0.3)])
def test_a_jump_at_a_joint_is_read_on_the_side_of_the_option(stepped, output, jump, capsys):
    """Newton: what is attached takes m s^2 w of the force, and iota s^2 psi of the moment (with its damping)."""
    file, rig = stepped
    s = -0.4 + 35.0j
    values = (
        answer(capsys, "response", file, "--output", output, "--x", "0.4", "--side", side, "--s", "-0.4+35j")["value"]
        for side in ("outer", "inner")
    )
    outer, inner = (complex(*value[0]) for value in values)
    if output == "shear":
        taken = jump * s**2 * tfarm.transfer(rig, "displacement", x=0.4)(s)
    else:
        taken = jump * s**2 * (tfarm.transfer(rig, "rotation", x=0.4)(s) + tfarm.transfer(rig, "hub_angle")(s))
    felt = 1 + 2e-4 * s if output == "moment" else 1.0  # the outer gauge does not feel its segment's C
    assert outer * felt - inner == pytest.approx(taken, rel=1e-9)
