"""What the assumptions do: natural frequencies over the sections and hubs that the paper leaves open.

The paper gives an area, 6e-4 m^2, but neither the second moment I nor the hub inertia I_h.  Two studies walk through
the candidates, one parameter at a time, everything else being the arm's own.  Both rest on the exact solution, and
the sensitivities are exact too (`Modes.sensitivity`); frequencies are those of the undamped arm.

The candidates of `assumptions` as commands and pages have them, and the answer of `tfarm assumptions`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import MOMENT_GAIN, PLANE, Arm, Section
from tfarm.arrays import Real
from tfarm.columns import ANSWER, JSON, REPORT, TERMINAL, Column, Table
from tfarm.digits import fixed, general, plain, significant, singly
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.stability import stability
from tfarm.loop.windows import windows_of
from tfarm.records import record
from tfarm.spectrum import modes
from tfarm.spectrum.table import default_gains

STUDIED_MODES = 4  # flexible modes, unless told
AREA = 6.0e-4  # m^2, the paper's
DEPTHS = (0.002, 0.003, 0.004, 0.006, 0.008, 0.010, 0.015, 0.020, 0.030, 0.040, 0.060)  # m, for that area
INERTIAS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # kg m^2, about the value assumed for the paper's hub
OWN_VALUE = 1e-9  # relative: so near to the arm's own value a candidate is that value


@dataclass(frozen=True, slots=True, kw_only=True)
@record
class Study:
    """Frequencies over the candidates of one assumed parameter, a row a candidate.

    `values` (n,) are depths [m] of rectangles of the arm's own area, in the plane of bending, or hub inertias [kg m^2].
    `natural_frequency` [rad/s] and `sensitivity`, d ln w/d ln of the second moment (area, shear factor and all else
    held) or of the inertia, are (n, count), flexible modes from the first.  `is_own` marks the arm's own value, or for
    another shape the rectangle with its area and second moment: only these two and the shear factor enter.  `pinned`
    and `locked` [rad/s] are the limits of every column for a free pin and for the locked hub; empty of a section.
    """

    arm: Arm
    arms: tuple[Arm, ...]
    values: Real
    natural_frequency: Real
    sensitivity: Real
    is_own: NDArray[np.bool_]
    pinned: Real = field(default_factory=lambda: np.empty(0))
    locked: Real = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True, slots=True)
class LoopVerdict:
    """What becomes of the default loop: "stable", "marginal", "unstable" or "undecided", and the upper edge of
    the gain on the moment.

    `K2_below` is None where the loop is not stable.  `is_edge`: whether poles reach the axis there; the search for
    such a gain may have ended before.
    """

    verdict: str
    K2_below: float | None
    is_edge: bool = False


def loop_verdicts(study: Study) -> tuple[LoopVerdict, ...] | None:
    """The verdict on each candidate under the default gains of the arm itself.

    None where the hub is locked or a free pin: the moment has no loop there.
    """
    if not all(has_hub_inertia(arm) for arm in study.arms):
        return None
    law, verdicts = default_gains(study.arm), []
    for arm in study.arms:
        try:
            found = stability(arm, law)
            around = (windows := windows_of(found, [MOMENT_GAIN])[MOMENT_GAIN]).around
        except ConvergenceError:
            verdicts.append(LoopVerdict("undecided", None))
            continue
        is_edge = around is not None and windows.end(around[1]) == "edge"
        verdicts.append(LoopVerdict(found.verdict, None if around is None else around[1], is_edge))
    return tuple(verdicts)


def own_depth(arm: Arm) -> float:
    """sqrt(12 I/A) [m], the depth of the rectangle with the arm's area and second moment."""
    return math.sqrt(12.0) * arm.link.section.radius_of_gyration


def has_hub_inertia(arm: Arm) -> bool:
    """Whether the hub has an inertia that could be another: neither locked (inf) nor a free pin (0)."""
    return 0.0 < arm.hub.inertia < math.inf


