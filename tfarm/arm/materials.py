"""The materials of `materials.toml`, and the tables of links that name one."""

import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from tfarm.digits import general
from tfarm.errors import must_be_known, require

# keys of [link], of which there is one
SHEAR = ("shear_modulus", "poissons_ratio")
WORDS = {  # keys of [link] that a material fills: symbol, unit and size of the unit
    "density": ("ρ", "kg/m^3", 1.0),
    "youngs_modulus": ("E", "GPa", 1e9),
    "shear_modulus": ("G", "GPa", 1e9),
    "poissons_ratio": ("ν", "", 1.0),
}


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
            f"{WORDS[key][0]} = {general(getattr(self, key) / WORDS[key][2], 6)} {WORDS[key][1]}"
            for key in keys
        )
        return f"material {self.name}: {', '.join(map(str.rstrip, numbers))} ({self.source})"


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
    lacking = [key for key in WORDS if key not in table and not (key in SHEAR and has_shear)]
    return found, {key: value for key in lacking if (value := getattr(found, key)) is not None}


def fill_material(table: Any) -> Any:
    """Return the table of a link with the numbers of its material, if it names one."""
    found = of_material(table)
    return table if found is None else {**found[1], **table}


def material_assumptions(tables: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return one assumption for each material of links, with the numbers that are taken from it and their source."""
    texts = (found[0].words(found[1]) for found in map(of_material, tables) if found is not None and found[1])
    return list(dict.fromkeys(texts))
