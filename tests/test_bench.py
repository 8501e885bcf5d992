"""The benchmark times work: each timed call is on an arm of which nothing is kept, and each way to keep it is known."""

import cProfile
import functools
import sys
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests import bench, caches
from tests.shared import thinned
from tfarm.arm import Payload
from tfarm.assessment import card
from tfarm.loop.margins import margins
from tfarm.report import page
from tfarm.response.signals import Signals
from tfarm.synthesis.judge import judge_of

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


def test_windows_and_every_other_lazy_entry_are_in_their_row():
    profile = cProfile.Profile()
    profile.runcall(bench.CALLS["verdict, windows, margins"][0](bench.unseen(LOADED)))
    assert "windows_of" in {getattr(each.code, "co_name", "") for each in profile.getstats()}


def test_random_arms_are_new_in_each_row():
    subjects = []

    def call(subject):
        subjects.append(subject)
        return lambda: None

    rows = [bench.drawn(call, 1) for _ in range(2)]
    assert len(set(subjects)) == len(subjects) == 2 * 2 * bench.DRAWN
    assert all(0 <= row["median"] <= row["worst"] for row in rows)


def test_caches_are_found_however_they_are_made():
    known = caches.caches()
    assert {judge_of, card.margins_of, card.sampled_of, page.brief_on} <= set(known)
    planted = [  # by a call, of a part of the arguments, and inside a function
        functools.lru_cache(maxsize=4)(margins),
        functools.lru_cache(maxsize=4)(functools.partial(margins, law=bench.LAB.law)),
        functools.cache(lambda: None),
    ]
    planted[2].__wrapped__.__module__ = "tfarm.loop.margins"
    assert [each for each in caches.caches() if each not in known] == planted
    assert [each for each in caches.of_arms().values() if each in planted] == planted[:2]
    planted[2]()
    caches.empty(planted)
    assert planted[2].cache_info().currsize == 0


def test_results_that_a_module_keeps_otherwise_are_found(monkeypatch):
    """In a dictionary of the module or of a class, as an attribute of a function, and as a property of a record."""
    module, record = sys.modules[margins.__module__], Signals(LOADED.arm, ("hub_angle",))
    for owner, name, value in ((module, "_memory", {}), (module.Margins, "memory", {}), (module, "_signals", record)):
        monkeypatch.setattr(owner, name, value, raising=False)
    before = caches.held()
    module._memory["arm"] = module.Margins.memory["arm"] = record.system
    monkeypatch.setattr(margins, "memory", {}, raising=False)
    kept = {f"tfarm.loop.margins.{name}" for name in ("_memory", "Margins.memory", "_signals", "margins")}
    assert kept <= caches.grown(before)


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


def test_the_peer_of_the_response_solves_the_same_equations():
    arm, s = LOADED.arm, bench.axis(20)
    assert np.allclose(bench.solved(arm, s), tfarm.transfer(arm, list(bench.OUTPUTS))(s), rtol=1e-9, atol=0)


def test_the_time_of_a_command_is_that_of_its_process():
    """A loop of as much processor time as is asked for, in a process that is told so by its environment."""
    loop = "import os, time\nwhile time.process_time() < float(os.environ['LONG']): pass"
    short, long = (bench.of_process("-c", loop, LONG=each) for each in ("0.2", "0.7"))
    assert 0.2 < short < 0.7 < long
