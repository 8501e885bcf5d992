"""Kernels are compiled once, and a line says so; those without an entry for Python refuse to be called from it."""

import os
import subprocess
import sys

import pytest

from tfarm.exact.compiled import inlined, python_of

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
    assert [run.stderr for run in runs] == ["tfarm: compiling kernels, once (about half a minute)\n", ""]


def test_an_inlined_kernel_refuses_python_where_it_would_call_a_null_pointer():
    half = inlined(lambda x: 0.5 * x)
    with pytest.raises(TypeError, match="called by kernels alone"):
        half(3.0)
    assert python_of(half)(3.0) == 1.5
