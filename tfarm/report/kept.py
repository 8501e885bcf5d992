"""What a report keeps of each arm in its folder as JSON, and reads again for the pages that are about all arms."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

COMPARISON_KIND = "compare"  # what is kept of a comparison
COMPARISON_PAGE = "compare.html"
LARGEST_READ = 1 << 20  # bytes of a file worth reading
T = TypeVar("T")


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
