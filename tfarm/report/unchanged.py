"""Which pages need not be made again: what each was made of, and the hash of every file of it, kept in made.json.

A page is made of the arm's file with its chain, the laws that it is about, the fit that its numbers are from, what was
measured, tfarm's own files and the versions of what computes and draws.  It is up to date if all of these are what they
were and each of its files is as it was written.

What a report keeps of each arm in its folder as JSON, and reads again for the pages that are about all arms.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import tfarm
from tfarm.dsp.chain import file_text
from tfarm.report.given_laws import Subject

NOTES_KIND = "made"
PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "mpmath",
    "python-flint",
    "sympy",
    "control",
    "matplotlib",
    "latex2mathml",
    "vl-convert-python",
)
COMPARISON_KIND = "compare"  # what is kept of a comparison
COMPARISON_PAGE = "compare.html"
LARGEST_READ = 1 << 20  # bytes of a file worth reading
T = TypeVar("T")


@cache
def makers() -> str:
    """SHA-256 of every file of tfarm, with the versions of what computes and draws."""
    root = Path(tfarm.__file__).parent
    digest = hashlib.sha256(repr([platform.python_version(), *map(version, PACKAGES)]).encode())
    for file in sorted(root.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            digest.update(f"\n{file.relative_to(root).as_posix()}\n".encode() + file.read_bytes())
    return digest.hexdigest()


def key_of(subject: Subject, trust: str) -> str:
    """What the pages on this subject are made of, `trust` being the page that they lead to: a hash."""
    given = pickle.dumps((subject.laws, subject.fit, subject.measured), protocol=4)  # only hashed, never read
    text = "\n".join((makers(), trust, subject.arm.name, file_text(subject.arm, subject.chain)))
    return hashlib.sha256(text.encode() + given).hexdigest()


def is_unchanged(folder: Path, pages: Sequence[str], trust: str, subject: Subject) -> bool:
    """Whether all these pages in an arm's folder are made of the subject, and their files are as they were written."""
    key, noted = key_of(subject, trust), _notes(folder)
    if any(page not in noted or noted[page]["key"] != key for page in pages):
        return False
    files = [each for page in pages for each in noted[page]["files"].items()]
    try:
        return all(_hash(folder / name) == digest for name, digest in files)
    except (OSError, ValueError):
        return False


def note_made(made: Path, folder: Path, pages: Iterable[str], key: str) -> None:
    """made.json in `made`: that its files are these pages, beside what is noted in the arm's `folder` of others."""
    files = {file.relative_to(made).as_posix(): _hash(file) for file in sorted(made.rglob("*")) if file.is_file()}
    notes = {**_notes(folder), **{page: {"key": key, "files": files} for page in pages}}
    keep(made, NOTES_KIND, {"name": folder.name, "pages": notes})


def _notes(folder: Path) -> dict[str, Any]:
    """What is noted of each page; of none where made.json is not there, or none of ours."""

    def notes(read: dict[str, Any]) -> dict[str, Any]:
        return {page: {"key": note["key"], "files": dict(note["files"])} for page, note in read["pages"].items()}

    return kept_in(folder, NOTES_KIND, notes) or {}


def _hash(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def keep(folder: Path, kind: str, content: Mapping[str, Any]) -> None:
    """kind.json, with a mark of what it is."""
    text = json.dumps({f"tfarm_{kind}": 1, **content}, ensure_ascii=False, indent=1) + "\n"
    (folder / f"{kind}.json").write_text(text, encoding="utf-8", newline="")


def kept_in(folder: Path, kind: str, made_of: Callable[[dict[str, Any]], T | None]) -> T | None:
    """What `made_of` makes of a folder's kind.json; None where there is none, or none of ours."""
    file = folder / f"{kind}.json"
    try:
        read = json.loads(file.read_text(encoding="utf-8")) if file.stat().st_size <= LARGEST_READ else {}
        return made_of(read) if read.pop(f"tfarm_{kind}") == 1 else None
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None


def kept_comparison(out: Path) -> tuple[str, tuple[str, ...]]:
    """The title of compare.html beside the reports, and the arms that it compares; ("", ()) where there is none."""
    found = kept_in(out, COMPARISON_KIND, lambda read: (str(read["title"]), tuple(map(str, read["arms"]))))
    return found if found is not None and (out / COMPARISON_PAGE).is_file() else ("", ())


def kept(out: Path, kind: str, made_of: Callable[[dict[str, Any], Path], T | None]) -> list[T]:
    """What `made_of` makes of each folder's kind.json, by name; what is none of ours is passed over."""

    def made(folder: Path) -> T | None:
        return kept_in(folder, kind, lambda read: made_of(read, folder) if read["name"] == folder.name else None)

    folders = sorted((f for f in out.iterdir() if f.is_dir() and not f.name.startswith(".")), key=lambda f: f.name)
    return [each for each in map(made, folders) if each is not None]
