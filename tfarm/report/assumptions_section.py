"""What the assumptions do: natural frequencies over the sections and the hub inertias that could be chosen."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from tfarm.arm import Arm
from tfarm.audit.assumptions import (
    HubStudy,
    LoopVerdict,
    SectionStudy,
    has_hub_inertia,
    hub_study,
    loop_verdicts,
    section_study,
)
from tfarm.columns import Column, Table
from tfarm.digits import fixed, plain, significant, singly
from tfarm.report.assumptions_pictures import Study, hub_picture, section_picture
from tfarm.report.figures import Picture
from tfarm.report.paper import is_from_paper
from tfarm.report.sections import Section
from tfarm.response.frequency import Real
from tfarm.spectrum.scales import default_gains

Verdicts = tuple[LoopVerdict, ...] | None
OWN = "#eaf1f8"  # behind the row of the arm itself

FROM_PAPER = (
    "The paper prints the area of the section, but neither its second moment I nor the hub inertia I_h. Every "
    "frequency in rad/s on this page rests on {assumed}: here is what other values would do."
)
TWO_ASSUMED, ONE_ASSUMED = "the two values assumed for them", "the one assumed for I, and on a hub that is {what}"
NOT_FROM_PAPER = "What would another section of the same area do{hub}? Everything else is as this arm has it."
SECTION_WORDS = (
    "Rectangles of {area} m² with a depth of {least} to {most} m in the plane of bending: the first natural frequency "
    "runs from {low} to {high} rad/s; here, at {own} m, it is {here} rad/s, and one per cent more depth changes it by "
    "{slope} %."
)
HUB_WORDS = (
    "Hub inertias of {least} to {most} kg m^2: the first natural frequency runs from {low} to {high} rad/s; here, at "
    "{own} kg m^2, it is {here} rad/s, and one per cent more inertia changes it by {slope} %. No hub, however light or "
    "heavy, takes it outside {locked} to {pinned} rad/s."
)
NO_HUB = "The hub of this arm is {what}, so there is no inertia to choose."
SECTION_TABLE = (
    "The shaded row is this arm. Sensitivity: per cent of natural frequency for one per cent more of I, with the area, "
    "the shear factor and all else held, exact. As I = A depth²/12, one per cent of depth counts twice. A slender arm "
    "has 0.5 throughout.{searched}"
)
HUB_TABLE = (
    "The shaded row is this arm. Sensitivity: per cent of natural frequency for one per cent more of I_h, all else "
    "held, exact. The closer to zero, the less that frequency depends on the hub.{searched}"
)
SEARCHED = " *: no limit was found up to there; the search ends."


def assumptions_section(arm: Arm) -> Section:
    """Frequencies over depth and over hub inertia, with sensitivities, each as a picture and as a table."""
    section = section_study(arm)
    words = [_opening(arm), _section_words(section)]
    blocks: list[Picture | Table] = [section_picture(section), section_table(section)]
    if has_hub_inertia(arm):
        hub = hub_study(arm)
        words.append(_hub_words(hub))
        blocks += [hub_picture(hub), hub_table(hub)]
    else:
        words.append(NO_HUB.format(what=_held_hub(arm)))
    return Section(anchor="assumptions", title="What the assumptions do", words=words, blocks=blocks)


# ------------------------------------------------------------ words


def _opening(arm: Arm) -> str:
    """What was assumed, or what is asked."""
    if not is_from_paper(arm):
        return NOT_FROM_PAPER.format(hub=", and another hub" * has_hub_inertia(arm))
    one = ONE_ASSUMED.format(what=_held_hub(arm))
    return FROM_PAPER.format(assumed=TWO_ASSUMED if has_hub_inertia(arm) else one)


def _held_hub(arm: Arm) -> str:
    return "locked" if arm.is_locked else "a free pin"


def _section_words(study: SectionStudy) -> str:
    slope = fixed(2 * study.sensitivity[study.is_own][0, :1], 3)[0]
    area = plain(study.arm.link.section.area, 4)
    return SECTION_WORDS.format(area=area, slope=slope, **_ends(study.depth, study))


def _hub_words(study: HubStudy) -> str:
    slope = fixed(study.sensitivity[study.is_own][0, :1], 3)[0]
    limits = {"locked": significant(float(study.locked[0]), 5), "pinned": significant(float(study.pinned[0]), 5)}
    return HUB_WORDS.format(slope=slope, **limits, **_ends(study.hub_inertia, study))


def _ends(values: Real, study: Study) -> dict[str, str]:
    """The range of the candidates, that of the first frequency, and where the arm itself is."""
    first = study.natural_frequency[:, 0]
    own = int(np.flatnonzero(study.is_own)[0])
    texts = {"least": values.min(), "most": values.max(), "own": values[own]}
    frequencies = {"low": first.min(), "high": first.max(), "here": first[own]}
    return {name: plain(float(x), 4) for name, x in texts.items()} | {
        name: significant(float(x), 5) for name, x in frequencies.items()
    }


# ------------------------------------------------------------ tables


def section_table(study: SectionStudy) -> Table:
    """A row a candidate section."""
    verdicts = loop_verdicts(study)
    size = (
        _value("depth_m", "depth", "m", study.depth, study),
        _value("width_m", "width", "m", study.width, study),
        _value("second_moment_m4", "I", "m⁴", study.second_moment, study),
    )
    return Table(
        stem="assumptions-section",
        title="Candidate sections: rectangles of this area",
        caption=SECTION_TABLE.format(searched=_searched(verdicts)),
        columns=(_which(study), *size, *_modes(study), *_loop(study, verdicts)),
    )


def hub_table(study: HubStudy) -> Table:
    """A row a hub inertia."""
    verdicts = loop_verdicts(study)
    return Table(
        stem="assumptions-hub",
        title="Candidate hub inertias",
        caption=HUB_TABLE.format(searched=_searched(verdicts)),
        columns=(
            _which(study),
            _value("hub_inertia_kg_m2", "I_h", "kg m²", study.hub_inertia, study),
            *_modes(study),
            *_loop(study, verdicts),
        ),
    )


def _which(study: Study) -> Column:
    """Says in words what the shade says."""
    texts = ["this arm" if own else "" for own in study.is_own]
    return Column("is", "", of=texts, tint=_tint(study))


def _value(key: str, title: str, of: str, values: Real, study: Study) -> Column:
    return Column(key, title, of, of=values, digits=singly(plain, 4), tint=_tint(study))


def _modes(study: Study) -> Iterator[Column]:
    for i, omega in enumerate(study.natural_frequency.T, 1):
        yield Column(
            f"mode_{i}_rad_s", f"mode {i}", "rad/s", of=omega, digits=singly(significant, 6),
            group="natural frequency", tint=_tint(study),
        )  # fmt: skip
    for i, slope in enumerate(study.sensitivity.T, 1):
        yield Column(
            f"mode_{i}_sensitivity",
            f"mode {i}",
            "%/%",
            of=slope,
            digits=partial(fixed, decimals=4),
            group="sensitivity",
            tint=_tint(study),
        )


def _loop(study: Study, verdicts: Verdicts) -> Iterator[Column]:
    """The verdict on the default loop, and up to which K2 it stays stable; nothing where there is no loop."""
    if verdicts is None:
        return
    words = [each.verdict for each in verdicts]
    edges = ["-" if each.K2_below is None else _edge(each.K2_below, each.is_edge) for each in verdicts]
    law = default_gains(study.arm)
    group = f"loop at K1 = {plain(law.K1, 4)}, K2 = {plain(law.K2, 4)}"
    yield Column("verdict", "verdict", of=words, group=group, tint=_tint(study))
    values = ["" if each.K2_below is None else each.K2_below for each in verdicts]
    yield Column("K2_below", "stable below K2", of=values, digits=edges, group=group, tint=_tint(study))


def _searched(verdicts: Verdicts) -> str:
    """What a star means, where there is one."""
    return SEARCHED if any(each.K2_below is not None and not each.is_edge for each in verdicts or ()) else ""


def _edge(K2: float, is_edge: bool) -> str:
    return significant(K2, 6) if is_edge else f"{plain(K2, 6)}*"


def _tint(study: Study) -> list[str]:
    return [OWN if own else "" for own in study.is_own]
