"""The parts of an arm as frozen records in SI units: sections, links, hub, springs, motor, attachments, payload.

Letters as in the paper: E, G, rho, A, I, kappa, C of a link; I_h, b, r of the hub; k, c of a rotary spring; R, L_a, Kt,
Ke, N, J_m, b_m, eta of the motor; m, I_c, e of the payload.  Source of the shear factors: G. R. Cowper, "The shear
coefficient in Timoshenko's beam theory", Journal of Applied Mechanics 33 (1966) 335-340, table 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING as NO_DEFAULT
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal, cast

from tfarm.arm.checks import (
    above_zero,
    check_annotated,
    finite,
    not_negative,
    not_negative_or_inf,
    number,
    positive,
)
from tfarm.errors import MISSING, must_be_known, require

MODULUS = "Young's modulus is a positive, finite number in Pa"


@dataclass(frozen=True, slots=True)
class NamedShape:
    """A named shape: its dimensions [m]; area [m^2], second moment [m^4], Cowper's factor as functions."""

    dimensions: tuple[str, ...]
    area: Callable[..., float]
    second_moment: Callable[..., float]
    cowper: Callable[..., float]


def tube_area(outer_diameter: float, inner_diameter: float) -> float:
    """Return A = pi (D - d) (D + d)/4."""
    return math.pi * (outer_diameter - inner_diameter) * (outer_diameter + inner_diameter) / 4


def tube_second_moment(outer_diameter: float, inner_diameter: float) -> float:
    """Return I = pi (D - d) (D + d) (D^2 + d^2)/64 = A (D^2 + d^2)/16."""
    return tube_area(outer_diameter, inner_diameter) * (outer_diameter**2 + inner_diameter**2) / 16


def tube_cowper(nu: float, *, outer_diameter: float, inner_diameter: float) -> float:
    """Return kappa = 6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2),  m = inner/outer."""
    m2 = (inner_diameter / outer_diameter) ** 2
    return 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)


