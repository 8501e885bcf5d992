"""Octave, where it is installed."""

import shutil
import subprocess

import pytest
import scipy.io

OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
ABSENT = "octave is not installed: scripts for MATLAB are not run"
SECONDS = 60  # for a start of Octave of a second, on a machine under load


def left_by_octave(folder, code):
    """The variables that lines of Octave leave, run in a folder, and what they print."""
    if OCTAVE is None:
        pytest.skip(ABSENT)
    (folder / "run_me.m").write_text(
        f"try\n{code}\ncd('{folder}'); save('-v7', 'left.mat');\ncatch error\ndisp(error.message)\nend\n",
        encoding="utf-8",
    )
    (folder / "left.mat").unlink(missing_ok=True)
    call = [OCTAVE, "--no-gui", "--norc", "--no-history", "--quiet", "--eval", f"cd('{folder}'); run_me"]
    done = subprocess.run(call, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert (folder / "left.mat").exists(), done.stdout + done.stderr
    return scipy.io.loadmat(folder / "left.mat", squeeze_me=True), done.stdout
