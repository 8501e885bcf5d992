"""The picture of a record as a command writes it into a file: on a figure of its own."""

from __future__ import annotations

from functools import singledispatch
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from matplotlib.figure import Figure

import tfarm.plots


@singledispatch
def drawn(found: object, *beside: Any) -> Figure:
    """The figure of what was found, with what its picture has beside it (of a locus the reduced one).

    The function that draws a record registers itself, by `drawn.register` above it.
    """
    raise TypeError(f"{type(found).__name__} has no picture")


def picture_of(*found: Any) -> Figure:
    """What `drawn` gives, once all pictures of this room are known to it."""
    for module in iter_modules(tfarm.plots.__path__):
        import_module(f"tfarm.plots.{module.name}")
    return drawn(*found)
