"""The numbers of the Nyquist plots: encirclements beside unstable poles, and the loop function on the contour."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tfarm.columns import Column, Table
from tfarm.digits import significant, singly
from tfarm.loop.nyquist import Nyquist
from tfarm.report.loop_laws import Named

COUNT_CAPTION = (
    "{open}, so each clockwise turn around −1 (counted negative) is one unstable "
    "closed-loop pole. The count in a box was made without Nyquist, by finding every pole; poles whose real part is "
    "less than 10⁻¹² of their size are not told apart from the axis there (undecided), though their turns around −1 "
    "are counted.{last}"
)
NO_OPEN, OWN_OPEN = "L has no pole right of the contour", "Beside the poles that a law itself has right of the contour"
TO_COMPARE = "to compare"
LAST_COUNTED = " The last law is there to show that the count is not always 0."
RINGS_CAPTION = "Rings: sizes of L; −1 lies on the ring 1. Broad: ω > 0, arrows as ω rises; thin: its mirror image."


class PlotOfLaw(NamedTuple):
    """One law's plot: its name, and the counted contour."""

    named: Named
    data: Nyquist[Any]


def count_table(plots: Sequence[PlotOfLaw], names: Sequence[str]) -> Table:
    """Verdict, encirclements and unstable poles of each law."""
    verdicts = [plot.data.verdict for plot in plots]
    counts = np.array([[p.encirclements, p.expected, p.verdict.unstable_roots, p.on_axis] for _, p in plots])
    bands = np.array([verdict.band for verdict in verdicts])
    words = [f"{it.verdict}{', infinitely many in all' * it.unstable_roots_infinite}" for it in verdicts]
    titles = ("turns around −1", "by Nyquist", "in a box", "undecided")
    keys = ("encirclements", "unstable_by_nyquist", "unstable_in_box", "on_axis_in_box")
    return Table(
        stem="nyquist-count",
        title="Encirclements beside unstable poles",
        caption=COUNT_CAPTION.format(
            open=NO_OPEN if not any(p.unstable_open for _, p in plots) else OWN_OPEN,
            last=LAST_COUNTED if plots[-1].named.name == TO_COMPARE and plots[-1].data.expected else "",
        ),
        columns=(
            Column("law", "law", of=names),
            Column("verdict", "verdict", of=words),
            *(
                Column(
                    key,
                    title,
                    of=column,
                    digits=singly(lambda n: str(n).replace("-", "−")),
                    group="" if key == "encirclements" else "unstable poles",
                )
                for key, title, column in zip(keys, titles, counts.T, strict=True)
            ),
            Column("band_rad_s", "up to", "rad/s", of=bands, digits=singly(significant, 6)),
        ),
    )


def curve_data(plots: Sequence[PlotOfLaw]) -> Table:
    """L on the contour of every law."""
    L, s = np.concatenate([plot.data.L for plot in plots]), np.concatenate([plot.data.s for plot in plots])
    law = [plot.named.key for plot in plots for _ in plot.data.s]
    return Table(
        stem="nyquist-data",
        title="The loop function on the contour",
        is_data=True,
        columns=(
            Column("law", "law", of=law),
            Column("re_s", "Re s", "1/s", of=s.real),
            Column("im_s", "Im s", "rad/s", of=s.imag),
            Column("re_L", "Re L", of=L.real),
            Column("im_L", "Im L", of=L.imag),
        ),
    )
