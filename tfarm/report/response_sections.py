"""Frequency responses on an arm's page: exact ones, measured ones over them, and the fit to measurements."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import MOMENT_GAIN
from tfarm.digits import listed, plain
from tfarm.errors import ConvergenceError
from tfarm.fitting.fit import ARMS, Possible, possible
from tfarm.fitting.overlay import overlay
from tfarm.loop.margins import Margins, margins
from tfarm.loop.plane import ranges_of
from tfarm.plots import frequency, style
from tfarm.report.cases import Case, has_loop
from tfarm.report.sections import PageSection, Picture, picture, prose, sheet, upper
from tfarm.response.frequency import AXIS_SHARE, Bode, bode
from tfarm.schema import Quantity, Table, curve_table, table
from tfarm.spectrum.table import default_gains

SPANS_ON_ALL = {"phase": ("phase margin", "deg"), "delay": ("delay margin", "s"), "disk": ("disk margin", "")}


def bode_section(case: Case, output: str) -> PageSection:
    """One output: picture, its meaning, poles and zeros."""
    data = bode(case.arm, output)
    anchor, what = f"bode-{output.replace('_', '-')}", f"{data.input_label} to {data.label}"
    if data.is_zero:
        none = f"The {data.label} is zero at every frequency: this arm's tip is pinned."
        return PageSection(anchor=anchor, title=f"From {what}", words=(none,))
    roots, facts = table([*data.pole_list, *data.zero_list], parent=data).columns, {"data": data, "boxes": _boxes(data)}
    blocks = (
        picture("bode", frequency.bode.figure(data), stem=anchor, data=curve_table(data).columns, **bode_facts(data)),
        sheet("bode_table", roots, stem=f"{anchor}-roots", **facts),
    )
    words = () if roots else (f"{prose('bode_roots', **facts)} There are none.",)
    return PageSection(anchor=anchor, title=f"From {what}", words=words, blocks=blocks)


def bode_facts(data: Bode) -> dict[str, Any]:
    """The facts of a caption of a response: its zeros in the right half-plane, and the turn of its phase."""
    right = data.zeros[data.zeros.real > AXIS_SHARE * abs(data.zeros)]
    count, slowest = int(np.sum(right.imag == 0) + 2 * np.sum(right.imag > 0)), float(abs(right).min(initial=np.inf))
    return {"found": data, "right": count, "slowest": slowest, "turned": float(np.ptp(data.phase))}


def _boxes(data: Bode) -> list[str]:
    """The widths in which poles and zeros are complete, one where both are the same."""
    pairs = {"poles": data.pole_width, "zeros": data.zero_width}
    found = {name: f"{plain(left, 5)} < Re s < {plain(right, 5)} 1/s"
             for name, (left, right) in pairs.items() if not math.isinf(left)}  # fmt: skip
    if len(found) == len(pairs) and len(set(found.values())) == 1:
        return [found["poles"]]
    return [f"{name} {width}" for name, width in found.items()]


# ------------------------------------------------------------ fitted to measurements


def fit_section(case: Case, count: int = ARMS) -> PageSection:
    """Measurements, the fitted numbers with their intervals, and the share of possible arms on which a loop holds."""
    fit = case.fit
    assert fit is not None
    words = [f"{upper(each)}." for each in fit.not_determined]
    blocks: list[Picture | Table] = []
    if fit.responses:
        names = listed([f"{each.label} [{each.unit}]" for each in fit.responses])
        blocks.append(picture("fit_overlay", frequency.fitted.figure(fit), names=names))
    blocks += [
        sheet("fitted", table(fit.parameters).columns, stem="fit"),
        sheet("fit_resonances", table(fit.resonances).columns),
    ]
    try:
        those = possible(fit, count)
    except ConvergenceError as error:
        words.append(f"What the data leave of a loop is not drawn: {error}.")
    else:
        every = [margins(each, default_gains(fit.arm)) for each in those.arms if has_loop(fit.arm)]
        words += [prose("fit_share", gains=style.gains_words(default_gains(fit.arm)), every=every)] if every else []
        blocks += _of_all_arms(those, every)
    answer = prose("fit", verdict=fit.verdict, found=fit.in_words)
    return PageSection(anchor="fit", title="Fitted to measurements", answer=answer, words=words, blocks=blocks)


class MarginSpan(NamedTuple):
    """A margin over the possible arms."""

    margin: Annotated[str, Quantity("of the loop", help="stability margin of the default loop")]
    unit: Annotated[str, Quantity("unit", help="unit of the margin")]
    lowest: Annotated[float, Quantity("lowest", digits=4, help="least over the arms on which the loop is stable")]
    highest: Annotated[float, Quantity("highest", digits=4, help="largest over the arms on which the loop is stable")]


def _of_all_arms(those: Possible, every: list[Margins]) -> Iterator[Picture | Table]:
    """The band of a response, and of an arm with a loop the share of arms over its gains, and the margins over all."""
    if those.fit.responses:
        yield picture("fit_band", frequency.draw_band(those, "root_moment"), arms=those.arms)
    if not every:
        return
    yield picture("fit_map", frequency.draw_share(those, ranges_of(those.fit.arm)))
    stable = [each for each in every if each.in_band is not None]
    ends = (each.windows[MOMENT_GAIN].around for each in stable)
    found = {(f"{MOMENT_GAIN} up to", ""): [pair[1] for pair in ends if pair is not None]}
    found |= {title: [getattr(each.in_band, name) for each in stable] for name, title in SPANS_ON_ALL.items()}
    known = {title: [value for value in values if value is not None] for title, values in found.items()}
    rows = [MarginSpan(*title, min(values), max(values)) for title, values in known.items() if values]
    gains = style.gains_words(default_gains(those.fit.arm))
    yield sheet("fit_margins", table(rows).columns, gains=gains, stable=stable)


# ------------------------------------------------------------ measured


def measured_section(case: Case) -> PageSection:
    """Each response over the exact one, with the differences."""
    blocks, words = list[Picture | Table](), list[str]()
    for number, one in enumerate(case.measured, start=1):
        found, label = overlay(case.arm, one), f"-{number}" if len(case.measured) > 1 else ""
        name = found.measured.label
        words.append(prose("measured_response", name=name, found=found, peaks=found.unmatched / (2 * math.pi)))
        blocks += [
            picture("measured", frequency.measured.figure(found), stem=f"measured{label}", data=found.csv_table.columns,
                    name=name),
            sheet("measured_modes", table(found.modes).columns, stem=f"measured-modes{label}"),
            sheet("measured_required", table(found.required_changes).columns, stem=f"measured-required{label}"),
        ]  # fmt: skip
    return PageSection(anchor="bode-measured", title="Measured over exact", words=words, blocks=blocks)
