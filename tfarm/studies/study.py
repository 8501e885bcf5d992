"""A study: many arms and loops, each by the exact solution, and the findings over all of them.

It may be declared by a small TOML file, which can be kept and run again:

arm = "sasaki2012-lab"                # preset or file, with its chain and its [law]
ask = ["card", "modes"]
draws = 2000
[over]
"payload.mass" = { uniform = [0.0, 0.2] }
"hub.inertia" = { normal = [0.1, 0.005] }
"""

import math
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np

# whose statistics take half a second to load
from tfarm.arm import AnyLaw, Arm
from tfarm.arm.chain import Chain
from tfarm.arm.checks import whole
from tfarm.case import Case
from tfarm.errors import one_line, require
from tfarm.files import locked_folder
from tfarm.fitting.posterior import load_posterior
from tfarm.processes import share_tasks
from tfarm.records import frozen
from tfarm.schema import Column, Quantity, Table, text
from tfarm.spectrum.gains import default_gains
from tfarm.stopping import Progress
from tfarm.studies.declaration import files_of
from tfarm.studies.findings import (
    Failure,
    Spread,
    StableShare,
    StudyBand,
    failures_of,
    response_quantiles,
    shares_of,
    spreads_of,
)
from tfarm.studies.quantities import CARD, column_names, order_of, quantity_of
from tfarm.studies.running import (
    OUT,
    ROW,
    Resources,
    StudyFolder,
    StudyPlan,
    on_cluster,
    run_parts,
)
from tfarm.studies.sobol import SobolIndex, sobol_indices
from tfarm.studies.space import listing_of, space_of
from tfarm.studies.worst import WorstArm, worst_arm


class StudyTable(dict[str, Any]):
    """Columns of a study as arrays by their names."""

    def to_pandas(self) -> Any:
        """Return a pandas data frame.  Raises ImportError without pandas."""
        return import_module("pandas").DataFrame(self)


