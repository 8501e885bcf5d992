"""The benchmark times work, not a cache: every cache of the package is known, emptied, and cannot answer unnoticed."""

import ast
import importlib
import os
from functools import cache
from pathlib import Path

import pytest

import tfarm

ARM = tfarm.load("sasaki2012")


@pytest.fixture(scope="module")
def bench():
    """The modules of the benchmark; that its package asks for one thread is taken back."""
    before = dict(os.environ)
    names = ("caches", "timing", "spectra")
    found = {name: importlib.import_module(f"tests.bench.{name}") for name in names}
    for name in set(os.environ) - set(before):
        del os.environ[name]
    os.environ.update(before)
    return type("Bench", (), found)


def declared():
    """The functions and methods of the package under @cache or @lru_cache, read from its sources."""
    root, found = Path(tfarm.__file__).parent, set()
    for source in root.rglob("*.py"):
        module = ".".join(("tfarm", *source.relative_to(root).with_suffix("").parts)).removesuffix(".__init__")
        tree = ast.parse(source.read_text(encoding="utf-8"))
        scopes = [("", tree), *((f"{one.name}.", one) for one in tree.body if isinstance(one, ast.ClassDef))]
        for prefix, scope in scopes:
            for one in scope.body:
                marks = [ast.unparse(each).split("(")[0] for each in getattr(one, "decorator_list", ())]
                if {each.split(".")[-1] for each in marks} & {"cache", "lru_cache"}:
                    found.add(f"{module}.{prefix}{one.name}")
    return found


def test_every_cache_of_the_package_is_emptied(bench):
    assert set(bench.caches.caches()) == declared()
    tfarm.modes(ARM, 20)
    assert any(each.cache_info().currsize for each in bench.caches.caches().values())
    bench.caches.empty()
    assert not any(each.cache_info().currsize for each in bench.caches.caches().values())


def test_an_arm_keeps_nothing_itself():
    assert not hasattr(ARM, "__dict__")


def test_each_timed_call_works_out_all_that_the_first_does(bench):
    """Counted where the work is: the undamped frequencies are searched for anew at every call."""
    caches = bench.caches.caches()
    searched = next(one for name, one in caches.items() if name.startswith("tfarm.spectrum.frequencies."))
    seen = []

    def call():
        before = searched.cache_info()
        tfarm.modes(ARM, 20)
        seen.append((before.misses, before.hits, searched.cache_info().misses))

    bench.timing.interleaved({"tfarm": call}, 3)
    assert len(seen) >= 5
    assert {(misses, hits) for misses, hits, _ in seen} == {(0, 0)}
    assert {misses for *_, misses in seen} == {1}


def test_a_call_that_a_cache_answers_is_refused(bench, monkeypatch):
    kept = cache(lambda: tfarm.modes(ARM, 20))
    with pytest.raises(bench.caches.AnsweredByCacheError, match=r"tfarm\.spectrum\.frequencies"):
        bench.timing.interleaved({"one that remembers": kept}, 2)
    bench.timing.interleaved({"one that remembers": kept}, 2, warm=True)
    bench.caches.empty()
    monkeypatch.setattr(bench.caches, "empty", lambda: None)
    with pytest.raises(bench.caches.AnsweredByCacheError):
        bench.timing.interleaved({"tfarm": lambda: tfarm.modes(ARM, 21)}, 2)


def test_the_row_of_natural_frequencies_times_a_search(bench, monkeypatch):
    """Its call, with the caches empty, takes many times what the warm one does that was printed once."""
    timed = []

    def spy(candidates, rounds, *, warm=False):
        assert not warm
        cold = bench.timing.interleaved(candidates, 5)
        timed.append((cold, bench.timing.interleaved(candidates, 5, warm=True)))
        return cold

    monkeypatch.setattr(bench.spectra, "interleaved", spy)
    row = next(bench.spectra.modes_rows())
    ((cold, warm),) = timed
    assert cold.median("tfarm") > 5 * warm.median("tfarm")
    assert row.seconds == cold.median("tfarm") / 100
    assert not row.warm
