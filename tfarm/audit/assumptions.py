"""What the assumptions do: natural frequencies over the sections and hubs that the paper leaves open.

The paper gives an area, 6e-4 m^2, but neither the second moment I nor the hub inertia I_h.  Two studies walk through
the candidates, one parameter at a time, everything else being the arm's own.  Both rest on the exact solution, and
the sensitivities are exact too (`Modes.sensitivity`); frequencies are those of the undamped arm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import MOMENT_GAIN, PLANE, Arm, Section
from tfarm.arrays import Real
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.stability import stability
from tfarm.loop.windows import windows_of
from tfarm.records import record
from tfarm.schema import Quantity
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One candidate section or hub inertia, and the loop under the default gains of the arm itself."""

    is_own: Annotated[bool, Quantity("this arm")]
    depth: Annotated[float | None, Quantity("depth", "m", 4)] = None
    width: Annotated[float | None, Quantity("width", "m", 4)] = None
    second_moment: Annotated[float | None, Quantity("I", "m^4", 4, key="second_moment_m4")] = None
    hub_inertia: Annotated[float | None, Quantity("I_h", "kg m^2", 4, key="hub_inertia_kg_m2")] = None
    natural_frequency: Annotated[list[float], Quantity("natural frequencies", "rad/s")]
    sensitivity: Annotated[list[float], Quantity("sensitivities", "%/%", 4, "of frequency to I or I_h, exact")]
    verdict: Annotated[str, Quantity("loop")]
    K2_below: Annotated[float | None, Quantity(f"stable below {MOMENT_GAIN}", help="of the default loop")]
    K2_below_is_edge: Annotated[bool, Quantity("stability limit there")]


def candidates(study: Study) -> list[Candidate]:
    """A row a candidate."""
    verdicts = loop_verdicts(study) or (LoopVerdict("no loop", None),) * len(study.arms)
    rows = zip(study.is_own.tolist(), study.values.tolist(), study.natural_frequency.tolist(),
               study.sensitivity.tolist(), verdicts, strict=True)  # fmt: skip
    return [
        Candidate(is_own=own, natural_frequency=omega, sensitivity=slopes, verdict=loop.verdict, K2_below=loop.K2_below,
                  K2_below_is_edge=loop.is_edge, **_size(study, value))
        for own, value, omega, slopes, loop in rows
    ]  # fmt: skip


def _size(study: Study, value: float) -> dict[str, float]:
    """The varied parameter and those that go with it."""
    area = study.arm.link.section.area
    if study.pinned.size:
        return {"hub_inertia": value}
    return {"depth": value, "width": area / value, "second_moment": area * value**2 / 12}


@dataclass(frozen=True)
class SectionStudy:
    """Rectangles of the arm's area."""

    study: Study

    @property
    def area(self) -> Annotated[float, Quantity("area", "m^2", key="area_m2")]:
        """The area of the section."""
        return self.study.arm.link.section.area

    @property
    def shear_factor(self) -> Annotated[float, Quantity("shear factor")]:
        """The shear factor of the section."""
        return self.study.arm.link.shear_factor

    @property
    def held(self) -> Annotated[str, Quantity("sensitivity to I")]:
        """What is held."""
        return HELD_SECTION

    @property
    def candidates(self) -> Annotated[list[Candidate], Quantity("candidate sections")]:
        """A row a candidate."""
        return candidates(self.study)


@dataclass(frozen=True)
class HubStudy:
    """Hub inertias."""

    study: Study

    @property
    def held(self) -> Annotated[str, Quantity("sensitivity to I_h")]:
        """What is held."""
        return HELD_HUB

    @property
    def locked(self) -> Annotated[list[float], Quantity("locked hub (I_h = inf) [rad/s]", key="locked_rad_s")]:
        """The limits of a heavy hub."""
        return list(self.study.locked.tolist())

    @property
    def pinned(self) -> Annotated[list[float], Quantity("free pin (I_h = 0) [rad/s]", key="pinned_rad_s")]:
        """The limits of a light one."""
        return list(self.study.pinned.tolist())

    @property
    def candidates(self) -> Annotated[list[Candidate], Quantity("candidate hub inertias")]:
        """A row a candidate."""
        return candidates(self.study)


@dataclass(frozen=True)
class Assumptions:
    """The effect of the assumed section and hub; no hub where that has no inertia to choose."""

    arm: Annotated[str, Quantity("arm")]
    count: Annotated[int, Quantity("flexible modes")]
    gains: Annotated[dict[str, float], Quantity("gains of the loop")]
    section: Annotated[SectionStudy, Quantity("section")]
    hub: Annotated[HubStudy | None, Quantity("hub")]


def assumptions(arm: Arm, count: int) -> Assumptions:
    """Frequencies over the candidates of section and hub inertia.

    Raises ParameterError for a rig: what the paper leaves open are section and hub of one beam.
    """
    if not arm.is_uniform:
        remedy = "the assumptions looked at are the paper's, of one Timoshenko beam on a hub; this is a rig"
        raise ParameterError(key="arm", value=arm.name, remedy=remedy)
    hub = HubStudy(hub_study(arm, count=count)) if has_hub_inertia(arm) else None
    law = default_gains(arm)
    section = SectionStudy(section_study(arm, count=count))
    return Assumptions(arm.name, count, {name: law[name] for name in PLANE}, section, hub)