SHAPES: Mapping[str, NamedShape] = {
    "rectangle": NamedShape(
        dimensions=("width", "depth"),
        area=lambda width, depth: width * depth,
        second_moment=lambda width, depth: width * depth**3 / 12,
        cowper=lambda nu, **_: 10 * (1 + nu) / (12 + 11 * nu),
    ),
    "round": NamedShape(
        dimensions=("diameter",),
        area=lambda diameter: math.pi * diameter**2 / 4,
        second_moment=lambda diameter: math.pi * diameter**4 / 64,
        cowper=lambda nu, **_: 6 * (1 + nu) / (7 + 6 * nu),
    ),
    "tube": NamedShape(
        dimensions=("outer_diameter", "inner_diameter"),
        area=tube_area,
        second_moment=tube_second_moment,
        cowper=tube_cowper,
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A cross-section: `area` [m^2], `second_moment` [m^4] about the bending axis, `shear_factor` [-].

    Build it by its shape, such as `Section.rectangle(width=, depth=)`; `dimensions` [m] are the arguments of that.
    A named shape without a shear factor has Cowper's.
    """

    shape: str
    area: Annotated[float, positive, "a section has a positive, finite area in m^2"]
    second_moment: Annotated[float, positive, "a section has a positive, finite second moment in m^4"]
    shear_factor: float | None = None
    dimensions: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        check_annotated(self, "link.section")
        if self.shear_factor is not None:
            meaning = (
                "a shear factor multiplies G A: above 0, up to 1 (a form factor of 6/5 is entered as 5/6)"
            )
            kappa = positive("link.section.shear_factor", self.shear_factor, meaning)
            require(kappa <= 1.0, "link.section.shear_factor", kappa, meaning)
            object.__setattr__(self, "shear_factor", kappa)
        if self.shape == "general":
            remedy = "a general section needs its own, e.g. 0.8333333333333334 for a rectangle"
            require(self.shear_factor, "link.section.shear_factor", MISSING, remedy)
        else:
            remedy = f"does not fit this {self.shape}; use Section.{self.shape}() or Section.general()"
            is_right = (self.area, self.second_moment) == _properties(self.shape, dict(self.dimensions))
            require(is_right, "link.section.area", self.area, remedy)

    @classmethod
    def rectangle(cls, *, width: float, depth: float, shear_factor: float | None = None) -> Section:
        """Build a solid rectangle, `depth` [m] in the plane of bending."""
        return cls._of_shape("rectangle", shear_factor, width=width, depth=depth)

    @classmethod
    def round(cls, *, diameter: float, shear_factor: float | None = None) -> Section:
        """Build a solid round bar."""
        return cls._of_shape("round", shear_factor, diameter=diameter)

    @classmethod
    def tube(
        cls, *, outer_diameter: float, inner_diameter: float, shear_factor: float | None = None
    ) -> Section:
        """Build a round tube."""
        sizes = {"outer_diameter": outer_diameter, "inner_diameter": inner_diameter}
        return cls._of_shape("tube", shear_factor, **sizes)

    @classmethod
    def general(cls, *, area: float, second_moment: float, shear_factor: float) -> Section:
        """Build any section by its numbers."""
        return cls(shape="general", area=area, second_moment=second_moment, shear_factor=shear_factor)

    @classmethod
    def _of_shape(cls, shape: str, shear_factor: float | None, **sizes: float) -> Section:
        """Build a named shape."""
        dimensions = {}
        for name, value in sizes.items():
            meaning = f"the {name.replace('_', ' ')} is a positive, finite number of metres"
            dimensions[name] = positive(f"link.section.{name}", value, meaning)
        area, second_moment = _properties(shape, dimensions)
        return cls(
            shape=shape,
            area=area,
            second_moment=second_moment,
            shear_factor=shear_factor,
            dimensions=tuple(dimensions.items()),
        )

    @property
    def radius_of_gyration(self) -> float:
        """sqrt(I/A) [m]."""
        return math.sqrt(self.second_moment / self.area)

    @property
    def half_depth(self) -> float | None:
        """Distance [m] from the neutral axis to the surface in the plane of bending; None for a general section."""
        depths = [size for name, size in self.dimensions if name in ("depth", "diameter", "outer_diameter")]
        return depths[0] / 2 if depths else None

    def cowper_factor(self, poissons_ratio: float) -> float:
        """Return Cowper's shear factor of a named shape, for a Poisson's ratio in (-1, 0.5]."""
        return SHAPES[self.shape].cowper(poissons_ratio, **dict(self.dimensions))


def _properties(shape: str, dimensions: Mapping[str, float]) -> tuple[float, float]:
    """Return the area [m^2] and second moment [m^4] of a named shape.  Raises ParameterError for wrong dimensions."""
    must_be_known("link.section.shape", shape, [*SHAPES, "general"])
    known = SHAPES[shape]
    remedy = f"a {shape} has {' and '.join(known.dimensions)}: build it with Section.{shape}()"
    require(set(dimensions) == set(known.dimensions), "link.section.dimensions", tuple(dimensions), remedy)
    if shape == "tube":
        outer, inner = (dimensions[name] for name in known.dimensions)
        remedy = f"a tube is hollow: less than its outer diameter, {outer:g} m"
        require(inner < outer, "link.section.inner_diameter", inner, remedy)
    return known.area(**dimensions), known.second_moment(**dimensions)


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """The flexible link, or a segment of it: `length` [m], `density` [kg/m^3], its moduli [Pa] and its `section`.

    `damping` is Kelvin-Voigt damping C [s], on bending only: E -> E (1 + C s).  `stated_ratio` is the Poisson's ratio
    from which G was computed, None where G itself was stated.
    """

    length: Annotated[float, positive, "a length is a positive, finite number of metres"]
    density: Annotated[float, positive, "a density is a positive, finite number in kg/m^3"]
    youngs_modulus: Annotated[float, positive, MODULUS]
    shear_modulus: Annotated[float, positive, "a shear modulus is a positive, finite number in Pa"]
    section: Section
    damping: Annotated[
        float, not_negative, "damping C is zero or a positive time in seconds, as in E (1 + C s)"
    ] = 0.0
    stated_ratio: float | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.stated_ratio is not None:
            G = self.youngs_modulus / (2 * (1 + self.stated_ratio))
            # of a link with another modulus
            if self.shear_modulus != G:
                object.__setattr__(self, "stated_ratio", None)
        check_annotated(self, "link")
        remedy = f"{self.slenderness:.3g} times the section's radius of gyration is no beam; check the units"
        require(self.slenderness <= 1e9, "link.length", self.length, remedy)
        # the argument of Cowper's factor; the margins allow for a rounded G
        nu = self.poissons_ratio
        remedy = (
            f"with this Young's modulus it means a Poisson's ratio of {nu:.4g}, outside (-1, 0.5]; "
            "correct it, or give link.section.shear_factor for a material that is not isotropic"
        )
        is_right = self.section.shear_factor or -1 + 1e-9 <= nu <= 0.5 + 1e-12
        require(is_right, "link.shear_modulus", self.shear_modulus, remedy)

    @classmethod
    def isotropic(
        cls,
        *,
        length: float,
        density: float,
        youngs_modulus: float,
        poissons_ratio: float,
        section: Section,
        damping: float = 0.0,
    ) -> Link:
        """Build the link of an isotropic material: G = E/(2 (1 + nu)), nu Poisson's ratio."""
        E = positive("link.youngs_modulus", youngs_modulus, MODULUS)
        meaning = "Poisson's ratio lies above -1, up to 0.5 (incompressible); about 0.3 for metals"
        nu = number("link.poissons_ratio", poissons_ratio, meaning)
        require(-1.0 < nu <= 0.5, "link.poissons_ratio", nu, meaning)
        return cls(
            length=length,
            density=density,
            youngs_modulus=E,
            shear_modulus=E / (2 * (1 + nu)),
            section=section,
            damping=damping,
            stated_ratio=nu,
        )

    @property
    def poissons_ratio(self) -> float:
        """nu = E / (2 G) - 1 [-], of an isotropic material."""
        return self.youngs_modulus / (2 * self.shear_modulus) - 1

    @property
    def shear_factor(self) -> float:
        """kappa [-] of the section, or else Cowper's (1966) from Poisson's ratio."""
        return self.section.shear_factor or self.section.cowper_factor(self.poissons_ratio)

    @property
    def EI(self) -> float:
        """Bending stiffness E I [N m^2], undamped."""
        return self.youngs_modulus * self.section.second_moment

    @property
    def kGA(self) -> float:
        """Shear stiffness kappa G A [N]."""
        return self.shear_factor * self.shear_modulus * self.section.area

    @property
    def rhoA(self) -> float:
        """Mass per length rho A [kg/m]."""
        return self.density * self.section.area

    @property
    def rhoI(self) -> float:
        """Rotary inertia per length rho I [kg m]."""
        return self.density * self.section.second_moment

    @property
    def slenderness(self) -> float:
        """L / sqrt(I/A) [-]; for a rectangle sqrt(12) times length over depth."""
        return self.length / self.section.radius_of_gyration


# ------------------------------------------------------------ the other parts of a rig


def repr_fields(record: Any, always: int) -> dict[str, Any]:
    """Return the first `always` fields of a record's repr, and those of the others that differ from their defaults."""
    found: dict[str, Any] = {}
    for each in fields(record):
        if not each.repr:
            continue
        value = getattr(record, each.name)
        default = each.default if each.default_factory is NO_DEFAULT else each.default_factory()
        if len(found) < always or value != default:
            found[each.name] = value
    return found


def brief_repr(record: Any, always: int) -> str:
    """Return the repr of a record with the fields of `repr_fields` alone."""
    shown = ", ".join(f"{name}={value!r}" for name, value in repr_fields(record, always).items())
    return f"{type(record).__name__}({shown})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Hub:
    """The hub: `inertia` I_h [kg m^2] (inf: locked, 0: free pin), viscous `friction` b [N m s/rad].

    `radius` r [m] is the distance from the axis to the clamp; `stiffness` [N m/rad] is a spring to ground.
    """

    inertia: Annotated[
        float, not_negative_or_inf, "a hub inertia is zero (free pin), positive in kg m^2, or inf (locked)"
    ]
    friction: Annotated[
        float, not_negative, "a hub friction is zero or a positive, finite number in N m s/rad"
    ] = 0.0
    radius: Annotated[
        float,
        not_negative,
        "a hub radius, from the axis to the clamp, is zero or a positive, finite number of metres",
    ] = 0.0
    stiffness: Annotated[
        float,
        not_negative,
        "a spring from hub to ground is zero or positive, finite, in N m/rad (inertia = inf locks)",
    ] = 0.0

    def __post_init__(self) -> None:
        check_annotated(self, "hub")
        for name, value in (("friction", self.friction), ("stiffness", self.stiffness)):
            remedy = (
                f"no effect, as inertia = inf locks the hub; leave out the {name}, or give a finite inertia"
            )
            require(math.isfinite(self.inertia) or not value, f"hub.{name}", value, remedy)

    def __repr__(self) -> str:
        return brief_repr(self, always=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class RotarySpring:
    """A rotary spring and dashpot in parallel: `stiffness` k [N m/rad] (inf: rigid), `damping` c [s], k (1 + c s)."""

    stiffness: Annotated[
        float, above_zero, "the stiffness of a clamp or joint is positive in N m/rad, or inf (rigid)"
    ] = math.inf
    damping: Annotated[
        float, not_negative, "damping c is zero or a positive time in seconds, as in k (1 + c s)"
    ] = 0.0

    def __post_init__(self) -> None:
        check_annotated(self, "spring")
        remedy = "a rigid spring has no damping: give a finite stiffness in N m/rad, or leave the damping out"
        require(not (self.damping and self.is_rigid), "spring.damping", self.damping, remedy)

    @property
    def is_rigid(self) -> bool:
        """Whether k = inf."""
        return math.isinf(self.stiffness)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motor:
    """A geared DC motor: `resistance` R [ohm], `inductance` L_a [H], `torque_constant` Kt [N m/A].

    `back_emf_constant` Ke [V s/rad] is Kt by default; `gear_ratio` N is motor turns per hub turn.  On the motor's
    side of the gear: `rotor_inertia` J_m [kg m^2] and `rotor_friction` b_m [N m s/rad].  `gear_efficiency` eta [-]
    is that from motor to hub: u = eta N Kt i.
    """

    resistance: Annotated[float, positive, "a motor's resistance is a positive, finite number of ohms"]
    torque_constant: Annotated[float, positive, "a torque constant is a positive, finite number in N m/A"]
    # Kt then
    back_emf_constant: Annotated[
        float, not_negative, "a back-EMF constant is zero or a positive, finite number in V s/rad"
    ] = cast("float", None)
    inductance: Annotated[
        float, not_negative, "an inductance is zero or a positive, finite number of henries"
    ] = 0.0
    gear_ratio: Annotated[
        float, positive, "a gear ratio, motor turns per hub turn, is a positive, finite number"
    ] = 1.0
    rotor_inertia: Annotated[
        float, not_negative, "a rotor inertia is zero or a positive, finite number in kg m^2, before the gear"
    ] = 0.0
    rotor_friction: Annotated[
        float,
        not_negative,
        "a rotor friction is zero or a positive, finite number in N m s/rad, before the gear",
    ] = 0.0
    gear_efficiency: Annotated[float, positive, "an efficiency is above 0"] = 1.0

    def __post_init__(self) -> None:
        if cast("float | None", self.back_emf_constant) is None:
            object.__setattr__(self, "back_emf_constant", self.torque_constant)
        check_annotated(self, "motor")
        remedy = "an efficiency is above 0, up to 1 (75 % is entered as 0.75)"
        require(self.gear_efficiency <= 1.0, "motor.gear_efficiency", self.gear_efficiency, remedy)

    @property
    def reflected_inertia(self) -> float:
        """N^2 J_m [kg m^2], the rotor's inertia at the hub."""
        return self.gear_ratio**2 * self.rotor_inertia


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """A body on the link at `x` [m] from the clamp: `mass` [kg], `inertia` [kg m^2], springs to ground.

    `stiffness` [N/m] is that of its displacement, `rotational_stiffness` [N m/rad] that of its rotation.
    """

    x: Annotated[
        float,
        not_negative,
        "an attachment's place is zero or a positive number of metres from the clamp, up to the tip",
    ]
    mass: Annotated[float, not_negative, "an attached mass is zero or a positive, finite number in kg"] = 0.0
    inertia: Annotated[
        float, not_negative, "an attached inertia is zero or a positive, finite number in kg m^2"
    ] = 0.0
    stiffness: Annotated[
        float, not_negative, "an attached spring to ground is zero or positive, finite, in N/m"
    ] = 0.0
    rotational_stiffness: Annotated[
        float, not_negative, "an attached rotary spring to ground is zero or positive, finite, in N m/rad"
    ] = 0.0

    def __post_init__(self) -> None:
        check_annotated(self, "attachment")
        remedy = "an empty attachment: give a mass, an inertia, a stiffness or a rotational_stiffness"
        require(self.mass or self.inertia or self.is_held, "attachment.x", self.x, remedy)

    @property
    def is_held(self) -> bool:
        """Whether it has a spring to ground."""
        return self.stiffness > 0.0 or self.rotational_stiffness > 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gauge:
    """The strain gauge whose moment is fed back, at `x` [m] from the clamp: 0, the root, in the paper.

    At a joint of two segments, or at an attachment, it is on the outer side unless `side` is "inner".
    """

    x: Annotated[
        float, not_negative, "a gauge's place is zero or a positive number of metres from the clamp"
    ] = 0.0
    side: Literal["outer", "inner"] = "outer"

    def __post_init__(self) -> None:
        check_annotated(self, "gauge")
        require(self.side in ("outer", "inner"), "gauge.side", self.side, '"outer" or "inner"')


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """The payload: `mass` m [kg] (inf pins its centre), `inertia` I_c [kg m^2] about its own centre of mass.

    An infinite inertia locks the tip's rotation; `offset` e [m], of any sign, is that of the centre beyond the tip.
    """

    mass: Annotated[
        float, not_negative_or_inf, "a payload mass is zero, positive in kg, or inf (tip pinned)"
    ] = 0.0
    inertia: Annotated[
        float,
        not_negative_or_inf,
        "a payload inertia is zero, positive in kg m^2, or inf (tip cannot rotate)",
    ] = 0.0
    offset: Annotated[
        float, finite, "a payload's offset is a finite number of metres beyond the tip, negative before it"
    ] = 0.0

    def __post_init__(self) -> None:
        check_annotated(self, "payload")

    def __repr__(self) -> str:
        return brief_repr(self, always=2)
