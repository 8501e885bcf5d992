"""What holds for every test."""

import os

# One thread of BLAS for each worker, set before NumPy is loaded: on matrices of a hundred rows a second one only spins.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Iterator

import flint
import mpmath
import pytest
from hypothesis import settings

settings.register_profile("reproducible", deadline=None, derandomize=True, database=None)
settings.register_profile("search", deadline=None, max_examples=1000)
settings.load_profile("reproducible")


@pytest.fixture(autouse=True)
def precision_stays_local() -> Iterator[None]:
    """No test, and so no function of tfarm, leaves a changed working precision behind."""
    before = mpmath.mp.prec, flint.ctx.prec
    yield
    after = mpmath.mp.prec, flint.ctx.prec
    mpmath.mp.prec, flint.ctx.prec = before
    assert after == before, f"(mpmath, flint) bits were {before}, and now are {after}"
