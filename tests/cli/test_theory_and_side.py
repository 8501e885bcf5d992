"""--theory on every command that takes an arm, and --side of a joint of two segments."""

import pytest

import tfarm
from tests.cli.shortest import OF_AN_ARM
from tests.shared import thinned
from tests.shell import answer
from tfarm.arm.reading import PRESETS
from tfarm.cli.running import commands_of, whole_command
from tfarm.exact.outputs import on_side

# others take long, or a file: the option is one for all
VERBS = ("modes", "response", "poles", "margins", "locus", "reduce", "sampled", "spill", "simulate")
ARM, BENCH = "sasaki2012-lab", "tests/rigs/bench-rig.toml"


def test_every_command_that_takes_an_arm_has_the_option():
    commands = commands_of(whole_command())
    takes_arm = {name for name, each in commands.items() if any(p.name in ("arm", "arms") for p in each.params)}
    has_option = {name for name, each in commands.items() if any("--theory" in p.opts for p in each.params)}
    assert takes_arm == has_option
    assert takes_arm > set(VERBS)


@pytest.mark.parametrize("verb", thinned(VERBS, 4))
def test_the_option_does_what_the_files_key_does(verb, tmp_path, capsys):
    """All numbers are those of the file with that theory, and not those of the arm's own."""
    file, options = tmp_path / f"{ARM}.toml", OF_AN_ARM[verb].split()
    file.write_bytes(b'theory = "euler-bernoulli"\n' + PRESETS.joinpath(file.name).read_bytes())
    given = answer(capsys, verb, ARM, *options, "--theory", "euler-bernoulli")
    assert given == answer(capsys, verb, str(file), *options)
    assert given != answer(capsys, verb, ARM, *options)


@pytest.mark.parametrize(("output", "x"), [("strain", 0.06), ("shear", 0.3)])
def test_a_jump_at_a_joint_is_read_on_the_side_of_the_option(output, x, capsys):
    """Strain at a joint of two segments, shear force at a mass; in `tests.exact.test_chain` by another method."""
    values = []
    for side in ("outer", "inner"):
        words = ("--output", output, "--x", str(x), "--side", side, "--s", "-0.4+35j")
        values.append(complex(*answer(capsys, "response", BENCH, *words)["value"][0]))
        assert values[-1] == tfarm.transfer(tfarm.load(BENCH), on_side(output, side), x=x)(-0.4 + 35j)
    assert abs(values[0] / values[1] - 1) > 1e-3
