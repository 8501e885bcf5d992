"""The caches of tfarm, emptied before a call is timed, and the proof that none answered it.

Whatever tfarm keeps outlives its call in `functools` caches of functions (by value: an equal arm finds the same entry)
and in cached properties of systems and records, which only those caches and the caller hold on to.  An Arm itself keeps
nothing.  So with the caches emptied, and records made inside the call, a call begins as the first one of a process did.
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
from collections import Counter
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import tfarm

Cached = Any  # a function with cache_info() and cache_clear()


class AnsweredByCacheError(Exception):
    """A timed call found what an earlier one had left."""


@functools.cache
def caches() -> dict[str, Cached]:
    """Every functools cache of a function or method of the package, by its name; all modules are imported for it."""
    names = [each.name for each in pkgutil.walk_packages(tfarm.__path__, "tfarm.") if "__main__" not in each.name]
    found = (each for name in names for each in _of_module(importlib.import_module(name)))
    return {f"{each.__module__}.{each.__qualname__}": each for each in found}


def _of_module(module: ModuleType) -> Iterator[Cached]:
    owners = [module, *(each for each in vars(module).values() if isinstance(each, type))]
    for owner in owners:
        for value in vars(owner).values():
            function = getattr(value, "__func__", value)  # of a class method
            if hasattr(function, "cache_info") and function.__module__ == module.__name__:
                yield function


def empty() -> None:
    """Empty them all."""
    for each in caches().values():
        each.cache_clear()


def worked_out() -> Counter[str]:
    """How many values each cache had not and was given, since it was emptied last."""
    return Counter({name: each.cache_info().misses for name, each in caches().items()})


class ColdCalls:
    """Calls of one candidate, each with empty caches: all have to work out what the first one did."""

    def __init__(self) -> None:
        self._first: Counter[str] | None = None
        self._before: Counter[str] = Counter()

    def before(self) -> None:
        """Empty the caches, outside of the time that is measured."""
        empty()
        self._before = worked_out()

    def after(self) -> None:
        """Raise AnsweredByCacheError where the call worked less out than the first one."""
        done = worked_out()
        done.subtract(self._before)
        self._first = self._first or done
        if less := [name for name, count in done.items() if count < self._first[name]]:
            raise AnsweredByCacheError(f"a timed call did not work out what an earlier one had: {', '.join(less)}")
