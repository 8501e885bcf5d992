"""Frequency responses: for each output its Bode plot and its poles and zeros."""

from __future__ import annotations

import math
from operator import attrgetter

import numpy as np

from tfarm.arm import Arm
from tfarm.digits import how_many, plain, significant
from tfarm.plots.frequency import bode as bode_plot
from tfarm.report.sections import PageSection, Picture
from tfarm.report.words import upper
from tfarm.response.answers import bode_table, roots_table
from tfarm.response.frequency import AXIS_SHARE, Bode, Extremum, bode

MAGNITUDE = attrgetter("magnitude")
ROOTS_CAPTION = (
    "Those below the real axis are their mirror images. A damping ratio of 100 % is a real root in the left "
    "half-plane, −100 % one in the right. Magnitude: at s = i Im s (real roots: at s = i |s|)."
)


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
        data=bode_table(data, f"{anchor}-data"),
    )
    if not data.poles.size and not data.zeros.size:
        return PageSection(
            anchor=anchor, title=title, words=(f"{completeness(data)} There are none.",), blocks=(picture,)
        )
    caption = f"{completeness(data)} {ROOTS_CAPTION}"
    roots = roots_table(data, "pole", "zero", stem=f"{anchor}-roots", caption=caption)
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
    if not data.resonances.size and data.output == "root_moment" and data.arm.has_massless_hub:
        gauge = "−u/(1 + C s)" if data.arm.damping else "−u"
        return f"Nothing resonates here: a free pin passes the torque on to the link; the gauge there reads {gauge}."
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
