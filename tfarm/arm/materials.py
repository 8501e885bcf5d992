"""The materials of `materials.toml`, and the tables of links that name one."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, ClassVar

from tfarm.digits import general
from tfarm.errors import must_be_known, require

# keys of [link], of which there is one
SHEAR = ("shear_modulus", "poissons_ratio")


@dataclass(frozen=True, slots=True)
class Material:
    """A material: density [kg/m^3], moduli [Pa], source, usual range.  A laminate has a shear modulus, others nu."""

    name: str
    density: float
    youngs_modulus: float
    source: str
    range: str
    shear_modulus: float | None = None
    poissons_ratio: float | None = None

    # keys of [link] that a material fills: symbol, unit and size of the unit
    symbols: ClassVar = {
        "density": ("ρ", "kg/m^3", 1.0),
        "youngs_modulus": ("E", "GPa", 1e9),
        "shear_modulus": ("G", "GPa", 1e9),
        "poissons_ratio": ("ν", "", 1.0),
    }

    @property
    def is_isotropic(self) -> bool:
        """Whether G = E/(2 (1 + nu))."""
        return self.shear_modulus is None

    def words(self, keys: Iterable[str]) -> str:
        """Return some of its numbers with their source."""
        numbers = []
        for key in keys:
            symbol, unit, size = self.symbols[key]
            numbers.append(f"{symbol} = {general(getattr(self, key) / size, 6)} {unit}".rstrip())
        return f"material {self.name}: {', '.join(numbers)} ({self.source})"


@cache
def materials() -> dict[str, Material]:
    """Return the materials by name, as `material = "steel"` in [link] names them."""
    tables = tomllib.loads((files("tfarm.arm") / "materials.toml").read_text("utf-8"))
    return {name: Material(name=name, **values) for name, values in tables.items()}


def of_material(table: Any) -> tuple[Material, dict[str, float]] | None:
    """Return the material that the table of a link names, and the numbers taken from it: those that the table lacks.

    None without a material.  Raises ParameterError for an unknown one, and for Poisson's ratio of a laminate.
    """
    not_isotropic = "is not isotropic: G is no function of E; give shear_modulus, in Pa"
    name = table.get("material") if isinstance(table, dict) else None
    if not isinstance(name, str):
        return None
    must_be_known("link.material", name, materials())
    found = materials()[name]
    is_right = found.is_isotropic or "poissons_ratio" not in table
    require(is_right, "link.poissons_ratio", table.get("poissons_ratio"), f"{name} {not_isotropic}")
    has_shear = any(key in table for key in SHEAR)
    filled = {}
    for key in found.symbols:
        value = getattr(found, key)
        is_stated = key in table or (key in SHEAR and has_shear)
        if value is not None and not is_stated:
            filled[key] = value
    return found, filled


def fill_material(table: Any) -> Any:
    """Return the table of a link with the numbers of its material, if it names one."""
    found = of_material(table)
    if found is None:
        return table
    return {**found[1], **table}


def material_assumptions(tables: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return one assumption for each material of links, with the numbers that are taken from it and their source."""
    texts = []
    for material, numbers in filter(None, map(of_material, tables)):
        if numbers:
            texts.append(material.words(numbers))
    return list(dict.fromkeys(texts))
