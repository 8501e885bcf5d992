"""The numbers of the Nyquist plots: encirclements beside unstable poles, and the loop function on the contour."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from tfarm.columns import Column, Table
from tfarm.digits import significant, singly
from tfarm.loop.nyquist import Nyquist, nyquist_table
from tfarm.report.given_laws import LawOnArm

COUNT_CAPTION = (
    "{open}, so each clockwise turn around −1 (counted negative) is one unstable "
    "closed-loop pole. The count in a box was made without Nyquist, by finding every pole; poles whose real part is "
    "less than 10⁻¹² of their size are not told apart from the axis there (undecided), though their turns around −1 "
    "are counted."
)
NO_OPEN, OWN_OPEN = "L has no pole right of the contour", "Beside the poles that a law itself has right of the contour"
RINGS_CAPTION = "Rings: sizes of L; −1 lies on the ring 1. Broad: ω > 0, arrows as ω rises; thin: its mirror image."


class PlotOfLaw(NamedTuple):
    """One law's plot: its name, and the counted contour."""

    named: LawOnArm
    data: Nyquist


def count_table(plots: Sequence[PlotOfLaw], names: Sequence[str]) -> Table:
    """Verdict, encirclements and unstable poles of each law."""
    whole = partial(Column, digits=singly(lambda n: str(n).replace("-", "−")))
    unstable = partial(whole, group="unstable poles")
    words = [
        f"{it.verdict}{', infinitely many in all' * it.unstable_roots_infinite}" for it in (p.verdict for _, p in plots)
    ]
    return Table(
        stem="nyquist-count",
        title="Encirclements beside unstable poles",
        caption=COUNT_CAPTION.format(open=NO_OPEN if not any(p.unstable_open for _, p in plots) else OWN_OPEN),
        columns=(
            Column("law", "law", of=names),
            Column("verdict", "verdict", of=words),
            whole("encirclements", "turns around −1", of="data.encirclements"),
            unstable("unstable_by_nyquist", "by Nyquist", of="data.expected"),
            unstable("unstable_in_box", "in a box", of="data.verdict.unstable_roots"),
            unstable("on_axis_in_box", "undecided", of="data.on_axis"),
            Column("band_rad_s", "up to", "rad/s", of="data.verdict.band", digits=singly(significant, 6)),
        ),
        record=list(plots),
    )


def curve_data(plots: Sequence[PlotOfLaw], stem: str = "nyquist-data") -> Table:
    """L on the contour of every law."""
    return nyquist_table(*(plot.data for plot in plots), stem=stem, laws=[plot.named.key for plot in plots])
