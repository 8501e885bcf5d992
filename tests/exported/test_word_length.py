"""Realisations and bounds of finite word length, against sums, Lyapunov equations, fractions and whole numbers."""

from dataclasses import replace

import numpy as np
import pytest
import sympy
from scipy.linalg import solve_discrete_lyapunov

import tfarm
from tests.exported import worst
from tests.exported.cases import GAINS, IDEAL, LAB, NOTCH, PI, REAL, realised, task_of
from tests.survey import tally
from tfarm.case import Case
from tfarm.dsp import Converters
from tfarm.errors import ParameterError
from tfarm.exported.controller import c_controller, in_z
from tfarm.exported.realisations import candidates, close_around_law, gramians, similar, with_system_matrix
from tfarm.exported.word_length import absolute_sum, observable_part

SERVO = tfarm.Law(
    {"hub_angle": ([6.0, 8.0], [0.02, 1.0]), "root_moment": ([0.1], [0.01, 1.0])}, references=("hub_angle",)
)

LAG = tfarm.Law({"hub_rate": ([0.3], [0.02, 1.0]), "root_moment": ([0.1], [0.01, 1.0])}, references=("hub_rate",))
MULTIPLE = tfarm.Law({"hub_angle": ([1e-10], np.poly(np.full(8, 0.95)).tolist())}, period=0.01)
WITH_DAC = replace(IDEAL, converters=Converters(torque_bits=12, torque_range=2.0))
UNSTABLE = tfarm.HubFeedback(K1=0.3, K2=30.0)


def exact_loop(law, chain=IDEAL, arm=LAB):
    return in_z(Case(arm, law, chain)), tfarm.sampled(arm, law, chain).verdict.loop


@pytest.mark.parametrize("law", [SERVO, PI, NOTCH])
def test_every_realisation_has_the_transfer_functions_of_the_law(law):
    given, loop = exact_loop(law)
    z = np.exp(1j * np.linspace(0.05, 3.1, 40))
    names = []
    for gain, S in candidates(given, loop):
        n = given.order
        A, B, C, D = S[:n, :n], S[:n, n:], S[n:, :n], S[n:, n:]
        names.append(gain.realisation)
        own = np.stack([C @ np.linalg.solve(each * np.eye(len(A)) - A, B) + D for each in z])[:, 0]
        assert abs(own.T - given.values(z)).max() <= 1e-11 * abs(own).max()
    assert {"second-order sections", "balanced state space"} < set(names)


def test_noise_gains_are_those_of_lyapunov_equations():
    """Of a stable loop without a free hub angle; the balanced realisation has the same variances on both sides."""
    given, loop = exact_loop(SERVO)
    for gain, S in candidates(given, loop):
        law = with_system_matrix(given, S)
        of = close_around_law(law, loop)
        K = solve_discrete_lyapunov(of.matrix, of.of_signals @ of.of_signals.T)
        W = solve_discrete_lyapunov(of.matrix.T, np.outer(of.output, of.output))
        k, w, variance = np.diag(K)[of.states], np.diag(W)[of.states], of.output @ K @ of.output
        assert gain.gain == pytest.approx(k @ w / variance, rel=1e-6)
        if gain.realisation == "balanced state space":
            assert k / variance == pytest.approx(w, rel=1e-6)
            K, W = gramians(of)
            assert abs(K - np.diag(np.diag(K))).max() <= 1e-9 * abs(K).max()


def test_the_bound_of_a_sum_holds_and_is_near():
    """Complex pairs near the circle, where single terms are small by chance; an integrator has none for all samples."""
    rng = np.random.default_rng(2)
    for radius in (0.5, 0.9, 0.99):
        q = rng.normal(size=(4, 4))
        M = radius * np.linalg.solve(q, np.diag([1, 0.3, -0.7, 0.99]) @ q)
        left, right = rng.normal(size=(2, 4)), rng.normal(size=(4, 3))
        bound, is_whole = absolute_sum(M, left, right)
        long = sum(abs(left @ np.linalg.matrix_power(M, k) @ right) for k in range(4000))
        assert is_whole
        assert (bound >= long * (1 - 1e-12)).all()
        assert bound == pytest.approx(long, rel=0.01)
    assert not absolute_sum(np.eye(1), np.eye(1), np.eye(1))[1]


@pytest.mark.parametrize("precision", ["double", "float", "q31"])
@pytest.mark.parametrize("law", [NOTCH, LAG])
def test_states_stay_within_their_bounds_and_reach_them_under_the_worst_inputs(law, precision):
    """Errors at the ends of their ranges with the signs of the response; `worst` has what the code returns."""
    controller, _ = realised(task_of((LAB, law, IDEAL), precision, ranges={"root_moment": 2.0}))
    word = controller.word
    assert word.bounds.is_whole
    A, B, _, _ = word.law.parts[0].block.matrices()
    response = np.array([np.linalg.matrix_power(A, k) @ B for k in reversed(range(300))])
    for row, bound in enumerate(word.bounds.states):
        x = np.zeros(len(A))
        for e in np.sign(response[:, row]) * word.sizes:
            x = A @ x + B @ e
        assert 0.95 * bound <= x[row] <= bound * (1 + 1e-9)


