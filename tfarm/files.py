"""Reading and writing files: never half of one is visible, and nothing but a file is replaced.

A file is written under a temporary name in its folder and renamed.  Leftovers of a killed run are removed by the next
one: each temporary file or folder is locked while its writer lives, so one that can be locked has no writer.
"""

import errno
import io
import os
import re
import secrets
import shutil
import stat
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import IO, Any, Literal, cast

from tfarm.errors import ParameterError, require
from tfarm.foreign import read_arrays
from tfarm.stopping import undone_if_stopped

if sys.platform != "win32":
    import fcntl

# in the place of a path, as other programs have it; a file of that name is written as a/-
STANDARD_OUTPUT = "-"


def read_file(path: str | os.PathLike[str], most: int, *, key: str, what: str) -> bytes:
    """Return the bytes of a regular file of at most `most`; a device, a pipe or a folder is refused unopened.

    Raises ParameterError, naming `key`; `what` names the kind of file in the remedy ("a .toml file").
    """
    with open_file(path, most, key=key, what=what) as file, _name_errors(key, path):
        data = file.read(most + 1)
    # of a file that grows, or that has no size
    _check_size(path, len(data), most, what)
    return data


@contextmanager
def open_file(path: str | os.PathLike[str], most: int, *, key: str, what: str) -> Iterator[IO[bytes]]:
    """Yield what `read_file` reads as an open file."""
    with _name_errors(key, path):
        status = os.stat(path)
    kind = "a folder" if stat.S_ISDIR(status.st_mode) else "no regular file"
    require(stat.S_ISREG(status.st_mode), key, os.fspath(path), f"is {kind}; give {what}")
    _check_size(path, status.st_size, most, what)
    with _name_errors(key, path):
        # closed below
        file = open(path, "rb")  # noqa: SIM115
    with file:
        yield file


def _check_size(path: str | os.PathLike[str], size: int, most: int, what: str) -> None:
    """Raise ParameterError for a file of more bytes."""
    require(size <= most, "size in bytes", size, f"{what} of at most {most} is read", os.fspath(path))


def read_mat(path: str | os.PathLike[str], most: int, *, key: str) -> tuple[dict[str, Any], bytes]:
    """Return the arrays of a .mat file (up to version 7.2) by name, "structure.name" of a structure, and its bytes.

    Raises ParameterError, naming `key`, where there is none or it cannot be read.
    """
    data = read_file(path, most, key=key, what="a .mat file")
    return read_arrays("mat", path, key=key, remedy="no .mat file that can be read (up to version 7.2)"), data


def mat_content(variables: Mapping[str, Any], oned_as: Literal["row", "column"]) -> bytes:
    """Return a MATLAB file (level 5) without SciPy's date in its header: same inputs, same bytes."""
    from scipy.io import savemat

    content = io.BytesIO()
    savemat(cast("Any", content), dict(variables), oned_as=oned_as)
    # bytes of text that a MAT-file begins with, before its version
    size = 116
    return b"MATLAB 5.0 MAT-file, written by tfarm".ljust(size) + content.getvalue()[size:]


def write_file(path: Path, content: bytes, *, key: str) -> None:
    """Write under a temporary name, then rename; symbolic links are followed, and a replaced file keeps its mode.

    What is no regular file (a device, a pipe, /dev/stdout, or "-" for that) is written straight to.  Raises
    ParameterError, naming `key`, where that cannot be done, and BrokenPipeError where the reader of a pipe has left.
    """
    number = _descriptor(path)
    with _name_errors(key, path, "cannot be written ({}); choose another"):
        if number is None and not (path.exists() and not path.is_file()):
            _replace(Path(os.path.realpath(path)), content)
            return
        # a pipe without a reader, and a folder, raise OSError at once
        if number is None:
            handle = os.open(path, os.O_WRONLY | getattr(os, "O_NONBLOCK", 0))
        else:
            handle = os.dup(number)
        os.set_blocking(handle, True)
        with os.fdopen(handle, "wb") as file:
            file.write(content)


def is_standard_output(path: Path) -> bool:
    """Return whether a path such as /dev/stdout, or "-", is this process's own standard output."""
    return _descriptor(path) == 1


@contextmanager
def temporary_folder(place: Path) -> Iterator[Path]:
    """Yield a new folder in `place`, removed afterwards with its content; leftovers of killed runs go first."""
    with _temporary(place, ".writing-", "", partial(Path.mkdir, mode=0o700)) as folder:
        yield folder


@contextmanager
def place_in(out: Path, key: str, names: Sequence[str] = ()) -> Iterator[Path]:
    """Yield a temporary folder in `out`, gone afterwards; what was made for it goes too if the work fails.

    Raises ParameterError, naming `key`, before any work where `out` or a folder of these names in it cannot be written.
    """
    folders = [out, *(out / name for name in names)]
    try:
        with _make_folders(folders):
            for folder in folders:
                # which fails where it cannot be written to
                with temporary_folder(folder):
                    pass
            with temporary_folder(out) as place:
                yield place
    except OSError as error:
        raise ParameterError(
            key=key,
            value=str(out),
            remedy=f"cannot be written to ({error.strerror or error}); give a folder that can",
        ) from None


