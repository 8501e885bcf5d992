"""Gains for the continuous loop: stable, as good as a Legendre-Ritz model's at random points, and how flat they are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import tfarm
from tests.loop.ritz_loop import RitzLoop
from tests.shared import refusal, sized
from tests.synthesis.judged import judge_of
from tfarm import HubFeedback
from tfarm.case import Case
from tfarm.errors import ConvergenceError
from tfarm.loop.continuous import frequency_above_mode
from tfarm.loop.stability import stability
from tfarm.synthesis.design import design

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
BOUNDS = {"K1": (0.0, 20.0), "K2": (-2.0, 1.0)}
MODEL, TOP = RitzLoop(LAB, 12), frequency_above_mode(LAB, 2)
RISE, TURN = 1.0, 1.15  # s, rad: the default slew of a chain
POINTS = 64  # of the period after it


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
    step = expm(whole * 2 * np.pi / tfarm.modes(arm, 1).natural_frequency[-1] / POINTS)
    moment = []
    for _ in range(POINTS):
        moment.append(z[N - 1])
        z = step @ z
    return np.array(moment)


def left(law, model=MODEL):
    """Root mean square of that."""
    return np.sqrt((slew(model, law) ** 2).mean())


def damping_of(law):
    """The least damping ratio of the Ritz model's poles in the band; negative where the loop is not stable."""
    s = MODEL.eigenvalues(law)
    if (s.real > 1e-9 * abs(s)).any():
        return -1.0
    s = s[(s.imag > 0) & (s.imag < TOP)]
    return (-s.real / abs(s)).min(initial=1.0)


@pytest.mark.parametrize(
    ("K1", "K2", "Kp"), [(0.3, 0.3, 0.0), (0.3, 0.0, 0.0), (5.0, 0.3, 0.0), (26.0, -3.0, 0.0), (0.3, 0.3, 5.0)]
)
def test_the_residual_moment_is_that_of_a_simulated_slew(K1, K2, Kp):
    """Real poles count: at K1 = 26 and K2 = -3 they are nine tenths of what is left."""
    law = HubFeedback(K1=K1, K2=K2, Kp=Kp)
    ours = judge_of(LAB, law, "residual", count=6, continuous=True).score(law)
    assert ours == pytest.approx(left(law), rel=1e-3)


@pytest.fixture(scope="module")
def damping():
    return design(LAB, "damping", continuous=True, **BOUNDS)


@pytest.fixture(scope="module")
def residual():
    return design(LAB, "residual", continuous=True, **BOUNDS)


def random_laws(number):
    rng = np.random.default_rng(5)
    laws = [
        HubFeedback(K1=float(a), K2=float(b))
        for a, b in zip(rng.uniform(0, 20, number), rng.uniform(-2, 1, number), strict=True)
    ]
    return [law for law in laws if damping_of(law) > 0]


def test_random_gains_damp_no_better_and_leave_no_less(damping, residual):
    assert max(damping_of(law) for law in random_laws(200)) <= damping.value * (1 + 1e-4)
    assert damping.verdict.is_stable
    assert damping_of(damping.law) == pytest.approx(damping.value, rel=1e-4)
    assert min(left(law) for law in random_laws(50)) >= residual.value * (1 - 1e-3)
    assert residual.value < left(damping.law)
    assert left(residual.law) == pytest.approx(residual.value, rel=1e-3)


def test_without_damping_no_hub_whose_slew_ends_in_whole_periods_leaves_less():
    """K1 -> 0 leaves a hub of I_h/(1 - K2); of its mode at w then sin^2(w T/4) is left: nothing at w T = 4 pi n."""

    def periods(K2):
        hub = tfarm.Hub(inertia=BARE.hub.inertia / (1 - K2))
        return tfarm.modes(replace(BARE, hub=hub), 1).natural_frequency[-1] * RISE / (4 * np.pi)

    found = design(BARE, "residual", modes=1, continuous=True)
    whole = HubFeedback(K1=1e-6, K2=brentq(lambda K2: periods(K2) - 5, 0.0, 0.9))
    judge = judge_of(BARE, whole, "residual", continuous=True)
    assert found.value <= judge.score(whole) < 0.3 * judge.score(HubFeedback(K1=1e-6))


