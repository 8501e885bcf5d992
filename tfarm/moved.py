"""Names of former versions: a module that has them no more finds each where it is now, with a DeprecationWarning."""

import sys
import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any


class FormerName:
    """A method or property of a record under a former name, which warns of its new one."""

    def __init__(self, new: str) -> None:
        self.new = new

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, record: object, owner: type) -> Any:
        if record is None:
            return self
        warnings.warn(f"{owner.__name__}.{self.name} is {self.new} now", DeprecationWarning, stacklevel=2)
        return getattr(record, self.new)


def moved(module: str, places: Mapping[str, str]) -> Callable[[str], object]:
    """Return the `__getattr__` of a module, by the module of each former name, or "module:name" of a new one."""

    def find(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        place, _, new = places[name].partition(":")
        news = f"is {new} now: import that" if new else "has moved: import it"
        warnings.warn(f"{module}.{name} {news} from {place}", DeprecationWarning, stacklevel=2)
        return getattr(import_module(place), new or name)

    return find


def moved_module(name: str, places: Mapping[str, str]) -> ModuleType:
    """Return a former module, which `import` finds too, by the modules that its names are in."""
    module = sys.modules[name] = ModuleType(name, "A module of version 1.0, whose names are elsewhere.")
    vars(module)["__getattr__"] = moved(name, places)
    return module
