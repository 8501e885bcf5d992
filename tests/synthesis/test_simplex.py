"""Simplexes that go down in step: each as SciPy's goes alone, to the last bit."""

import numpy as np
import pytest
from scipy.optimize import minimize

from tfarm.synthesis.simplex import downhill


def bent(x, y):
    """Rosenbrock's valley."""
    return 100 * (y - x * x) ** 2 + (1 - x) ** 2


def edged(x, y):
    """With an edge, and no value beyond a line."""
    return abs(x - 0.3) + 3 * abs(y - x) if x + y < 1.5 else float("nan")


@pytest.mark.parametrize("most", [2, 7, 40, 120, 400])
@pytest.mark.parametrize("function", [bent, edged])
def test_each_goes_as_scipys_does_alone(function, most):
    rng = np.random.default_rng(3)
    starts = [start + 0.1 * np.array([[0, 0], [1, 0], [0, 1]]) for start in rng.uniform(-1, 0.7, (4, 2))]
    found = downhill(lambda points: np.array([function(*point) for point in points]), starts, 1e-4, most)
    for triangle, start in zip(found, starts, strict=True):
        options = {"initial_simplex": start, "xatol": 1e-4, "fatol": 0.0, "maxfev": most}
        theirs = minimize(lambda x: function(*x), start[0], method="Nelder-Mead", options=options)
        assert triangle.corners[0].tolist() == theirs.x.tolist()
        assert triangle.values.tolist() == theirs.final_simplex[1].tolist()


def test_all_are_asked_at_once():
    asked = []

    def values(points):
        asked.append(len(points))
        return (points**2).sum(axis=1)

    downhill(values, [np.array([[1.0, 1.0], [1.1, 1.0], [1.0, 1.1]])] * 3, 1e-4, 30)
    assert asked == [3] * 30
