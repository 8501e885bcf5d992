"""The table of published values: complete, checked both ways, and loud where it fails."""

import json
import math
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from tests.shell import run
from tfarm.audit import published
from tfarm.audit.published import ALL as SOURCES
from tfarm.audit.published import agrees, validate
from tfarm.errors import CertificationError


def only(key: str):
    (source,) = (source for source in SOURCES if source.key == key)
    return source


def changed(key: str, **changes):
    """A source of one case, its first, with changes."""
    source = only(key)
    return replace(source, cases=(replace(source.cases[0], **changes),))


def test_every_row_agrees_or_has_a_reason() -> None:
    table = validate()
    assert len(table) == sum(len(case.printed) for source in SOURCES for case in source.cases)
    assert all(row.agrees != bool(row.why) for row in table)
    assert sum(row.agrees for row in table) > 80
    assert all(math.isfinite(row.difference) for row in table)


def test_every_source_has_a_test_that_names_it() -> None:
    texts = [
        path.read_text(encoding="utf-8") for path in (Path(__file__).parent.parent / "published").glob("test_*.py")
    ]
    assert {source.key for source in SOURCES if source.key not in "".join(texts)} == set()


def test_keys_are_unique_and_every_arm_is_whole() -> None:
    assert len({source.key for source in SOURCES}) == len(SOURCES)
    for source in SOURCES:
        assert source.citation
        assert source.reached
        for case in source.cases:
            assert set(case.why) <= set(range(1, len(case.printed) + 1))


@pytest.mark.parametrize(
    ("ours", "printed", "expected"),
    [
        (1.65, "1.65", True),
        (1.65499, "1.65", True),
        (1.6551, "1.65", False),
        (1533.648, "1534.0", False),
        (1533.648, "1534", True),
        (0.125, "0.12", True),  # exactly half a unit
        (22.0345, "22.03450", True),
    ],
)
def test_half_a_unit_of_the_last_printed_digit(ours: float, printed: str, expected: bool) -> None:
    assert agrees(ours, printed) is expected


def heavier(key):
    """The arm of a source's first case with a hundredth more of tip mass."""
    arm = only(key).cases[0].arm
    return replace(arm, payload=replace(arm.payload, mass=1.01 * arm.payload.mass))


WRONG = {  # a slip in a source's first case, by the pattern of its message
    "code-aster-v2.05.400, pinned-free, mode 2: printed 7.06868, exact 7.06858": (
        "code-aster-v2.05.400", lambda: {"printed": ("3.9266", "7.06868")},
    ),
    "mode 1: .*agrees though a reason is given": ("code-aster-v2.05.400", lambda: {"why": {1: "for no reason"}}),
    "mode 1.*mode 5": ("wang-2017", lambda: {"arm": heavier("wang-2017")}),
}  # fmt: skip


@pytest.mark.parametrize("message", WRONG)
def test_a_wrong_digit_reason_or_arm_is_named(message: str) -> None:
    key, changes = WRONG[message]
    with pytest.raises(CertificationError, match=message):
        validate((changed(key, **changes()),))


def test_the_verb_prints_the_table_or_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "proof", "validate")
    assert (code, err) == (0, "")
    assert re.search(r"^agree to the last printed digit +136\ndiffer for the reason given +21$", out, re.MULTILINE)
    assert "printed with the sign of the tip inertia" in out  # the rest is folded in a line of 120 characters
    printed = set(out.split())
    assert all(printed.issuperset(source.citation.split()) for source in SOURCES)
    code, out, err = run(capsys, "proof", "validate", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["explained"] == 21


def test_the_command_exits_3_and_names_the_row(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = changed("nafems-fv5", why={})
    monkeypatch.setattr(published, "validate", partial(validate, (wrong,)))
    code, out, err = run(capsys, "proof", "validate")
    assert (code, out) == (3, "")
    assert "nafems-fv5, pinned-pinned, mode 1: printed 42.650, exact 42.64490922, and no reason is given" in err
    assert err.count("\n") == 1
