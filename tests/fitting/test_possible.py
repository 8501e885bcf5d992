"""The arms that the data leave possible: spread by the covariance, and wide where numbers are not determined.

Several records of one response: their scatter is the noise's where nothing else differs, and more where it does.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import tfarm
from tests.fitting.planted import chi_squared_at
from tests.fitting.test_fit import LAB, PAIRS, measured
from tests.shared import thinned
from tfarm.dsp import Chain
from tfarm.fitting.fit import arms_drawn, fit, repeats
from tfarm.fitting.possible import response_band, stable_share
from tfarm.plots.frequency import draw_band, draw_share
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import fit_section
from tfarm.spectrum.table import default_gains


@pytest.fixture(scope="module")
def known():
    return fit(LAB, measured(share=0.1), free=["link.youngs_modulus", "link.damping"], profile=False)


def test_intervals_by_the_covariance_reach_its_quantile_to_both_sides(known):
    for each in known.parameters:
        reach = np.exp(1.959964 * each.deviation / each.value)  # of a logarithm
        assert (each.low, each.high) == pytest.approx((each.value / reach, each.value * reach), rel=1e-6)
    assert sum(each.chi_squared for each in known.response_list) == pytest.approx(known.chi_squared, rel=1e-12)


def test_drawn_arms_are_spread_by_the_covariance(known):
    arms = arms_drawn(known, count=400)
    points = np.log([[arm.link.youngs_modulus / known.arm.link.youngs_modulus, arm.damping / known.arm.damping]
                     for arm in arms])  # fmt: skip
    covariance, spread = np.linalg.inv(known.jacobian.T @ known.jacobian), np.cov(points.T)
    deviation = np.sqrt(np.diag(covariance))
    assert np.sqrt(np.diag(spread)) == pytest.approx(deviation, rel=5 / np.sqrt(2 * 400))
    correlation = covariance[0, 1] / deviation.prod()
    assert spread[0, 1] / np.sqrt(spread[0, 0] * spread[1, 1]) == pytest.approx(correlation, abs=5 / np.sqrt(400))


def test_drawn_arms_agree_with_the_data(known):
    """Their own sum of squares, numbers of the sensor at their best, is within the quantile of chi squared: 99.9 %."""
    free = ["link.youngs_modulus", "link.damping", "gain"]
    found = fit(LAB, measured(pairs=PAIRS[:1], share=0.1), free=free, profile=False)
    limit = found.chi_squared + chi2.ppf(0.999, df=2)
    for arm in arms_drawn(found, count=10):
        numbers = {"link.youngs_modulus": arm.link.youngs_modulus, "link.damping": arm.damping}
        sums = [chi_squared_at(found, numbers | {"gain": gain}) for gain in np.linspace(0.8, 1.2, 201)]
        assert min(sums) < limit


def test_of_an_unknown_pair_the_product_hardly_varies():
    free = ["link.youngs_modulus", "link.section.second_moment"]
    found = fit(LAB, measured(pairs=PAIRS[:1]), free=free, profile=False)
    arms = arms_drawn(found, count=30)
    E, EI = (np.log([getattr(arm.link, name) for arm in arms]) for name in ("youngs_modulus", "EI"))
    assert np.std(E) > 0.3
    assert np.std(EI) < 1e-3


def test_gains_and_responses_on_all_of_them(known):
    """The band is that of the drawn arms' own responses, the map the share of those that are stable."""
    arms = arms_drawn(known, count=5)
    band, best = (
        draw_band.figure(known, response_band(known, arms, "root_moment"), "root_moment", 5).axes[0].get_children()[:2]
    )
    vertices = band.get_paths()[0].vertices
    omega = 2 * np.pi * best.get_xdata()[400]
    sizes = [abs(tfarm.transfer(arm, "root_moment")(1j * omega)) for arm in (known.arm, *arms)]
    at = vertices[np.isclose(vertices[:, 0], best.get_xdata()[400], rtol=1e-12), 1]
    assert (at.min(), at.max(), best.get_ydata()[400]) == pytest.approx((min(sizes[1:]), max(sizes[1:]), sizes[0]))
    share = (
        draw_share.figure(known, stable_share(arms[:2], [(0.3, 0.5), (0.3, 3.0)])).axes[0].collections[0].get_array()
    )
    stable = [tfarm.closed_loop_poles(arm, tfarm.HubFeedback(K1=0.3, K2=0.3), 6).unstable == 0 for arm in arms[:2]]
    assert share[0, 0] == np.mean(stable)
    assert share[-1].tolist() == [0.0] * 60


def test_the_section_of_a_page(known):
    section = fit_section(ArmReport(known.arm, Chain(), (), known), count=3)
    titles = [block.title for block in section.blocks]
    assert titles == [
        "Measured over fitted", "Fitted numbers", "Resonances", "The arms that the data leave possible",
        "Gains on all of these arms", "Margins over these arms",
    ]  # fmt: skip
    assert "the loop is stable on 3 of 3 of these arms" in " ".join(section.words)
    assert "[N m s/rad]" in section.blocks[4].figure.axes[0].get_xlabel()
    table = section.blocks[1]
    assert [row["value"] for row in table] == [each.value for each in known.parameters]
    each = [tfarm.margins(arm, default_gains(known.arm)).in_band.disk for arm in arms_drawn(known, count=3)]
    assert [row["disk_margin"][0] for row in section.blocks[-1]] == each


OMEGA = np.geomspace(8.0, 600.0, 60)


def records(moduli):
    """A record of each of these arms."""
    arms = [replace(LAB, link=replace(LAB.link, youngs_modulus=E)) for E in moduli]
    return [measured(arm, PAIRS[:1], seed=n, omega=OMEGA)[0] for n, arm in enumerate(arms)]


@pytest.mark.parametrize("scatter", thinned([0.01, 0.0], 2))
def test_the_scatter_between_records(scatter):
    """E that differs by 1 % from sweep to sweep: of its mean over eight records that leaves 1 %/sqrt(8)."""
    shares = np.array([-1.2, 0.7, 0.1, 1.4, -0.6, -1.1, 0.9, -0.2])
    moduli = LAB.link.youngs_modulus * (1 + scatter * shares)
    found = fit(LAB, records(moduli), free=["link.youngs_modulus"], profile=False)
    several = repeats(found, draws=12)
    each = [row["link.youngs_modulus"] for row in several.each]
    assert each == pytest.approx(moduli, rel=5e-3 if scatter else 2e-3)
    times = several.times_wider["link.youngs_modulus"]
    if not scatter:
        assert 0.4 < times < 1.8  # of eight records: a deviation is known to 1/sqrt(14)
        return
    spread = times * found.parameters[0].deviation / LAB.link.youngs_modulus
    assert spread == pytest.approx(scatter * shares.std(ddof=0) / np.sqrt(8), rel=0.5)
    assert times > 5
    low, high = several.intervals["link.youngs_modulus"]
    assert low < LAB.link.youngs_modulus < high


def test_two_records_have_no_scatter():
    assert (
        repeats(fit(LAB, records([LAB.link.youngs_modulus] * 2), free=["link.youngs_modulus"], profile=False)) is None
    )
