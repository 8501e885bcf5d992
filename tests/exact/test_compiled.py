"""Kernels are compiled once, and a line says so."""

import os
import subprocess
import sys

KERNELS = """
from tfarm.exact.compiled import compiled

@compiled
def double(x):
    return 2 * x

@compiled
def triple(x):
    return 3 * x

print(double(1.5), triple(1.5))
"""


def test_the_first_compilation_is_announced_once_and_a_kept_kernel_is_not(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNELS)
    paths = os.pathsep.join([str(tmp_path), os.getcwd()])
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": paths}
    runs = [
        subprocess.run([sys.executable, "-c", "import kernels"], env=environment, capture_output=True, text=True)
        for _ in range(2)
    ]
    assert [run.stdout for run in runs] == ["3.0 4.5\n"] * 2
    assert [run.stderr for run in runs] == ["tfarm: compiling kernels, once (about a minute)\n", ""]
