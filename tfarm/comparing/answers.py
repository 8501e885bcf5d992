"""Two loops beside each other as commands and pages have them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from tfarm.columns import FILES, JSON, Column, Table
from tfarm.digits import general, singly, within
from tfarm.dsp.verdict import sampled_law_answer
from tfarm.loop.answers import MARGIN_COLUMNS, gain_rows, margins_answer, sizes_of
from tfarm.spectrum.answers import EIGENVALUE_ERROR

from .comparison import ComparedSide, Comparison

ValuesOfSide = Sequence[float | None]
MOST_DIGITS_COMPARED = 8  # of a value in its column; fewer where fewer hold
SAMPLED_MARGINS = {"gain_factor_up": ("stable up to this factor on the law", ""),
          "gain_factor_down": ("and down to this one", ""), "delay_margin_s": ("delay margin", "s")}  # fmt: skip
MARGIN_ERROR = 1e-8  # of its size: what a margin may be off, which is found by search on the grid of the loop


@dataclass(frozen=True)
class ComparedQuantity:
    """What stands in a column for each side: `key`, title, unit, and by how much a value may be off.

    That is the larger of `relative`, a share of it, and `absolute`: what two values differ by less is no difference.
    """

    key: str
    title: str
    unit: str = ""
    relative: float = 0.0
    absolute: float = 0.0

    def difference(self, one: float | None, other: float | None) -> float | None:
        """By how much the second is larger; None where that is no number."""
        if one is None or other is None or not (math.isfinite(one) and math.isfinite(other)):
            return None
        return 0.0 if abs(other - one) <= 2 * max(self.relative * abs(one), self.absolute) else other - one

    def percent(self, one: float | None, other: float | None) -> float | None:
        """The same in per cent of the first's size."""
        apart = self.difference(one, other)
        return 100 * apart / abs(one) if one and apart is not None else apart if apart == 0.0 else None

    def cell(self, value: float | None) -> str:
        """The value in the digits that hold, eight at most; "-" where there is none."""
        if value is None or math.isinf(value):
            return "-" if value is None else general(value, MOST_DIGITS_COMPARED)
        error = max(self.relative * abs(value), self.absolute)
        return within(value, error, MOST_DIGITS_COMPARED) if error else general(value, MOST_DIGITS_COMPARED)

    def columns(self, found: Comparison, one: ValuesOfSide, other: ValuesOfSide) -> list[Column]:
        """Of both sides, and the difference."""
        apart = [self.percent(*pair) for pair in zip(one, other, strict=True)]
        return [
            Column(f"{self.key}_one", f"{self.title}{found.one.name}", self.unit, of=one, digits=self._cells),
            Column(f"{self.key}_other", f"{self.title}{found.other.name}", self.unit, of=other, digits=self._cells),
            Column(f"{self.key}_difference_percent", "difference", of=apart, digits=singly(_percent)),
        ]

    def _cells(self, values: ValuesOfSide) -> list[str]:
        return [self.cell(value) for value in values]


POLE_SIZE = ComparedQuantity("size_rad_s", "|s| of ", "rad/s", relative=EIGENVALUE_ERROR)
POLE_DAMPING = ComparedQuantity("damping_ratio", "damping of ", absolute=EIGENVALUE_ERROR)


def _percent(value: float | None) -> str:
    """A difference; what is less than the error of both is none."""
    return "-" if value is None else f"{value:+.3g} %" if value else "0 %"


def compared_modes(found: Comparison) -> Table:
    """A row a flexible mode: natural frequencies and damping ratios of both arms, and how they differ."""
    one, other = ([float(w) for w in side.modes.natural_frequency[side.modes.index > 0]] for side in found.sides)
    columns = (
        Column("mode", "mode", of=range(1, len(one) + 1)),
        *ComparedQuantity("natural_frequency_rad_s", "w of ", "rad/s", relative=EIGENVALUE_ERROR).columns(
            found, one, other
        ),
        *ComparedQuantity("damping_ratio", "damping of ", absolute=EIGENVALUE_ERROR).columns(
            found, found.one.damping_ratio, found.other.damping_ratio
        ),
    )
    return Table(columns=columns)


def compared_poles(found: Comparison) -> Table:
    """A row a mode that has an oscillating closed-loop pole on both sides, 0 the hub: both, and the difference."""
    modes = [mode for mode in found.one.by_mode if mode in found.other.by_mode]
    both = [[side.by_mode[mode] for mode in modes] for side in found.sides]
    sizes, ratios = [[abs(s) for s in side] for side in both], [[_ratio(s) for s in side] for side in both]
    columns = (
        Column("number", on=(JSON, FILES), of=range(1, len(modes) + 1)),
        _modes_column(modes),
        *POLE_SIZE.columns(found, *sizes),
        *POLE_DAMPING.columns(found, *ratios),
    )
    return Table(columns=columns)


