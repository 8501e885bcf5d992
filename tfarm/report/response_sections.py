"""Frequency responses on an arm's page: exact ones, measured ones over them, and the fit to measurements."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import MOMENT_GAIN
from tfarm.digits import listed, plain
from tfarm.errors import ConvergenceError
from tfarm.fitting.fit import ARMS, Possible, possible
from tfarm.fitting.overlay import overlay
from tfarm.loop.margins import margins
from tfarm.loop.plane import ranges_of
from tfarm.plots.frequency import bode as bode_plot
from tfarm.plots.frequency import draw_band, draw_share, fitted
from tfarm.plots.frequency import measured as measured_plot
from tfarm.plots.style import gains_words
from tfarm.report.cases import Case, has_loop
from tfarm.report.sections import PageSection, Picture, prose, upper
from tfarm.response.frequency import AXIS_SHARE, Bode, bode
from tfarm.schema import Quantity, Table, curve_table, table
from tfarm.spectrum.table import default_gains

SPANS_ON_ALL = (  # title, unit and name of a margin in the frequency range
    ("phase margin", "deg", "phase"),
    ("delay margin", "s", "delay"),
    ("disk margin", "", "disk"),
)


def bode_section(case: Case, output: str) -> PageSection:
    """One output: picture, its meaning, poles and zeros."""
    data = bode(case.arm, output)
    anchor, what = f"bode-{output.replace('_', '-')}", f"{data.input_label} to {data.label}"
    title = f"From {what}"
    if data.is_zero:
        words = (f"The {data.label} is zero at every frequency: this arm's tip is pinned.",)
        return PageSection(anchor=anchor, title=title, words=words)
    picture = Picture(
        stem=anchor,
        title=upper(f"{what}: magnitude and phase"),
        caption=bode_words(data),
        alt=prose("bode_alt", data=data, start=float(abs(data.value[0]))),
        figure=bode_plot.figure(data),
        data=curve_table(data, stem=f"{anchor}-data", title=what),
    )
    complete = prose("bode_roots", data=data, boxes=_boxes(data))
    if not data.poles.size and not data.zeros.size:
        return PageSection(anchor=anchor, title=title, words=(f"{complete} There are none.",), blocks=(picture,))
    caption, roots = f"{complete} {prose('bode_magnitudes')}", [*data.pole_list, *data.zero_list]
    titles = {"stem": f"{anchor}-roots", "title": f"Poles and zeros, {what}", "caption": caption}
    listed_roots = table(roots, parent=data, **titles)
    return PageSection(anchor=anchor, title=title, blocks=(picture, listed_roots))


def bode_words(data: Bode) -> str:
    """The range of the picture, its extrema, and their meaning for control."""
    right = data.zeros[data.zeros.real > AXIS_SHARE * abs(data.zeros)]
    count, slowest = int(np.sum(right.imag == 0) + 2 * np.sum(right.imag > 0)), float(abs(right).min(initial=np.inf))
    return prose("bode", data=data, right=count, slowest=slowest, turned=float(np.ptp(data.phase)))


def _boxes(data: Bode) -> list[str]:
    """The widths in which poles and zeros are complete, one where both are the same."""
    pairs = {"poles": data.pole_width, "zeros": data.zero_width}
    found = {name: f"{plain(left, 5)} < Re s < {plain(right, 5)} 1/s"
             for name, (left, right) in pairs.items() if not math.isinf(left)}  # fmt: skip
    if len(found) == len(pairs) and len(set(found.values())) == 1:
        return [found["poles"]]
    return [f"{name} {width}" for name, width in found.items()]


def fit_section(case: Case, count: int = ARMS) -> PageSection:
    """Measurements, the fitted numbers with their intervals, and the share of possible arms on which a loop holds."""
    fit = case.fit
    assert fit is not None
    words = [f"{upper(each)}." for each in fit.not_determined]
    blocks: list[Picture | Table] = []
    if fit.responses:
        names = listed([f"{each.label} [{each.unit}]" for each in fit.responses])
        blocks.append(Picture(
            stem="fit-overlay", title="Measured over fitted", caption=prose("fit_overlay", names=names),
            alt=f"Measured and computed responses: {names}.", figure=fitted.figure(fit),
        ))  # fmt: skip
    blocks.append(table(fit.parameters, stem="fit", title="Fitted numbers"))
    if fit.resonances:
        blocks.append(table(fit.resonances, stem="fit-resonances", title="Resonances", caption=prose("fit_resonances")))
    try:
        those = possible(fit, count)
    except ConvergenceError as error:
        words.append(f"What the data leave of a loop is not drawn: {error}.")
    else:
        notes, more = _onwards(those)
        words += notes
        blocks += more
    answer = prose("fit", verdict=fit.verdict, found=fit.in_words)
    return PageSection(anchor="fit", title="Fitted to measurements", answer=answer, words=words, blocks=blocks)


class MarginSpan(NamedTuple):
    """A margin over the possible arms."""

    margin: Annotated[str, Quantity("of the loop", help="stability margin of the default loop")]
    unit: Annotated[str, Quantity("unit", help="unit of the margin")]
    lowest: Annotated[float, Quantity("lowest", digits=4, help="least over the arms on which the loop is stable")]
    highest: Annotated[float, Quantity("highest", digits=4, help="largest over the arms on which the loop is stable")]


def _onwards(those: Possible) -> tuple[list[str], list[Picture | Table]]:
    """The band of a response, the map with the share of arms, and the margins over all arms."""
    words, blocks, arm = list[str](), list[Picture | Table](), those.fit.arm
    if those.fit.responses:
        blocks.append(Picture(
            stem="fit-band", title="The arms that the data leave possible",
            caption=f"The magnitude of the root moment of {len(those.arms)} arms drawn about the best: all explain the "
            "data.",
            alt="Band of the root moment's magnitude over frequency.", figure=draw_band(those, "root_moment"),
        ))  # fmt: skip
    if not has_loop(arm):
        return words, blocks
    law = default_gains(arm)
    every, gains = [margins(each, law) for each in those.arms], gains_words(law)
    stable = [each for each in every if each.in_band is not None]
    words.append(prose("fit_share", gains=gains, stable=len(stable), every=len(every)))
    blocks.append(Picture(
        stem="fit-map", title="Gains on all of these arms", caption=prose("fit_map"),
        alt="Map of the share of arms on which gains hold.", figure=draw_share(those, ranges_of(arm)),
    ))  # fmt: skip
    ends = (each.windows[MOMENT_GAIN].around for each in stable)
    found = [(f"{MOMENT_GAIN} up to", "", [pair[1] for pair in ends if pair is not None])]
    for title, unit, name in SPANS_ON_ALL:
        values = [getattr(each.in_band, name) for each in stable]
        found.append((title, unit, [value for value in values if value is not None]))
    if rows := [MarginSpan(title, unit, min(own), max(own)) for title, unit, own in found if own]:
        blocks.append(
            table(
                rows,
                stem="fit-margins",
                title="Margins over these arms",
                caption=f"Of {gains} over the {len(stable)} arms on which it holds.",
            )
        )
    return words, blocks


def measured_section(case: Case) -> PageSection:
    """Each response over the exact one, with the differences."""
    blocks: list[Picture | Table] = []
    words: list[str] = []
    for number, one in enumerate(case.measured, start=1):
        found = overlay(case.arm, one)
        name = found.measured.label
        label = f"-{number}" if len(case.measured) > 1 else ""
        blocks.append(Picture(
            stem=f"measured{label}", title=name, caption=prose("measured_curves"),
            alt=f"Measured and exact response {name}.", figure=measured_plot.figure(found),
            data=Table(stem=f"measured{label}-data", title=name, columns=found.csv_table.columns),
        ))  # fmt: skip
        for stem, title, rows in (
            ("modes", "Mode by mode", found.modes),
            ("required", "Single changes that explain a mode", found.required_changes),
        ):
            if rows:
                blocks.append(
                    table(rows, stem=f"measured-{stem}{label}", title=title, caption=prose(f"measured_{stem}"))
                )
        words.append(prose("measured_response", name=name, found=found, peaks=found.unmatched / (2 * math.pi)))
    return PageSection(anchor="bode-measured", title="Measured over exact", words=words, blocks=blocks)
