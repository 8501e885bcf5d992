"""Pictures of a study: distributions of its quantities, their values over the varied numbers, bands of responses."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from tfarm.arm.schema import file_key, file_keys
from tfarm.arrays import Real
from tfarm.digits import how_many
from tfarm.errors import require
from tfarm.studies.bands import ENDS, ResponseBand
from tfarm.studies.findings import Spread
from tfarm.studies.quantities import COLUMNS, LOOPS, asked_columns
from tfarm.studies.running import Plan
from tfarm.studies.space import LAW
from tfarm.studies.study import Study

from .frequency import over_frequency
from .motion import OF_STABILITY
from .style import BLUE, GREY, INK, WIDE, Axes, number_label, picture, plain_ticks, safe

BINS = 24  # at most, of a histogram
ACROSS, MOST_QUANTITIES = 4, 12  # axes of distributions side by side, and in all
MOST_NUMBERS, MOST_ROWS = 4, 3  # axes of a scatter picture
MOST_POINTS = 1000  # arms of a scatter picture
LINE = 24  # letters of a label of such small axes
FIRST = ("gain_margin_db", "phase_margin_deg", "delay_margin_ms", "peak_sensitivity")  # where there are too many
LOOKS: tuple[dict[str, Any], ...] = (
    {"fill": True, "color": BLUE, "alpha": 0.4}, {"fill": False, "color": INK, "lw": 1.1}
)  # fmt: skip
MARKS = {**OF_STABILITY, "": (GREY, "^")}
SINGLE = 12  # curves of single arms in a band
NOT_DETERMINED = "not determined"


def distributions(found: Study, quantity: str | None = None, most: int = MOST_QUANTITIES) -> dict[str, list[Spread]]:
    """Return the distributions of a quantity, or of all, those of both loops together: first margins, then others.

    Raises ParameterError where the study has no number of it.
    """
    names = {each.name for each in found.spreads} & set(asked_columns([quantity]) if quantity else COLUMNS)
    require(names, "quantity", quantity, "the study has no number of it: name it in `ask`")
    both: dict[str, list[Spread]] = {}
    for each in found.spreads:
        if each.name in names:
            both.setdefault(".".join(part for part in each.name.split(".") if part not in LOOPS), []).append(each)
    return {name: both[name] for name in sorted(both, key=lambda name: name not in FIRST)[:most]}


def _grid(found: Study, quantity: str | None = None) -> tuple[int, int]:
    """Rows and columns of the axes of distributions."""
    count = len(distributions(found, quantity))
    return math.ceil(count / ACROSS), min(count, ACROSS)


def _histograms(figure: Any, found: Study, quantity: str | None = None) -> None:
    count, (rows, columns) = len(distributions(found, quantity)), _grid(found, quantity)
    for ax in np.ravel(figure.subplots(rows, columns, squeeze=False))[count:]:
        ax.remove()


@picture(
    (Study, "tfarm.study returns"), grid=_histograms,
    size=lambda *of: (max(4.5, 2.4 * _grid(*of)[1]), 0.9 + 2.0 * _grid(*of)[0]),
    title=lambda found, *_: f"{found.arm}: distributions over {how_many(found.done, 'arm')}",
)  # fmt: skip
def study(found: Study, quantity: str | None = None, *, ax: Sequence[Axes]) -> None:
    """Distribution of each quantity of a study (from `tfarm.study`), or of one, in axes of its own; the axes.

    Continuous-time loops are filled, sampled ones drawn as an outline; the bar above is from the 5 % to the 95 %
    quantile, with the median.  Values without a limit or undefined are left out, and their number is in the title.
    """
    table = found.table()
    for one, each in zip(ax, distributions(found, quantity).values(), strict=False):
        values = [table[of.name][np.isfinite(table[of.name])] for of in each]
        every = np.concatenate(values)
        room = 0.02 * (abs(every).max() or 1.0) if np.ptp(every) <= 1e-9 * abs(every).max() else 0.0
        edges = np.linspace(every.min() - room, every.max() + room, min(BINS, 2 + math.isqrt(every.size)))
        counts = [np.histogram(own, edges)[0] for own in values]
        top = max(own.max() for own in counts)
        for n, (of, own, looks) in enumerate(zip(each, counts, LOOKS, strict=False)):
            loop = _loop_of(of.name)
            one.stairs(own, edges, label=loop.replace("continuous", "continuous-time") or "arms", **looks)
            one.plot([of.low, of.high], [top * (1.08 + 0.1 * n)] * 2, color=looks["color"], lw=1.2)
            one.plot([of.median], [top * (1.08 + 0.1 * n)], "|", ms=7, mew=1.6, color=looks["color"])
        one.set(xlabel=_folded(COLUMNS[each[0].name].of.label, each[0].unit), ylabel="arms [−]", ylim=(0, 1.27 * top))
        if fewer := [f"{of.arms}" for of in each if of.arms < found.done]:
            one.set_title(f"{' and '.join(fewer)} of {found.done} arms", fontsize=8.0)
        one.yaxis.set_major_locator(MaxNLocator(3, integer=True))
        one.xaxis.set_major_locator(MaxNLocator(4))
        plain_ticks(one.xaxis)


def _loop_of(name: str) -> str:
    return next((loop for loop in LOOPS if loop in name.split(".")), "")


def _folded(label: str, unit: str) -> str:
    return textwrap.fill(f"{safe(label)} [{unit or '−'}]", LINE)


def key_label(key: str, plan: Plan) -> str:
    """A varied number with its SI unit."""
    if key.startswith(LAW):
        return number_label(key.removeprefix(LAW), plan.arm, plan.law)
    is_known = ".".join(word for word in key.split(".") if not word.isdecimal()) in file_keys()
    return f"{key} [{(file_key(key, plan.arm).unit if is_known else '') or '−'}]"


def _shown(found: Study, quantity: str | None = None) -> tuple[list[Spread], tuple[str, ...]]:
    """Quantities up and numbers along the axes: of both loops the sampled one, and those that drive most first."""
    rows = [each[-1] for each in distributions(found, quantity, MOST_ROWS).values()]
    drivers = [each.driver for each in rows]
    keys = sorted(found.parts.plan.space.keys, key=drivers.count, reverse=True)
    return rows, tuple(keys[:MOST_NUMBERS])


def _scatter_axes(figure: Any, *of: Any) -> Any:
    rows, keys = _shown(*of)
    return figure.subplots(len(rows), len(keys), squeeze=False, sharex="col", sharey="row")


@picture(
    (Study, "tfarm.study returns"), grid=_scatter_axes,
    size=lambda *of: (max(4.5, min(WIDE, 2.6 * len(_shown(*of)[1]) + 0.6)), 1.0 + 1.9 * len(_shown(*of)[0])),
    title=lambda found, *_: f"{found.arm}: quantities over the varied numbers",
)  # fmt: skip
def study_scatter(found: Study, quantity: str | None = None, *, ax: Sequence[Axes]) -> None:
    """Values of a study (from `tfarm.study`) over each varied number, of three quantities or of one; the axes.

    A mark is an arm, in the colour of the stability of its loop; at the upper edge it has no limit, at the lower edge
    no value.  Of more than a thousand arms as many are drawn, even over the rows.
    """
    table, (rows, keys) = found.table(), _shown(found, quantity)
    drawn = np.unique(np.linspace(0, found.done - 1, min(found.done, MOST_POINTS)).round().astype(int))
    for of, line in zip(rows, np.reshape(np.array(ax, dtype=object), (len(rows), len(keys))), strict=True):
        before, loop, _ = of.name.partition(_loop_of(of.name) or "\n")
        words = table.get(f"{before}{loop}.stability", np.full(found.done, "stable" if not loop else ""))[drawn]
        for key, one in zip(keys, line, strict=True):
            _scatter(table[key][drawn], table[of.name][drawn], words, one)
            one.set(xlabel=_folded(*_split(key_label(key, found.parts.plan))) if of is rows[-1] else "")
            one.xaxis.set_major_locator(MaxNLocator(4))
            plain_ticks(one.xaxis)
        line[0].set_ylabel(_folded(of.label, of.unit))


def _split(label: str) -> tuple[str, str]:
    words, _, unit = label.rpartition(" [")
    return words, unit.removesuffix("]")


def _scatter(x: Real, y: Real, words: Any, ax: Axes) -> None:
    """Marks by stability; without a limit at the upper edge, without a value at the lower one."""
    edges = np.where(np.isposinf(y), 0.98, 0.02)
    for word, (colour, mark) in MARKS.items():
        looks: dict[str, Any] = {"ls": "none", "color": colour, "marker": mark, "ms": 3.4, "alpha": 0.75}
        own, inside = words == word, np.isfinite(y)
        if own.any():
            ax.plot(x[own & inside], y[own & inside], label=word or NOT_DETERMINED, **looks)
            ax.plot(x[own & ~inside], edges[own & ~inside], transform=ax.get_xaxis_transform(), **looks)


@picture(
    (ResponseBand, "tfarm.studies.bands.frequency_band returns"), size=(9.0, 4.6),
    title=lambda band: f"{band.arm}: {band.response} over {how_many(band.arms, 'arm')}",
)  # fmt: skip
def study_band(band: ResponseBand, *, ax: Axes) -> None:
    """Band of the exact responses of the arms of a study: 5, 50 and 95 % at each point; in the axes, or new ones."""
    low, median, high = (band.quantile(end) for end in ENDS)
    ax.fill_between(band.at, low, high, color=BLUE, alpha=0.3, lw=0, label="5 to 95 % of the arms, at each point")
    ax.plot(band.at, band.curves[:: max(1, band.arms // SINGLE)].T, color=GREY, lw=0.4, alpha=0.6, zorder=1.5)
    ax.plot([], [], color=GREY, lw=0.8, label="single arms")
    ax.plot(band.at, median, color=BLUE, lw=1.4, label="median, at each point")
    ax.set(xlabel=band.abscissa, ylabel=f"{band.response} [{band.unit}]", xlim=band.at[[0, -1]])
    if band.unit.startswith("dB"):
        over_frequency(ax, ax.get_ylabel())


def band_data(band: ResponseBand) -> Mapping[str, Real]:
    """Columns of the quantiles of a band."""
    return {"at": band.at, **{end: band.quantile(end) for end in ENDS}}
