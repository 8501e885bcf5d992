"""The texts of pages: each that is asked for is there, and none is left that no page has."""

import re

from tfarm.report.sections import TEMPLATES, prose

TEXTS = (TEMPLATES / "prose.txt").read_text(encoding="utf-8")
NAMES = set(re.findall(r"{% macro (\w+)\(", TEXTS))
SHARED = {"clipped", "bands", "extrema", "beyond_left"}  # which other texts have in them


def test_every_text_has_one_place_that_asks_for_it():
    code = "\n".join(file.read_text(encoding="utf-8") for file in TEMPLATES.parent.glob("*.py"))
    asked = set(re.findall(r'prose\(\s*["\'](\w+)', code)) | {"measured_modes", "measured_required"}
    asked |= {f"trust_{name}" for name in ("proofs", "accuracy", "published")} | {"gain_crossovers", "phase_crossovers"}
    assert asked == NAMES - SHARED
    assert all(TEXTS.count(f"{name}(") > 1 for name in SHARED)


def test_line_breaks_of_a_text_are_spaces():
    assert prose("spill", found="the loop is stable") == (
        "Models of few flexible modes under the same controller: the number of unstable poles, and the rightmost. "
        "The loop is stable."
    )
