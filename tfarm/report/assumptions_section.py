"""What the assumptions do: natural frequencies over the sections and the hub inertias that could be chosen."""

from __future__ import annotations

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.audit.assumptions import (
    Study,
    has_hub_inertia,
    hub_study,
    section_study,
)
from tfarm.columns import Table
from tfarm.digits import fixed, plain, significant
from tfarm.report.arm_section import is_from_paper
from tfarm.report.sections import PageSection, Picture
from tfarm.schema import table

PAPER_LEAVES_OPEN = (
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
OF_ONE_BEAM = (
    "What another section or another hub inertia would do is studied for an arm of one segment on a hub and no more; "
    "this is a rig, each of whose parts has assumptions of its own. To see what one does, change it in the file."
)
NO_HUB = "The hub of this arm is {what}, so there is no inertia to choose."
SECTION_TABLE = (
    "Sensitivity: per cent of natural frequency for one per cent more of I, with the area, "
    "the shear factor and all else held, exact. As I = A depth²/12, one per cent of depth counts twice. A slender arm "
    "has 0.5 throughout."
)
HUB_TABLE = (
    "Sensitivity: per cent of natural frequency for one per cent more of I_h, all else "
    "held, exact. The closer to zero, the less that frequency depends on the hub."
)


def assumptions_section(arm: Arm) -> PageSection:
    """Frequencies over depth and over hub inertia, with sensitivities, each as a table."""
    title = "What the assumptions do"
    if not arm.is_uniform:
        return PageSection(anchor="assumptions", title=title, words=(OF_ONE_BEAM,))
    section = section_study(arm)
    area, slope = plain(arm.link.section.area, 4), fixed(2 * section.sensitivity[section.is_own][0, :1], 3)[0]
    words = [opening(arm), SECTION_WORDS.format(area=area, slope=slope, **_ends(section.values, section))]
    blocks: list[Picture | Table] = []
    title_of = "Candidate sections: rectangles of this area"
    blocks.append(table(section.candidates, stem="assumptions-section", title=title_of, caption=SECTION_TABLE))
    if has_hub_inertia(arm):
        hub = hub_study(arm)
        limits = {"locked": significant(float(hub.locked[0]), 5), "pinned": significant(float(hub.pinned[0]), 5)}
        slope = fixed(hub.sensitivity[hub.is_own][0, :1], 3)[0]
        words.append(HUB_WORDS.format(slope=slope, **limits, **_ends(hub.values, hub)))
        of_hub = {"stem": "assumptions-hub", "title": "Candidate hub inertias", "caption": HUB_TABLE}
        blocks.append(table(hub.candidates, **of_hub))
    else:
        words.append(NO_HUB.format(what="locked" if arm.is_locked else "a free pin"))
    return PageSection(anchor="assumptions", title=title, words=words, blocks=blocks)


# ------------------------------------------------------------ words


def opening(arm: Arm) -> str:
    """What was assumed, or what is asked."""
    if not is_from_paper(arm):
        return NOT_FROM_PAPER.format(hub=", and another hub" * has_hub_inertia(arm))
    if has_hub_inertia(arm):
        return PAPER_LEAVES_OPEN.format(assumed=TWO_ASSUMED)
    return PAPER_LEAVES_OPEN.format(assumed=ONE_ASSUMED.format(what="locked" if arm.is_locked else "a free pin"))


def _ends(values: Real, study: Study) -> dict[str, str]:
    """The range of the candidates, that of the first frequency, and where the arm itself is."""
    first = study.natural_frequency[:, 0]
    own = int(np.flatnonzero(study.is_own)[0])
    texts = {"least": values.min(), "most": values.max(), "own": values[own]}
    frequencies = {"low": first.min(), "high": first.max(), "here": first[own]}
    return {name: plain(float(x), 4) for name, x in texts.items()} | {
        name: significant(float(x), 5) for name, x in frequencies.items()
    }
