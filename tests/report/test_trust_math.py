"""TeX of the audit to MathML: well formed, nothing lost, differences marked where they are."""

import re
from xml.etree import ElementTree

import pytest

from tfarm.audit import claims
from tfarm.audit.rows import tex
from tfarm.report.trust import anchor, compared_formulas, in_letters
from tfarm.schema.html import GREEK

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


def test_the_same_formula_has_no_marks():
    typeset = tex(claim_of("(15)").printed)
    assert [changed(side) for side in compared_formulas(typeset, typeset)] == [[], []]


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


def test_every_equation_has_an_anchor_of_its_own():
    anchors = [anchor(claim.equation) for claim in CLAIMS]
    assert len(set(anchors)) == len(anchors)
    assert anchor("(A.1)") == "eq-a-1"
