"""A sign turned in any formula of the audit is caught, by a check that never reads the right one.

    python -m tests.audit.test_planted_slips SIZE SEED

Up to SIZE signs between two terms of each formula, chosen by SEED, turned one at a time: the formula's check must
find a residual, and read what is wrong and nothing of what is right.  Budget: half a minute of CPU for all signs
(there are fewer than 100 in each formula).

A slip planted in any formula of the audit is caught by its check, and no formula is compared with itself.
"""

import random
import re
from functools import cache
from unittest.mock import patch

import pytest

from tests import survey
from tests.shared import thinned
from tests.survey import Finding
from tfarm import audit
from tfarm.audit import equations, formulas, paper
from tfarm.errors import CertificationError

CLAIMS = {claim.equation: claim for claim in audit.claims()}
NOT_FORMULAS = {"section 5: inputs", "section 5: alpha_c", "section 5: eta_c"}
FORMULAS = {
    name: claim.corrected or claim.printed
    for name, claim in CLAIMS.items()
    if not name.startswith("Table") and name not in NOT_FORMULAS and "order of" not in name
}
CACHES = (
    formulas.parse_expression,
    equations.accelerations,
    paper.energy_of,
    equations.wave_determinant,
    equations.relation,
)


def flips(text):
    """The text with one of its signs turned, for every sign between two terms (but that of a ±)."""
    for sign in re.finditer(r" ([-+]) (?!pm)", text):
        turned = {"+": "-", "-": "+"}[sign[1]]
        yield text[: sign.start(1)] + turned + text[sign.end(1) :]


SIGNED = [name for name, text in FORMULAS.items() if any(flips(text))]


class Watched:
    """The pattern by which `formulas.parse_expression` finds derivatives in a text, and the texts in which it has."""

    def __init__(self, pattern):
        self.pattern, self.texts = pattern, set()

    def sub(self, replace, text):
        self.texts.add(text)
        return self.pattern.sub(replace, text)

    def fullmatch(self, text):
        return self.pattern.fullmatch(text)


def texts_read_by(check, text):
    """Every formula that a check reads, from empty caches, and the residual that it finds."""
    for cached in CACHES:
        cached.cache_clear()
    with patch.object(formulas, "JET", Watched(formulas.JET)) as watched:
        residual = check(text)
    return watched.texts, residual


def parts(text):
    return {part.strip() for part in re.split(r" = |;", text)}


def faults(name, turned):
    """What is wrong with how a formula's check takes the formula with a turned sign."""
    right, wrong = parts(FORMULAS[name]) - parts(turned), parts(turned) - parts(FORMULAS[name])
    seen, residual = texts_read_by(CLAIMS[name].check, turned)
    if not wrong <= seen:
        yield f"not read: {wrong - seen}"
    if right & seen:
        yield f"compared with itself: {right & seen}"
    if name != "(20), (23): K" and audit.is_zero(residual):  # dimensions, which part the two K, have no sign
        yield f"not caught: {turned}"


def signs(size, seed):
    """Of each formula up to `size` signs."""
    rng = random.Random(seed)
    for name in SIGNED:
        turned_signs = list(flips(FORMULAS[name]))
        for turned in rng.sample(turned_signs, min(size, len(turned_signs))):
            wrong = "; ".join(faults(name, turned))
            yield Finding("fault" if wrong else "caught", f"{name}: {wrong}" if wrong else "", bool(wrong))


