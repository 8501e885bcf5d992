"""The benchmark times work, not a cache: every cache of the package is known and emptied."""

import tfarm
from tests import bench, caches

ARM = tfarm.load("sasaki2012")


def test_each_timed_call_works_out_all_that_the_first_does():
    """Counted where the work is: the undamped frequencies are searched for anew at every call, but a warm one."""
    searched = next(one for name, one in caches.caches().items() if name.startswith("tfarm.spectrum.frequencies."))
    seen = []

    def call():
        before = searched.cache_info().misses
        tfarm.modes(ARM, 20)
        seen.append(searched.cache_info().misses - before)

    bench.timed([call], 3)
    assert len(seen) >= 5
    assert set(seen) == {1}
    bench.timed([call], 1, warm=True)
    assert seen[-1] == 0


def test_every_cache_is_emptied_and_an_arm_keeps_nothing_itself():
    tfarm.modes(ARM, 20)
    assert any(each.cache_info().currsize for each in caches.caches().values())
    caches.empty()
    assert not any(each.cache_info().currsize for each in caches.caches().values())
    assert not hasattr(ARM, "__dict__")
