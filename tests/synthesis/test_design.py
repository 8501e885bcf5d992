"""Gains that serve best: never beaten by random ones, always stable, and what the slew leaves against a simulation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import tfarm
from tests.loop.ritz_loop import RitzLoop
from tests.shared import sized
from tests.synthesis.designs import grids, least_on
from tfarm import HubFeedback
from tfarm.arm import many_laws
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.damping import least_damping
from tfarm.loop.frequencies import band_of
from tfarm.loop.lines import NO_FEEDBACK
from tfarm.loop.margins import loop_margins
from tfarm.loop.plane import gain_map
from tfarm.loop.residual import PERIOD_SAMPLES, RISE, TURN, residual_moment
from tfarm.loop.stability import stability
from tfarm.synthesis.design import best_gains

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
BOUNDS = {"K1": (0.0, 20.0), "K2": (-2.0, 1.0)}


def slew(model, law):
    """The Ritz model's gauge over the first period after the slew: matrix exponentials, the reference as states."""
    arm, A, n = model.arm, model.state_matrix(law), model.n
    torque = np.zeros(A.shape[0])
    torque[n : 2 * n] = np.linalg.solve(model.M, model.b)
    torque[-1] = (model.inertia * model.b @ torque[n : 2 * n] - 1) / model.damping
    N = A.shape[0]
    whole = np.zeros((N + 3, N + 3))  # z, then reference angle, rate and acceleration
    whole[:N, :N] = A
    whole[:N, N:] = np.outer(torque, [law.Kp, law.K1, arm.total_inertia])
    whole[N, N + 1] = whole[N + 1, N + 2] = 1
    z, half = np.zeros(N + 3), expm(whole * RISE / 2)
    for acceleration in (1, -1):
        z[-1] = acceleration * 4 * TURN / RISE**2
        z = half @ z
    assert z[N] == pytest.approx(TURN)
    z[-1] = 0.0
    step = expm(whole * 2 * np.pi / tfarm.modes(arm, 1).natural_frequency[-1] / PERIOD_SAMPLES)
    moment = []
    for _ in range(PERIOD_SAMPLES):
        moment.append(z[N - 1])
        z = step @ z
    return np.array(moment)


@pytest.mark.parametrize(
    ("K1", "K2", "Kp"), [(0.3, 0.3, 0.0), (0.3, 0.0, 0.0), (5.0, 0.3, 0.0), (26.0, -3.0, 0.0), (0.3, 0.3, 5.0)]
)
def test_the_residual_moment_is_that_of_a_simulated_slew(K1, K2, Kp) -> None:
    """Real poles count: at K1 = 26 and K2 = -3 they are nine tenths of what is left."""
    moment = slew(RitzLoop(LAB, 10), HubFeedback(K1=K1, K2=K2, Kp=Kp))
    ours = residual_moment(LAB, many_laws(HubFeedback(K1=K1, K2=K2, Kp=Kp)), 6)[0]
    assert ours == pytest.approx(np.sqrt((moment**2).mean()), rel=1e-3)


def test_what_an_unstable_loop_leaves_is_huge_but_finite() -> None:
    left = residual_moment(BARE, many_laws(NO_FEEDBACK, K1=[0.3, 0.3, -1e4], K2=[0.3, 6.0, 0.3]), 2)
    assert np.isfinite(left).all()
    assert (left[1:] > left[0]).all()


@pytest.fixture(scope="module")
def damping():
    return best_gains(LAB, "damping", continuous=True, **BOUNDS)


def random_gains(arm, number):
    rng = np.random.default_rng(5)
    K1, K2 = np.sort(rng.uniform(*BOUNDS["K1"], 15)), np.sort(rng.uniform(*BOUNDS["K2"], 15))
    stable = gain_map(arm, K1, K2).stable
    a, b = np.meshgrid(K1, K2)
    assert stable.sum() >= number
    return a[stable][:number], b[stable][:number]


def test_two_hundred_random_gains_damp_no_better(damping) -> None:
    K1, K2 = random_gains(LAB, 200)
    assert least_damping(LAB, many_laws(NO_FEEDBACK, K1=K1, K2=K2), 2).max() <= damping.value * (1 + 1e-9)
    assert damping.verdict.is_stable
    assert least_damping(LAB, many_laws(damping.law), 2)[0] == damping.value


@pytest.fixture(scope="module")
def residual():
    return best_gains(LAB, "residual", continuous=True, **BOUNDS)


def test_two_hundred_random_gains_leave_no_less(damping, residual) -> None:
    K1, K2 = random_gains(LAB, 200)
    assert residual_moment(LAB, many_laws(NO_FEEDBACK, K1=K1, K2=K2), 2).min() >= residual.value * (1 - 1e-9)
    assert residual.value < residual_moment(LAB, many_laws(damping.law), 2)[0]


@pytest.mark.survey
def test_no_grid_leaves_less() -> None:
    """The small case of `python -m tests.synthesis.designs SIZE SEED`, and a part of the box where a grid once did."""
    residual = best_gains(LAB, "residual", continuous=True)
    best = min(least_on(LAB, *grid) for grid in grids(np.random.default_rng(1), residual))
    assert residual.value <= 1.01 * best
    assert residual.value <= 1.01 * least_on(LAB, np.linspace(1e-3, 0.1, 60), np.linspace(-3, -1, 60))


