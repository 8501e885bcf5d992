"""No proof is wrong: certified lists of random arms against an independent model, by `tests.spectrum.proofs`."""

import numpy as np
import pytest

from tests.spectrum.proofs import arms, judge
from tests.spectrum.test_certify import random_arm
from tests.survey import each_of, tally
from tfarm import CertificationError
from tfarm.spectrum import Modes
from tfarm.spectrum.proofs import Certificate


def test_random_arms_are_proven_and_none_wrongly() -> None:
    """`python -m tests.spectrum.proofs 60` for more."""
    outcomes, figures, _ = tally(each_of(arms), 4, 77)
    assert outcomes == {"proven": 4}
    assert figures["gaps counted, of 19"] == [19] * 4


def forged(monkeypatch: pytest.MonkeyPatch, change) -> None:
    honest = Modes.certify
    monkeypatch.setattr(Modes, "certify", lambda self: change(honest(self)))


def moved(proof: Certificate) -> Certificate:
    brackets = list(proof.brackets)
    low, high = map(float, brackets[7])
    brackets[7] = (repr(1.01 * low), repr(1.01 * high))
    return Certificate(tuple(brackets), proof.count, proof.below)


def shifted(proof: Certificate) -> Certificate:
    """A list without its first mode, made up to twenty by one more above."""
    last = float(proof.brackets[-1][0])
    extra = (repr(1.2 * last), repr(1.2 * last * (1 + 1e-14)))
    return Certificate((*proof.brackets[1:], extra), proof.count, proof.below)


def miscounted(proof: Certificate) -> Certificate:
    return Certificate(proof.brackets, proof.count + 1, proof.below)


@pytest.mark.parametrize(
    ("change", "reason"),
    [(moved, "in bracket 8"), (shifted, "another count between the brackets"), (miscounted, "counted")],
)
def test_a_wrong_proof_would_be_seen(monkeypatch: pytest.MonkeyPatch, change, reason: str) -> None:
    arm = random_arm(np.random.default_rng(5))
    assert judge(arm).outcome == "proven"
    forged(monkeypatch, change)
    verdict = judge(arm)
    assert verdict.outcome == "wrong"
    assert reason in verdict.reason


def test_a_refusal_is_tallied_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(proof: Certificate) -> Certificate:
        raise CertificationError("no proven count between 1 and 2 rad/s")

    forged(monkeypatch, refuse)
    verdict = judge(random_arm(np.random.default_rng(5)))
    assert (verdict.outcome, verdict.reason) == ("refused", "no proven count between 1 and 2 rad/s")
