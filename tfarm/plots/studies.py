"""Pictures of a study: distributions of its quantities, their values over the varied numbers, bands of responses."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from tfarm.arm.schema import file_key, file_keys
from tfarm.digits import how_many, unit
from tfarm.errors import require
from tfarm.exact.outputs import signal_words, unit_over
from tfarm.plots.frequency import over_frequency
from tfarm.plots.motion import OF_STABILITY
from tfarm.plots.style import BLUE, GREY, INK, Axes, number_label, picture, plain_ticks, safe
from tfarm.studies.findings import Spread
from tfarm.studies.quantities import COLUMNS, column_names, loop_of, quantity_of, stability_of
from tfarm.studies.study import Study

# axes of distributions side by side, and in all
ACROSS = 4
MOST_QUANTITIES = 12
# of a scatter picture: axes, and arms
MOST_MARKS = 1000
# letters of a label of such small axes
LINE = 24
LOOKS: dict[str, dict[str, Any]] = {
    "continuous": {"fill": True, "color": BLUE, "alpha": 0.4, "label": "continuous-time"},
    "sampled": {"fill": False, "color": INK, "lw": 1.1, "label": "sampled"},
    "": {"fill": True, "color": BLUE, "alpha": 0.4, "label": "arms"},
}
MARKS = {**OF_STABILITY, "": (GREY, "^"), "arm": (BLUE, "o")}


def distributions(
    found: Study, quantity: str | None = None, most: int = MOST_QUANTITIES
) -> list[list[Spread]]:
    """Return the distributions of a quantity, or of all, those of both loops together: first margins, then others.

    Raises ParameterError where the study has no number of it.
    """
    # where there are too many
    first = ("gain_margin_db", "phase_margin_deg", "delay_margin_ms", "peak_sensitivity")
    both: dict[str, list[Spread]] = {}
    names = column_names([quantity]) if quantity else COLUMNS
    for each in (each for each in found.spreads if each.name in names):
        both.setdefault(each.name.replace(f"{loop_of(each.name)}.", ""), []).append(each)
    require(both, "quantity", quantity, "the study has no number of it: name it in `ask`")
    return [both[name] for name in sorted(both, key=lambda name: name not in first)][:most]


def _grid(figure: Any, *of: Any) -> None:
    count = len(distributions(*of))
    for ax in figure.subplots(math.ceil(count / ACROSS), min(count, ACROSS), squeeze=False).ravel()[count:]:
        ax.remove()


@picture(
    (Study, "tfarm.study returns"),
    grid=_grid,
    size=lambda *of: (
        max(4.5, 2.4 * min(n := len(distributions(*of)), ACROSS)),
        0.9 + 2.0 * math.ceil(n / ACROSS),
    ),
    title=lambda found, *_: f"{found.arm}: distributions over {how_many(found.done, 'arm')}",
)
def study(found: Study, quantity: str | None = None, *, ax: Sequence[Axes]) -> None:
    """Distribution of each quantity of a study (from `tfarm.study`), or of one, in axes of its own; the axes.

    Continuous-time loops are filled, sampled ones an outline.  The bar above is from the 5 % to the 95 % quantile with
    the median.  Where some arms have no finite value the title is the number of those that have one.
    """
    table = found.table()
    for one, each in zip(ax, distributions(found, quantity), strict=False):
        values = [table[of.name][np.isfinite(table[of.name])] for of in each]
        low = min(of.least for of in each)
        high = max(of.largest for of in each)
        room = 0.02 * (abs(high) or 1.0) if high - low <= 1e-9 * abs(high) else 0.0
        edges = np.linspace(low - room, high + room, min(24, 2 + math.isqrt(max(map(len, values)))))
        counts = [np.histogram(own, edges)[0] for own in values]
        for n, (of, own) in enumerate(zip(each, counts, strict=True)):
            looks = LOOKS[loop_of(of.name)]
            height = np.max(counts) * (1.08 + 0.1 * n)
            one.stairs(own, edges, **looks)
            one.plot(
                [of.low, of.median, of.high],
                [height] * 3,
                "|-",
                ms=7,
                markevery=[1],
                color=looks["color"],
                lw=1.2,
            )
        label = _folded(f"{quantity_of(each[0].name).label} [{each[0].unit or '−'}]")
        counted = " and ".join(str(of.arms) for of in each if of.arms < found.done)
        one.set(xlabel=label, ylabel="arms [−]", ylim=(0, 1.27 * np.max(counts)))
        one.set_title(f"{counted} of {found.done} arms" * bool(counted), fontsize=8.0)
        one.yaxis.set_major_locator(MaxNLocator(3, integer=True))
        one.xaxis.set_major_locator(MaxNLocator(4))
        plain_ticks(one.xaxis)


def _folded(label: str) -> str:
    return textwrap.fill(safe(label).replace(" [", "\u00a0["), LINE).replace("\u00a0", " ")


def key_label(key: str, found: Study) -> str:
    """A varied number with its SI unit."""
    plan = found.parts.plan
    if key.startswith("law."):
        return number_label(key.removeprefix("law."), plan.case.arm, plan.case.law)
    is_known = ".".join(word for word in key.split(".") if not word.isdecimal()) in file_keys()
    return f"{key} [{unit(file_key(key, plan.case.arm).unit if is_known else '') or '−'}]"


def _shown(found: Study, quantity: str | None = None) -> tuple[list[Spread], list[str]]:
    """Quantities up, of both loops the sampled one, and numbers along the axes: those that drive most first."""
    # of a scatter picture: axes, and arms
    most_numbers = 4
    most_rows = 3
    rows = [each[-1] for each in distributions(found, quantity, most_rows)]
    drivers = [each.driver for each in rows]
    return rows, sorted(found.parts.plan.space.keys, key=drivers.count, reverse=True)[:most_numbers]


@picture(
    (Study, "tfarm.study returns"),
    size=lambda *of: (9.0, 1.0 + 1.9 * len(_shown(*of)[0])),
    grid=lambda figure, *of: figure.subplots(
        *(len(each) for each in _shown(*of)), squeeze=False, sharex="col", sharey="row"
    ),
    title=lambda found, *_: f"{found.arm}: quantities over the varied numbers",
)
def study_scatter(found: Study, quantity: str | None = None, *, ax: Sequence[Axes]) -> None:
    """Values of a study (from `tfarm.study`) over each varied number, of three quantities or of one; the axes.

    A mark is an arm, in the colour of the stability of its loop; at the upper edge it has no limit, at the lower edge
    no value.  Of more than a thousand arms as many are drawn, even over the rows.
    """
    (rows, keys) = _shown(found, quantity)
    step = 1 + (found.done - 1) // MOST_MARKS
    table = {name: values[::step] for name, values in found.table().items()}
    for of, line in zip(rows, np.reshape(np.array(ax, dtype=object), (len(rows), len(keys))), strict=True):
        y = table[of.name]
        words = table.get(stability_of(of.name), np.full(len(y), "arm"))
        edge = np.where(np.isnan(y), 0.02, 0.98)
        for key, one in zip(keys, line, strict=True):
            for word, (colour, mark) in MARKS.items():
                for own, height, transform in (
                    (np.isfinite(y), y, one.transData),
                    (~np.isfinite(y), edge, one.get_xaxis_transform()),
                ):
                    if (here := own & (words == word)).any():
                        one.plot(
                            table[key][here],
                            height[here],
                            mark,
                            color=colour,
                            ms=3.4,
                            alpha=0.75,
                            transform=transform,
                            label=word or "not determined",
                        )
            one.set(xlabel=_folded(key_label(key, found)) * one.xaxis.get_tick_params()["labelbottom"])
            one.set(
                ylabel=_folded(f"{of.label} [{of.unit or '−'}]") * one.yaxis.get_tick_params()["labelleft"]
            )
            one.xaxis.set_major_locator(MaxNLocator(4))
            plain_ticks(one.xaxis)


@picture(
    (Study, "tfarm.study returns"),
    size=(9.0, 4.6),
    title=lambda found, output="root_moment": (
        f"{found.arm}: {signal_words(output)[0]} of the arms of a study"
    ),
)
def study_band(found: Study, output: str = "root_moment", *, ax: Axes) -> None:
    """Exact responses of up to 100 arms of a study (from `tfarm.study`), their 5, 50 and 95 % at each frequency.

    The arms are even over the rows.  Raises ParameterError for an unknown output, and where no arm has that response.
    """
    band = found.band(output)
    omega = band.omega
    ax.fill_between(
        omega,
        band.low,
        band.high,
        color=BLUE,
        alpha=0.3,
        lw=0,
        label="5 to 95 % of the arms, at each frequency",
    )
    # a dozen single arms at least
    for n, curve in enumerate(band.curves[:: max(1, len(band.curves) // 12)]):
        ax.plot(omega, curve, color=GREY, lw=0.5, alpha=0.6, zorder=1.5, label="single arms" * (not n))
    ax.plot(omega, band.median, color=BLUE, lw=1.4, label="median, at each frequency")
    over_frequency(ax, f"{band.label} [dB re 1 {unit_over(band.unit, found.parts.plan.case.arm.input_unit)}]")
