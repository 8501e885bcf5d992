"""The texts of pages: each one used exists, and each one there is used."""

import re

from tfarm.report.sections import TEMPLATES, prose, sheet
from tfarm.schema import Column

TEXTS = (TEMPLATES / "prose.txt").read_text(encoding="utf-8")
NAMES = set(re.findall(r"{% macro (\w+)\(", TEXTS))
OF_TRUST = {f"trust_{name}" for name in ("proofs", "accuracy", "published")}  # used by its template


def test_every_text_is_used():
    code = "\n".join(file.read_text(encoding="utf-8") for file in TEMPLATES.parent.glob("*.py"))
    assert set(re.findall(r'(?:prose|picture|sheet)\(\s*"(\w+)"', code)) <= NAMES
    used = {name for name in NAMES if f'"{name}"' in code} | OF_TRUST
    assert all(TEXTS.count(f"{name}(") > 1 for name in NAMES - used)  # which other texts have in them


def test_line_breaks_of_a_text_are_spaces_and_a_table_has_title_and_caption():
    assert prose("fit", verdict="fitted", found="3 numbers").startswith("Fitted: 3 numbers. The interval holds")
    table = sheet("matrices", [Column("row", "", of=["x1"])], stem="of-a-law", name="A ¶ <law>")
    assert (table.stem, table.title) == ("of-a-law", "Matrices of A ¶ <law>")
    assert table.caption.startswith("A ¶ <law>: A and C under the states, B and D under")
