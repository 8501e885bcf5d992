"""The benchmark times work, not a cache: every cache of the package is known and emptied."""

import ast
from pathlib import Path

import tfarm
from tests import bench, caches

ARM = tfarm.load("sasaki2012")


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


def test_every_cache_of_the_package_is_emptied_and_an_arm_keeps_nothing_itself():
    assert set(caches.caches()) == declared()
    tfarm.modes(ARM, 20)
    assert any(each.cache_info().currsize for each in caches.caches().values())
    caches.empty()
    assert not any(each.cache_info().currsize for each in caches.caches().values())
    assert not hasattr(ARM, "__dict__")


def test_each_timed_call_works_out_all_that_the_first_does():
    """Counted where the work is: the undamped frequencies are searched for anew at every call, but a warm one."""
    searched = next(one for name, one in caches.caches().items() if name.startswith("tfarm.spectrum.frequencies."))
    seen = []

    def call():
        before = searched.cache_info().misses
        tfarm.modes(ARM, 20)
        seen.append(searched.cache_info().misses - before)

    bench.timed({"tfarm": call}, 3)
    assert len(seen) >= 5
    assert set(seen) == {1}
    bench.timed({"tfarm": call}, 1, warm=True)
    assert seen[-1] == 0
