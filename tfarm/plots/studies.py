"""Pictures of a study: distributions of its quantities, their values over the varied numbers, bands of responses."""

import math
import textwrap
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from tfarm.arm.schema import file_key, file_keys
from tfarm.arrays import Real
from tfarm.digits import how_many, unit
from tfarm.errors import require
from tfarm.exact.outputs import signal_words, unit_over
from tfarm.plots.frequency import over_frequency
from tfarm.plots.labels import number_label, with_unit
from tfarm.plots.motion import OF_STABILITY
from tfarm.plots.style import BLUE, GREY, INK, Axes, few_ticks, picture, safe
from tfarm.studies.findings import Spread
from tfarm.studies.quantities import COLUMNS, column_names, loop_of, quantity_of, stability_of
from tfarm.studies.study import Study


def distributions(found: Study, quantity: str | None = None, most: int = 12) -> list[list[Spread]]:
    """Return the distributions of a quantity, or of all, those of both loops together: first margins, then others.

    Raises ParameterError where the study has no number of it.
    """
    # where there are too many
    first = ("gain_margin_db", "phase_margin_deg", "delay_margin_ms", "peak_sensitivity")
    both: dict[str, list[Spread]] = {}
    names = column_names([quantity]) if quantity else COLUMNS
    for each in found.spreads:
        if each.name in names:
            name = each.name.replace(f"{loop_of(each.name)}.", "")
            both.setdefault(name, []).append(each)
    require(both, "quantity", quantity, "the study has no number of it: name it in `ask`")
    return [both[name] for name in sorted(both, key=lambda name: name not in first)][:most]


def _shape(count: int) -> tuple[int, int]:
    """Return rows and columns of small axes."""
    across = 4
    return math.ceil(count / across), min(count, across)


def _size(*of: Any) -> tuple[float, float]:
    rows, columns = _shape(len(distributions(*of)))
    return max(4.5, 2.4 * columns), 0.9 + 2.0 * rows


def _grid(figure: Any, *of: Any) -> None:
    count = len(distributions(*of))
    axes = figure.subplots(*_shape(count), squeeze=False).ravel()
    for ax in axes[count:]:
        ax.remove()


@picture(
    (Study, "tfarm.study returns"),
    grid=_grid,
    size=_size,
    title=lambda found, *_: f"{found.arm}: distributions over {how_many(found.done, 'arm')}",
)
def study(found: Study, quantity: str | None = None, *, ax: Sequence[Axes]) -> None:
    """Draw the distribution of each quantity of a study (from `tfarm.study`), or of one, in axes of its own; the axes.

    Continuous-time loops are filled, sampled ones an outline.  The bar above is from the 5 % to the 95 % quantile with
    the median.  Where some arms have no finite value the title is the number of those that have one.
    """
    for one, each in zip(ax, distributions(found, quantity), strict=False):
        _draw_distribution(found, each, one)


def _draw_distribution(found: Study, each: Sequence[Spread], ax: Axes) -> None:
    """Draw the distribution of a quantity, of both loops together."""
    table = found.table()
    values = [table[of.name][np.isfinite(table[of.name])] for of in each]
    low = min(of.least for of in each)
    high = max(of.largest for of in each)
    room = 0.0
    if high - low <= 1e-9 * abs(high):
        room = 0.02 * (abs(high) or 1.0)
    most = max(map(len, values))
    edges = np.linspace(low - room, high + room, min(24, 2 + math.isqrt(most)))
    counts = [np.histogram(own, edges)[0] for own in values]
    top = np.max(counts)
    for n, (of, own) in enumerate(zip(each, counts, strict=True)):
        loop = loop_of(of.name)
        colour = BLUE
        if loop == "sampled":
            colour = INK
            ax.stairs(own, edges, color=colour, lw=1.1, label=loop)
        else:
            label = "continuous-time" if loop else "arms"
            ax.stairs(own, edges, fill=True, color=colour, alpha=0.4, label=label)
        height = top * (1.08 + 0.1 * n)
        ends = [of.low, of.median, of.high]
        ax.plot(ends, [height] * 3, "|-", ms=7, markevery=[1], color=colour, lw=1.2)
    first = each[0]
    label = with_unit(quantity_of(first.name).label, first.unit)
    ax.set(xlabel=_fold_label(label), ylabel="arms [−]", ylim=(0, 1.27 * top))
    counted = " and ".join(str(of.arms) for of in each if of.arms < found.done)
    if counted:
        ax.set_title(f"{counted} of {found.done} arms", fontsize=8.0)
    ax.yaxis.set_major_locator(MaxNLocator(3, integer=True))
    few_ticks(ax.xaxis)


def _fold_label(label: str) -> str:
    """Return a label in lines for small axes, no unit on a line of its own."""
    letters = 24
    lines = textwrap.fill(safe(label).replace(" [", "\u00a0["), letters)
    return lines.replace("\u00a0", " ")


