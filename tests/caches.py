"""The caches of tfarm, counted while a call is timed, or emptied before its work is counted.

What outlives a call is in `functools` caches, wherever they are made and kept, and in the cached properties of records
that only those caches and the caller hold on to.  An unbounded cache has what tfarm itself says (its tables, templates
and classes); what is kept of arms is in bounded ones.  `held` are the other places where a module could keep a result.
"""

import functools
import gc
import importlib
import pkgutil
from collections.abc import MutableMapping, MutableSequence, MutableSet
from types import ModuleType

import tfarm

CONTAINERS = (MutableMapping, MutableSequence, MutableSet)


@functools.cache
def modules():
    """Every module of the package, imported, by its name."""
    names = [each.name for each in pkgutil.walk_packages(tfarm.__path__, "tfarm.") if "__main__" not in each.name]
    return {name: importlib.import_module(name) for name in names}


def caches():
    """Every functools cache that is alive of a function or method of the package, by decorator or by call."""
    modules()
    kind, is_frozen = type(functools.cache(len)), gc.get_freeze_count() > 0
    gc.unfreeze()  # the tests freeze what they begin with, and a frozen object is not listed
    found = [each for each in gc.get_objects() if type(each) is kind and name_of(each).startswith("tfarm.")]
    if is_frozen:
        gc.freeze()
    return [each for each in found if "whole_command" not in name_of(each)]  # the tree of commands holds no result


def of_arms():
    """Those of them that can have results of an arm, by name and number."""
    bounded = [each for each in caches() if each.cache_parameters()["maxsize"] is not None]
    return {f"{name_of(each)} {number}": each for number, each in enumerate(bounded)}


def name_of(cache):
    """The module and the name of the function in a cache."""
    function = cache.__wrapped__
    while hasattr(function, "func"):  # of a partial one
        function = function.func
    return f"{function.__module__}.{getattr(function, '__qualname__', '')}"


def counts(known):
    """Hits and misses of each of some caches by name."""
    return {name: each.cache_info()[:2] for name, each in known.items()}


def empty(some=None):
    """Empty some caches, or all."""
    for each in caches() if some is None else some:
        each.cache_clear()


def held():
    """Entries by name of each container of a module or class, and of the attributes of each function and record there.

    What functions have as defaults is not counted: `make lint` allows no container there.
    """
    sizes = {}
    for module, content in modules().items():
        classes = [each for each in vars(content).values() if isinstance(each, type) and each.__module__ == module]
        for owner in (content, *classes):
            where = module if owner is content else f"{module}.{owner.__name__}"
            for name, value in list(vars(owner).items()):
                inside = value if isinstance(value, CONTAINERS) else getattr(value, "__dict__", ())
                if not (name.startswith("__") or isinstance(value, type | ModuleType)):
                    sizes[f"{where}.{name}"] = len(inside)
    return sizes


def grown(before):
    """Names of what has more entries than before."""
    return {name for name, size in held().items() if size > before.get(name, 0)}
