"""The best constant gain, of costs that are functions of the gain with a minimum in closed form."""

from types import SimpleNamespace

import pytest

from tfarm.tuner import baselines, best_constant


def best_of(monkeypatch, cost, windows):
    """The best constant gain of a trial with that cost, and every gain that was tried."""
    tried = []

    def with_constant(K):
        tried.append(K)
        return SimpleNamespace(cost=cost(K))

    monkeypatch.setattr(baselines, "constant_windows", lambda loop: windows)
    return best_constant(SimpleNamespace(loop=None, n=300, with_constant=with_constant)), tried


def test_the_lowest_of_two_valleys_is_found_though_it_is_the_narrower(monkeypatch):
    found, _ = best_of(monkeypatch, lambda K: min((K - 0.3) ** 2, 50 * (K - 0.8) ** 2 - 0.1), [(0.0, 1.0)])
    assert found == (pytest.approx(0.8, abs=1e-7), pytest.approx(-0.1, rel=1e-12))


def test_no_gain_is_tried_where_the_loop_is_not_stable_and_the_last_window_is_as_good_as_the_first(monkeypatch):
    found, tried = best_of(monkeypatch, lambda K: (K - 1.2) ** 2, [(0.0, 0.5), (1.0, 1.5)])
    assert found.gain == pytest.approx(1.2, abs=1e-7)
    assert all(0 <= K < 0.5 or 1.0 < K < 1.5 for K in tried)
    found, tried = best_of(monkeypatch, lambda K: K, [(0.2, 1.0)])  # no moment feedback is not stable
    assert 0.2 < min(tried) <= found.gain == pytest.approx(0.2, abs=1e-5)


@pytest.mark.parametrize("windows", [[(0.0, 1.0)], []])
def test_nothing_fed_back_is_a_gain_too_and_all_there_is_where_none_is_stable(monkeypatch, windows):
    found, tried = best_of(monkeypatch, lambda K: 2.0 + K, windows)
    assert found == (0.0, 2.0)
    assert len(tried) > 1 or not windows
