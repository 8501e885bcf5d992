"""Files, links and anchors of written pages, and what their tests stand on."""

import math
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser

import tfarm
from tests.report.full import ARM
from tfarm.audit.published import validate
from tfarm.report.page import PIECES

ANCHORS = {piece.anchor for piece in PIECES}
HELD = replace(ARM, hub=tfarm.Hub(inertia=math.inf))  # no loop: its proofs are quick
validated = cache(lambda: tuple(validate()))  # as this process has it


def blocks_of(section):
    """Pictures and tables of a section by their stems."""
    return {block.stem: block for block in section.blocks}


def values_of(table):
    """The values of a table by the keys of its columns."""
    return {column.key: list(column.values) for column in table.columns}


def files_of(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@cache
def links_of(page):
    """What a page that stays holds, read once."""
    return Links(page)


@cache
def ids_of(page):
    return set(links_of(page).ids)


class Links(HTMLParser):
    """Every href, src, id and tag of a page."""

    def __init__(self, page):
        super().__init__()
        self.targets, self.ids, self.tags, self.alts = [], [], set(), []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        for key, value in attrs:
            if key in ("href", "src", "srcset", "action", "data"):
                self.targets.append(value)
            elif key == "id":
                self.ids.append(value)
        if tag == "img":
            self.alts.append(dict(attrs).get("alt"))


class Unmakeable:
    """A piece of the page that cannot be made: in a class, so that a process may be sent it."""

    def __init__(self, error):
        self.error = error

    def __call__(self, *_):
        raise self.error
