"""The materials of `materials.toml`, and the tables of links that name one."""

import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from tfarm.digits import general
from tfarm.errors import must_be_known, require

GPA = 1e9  # Pa
SHEAR = ("shear_modulus", "poissons_ratio")  # keys of [link], of which there is one
WORDS = {  # keys of [link] that a material fills: symbol, unit and size of the unit
    "density": ("rho", "kg/m^3", 1.0),
    "youngs_modulus": ("E", "GPa", GPA),
    "shear_modulus": ("G", "GPa", GPA),
    "poissons_ratio": ("nu", "", 1.0),
}
NO_COWPER = "; shear factor of the section that of nu = 0, unless given"


class Material(NamedTuple):
    """A material: density [kg/m^3], moduli [Pa], source, usual range.  A laminate has a shear modulus, others nu."""

    name: str
    density: float
    youngs_modulus: float
    source: str
    range: str
    shear_modulus: float | None = None
    poissons_ratio: float | None = None

    @property
    def is_isotropic(self) -> bool:
        """Whether G = E/(2 (1 + nu))."""
        return self.shear_modulus is None

    def words(self, keys: Iterable[str]) -> str:
        """Return some of its numbers with their source."""
        numbers = (
            f"{WORDS[key][0]} = {general(getattr(self, key) / WORDS[key][2], 6)} {WORDS[key][1]}" for key in keys
        )
        return f"material {self.name}: {', '.join(map(str.rstrip, numbers))} ({self.source})"


@cache
def materials() -> dict[str, Material]:
    """Return the materials by name, as `material = "steel"` in [link] names them."""
    tables = tomllib.loads((files("tfarm.arm") / "materials.toml").read_text("utf-8"))
    return {name: Material(name=name, **values) for name, values in tables.items()}


def material_of(table: Any) -> Material | None:
    """Return the material that the table of a link names, if any.

    Raises ParameterError for an unknown material, and for Poisson's ratio of one that is not isotropic.
    """
    name = table.get("material") if isinstance(table, dict) else None
    if not isinstance(name, str):
        return None
    must_be_known("link.material", name, materials())
    found, nu = materials()[name], table.get("poissons_ratio")
    remedy = f"{name} is not isotropic: G is no function of E; give shear_modulus, in Pa"
    require(found.is_isotropic or nu is None, "link.poissons_ratio", nu, remedy)
    return found


def taken(material: Material, table: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers that a link takes from its material: those that its table lacks."""
    lacking = [key for key in WORDS if key not in table and not (key in SHEAR and any(each in table for each in SHEAR))]
    return {key: value for key in lacking if (value := getattr(material, key)) is not None}


def filled(table: Any) -> Any:
    """Return the table of a link with the numbers of its material, if it names one."""
    material = material_of(table)
    return table if material is None else {**taken(material, table), **table}


def assumed(tables: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return one assumption for each material of links, with the numbers that are taken from it and their source."""
    named = [(material, table) for table in tables if (material := material_of(table)) is not None]
    texts = []
    for material, table in named:
        keys = taken(material, table)
        note = "" if material.is_isotropic or "shear_factor" in table.get("section", {}) else NO_COWPER
        texts += [material.words(keys) + note] if keys else []
    return list(dict.fromkeys(texts))
