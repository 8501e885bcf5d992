"""What the tests of pages share: coarse grids, a full report on one arm, and the files, links and anchors of pages.

On coarse grids words, links and bytes are tested: where a boundary lies has tests of its own.  The report is made once
a session, by a process with other hashes and in another time zone, which then lists its kernels; its name and
assumptions are as hostile as they may be; its audit is the one that the command of this session has made.
"""

import math
import os
import subprocess
import sys
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import tfarm
from tests.hostile import LONG, NAME, PRINTED, Read
from tfarm.arm import to_toml
from tfarm.assessment import stability_map
from tfarm.audit.published import validate
from tfarm.dsp import Chain
from tfarm.exported import live_loop
from tfarm.loop import circle_crossings as sampled_regions
from tfarm.loop import loci
from tfarm.loop import sampled_modes as sampled_loci
from tfarm.report import overview, page, writing
from tfarm.report.page import ArmReport
from tfarm.report.sections import PIECES

COARSE = (
    (stability_map, "GRID_COLUMNS", 48),
    (stability_map, "GRID_ROWS", 40),
    (stability_map, "SAMPLED_COLUMNS", 24),
    (stability_map, "OVERLAY_COLUMNS", 8),
    (sampled_regions, "MOST_COLUMNS", 0),  # with the corners that so few have
    (loci, "LOCUS_POINTS", 60),
    (sampled_loci, "SAMPLED_LOCUS_VALUES", 31),
    (page, "FILM_FRAMES", 10),
    (writing, "MOST_WORKERS", 1),  # a second process would have its own grids
    (stability_map, "sampled_region", stability_map.sampled_region.__wrapped__),  # what is kept of it is of other grids
    (live_loop, "sampled_region", stability_map.sampled_region.__wrapped__),
)


def coarsen(put=setattr):
    """Put the coarse grids in place, for good or, with a MonkeyPatch's setattr, until it is undone."""
    for room, name, value in COARSE:
        put(room, name, value)


def plain_cards(put):
    """Cards of the index with an empty picture, for tests that are not about it: a response and a drawing each."""
    put(page, "bode", lambda *_: None)
    put(overview, "draw_card", SimpleNamespace(figure=lambda _: None))
    put(overview, "save_figure", lambda _, file: file.write_text("<svg/>"))


ASSUMPTIONS = (PRINTED, "second assumption", LONG)
ARM = replace(tfarm.load("stocky-steel"), name=NAME, assumptions=ASSUMPTIONS)
REPORT = (
    "import pickle, sys, tfarm; from pathlib import Path; from tfarm.report import page, write;"
    "rows = pickle.loads(Path(sys.argv[3]).read_bytes()); page.kept_audit = lambda: rows;"
    "from tests.report.written import coarsen; coarsen();"  # the map and the sampled section have tests of their own
    "print(write([tfarm.load(sys.argv[1])], Path(sys.argv[2])));"
    "pyplot = sys.modules.get('matplotlib.pyplot');"  # python-control imports it; no figure may be its own
    "print(bool(pyplot and pyplot.get_fignums()));"
    "from tests.exact.signatures import save; save(Path(sys.argv[2]).with_suffix('.signatures'))"
)


def report_elsewhere(audit_file, out):
    file = out.with_suffix(".toml")
    file.write_text(to_toml(ARM), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", REPORT, str(file), str(out), str(audit_file)],
        env={**os.environ, "PYTHONHASHSEED": "12345", "TZ": "Asia/Tokyo"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout.splitlines(), done.stderr) == ([str(out / "index.html"), "False"], "")


ANCHORS = {piece.anchor for piece in PIECES}
HELD = replace(ARM, hub=tfarm.Hub(inertia=math.inf))  # no loop: its proofs are quick
validated = cache(lambda: tuple(validate()))  # as this process has it


def report_with(arm, **records):
    """A report on an arm in which these records stand for those that it would make."""
    return type("Report", (ArmReport,), records)(arm, Chain())


def blocks_of(section):
    """Pictures and tables of a section by their stems; those without columns are not on the page."""
    return {block.stem: block for block in section.blocks if getattr(block, "columns", True)}


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
