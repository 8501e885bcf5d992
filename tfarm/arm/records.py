"""What is analysed: a hub, a uniform Timoshenko link and a payload.  Frozen, checked once, SI units.

Letters as in the paper: E, G, rho, A, I, kappa, C, I_h, m, I_c.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace

from tfarm.arm.checks import extended, not_negative, number, positive
from tfarm.arm.sections import Section
from tfarm.errors import ParameterError, shown

MEANINGS = {
    "length": "a length is a positive, finite number of metres",
    "density": "a density is a positive, finite number in kg/m^3",
    "youngs_modulus": "Young's modulus is a positive, finite number in Pa",
    "shear_modulus": "a shear modulus is a positive, finite number in Pa",
    "damping": "damping C is zero or a positive time in seconds, as in E (1 + C s)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """The flexible link: `length` [m], `density` [kg/m^3], `youngs_modulus`, `shear_modulus` [Pa], `section`.

    `damping` is Kelvin-Voigt damping C [s], on bending only: E -> E (1 + C s).
    """

    length: float
    density: float
    youngs_modulus: float
    shear_modulus: float
    section: Section
    damping: float = 0.0

    def __post_init__(self) -> None:
        for name, meaning in MEANINGS.items():
            check = not_negative if name == "damping" else positive
            object.__setattr__(self, name, check(f"link.{name}", getattr(self, name), meaning))
        self._check_slenderness()
        self._check_cowper()

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
        """The link of an isotropic material: G = E / (2 (1 + nu)) from Poisson's ratio nu."""
        E = positive("link.youngs_modulus", youngs_modulus, MEANINGS["youngs_modulus"])
        nu = _poissons_ratio(poissons_ratio)
        return cls(
            length=length,
            density=density,
            youngs_modulus=E,
            shear_modulus=E / (2 * (1 + nu)),
            section=section,
            damping=damping,
        )

    def _check_slenderness(self) -> None:
        if not 1e-3 <= self.slenderness <= 1e9:
            remedy = f"{self.slenderness:.3g} times the section's radius of gyration is no beam; check the units"
            raise ParameterError(key="link.length", value=self.length, remedy=remedy)

    def _check_cowper(self) -> None:
        """Cowper's factor holds for isotropic materials; the margins allow for a rounded G."""
        nu = self.poissons_ratio
        if self.section.shear_factor is None and not -1 + 1e-9 <= nu <= 0.5 + 1e-12:
            remedy = (
                f"with this Young's modulus it means a Poisson's ratio of {nu:.4g}, outside (-1, 0.5]; "
                "mend it, or give link.section.shear_factor for a material that is not isotropic"
            )
            raise ParameterError(key="link.shear_modulus", value=self.shear_modulus, remedy=remedy)

    @property
    def poissons_ratio(self) -> float:
        """nu = E / (2 G) - 1 [-], of an isotropic material."""
        return self.youngs_modulus / (2 * self.shear_modulus) - 1

    @property
    def shear_factor(self) -> float:
        """kappa [-]: the section's own, or else Cowper's (1966) from Poisson's ratio."""
        given = self.section.shear_factor
        return self.section.cowper_factor(self.poissons_ratio) if given is None else given

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Hub:
    """The hub: `inertia` I_h [kg m^2]; inf locks it, 0 leaves a free pin."""

    inertia: float

    def __post_init__(self) -> None:
        meaning = "a hub inertia is zero (free pin), positive in kg m^2, or inf (locked)"
        object.__setattr__(self, "inertia", extended("hub.inertia", self.inertia, meaning))


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """The payload: `mass` m [kg] (inf pins the tip), `inertia` I_c [kg m^2] (inf forbids tip rotation)."""

    mass: float = 0.0
    inertia: float = 0.0

    def __post_init__(self) -> None:
        meaning = "a payload mass is zero, positive in kg, or inf (tip pinned)"
        object.__setattr__(self, "mass", extended("payload.mass", self.mass, meaning))
        meaning = "a payload inertia is zero, positive in kg m^2, or inf (tip cannot rotate)"
        object.__setattr__(self, "inertia", extended("payload.inertia", self.inertia, meaning))


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """A hub, a flexible link and a payload, with the assumptions that every report repeats."""

    link: Link
    hub: Hub
    payload: Payload = field(default_factory=Payload)
    name: str = "arm"
    assumptions: tuple[str, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", _name(self.name))
        object.__setattr__(self, "assumptions", _texts(self.assumptions))

    @property
    def total_inertia(self) -> float:
        """J = I_h + rhoA L^3/3 + rhoI L + m L^2 + I_c [kg m^2], of the rigid arm about the hub."""
        link, payload = self.link, self.payload
        beam = link.rhoA * link.length**3 / 3 + link.rhoI * link.length
        return self.hub.inertia + beam + payload.mass * link.length**2 + payload.inertia

    @property
    def hub_inertia(self) -> float:
        """I_h [kg m^2]."""
        return self.hub.inertia

    @property
    def carried_inertia(self) -> float:
        """J - I_h [kg m^2], of what the hub carries."""
        return self.total_inertia - self.hub.inertia

    @property
    def own_mass(self) -> float:
        """rho A L [kg], of the arm itself."""
        return self.link.rhoA * self.link.length

    @property
    def payload_mass(self) -> float:
        """m [kg], at the tip; inf where that is pinned."""
        return self.payload.mass

    @property
    def length(self) -> float:
        """L [m], from the hub's axis to the tip."""
        return self.link.length

    @property
    def damping(self) -> float:
        """C [s] of the bending moment E I (1 + C s)."""
        return self.link.damping

    @property
    def is_undamped(self) -> bool:
        """Whether C = 0: then every frequency is real, and theorems hold that do not at C > 0."""
        return self.link.damping == 0

    @property
    def has_massless_hub(self) -> bool:
        """Whether I_h = 0: then the root moment is -u at every instant."""
        return self.hub.inertia == 0

    @property
    def bending_scale(self) -> float:
        """E I/L [N m], the moment that bends the whole arm by an angle of 1."""
        return self.link.EI / self.link.length

    def having(self, **numbers: float) -> Arm:
        """The arm with other numbers: of `ADJUSTABLE`, by name, in SI units.  Raises ParameterError as its parts do."""
        parts = {room: getattr(self, room) for room in ("link", "hub", "payload")}
        for name, value in numbers.items():
            room, field = ADJUSTABLE[name]
            parts[room] = replace(parts[room], **{field: value})
        return replace(self, **parts)

    @property
    def is_locked(self) -> bool:
        """Whether the hub cannot turn (I_h = inf): then the hub angle drives, not the torque."""
        return math.isinf(self.hub.inertia)

    @property
    def has_rigid_mode(self) -> bool:
        """Whether the whole arm can turn as a rigid body: no inertia is infinite."""
        return math.isfinite(self.total_inertia)

    @property
    def shear_cutoff(self) -> float:
        """sqrt(kGA/rhoI) [rad/s], above which both pairs of waves travel."""
        return math.sqrt(self.link.kGA / self.link.rhoI)


ADJUSTABLE = {  # numbers of an arm by name: the part and the field that hold them
    "payload_mass": ("payload", "mass"),
    "payload_inertia": ("payload", "inertia"),
    "hub_inertia": ("hub", "inertia"),
    "length": ("link", "length"),
    "damping": ("link", "damping"),
}


def must_be_arm(arm: object) -> None:
    """Raise ParameterError where a name, a path or anything else stands in the place of an Arm."""
    if not isinstance(arm, Arm):
        name = str(arm) if isinstance(arm, str | os.PathLike) else "sasaki2012"
        raise ParameterError(key="arm", value=arm, remedy=f"is no Arm; give tfarm.load({shown(name)})")


def must_turn(arm: Arm) -> None:
    """Raise ParameterError, naming the infinite part, for an arm that cannot slew: something holds it."""
    parts = {
        "hub.inertia": arm.hub.inertia,
        "payload.mass": arm.payload.mass,
        "payload.inertia": arm.payload.inertia,
    }
    key, value = max(parts.items(), key=lambda part: part[1])
    if math.isinf(value):
        raise ParameterError(key=key, value=value, remedy="an arm that cannot turn has no slew; give finite inertias")


def _poissons_ratio(value: object) -> float:
    meaning = "Poisson's ratio lies above -1, up to 0.5 (incompressible); about 0.3 for metals"
    nu = number("link.poissons_ratio", value, meaning)
    if not -1.0 < nu <= 0.5:
        raise ParameterError(key="link.poissons_ratio", value=nu, remedy=meaning)
    return nu


MOST_BYTES = 200  # of a name in UTF-8: file systems stop at 255, and a temporary file's name is longer than its own
DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in "0123456789¹²³")}


