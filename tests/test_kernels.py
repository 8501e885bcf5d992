"""That a choice of kernels has an effect: `make kernels` relies on it."""

from tests import kernels


def test_numpys_loops_and_openblas_are_those_of_the_environment() -> None:
    """NumPy names its loops; two kernels of OpenBLAS round a product of matrices differently."""
    loops = "from numpy._core._multiarray_umath import __cpu_dispatch__ as all, __cpu_features__ as on"
    plain = kernels.variants(kernels.CORES)["NumPy without AVX512, AVX2 and FMA3"]
    assert kernels.run(plain, "-c", f"{loops}; print([name for name in all if on[name]])").stdout == "[]\n"
    product = "import numpy; a = numpy.random.default_rng(1).normal(size=(200, 200)); print((a @ a).tobytes().hex())"
    found = {core: kernels.run({"OPENBLAS_CORETYPE": core}, "-c", product).stdout for core in kernels.FEW}
    assert found["Prescott"]
    assert found["Prescott"] != found["Haswell"]
