"""Does a process with other hashes, and in another time zone, write the same report?

    python -m tests.report.twice SIZE SEED

The full report of each of the first SIZE presets (four and more: all) by two processes, of which one has the hashes
of SEED, compared byte by byte.
Budget: two minutes of CPU an arm.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import tfarm
from tests import survey
from tests.survey import Finding

WRITE = (
    "import sys, tfarm; from pathlib import Path; from tfarm.report import write;"
    "write([tfarm.load(sys.argv[1])], Path(sys.argv[2]))"
)


def written(name: str, folder: Path, **environment: str) -> dict[str, bytes]:
    """Every file of the preset's report, made by a process of its own."""
    subprocess.run([sys.executable, "-c", WRITE, name, str(folder)], env={**os.environ, **environment}, check=True)
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def differing(name: str, seed: int) -> list[str]:
    """The files that two processes write in two ways, or that one of them does not write."""
    with tempfile.TemporaryDirectory() as folder:
        here = written(name, Path(folder) / "here", PYTHONHASHSEED="0")
        there = written(name, Path(folder) / "there", PYTHONHASHSEED=str(seed), TZ="Asia/Tokyo")
    return sorted(file for file in here.keys() | there.keys() if here.get(file) != there.get(file))


def presets(size, seed):
    """Of each preset the files that differ."""
    for name in tfarm.presets()[:size]:
        files = differing(name, seed)
        yield Finding("differs" if files else "same bytes", f"{name}: {', '.join(files)}" if files else "", bool(files))


if __name__ == "__main__":
    survey.main(presets, size=4)
