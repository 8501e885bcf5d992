"""The audit kept on disk: equal to a new one, made anew where it cannot be read, and of these sources alone."""

import json
import os

import pytest

from tfarm.audit import kept, kept_audit, paper


@pytest.fixture
def runs(audit_rows, monkeypatch):
    """How often the audit is made, in a list."""
    made = []
    monkeypatch.setattr(paper, "audit", lambda: made.append(1) or audit_rows)
    return made


def test_the_audit_is_made_once_and_then_read(runs, audit_rows, tmp_path):
    assert kept_audit(tmp_path / "new") == kept_audit(tmp_path / "new") == audit_rows
    assert len(runs) == 1
    assert [file.suffix for file in (tmp_path / "new").iterdir()] == [".json"]


@pytest.mark.parametrize("slip", ["cut", "no JSON", "fewer rows", "another claim", "another kind"])
def test_what_is_not_the_audit_of_these_claims_is_made_anew(slip, runs, audit_rows, tmp_path):
    kept_audit(tmp_path)
    (file,) = tmp_path.iterdir()
    rows = json.loads(file.read_text(encoding="utf-8"))
    other = {
        "cut": file.read_text(encoding="utf-8")[:-9],
        "no JSON": "\0",
        "fewer rows": json.dumps(rows[1:]),
        "another claim": json.dumps([rows[0] | {"printed": "F = m*a"}, *rows[1:]]),
        "another kind": json.dumps([rows[0] | {"evidence": 1}, *rows[1:]]),
    }
    file.write_text(other[slip], encoding="utf-8")
    assert kept_audit(tmp_path) == audit_rows
    assert len(runs) == 2
    assert json.loads(file.read_text(encoding="utf-8")) == rows


def test_a_folder_that_cannot_be_made_leaves_the_audit_as_it_is(runs, audit_rows, tmp_path):
    (tmp_path / "file").touch()
    assert kept_audit(tmp_path / "file") == audit_rows
    assert runs == [1]


def test_other_sources_and_other_versions_have_another_hash(tmp_path, monkeypatch):
    room = tmp_path / "tfarm" / "audit"
    room.mkdir(parents=True)
    monkeypatch.setattr(kept, "__file__", os.fspath(room / "kept.py"))
    hashes = [kept.source_hash()]
    for name, text in (("a.py", "1"), ("a.py", "2"), ("audit/claims.toml", "2"), ("notes.txt", "2")):
        (tmp_path / "tfarm" / name).write_text(text, encoding="utf-8")
        hashes.append(kept.source_hash())
    monkeypatch.setattr(kept, "version", lambda _: "0")
    hashes.append(kept.source_hash())
    assert hashes[3] == hashes[4]
    assert len(set(hashes)) == len(hashes) - 1
