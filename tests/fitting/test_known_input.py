"""Closed loops of which only the input and the output are known, by finite elements: where output errors are biased.

python -m tests.fitting.test_known_input COUNT    # errors of numbers over their deviations, of both noise models
"""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

import tfarm
from tests.chain_elements import reached
from tests.dsp.independent import held
from tests.fitting.elements_in_time import Plant
from tfarm.arm.chain import Chain, Sampling
from tfarm.fitting.fit import fit
from tfarm.fitting.intervals import confidence_intervals
from tfarm.fitting.model import Problem, free_parameters
from tfarm.fitting.run_model import fit_run
from tfarm.fitting.run_numbers import with_disturbance
from tfarm.fitting.runs import RigRun
from tfarm.fitting.solve import nearest_minimum, rescale_noise

LAB = tfarm.load("sasaki2012-lab")
PERIOD = 0.02
CHAIN = Chain(sampling=Sampling(period=PERIOD))
TRUTH = {"link.youngs_modulus": LAB.link.youngs_modulus, "hub.inertia": LAB.hub.inertia}
START = {"link.youngs_modulus": 1.15 * TRUTH["link.youngs_modulus"], "hub.inertia": 0.85 * TRUTH["hub.inertia"]}
SENSOR = 5e-4
# deviation of a white torque [N m], held over a sample
TORQUE = 0.02


def closed_loop(seed, torque, count=800):
    """A record under a law that the fit does not know: noise of the sensor, and of a torque, go round the loop."""
    rng = np.random.default_rng([571, seed])
    plant = Plant(LAB, ("hub_angle",), reached(LAB, 3))
    A, B = held(plant.A, plant.B, PERIOD)
    C = plant.C[0]
    wanted = 0.3 * rng.choice([-1.0, 1.0], count // 40 + 1).repeat(40)[:count]
    w = torque * rng.standard_normal(count)
    v = SENSOR * rng.standard_normal(count)
    x = np.zeros(len(A))
    before = 0.0
    u, y = np.zeros((2, count))
    for k in range(count):
        y[k] = C @ x + v[k]
        u[k] = 2.0 * (wanted[k] - y[k]) - 0.8 * (y[k] - before) / PERIOD
        before = y[k]
        x = A @ x + B * (u[k] + w[k])
    return RigRun(period=PERIOD, outputs={"hub_angle": y}, input=u, is_disturbed=True)


def scores(seed, torque, *, is_predicted):
    """Errors of the numbers over their deviations, by output or prediction errors, searched from the truth."""
    family, numbers = free_parameters(LAB, [*TRUTH], start={}, bounds={}, priors={})
    problem = Problem(family, numbers, (), (), (fit_run(LAB, closed_loop(seed, torque), CHAIN),))
    if is_predicted:
        problem = replace(problem, runs=(replace(problem.runs[0], sigma=(SENSOR,)),))
        problem = with_disturbance(problem)
    found = rescale_noise(nearest_minimum(problem, np.zeros(len(problem.parameters))))
    fitted, _ = confidence_intervals(found, profile=False)
    pairs = zip(TRUTH.values(), fitted, strict=False)
    return np.array([(each.value - value) / each.deviation for value, each in pairs])


def share_inside(found):
    """The share of scores within the 95 % interval of a normal distribution."""
    return float((abs(found) < 1.96).mean())


def test_output_errors_of_white_sensor_noise_are_within_their_intervals():
    # u knows the noise of the past alone
    found = np.array([scores(seed, 0.0, is_predicted=False) for seed in range(4)])
    assert abs(found).max() < 4
    assert abs(found.mean(axis=0)).max() < 1.5


def test_prediction_errors_of_a_torque_are_within_their_intervals_where_output_errors_are_not():
    by_output = np.array([scores(seed, TORQUE, is_predicted=False) for seed in range(4)])
    by_prediction = np.array([scores(seed, TORQUE, is_predicted=True) for seed in range(4)])
    assert share_inside(by_output) < 0.5
    assert abs(by_prediction).max() < 4
    assert abs(by_prediction.mean(axis=0)).max() < 1.5


def test_the_fit_finds_the_torque():
    found = fit(LAB, [], [*TRUTH], runs=[closed_loop(2, TORQUE)], chain=CHAIN, start=START, profile=False)
    numbers = {each.key: each for each in found.parameters}
    assert found.verdict == "fitted"
    ratio = numbers["disturbance:hub_angle"]
    assert ratio.value == pytest.approx(TORQUE / SENSOR, rel=0.5)
    for key, value in TRUTH.items():
        assert abs(numbers[key].value - value) < 4 * numbers[key].deviation
    # of a record without a torque none is found
    found = fit(LAB, [], [*TRUTH], runs=[closed_loop(2, 0.0)], chain=CHAIN, start=START, profile=False)
    assert [each.key for each in found.parameters] == [*TRUTH]


def test_prediction_errors_are_those_of_a_kalman_filter():
    """The filter's recursion on outputs and input, its gain by iteration of Riccati's difference equation."""
    run = closed_loop(1, TORQUE, count=60)
    rest = replace(fit_run(LAB, run, CHAIN), is_moving=False, disturbance=(0,), sigma=(1.0,))
    ratio = 40.0
    own = np.zeros(2)
    found = rest.residuals_with(LAB, lambda place: ratio, own)
    pulse = rest.pulse(LAB, lambda place: ratio)
    A, B, C = pulse.matrices()
    (c,) = C
    P = np.zeros_like(A)
    for _ in range(20_000):
        S = c @ P @ c + 1 / ratio**2
        K = A @ P @ c / S
        P = A @ P @ A.T - S * np.outer(K, K) + torque_step(pulse, A)
    x = np.zeros(len(A))
    errors = []
    for u, y in zip(run.input, run.outputs["hub_angle"], strict=True):
        e = y - c @ x
        errors.append(-e)
        x = A @ x + B * u + K * e
    np.testing.assert_allclose(found, errors, atol=1e-7 * abs(np.array(errors)).max())


def torque_step(pulse, A):
    """The covariance of a step of the states by a torque of deviation 1: here the input acts at once, too."""
    states = pulse.integrals_at + 2
    _, B, _ = pulse.matrices()
    by_torque = np.r_[B[:states], np.zeros(len(A) - states)]
    return np.outer(by_torque, by_torque)


@pytest.mark.survey
def test_survey():
    assert survey(40)


def survey(count):
    """Print coverage of both noise models of both noises, and return whether the right ones cover 95 %."""
    good = True
    for torque, is_predicted in ((0.0, False), (TORQUE, False), (TORQUE, True)):
        found = np.array([scores(seed, torque, is_predicted=is_predicted) for seed in range(count)])
        inside = int((abs(found) < 1.96).sum())
        chance = binomtest(inside, found.size, 0.95).pvalue
        words = "prediction errors" if is_predicted else "output errors"
        print(f"torque {torque:g} N m, {words}: inside 95 % {inside} of {found.size} (binomial {chance:.3g}),", end=" ")
        print(f"mean {found.mean(axis=0).round(2)}, deviation {found.std(axis=0).round(2)}", flush=True)
        good &= chance > 1e-3 or (torque > 0 and not is_predicted)
    return good


if __name__ == "__main__":
    survey(int(sys.argv[1]))
