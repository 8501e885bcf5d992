"""Method and proofs: the proofs kept for each arm, the digits shown, formulas as MathML, and the page made of them."""

import json
import re
from dataclasses import replace
from fractions import Fraction
from unittest.mock import Mock
from xml.etree import ElementTree

import numpy as np
import pytest

import tfarm
from tests.report import written
from tfarm.arm import to_toml
from tfarm.audit import arm_proofs, claims, published
from tfarm.audit.arm_proofs import prove
from tfarm.audit.formulas import tex
from tfarm.audit.published import PublishedRow
from tfarm.dsp import Chain
from tfarm.report import write
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import how_proven, modal_table
from tfarm.report.trust import (
    compared_formulas,
    in_letters,
    proof_tables,
    published_tables,
    save_proof,
    write_trust,
    written_proofs,
)
from tfarm.response import frequency
from tfarm.response.frequency import worst_error
from tfarm.schema.html import GREEK

ARM = tfarm.load("stocky-steel")
HELD = replace(ARM, payload=tfarm.Payload(mass=np.inf, inertia=0.1))
LOCKED = replace(HELD, hub=tfarm.Hub(inertia=np.inf))  # no loop: its proofs are quick
CHEAP = ("(8)", "Table 1 (rho)", "Table 1 (I_h)", "section 5: inputs", "(22)", "a_ij")


@pytest.fixture(scope="module")
def proof(pages):
    """The proof that a session's report was made with, as it is read again: that of ARM under another name."""
    (found,) = written_proofs(pages)
    assert found.sha256 == arm_proofs.hash_of(written.ARM)
    return replace(found, name=ARM.name, sha256=arm_proofs.hash_of(ARM))


@pytest.fixture(scope="module")
def proven_modes():
    """The modal table of ARM, whose digits are proven as it is made, and its modes."""
    return tfarm.modes(ARM, count=10), modal_table(ArmReport(ARM, Chain()))


@pytest.fixture(scope="module")
def evidence(audit_rows):
    """Some rows of the audit, and two published numbers, one of them explained."""
    rows = tuple(row for row in audit_rows if row.equation in CHEAP)
    printed = [
        PublishedRow(
            source="nafems-fv5", case="pinned <b>", quantity="frequency [Hz]", mode=mode, printed="42.650",
            ours=42.6449, difference=-1.2e-4, agrees=not why, why=why,
        )
        for mode, why in ((1, ""), (2, "a misprint"))
    ]  # fmt: skip
    return rows, tuple(printed)


@pytest.fixture(scope="module")
def page(evidence, proof, tmp_path_factory):
    """The page of one proven arm and one that is not."""
    folder = tmp_path_factory.mktemp("page") / "trust"
    unproven = replace(proof, name="other", brackets=(), count=0, below="", failure="a double frequency near 7 rad/s")
    write_trust(*evidence, [proof, unproven], folder)
    rows = json.loads((folder / "data" / "audit.json").read_text(encoding="utf-8"))["rows"]
    assert {row["equation"] for row in rows} == set(CHEAP)
    return (folder / "index.html").read_text(encoding="utf-8")


# ------------------------------------------------------------ proofs


def test_the_brackets_hold_what_mpmath_finds_in_the_paper_s_determinant(proof):
    texts = tfarm.modes(ARM, count=10).digits(30)[1:]
    assert len(proof.brackets) == len(texts) == 10
    for row, ((lower, upper), text) in enumerate(zip(proof.brackets, texts, strict=True)):
        assert Fraction(lower) <= Fraction(text) <= Fraction(upper)
        assert text.startswith(proof.leading_digits[row])
    assert proof.count == 11
    assert not proof.failure


@pytest.mark.parametrize(
    ("lower", "text"),
    [
        ("71.50568246689014371", "71.505682466890143710"),
        ("0.00071505682466890143711", "0.00071505682466890143711"),
        ("1200000", "1200000.0000000000000"),
    ],
)
def test_twenty_digits_with_their_zeros(proof, lower, text):
    assert replace(proof, brackets=((lower, ""),)).leading_digits == [text]


def test_the_modal_table_has_the_proof_of_its_digits(proven_modes, monkeypatch):
    modes, table = proven_modes
    report = ArmReport(ARM, Chain())
    assert "Every printed digit of the natural frequencies is proven" in table.caption
    omega, hertz = (column.cells for column in table.columns[1:3])
    assert "11 lie below" in how_proven(report, omega, hertz)
    for i in (1, 10):  # a wrong last digit in either column is found out
        wrong = list(hertz)
        wrong[i] = wrong[i][:-1] + str((int(wrong[i][-1]) + 1) % 10)
        assert "not determined" in how_proven(report, omega, wrong)
        assert "not determined" in how_proven(report, wrong, hertz)

    def fail(self, digits):
        raise tfarm.CertificationError("a double frequency near 7 rad/s")

    monkeypatch.setattr(type(modes), "certify", fail)
    arm_proofs.proven_modes.cache_clear()
    assert how_proven(report, omega, hertz).endswith("not proven: a double frequency near 7 rad/s.")
    unproven = prove(LOCKED)
    assert (unproven.failure, unproven.brackets) == ("a double frequency near 7 rad/s", ())


