"""tfarm export: what it prints and writes, and what it refuses in one line."""

import pytest

import tfarm
from tests.exported.cases import GAINS, IDEAL, LAB, hinf, task_of
from tests.exported.compilers import build, run
from tests.shell import answer, refused

CONTROLLER = ("export", "sasaki2012-lab", "--what", "controller", "--as", "c")
FILES = ["controller.h", "controller.c", "self_test.c", "example.c"]


def test_the_command_writes_what_the_function_does(capsys, tmp_path):
    gains, sizes = ("--K1", "0.3", "--K2", "0.3"), {"hub_rate": 10.0, "root_moment": 2.0, "output": 5.0}
    ranges = [f"--range={name}={size}" for name, size in sizes.items()]
    found = answer(capsys, *CONTROLLER, *gains, "--precision", "q31", *ranges, "--out", str(tmp_path / "a"))
    own = tfarm.export(LAB, GAINS, what="controller", form="c", folder=tmp_path / "b", precision="q31", ranges=sizes)
    assert found["files"] == list(own.files) == FILES
    assert found["verdict"].startswith("stable (certified up to ")
    assert found["noise_gains"] == [{"realisation": "law as given", "gain": 0.0}]
    assert {"name": "root_moment", "identifier": "y_root_moment"} in found["names"]
    for file in FILES:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    header = (tmp_path / "a" / "controller.h").read_text(encoding="ascii")
    for line in ("arm: sasaki2012-lab", "sampling period [s]: 0.01", "certainty: certified to 9.27e+05 rad/s",
                 "phase margin [deg]: 26.15 at 63.4 rad/s, poor", f"SHA-256 of the inputs: {own.sha256}"):  # fmt: skip
        assert f" * {line}\n" in header
    assert "warning" not in header
    assert run(build(tmp_path / "a", "gcc")) == b"0 of 1000 samples differ\n"


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (("--K2", "30"), "law = 'gains at the hub': the sampled loop is not certified stable: unstable ("),
        (("--precision", "q15"), "precision = 'q15': did you mean \"q31\"? known are: double, float, q31"),
        (("--precision", "q31"), "range = 'hub_rate': q31 needs the largest absolute value"),
        (("--range", "hub_rate=x"), "write SIGNAL=VALUE"),
        (("--what", "plant"), "as = 'c': a plant is exported as: fmu, mat, py"),
        (("--as", "fmu", "--what", "loop", "--precision", "q31"), "precision = 'q31': a functional mock-up unit has a"),
        (("--as", "fmu", "--what", "loop", "--K1", "-3"), "the sampled loop is not certified stable: unstable ("),
        (("--as", "fmu", "--what", "tuner"), "as = 'fmu': a tuner is exported as: c"),
    ],
)  # fmt: skip
def test_a_refused_export_leaves_nothing_behind(capsys, tmp_path, options, error):
    assert error in refused(capsys, *CONTROLLER, *options, "--out", str(tmp_path / "new"))
    assert not (tmp_path / "new").exists()


def test_the_hash_is_that_of_arm_law_and_chain():
    def sha(arm=LAB, law=GAINS, chain=IDEAL):
        return task_of((arm, law, chain)).sha256

    faster = tfarm.dsp.Chain(sampling=tfarm.dsp.Sampling(period=0.005))
    others = sha(law=tfarm.HubFeedback(K1=0.3, K2=0.31)), sha(arm=LAB.with_numbers(payload_mass=0.2)), sha(chain=faster)
    assert sha() == sha()
    assert len({sha(), *others}) == 4


@pytest.mark.survey
def test_a_law_of_another_input_is_in_its_unit(tmp_path):
    """A controller of the motor's current, on the file of its arm."""
    arm, law, chain = hinf()
    found = tfarm.export(arm, law, what="controller", form="c", folder=tmp_path, chain=chain, anyway=True)
    assert b" * Output: motor_current [A]\n" in found.contents["controller.h"]
    assert found.details.realisation == "balanced state space"
    gains = {each.realisation: each.gain for each in found.details.noise_gains}
    assert gains["balanced state space"] < gains["law as given"] / 100
