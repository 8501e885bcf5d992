"""A few arms of the survey, and that it sees what is wrong."""

import numpy as np
import pytest

from tests.models import Ritz
from tests.plausible.arms import draw
from tests.plausible.survey import VERBS, gains, judged, poles, run
from tests.shared import thinned


@pytest.mark.parametrize("number", thinned([1, 3], 2))
@pytest.mark.parametrize("verb", VERBS)
def test_plausible_arms_are_answered_and_right(verb, number):
    found = judged(verb, number, 2012, terms=(28, 36))
    assert (found.outcome, found.words) == ("answered", "")
    assert found.figures["checks"] > (2 if verb == "margins" else 5)


def test_the_survey_detects_a_wrong_digit_and_a_missing_pole(tmp_path):
    case, path = draw(1, 2012), tmp_path / "arm.toml"
    models = Ritz(case.arm, 24), Ritz(case.arm, 32)
    path.write_text(case.toml)
    _, answer, _ = run(["poles", str(path), *gains(case)])
    assert poles(case, answer, *models)[0] == []
    right = answer["poles"]
    middle = len(right) // 2
    for wrong in ([*right[:-1], (np.array(right[-1]) * (1 + 1e-5)).tolist()], right[:middle] + right[middle + 1 :]):
        assert poles(case, answer | {"poles": wrong}, *models)[0]