def test_the_accuracy_is_measured_and_a_wrong_digit_would_show(proof, monkeypatch):
    assert [output for output, _ in proof.errors] == ["root_moment", "tip_displacement"]
    assert all(0 < error < 2e-15 for _, error in proof.errors)

    exact = tfarm.transfer

    def off(arm, output):
        """A response with a relative error of 1e-9."""
        G = exact(arm, output)
        return Mock(side_effect=lambda s: G(s) * (1 + 1e-9), derivative=G.derivative, digits=G.digits)

    monkeypatch.setattr(frequency, "transfer", off)
    assert 1e-10 < worst_error(ARM, "root_moment", proof.band) <= 1e-9


def test_a_response_that_is_zero_throughout_has_no_error():
    assert worst_error(HELD, "tip_displacement", (1.0, 10.0)) is None
    assert [output for output, _ in prove(LOCKED).errors] == ["root_moment"]


# ------------------------------------------------------------ the page


def test_the_page_shows_verdicts_in_words_and_formulas_as_mathml(page):
    for words in ("✓ right as printed", "≠ corrected", "? undecided"):
        assert words in page
    formulas = re.findall(r"<math.*?</math>", page, flags=re.DOTALL)
    assert len(formulas) >= 12
    assert all(ElementTree.fromstring(formula).tag == "math" for formula in formulas)
    assert 'id="eq-8"' in page
    assert 'href="#eq-8"' in page
    assert "A*G*Φ<sub>x</sub>*κ" in page  # the residual of (8) as printed
    assert page.count('class="claim"') == len(CHEAP)
    assert page.count("printed, and used here") == page.count("✓ right as printed</span></h3>") > 0


def test_long_tables_and_claims_are_folded_below_their_answers(page):
    """Unfolded are the counts, the accuracy of curves, and numbers; a chip for every claim."""
    unfolded = re.sub(r"<details.*?</details>", "", page, flags=re.DOTALL)
    assert re.findall(r'id="(table-[^"]*)"', unfolded) == ["table-counts", "table-accuracy"]
    assert "<article" not in unfolded
    assert unfolded.count('href="#eq-') == len(CHEAP)


def test_proofs_published_numbers_versions_and_the_command_are_there(page, proof):
    for words in (
        "Not so for other", "not proven: a double frequency near 7 rad/s", f"{proof.leading_digits[0]}…",
        "1 of 2 printed natural frequencies agree", "a misprint", "pinned &lt;b&gt;", proof.sha256,
        "<code>tfarm report stocky-steel other.toml --out reports</code>",
    ):  # fmt: skip
        assert words in page
    for name in ("numpy", "scipy", "mpmath", "python-flint", "sympy", "control", "matplotlib"):
        assert f">{name}</td>" in page
    assert "<b>" not in page


def test_every_source_of_a_number_is_named():
    """Tables of arms and of rigs: the numbers of the sources are all numbers that are compared."""
    first = [(source.key, source.cases[0]) for source in published.ALL]
    rows = [row for key, case in first for row in published.case_rows(key, case)]
    table = published_tables(published.Validation(tuple(rows)))[0]
    columns = {column.key: column for column in table.columns}
    assert len(columns["numbers"].values) == len(published.ALL)
    assert sum(columns["numbers"].values) == len(rows)


def test_one_page_of_an_arm_does_not_wait_for_the_audit(tmp_path, evidence):
    """--only has no page on trust, nor a link to it, unless a whole report made it before."""
    arm = replace(LOCKED, name="mine")
    page = write([arm], tmp_path, only=("locus",))
    text = page.read_text(encoding="utf-8")
    assert "Method and proofs" not in text
    assert 'href="proof.json"' in text
    assert (tmp_path / "mine" / "arm.toml").read_text(encoding="utf-8") == to_toml(arm)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["index.html", "mine"]
    write_trust(*evidence, written_proofs(tmp_path), tmp_path / "trust")
    write([arm], tmp_path, only=("locus",))
    assert "../trust/index.html" in page.read_text(encoding="utf-8")
    assert "trust/index.html" in (tmp_path / "index.html").read_text(encoding="utf-8")