def _name(name: object) -> str:
    """The name, which is also the name of the arm's folder of reports, on every file system."""
    remedy = 'a name has 1 to 80 characters, begins with a letter or digit and has no / \\ : * ? " < > |'
    if not isinstance(name, str) or not 1 <= len(name) <= 80 or not name.isprintable():
        raise ParameterError(key="name", value=name, remedy=remedy)
    if not name[0].isalnum() or name[-1] in " ." or set(name) & set('/\\:*?"<>|'):
        raise ParameterError(key="name", value=name, remedy=remedy)
    if len(name.encode()) > MOST_BYTES:
        raise ParameterError(key="name", value=name, remedy=f"{len(name.encode())} bytes; at most {MOST_BYTES}")
    if name.partition(".")[0].rstrip().casefold() in DEVICES:
        raise ParameterError(key="name", value=name, remedy="is a device to Windows; give the arm another name")
    return name


def _texts(assumptions: object) -> tuple[str, ...]:
    """The assumptions, each with its white space made plain."""
    remedy = "assumptions are a list of plain texts"
    if not isinstance(assumptions, list | tuple):
        raise ParameterError(key="assumptions", value=assumptions, remedy=remedy)
    texts = tuple(" ".join(text.split()) if isinstance(text, str) else text for text in assumptions)
    for text in texts:
        if not isinstance(text, str) or not text.isprintable():
            raise ParameterError(key="assumptions", value=text, remedy=remedy)
    return texts
