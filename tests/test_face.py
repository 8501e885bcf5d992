import re
import subprocess
import sys
from pathlib import Path

import pytest

import tfarm
from tests.shared import refusal, thinned

HEAVY = ("control", "matplotlib", "matplotlib.pyplot", "sympy", "mpmath",
         "scipy.linalg", "scipy.signal", "scipy.stats", "scipy.optimize")  # fmt: skip


def loaded_after(*codes):
    """The heavy modules that a fresh interpreter has after running each of these, one after the other."""
    names = f"print(*[name for name in {HEAVY!r} if name in sys.modules], sep=',')"
    script = "\n".join(["import sys", *(line for code in codes for line in (code, names))])
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    found = [set(filter(None, line.split(","))) for line in done.stdout.splitlines()]
    return found if len(codes) > 1 else found[0]


QUIETLY = (  # a command that prints JSON
    "from tfarm.cli.running import run; from contextlib import redirect_stdout; from io import StringIO\n"
    "with redirect_stdout(StringIO()): assert run(['modes', 'sasaki2012', '--count', '3', '--json']) == 0\n"
)


@pytest.mark.parametrize(
    "code", thinned(["import tfarm; tfarm.load('sasaki2012'), dir(tfarm)", "import tfarm", QUIETLY], 2)
)
def test_importing_tfarm_and_reading_an_arm_load_nothing_heavy(code):
    assert loaded_after(code) == set()


def test_pictures_load_matplotlib_on_request_and_pyplot_for_own_figures_only():
    """And a process that makes pages loads neither SymPy nor statistics.

    Each takes a second, or half of one: the audit alone wants the first.
    """
    code = "import tfarm; from matplotlib.figure import Figure as F; arm = tfarm.load('sasaki2012');"
    sketched, with_pages = loaded_after(
        f"{code} tfarm.plots.sketch(arm, ax=F().subplots())", "import tfarm.report.writing"
    )
    assert "matplotlib" in sketched
    assert not {"matplotlib.pyplot", "control", "sympy"} & sketched
    assert not {"sympy", "scipy.stats", "scipy.signal", "control"} & with_pages


def test_the_probe_would_notice():
    assert "matplotlib" in loaded_after("import matplotlib")


@pytest.mark.parametrize("name", tfarm.__all__)
def test_every_name_of_the_face_is_there(name):
    assert name in dir(tfarm)
    assert getattr(tfarm, name).__doc__


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'mode'"):
        _ = tfarm.mode


@pytest.mark.parametrize("arm", ["sasaki2012", Path("arm.toml"), None])
def test_a_name_in_the_place_of_an_arm_is_refused_with_what_to_write(arm):
    law = tfarm.HubFeedback(K1=0.3, K2=0.3)
    calls = {"modes": (), "transfer": ("root_moment",), "closed_loop_poles": (law, 3), "margins": (law,),
             "reduce": (["root_moment"],), "fit": ([], ["hub.inertia"]), "step": (law,), "Case": (law,)}  # fmt: skip
    for name, others in calls.items():
        line = str(refusal(getattr(tfarm, name), arm, *others))
        assert re.match(r"arm = .*: is no Arm; give tfarm.load\('[\w.]+'\)", line)
