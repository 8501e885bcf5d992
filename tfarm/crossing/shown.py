"""The grid of a plane of two numbers as files and terminals have it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tfarm.arrays import Real
from tfarm.columns import Column, Table

MOST_LINES, MOST_CHARACTERS = 24, 60  # of a coarse picture


def grid_table(vary: Sequence[str], x: Real, y: Real, counts: Any) -> Table:
    """A row a point of the plane of two numbers: both, and the count of unstable poles there."""
    across, up = np.meshgrid(x, y)
    pairs = zip(vary, (across, up), strict=True)
    columns = [Column(name.replace(".", "_").replace("@", "_at_"), of=values.ravel()) for name, values in pairs]
    return Table(columns=(*columns, Column("unstable_roots", of=[count for row in counts for count in row])))


def coarse(vary: Sequence[str], x: Real, y: Real, unstable: Any) -> str:
    """A picture of the counts (len(y), len(x)): a dot where the loop is stable."""
    step = max(1, len(y) // MOST_LINES), max(1, len(x) // MOST_CHARACTERS)
    rows = list(zip(y, np.asarray(unstable), strict=True))[:: -step[0]]
    lines = [f"{value:9.3g} " + "".join("#" if count else "." for count in row[:: step[1]]) for value, row in rows]
    first, second = vary
    legend = f"{second} up, {first} from {x[0]:g} to {x[-1]:g} to the right; . stable, # unstable"
    return "\n".join([*lines, legend])
