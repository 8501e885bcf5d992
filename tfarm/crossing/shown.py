"""A plane of two numbers of a law with its counts of unstable poles, as files and terminals have it."""

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.crossing.line import Crossings, Window, intervals
from tfarm.errors import ConvergenceError
from tfarm.schema import Column, Quantity, Table


class PlaneOfCounts(ABC):
    """Counts of unstable poles over the plane of two numbers: `vary` names them, `x` and `y` are their values.

    `crossings` are those along y at each x, exact and independent of the grid.
    """

    vary: tuple[str, str]
    x: Real
    y: Real
    crossings: list[Crossings]

    @property
    @abstractmethod
    def counts(self) -> Any:
        """Unstable poles (len(y), len(x)); infinity where they are infinitely many."""

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Points (len(y), len(x)) at which the loop is stable."""
        return np.asarray(np.equal(self.counts, 0))

    @property
    def finding(
        self,
    ) -> Annotated[str, Quantity("stability region", help="points of the grid without unstable pole")]:
        """Number of points of the grid at which the loop is stable."""
        return f"stable at {int(self.stable.sum())} of {self.stable.size} points"

    @property
    def stable_intervals(self) -> list[list[Window]]:
        """For each x the stability intervals of y, cut to the map: the region with exact edges."""
        low, high = self.y[[0, -1]].tolist()
        columns = zip(self.crossings, self.counts[0], strict=True)
        return [intervals(found, low, high, low, int(count)) for found, count in columns]

    def must_agree(self, count: Callable[[float, float], int | None], remedy: str) -> None:
        """Raise ConvergenceError where a count at a corner is another one.  None: a pole is on the stability limit."""
        for i, j in itertools.product((0, -1), repeat=2):
            at = (float(self.x[i]), float(self.y[j]))
            here = int(self.counts[j][i])
            there = count(*at)
            if there not in (here, None):
                where = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.vary, at, strict=True))
                raise ConvergenceError(
                    f"at {where} {there} poles are unstable, not {here}: {remedy}", self, there
                )

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
        columns = [
            Column(name.replace(".", "_").replace("@", "_at_"), of=values.ravel()) for name, values in pairs
        ]
        columns.append(Column("unstable_roots", of=itertools.chain(*self.counts)))
        return Table(columns=tuple(columns))

    @property
    def drawing(self) -> str:
        """A coarse picture for a terminal: a dot where the loop is stable."""
        most_lines = 24
        most_characters = 60
        up = max(1, self.y.size // most_lines)
        across = max(1, self.x.size // most_characters)
        rows = list(zip(self.y, self.counts, strict=True))[::-up]
        lines = []
        for value, row in rows:
            marks = "".join("#" if count else "." for count in row[::across])
            lines.append(f"{value:9.3g} {marks}")
        name, other = self.vary
        legend = f"{other} up, {name} from {self.x[0]:g} to {self.x[-1]:g} to the right; . stable, # unstable"
        return "\n".join([*lines, legend])