@frozen(kw_only=True)
class Study:
    """Results of a study, as far as it has been run, with its findings."""

    parts: StudyFolder
    arm: Annotated[str, Quantity("arm", help="arm whose numbers are varied")]
    rows: Annotated[int, Quantity("arms", help="rows of the whole study")]
    rows_a_part: Annotated[int, Quantity(help="rows of one file of the results")]
    worst: Annotated[WorstArm | None, Quantity("worst arm", help="in one quantity")] = None
    sobol: Annotated[tuple[SobolIndex, ...], Quantity("Sobol' indices", help="of a sample of their own")] = ()

    @cached_property
    def _table(self) -> dict[str, Any]:
        return self.parts.column(*self.parts.plan.columns)

    def table(self) -> StudyTable:
        """Return the results as arrays by the name of their column, rows in order; NaN or "" where there is none."""
        return StudyTable(self._table)

    @property
    def done(self) -> Annotated[int, Quantity("arms computed", help="rows in the parts that are written")]:
        """Number of computed rows."""
        return len(self._table[ROW])

    @property
    def is_complete(self) -> Annotated[bool, Quantity(help="whether every row is computed")]:
        """Whether every row is computed."""
        return self.done == self.rows

    @cached_property
    def shares(
        self,
    ) -> Annotated[
        tuple[StableShare, ...],
        Quantity("stable arms (confidence one-sided, Clopper-Pearson)", help="by loop", first=True),
    ]:
        """Stable arms of each loop; a confidence of a complete study alone."""
        plan = self.parts.plan
        return shares_of(self._table, plan.names, plan.space.is_independent and self.is_complete)

    @cached_property
    def spreads(self) -> Annotated[tuple[Spread, ...], Quantity("distributions", help="of each quantity")]:
        """Distribution of each quantity with its driver."""
        return spreads_of(self._table, self.parts.plan.names, self.parts.plan.space.keys)

    @cached_property
    def failures(self) -> Annotated[tuple[Failure, ...], Quantity("without a result", help="arms by reason")]:
        """Arms without a result by reason."""
        return failures_of(self._table)

    def band(self, output: str, most: int = 100) -> StudyBand:
        """Return the responses of an output of at most that many arms, even over the rows, and their quantiles.

        Raises ParameterError for an unknown output, and where no arm has that response.
        """
        plan = self.parts.plan
        rows = np.column_stack([self._table[key] for key in plan.space.keys])
        return response_quantiles(plan.subjects, rows[:: max(1, -(-self.done // most))].tolist(), output)

    @property
    def shear(
        self,
    ) -> Annotated[str, Quantity("shear modulus", help="with a varied Young's modulus; else empty")]:
        """Shear moduli where Young's modulus is varied."""
        return "; ".join(self.parts.plan.subjects.notes)

    @property
    def finding(self) -> Annotated[str, Quantity(help="stable arms of each loop, with their confidence")]:
        """Stable arms of each loop."""
        words = [f"{each.loop}: {each.finding}" for each in self.shares]
        return "; ".join(words) or f"{self.done:,} of {self.rows:,} arms computed"

    @property
    def varied_numbers(self) -> list[Column]:
        """A row a varied number: its distribution or grid, and its value of the worst arm where that was found."""
        space = self.parts.plan.space
        kinds = dict.fromkeys(space.keys, "list or posterior")
        for key, each in space.over.items():
            kinds[key] = one_line(f"{each.kind} {', '.join(map(text, each.numbers))}", 60)
        columns = [
            Column("key", "number", of=space.keys),
            Column("distribution", "distribution", of=list(kinds.values())),
        ]
        if self.worst is not None:
            worst = list(self.worst.numbers.values())
            columns.append(Column("worst", "worst arm", of=worst, shown=list(map(text, worst))))
        return columns

    @property
    def csv_table(self) -> Table:
        """Every row of the study."""
        units = {name: quantity_of(name).unit for name in self.parts.plan.names}
        columns = []
        for name, values in self._table.items():
            cells = ["" if each != each else each for each in values.tolist()]
            columns.append(Column(name, unit=units.get(name, ""), of=cells))
        return Table(columns=tuple(columns))


def study(
    arm: Arm,
    over: Mapping[str, Mapping[str, Any]] | None = None,
    ask: Sequence[str] = (CARD,),
    law: AnyLaw | None = None,
    chain: Chain | None = None,
    *,
    out: str | Path,
    draws: int = 1000,
    seed: int = 0,
    rows: str | Path | None = None,
    posterior: str | Path | None = None,
    worst: str = "",
    sobol: int = 0,
    workers: int | None = None,
    client: Any = None,
    stop_after: float | None = None,
    part: int | None = None,
    progress: Progress = lambda *_: None,
) -> Study:
    """Return the results of many arms and loops, and write them to a folder, from which an interrupted study goes on.

    Parameters
    ----------
    arm, law, chain
        The arm, its controller (default gains) and its sampling (10 ms, ideal converters).
    over
        Varied numbers by key, such as {"payload.mass": {"uniform": [0.0, 0.2]}}; "loguniform", "normal" [mean,
        deviation], "lognormal" [median, deviation of ln], "grid" [low, high, count] and "values" too.  Keys are those
        of the arm's file and of its chain, "law.K1" and other numbers of the controller, "tuner.seed" and others.
    ask
        Quantities: "card", "modes", "damped_modes", "poles", "step", "tuner", or names of theirs.
    out
        Folder of the results.
    draws, seed
        Number of independent draws, and the seed on which they depend.
    rows
        CSV or Parquet file with a column a key, in the place of draws.
    posterior
        File of a fit's posterior (`tfarm fit --save`).
    worst
        Quantity of which the worst arm is searched.
    sobol
        Size N, a power of 2, of a sample of N (numbers + 2) arms of its own, for Sobol' indices of the quantities.
    workers, client
        Processes of this machine (default: one a processor), or a client of Dask.
    stop_after
        Seconds after which no part is begun any more.
    part
        Rows of a part; by default as many as take 5 to 30 s.
    progress
        Called with parts done, parts of the study, and a text; before the sample of Sobol' indices with 0, 0 and a
        text that has the time that they take.

    Raises
    ------
    ParameterError
        For an unknown key or quantity, illegal numbers, and a folder with another study.
    ConvergenceError
        Where a worker process or the scheduler was killed; another run goes on.
    """
    case = Case(arm, default_gains(arm) if law is None else law, chain)
    workers = usual_workers(client) if workers is None else workers
    counts = {"draws": draws, "seed": seed, "workers": workers, "part": 1 if part is None else part}
    for key, value in counts.items():
        least = 0 if key == "seed" else 1
        whole(key, value, least, 2**63, f"a whole number from {least}")
    known = None if posterior is None else load_posterior(posterior)
    space = space_of(
        over or {},
        draws=draws,
        seed=seed,
        posterior=known,
        listing=None if rows is None else listing_of(Path(rows)),
    )
    order = order_of(worst) if worst else ()
    plan = StudyPlan(case, space, column_names([*ask, *order]))
    require(
        sobol >= 0 and sobol & (sobol - 1) == 0, "sobol", sobol, "a power of 2, such as 256; 0 for no indices"
    )
    is_possible = not sobol or (space.is_independent and posterior is None and len(space.keys) > 1)
    require(is_possible, "sobol", sobol, "needs two or more independent distributions")
    declared = {
        "over": over or {},
        "ask": ask,
        "draws": draws,
        "seed": seed,
        "rows": rows,
        "posterior": posterior,
        "worst": worst,
        "sobol": sobol,
    }
    files = files_of(case, declared)
    engine = partial(share_tasks, count=workers) if client is None else partial(on_cluster, client=client)
    deadline = time.monotonic() + (math.inf if stop_after is None else stop_after)
    resources = Resources(engine, workers, deadline, progress)
    folder = Path(out)
    with locked_folder(folder, key=OUT):
        parts = run_parts(folder, plan, files, resources, part)
        found = Study(parts=parts, arm=arm.name, rows=space.count, rows_a_part=parts.rows)
        if found.is_complete:
            if sobol:
                found = replace(found, sobol=sobol_indices(parts, sobol, resources))
            if order:
                found = replace(found, worst=worst_arm(parts, found.table(), order, resources))
    return found


def usual_workers(client: Any) -> int:
    """Return the number of workers of a client of Dask, or of processors of this machine that may be used."""
    if client is not None:
        return max(1, len(client.nthreads()))
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# ------------------------------------------------------------------------------------------------------------ file


# ------------------------------------------------------------------------------------------------------------ worst


# ------------------------------------------------------------------------------------------------------------ Sobol'
