"""That `make kernels` runs what it says it runs.

The sampler of mutants changes what it says, once.
"""

from pathlib import Path

from tests import kernels

ROOT = Path(__file__).parent.parent


def test_what_is_chosen_is_what_runs() -> None:
    """Where NumPy and SciPy bring their OpenBLAS, the oldest kernels are never a CPU's own; NumPy's loops likewise."""
    own, oldest = kernels.probed({}), kernels.probed({"OPENBLAS_CORETYPE": "Prescott"})
    assert own.count(", ") == 2
    if "no OpenBLAS" not in own:
        assert oldest.split(", ")[:2] != own.split(", ")[:2]
    assert oldest.split(", ")[2] == own.split(", ")[2]
    plain = kernels.probed(kernels.variants(kernels.CORES)["NumPy without AVX512, AVX2 and FMA3"])
    assert plain == ", ".join([*own.split(", ")[:2], "baseline"])
