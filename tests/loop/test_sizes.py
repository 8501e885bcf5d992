"""Nothing is told by how large a number is in its unit: sensors, panels, slow pairs, gains near the smallest double."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import tfarm
from tfarm import Law
from tfarm.errors import ConvergenceError
from tfarm.loop import panels
from tfarm.loop.loop import Loop
from tfarm.loop.margins import dense

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")


class Scaled:
    """The moment at the middle of the arm, so many times as large."""

    def __init__(self, size):
        self.G, self.size = tfarm.transfer(LAB, "moment", x=0.5 * LAB.length), size
        self.outputs = self.G.outputs

    def __call__(self, s):
        return self.size * self.G(s)


@pytest.mark.parametrize("size", [1e-12, 1e12])
def test_zeros_of_a_sensor_are_the_same_in_any_unit_or_refused_in_any(size, monkeypatch):
    line = panels._Panels.of(LAB, "moment", 1j, 300.0)
    np.testing.assert_allclose(line.zeros(Scaled(size)), line.zeros(Scaled(1.0)), rtol=1e-9)
    monkeypatch.setattr(panels, "STEEP_A_SENSOR_PANEL", 400)  # panels too wide for their polynomials
    wide = panels._Panels.of(LAB, "moment", 1j, 2e4)
    with pytest.raises(ConvergenceError, match="do not follow the numerator of moment"):
        wide.zeros(Scaled(size))


def test_the_miss_of_a_panel_is_a_share_of_each_parts_own_size(monkeypatch):
    """Drive, angle or gauge in a unit 2^30 times as large misses by as large a share."""
    parts, small, errors = panels.loop_parts, 2.0**-30, []
    for drive, angle, gauge in ((1.0, 1.0, 1.0), (small, 1.0, 1.0), (1.0, small, 1.0), (1.0, 1.0, small)):

        def read(k, s, drive=drive, shares=(angle, 1.0, gauge)):
            found = parts(k, s)
            return found.drive * drive, found.numerators * np.array(shares)[:, None], found.scale

        monkeypatch.setattr(panels, "loop_parts", read)
        errors.append(panels._panel(LAB, -2e4, 2e4)[1])
    assert errors[0] > 1e-9
    np.testing.assert_allclose(errors, errors[0], rtol=1e-6)


def test_a_slow_pair_is_no_real_pole_to_a_locus():
    """Under next to no stiffness an arm swings as a rigid one, at 1e-5 rad/s."""
    w, ratio = 1e-5, 0.1
    law = Law({"hub_angle": w * w * LAB.total_inertia, "hub_rate": 2 * ratio * w * LAB.total_inertia})
    found = tfarm.locus(LAB, law, "gain", 0.5, 1.0, points=3, branches=1).branches[:, -1]
    slow = found[abs(found) < 1e-3]
    np.testing.assert_allclose(slow, [w * complex(-ratio, math.sqrt(1 - ratio**2))], rtol=1e-4)


def test_without_losses_no_law_is_quiet_however_little_it_feeds_back(monkeypatch):
    """At each of its modes |L| is infinite, though between them it is 1e-12: what is exact is not told."""
    monkeypatch.setattr("tfarm.loop.margins.windows_of", lambda _: {})  # which take longest
    found = tfarm.margins(BARE, Law({"hub_rate": ([1e-12, 1e-12], [1.0, 2.0])}), band=1000.0)
    assert found.stability.is_stable
    assert found.in_band is not None
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == (None, None, None)


def test_models_that_nothing_damps_are_not_unstable_by_rounding():
    """Their poles are at up to 6e4 rad/s, and right of the axis by some last digits."""
    arm = tfarm.load("stocky-steel").having(damping=0.0)
    found = tfarm.spill(arm, Law({"hub_angle": 1.0, "root_moment": 0.3}), 4)
    assert found.rightmost.real.max() > 0
    assert found.unstable.tolist() == [0] * 4
    assert found.driven.size == 0


def test_a_law_that_differentiates_the_angle_is_one_on_the_rate():
    """(a s^2 + b s + c) of the angle is (a s + b) of the rate and c of the angle, over one denominator."""
    den, s = [0.01, 1.0], np.array([0.3 + 2j, 40j, 5.0])
    improper = Law({"hub_angle": ([0.1, 1.0, 2.0], den)})
    proper = Law({"hub_rate": ([0.1, 1.0], den), "hub_angle": ([2.0], den)})
    one, other = (Loop(LAB, law).loop_function(s) for law in (improper, proper))
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_margins_look_at_what_is_narrow_in_the_law_itself():
    """A notch a ten-millionth wide."""
    w, ratio = 40.0, 1e-7
    law = Law({"hub_rate": ([0.3, 0.0, 0.3 * w * w], [1.0, 2 * ratio * w, w * w])})
    poles = SimpleNamespace(values=np.empty(0, complex), moving=np.empty(0, complex))
    omega = dense(SimpleNamespace(loop=Loop(LAB, law), band=100.0, poles=poles))
    assert (abs(omega - w) <= 2 * ratio * w).sum() > 5