def unpaired_poles(found: Comparison) -> Table:
    """A row an oscillating closed-loop pole that one side alone has, of a mode or of none."""
    rows = [
        (side.name, mode, pole)
        for side, other in (found.sides, found.sides[::-1])
        for pole in side.oscillating.tolist()
        if (mode := next((n for n, s in side.by_mode.items() if s == pole), None)) not in other.by_mode
    ]
    columns = (
        Column("of", "of", of=[name for name, _, _ in rows]),
        _modes_column([mode for _, mode, _ in rows]),
        Column("size_rad_s", "|s|", "rad/s", of=[abs(s) for _, _, s in rows], digits=singly(POLE_SIZE.cell)),
        Column("damping_ratio", "damping", of=[_ratio(s) for _, _, s in rows], digits=singly(POLE_DAMPING.cell)),
    )
    return Table(columns=columns)


def _modes_column(modes: Sequence[int | None]) -> Column:
    return Column(
        "mode", "mode", of=modes, shown=["none" if mode is None else str(mode) if mode else "hub" for mode in modes]
    )


def _ratio(s: complex) -> float:
    return -s.real / abs(s) + 0.0


def compared_margins(found: Comparison) -> Table:
    """A row a margin: what is exact where that is known, else what holds in the band, which `known` says.

    Of loops at their samples: between which factors on the law they are stable, and how much later it may act.
    Differences are in per cent, of angles in degrees.
    """
    of_loops = {column.key: (column.title, column.unit) for column in MARGIN_COLUMNS}
    names = SAMPLED_MARGINS if found.is_sampled else of_loops
    units = [unit for _, unit in names.values()]
    (one, known_one), (other, known_other) = (zip(*_known(side), strict=True) for side in found.sides)
    quantity = ComparedQuantity("value", "", relative=MARGIN_ERROR)
    first, second, apart = quantity.columns(found, one, other)
    degrees = [
        quantity.difference(*pair) if unit == "deg" else None for unit, *pair in zip(units, one, other, strict=True)
    ]
    percent = [None if unit == "deg" else each for unit, each in zip(units, apart.values, strict=True)]
    both = zip(units, degrees, percent, strict=True)
    shown = [_degrees(angle) if unit == "deg" else _percent(share) for unit, angle, share in both]
    titles = [f"{title} [{unit}]" if unit else title for title, unit in names.values()]
    of = found.other.name
    columns = (
        Column("margin", "margin", of=list(names), shown=titles),
        Column("unit", on=(JSON, FILES), of=units),
        first,
        second,
        replace(apart, of=percent, shown=shown),
        Column("value_difference_deg", on=(JSON, FILES), of=degrees),
        Column("known_one", f"known of {found.one.name}", of=known_one),
        Column("known_other", f"known of {of}", head=f"of {of}", of=known_other),
    )
    return Table(columns=columns)


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{value:+.3g} deg" if value else "0 deg"


def compared_windows(found: Comparison) -> Table | None:
    """How far each gain may go alone in both; None where a law is not these gains, or a loop is unstable."""
    rows = [gain_rows(side.margins) if side.margins is not None else [] for side in found.sides]
    if not all(rows):
        return None
    spans = [[" ".join(row.spans(general, 8, row.windows.around)) or "-" for row in each] for each in rows]
    columns = (
        Column("gain", "gain", of=[row.gain for row in rows[0]]),
        Column("one", f"stable around it, {found.one.name}", of=spans[0]),
        Column("other", found.other.name, of=spans[1]),
    )
    return Table(columns=columns)


def compared_answer(found: Comparison) -> dict[str, Any]:
    """Names and verdicts, the tables, and of each side the whole answer of `tfarm margins`, or of `tfarm sampled`."""
    return {
        "of": "arms" if found.is_of_arms else "laws",
        "names": [side.name for side in found.sides],
        "verdicts": [side.verdict for side in found.sides],
        "sampled": [side.sampled.answer for side in found.sides],
        "modes": compared_modes(found),
        "poles": compared_poles(found),
        "unpaired_poles": unpaired_poles(found),
        "margins": compared_margins(found),
        "at_samples": found.is_sampled,
        "loops": [_loop_answer(side) for side in found.sides],
    }


def _loop_answer(side: ComparedSide) -> dict[str, Any]:
    if side.analysis is not None:
        return sampled_law_answer(side.analysis)
    assert side.margins is not None
    return margins_answer(side.margins)


def side_words(side: ComparedSide) -> str:
    """A line: both verdicts on one side, with what is known beyond the band, and its law."""
    reach, verdict = "", None if side.margins is None else side.margins.stability
    if verdict is not None and not (verdict.verdict == "unstable" or verdict.is_known_beyond):
        reach = f" up to {verdict.band:.4g} rad/s, not known beyond"
    return f"{side.name}: {side.verdict.upper()}{reach}; {side.sampled.at}: {side.sampled.sentence}"


def _known(side: ComparedSide) -> list[tuple[float | None, str]]:
    """Each margin with what is known of it; a phase that a delay takes away has no exact value."""
    if side.analysis is not None:
        words = f"with {side.analysis.verdict.modes_used} modes"
        return [(value, "-" if value is None else words) for value in side.sampled_margins]
    assert side.margins is not None
    known: list[tuple[float | None, str]] = []
    for column in MARGIN_COLUMNS:
        exact, in_band = sizes_of(side.margins)[column.key]
        is_exact = exact is not None and (column.unit != "deg" or bool(side.margins.exact_delay))
        if in_band is None:
            known.append((None, "-"))
        else:
            known.append((exact, "exact") if is_exact else (in_band, "in the band"))
    return known
