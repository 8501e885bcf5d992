"""A few arms of the survey, and that it sees what is wrong."""

import copy

import numpy as np
import pytest

from tests.plausible import survey
from tests.plausible.arms import draw
from tests.plausible.command import Ran, run
from tests.plausible.spectra import Models
from tests.shared import thinned

QUICK = ("modes", "response", "poles", "margins", "map")


@pytest.mark.parametrize("number", thinned([1, 3], 2))
def test_plausible_arms_are_answered_and_right(number: int) -> None:
    rows = survey.survey_one(number, 2012, QUICK, terms=(28, 36))
    assert [(row.verb, row.outcome, row.words) for row in rows] == [(verb, "answered", "") for verb in QUICK]
    assert all(row.checks > 5 for row in rows)


def test_the_survey_sees_a_wrong_digit_and_a_missing_pole(tmp_path) -> None:
    case = draw(1, 2012)
    models, path = Models(case.beam, 24, 32), tmp_path / "arm.toml"
    path.write_text(case.toml)
    ran = run(["poles", str(path), *case.law.options])
    assert not survey.VERBS["poles"].judge(case, models, ran).wrong
    for spoil in (_missing, _shifted):
        answer = copy.deepcopy(ran.answer)
        spoil(answer)
        judged = survey.VERBS["poles"].judge(case, models, Ran(ran.arguments, 0, answer, "", 0.0))
        assert judged.wrong


def _missing(answer) -> None:
    answer["poles"].pop(len(answer["poles"]) // 2)


def _shifted(answer) -> None:
    answer["poles"][-1][1] *= 1 + 1e-7


def test_arms_are_drawn_the_same_each_time_and_differ() -> None:
    assert draw(5, 1).toml == draw(5, 1).toml != draw(6, 1).toml
    assert np.unique([draw(n, 1).beam.link.length for n in range(20)]).size == 20