def key_label(key: str, found: Study) -> str:
    """Return a varied number with its SI unit."""
    plan = found.parts.plan
    if key.startswith("law."):
        return number_label(key.removeprefix("law."), plan.case.arm, plan.case.law)
    words = [word for word in key.split(".") if not word.isdecimal()]
    if ".".join(words) in file_keys():
        return with_unit(key, unit(file_key(key, plan.case.arm).unit))
    return with_unit(key)


def _rows_and_keys(found: Study, quantity: str | None = None) -> tuple[list[Spread], list[str]]:
    """Return quantities up, of both loops the sampled one, and numbers across: those that drive most first."""
    # of a scatter picture: axes, and arms
    most_numbers = 4
    most_rows = 3
    rows = [each[-1] for each in distributions(found, quantity, most_rows)]
    drivers = [each.driver for each in rows]
    keys = sorted(found.parts.plan.space.keys, key=drivers.count, reverse=True)
    return rows, keys[:most_numbers]


def _grid_of_rows(figure: Any, *of: Any) -> None:
    rows, keys = _rows_and_keys(*of)
    figure.subplots(len(rows), len(keys), squeeze=False, sharex="col", sharey="row")


@picture(
    (Study, "tfarm.study returns"),
    size=lambda *of: (9.0, 1.0 + 1.9 * len(_rows_and_keys(*of)[0])),
    grid=_grid_of_rows,
    title=lambda found, *_: f"{found.arm}: quantities over the varied numbers",
)
def study_scatter(found: Study, quantity: str | None = None, *, ax: Sequence[Axes], most: int = 1000) -> None:
    """Draw values of a study (from `tfarm.study`) over each varied number, of three quantities or of one; the axes.

    A mark is an arm, in the colour of the stability of its loop; at the upper edge it has no limit, at the lower edge
    no value.  Of more than `most` arms as many are drawn, even over the rows.
    """
    rows, keys = _rows_and_keys(found, quantity)
    step = 1 + (found.done - 1) // most
    table = {name: values[::step] for name, values in found.table().items()}
    axes = np.reshape(np.array(ax, dtype=object), (len(rows), len(keys)))
    for of, line in zip(rows, axes, strict=True):
        y = table[of.name]
        words = table.get(stability_of(of.name), np.full(len(y), "arm"))
        for key, one in zip(keys, line, strict=True):
            _draw_marks(table[key], y, words, one)
            if one.xaxis.get_tick_params()["labelbottom"]:
                one.set_xlabel(_fold_label(key_label(key, found)))
            if one.yaxis.get_tick_params()["labelleft"]:
                one.set_ylabel(_fold_label(with_unit(of.label, of.unit)))
            few_ticks(one.xaxis)


def _draw_marks(x: Real, y: Real, words: Any, ax: Axes) -> None:
    """Draw a mark for each arm by the word for its stability, without a finite value at the edges."""
    marks = {**OF_STABILITY, "": (GREY, "^"), "arm": (BLUE, "o")}
    edge = np.where(np.isnan(y), 0.02, 0.98)
    is_finite = np.isfinite(y)
    for word, (colour, mark) in marks.items():
        label = word or "not determined"
        draw = partial(ax.plot, ls="none", marker=mark, color=colour, ms=3.4, alpha=0.75, label=label)
        is_word = words == word
        here = is_finite & is_word
        if here.any():
            draw(x[here], y[here])
        here = ~is_finite & is_word
        if here.any():
            draw(x[here], edge[here], transform=ax.get_xaxis_transform())


@picture(
    (Study, "tfarm.study returns"),
    size=(9.0, 4.6),
    title=lambda found, output="root_moment": (
        f"{found.arm}: {signal_words(output)[0]} of the arms of a study"
    ),
)
def study_band(found: Study, output: str = "root_moment", *, ax: Axes) -> None:
    """Draw exact responses of up to 100 arms of a study (from `tfarm.study`), their 5, 50 and 95 % at each frequency.

    The arms are even over the rows.  Raises ParameterError for an unknown output, and where no arm has that response.
    """
    band = found.band(output)
    omega = band.omega
    most = "5 to 95 % of the arms, at each frequency"
    ax.fill_between(omega, band.low, band.high, color=BLUE, alpha=0.3, lw=0, label=most)
    # a dozen single arms at least
    label = "single arms"
    for curve in band.curves[:: max(1, len(band.curves) // 12)]:
        ax.plot(omega, curve, color=GREY, lw=0.5, alpha=0.6, zorder=1.5, label=label)
        label = ""
    ax.plot(omega, band.median, color=BLUE, lw=1.4, label="median, at each frequency")
    ratio = unit_over(band.unit, found.parts.plan.case.arm.input_unit)
    over_frequency(ax, f"{band.label} [dB re 1 {ratio}]")
