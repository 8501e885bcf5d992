"""A few arms of the survey, and that it sees what is wrong."""

import copy
from dataclasses import replace

import pytest

from tests.plausible.arms import draw
from tests.plausible.judges import Models
from tests.plausible.survey import VERBS, judged, run
from tests.shared import thinned


@pytest.mark.parametrize("number", thinned([1, 3], 2))
@pytest.mark.parametrize("verb", VERBS)
def test_plausible_arms_are_answered_and_right(verb, number):
    found = judged(verb, number, 2012, terms=(28, 36))
    assert (found.outcome, found.words) == ("answered", "")
    assert found.figures["checks"] > 5


def test_the_survey_sees_a_wrong_digit_and_a_missing_pole(tmp_path):
    case = draw(1, 2012)
    models, path = Models(case.beam, 24, 32), tmp_path / "arm.toml"
    path.write_text(case.toml)
    ran = run(["poles", str(path), *case.law.options])
    assert not VERBS["poles"].judge(case, models, ran).wrong
    shifted, missing = copy.deepcopy(ran.answer), copy.deepcopy(ran.answer)
    shifted["poles"][-1][1] *= 1 + 1e-7
    missing["poles"].pop(len(missing["poles"]) // 2)
    for answer in (shifted, missing):
        assert VERBS["poles"].judge(case, models, replace(ran, answer=answer)).wrong
