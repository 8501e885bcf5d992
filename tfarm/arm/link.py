"""The link: a uniform segment of a Timoshenko beam.  Frozen, checked once, SI units.

Letters as in the paper: E, G, rho, A, I, kappa, C.
"""

from __future__ import annotations

from dataclasses import dataclass

from tfarm.arm.checks import check_fields, not_negative, number, positive
from tfarm.arm.sections import Section
from tfarm.errors import ParameterError

SLENDEREST = 1e9  # length over radius of gyration: above it the units are mixed up
MEANINGS = {
    "length": "a length is a positive, finite number of metres",
    "density": "a density is a positive, finite number in kg/m^3",
    "youngs_modulus": "Young's modulus is a positive, finite number in Pa",
    "shear_modulus": "a shear modulus is a positive, finite number in Pa",
}
DAMPING = "damping C is zero or a positive time in seconds, as in E (1 + C s)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """The flexible link, or a segment of it: `length` [m], `density` [kg/m^3], its moduli [Pa] and its `section`.

    `damping` is Kelvin-Voigt damping C [s], on bending only: E -> E (1 + C s).
    """

    length: float
    density: float
    youngs_modulus: float
    shear_modulus: float
    section: Section
    damping: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "link", positive, MEANINGS)
        check_fields(self, "link", not_negative, {"damping": DAMPING})
        if self.slenderness > SLENDEREST:
            remedy = f"{self.slenderness:.3g} times the section's radius of gyration is no beam; check the units"
            raise ParameterError(key="link.length", value=self.length, remedy=remedy)
        nu = self.poissons_ratio  # which Cowper's factor is a function of; the margins allow for a rounded G
        if self.section.shear_factor is None and not -1 + 1e-9 <= nu <= 0.5 + 1e-12:
            remedy = (
                f"with this Young's modulus it means a Poisson's ratio of {nu:.4g}, outside (-1, 0.5]; "
                "mend it, or give link.section.shear_factor for a material that is not isotropic"
            )
            raise ParameterError(key="link.shear_modulus", value=self.shear_modulus, remedy=remedy)

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
        meaning = "Poisson's ratio lies above -1, up to 0.5 (incompressible); about 0.3 for metals"
        nu = number("link.poissons_ratio", poissons_ratio, meaning)
        if not -1.0 < nu <= 0.5:
            raise ParameterError(key="link.poissons_ratio", value=nu, remedy=meaning)
        return cls(
            length=length,
            density=density,
            youngs_modulus=E,
            shear_modulus=E / (2 * (1 + nu)),
            section=section,
            damping=damping,
        )

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
