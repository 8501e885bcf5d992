"""Measure speed and accuracy, beside other packages: `make bench`.

Nothing here is a test: times depend on the machine, so they are printed as ratios and medians, and kept in
reports/bench.json.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from . import elements, loci, responses, sampled, spectra, tuning
from .rows import Row, keep, show


def measure() -> Iterator[Row]:
    """All rows, group by group."""
    yield from responses.response_rows()
    yield from responses.mpmath_rows()
    yield elements.response_row()
    yield from spectra.modes_rows()
    yield elements.mode_row()
    yield spectra.cxroots_row()
    yield from sampled.loop_rows()
    yield from loci.locus_rows()
    yield from sampled.sampled_rows()
    yield tuning.tuner_row()


def main(path: Path) -> None:
    """Measure, print, keep."""
    logging.getLogger("cxroots").setLevel(logging.CRITICAL)  # it tells of every subdivision it takes back
    console, rows = Console(width=None if sys.stdout.isatty() else 170), []
    with Console(stderr=True).status("measuring") as status:
        for row in measure():
            rows.append(row)
            status.update(f"measured {row.what}")
    show(rows, console)
    keep(rows, path)
    missed = [row.what for row in rows if row.target and not row.target.met]
    console.print(f"targets missed: {', '.join(missed) or 'none'}; kept in {path}", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    main(Path(*sys.argv[1:2] or ["reports/bench.json"]))