PLANTED = [
    ("(1)", "x*theta_tt", "theta_tt"),
    ("(2)", "rho*I", "rho*A"),
    ("(3)", "E*I*phi_x", "E*A*phi_x"),
    ("(4)", "= -kappa", "= kappa"),
    ("(5)", "= -E", "= -2*E"),
    ("(6)", "y(0,t)", "y_x(0,t)"),
    ("(7)", "phi(0,t)", "phi(L,t)"),
    ("(8)", "Phi_x", "Phi"),
    ("(9)", "s^2", "s"),
    ("(10)", "E*I*Phi_x", "I*Phi_x"),
    ("(11)", "L*Theta", "Theta"),
    ("(12)", "= -E", "= E"),
    ("(13)", "Y(0,s)", "Y(L,s)"),
    ("(14)", "Phi(0,s)", "Theta"),
    ("(3), (10), (18), (19): order of arguments", "(0,s)", "(s,0)"),
    ("(1)-(14): damping C", "C*s", "C*s^2"),
    ("(15)", "I_c*", "2*I_c*"),
    ("(16)", "a2*I_h", "a2/2*I_h"),
    ("(17)", "a2*theta_t", "a1*theta_t"),
    ("(18)", "; a3 = a1", ""),
    ("(19)", "K2 < 1", "K2 < 2"),
    ("(19)", "- K2*E", "+ K2*E"),
    ("(20)", "a2*K1", "a1*K1"),
    ("(18)-(20): damping C > 0", "C*phi_xt", "2*C*phi_xt"),
    ("(18)-(20): constant gains, varied by the tuner", "K2_t = 0", "K2_t = 1"),
    ("(21)", "-eta_c", "eta_c"),
    ("(22)", "+ dw", "+ 2*dw"),
    ("(23)", "u - K*x", "u + K*x"),
    ("(20), (23): K", "K2*x", "K1*x"),
    ("section 5: inputs", "u(t-1), ", ""),
    ("Table 1 (rho)", "2766.7", "276.67"),
    ("Table 1 (rho)", "m^3", "m^2"),
    ("Table 1 (C's unit)", "s", "1/s"),
    ("Table 1 (other units)", "G: Pa", "G: N"),
    ("Table 1 (I)", "1.8e-9", "1.8e-8"),
    ("Table 1 (I)", "m^4", "m^3"),
    ("Table 1 (I_h)", "kg m^2", "kg m"),
    ("(A.1)", "- k3*", "+ k3*"),
    ("(A.1)", "rho*s^2/(lambda_1*", "rho*s^2/("),
    ("(A.2)", "4*rho", "2*rho"),
    ("(A.2)", "*(1 + C*s)))))", "))))"),
    ("a_ij", "exp(-lambda_2*L)", "exp(lambda_2*L)"),
    ("a_ij", "lambda_2^2", "lambda_2"),
    ("Delta, Delta k_i", "U a42", "-U a42"),
    ("appendix as a whole", "4*rho", "4.0000000001*rho"),
    ("appendix as a whole", "+ Delta_k3", "- Delta_k3"),
]


@cache
def is_right(name):
    """Whether a claim's check finds nothing in the right formula."""
    claim = CLAIMS[name]
    return audit.is_zero(claim.check(claim.corrected or claim.printed))


@pytest.mark.parametrize(("name", "right", "wrong"), thinned(PLANTED, 7))
def test_a_planted_slip_is_caught(name, right, wrong):
    claim = CLAIMS[name]
    text = claim.corrected or claim.printed
    assert right in text
    assert is_right(name)
    assert not audit.is_zero(claim.check(text.replace(right, wrong, 1)))


def test_every_claim_but_counts_has_a_planted_slip():
    assert set(CLAIMS) - {name for name, _, _ in PLANTED} == {"section 5: alpha_c", "section 5: eta_c"}


def test_a_slip_in_a_correction_stops_the_audit():
    claim = CLAIMS["(A.1)"]
    wrong = type(claim)(
        equation="(A.1)",
        printed=claim.printed,
        corrected=claim.printed,
        check=claim.check,
        evidence="the print as its own correction",
    )
    with pytest.raises(CertificationError, match=r"\(A\.1\), as corrected, leaves"):
        wrong.row()


@pytest.mark.parametrize("name", thinned(SIGNED, 4))
def test_turned_signs_are_caught_and_no_formula_is_compared_with_itself(name):
    """At one sign of each formula; at all of them: `python -m tests.audit.test_planted_slips 1000`."""
    turned_signs = list(flips(FORMULAS[name]))
    assert list(faults(name, turned_signs[len(turned_signs) // 2])) == []


def test_increment_and_update_are_judged_by_descent_on_numbers():
    """Momentum's own claim, by running the rule: the corrected one falls to the minimum, the printed one diverges."""
    ends = {}
    for name, sign in (("printed", -1), ("corrected", 1)):
        w, dw = 1.0, 0.0
        for _ in range(200):
            dw = -0.1 * w + 0.6 * dw
            w += sign * dw
        ends[name] = abs(w)
    assert ends["corrected"] < 1e-9
    assert ends["printed"] > 1e9
    assert CLAIMS["(22)"].corrected == "w_next = w + dw"
    assert CLAIMS["(22)"].printed == "w_next = w - dw"


if __name__ == "__main__":
    survey.main(signs)
