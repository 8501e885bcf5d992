"""The numerical rooms under other kernels of BLAS and NumPy than this machine's own:  make kernels

    python -m tests.kernels                    # every room under every kernel: most of an hour
    python -m tests.kernels tests/reduced      # some of them
    python -m tests.kernels --marked           # the tests marked `kernels` under two: what .ci/run does

OpenBLAS chooses its kernels by the CPU, NumPy its loops, and last bits go with them.  OPENBLAS_CORETYPE and
NPY_DISABLE_CPU_FEATURES choose others.  What a kernel really is, is asked of both copies of OpenBLAS, NumPy's and
SciPy's: one that this CPU cannot run, or that turns out to be another one's, is named and skipped.
"""

import ctypes
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOMS = [f"tests/{room}" for room in ("exact", "spectrum", "response", "reduced", "loop", "dsp", "tuner")]
CORES = ("Haswell", "SkylakeX", "Zen", "Nehalem", "Prescott")
FEW = ("Haswell", "Prescott")  # one with fused multiply-add and one without, whatever the machine's own is
CHOSEN_BY = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")  # the variables of the environment that choose kernels
NAMES = ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename")


def kernels_in_use() -> tuple[str, ...]:
    """What NumPy's OpenBLAS, SciPy's, and NumPy itself run on in this process, after some work of each."""
    import numpy as np
    import scipy
    import scipy.linalg
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    a = np.eye(64) + np.arange(4096.0).reshape(64, 64) % 7
    np.linalg.eigvals(a @ a), scipy.linalg.eigvals(a), np.exp(a)
    cores = []
    for package in (np, scipy):
        folder = Path(package.__file__).parent
        found = [core_of(path) for path in folder.parent.glob(f"{folder.name}.libs/*openblas*")]
        cores.append(next(iter(found), "no OpenBLAS of its own"))
    return *cores, "+".join(name for name in __cpu_dispatch__ if __cpu_features__[name]) or "baseline"


def core_of(path: Path) -> str:
    """The name that a copy of OpenBLAS gives its kernels."""
    library = ctypes.CDLL(str(path))
    for name in NAMES:
        if hasattr(library, name):
            getattr(library, name).restype = ctypes.c_char_p
            return getattr(library, name)().decode()
    return "a nameless OpenBLAS"


def variants(cores: tuple[str, ...]) -> dict[str, dict[str, str]]:
    """What is run, and the environment that chooses it.

    NumPy takes only names that it has loops of its own for, and they change with its version (AVX2 and FMA3 are X86_V3
    since 2.4), so those it has are asked for.
    """
    from numpy._core._multiarray_umath import __cpu_dispatch__

    chosen = {f"OpenBLAS {core}": {"OPENBLAS_CORETYPE": core} for core in cores}
    if cores != FEW:
        wide = [name for name in __cpu_dispatch__ if name.startswith("AVX512") or name == "X86_V4"]
        for title, names in (("without AVX512", wide), ("without AVX512, AVX2 and FMA3", list(__cpu_dispatch__))):
            chosen[f"NumPy {title}"] = {"NPY_DISABLE_CPU_FEATURES": " ".join(names)}
    return chosen


def environment_with(chosen: dict[str, str]) -> dict[str, str]:
    """This process's environment with those variables, and without any other choice of kernels that it has itself."""
    return {name: value for name, value in os.environ.items() if name not in CHOSEN_BY} | chosen


def probed(environment: dict[str, str]) -> str:
    """`kernels_in_use` of a process with that environment, or the signal that ended it: an instruction unknown here."""
    script = "from tests.kernels import kernels_in_use; print(*kernels_in_use(), sep=', ')"
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, env=environment_with(environment), capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else f"exit {done.returncode}"


def with_the_mark(paths: list[str]) -> list[str]:
    """The files of tests in those folders with one marked `kernels`: the others would only take time to load."""
    files = [file for path in paths for file in sorted(Path(path).rglob("test_*.py"))]
    return [str(file) for file in files if "pytest.mark.kernels" in file.read_text(encoding="utf-8")]


def main(arguments: list[str]) -> int:
    """The number of kernels under which a test failed.  Two are run at a time, each by one process."""
    marked, seen = "--marked" in arguments, {}
    paths = [argument for argument in arguments if argument != "--marked"] or ROOMS
    paths = with_the_mark(paths) if marked else paths
    only = ("-m", "kernels and not survey") if marked else ()
    pytest = [sys.executable, "-m", "pytest", "-q", "-n", "0", *only, *paths]
    print(f"own: {probed({})}", flush=True)
    for title, environment in variants(FEW if marked else CORES).items():
        what = probed(environment)
        if what.startswith("exit") or what in seen:
            why = f"it is {what}, as {seen[what][0]}" if what in seen else f"this CPU cannot run it ({what})"
            print(f"{title}: skipped, {why}", flush=True)
            continue
        seen[what] = title, environment

    def passes(environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
        return subprocess.run(pytest, env=environment_with(environment), capture_output=True, text=True, check=False)

    failed = []
    with ThreadPoolExecutor(2) as pool:
        environments = [environment for _, environment in seen.values()]
        for (what, (title, _)), done in zip(seen.items(), pool.map(passes, environments), strict=True):
            print(f"{title}: {what}\n{done.stdout}{done.stderr}", flush=True)
            if done.returncode:
                failed.append(title)
    print(f"{len(seen)} kernels, " + (f"failures under {', '.join(failed)}" if failed else "none with a failure"))
    return len(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
