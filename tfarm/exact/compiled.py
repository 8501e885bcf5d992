"""Numba with its disk cache where a folder for it can be written, and without it where none can.

numba keys a cached function by its own file only: an edited callee in another file would go unnoticed
(measured with numba 0.68).  So the cache of this package lies in a folder named by a hash of all the sources
that compiled code can come from: those of this room, and those that ask it to compile.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeVar

from numba import config, njit
from numba.core import types
from numba.core.extending import intrinsic

_Function = TypeVar("_Function", bound=Callable[..., Any])
_HERE = Path(__file__).parent


def compiled(function: _Function) -> _Function:
    """The function compiled by numba (nopython, IEEE arithmetic, NumPy's rules for division)."""
    try:
        with _cache_folder():
            return njit(cache=True, error_model="numpy", nogil=True, no_cfunc_wrapper=True)(function)
    except (RuntimeError, OSError):  # no folder for the cache can be written
        return njit(error_model="numpy", nogil=True, no_cfunc_wrapper=True)(function)


def inlined(function: _Function) -> _Function:
    """The same for a small formula, melted into its callers: a loop with a call in it does not vectorise."""
    return njit(error_model="numpy", forceinline=True, no_cfunc_wrapper=True)(function)


def python_of(function: Callable[..., Any]) -> Callable[..., Any]:
    """The Python function behind a compiled one, with those it calls, for numbers that numba does not know."""
    python: Any = getattr(function, "py_func", function)
    called = {name: python.__globals__[name] for name in python.__code__.co_names if name in python.__globals__}
    replaced = {name: python_of(value) for name, value in called.items() if hasattr(value, "py_func")}
    if not replaced:
        return python
    return FunctionType(python.__code__, python.__globals__ | replaced, python.__name__)


def _source_hash() -> str:
    digest = hashlib.sha256()
    for source in sorted(_HERE.parent.rglob("*.py")):
        text = source.read_bytes()
        if source.parent == _HERE or b"exact.compiled import" in text:
            digest.update(text)
    return digest.hexdigest()[:16]


@contextmanager
def _cache_folder() -> Iterator[None]:
    """numba's cache folder for the functions decorated inside; a folder the user chose stays its parent."""
    chosen = config.CACHE_DIR
    config.CACHE_DIR = str(Path(chosen or _HERE / "__pycache__") / f"tfarm-{_SOURCE_HASH}")
    try:
        yield
    finally:
        config.CACHE_DIR = chosen


_SOURCE_HASH = _source_hash()

if TYPE_CHECKING:

    def fma(a: float, b: float, c: float) -> float: ...

else:

    @intrinsic
    def fma(typing_context, a, b, c):
        """a b + c with one rounding: the hardware instruction, which also vectorises."""
        signature = types.float64(types.float64, types.float64, types.float64)
        return signature, lambda context, builder, signature, arguments: builder.fma(*arguments)
