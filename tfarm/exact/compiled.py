"""Numba with its disk cache where a folder for it can be written, and without it where none can.

Two facts decide the shape of the files that use this module (measured with numba 0.68):
the cache is keyed by the file of the *calling* function, so an edited callee in another file would
go unnoticed, hence compiled functions that call each other share one file (`fma` below is a
leaf that does not change); and a package installed read-only must still import.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from numba import njit
from numba.core import types
from numba.core.extending import intrinsic

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """The function compiled by numba (nopython, IEEE arithmetic, NumPy's rules for division)."""
    try:
        return njit(cache=True, error_model="numpy", nogil=True)(function)  # type: ignore[no-any-return]
    except RuntimeError:  # no folder for the cache can be written
        return njit(error_model="numpy", nogil=True)(function)  # type: ignore[no-any-return]


def inlined(function: _Function) -> _Function:
    """The same for a small formula, melted into its callers: a loop with a call in it does not vectorise."""
    return njit(error_model="numpy", forceinline=True)(function)  # type: ignore[no-any-return]


def plain(function: _Function) -> _Function:
    """The Python function behind a compiled one, for numbers that numba does not know."""
    return getattr(function, "py_func", function)


if TYPE_CHECKING:

    def fma(a: float, b: float, c: float) -> float: ...

else:

    @intrinsic
    def fma(typing_context, a, b, c):
        """a b + c with one rounding: the hardware instruction, which also vectorises."""
        signature = types.float64(types.float64, types.float64, types.float64)
        return signature, lambda context, builder, signature, arguments: builder.fma(*arguments)
