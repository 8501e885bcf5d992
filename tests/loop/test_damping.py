"""Poles and damping of many laws at once, against the complete lists of `poles_below` and a Legendre-Ritz model."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.loop.agreement import some_free_arm, some_gains
from tests.loop.ritz_loop import RitzLoop
from tests.shared import thinned
from tfarm import HubFeedback
from tfarm.arm import law_of, many_laws
from tfarm.errors import ConvergenceError
from tfarm.loop import damping
from tfarm.loop.damping import band_and_real_poles, band_poles, is_oscillating, least_damping
from tfarm.loop.frequencies import band_of
from tfarm.loop.loop import Loop
from tfarm.loop.poles import poles_below
from tfarm.reduced import tailed_model

LAB = tfarm.load("sasaki2012-lab")


def some_laws(rng, arm, number):
    K1, K2, Kp = some_gains(rng, arm, number)
    return many_laws(HubFeedback(Kp=Kp), K1=K1, K2=rng.permutation(K2))


@pytest.mark.parametrize(("seed", "number"), thinned(product(range(4), (1, 4)), 3))
def test_they_are_the_poles_of_the_complete_list(seed, number) -> None:
    rng = np.random.default_rng(30 + seed)
    arm = some_free_arm(rng, damped=bool(seed % 2))
    laws, top = some_laws(rng, arm, 6), band_of(arm, number)
    oscillating, either = band_poles(arm, laws, number), band_and_real_poles(arm, laws, number)
    real = np.where(is_oscillating(either), np.nan, either)
    for n, law in enumerate(laws.T):
        complete = poles_below(Loop(arm, law_of(law)), 3 * top)
        exact, left = complete.moving, complete.box.re_min
        for found, there in (
            (oscillating[n], exact[(exact.imag > 0) & (exact.imag < top)]),
            (real[n], exact[(exact.imag == 0) & (abs(exact) < top)]),
        ):
            found = np.sort_complex(found[found.real > left])
            np.testing.assert_allclose(found, np.sort_complex(there), rtol=1e-8, atol=1e-9 * top)


def test_the_least_damping_is_that_of_an_independent_model() -> None:
    K1, K2 = np.array([0.3, 0.3, 5.0, 0.3]), np.array([0.3, -1.0, 0.5, 1.2])
    found = least_damping(LAB, many_laws(HubFeedback(), K1=K1, K2=K2), 2)
    model, top = RitzLoop(LAB, 12), band_of(LAB, 2)
    for n in range(4):
        s = model.eigenvalues(HubFeedback(K1=float(K1[n]), K2=float(K2[n])))
        s = s[(s.imag > 0) & (s.imag < top)]
        assert found[n] == pytest.approx((-s.real / abs(s)).min(), rel=1e-5)
    assert found[3] < 0


def test_next_to_the_clamped_hub_a_larger_model_is_asked_before_a_box(monkeypatch):
    """K2 = 0.9978 nearly cancels the hub's inertia: a model's first modes are a third off, and a design asks often."""
    arm = tfarm.load("sasaki2012")
    arm = replace(arm, link=replace(arm.link, length=16.0))
    K1 = np.array([0.3, 0.1, 1.0])
    top = band_of(arm, 1)
    boxed = [poles_below(Loop(arm, HubFeedback(K1=float(k), K2=0.9978)), top).values for k in K1]
    monkeypatch.setattr(damping, "poles_below", None)
    found = band_poles(arm, many_laws(HubFeedback(K2=0.9978), K1=K1), 1)
    for own, box in zip(found, boxed, strict=True):
        box = box[is_oscillating(box) & (box.imag < top)]
        np.testing.assert_allclose(np.sort_complex(own[~np.isnan(own)]), np.sort_complex(box), rtol=1e-9)


def test_a_hub_as_good_as_clamped_needs_no_larger_model(monkeypatch):
    """A light hub that K2 nearly clamps: designs took 20 s and more, in models of 31 and 101 modes and in boxes."""
    arm = tfarm.load("stocky-steel")
    arm = replace(arm, link=replace(arm.link, density=58453563.61002201))
    K1, K2, top = np.geomspace(1.0, 1e4, 5).repeat(4), np.tile([-2, 0.5, 0.95, 0.9972], 5), band_of(arm, 1)
    model = RitzLoop(arm, 12)
    monkeypatch.setattr(damping, "MODES_BEYOND_BAND", damping.MODES_BEYOND_BAND[:1])
    monkeypatch.setattr(damping, "poles_below", None)
    for own, a, b in zip(band_poles(arm, many_laws(HubFeedback(), K1=K1, K2=K2), 1), K1, K2, strict=True):
        s = model.eigenvalues(HubFeedback(K1=float(a), K2=float(b)))
        s = s[is_oscillating(s) & (s.imag < top)]
        np.testing.assert_allclose(np.sort_complex(own[~np.isnan(own)]), np.sort_complex(s), rtol=1e-6)


def test_modes_that_cannot_be_followed_are_sought_once_and_left_to_a_box(monkeypatch):
    """A heavy arm of much damping, and a law that makes two poles one: 20 s went into 101 modes, then nothing came."""
    arm = tfarm.load("sasaki2012-as-printed")
    section = replace(arm.link.section, area=0.5471584437514746)
    arm = replace(arm, link=replace(arm.link, damping=0.02, section=section))
    sought, laws = [], many_laws(HubFeedback(K2=-1.29253472), K1=np.array([10.9546321, 10.9546322]))

    def lost(arm, count):
        sought.append(count)
        if count > 6:
            raise ConvergenceError("lost", None, None)
        return tailed_model(arm, count)

    monkeypatch.setattr(damping, "tailed_model", lost)
    damping._model.cache_clear()
    found = [band_and_real_poles(arm, laws, 1) for _ in range(2)]
    damping._model.cache_clear()
    assert sought == [6, 31]
    np.testing.assert_array_equal(*found)
    boxed = poles_below(Loop(arm, law_of(laws[:, 0])), band_of(arm, 1)).moving
    own = found[0][0]
    np.testing.assert_allclose(np.sort_complex(own[~np.isnan(own)]), np.sort_complex(boxed), rtol=1e-8)


def test_two_starts_that_end_in_one_pole_are_no_answer(monkeypatch) -> None:
    """The first law's poles are then those of a box, and none is missing."""
    laws = many_laws(HubFeedback(), K1=np.array([0.1, 0.4]), K2=np.array([0.3, -0.2]))
    alone, next_to = band_poles(LAB, laws, 3), damping.exact_poles_next_to

    def merged(arm, starts, laws):
        polished, settled = next_to(arm, starts, laws)
        polished[0, 1] = polished[0, 0]
        return polished, settled

    monkeypatch.setattr(damping, "exact_poles_next_to", merged)
    found = band_poles(LAB, laws, 3)
    for mine, theirs in zip(found, alone, strict=True):
        mine, theirs = (np.sort_complex(each[~np.isnan(each)]) for each in (mine, theirs))
        np.testing.assert_allclose(mine, theirs, rtol=1e-9)
