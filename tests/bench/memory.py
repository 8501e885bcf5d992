"""Peak memory of ten million frequencies, in a process of its own."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

from .rows import Row, Target

GROUP = "Memory"
POINTS = 10_000_000
LIMIT = 200.0  # MB


def memory_row() -> Row:
    """Three outputs at 1e7 frequencies: what the call needed at its peak, less its input and its result.

    To be called early: the peak that a system reports for a child may start from its parent's.
    """
    run = subprocess.run([sys.executable, "-m", __name__], check=True, capture_output=True, text=True)
    used = json.loads(run.stdout)
    beyond = used["peak"] - used["idle"] - used["input"] - used["result"]
    note = (
        f"peak {used['peak']:.0f} MB = Python, libraries and compiled kernel {used['idle']:.0f} MB + input s "
        f"{used['input']:.0f} MB + result {used['result']:.0f} MB + beyond {beyond:.0f} MB.  Time: one call."
    )
    return Row(
        group=GROUP, what="tfarm: sasaki2012, three outputs, peak beyond input and result", n=POINTS, each="point",
        seconds=used["seconds"] / POINTS, warm=True, target=Target(measured=beyond, limit=LIMIT, unit="MB"), note=note,
    )  # fmt: skip


def _measure() -> dict[str, float]:
    """Sizes in MB (1e6 bytes) and the seconds of the one call."""
    import numpy as np

    import tfarm

    from .reference import OUTPUTS

    G = tfarm.transfer(tfarm.load("sasaki2012"), list(OUTPUTS))
    G(1j * np.geomspace(0.1, 1e4, 1000))
    idle = _now()
    s = 1j * np.geomspace(0.1, 1e4, POINTS)
    start = time.perf_counter()
    result = G(s)
    seconds = time.perf_counter() - start
    return {"idle": idle, "peak": _peak(), "input": s.nbytes / 1e6, "result": result.nbytes / 1e6, "seconds": seconds}


def _peak() -> float:
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def _now() -> float:
    """Memory in use; where the system does not tell, the peak so far."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return _peak()
    return pages * resource.getpagesize() / 1e6


if __name__ == "__main__":
    sys.stdout.write(json.dumps(_measure()))
