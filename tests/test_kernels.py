"""That `make kernels` runs what it says it runs."""

import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests import kernels

ROOT = Path(__file__).parent.parent


@pytest.fixture(params=[{}, {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "AVX2"}])
def surroundings(request, monkeypatch):
    """An environment that chooses no kernels, and one that does."""
    for name in kernels.CHOSEN_BY:
        monkeypatch.delenv(name, raising=False)
    for name, value in request.param.items():
        monkeypatch.setenv(name, value)


@pytest.mark.usefixtures("surroundings")
def test_what_is_chosen_is_what_runs() -> None:
    """Where NumPy and SciPy bring their OpenBLAS, the oldest kernels are never a CPU's own; NumPy's loops likewise."""
    own, oldest = kernels.probed({}), kernels.probed({"OPENBLAS_CORETYPE": "Prescott"})
    assert own.count(", ") == 2
    if "no OpenBLAS" not in own:
        assert oldest.split(", ")[:2] != own.split(", ")[:2]
    assert oldest.split(", ")[2] == own.split(", ")[2]
    plain = kernels.probed(kernels.variants(kernels.CORES)["NumPy without AVX512, AVX2 and FMA3"])
    assert plain == ", ".join([*own.split(", ")[:2], "baseline"])


@pytest.mark.usefixtures("surroundings")
def test_a_kernel_that_is_none_is_named_and_skipped(monkeypatch, capsys) -> None:
    """SkylakeX dies of an unknown instruction, Zen is Haswell again, Nehalem has a failing test."""
    what = {"Haswell": "h", "SkylakeX": "exit -4", "Zen": "h", "Nehalem": "n", "Prescott": "p"}
    ran = []

    def run(_, env, **_how):
        core = env.get("OPENBLAS_CORETYPE")
        ran.append(core)
        return SimpleNamespace(returncode=int(core == "Nehalem"), stdout=f"tests under {core}", stderr="")

    monkeypatch.setattr(kernels, "probed", lambda chosen: what.get(chosen.get("OPENBLAS_CORETYPE"), str(chosen)))
    monkeypatch.setattr(kernels.subprocess, "run", run)
    assert kernels.main(["tests/exact"]) == 1
    assert Counter(ran) == {"Haswell": 1, "Nehalem": 1, "Prescott": 1, None: 2}  # two at a time, so in any order
    said = capsys.readouterr().out
    assert "OpenBLAS Nehalem: n\ntests under Nehalem\n" in said
    assert "OpenBLAS SkylakeX: skipped, this CPU cannot run it (exit -4)" in said
    assert "OpenBLAS Zen: skipped, it is h, as OpenBLAS Haswell" in said
    assert "failures under OpenBLAS Nehalem" in said


def test_only_files_with_a_marked_test_are_loaded() -> None:
    """Those that pytest itself chooses by the mark."""
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "--collect-only", "-m", "kernels", "tests/reduced"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    files = {str(Path(file).relative_to(ROOT)) for file in kernels.with_the_mark([str(ROOT / "tests" / "reduced")])}
    assert {line.partition("::")[0] for line in listed if "::" in line} == files
    assert 0 < len(files) < 5
