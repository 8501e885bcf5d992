"""Numba with its disk cache where a folder for it can be written, else without.

numba keys a cached function by its own file only and ignores an edited callee in another file (numba 0.68).  So the
cache of this package is in a folder named by a hash of all sources of compiled code: those of this room, and those that
import this module, but for those that only take the Python function of a kernel.
"""

import hashlib
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeVar

from numba import config, njit
from numba.core import event, types
from numba.core.caching import FunctionCache
from numba.core.extending import intrinsic
from numba.core.runtime import rtsys
from numba.core.types.misc import unliteral
from numba.np import linalg

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])


class _KernelCache(FunctionCache):  # type: ignore[misc]  # numba comes without types
    """Kernels on disk, loaded without numba's tables of every function it knows, which only compiling reads."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the kernel of a signature, None where it is not kept; numba's own fills those tables first."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


def compiled(function: _Kernel) -> _Kernel:
    """Return the function compiled by numba (nopython, IEEE arithmetic, NumPy's rules for division).

    Its cache is below the user's cache folder of numba, or else below this room.
    """
    kernel = _kernel_of(function, is_inlined=False)
    parent = config.CACHE_DIR
    config.CACHE_DIR = str(_CACHE)
    # no folder for the cache can be written
    with suppress(RuntimeError, OSError):
        kernel._cache = _KernelCache(function)
    config.CACHE_DIR = parent
    return kernel


def inlined(function: _Kernel) -> _Kernel:
    """Return a function compiled and inlined into the kernels that call it, so that loops over it vectorise."""
    kernel = _kernel_of(function, is_inlined=True)
    # what Python would call: a null pointer
    kernel._insert = lambda *_: None
    kernel._compile_for_args = _refuse
    return kernel


def _refuse(*_: Any) -> None:
    """Raise TypeError, in the place of a call from Python."""
    raise TypeError("an inlined kernel is called by kernels alone; python_of(it) is for Python")


def _kernel_of(function: _Kernel, is_inlined: bool) -> Any:
    """Return the kernel of a function; others call it with the type of a constant.

    Numba itself would compile it anew for each value.
    """
    jit = njit(
        error_model="numpy",
        nogil=True,
        no_cfunc_wrapper=True,
        forceinline=is_inlined,
        no_cpython_wrapper=is_inlined,
    )
    kernel: Any = jit(function)
    template_for = kernel.get_call_template
    kernel.get_call_template = lambda args, kws: template_for([unliteral(each) for each in args], kws)
    return kernel


def python_of(function: Any) -> Callable[..., Any]:
    """Return the Python function of a compiled one, with its callees, for numbers other than numba's."""
    python: Any = getattr(function, "py_func", function)
    called = {
        name: python.__globals__[name] for name in python.__code__.co_names if name in python.__globals__
    }
    replaced = {name: python_of(value) for name, value in called.items() if hasattr(value, "py_func")}
    if not replaced:
        return python
    return FunctionType(python.__code__, python.__globals__ | replaced, python.__name__)


def _cache_folder() -> Path:
    """Return the folder of the kernels, named by a hash of all sources of compiled code."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted(here.parent.rglob("*.py")):
        text = source.read_bytes()
        has_kernels = source.parent == here or b"exact.compiled import" in text
        if has_kernels and b"import python_of\n" not in text:
            digest.update(text)
    return Path(config.CACHE_DIR or here / "__pycache__") / f"tfarm-{digest.hexdigest()[:16]}"


_CACHE = _cache_folder()


class _FirstUse(event.Listener):  # type: ignore[misc]  # numba comes without types
    """A line on standard error at the first compilation, where no compiled kernel has been kept before."""

    is_silent = _CACHE.exists()

    def on_start(self, _: Any) -> None:
        if not self.is_silent:
            self.is_silent = True
            print("tfarm: compiling kernels, once (about half a minute)", file=sys.stderr)

    def on_end(self, _: Any) -> None: ...


event.register("numba:compile", _FirstUse())
# At their import numba's functions of arrays look for a BLAS by loading scipy.linalg, a tenth of a short command.  No
# kernel calls it, and where one did, numba would look again as it compiles it.
_look_for_blas = linalg.ensure_blas
linalg.ensure_blas = lambda: None
import_module("numba.np.arraymath")
linalg.ensure_blas = _look_for_blas

if TYPE_CHECKING:

    def fma(a: float, b: float, c: float) -> float: ...

else:

    @intrinsic
    def fma(typing_context, a, b, c):
        """Return a b + c with one rounding, by the hardware instruction, which also vectorises."""
        signature = types.float64(types.float64, types.float64, types.float64)
        return signature, lambda context, builder, signature, arguments: builder.fma(*arguments)
