"""Each kernel is compiled once: after a full report and the usual commands it has one signature a number type."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from tests.exact.signatures import compiled_twice
from tfarm.exact.compiled import compiled, inlined

SAVE = "import sys; from pathlib import Path; from tests.exact.signatures import save; save(Path(sys.argv[1]))"


def test_a_report_and_the_usual_commands_have_one_signature_a_kernel(pages):
    assert json.loads(pages.with_suffix(".signatures").read_text()) == {}


@pytest.mark.survey
def test_from_an_empty_cache_kernels_of_kernels_have_one_too(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", SAVE, str(tmp_path / "found")], env=environment, check=True)
    assert json.loads((tmp_path / "found").read_text()) == {}


def summed(values, power):
    return (values**power).sum()


def test_layouts_and_flags_are_seen_number_types_and_constants_are_not(monkeypatch, tmp_path):
    monkeypatch.setattr("tfarm.exact.compiled._CACHE", tmp_path)  # a kernel of a test cannot be read again
    monkeypatch.setattr(summed, "__module__", "tfarm.tests")
    kernel, inner = compiled(summed), inlined(summed)
    outer = compiled(lambda values: inner(values, 2) + inner(values, 3))
    values = np.ones((3, 2))
    assert [kernel(values, 2), kernel(values * 1j, 2), outer(values)] == [6.0, -6.0, 12.0]
    assert [len(each.signatures) for each in (kernel, inner)] == [2, 1]
    assert "tfarm.tests.summed" not in compiled_twice(kernel)
    kernel(values.T, 2)
    assert len(compiled_twice(kernel)["tfarm.tests.summed"]) == 3
