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
    for row in table:
        assert row.difference == pytest.approx(row.ours / float(row.printed) - 1, abs=1e-15)
        assert math.isfinite(row.ours)


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


def test_a_wrong_digit_without_a_reason_is_named() -> None:
    wrong = changed("code-aster-v2.05.400", printed=("3.9266", "7.06868"))
    with pytest.raises(
        CertificationError, match=r"code-aster-v2.05.400, pinned-free, mode 2: printed 7.06868, exact 7.06858"
    ):
        validate((wrong,))


def test_a_reason_without_a_difference_is_named_too() -> None:
    idle = changed("code-aster-v2.05.400", why={1: "for no reason"})
    with pytest.raises(CertificationError, match=r"mode 1: .*agrees though a reason is given"):
        validate((idle,))


def test_another_arm_is_noticed() -> None:
    """The rows depend on the arm: a hundredth more of tip mass and the agreement is gone."""
    case = only("wang-2017").cases[0]
    payload = replace(case.arm.payload, mass=1.01 * case.arm.payload.mass)
    with pytest.raises(CertificationError, match=r"mode 1.*mode 5"):
        validate((changed("wang-2017", arm=replace(case.arm, payload=payload)),))


def test_the_verb_prints_the_table_or_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "validate")
    assert (code, err) == (0, "")
    assert re.search(r"^agree to the last printed digit +136\ndiffer for the reason given +21$", out, re.MULTILINE)
    assert "printed with the sign of the tip inertia reversed" in out
    assert all(source.citation in out for source in SOURCES)
    code, out, err = run(capsys, "validate", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["explained"] == 21


def test_the_command_exits_3_and_names_the_row(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = changed("nafems-fv5", why={})
    monkeypatch.setattr(published, "validate", partial(validate, (wrong,)))
    code, out, err = run(capsys, "validate")
    assert (code, out) == (3, "")
    assert "nafems-fv5, pinned-pinned, mode 1: printed 42.650, exact 42.64490922, and no reason is given" in err
    assert err.count("\n") == 1