@pytest.mark.parametrize(("law", "bits"), [(SERVO, None), (NOTCH, None), (GAINS, None), (SERVO, 12)])
def test_a_limit_cycle_in_fixed_point_stays_within_its_bound(law, bits):
    """The closed loop with whole numbers in the controller, from a start off its rest, once it has decayed."""
    chain = replace(IDEAL, converters=Converters(torque_bits=bits, torque_range=2.0))
    controller, loop = realised(task_of((LAB, law, chain), "q31"))
    word = controller.word
    bound = word.limit_cycle(loop)
    A, B, C = loop.pulse.matrices()
    n, table = word.law.order, word.table
    a, b, c, d = (each.tolist() for each in (table[:n, :n], table[:n, n:], table[n:, :n], table[n:, n:]))
    shift, R, U = word.shifts.tolist(), word.ranges, word.output
    reads = [loop.in_z.signals.index(name) for name in word.law.signals]
    start = 1e-1 if bits else 1e-6
    plant, x, seen = np.random.default_rng(1).normal(size=len(A)) * start, [0] * len(a), []
    plant[loop.pulse.integrals_at] = 0.0
    for _ in range(6000):
        e = [-round(each) for each in (C[reads] @ plant) / R * 2.0**31]
        sums = [sum(map(int.__mul__, a[i], x)) + sum(map(int.__mul__, b[i], e)) for i in range(len(a))]
        u = (sum(map(int.__mul__, c[0], x)) + sum(map(int.__mul__, d[0], e)) + (1 << (shift[-1] - 1))) >> shift[-1]
        u = round(u / 2 ** (32 - bits)) * 2 ** (32 - bits) if bits else u
        x = [(each + (1 << (s - 1))) >> s for each, s in zip(sums, shift, strict=False)]
        plant = A @ plant + B * (u * U / 2.0**31)
        seen.append(u * U / 2.0**31)
    assert bound is not None
    assert max(map(abs, seen[-1000:])) <= bound
    assert max(map(abs, seen[:10])) > bound
    assert law is not SERVO or max(map(abs, seen[-1000:])) >= bound / 1000


def test_a_pole_that_no_output_shows_is_left_out():
    M, left = np.array([[1.0, 0.3], [0.0, 0.5]]), np.array([[0.0, 1.0]])
    kept = observable_part(M, left)
    assert max(abs(np.linalg.eigvals(kept))) == pytest.approx(0.5)
    for k in range(6):
        assert left @ np.linalg.matrix_power(kept, k + 1) == pytest.approx(left @ np.linalg.matrix_power(M, k + 1))
    assert (observable_part(M, np.eye(2)) == M).all()


def test_an_integral_can_overflow_and_a_servo_cannot():
    found = c_controller(task_of("integral", "q31")).details
    assert found.overflow.startswith("not excluded: a state may saturate")
    assert found.samples == 20_000
    assert 1e-9 < found.error < 1e-3  # until that state saturates
    found = c_controller(task_of((LAB, SERVO, IDEAL), "q31")).details
    assert found.overflow.startswith("excluded")
    assert found.samples is None
    assert max(found.largest_states) < 1


@pytest.mark.parametrize(
    ("task", "error"),
    [
        (task_of((LAB, GAINS, IDEAL), "q31", ranges={"root_moment": -1.0}), "range.root_moment = -1.0: the largest"),
        (task_of("gains", ranges={"tip": 1.0}), "range = 'tip': known are: hub_rate, root_moment, feedforward, output"),
        (task_of((LAB, GAINS, IDEAL), "q31", ranges={"output": 1.0, "feedforward": 2.0}),
         "range.feedforward = 2.0: in fixed point feedforward is a fraction of the range of the output: at most 1.0"),
        (task_of((LAB, GAINS, WITH_DAC), "q31", ranges={"output": 3.0}),
         "range.output = 3.0: q31 has steps of a DAC that are a power of 2 of its own: output=2.0, or"),
        (task_of((LAB, MULTIPLE, IDEAL), "q31", anyway=True),
         r"law = 'law': ill-conditioned or unstable in z: modulus of its poles up to 0.96"),
        (replace(task_of("gains", "q31"), ranges={"hub_rate": 1.0, "root_moment": 1.0}), "range = 'output': q31 needs"),
        (task_of((LAB, GAINS, REAL), "q31"), 'converters.hub_rate = \'difference\': with q31 the hub rate is an input'),
        (task_of((LAB, replace(PI, delay=0.015), IDEAL)), "law.delay = 0.015: is 1.5 samples: C code has a delay"),
        (task_of((LAB, tfarm.Law({"hub_rate": 0.3, "tip_deflection": 1e-50}), IDEAL), "float"),
         r"ABCD\[0\]\[1\] = 1e-50: this coefficient is beyond the numbers of float32"),
    ],
)  # fmt: skip
def test_what_cannot_be_exported_is_refused_in_one_line(task, error):
    with pytest.raises(ParameterError, match=error) as caught:
        c_controller(task)
    assert "\n" not in str(caught.value)


