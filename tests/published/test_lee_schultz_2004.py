"""J. Lee, W. W. Schultz (2004): clamped Timoshenko beams of several thicknesses, by Chebyshev collocation.

Their method, written anew here, gives the digits too: so it is their problem that is being solved.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigvals

from tfarm.audit.literature import SOURCES
from tfarm.audit.published import agrees, case_rows, computed

(SOURCE,) = (source for source in SOURCES if source.key == "lee-schultz-2004")


def chebyshev(n: int) -> np.ndarray:
    """The differentiation matrix on n + 1 Chebyshev points of 0..1 (Trefethen 2000, chapter 6)."""
    x = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.r_[2.0, np.ones(n - 1), 2.0] * (-1.0) ** np.arange(n + 1)
    D = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(n + 1))
    return 2 * (D - np.diag(D.sum(axis=1)))


def collocated(arm, n: int = 30, count: int = 3) -> np.ndarray:
    """L (w^2 rhoA/EI)^(1/4) of a clamped-clamped beam of L = rhoA = EI = 1."""
    link, D = arm.link, chebyshev(n)
    inner = np.s_[1:-1, 1:-1]
    D1, D2, one = D[inner], (D @ D)[inner], np.eye(n - 1)
    K = -np.block([[link.kGA * D2, -link.kGA * D1], [link.kGA * D1, link.EI * D2 - link.kGA * one]])
    M = np.diag(np.r_[np.full(n - 1, link.rhoA), np.full(n - 1, link.rhoI)])
    return np.sort(eigvals(K, M).real)[:count] ** 0.25


@pytest.mark.parametrize("case", SOURCE.cases, ids=lambda case: case.name)
def test_every_printed_digit_is_right(case) -> None:
    assert all(row.agrees for row in case_rows(SOURCE.key, case))


@pytest.mark.parametrize(
    "case", [case for case in SOURCE.cases if case.arm.link.slenderness < 400], ids=lambda c: c.name
)
def test_their_method_gives_the_same(case) -> None:
    found = collocated(case.arm)
    assert found == pytest.approx(computed(case), rel=1e-8)
    assert all(agrees(value, printed) for value, printed in zip(found.tolist(), case.printed, strict=True))


def test_another_shear_factor_would_not_do() -> None:
    """Each of the six digits weighs: Cowper's factor misses them from h/L = 0.005 on."""
    for case in SOURCE.cases[1:]:
        section = replace(case.arm.link.section, shear_factor=10 * 1.3 / (12 + 11 * 0.3))
        link = replace(case.arm.link, section=section)
        other = replace(case, arm=replace(case.arm, link=link))
        assert not all(row.agrees for row in case_rows(SOURCE.key, other))
