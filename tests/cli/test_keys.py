"""JSON keys are a contract: what each command prints has the keys that are kept, and no other."""

import json

import pytest

from tests.cli.keys import COMMANDS, KEPT, LAW, paths
from tests.shell import answer

DEAR = ("design", "compare", "assumptions", "validate", "locus of a law")  # whose keys other tests read one by one


@pytest.mark.parametrize("name", [pytest.param(each, marks=[pytest.mark.survey] * (each in DEAR)) for each in COMMANDS])
def test_a_command_has_its_keys(capsys, tmp_path, name):
    """A key that is gone breaks programs; one that is new belongs into the file: python -m tests.cli.keys."""
    law = tmp_path / "law.toml"
    law.write_text(LAW, encoding="utf-8")
    found = paths(answer(capsys, *(word.format(law=law) for word in COMMANDS[name])))
    kept = set(json.loads(KEPT.read_text(encoding="utf-8"))[name])
    assert (sorted(kept - found), sorted(found - kept)) == ([], [])


def test_paths_go_through_lists_and_tables():
    assert paths({"a": [{"b": 1}, {"c": {"d": None}}], "e": []}) == {"a", "a[].b", "a[].c", "a[].c.d", "e"}