def test_a_law_whose_rounding_destabilises_the_loop_is_refused():
    """A gain next to the end of its interval, which rounding to float32 moves beyond it."""
    K2 = None
    for rate in np.linspace(0.3, 0.31, 40):
        end = tfarm.sampled(LAB, tfarm.HubFeedback(K1=float(rate), K2=0.3), IDEAL).interval("K2")[1]
        if float(np.float32(end * (1 - 1e-9))) > end * (1 + 2e-9):
            K2, K1 = end * (1 - 1e-9), float(rate)
            break
    assert K2 is not None
    law = tfarm.HubFeedback(K1=K1, K2=K2)
    assert tfarm.sampled(LAB, law, IDEAL).verdict.is_stable
    with pytest.raises(ParameterError, match=r"precision = 'float': rounded to float the loop is not certified"):
        c_controller(task_of((LAB, law, IDEAL), "float"))


def test_a_loop_that_is_not_certified_is_exported_anyway_and_the_header_warns():
    found = c_controller(task_of((LAB, UNSTABLE, IDEAL), anyway=True))
    assert b"warning: NOT CERTIFIED STABLE; exported by --anyway" in found.contents["controller.h"]
    assert found.verdict.startswith("unstable")


def test_a_realisation_has_coefficients_that_are_rounded_once():
    """States of condition 1e7, against rational numbers."""
    rng = np.random.default_rng(3)
    S = rng.normal(size=(4, 5))
    T = np.linalg.qr(rng.normal(size=(3, 3)))[0] @ np.diag([1.0, 1e-3, 1e-7]) @ rng.normal(size=(3, 3))
    found = similar(S, T)
    own, change = (sympy.Matrix(each.shape[0], each.shape[1], [*map(sympy.Rational, each.ravel())]) for each in (S, T))
    exact = sympy.diag(change.inv(), 1) * own * sympy.diag(change, sympy.eye(2))
    assert found.ravel().tolist() == pytest.approx([float(each) for each in exact], rel=2.0**-52, abs=0.0)


@pytest.mark.parametrize("precision", ["double", "float", "q31"])
def test_a_dac_adds_half_of_its_step_to_the_error(precision):
    without, of_dac = (
        c_controller(task_of((LAB, LAG, each), precision, ranges={"output": 2.0})).details for each in (IDEAL, WITH_DAC)
    )
    half = 2.0 / 4096
    assert half <= of_dac.error <= half + 3 * without.error
    assert of_dac.limit_cycle >= half > without.limit_cycle


@pytest.mark.parametrize("corner", [50.0, np.inf])
def test_the_range_of_an_estimated_rate_is_that_of_the_angle_or_of_its_differences(corner):
    """The largest output, attained by signs: gain times the rate of such an angle, and what is added."""
    T, K1, K2, R, M, F = 0.01, 0.3, 0.3, 0.2, 2.0, 0.5
    chain = replace(IDEAL, converters=Converters(encoder_counts=8192, hub_rate="difference", rate_filter=corner))
    law = tfarm.Law({"hub_rate": K1, "root_moment": K2})
    ranges = {"hub_angle": R, "root_moment": M, "feedforward": F}
    of_angle = c_controller(task_of((LAB, law, chain), ranges=ranges, anyway=True))
    # the estimate of an angle of the worst signs, by its recursion
    pole, h = np.exp(-corner * T), [(1 - np.exp(-corner * T)) / T]
    for _ in range(2000):
        h.append(h[-1] * pole)
    worst_rate = abs(np.diff([0.0, *h])).sum() * R
    assert of_angle.details.largest_output == pytest.approx(K1 * worst_rate + K2 * M + F, rel=1e-9)
    of_rate = c_controller(task_of((LAB, law, chain), ranges=ranges | {"hub_rate": 3.0}, anyway=True))
    assert of_rate.details.largest_output == pytest.approx(K1 * 3.0 + K2 * M + F, rel=1e-9)
    assert b"y_hub_angle: hub_angle [rad], at most 0.03 a sample, within +-0.2\n" in of_rate.contents["controller.h"]
    assert b"y_hub_angle: hub_angle [rad], within +-0.2\n" in of_angle.contents["controller.h"]


def test_a_law_whose_rounded_poles_are_unknown_has_no_bounds():
    found = c_controller(task_of((LAB, MULTIPLE, IDEAL), anyway=True)).details
    assert found.overflow == "not determined: the law is unstable or ill-conditioned in z"
    assert (found.error, found.largest_output) == (None, None)


def test_a_small_survey_of_what_the_code_returns():
    outcomes, figures, wrong = tally(worst.worst, 2, 2)
    assert wrong == 0
    assert sum(outcomes.values()) == 6
    assert max(max(values) for values in figures.values()) > 0.9
