"""What holds for every test."""

import os

# One thread of BLAS for each worker, set before NumPy is loaded: on matrices of a hundred rows a second one only spins.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pickle
from collections.abc import Iterator

import flint
import mpmath
import pytest
from hypothesis import settings

from tests.shared import once

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


@pytest.fixture(scope="session")
def audit_file(tmp_path_factory):
    """The pickled rows of the audit of the paper: some ten seconds of SymPy, once a session."""
    return once(tmp_path_factory, "audit", save_audit)


def save_audit(file):
    from tfarm import audit  # not for tests that have no need of SymPy

    file.write_bytes(pickle.dumps(audit.audit()))


@pytest.fixture(scope="session")
def audit_rows(audit_file):
    return pickle.loads(audit_file.read_bytes())


@pytest.fixture
def audited(audit_rows, monkeypatch):
    """Whoever asks for the audit gets the rows that this session has."""
    for room in ("tfarm.audit", "tfarm.audit.paper"):
        monkeypatch.setattr(f"{room}.audit", lambda: audit_rows)
    return audit_rows
