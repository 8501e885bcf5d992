"""The candidates of `assumptions` as commands and pages have them, and the answer of `tfarm assumptions`."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

from tfarm.arm import MOMENT_GAIN, PLANE, Arm
from tfarm.columns import ANSWER, JSON, REPORT, TERMINAL, Column, Table
from tfarm.digits import fixed, general, plain, significant, singly
from tfarm.errors import ParameterError
from tfarm.spectrum.scales import default_gains

from .assumptions import (
    HubStudy,
    LoopVerdict,
    SectionStudy,
    has_hub_inertia,
    hub_study,
    loop_verdicts,
    section_study,
)

Study = SectionStudy | HubStudy

HELD_SECTION = "area, shear factor and all else held: I = A depth^2/12, so one per cent of depth counts twice"
HELD_HUB = "all else held"
OWN = "#eaf1f8"  # on a page behind the row of the arm itself
NO_EDGE = "-"  # where no gain on the moment is stable


def _tints(study: Study) -> list[str]:
    return [OWN if own else "" for own in study.is_own]


_size = partial(Column, digits=singly(plain, 4), printed=singly(general, 4), tint=_tints)
SECTION_COLUMNS = (
    _size("depth_m", "depth", "m", of="depth"),
    _size("width_m", "width", "m", of="width"),
    _size("second_moment_m4", "I", "m⁴", of="second_moment", head="I [m^4]"),
)
HUB_COLUMNS = (_size("hub_inertia_kg_m2", "I_h", "kg m²", of="hub_inertia", head="I_h [kg m^2]"),)


def candidates(study: Study) -> Table:
    """A row a candidate: its size, frequencies [rad/s], sensitivities, and what becomes of the default loop."""
    size, parameter = (HUB_COLUMNS, "I_h") if isinstance(study, HubStudy) else (SECTION_COLUMNS, "I")
    columns = (
        Column("is_own", head="", printed=lambda values: ["*" * own for own in values], on=ANSWER),
        Column("is", of=["this arm" if own else "" for own in study.is_own], tint=_tints, on=REPORT),
        *size,
        Column("natural_frequency_rad_s", of="natural_frequency", on=(JSON,)),
        Column("sensitivity", on=(JSON,)),
        *_modes(study, parameter),
        *loop_columns(study, loop_verdicts(study)),
    )
    return Table(columns=columns, record=study, keys=2)


def _modes(study: Study, parameter: str) -> Iterator[Column]:
    """Frequencies, then sensitivities on a page; on a terminal in pairs."""
    pairs = list(enumerate(zip(study.natural_frequency.T, study.sensitivity.T, strict=True), 1))
    frequency, sensitivity = (partial(Column, group=name, tint=_tints, on=REPORT)
                              for name in ("natural frequency", "sensitivity"))  # fmt: skip
    for i, (omega, _) in pairs:
        yield frequency(f"mode_{i}_rad_s", f"mode {i}", "rad/s", of=omega, digits=singly(significant, 6))
    for i, (_, slope) in pairs:
        yield sensitivity(f"mode_{i}_sensitivity", f"mode {i}", "%/%", of=slope, digits=partial(fixed, decimals=4))
    for i, (omega, slope) in pairs:
        yield Column("", f"w{i}", "rad/s", of=omega, digits=singly(general, 8), on=(TERMINAL,))
        yield Column("", f"%/% {parameter}", of=slope, digits=singly("{:.4f}".format), on=(TERMINAL,))


def loop_columns(study: Study, found: tuple[LoopVerdict, ...] | None) -> Iterator[Column]:
    """The verdict on the default loop, and the upper edge of its moment gain; not on a page where there is no loop."""
    verdicts = found or (LoopVerdict("no loop", None),) * len(study.arms)
    law, edges = default_gains(study.arm), [each.K2_below for each in verdicts]
    group = f"loop at {', '.join(law.told(name, lambda gain: plain(gain, 4)) for name in PLANE)}"
    everywhere = (*ANSWER, *REPORT) if found else ANSWER
    words = [each.verdict for each in verdicts]
    yield Column("verdict", "verdict", of=words, head="loop", group=group, tint=_tints, on=everywhere)
    shown = [NO_EDGE if edge is None else general(edge, 6) for edge in edges]
    yield Column("K2_below", of=edges, head=f"{MOMENT_GAIN} below", shown=shown, on=ANSWER)
    yield Column("K2_below_is_edge", of=[each.is_edge for each in verdicts], on=(JSON,))
    if found:
        texts = [NO_EDGE if each.K2_below is None else _edge(each.K2_below, each.is_edge) for each in found]
        values = ["" if edge is None else edge for edge in edges]
        yield Column(
            "K2_below", f"stable below {MOMENT_GAIN}", of=values, shown=texts, group=group, tint=_tints, on=REPORT
        )


def _edge(gain: float, is_edge: bool) -> str:
    """An edge, or with a star the end of a search that found none."""
    return significant(gain, 6) if is_edge else f"{plain(gain, 6)}*"


def assumptions_answer(arm: Arm, count: int) -> dict[str, Any]:
    """The answer of `tfarm assumptions --json`; "hub" is null where the hub has no inertia to choose.

    Raises ParameterError for a rig: what the paper leaves open are section and hub of one beam.
    """
    if not arm.is_uniform:
        remedy = "the assumptions looked at are the paper's, of one Timoshenko beam on a hub; this is a rig"
        raise ParameterError(key="arm", value=arm.name, remedy=remedy)
    section = {
        "shape": "rectangle",
        "area_m2": arm.link.section.area,
        "shear_factor": arm.link.shear_factor,
        "sensitivity_to": "second_moment",
        "held": HELD_SECTION,
        "candidates": candidates(section_study(arm, count=count)),
    }
    hub = None
    if has_hub_inertia(arm):
        study = hub_study(arm, count=count)
        hub = {
            "sensitivity_to": "hub_inertia",
            "held": HELD_HUB,
            "candidates": candidates(study),
            "locked_rad_s": study.locked.tolist(),
            "pinned_rad_s": study.pinned.tolist(),
        }
    law = default_gains(arm)
    return {
        "arm": arm.name,
        "count": count,
        "gains": {name: law[name] for name in PLANE},
        "section": section,
        "hub": hub,
    }
