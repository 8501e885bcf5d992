"""Files, links and anchors of written pages, and what their tests stand on."""

import math
from dataclasses import replace
from functools import cache

import tfarm
from tests.hostile import Read
from tests.report.full import ARM
from tfarm.audit.published import validate
from tfarm.report.writing import PIECES

ANCHORS = {piece.anchor for piece in PIECES}
HELD = replace(ARM, hub=tfarm.Hub(inertia=math.inf))  # no loop: its proofs are quick
validated = cache(lambda: tuple(validate()))  # as this process has it


def blocks_of(section):
    """Pictures and tables of a section by their stems."""
    return {block.stem: block for block in section.blocks}


def values_of(table):
    """The values of a table, or of the columns of a picture, by the keys of its columns."""
    return {column.key: list(column.values) for column in getattr(table, "columns", table)}


def files_of(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@cache
def links_of(page):
    """What a page that stays holds, read once."""
    return Links(page)


@cache
def ids_of(page):
    return set(links_of(page).ids)


LEADING = ("href", "src", "srcset", "action", "data")  # attributes that lead somewhere


class Links:
    """Every href, src, id, tag and alternative text of a page."""

    def __init__(self, page):
        read = Read(page.read_text(encoding="utf-8"))
        self.tags, self.targets = read.tags, [value for key, value in read.attributes if key in LEADING]
        self.ids, self.alts = ([value for name, value in read.attributes if name == key] for key in ("id", "alt"))


class Unmakeable:
    """A piece of the page that cannot be made: in a class, so that a process may be sent it."""

    def __init__(self, error):
        self.error = error

    def __call__(self, *_):
        raise self.error
