"""The benchmark times work: each timed call is on an arm of which nothing is kept, and each way to keep it is known."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests import bench, caches
from tests.shared import thinned
from tfarm.arm import Payload

LOADED = bench.Subject(replace(bench.LAB.arm, payload=Payload(mass=0.05, inertia=1e-5)))
FEW = {f"study, an arm of {ask}": (bench.study(ask, 2, bench.chunk_of), 2) for ask in bench.STUDIED}
CALLS = bench.CALLS | FEW


def asked_by(call, times=2):
    """Hits and misses of the caches of arms by name, of calls as they are timed; the first finds them empty."""
    known, asked = caches.of_arms(), []

    def watched(subject):
        before, prepared = caches.counts(known), call(subject)

        def run():
            prepared()
            after = caches.counts(known)
            asked.append({name: tuple(np.subtract(after[name], before[name])) for name in known})

        return run

    caches.empty(known.values())
    for _ in range(times):
        bench.seconds(watched, LOADED)
    return asked


def is_done_anew(asked):
    """Whether each call finds and misses as much as the first, which misses something."""
    return any(misses for _, misses in asked[0].values()) and all(each == asked[0] for each in asked)


@pytest.mark.parametrize("what", thinned(CALLS, 2))
def test_nothing_is_kept_of_the_subject_of_a_timed_call(what):
    assert is_done_anew(asked_by(CALLS[what][0]))


def test_a_timed_call_that_finds_something_is_noticed():
    """An arm that was seen before, a dictionary, and a cached property of a record outside the call."""
    arm, memory, table = LOADED.arm, {}, tfarm.modes(LOADED.arm, 3)

    def remembered(subject):
        return lambda: memory.get("modes") or memory.setdefault("modes", tfarm.modes(subject.arm, 3))

    for call in (lambda subject: lambda: tfarm.modes(arm, 20), remembered, lambda subject: lambda: table.nodes):
        assert not is_done_anew(asked_by(call))


def test_only_bounded_caches_keep_anything_of_an_arm():
    """From one arm to the next nothing else grows, and an arm keeps nothing itself."""

    def calls():
        bench.seconds(CALLS["result card"][0], LOADED)

    calls()
    known = set(caches.caches()) - set(caches.of_arms().values())
    before, misses = caches.held(), [each.cache_info().misses for each in known]
    calls()
    assert caches.grown(before) == set()
    assert [each.cache_info().misses for each in known] == misses
    assert not hasattr(LOADED.arm, "__dict__")