def test_without_damping_a_slew_ends_in_whole_periods() -> None:
    """K1 -> 0 leaves a hub of I_h/(1 - K2); of its mode at w then sin^2(w T/4) is left: nothing at w T = 4 pi n."""
    found = best_gains(BARE, "residual", modes=1, continuous=True)
    hub = tfarm.Hub(inertia=BARE.hub.inertia / (1 - found.law.K2))
    periods = tfarm.modes(replace(BARE, hub=hub), 1).natural_frequency[-1] * RISE / (4 * np.pi)
    assert periods == pytest.approx(round(periods), abs=1e-6)
    plain = residual_moment(BARE, many_laws(HubFeedback(K1=found.law.K1)), 1)[0]
    assert found.value < 1e-6 * plain


@pytest.mark.parametrize("name", ["damping", "residual"])
def test_the_flat_part_is_that_of_the_valley(name, request) -> None:
    """Within one per cent at its ends and in between; just beyond them, the other gain held, worse."""
    found = request.getfixturevalue(name)
    law, worse = found.law, found.value * (0.99 if name == "damping" else 1.01)

    def value(K1, K2):
        if name == "damping":
            return least_damping(LAB, many_laws(NO_FEEDBACK, K1=K1, K2=K2), 2) - worse
        return worse - residual_moment(LAB, many_laws(NO_FEEDBACK, K1=K1, K2=K2), 2)

    for axis, (low, high) in enumerate((found.flat_K1, found.flat_K2)):
        bounds = found.bounds[("K1", "K2")[axis]]
        inside = np.linspace(low + 1e-6 * (high - low), high - 1e-6 * (high - low), 41)
        gains = [np.full(inside.size, law.K1), np.full(inside.size, law.K2)]
        gains[axis] = inside
        assert (value(*gains) >= 0).all()
        for end, bound in zip((low, high), bounds, strict=True):
            beyond = [np.array([law.K1]), np.array([law.K2])]
            beyond[axis] = np.array([end + (1e-3 if end == high else -1e-3) * (high - low)])
            assert end == bound or value(*beyond)[0] < 0


def test_where_the_bounds_cut_the_search_off_is_no_optimum(damping) -> None:
    """More damping lies beyond the bounds named, and none beyond those that are not."""
    assert damping.at_bound == ("K1", "K2")
    found = best_gains(LAB, "damping", continuous=True)
    assert (found.widened, found.at_bound) == (("K2",), ())
    assert found.bounds["K2"][0] < found.law.K2 < -3.0
    K1, K2 = found.law.K1 * np.array([0.99, 1.01, 1.0, 1.0]), found.law.K2 + np.array([0.0, 0.0, -0.1, 0.1])
    assert least_damping(LAB, many_laws(NO_FEEDBACK, K1=K1, K2=K2), 2).max() < found.value


@pytest.mark.parametrize("number", sized(8, 30))
def test_random_gains_have_no_better_disk_margin(number) -> None:
    bounds = {"K1": (0.1, 20.0), "K2": (0.3, 1.0)}
    found = best_gains(LAB, "margin", continuous=True, **bounds)
    rng, band = np.random.default_rng(6), band_of(LAB, 2)
    values = []
    for K1, K2 in zip(rng.uniform(0.1, 20.0, number), rng.uniform(0.3, 1.0, number), strict=True):
        values.append(loop_margins(stability(LAB, HubFeedback(K1=K1, K2=K2), band)).disk)
    assert max(values) <= found.value * (1 + 1e-6)
    assert found.value == pytest.approx(loop_margins(stability(LAB, found.law, band)).disk, rel=1e-3)


def test_gains_that_are_not_stable_never_win() -> None:
    found = best_gains(BARE, "residual", K1=(-1.0, 1.0), K2=(0.0, 3.0), continuous=True)
    assert found.verdict.is_stable
    assert found.law.K1 > 0
    with pytest.raises(ConvergenceError, match="widen the bounds"):
        best_gains(BARE, "damping", K1=(0.1, 1.0), K2=(1.1, 3.0), continuous=True)


@pytest.mark.parametrize("K1", [(1.0, 1.0), (2.0, 1.0), (float("nan"), 1.0), (0.0, float("inf"))])
def test_empty_bounds_are_refused(K1) -> None:
    with pytest.raises(ParameterError, match="K1"):
        best_gains(LAB, "damping", K1=K1)


def test_an_unknown_objective_is_refused() -> None:
    with pytest.raises(ParameterError, match="objective"):
        best_gains(LAB, "beauty")


@pytest.mark.parametrize("part", ["mass", "inertia"])
def test_an_arm_that_cannot_turn_has_no_slew_to_leave_a_residual(part) -> None:
    held = replace(LAB, payload=tfarm.Payload(**{part: float("inf")}))
    with pytest.raises(ParameterError, match=rf"payload\.{part} = inf: .*no slew"):
        best_gains(held, "residual")
