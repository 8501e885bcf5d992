"""Pages on coarse grids, for tests of words, links and bytes: where a boundary lies has tests of its own."""

from tfarm.dsp import crossings as sampled_regions
from tfarm.dsp import modes as sampled_loci
from tfarm.dsp import verdict
from tfarm.loop import loci
from tfarm.plots import regions
from tfarm.report import live, loop_section, writing

COARSE = (
    (loop_section, "GRID_COLUMNS", 48),
    (loop_section, "GRID_ROWS", 40),
    (regions, "SAMPLED_COLUMNS", 24),
    (regions, "OVERLAY_COLUMNS", 8),
    (sampled_regions, "MOST_COLUMNS", 0),  # with the corners that so few have
    (loci, "LOCUS_POINTS", 60),
    (sampled_loci, "SAMPLED_LOCUS_VALUES", 31),
    (verdict, "PERIOD_SHARES", (1.0, 5.0)),
    (writing, "MOST_WORKERS", 1),  # a second process would have its own grids
    (regions, "sampled_region", regions.sampled_region.__wrapped__),  # what is kept of it is of other grids
    (live, "sampled_region", regions.sampled_region.__wrapped__),
)


def coarsen(put=setattr):
    """Put the coarse grids in place, for good or, with a MonkeyPatch's setattr, until it is undone."""
    for room, name, value in COARSE:
        put(room, name, value)


def plain_cards(put):
    """Cards of the index with an empty picture, for tests that are not about it: a response and a drawing each."""
    put(writing, "bode", lambda *_: None)
    put(writing, "draw_card", lambda _: None)
    put(writing, "save_figure", lambda _, folder, stem, formats: (folder / f"{stem}.svg").write_text("<svg/>"))
