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
from typing import Any, Literal, cast

from tfarm.arm.checks import check_fields, extended, not_negative, number, positive, signed
from tfarm.errors import MISSING, must_be_known, require

KEY = "link.section"  # before the names of its numbers in messages
SLENDEREST = 1e9  # length over radius of gyration: above it the units are wrong
MEANINGS = {
    "length": "a length is a positive, finite number of metres",
    "density": "a density is a positive, finite number in kg/m^3",
    "youngs_modulus": "Young's modulus is a positive, finite number in Pa",
    "shear_modulus": "a shear modulus is a positive, finite number in Pa",
}


@dataclass(frozen=True, slots=True)
class NamedShape:
    """A named shape: its dimensions [m]; area [m^2], second moment [m^4], Cowper's factor as functions."""

    dimensions: tuple[str, ...]
    area: Callable[..., float]
    second_moment: Callable[..., float]
    cowper: Callable[..., float]


def cowper_tube(nu: float, *, outer_diameter: float, inner_diameter: float) -> float:
    """kappa = 6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2),  m = inner/outer."""
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
        area=lambda outer_diameter, inner_diameter: (
            math.pi * (outer_diameter - inner_diameter) * (outer_diameter + inner_diameter) / 4
        ),
        second_moment=lambda outer_diameter, inner_diameter: (
            math.pi
            * (outer_diameter - inner_diameter)
            * (outer_diameter + inner_diameter)
            * (outer_diameter**2 + inner_diameter**2)
            / 64
        ),
        cowper=cowper_tube,
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A cross-section: `area` [m^2], `second_moment` [m^4] about the bending axis, `shear_factor` [-].

    Build it by its shape, such as `Section.rectangle(width=, depth=)`; `dimensions` [m] are the arguments of that.
    A named shape without a shear factor has Cowper's.
    """

    shape: str
    area: float
    second_moment: float
    shear_factor: float | None = None
    dimensions: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        check_fields(
            self,
            KEY,
            positive,
            area="a section has a positive, finite area in m^2",
            second_moment="a section has a positive, finite second moment in m^4",
        )
        if self.shear_factor is not None:
            meaning = "a shear factor multiplies G A: above 0, up to 1 (a form factor of 6/5 is entered as 5/6)"
            kappa = positive(f"{KEY}.shear_factor", self.shear_factor, meaning)
            require(kappa <= 1.0, f"{KEY}.shear_factor", kappa, meaning)
            object.__setattr__(self, "shear_factor", kappa)
        remedy = "a general section needs its own, e.g. 0.8333333333333334 for a rectangle"
        require(self.shape != "general" or self.shear_factor is not None, f"{KEY}.shear_factor", MISSING, remedy)
        if self.shape != "general":
            require(
                (self.area, self.second_moment) == _properties(self.shape, dict(self.dimensions)),
                f"{KEY}.area",
                self.area,
                f"does not fit this {self.shape}; use Section.{self.shape}() or Section.general()",
            )

    @classmethod
    def rectangle(cls, *, width: float, depth: float, shear_factor: float | None = None) -> Section:
        """A solid rectangle, `depth` [m] in the plane of bending."""
        return cls._named("rectangle", shear_factor, width=width, depth=depth)

    @classmethod
    def round(cls, *, diameter: float, shear_factor: float | None = None) -> Section:
        """A solid round bar."""
        return cls._named("round", shear_factor, diameter=diameter)

    @classmethod
    def tube(cls, *, outer_diameter: float, inner_diameter: float, shear_factor: float | None = None) -> Section:
        """A round tube."""
        return cls._named("tube", shear_factor, outer_diameter=outer_diameter, inner_diameter=inner_diameter)

    @classmethod
    def general(cls, *, area: float, second_moment: float, shear_factor: float) -> Section:
        """Any section, by its numbers."""
        return cls(shape="general", area=area, second_moment=second_moment, shear_factor=shear_factor)

    @classmethod
    def _named(cls, shape: str, shear_factor: float | None, **sizes: float) -> Section:
        meaning = "the {} is a positive, finite number of metres"
        dimensions = {
            name: positive(f"{KEY}.{name}", value, meaning.format(name.replace("_", " ")))
            for name, value in sizes.items()
        }
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
        sizes = dict(self.dimensions)
        depth = sizes.get("depth", sizes.get("diameter", sizes.get("outer_diameter")))
        return None if depth is None else depth / 2

    def cowper_factor(self, poissons_ratio: float) -> float:
        """Cowper's shear factor of a named shape, for a Poisson's ratio in (-1, 0.5]."""
        return SHAPES[self.shape].cowper(poissons_ratio, **dict(self.dimensions))


def _properties(shape: str, dimensions: Mapping[str, float]) -> tuple[float, float]:
    """Return the area [m^2] and second moment [m^4] of a named shape.  Raises ParameterError for wrong dimensions."""
    must_be_known(f"{KEY}.shape", shape, [*SHAPES, "general"])
    names = SHAPES[shape].dimensions
    require(
        set(dimensions) == set(names),
        f"{KEY}.dimensions",
        tuple(dimensions),
        f"a {shape} has {' and '.join(names)}: build it with Section.{shape}()",
    )
    if shape == "tube":
        outer, inner = (dimensions[name] for name in names)
        remedy = f"a tube is hollow: less than its outer diameter, {outer:g} m"
        require(inner < outer, f"{KEY}.inner_diameter", inner, remedy)
    return SHAPES[shape].area(**dimensions), SHAPES[shape].second_moment(**dimensions)


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """The flexible link, or a segment of it: `length` [m], `density` [kg/m^3], its moduli [Pa] and its `section`.

    `damping` is Kelvin-Voigt damping C [s], on bending only: E -> E (1 + C s).  `stated_ratio` is the Poisson's ratio
    from which G was computed, None where G itself was stated.
    """

    length: float
    density: float
    youngs_modulus: float
    shear_modulus: float
    section: Section
    damping: float = 0.0
    stated_ratio: float | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.stated_ratio is not None and self.shear_modulus != self.youngs_modulus / (2 * (1 + self.stated_ratio)):
            object.__setattr__(self, "stated_ratio", None)  # of a link with another modulus
        check_fields(self, "link", positive, **MEANINGS)
        check_fields(
            self, "link", not_negative, damping="damping C is zero or a positive time in seconds, as in E (1 + C s)"
        )
        require(
            self.slenderness <= SLENDEREST,
            "link.length",
            self.length,
            f"{self.slenderness:.3g} times the section's radius of gyration is no beam; check the units",
        )
        nu = self.poissons_ratio  # the argument of Cowper's factor; the margins allow for a rounded G
        require(
            self.section.shear_factor is not None or -1 + 1e-9 <= nu <= 0.5 + 1e-12,
            "link.shear_modulus",
            self.shear_modulus,
            f"with this Young's modulus it means a Poisson's ratio of {nu:.4g}, outside (-1, 0.5]; "
            "correct it, or give link.section.shear_factor for a material that is not isotropic",
        )

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
        E = positive("link.youngs_modulus", youngs_modulus, MEANINGS["youngs_modulus"])
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
        own = self.section.shear_factor
        return self.section.cowper_factor(self.poissons_ratio) if own is None else own

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


def differing(record: Any, always: int) -> dict[str, Any]:
    """Return the first `always` fields of a record's repr, and those of the others that differ from their defaults."""
    found = {}
    for i, each in enumerate(known for known in fields(record) if known.repr):
        value = getattr(record, each.name)
        default = each.default if each.default_factory is NO_DEFAULT else each.default_factory()
        if i < always or value != default:
            found[each.name] = value
    return found