def section_study(arm: Arm, depths: Sequence[float] | None = None, *, count: int = STUDIED_MODES) -> Study:
    """The first `count` flexible frequencies over rectangles of the arm's area with these depths [m].

    Without depths 2 to 60 mm for the paper's area, scaled with the root of the area to two digits, and the arm's own.
    The shear factor is the arm's own throughout.
    """
    area, own = arm.link.section.area, own_depth(arm)
    if depths is None:
        depths = _with_own([float(f"{depth * math.sqrt(area / AREA):.2g}") for depth in DEPTHS], own)
    second_moments = [area * depth**2 / 12 for depth in depths]
    sections = (Section.general(area=area, second_moment=I, shear_factor=arm.link.shear_factor) for I in second_moments)
    arms = [replace(arm, link=replace(arm.link, section=section)) for section in sections]
    return _study(arm, arms, np.array(depths), own, count, "second_moment")


def hub_study(arm: Arm, inertias: Sequence[float] | None = None, *, count: int = STUDIED_MODES) -> Study:
    """The first `count` flexible frequencies over hub inertias [kg m^2] of a hub that has one.

    Without inertias 0.01 to 1, moved by whole decades if the arm's own lies outside, and the arm's own.
    """
    own = arm.hub.inertia
    if inertias is None:
        decades = min(0, math.floor(math.log10(own / INERTIAS[0]) + OWN_VALUE))
        decades += max(0, math.ceil(math.log10(own / INERTIAS[-1]) - OWN_VALUE))
        inertias = _with_own([inertia * 10.0**decades for inertia in INERTIAS], own)
    arms = [arm.having(hub_inertia=inertia) for inertia in inertias]
    pinned, locked = ([arm.having(hub_inertia=limit)] for limit in (0.0, math.inf))
    limits = {
        name: _frequencies(one, count, "hub_inertia")[0][0] for name, one in (("pinned", pinned), ("locked", locked))
    }
    if not arm.having(hub_inertia=1.0).has_rigid_mode:  # the first falls to 0, a heavy hub on the arm's own stiffness
        limits["locked"] = np.r_[0.0, limits["locked"][:-1]]
    return replace(_study(arm, arms, np.array(inertias), own, count, "hub_inertia"), **limits)


def _study(arm: Arm, arms: Sequence[Arm], values: Real, own: float, count: int, parameter: str) -> Study:
    frequency, sensitivity = _frequencies(arms, count, parameter)
    return Study(
        arm=arm,
        arms=tuple(arms),
        values=values,
        natural_frequency=frequency,
        sensitivity=sensitivity,
        is_own=abs(values / own - 1) < OWN_VALUE,
    )


def _frequencies(arms: Sequence[Arm], count: int, parameter: str) -> tuple[Real, Real]:
    """Flexible frequencies [rad/s] and their sensitivities to one parameter, each of shape (arms, count)."""
    tables = [modes(arm, count) for arm in arms]
    frequency = np.array([table.natural_frequency[-count:] for table in tables])
    return frequency, np.array([table.sensitivity[parameter][-count:] + 0.0 for table in tables])


def _with_own(candidates: Sequence[float], own: float) -> list[float]:
    """The candidates and the arm's own value, ascending; one that is it, but for rounding, gives way."""
    return sorted([*(value for value in candidates if abs(value / own - 1) >= OWN_VALUE), own])


HELD_SECTION = "area, shear factor and all else held: I = A depth^2/12, so one per cent of depth counts twice"
HELD_HUB = "all else held"
OWN = "#eaf1f8"  # on a page behind the row of the arm itself
NO_EDGE = "-"  # where no gain on the moment is stable


def _tints(study: Study) -> list[str]:
    return [OWN if own else "" for own in study.is_own]


_size = partial(Column, digits=singly(plain, 4), printed=singly(general, 4), tint=_tints)
SECTION_COLUMNS = (
    _size("depth_m", "depth", "m", of="values"),
    _size("width_m", "width", "m", of=lambda study: study.arm.link.section.area / study.values),
    _size(
        "second_moment_m4",
        "I",
        "m⁴",
        head="I [m^4]",
        of=lambda study: study.arm.link.section.area * study.values**2 / 12,
    ),
)
HUB_COLUMNS = (_size("hub_inertia_kg_m2", "I_h", "kg m²", of="values", head="I_h [kg m^2]"),)


def candidates(study: Study) -> Table:
    """A row a candidate: its size, frequencies [rad/s], sensitivities, and what becomes of the default loop."""
    size, parameter = (HUB_COLUMNS, "I_h") if study.pinned.size else (SECTION_COLUMNS, "I")
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
