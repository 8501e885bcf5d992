"""The caches of tfarm, emptied before a call is timed or its work is counted.

Whatever tfarm keeps outlives its call in `functools` caches of functions, and in cached properties of systems and
records, which only those caches and the caller hold on to.  So with the caches emptied, and records made inside the
call, a call begins as the first one of a process did.  The tree of commands, which holds no result, is kept.
"""

import functools
import importlib
import pkgutil

import tfarm


@functools.cache
def caches():
    """Every functools cache of a function or method of the package, by its name; all modules are imported for it."""
    names = [each.name for each in pkgutil.walk_packages(tfarm.__path__, "tfarm.") if "__main__" not in each.name]
    found = (each for name in names for each in _of_module(importlib.import_module(name)))
    return {f"{each.__module__}.{each.__qualname__}": each for each in found}


def _of_module(module):
    owners = [module, *(each for each in vars(module).values() if isinstance(each, type))]
    for owner in owners:
        for value in vars(owner).values():
            function = getattr(value, "__func__", value)  # of a class method
            is_own = hasattr(function, "cache_info") and function.__module__ == module.__name__
            if is_own and function.__name__ != "whole_command":
                yield function


def empty():
    """Empty them all."""
    for each in caches().values():
        each.cache_clear()
