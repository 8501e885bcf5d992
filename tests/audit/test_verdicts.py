"""Every row's verdict, what the rows must hold, and the audit kept on disk."""

import json
import os

import pytest
from mpmath import findroot, mpc, mpf, workdps

import tfarm
from tfarm import audit
from tfarm.audit import kept, kept_audit, paper
from tfarm.audit.equations import Beam, by_transition
from tfarm.schema import to_dict, to_json

VERDICTS = {
    **dict.fromkeys([f"({n})" for n in (*range(1, 8), 9, 10, 12, 13, 16, 21)], "ok"),
    **dict.fromkeys([f"({n})" for n in (8, 11, 14, 15, 17, 18, 19, 20, 22)], "corrected"),
    "(23)": "undecided",
    "(3), (10), (18), (19): order of arguments": "corrected",
    "(1)-(14): damping C": "corrected",
    "(18)-(20): damping C > 0": "corrected",
    "(18)-(20): constant gains, varied by the tuner": "corrected",
    "(20), (23): K": "corrected",
    "section 5: inputs": "undecided",
    "section 5: alpha_c": "undecided",
    "section 5: eta_c": "undecided",
    "Table 1 (rho)": "corrected",
    "Table 1 (C's unit)": "corrected",
    "Table 1 (other units)": "ok",
    "Table 1 (I)": "undecided",
    "Table 1 (I_h)": "undecided",
    "(A.1)": "corrected",
    "(A.2)": "undecided",
    "a_ij": "ok",
    "Delta, Delta k_i": "ok",
    "appendix as a whole": "corrected",
}


@pytest.fixture(scope="module")
def rows(audit_rows):
    return {row.equation: row for row in audit_rows}


def test_there_is_a_row_for_each_and_no_other(rows, audit_rows):
    assert len(rows) == len(audit_rows)
    assert {name: row.verdict for name, row in rows.items()} == VERDICTS


@pytest.mark.parametrize("name", VERDICTS)
def test_residuals_distinguish_printed_from_corrected(rows, name):
    row = rows[name]
    assert audit.is_zero(row.residual_corrected)
    assert audit.is_zero(row.residual_printed) == (row.verdict == "ok")
    assert (row.printed == row.corrected) == (row.verdict == "ok")
    assert row.evidence


@pytest.mark.parametrize(
    ("name", "formula"),
    [
        ("Table 1 (rho)", r"\rho = 2766.7\ \mathrm{kg/m^3}"),
        ("Table 1 (C's unit)", r"C: \ \mathrm{s}"),
        ("section 5: alpha_c", r"\alpha_{c} = 0.6"),
        ("(14)", r"\Phi(0,s) = 0"),
    ],
)
def test_typesetting_by_example(rows, name, formula):
    assert rows[name].corrected_tex == formula
    assert r"\theta_{t}^{2}" in rows["(20)"].printed_tex
    assert r"\phi_{x}(0,t)" in rows["(19)"].corrected_tex


def test_numbers_of_the_evidence_are_those_of_other_methods(rows):
    """By Legendre polynomials along the arm, 8 a field: 1.23186; roots of 1 + K1 s theta + K2 M(0) by mpmath."""
    assert "grows by 1.232 a period" in rows["(18)-(20): constant gains, varied by the tuner"].evidence
    arm = tfarm.load("sasaki2012")
    link, section = arm.link, arm.link.section
    numbers = (
        link.density, section.area, link.length, link.youngs_modulus, section.second_moment, link.shear_factor,
        link.shear_modulus, link.damping, arm.payload.mass, arm.payload.inertia, arm.hub.inertia,
    )  # fmt: skip
    for K2, near in ((0.5, -1 + 57j), (1.1, 2 + 21j)):

        def returned(s, K2=K2):
            theta, _, _, moment = by_transition(Beam(*map(mpf, numbers), s))
            return 1 + 0.3 * s * theta + K2 * moment

        with workdps(60):
            root = complex(findroot(returned, mpc(near), tol=1e-30))
        assert f"{root.real:.4f} + {root.imag:.4f}j 1/s for K2 = {K2}" in rows["(19)"].evidence


@pytest.mark.usefixtures("audited")
def test_json_has_the_keys_of_the_issue(audit_file):
    """The answer is what the command has printed."""
    answer = json.loads(to_json(to_dict(audit.Audit(audit.PAPER, audit.audit()))))
    assert json.loads(audit_file.with_suffix(".json").read_text(encoding="utf-8")) == answer
    assert "852780" in answer["paper"]
    keys = ["equation", "verdict", "printed", "corrected", "evidence", "residual_printed", "residual_corrected"]
    assert all(list(row) == keys for row in answer["rows"])


# Most of the time of an audit; each check has its planted slips, in tests/audit/test_planted_slips.py.
LONG = (
    "(1)-(14): damping C", "(15)", "(18)", "(18)-(20): damping C > 0", "(18)-(20): constant gains, varied by the tuner",
    "(19)", "Table 1 (rho)", "(A.1)", "(A.2)", "Delta, Delta k_i", "appendix as a whole",
)  # fmt: skip


@pytest.mark.parametrize(
    "claim",
    [
        pytest.param(each, marks=[pytest.mark.survey] * (each.equation in LONG), id=each.equation)
        for each in audit.claims()
    ],
)
def test_another_process_with_other_hashes_has_the_same_row(rows, claim):
    assert claim.row() == rows[claim.equation]


@pytest.mark.parametrize(("residual", "zero"), [("0", True), ("1.5e-49", True), ("1e-9", False), ("K*x", False)])
def test_what_counts_as_zero(residual, zero):
    assert audit.is_zero(residual) == zero


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
