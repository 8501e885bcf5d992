"""Real poles that no mode goes over into: what friction makes of a hub that weighs next to nothing."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from tests.transition import determinant
from tfarm import Hub, damped_modes, load, modes, transfer
from tfarm.arm import FED_BACK
from tfarm.dsp import Chain, Sampling
from tfarm.dsp.verdict import sampled_verdict
from tfarm.reduced import modal_model
from tfarm.spectrum.damped import entered
from tfarm.spectrum.table import default_gains

LAB = load("sasaki2012-lab")
LEFT_OUT = 2e-3  # of a response: what the modes left out add beside their static share at C = 0


def rubbing(inertia, friction, *, theory="timoshenko", C=1e-4):
    return replace(LAB.having(damping=C), hub=Hub(inertia=inertia, friction=friction), theory=theory)


@pytest.mark.parametrize("theory", ["timoshenko", "euler-bernoulli"])
@pytest.mark.parametrize("inertia", [0.0, 1e-6])
def test_the_pole_is_one_of_the_exact_arm(theory, inertia):
    arm = rubbing(inertia, 5.0, theory=theory)
    (pole,) = entered(damped_modes(modes(arm, 6)))
    beside = [determinant(arm, mpmath.mpf(pole * (1 + side)), digits=30).real for side in (-1e-9, 1e-9)]
    assert beside[0] * beside[1] < 0
    assert -140 < pole < -130


@pytest.mark.parametrize("C", [1e-4, 0.0])
@pytest.mark.parametrize("friction", [2.0, 5.0])
@pytest.mark.parametrize("inertia", [0.0, 1e-6])
def test_a_modal_model_has_it(C, friction, inertia):
    arm, s = rubbing(inertia, friction, C=C), 1j * np.array([20.0, 50.0, 300.0])
    exact = transfer(arm, list(FED_BACK))(s)
    np.testing.assert_allclose(modal_model(arm, FED_BACK, 16)(s), exact, rtol=LEFT_OUT)


def test_the_sampled_loop_of_few_modes_is_that_of_many():
    """Both with a pole at -135 1/s that was in neither: a fit of slow poles had stood in for it."""
    arm, chain = rubbing(0.0, 5.0), Chain(sampling=Sampling(period=2e-3))
    law = default_gains(arm)
    few, many = (sampled_verdict(arm, law, chain, count=count) for count in (8, 24))
    assert few.log_radius == pytest.approx(many.log_radius, rel=1e-6)


@pytest.mark.parametrize("inertia", [1e-3, 0.1])
def test_a_hub_that_weighs_something_has_none(inertia):
    assert not entered(damped_modes(modes(rubbing(inertia, 5.0), 6))).size


def test_a_segment_next_to_massless_is_no_warning():
    """On the negative axis its waves hardly swing: what D grows by from one s to the next is beyond any number."""
    first = replace(LAB.link, length=0.3, density=1e-9, damping=0.0)
    assert not entered(damped_modes(modes(replace(LAB, link=first, outer=(LAB.link,)), 6))).size
