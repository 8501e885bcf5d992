"""The numerical rooms under other kernels of BLAS and NumPy than this machine's own:  make kernels

    python -m tests.kernels                    # every room under every kernel: most of an hour
    python -m tests.kernels tests/reduced      # some of them
    python -m tests.kernels --marked           # the tests marked `kernels` under two: what .ci/run does

OpenBLAS chooses its kernels by the CPU, NumPy its loops, and last bits go with them.  OPENBLAS_CORETYPE and
NPY_DISABLE_CPU_FEATURES choose others.  Kernels that this CPU cannot run are named and skipped.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOMS = [f"tests/{room}" for room in ("exact", "spectrum", "response", "reduced", "loop", "dsp", "tuner")]
CORES = ("Haswell", "SkylakeX", "Zen", "Nehalem", "Prescott")
FEW = ("Haswell", "Prescott")  # one with fused multiply-add and one without, whatever the machine's own is
CHOSEN_BY = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")  # the variables of the environment that choose kernels
PROBE = "import numpy, scipy.linalg; a = numpy.eye(64); scipy.linalg.eigvals(numpy.exp(a) @ a); print(sum(a @ a[0]))"


def variants(cores: tuple[str, ...]) -> dict[str, dict[str, str]]:
    """What is run, and the environment that chooses it; NumPy's loops by the names that this version has."""
    from numpy._core._multiarray_umath import __cpu_dispatch__

    chosen = {f"OpenBLAS {core}": {"OPENBLAS_CORETYPE": core} for core in cores}
    if cores != FEW:
        wide = [name for name in __cpu_dispatch__ if name.startswith("AVX512") or name == "X86_V4"]
        for title, names in (("without AVX512", wide), ("without AVX512, AVX2 and FMA3", list(__cpu_dispatch__))):
            chosen[f"NumPy {title}"] = {"NPY_DISABLE_CPU_FEATURES": " ".join(names)}
    return chosen


def run(chosen: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python under these kernels, and no others that this process's own environment chooses."""
    environment = {name: value for name, value in os.environ.items() if name not in CHOSEN_BY} | chosen
    return subprocess.run([sys.executable, *words], env=environment, capture_output=True, text=True, check=False)


def main(arguments: list[str]) -> int:
    """The number of kernels under which a test failed.  Two are run at a time, each by one process."""
    marked = "--marked" in arguments
    paths = [argument for argument in arguments if argument != "--marked"] or ROOMS
    if marked:  # the other files would only take time to load
        files = (file for path in paths for file in sorted(Path(path).rglob("test_*.py")))
        paths = [str(file) for file in files if "pytest.mark.kernels" in file.read_text(encoding="utf-8")]
    only = ("-m", "kernels and not survey") if marked else ()
    chosen = {
        title: each for title, each in variants(FEW if marked else CORES).items() if run(each, "-c", PROBE).stdout
    }
    print(f"{', '.join(chosen)}; this CPU runs no others", flush=True)
    failed = []
    with ThreadPoolExecutor(2) as pool:
        tests = pool.map(lambda each: run(each, "-m", "pytest", "-q", "-n", "0", *only, *paths), chosen.values())
        for title, done in zip(chosen, tests, strict=True):
            print(f"{title}\n{done.stdout}{done.stderr}", flush=True)
            failed += [title] * bool(done.returncode)
    print(f"{len(chosen)} kernels, " + (f"failures under {', '.join(failed)}" if failed else "none with a failure"))
    return len(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
