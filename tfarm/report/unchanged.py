"""Which pages need not be made again: what each was made of, and the hash of every file of it, kept in made.json.

A page is made of the arm's file with its chain, the laws that it is about, the fit that its numbers are from, what was
measured, tfarm's own files and the versions of what computes and draws.  It is up to date if all of these are what they
were and each of its files is as it was written.
"""

from __future__ import annotations

import hashlib
import pickle
import platform
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tfarm
from tfarm.dsp.chain import file_text
from tfarm.report.given_laws import Subject
from tfarm.report.kept import keep, kept_in

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