@pytest.mark.parametrize("name", ["damping", "residual"])
def test_the_flat_part_is_that_of_the_valley(name, request):
    """Within one per cent at its ends and in between; just beyond them, the other gain held, worse."""
    found = request.getfixturevalue(name)
    judge = judge_of(LAB, found.law, name, continuous=True)
    best = judge.score(found.law)
    limit = best + 0.01 * abs(best)
    for key, (low, high) in found.flat.items():
        inside = np.linspace(low + 1e-6 * (high - low), high - 1e-6 * (high - low), 41)
        assert all(judge.score(found.law.with_number(key, float(each))) <= limit for each in inside)
        for end, bound in zip((low, high), found.bounds[key], strict=True):
            beyond = found.law.with_number(key, end + (1e-3 if end == high else -1e-3) * (high - low))
            assert end == bound or judge.score(beyond) > limit


def test_where_the_bounds_cut_the_search_off_is_no_optimum(damping):
    """More damping lies beyond the bounds given, and none beyond those that are not."""
    assert (damping.at_bound, damping.at_limit, damping.widened) == (("K1", "K2"), (), ())
    found = design(LAB, "damping", continuous=True)
    assert (found.widened, found.at_bound) == (("K2",), ())
    assert found.bounds["K2"][0] < found.law.K2 < -3.0
    around = [(0.99, 0.0), (1.01, 0.0), (1.0, -0.1), (1.0, 0.1)]
    others = [HubFeedback(K1=a * found.law.K1, K2=found.law.K2 + b) for a, b in around]
    assert max(damping_of(law) for law in others) < found.value > damping.value


@pytest.mark.parametrize("number", sized(8, 30))
def test_random_gains_have_no_better_disk_margin(number):
    bounds = {"K1": (0.1, 20.0), "K2": (0.3, 1.0)}
    found = design(LAB, "margin", continuous=True, **bounds)
    rng = np.random.default_rng(6)
    values = []
    for K1, K2 in zip(rng.uniform(0.1, 20.0, number), rng.uniform(0.3, 1.0, number), strict=True):
        values.append(stability(Case(LAB, HubFeedback(K1=K1, K2=K2)), TOP).in_band.disk)
    assert max(values) <= found.value * (1 + 1e-6)
    assert found.value == pytest.approx(stability(Case(LAB, found.law), TOP).in_band.disk, rel=1e-3)


def test_a_continuous_time_design_of_another_structure_has_the_damping_of_its_poles():
    found = design(LAB, "damping", structure="lead", continuous=True)
    assert found.verdict.is_stable
    s = tfarm.closed_loop_poles(LAB, found.law, 6).values
    s = s[(s.imag > 0) & (s.imag < TOP)]
    assert found.value == pytest.approx((-s.real / abs(s)).min(), rel=1e-9)
    sensitive = design(LAB, "sensitivity", structure="PD", continuous=True)
    assert 1.0 <= sensitive.value < 1.1  # L falls to 0


def test_gains_that_are_not_stable_never_win():
    found = design(BARE, "residual", K1=(-1.0, 1.0), K2=(0.0, 3.0), continuous=True)
    assert found.verdict.is_stable
    assert found.law.K1 > 0
    with pytest.raises(ConvergenceError, match="widen the bounds"):
        design(BARE, "damping", K1=(0.1, 1.0), K2=(1.1, 3.0), continuous=True)


HELD = [(replace(LAB, payload=tfarm.Payload(**{part: float("inf")})), part) for part in ("mass", "inertia")]
BAD = [
    *((LAB, {"K1": bounds}, "K1") for bounds in ((1.0, 1.0), (2.0, 1.0), (float("nan"), 1.0), (0.0, float("inf")))),
    *((arm, {"objective": "residual"}, f"payload.{part} = inf: ") for arm, part in HELD),  # no slew to leave one
    (LAB, {"structure": "LQX"}, "structure"),
    (LAB, {"structure": "lead", "objective": "beauty"}, "objective"),
    (LAB, {"structure": "lead", "K1": (0.0, 1.0)}, "K1"),
    (LAB, {"structure": "PD", "Kp": -1.0}, "Kp"),
]


@pytest.mark.parametrize(("arm", "options", "words"), BAD)
def test_what_does_not_go_together_is_refused(arm, options, words):
    assert words in str(refusal(design, arm, **options))
