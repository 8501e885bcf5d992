import subprocess
import sys

import pytest

import tfarm

HEAVY = ("control", "matplotlib", "sympy", "scipy.signal")


def loaded_after(code):
    """The heavy modules that a fresh interpreter has after running `code`."""
    script = f"import sys\n{code}\nprint(*[m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.parametrize("code", ["import tfarm", "import tfarm; tfarm.load('sasaki2012'), dir(tfarm)"])
def test_importing_tfarm_and_reading_an_arm_load_nothing_heavy(code):
    assert loaded_after(code) == []


def test_the_probe_would_notice():
    assert "sympy" in loaded_after("import sympy")


@pytest.mark.parametrize("name", tfarm.__all__)
def test_every_name_of_the_face_is_there(name):
    assert name in dir(tfarm)
    assert getattr(tfarm, name).__doc__


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'mode'"):
        _ = tfarm.mode


def test_no_name_of_the_face_is_a_room():
    rooms = {
        "arm",
        "exact",
        "spectrum",
        "response",
        "reduced",
        "loop",
        "dsp",
        "tuner",
        "audit",
        "report",
        "cli",
    }
    assert not rooms & set(tfarm.__all__)
