"""Frequency responses on an arm's page: exact ones, measured ones over them, and the fit to measurements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.columns import Column, Table
from tfarm.digits import general, how_many, listed, plain, significant, singly
from tfarm.errors import ConvergenceError
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import ARMS, Fit, Possible, possible
from tfarm.fitting.overlay import overlay
from tfarm.loop.margins import margins
from tfarm.loop.plane import ranges_of
from tfarm.plots.frequency import bode as bode_plot
from tfarm.plots.frequency import draw_band, draw_share, fitted
from tfarm.plots.frequency import measured as measured_plot
from tfarm.plots.style import gains_words
from tfarm.report.cases import has_loop
from tfarm.report.sections import PageSection, Picture, typeset, upper
from tfarm.response.frequency import AXIS_SHARE, Bode, Extremum, bode
from tfarm.schema import curve_table, table
from tfarm.spectrum.table import default_gains

MAGNITUDE = attrgetter("magnitude")
ROOTS_CAPTION = (
    "Those below the real axis are their mirror images. A damping ratio of 100 % is a real root in the left "
    "half-plane, −100 % one in the right. Magnitude: at s = i Im s (real roots: at s = i |s|)."
)
LEVEL_WORDS = (
    "The interval holds the true number in 95 of 100 measurements, if the arm is right and the noise is as said."
)
FIT_MARGINS = (
    Column("margin", "of the loop", of=lambda row: row[0]),
    Column("unit", "unit", of=lambda row: row[1]),
    Column("lowest", "lowest", of=lambda row: row[2][0], digits=singly(general, 4)),
    Column("highest", "highest", of=lambda row: row[2][1], digits=singly(general, 4)),
)
SPANS_ON_ALL = (  # title, unit and name of a margin in the band
    ("phase margin", "deg", "phase"),
    ("delay margin", "s", "delay"),
    ("disk margin", "", "disk"),
)
MODES_CAPTION = (
    "A pole and its residue are fitted to the lines around each measured peak; off: measured against exact frequency; "
    "residue: measured over exact, in dB, and the angle it is turned by, 180 degrees for a sensor of the other sign."
)
REQUIRED_CAPTION = "What each number would have to change by to explain that mode alone, to first order in logarithms."
CURVES_CAPTION = "Points: as measured. Blue: the exact response of the arm as its file has it, nothing fitted."


def bode_section(arm: Arm, output: str) -> PageSection:
    """One output: picture, what it means, poles and zeros."""
    data = bode(arm, output)
    anchor, title = f"bode-{output.replace('_', '-')}", f"From {data.input_label} to {data.label}"
    if data.is_zero:
        words = (f"The {data.label} is zero at every frequency: this arm's tip is pinned.",)
        return PageSection(anchor=anchor, title=title, words=words)
    picture = Picture(
        stem=anchor,
        title=upper(f"{data.input_label} to {data.label}: magnitude and phase"),
        caption=f"{what_is_seen(data)} {what_it_means(data)}",
        alt=alt_text(data),
        figure=bode_plot.figure(data),
        data=curve_table(data, stem=f"{anchor}-data", title=f"{data.input_label} to {data.label}"),
    )
    if not data.poles.size and not data.zeros.size:
        return PageSection(
            anchor=anchor, title=title, words=(f"{completeness(data)} There are none.",), blocks=(picture,)
        )
    caption = f"{completeness(data)} {ROOTS_CAPTION}"
    title_of = f"Poles and zeros, {data.input_label} to {data.label}"
    roots = table([*data.pole_list, *data.zero_list], stem=f"{anchor}-roots", title=title_of, caption=caption)
    return PageSection(anchor=anchor, title=title, blocks=(picture, roots))


def what_is_seen(data: Bode) -> str:
    """The picture in words."""
    low, high = (plain(w, 5) for w in data.band)
    grid = f"The exact response at {data.omega.size} frequencies from {low} to {high} rad/s"
    if data.poles.size or data.zeros.size:
        around = f"{how_many(len(data.poles), 'pole')} and {how_many(len(data.zeros), 'zero')}"
        grid += f", spaced geometrically around its {around}"
    grid += "."
    if data.infinite.size:
        edges = "the top edge" if not data.vanishing.size else "the top edge, or the bottom edge where it is truly zero"
        infinite = "Without damping every resonance is truly infinite: there the curve is broken and ends in an open "
        return f"{grid} {infinite}triangle on {edges}."
    return f"{grid} {highest_and_lowest(data)}"


def highest_and_lowest(data: Bode) -> str:
    """The highest peak and the deepest dip, or that the magnitude has none."""

    def at(each: Extremum) -> str:
        size = significant(each.magnitude, 4)
        return f"{size} {data.gain_unit} at {significant(each.omega, 6)} rad/s"

    peak = f"Highest peak: {at(max(data.peaks, key=MAGNITUDE))}" if data.peaks else "No peak: no local maximum of |G|"
    dip = f"deepest dip: {at(min(data.dips, key=MAGNITUDE))}" if data.dips else "no dip: no local minimum of |G|"
    return f"{peak}; {dip}."


def what_it_means(data: Bode) -> str:
    """One sentence on what the picture says about control."""
    if not data.resonances.size:
        return "Nothing resonates here: no pole that oscillates shows at this output."
    turned = f"{np.ptp(data.phase):.0f} degrees over the band"
    right = data.zeros[data.zeros.real > AXIS_SHARE * abs(data.zeros)]
    if right.size:
        count = int(np.sum(right.imag == 0) + 2 * np.sum(right.imag > 0))
        slowest = significant(float(abs(right).min()), 4)
        return (
            f"{how_many(count, 'zero')} in the right half-plane, the slowest at {slowest} rad/s: the phase turns by "
            f"{turned}, and a loop closed here cannot be much faster than the slowest of them."
        )
    if np.ptp(data.phase) < 181:
        return "The phase never leaves a band of 180 degrees, as for a sensor beside the motor."
    return f"The phase turns by {turned}."


def alt_text(data: Bode) -> str:
    """The picture for those who cannot see it."""
    places = ", ".join(significant(peak.omega, 4) for peak in data.peaks[:5])
    more = " and more above" if len(data.peaks) > 5 else ""
    peaks = "infinite peaks" if all(math.isinf(peak.magnitude) for peak in data.peaks) else "peaks"
    where = f"{peaks} at {places} rad/s{more}" if data.peaks else "no peaks"
    start = f"{significant(float(abs(data.value[0])), 3)} {data.gain_unit}"
    return f"Bode plot of {data.input_label} to {data.label}: {where}; it begins at {start}."


def completeness(data: Bode) -> str:
    """What the list of roots holds, and how far it goes."""
    height = f"0 ≤ Im s < {significant(data.band[1], 6)} rad/s"
    widths = [
        "" if math.isinf(left) else f"{plain(left, 5)} < Re s < {plain(right, 5)} 1/s"
        for left, right in (data.pole_width, data.zero_width)
    ]
    named = [f"{what} {each}" for what, each in zip(("poles", "zeros"), widths, strict=True) if each]
    width = widths[0] if widths[0] == widths[1] else ", ".join(named)
    known = "confirmed by the winding number around the box" if any(widths) else "counted"
    box = f"{height}, {width}, {known}" if width else f"{height}, {known}"
    rigid = "; rigid-body poles at s = 0 apart" * data.arm.has_rigid_mode
    return f"All poles and zeros that this output shows in {box}{rigid}."


def fit_section(fit: Fit, count: int = ARMS) -> PageSection:
    """What was measured, what explains it, how sure, and on how many arms of those that remain a loop holds."""
    words = [typeset(f"{fit.verdict[0].upper()}{fit.verdict[1:]}: {fit.in_words}. {LEVEL_WORDS}")]
    words += [typeset(f"{each[0].upper()}{each[1:]}.") for each in fit.not_determined]
    blocks: list[Picture | Table] = []
    if fit.responses:
        names = listed([each.name for each in fit.responses])
        caption = f"Points: {names} as measured. Blue: the fitted arm, exact; grey: the arm that the search began with."
        blocks.append(Picture(
            stem="fit-overlay", title="Measured over fitted", caption=caption,
            alt=f"Measured and computed responses: {names}.", figure=fitted.figure(fit),
        ))  # fmt: skip
    blocks.append(table(fit.parameters, stem="fit", title="Fitted numbers"))
    if fit.resonances:
        caption = (
            "Peaks of the measured responses, and poles of the arm's: with a held hub where they are over its angle."
        )
        blocks.append(table(fit.resonances, stem="fit-resonances", title="Resonances", caption=caption))
    try:
        those = possible(fit, count)
    except ConvergenceError as error:
        words.append(typeset(f"What the data leave of a loop is not drawn: {error}."))
    else:
        said, more = _onwards(those)
        words += said
        blocks += more
    return PageSection(anchor="fit", title="Fitted to measurements", words=words, blocks=blocks)


def _onwards(those: Possible) -> tuple[list[str], list[Picture | Table]]:
    """The band of a response, the map with the share of arms, and the margins over all arms."""
    words: list[str] = []
    blocks: list[Picture | Table] = []
    if those.fit.responses:
        count = len(those.arms)
        blocks.append(Picture(
            stem="fit-band", title="The arms that the data leave possible",
            caption=f"The magnitude of the root moment of {count} arms drawn about the best: all explain the data.",
            alt="Band of the root moment's magnitude over frequency.", figure=draw_band(those, "root_moment"),
        ))  # fmt: skip
    arm = those.fit.arm
    if has_loop(arm):
        law = default_gains(arm)
        every, gains = [margins(each, law) for each in those.arms], gains_words(law)
        stable = [each for each in every if each.in_band is not None]
        share = f"{len(stable)} of {len(every)} of these arms ({plain(100 * len(stable) / len(every), 3)} %)"
        words.append(typeset(f"With {gains} the loop holds on {share}."))
        blocks.append(Picture(
            stem="fit-map", title="Gains on all of these arms",
            caption="Dark: the gains hold on every arm that the data leave possible; white: on none; continuous time.",
            alt="Map of the share of arms on which gains hold.", figure=draw_share(those, ranges_of(arm)),
        ))  # fmt: skip
        gain_ends = (each.windows[MOMENT_GAIN].around for each in stable)
        spans = [(f"{MOMENT_GAIN} up to", "", [ends[1] for ends in gain_ends if ends is not None])]
        spans += [(title, unit, [getattr(each.in_band, name) for each in stable]) for title, unit, name in SPANS_ON_ALL]
        known_values = ((title, unit, [each for each in own if each is not None]) for title, unit, own in spans)
        if rows := [(title, unit, (min(own), max(own))) for title, unit, own in known_values if own]:
            blocks.append(Table(
                columns=FIT_MARGINS, record=rows, stem="fit-margins", title="Margins over these arms",
                caption=f"Of {gains} over the {len(stable)} arms on which it holds.",
            ))  # fmt: skip
    return words, blocks


def measured_section(arm: Arm, measured: Sequence[Measured]) -> PageSection:
    """Each response over the exact one, with what differs."""
    blocks: list[Picture | Table] = []
    words: list[str] = []
    for number, one in enumerate(measured, start=1):
        found = overlay(arm, one)
        name = found.measured.name
        label = f"-{number}" if len(measured) > 1 else ""
        blocks.append(Picture(
            stem=f"measured{label}", title=name, caption=CURVES_CAPTION,
            alt=f"Measured and exact response {name}.", figure=measured_plot.figure(found),
            data=Table(stem=f"measured{label}-data", title=name, columns=found.csv_table.columns),
        ))  # fmt: skip
        if found.modes:
            stem = f"measured-modes{label}"
            blocks.append(table(found.modes, stem=stem, title="Mode by mode", caption=MODES_CAPTION))
        if found.required_changes:
            stem, title = f"measured-required{label}", "Single changes that explain a mode"
            blocks.append(table(found.required_changes, stem=stem, title=title, caption=REQUIRED_CAPTION))
        words.append(typeset(f"{name}: the rms of ln(measured/exact) is {general(found.rms_log_error, 3)}."))
        if peaks := [plain(float(peak) / (2 * math.pi), 5) for peak in found.unmatched]:
            words[-1] += typeset(f" Peaks at {', '.join(peaks)} Hz are none of the arm's.")
    return PageSection(anchor="bode-measured", title="Measured over exact", words=words, blocks=blocks)
