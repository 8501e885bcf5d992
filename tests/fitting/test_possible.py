"""The arms that the data leave possible: spread as the covariance says, and honest about what is not known."""

import numpy as np
import pytest

import tfarm
from tests.fitting.test_fit import LAB, PAIRS, measured
from tfarm.fitting.fit import fit
from tfarm.fitting.possible import extremes, loop_on_all, possible, response_band, share_stable
from tfarm.report.fit_section import fit_section

LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)


@pytest.fixture(scope="module")
def known():
    return fit(LAB, measured(share=0.1), free=["link.youngs_modulus", "link.damping"], profile=False)


def test_draws_are_spread_as_the_covariance_says(known):
    those = possible(known, count=400)
    covariance = np.linalg.inv(known.solution.jacobian.T @ known.solution.jacobian)
    spread = np.cov(those.points.T)
    deviation = np.sqrt(np.diag(covariance))
    assert np.sqrt(np.diag(spread)) == pytest.approx(deviation, rel=5 / np.sqrt(2 * 400))
    correlation = covariance[0, 1] / deviation.prod()
    assert spread[0, 1] / np.sqrt(spread[0, 0] * spread[1, 1]) == pytest.approx(correlation, abs=5 / np.sqrt(400))
    assert those.arms[0].link.youngs_modulus == known.solution.problem.parameters[0].value(those.points[0, 0])


def test_of_an_unknown_pair_the_product_hardly_varies():
    free = ["link.youngs_modulus", "link.section.second_moment"]
    found = fit(LAB, measured(pairs=PAIRS[:1]), free=free, profile=False)
    arms = possible(found, count=30).arms
    E, EI = (np.log([getattr(arm.link, name) for arm in arms]) for name in ("youngs_modulus", "EI"))
    assert np.std(E) > 0.3
    assert np.std(EI) < 1e-3


def test_a_loop_on_all_of_them(known):
    those = possible(known, count=5)
    found = loop_on_all(those, LAW)
    assert (found.stable, found.of) == (5, 5)
    each = [tfarm.margins(arm, LAW) for arm in those.arms]
    assert extremes(found.disk) == (min(m.in_band.disk for m in each), max(m.in_band.disk for m in each))
    share = share_stable(those, np.array([0.3, 0.5]), np.array([0.3, 3.0]))
    assert share.tolist() == [[1.0, 1.0], [0.0, 0.0]]
    low, high, best = response_band(those, "root_moment", np.geomspace(10, 300, 50))
    assert (low < high).all()
    assert (best > 0.9 * low).all()


def test_the_section_of_a_page(known):
    section = fit_section(known, count=3)
    titles = [block.title for block in section.blocks]
    assert titles == [
        "Measured over fitted", "Fitted numbers", "Resonances", "The arms that the data leave possible",
        "Gains on all of these arms", "Margins over these arms",
    ]  # fmt: skip
    assert "the loop holds on 3 of 3 of these arms" in " ".join(section.words)
    table = section.blocks[1]
    assert [row["value"] for row in table] == [each.value for each in known.parameters]