@contextmanager
def _make_folders(folders: Sequence[Path]) -> Iterator[None]:
    """Make folders, of which those that are new and empty are removed afterwards, also where the process is stopped."""
    missing: list[Path] = []
    for folder in folders:
        missing += (each for each in (*reversed(folder.parents), folder) if not each.exists())

    def remove_empty() -> None:
        for folder in reversed(missing):
            with suppress(OSError):
                folder.rmdir()

    try:
        with undone_if_stopped(remove_empty):
            for folder in folders:
                folder.mkdir(parents=True, exist_ok=True)
            yield
    finally:
        remove_empty()


def move_into(made: Path, folder: Path) -> None:
    """Replace every file in one step each, pages last, so that a page never names a file that is not there."""
    files = [file.relative_to(made) for file in made.rglob("*") if file.is_file()]
    for file in sorted(files, key=lambda file: (file.suffix == ".html", file.as_posix())):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        os.replace(made / file, folder / file)


@contextmanager
def _name_errors(
    key: str,
    path: str | os.PathLike[str],
    remedy: str = "cannot be read ({}); check the path and its permissions",
) -> Iterator[None]:
    """Turn errors of the system into ParameterError with their reason in the remedy; a broken pipe stays one."""
    try:
        yield
    except BrokenPipeError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ParameterError(key=key, value=os.fspath(path), remedy=remedy.format(reason)) from None


def _descriptor(path: Path) -> int | None:
    """Return the number of the open file of a path such as "-", /dev/stdout or /dev/fd/3."""
    if str(path) == STANDARD_OUTPUT:
        return 1
    name = os.path.abspath(path)
    found = re.fullmatch(r"/(?:dev|proc/self)/fd/(\d{1,9})", name)
    if found:
        return int(found[1])
    return {"/dev/stdout": 1, "/dev/stderr": 2}.get(name)


def _replace(path: Path, content: bytes) -> None:
    """Write a regular file, new or in the place of another, whose mode and owner it keeps."""
    old = path.stat() if path.exists() else None
    if old is not None and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    make = partial(Path.touch, mode=0o666 if old is None else 0o600, exist_ok=False)
    with _temporary(path.parent, f".{path.name[:40]}.", ".part", make) as temporary:
        temporary.write_bytes(content)
        if old is not None:
            # AttributeError: of a system without owners
            with suppress(OSError, AttributeError):
                os.chown(temporary, old.st_uid, old.st_gid)
            temporary.chmod(stat.S_IMODE(old.st_mode))
        os.replace(temporary, path)


@contextmanager
def _temporary(folder: Path, prefix: str, suffix: str, make: Callable[[Path], object]) -> Iterator[Path]:
    """Yield the path that `make` makes, locked until it is removed afterwards; made again if another run removed it.

    Others of such a name that are not locked go first: their writers are gone.
    """
    pattern = re.compile(f"{re.escape(prefix)}[0-9a-f]{{8}}{re.escape(suffix)}")
    # of a folder that cannot be listed, and may yet be written to
    with suppress(PermissionError):
        for name in filter(pattern.fullmatch, os.listdir(folder)):
            with suppress(OSError), _hold_lock(folder / name, wait=False):
                _remove(folder / name)
    while True:
        path = folder / f"{prefix}{secrets.token_hex(4)}{suffix}"
        with undone_if_stopped(partial(_remove, path)):
            make(path)
            with _hold_lock(path, wait=True):
                try:
                    if path.exists():
                        yield path
                        return
                finally:
                    _remove(path)


@contextmanager
def _hold_lock(path: Path, *, wait: bool) -> Iterator[None]:
    """Hold the lock of a temporary file or folder; none where it is gone, or where the file system has no locks.

    Raises BlockingIOError where another process has it and `wait` is false.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW) if sys.platform != "win32" else None
    except FileNotFoundError:
        handle = None
    # on Windows: no such locks, but what is open cannot be removed either
    if handle is None:
        yield
        return
    try:
        with suppress(*[OSError] * wait):
            how = fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB
            fcntl.flock(handle, how)
        yield
    finally:
        os.close(handle)


@contextmanager
def locked_folder(path: Path, *, key: str) -> Iterator[None]:
    """Make a folder, unless it is there, and hold its lock; a new one that stays empty is removed.

    Raises ParameterError where another process has it.
    """
    with ExitStack() as stack:
        with _name_errors(key, path, "cannot be made ({}); choose another"):
            stack.enter_context(_make_folders([path]))
        try:
            stack.enter_context(_hold_lock(path, wait=False))
        except BlockingIOError:
            raise ParameterError(
                key=key, value=os.fspath(path), remedy="another run has it: wait for its end"
            ) from None
        yield


def _remove(path: Path) -> None:
    """Remove a temporary file or folder, if it is there."""
    # of a folder alone, and not of a link to one
    shutil.rmtree(path, ignore_errors=True)
    with suppress(OSError):
        path.unlink(missing_ok=True)
