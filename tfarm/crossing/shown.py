"""A plane of two numbers of a law with its counts of unstable poles, as files and terminals have it."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from tfarm.arrays import Real
from tfarm.schema import Column, Table

MOST_LINES, MOST_CHARACTERS = 24, 60  # of a coarse picture


class PlaneOfCounts(ABC):
    """Counts of unstable poles over the plane of two numbers: `vary` names them, `x` and `y` are their values."""

    vary: tuple[str, str]
    x: Real
    y: Real

    @property
    @abstractmethod
    def counts(self) -> Any:
        """Unstable poles (len(y), len(x)); infinity where they are infinitely many."""

    @property
    def axes(self) -> tuple[Real, Real]:
        """The values of both numbers: across the plane, and up it."""
        return self.x, self.y

    @property
    def K1(self) -> Real:
        """The values across, of the plane of K1 and K2."""
        return self.x

    @property
    def K2(self) -> Real:
        """The values up, of the plane of K1 and K2."""
        return self.y

    @property
    def csv_table(self) -> Table:
        """One row for each point of the grid: both numbers, and the count."""
        pairs = zip(self.vary, np.meshgrid(self.x, self.y), strict=True)
        columns = [Column(name.replace(".", "_").replace("@", "_at_"), of=values.ravel()) for name, values in pairs]
        return Table(columns=(*columns, Column("unstable_roots", of=[count for row in self.counts for count in row])))

    @property
    def drawing(self) -> str:
        """A coarse picture for a terminal: a dot where the loop is stable."""
        step = max(1, self.y.size // MOST_LINES), max(1, self.x.size // MOST_CHARACTERS)
        rows = list(zip(self.y, self.counts, strict=True))[:: -step[0]]
        lines = [f"{value:9.3g} " + "".join("#" if count else "." for count in row[:: step[1]]) for value, row in rows]
        across, up = self.vary
        legend = f"{up} up, {across} from {self.x[0]:g} to {self.x[-1]:g} to the right; . stable, # unstable"
        return "\n".join([*lines, legend])