def test_damped_modes_and_closed_loop_poles_are_counted_and_kept(tmp_path, monkeypatch):
    """Winding numbers in float64, by another code than the balls, count the same; and what was kept is read again."""
    lab, count = tfarm.load("sasaki2012-lab"), 4
    monkeypatch.setattr(arm_proofs, "PROVEN_MODES", count)
    (tmp_path / lab.name).mkdir()
    save_proof(ArmReport(lab, Chain()), tmp_path / lab.name)
    (proof,) = written_proofs(tmp_path)
    damped, loop = proof.boxes
    modes = tfarm.damped_modes(tfarm.modes(lab, count))
    assert (damped.count, damped.failure) == (modes.count, "")
    eigenvalues = modes.eigenvalues.ravel().tolist()
    assert sum(damped.box[0] < s.real and abs(s.imag) < damped.box[3] for s in eigenvalues) == damped.count
    values = tfarm.closed_loop_poles(lab, tfarm.HubFeedback(K1=0.3, K2=0.3), count).values
    assert loop.count == sum(2 if s.imag > 0 else 1 for s in values)
    table = proof_tables([replace(proof, brackets=())])[2]
    assert table.columns[1].values[0] == "damped modes, C = 0.0001 s"
    small = proof_tables(
        [replace(proof, brackets=(), boxes=(replace(loop, what="closed loop, K1 = 1.66e-05, K2 = 0.3"),))]
    )[2]
    assert small.columns[1].cells[0] == "closed loop, K1 = 1.66e-05, K2 = 0.3"


def test_a_box_that_cannot_be_proven_has_its_reason(monkeypatch):
    def fails(*_):
        raise tfarm.CertificationError("a zero lies on the edge")

    monkeypatch.setattr("tfarm.loop.poles.Poles.certify", fails)
    (loop,) = prove(tfarm.load("sasaki2012")).boxes
    assert (loop.count, loop.failure) == (0, "a zero lies on the edge")


# ------------------------------------------------------------ formulas


CLAIMS = claims()
TEXTS = [(claim, text) for claim in CLAIMS for text in (claim.printed, claim.corrected) if text]
WITH_DW = {"(21)", "(22)"}  # their plain text has dw for the increment


def leaves(markup):
    return [leaf for line in markup for leaf in ElementTree.fromstring(str(line)).iter() if leaf.text]


def formulas(text):
    """A formula as MathML, a line each."""
    return compared_formulas(text, text)[0]


def changed(markup):
    return [leaf.text for leaf in leaves(markup) if leaf.get("class") == "changed"]


def claim_of(equation):
    return next(claim for claim in CLAIMS if claim.equation == equation)


def pair(equation):
    claim = claim_of(equation)
    return compared_formulas(tex(claim.printed), tex(claim.corrected))


@pytest.mark.parametrize(("claim", "text"), TEXTS, ids=lambda it: getattr(it, "equation", ""))
def test_every_greek_letter_of_the_plain_text_is_set(claim, text):
    shown = "".join(leaf.text for leaf in leaves(formulas(tex(text))))
    for name, letter in GREEK.items():
        if name == "Delta" and claim.equation in WITH_DW:
            continue
        count = len(re.findall(rf"(?<![A-Za-z]){name}(?![A-Za-z])", text))
        assert shown.replace("ϕ", "φ").count(letter) == count, name
    assert not re.search("xmlns|http|&#", "".join(formulas(tex(text))))


@pytest.mark.parametrize(
    ("equation", "printed", "corrected"),
    [
        ("(8)", ["Θ"], ["Φ"]),
        ("(14)", ["t"], ["s"]),
        ("(17)", ["x"], ["t"]),
        ("(22)", ["−"], ["+"]),
        ("(A.1)", ["−", "−"], ["+", "+"]),
        ("Table 1 (rho)", ["2.7667"], ["2766.7"]),
        ("(1)-(14): damping C", [], ["(", "1", "+", "C", "s", ")"]),
    ],
)
def test_what_differs_is_marked_and_nothing_else(equation, printed, corrected):
    left, right = pair(equation)
    assert changed(left) == printed
    assert changed(right) == corrected


def test_a_determinant_has_bars_as_high_as_it():
    claim = claim_of("Delta, Delta k_i")
    bars = [leaf for leaf in leaves(formulas(tex(claim.printed))) if leaf.text == "|"]
    assert [bar.get("form") for bar in bars] == ["prefix", "postfix"] * 5
    assert all(bar.get("stretchy") == "true" for bar in bars)


def test_infinity_is_no_operator_and_plus_minus_is_one():
    lines = formulas(r"x = \pm \sqrt{a \pm b},\quad y < \infty")
    tags = [(leaf.tag, leaf.get("form")) for leaf in leaves(lines) if leaf.text in "±∞"]
    assert tags == [("mo", "prefix"), ("mo", "infix"), ("mi", None)]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("u theta_t only", "u θ<sub>t</sub> only"),
        ("kappa*G, m^2", "κ*G, m²"),
        ("a_31 and K2", "a<sub>31</sub> and K2"),
        ("phi_xt^2", "φ<sub>xt</sub>²"),
        ("<b>rho</b>", "&lt;b&gt;ρ&lt;/b&gt;"),
        ("alphabet, eta", "alphabet, η"),
    ],
)
def test_plain_text_in_letters(text, shown):
    assert in_letters(text) == shown