def brief_repr(record: Any, always: int) -> str:
    """Return the repr of a record with the fields of `differing` alone."""
    shown = ", ".join(f"{name}={value!r}" for name, value in differing(record, always).items())
    return f"{type(record).__name__}({shown})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Hub:
    """The hub: `inertia` I_h [kg m^2] (inf: locked, 0: free pin), viscous `friction` b [N m s/rad].

    `radius` r [m] is the distance from the axis to the clamp; `stiffness` [N m/rad] is a spring to ground.
    """

    inertia: float
    friction: float = 0.0
    radius: float = 0.0
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        check_fields(
            self,
            "hub",
            extended,
            inertia="a hub inertia is zero (free pin), positive in kg m^2, or inf (locked)",
        )
        check_fields(
            self,
            "hub",
            not_negative,
            friction="a hub friction is zero or a positive, finite number in N m s/rad",
            radius="a hub radius, from the axis to the clamp, is zero or a positive, finite number of metres",
            stiffness="a spring from hub to ground is zero or positive, finite, in N m/rad (inertia = inf locks)",
        )
        for name, value in (("friction", self.friction), ("stiffness", self.stiffness)):
            remedy = f"no effect, as inertia = inf locks the hub; leave out the {name}, or give a finite inertia"
            require(math.isfinite(self.inertia) or not value, f"hub.{name}", value, remedy)

    def __repr__(self) -> str:
        return brief_repr(self, always=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class RotarySpring:
    """A rotary spring and dashpot in parallel: `stiffness` k [N m/rad] (inf: rigid), `damping` c [s], k (1 + c s)."""

    stiffness: float = math.inf
    damping: float = 0.0

    def __post_init__(self) -> None:
        meaning = "the stiffness of a clamp or joint is positive in N m/rad, or inf (rigid)"
        check_fields(self, "spring", extended, stiffness=meaning)
        require(self.stiffness != 0.0, "spring.stiffness", self.stiffness, meaning)
        check_fields(
            self,
            "spring",
            not_negative,
            damping="damping c is zero or a positive time in seconds, as in k (1 + c s)",
        )
        require(
            not (self.damping and self.is_rigid),
            "spring.damping",
            self.damping,
            "a rigid spring has no damping: give a finite stiffness in N m/rad, or leave the damping out",
        )

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

    resistance: float
    torque_constant: float
    back_emf_constant: float = cast("float", None)  # Kt then
    inductance: float = 0.0
    gear_ratio: float = 1.0
    rotor_inertia: float = 0.0
    rotor_friction: float = 0.0
    gear_efficiency: float = 1.0

    def __post_init__(self) -> None:
        meanings = {
            "resistance": "a motor's resistance is a positive, finite number of ohms",
            "torque_constant": "a torque constant is a positive, finite number in N m/A",
            "gear_ratio": "a gear ratio, motor turns per hub turn, is a positive, finite number",
            "gear_efficiency": "an efficiency is above 0, up to 1 (75 % is entered as 0.75)",
        }
        check_fields(self, "motor", positive, **meanings)
        require(self.gear_efficiency <= 1.0, "motor.gear_efficiency", self.gear_efficiency, meanings["gear_efficiency"])
        if cast("float | None", self.back_emf_constant) is None:
            object.__setattr__(self, "back_emf_constant", self.torque_constant)
        check_fields(
            self,
            "motor",
            not_negative,
            back_emf_constant="a back-EMF constant is zero or a positive, finite number in V s/rad",
            inductance="an inductance is zero or a positive, finite number of henries",
            rotor_inertia="a rotor inertia is zero or a positive, finite number in kg m^2, before the gear",
            rotor_friction="a rotor friction is zero or a positive, finite number in N m s/rad, before the gear",
        )

    @property
    def reflected_inertia(self) -> float:
        """N^2 J_m [kg m^2], the rotor's inertia at the hub."""
        return self.gear_ratio**2 * self.rotor_inertia


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """A body on the link at `x` [m] from the clamp: `mass` [kg], `inertia` [kg m^2], springs to ground.

    `stiffness` [N/m] is that of its displacement, `rotational_stiffness` [N m/rad] that of its rotation.
    """

    x: float
    mass: float = 0.0
    inertia: float = 0.0
    stiffness: float = 0.0
    rotational_stiffness: float = 0.0

    def __post_init__(self) -> None:
        check_fields(
            self,
            "attachment",
            not_negative,
            x="an attachment's place is zero or a positive number of metres from the clamp, up to the tip",
            mass="an attached mass is zero or a positive, finite number in kg",
            inertia="an attached inertia is zero or a positive, finite number in kg m^2",
            stiffness="an attached spring to ground is zero or positive, finite, in N/m",
            rotational_stiffness="an attached rotary spring to ground is zero or positive, finite, in N m/rad",
        )
        require(
            self.mass or self.inertia or self.is_held,
            "attachment.x",
            self.x,
            "an empty attachment: give a mass, an inertia, a stiffness or a rotational_stiffness",
        )

    @property
    def is_held(self) -> bool:
        """Whether it has a spring to ground."""
        return self.stiffness > 0.0 or self.rotational_stiffness > 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gauge:
    """The strain gauge whose moment is fed back, at `x` [m] from the clamp: 0, the root, in the paper.

    At a joint of two segments, or at an attachment, it is on the outer side unless `side` is "inner".
    """

    x: float = 0.0
    side: Literal["outer", "inner"] = "outer"

    def __post_init__(self) -> None:
        check_fields(
            self,
            "gauge",
            not_negative,
            x="a gauge's place is zero or a positive number of metres from the clamp",
        )
        require(self.side in ("outer", "inner"), "gauge.side", self.side, '"outer" or "inner"')


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """The payload: `mass` m [kg] (inf pins its centre), `inertia` I_c [kg m^2] about its own centre of mass.

    An infinite inertia locks the tip's rotation; `offset` e [m], of any sign, is that of the centre beyond the tip.
    """

    mass: float = 0.0
    inertia: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        check_fields(
            self,
            "payload",
            extended,
            mass="a payload mass is zero, positive in kg, or inf (tip pinned)",
            inertia="a payload inertia is zero, positive in kg m^2, or inf (tip cannot rotate)",
        )
        check_fields(
            self,
            "payload",
            signed,
            offset="a payload's offset is a finite number of metres beyond the tip, negative before it",
        )

    def __repr__(self) -> str:
        return brief_repr(self, always=2)
