"""What holds for every test."""

import gc
import os

# One thread of BLAS for each worker, set before NumPy is loaded: on matrices of a hundred rows a second one only spins.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pickle
import sys
from collections.abc import Iterator

import flint
import mpmath
import pytest
from hypothesis import HealthCheck, settings

import tfarm
from tests.shared import once

SLOW = [HealthCheck.too_slow]
# Few examples, the same ones each time; `python -m tests.properties SIZE SEED` has others.  How long drawing them takes
# depends on how busy the machine is, not on tfarm.
settings.register_profile(
    "reproducible", deadline=None, derandomize=True, database=None, max_examples=25, suppress_health_check=SLOW
)
EXAMPLES = int(os.environ.get("EXAMPLES", "1000"))
settings.register_profile("search", deadline=None, database=None, max_examples=EXAMPLES, suppress_health_check=SLOW)
settings.load_profile("reproducible")


def pytest_collection_finish() -> None:
    """Modules and tests are there to the end: the collector need not go through them again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def precision_stays_local() -> Iterator[None]:
    """No test, and so no function of tfarm, leaves a changed working precision behind."""
    before = mpmath.mp.prec, flint.ctx.prec
    yield
    after = mpmath.mp.prec, flint.ctx.prec
    mpmath.mp.prec, flint.ctx.prec = before
    assert after == before, f"(mpmath, flint) bits were {before}, and now are {after}"


@pytest.fixture(scope="session")
def lab():
    """The paper's arm with a little damping."""
    return tfarm.load("sasaki2012-lab")


@pytest.fixture(scope="session")
def lossless():
    """The paper's arm."""
    return tfarm.load("sasaki2012")


@pytest.fixture(scope="session")
def audit_file(tmp_path_factory):
    """The pickled rows of the audit of the paper: some ten seconds of SymPy, once a session.

    What `tfarm proof audit --json` prints of them is audit.json in the same folder.
    """
    return once(tmp_path_factory, "audit", save_audit)


def save_audit(file):
    from tfarm.audit import paper
    from tfarm.cli.running import run

    rows = paper.audit()
    file.write_bytes(pickle.dumps(rows))
    with pytest.MonkeyPatch.context() as patch, open(file.with_suffix(".json"), "w", encoding="utf-8") as printed:
        patch.setattr(paper, "audit", lambda: rows)
        patch.setattr(sys, "stdout", printed)
        assert run(["proof", "audit", "--json"]) == 0


@pytest.fixture(scope="session")
def audit_rows(audit_file):
    return pickle.loads(audit_file.read_bytes())


@pytest.fixture
def audited(audit_rows, monkeypatch):
    """The audit's rows are those that this session has."""
    for room in ("tfarm.audit", "tfarm.audit.paper"):
        monkeypatch.setattr(f"{room}.audit", lambda: audit_rows)
    return audit_rows
