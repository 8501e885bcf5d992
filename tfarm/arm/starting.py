"""A first file of an arm, with unit and meaning of each key as a comment."""

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from tfarm.arm.materials import of_material
from tfarm.arm.schema import file_keys
from tfarm.arm.writing import toml_tables

HEAD = "# An arm of tfarm, in SI units throughout.\n"
REPLACED = "density, youngs_modulus, shear_modulus or poissons_ratio in [link] replace the numbers of the material"
UNDAMPED = "# damping = 0.0003"  # example of a link without damping
COMMENT_AT = 24  # column of a comment, if the value is no longer


def first_file(tables: Mapping[str, Any]) -> str:
    """Return the text of an arm's file with these tables, each line with a comment, and examples of other tables."""
    text = HEAD
    if (found := of_material(tables["link"])) is not None:
        text += f"# {found[0].words(found[1])}\n# usual range: {found[0].range}\n# {REPLACED}\n"
    for lines in toml_tables(tables):
        place = lines[0].strip("[]") if lines[0].startswith("[") else "top"
        if place == "link" and "damping" not in tables["link"]:
            lines = [*lines, UNDAMPED]
        text += "".join(["\n", *(f"{_commented(line, place)}\n" for line in lines)])
    return text + (files("tfarm.arm") / "first_file.txt").read_text("utf-8")


def _commented(line: str, place: str) -> str:
    """Return a line of a table with unit and meaning of its key, or of the table, where they are declared."""
    key = line.removeprefix("# ").partition(" = ")[0]
    words = file_keys().get(f"top.{place}" if key.startswith("[") else f"{place}.{key}")
    unit = f"[{words.unit}] " if words is not None and words.unit else ""
    return line if words is None else f"{line:<{COMMENT_AT}}  # {unit}{words.help}"
