"""No proof is wrong: certified lists of random arms against an independent model, by `tests.spectrum.proofs`."""

from dataclasses import replace

import numpy as np

from tests.spectrum.proofs import arms, judge
from tests.spectrum.test_certify import random_arm
from tests.survey import each_of, tally
from tfarm.spectrum import Modes


def test_random_arms_are_proven_and_none_wrongly() -> None:
    """`python -m tests.spectrum.proofs 60` for more."""
    outcomes, figures, _ = tally(each_of(arms), 4, 77)
    assert outcomes == {"proven": 4}
    assert figures["gaps counted, of 19"] == [19] * 4


def test_a_wrong_proof_would_be_seen(monkeypatch) -> None:
    """A bracket moved by one per cent, and a count that is one too high."""
    arm, honest = random_arm(np.random.default_rng(5)), Modes.certify

    def forged(self):
        proof = honest(self)
        low, high = map(float, proof.brackets[7])
        brackets = (*proof.brackets[:7], (repr(1.01 * low), repr(1.01 * high)), *proof.brackets[8:])
        return replace(proof, brackets=brackets, count=proof.count + 1)

    monkeypatch.setattr(Modes, "certify", forged)
    verdict = judge(arm)
    assert verdict.outcome == "wrong"
    assert "counted" in verdict.words
    assert "in bracket 8" in verdict.words
