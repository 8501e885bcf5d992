"""Every number in a table of an arm's page is a rounding of the value under its key in the file of that table."""

import pytest

from tests.hostile import NAME
from tests.report.full import ARM
from tests.report.walked import Walk, read, shown_in, untraced_cells
from tfarm.spectrum.table import default_gains


@pytest.fixture(scope="module")
def walk(pages):
    return Walk((pages / NAME / "index.html").read_text(encoding="utf-8"))


def files_of(part, folder):
    """The rows of a section's tables, by their stems."""
    return {stem: read(folder / "data" / f"{stem}.json")["rows"] for stem in part.tables}


def test_every_cell_rounds_the_value_under_its_key(pages, walk):
    law, count = [default_gains(ARM).K1, default_gains(ARM).K2], 0
    for part in walk.parts:
        for stem, rows in files_of(part, pages / NAME).items():
            sheet = part.tables[stem]
            assert len(sheet.keys) == len(sheet.rows[0])
            assert untraced_cells(sheet, rows, law) == [], stem
            count += sum(len(shown_in(cell)) for row in sheet.rows for cell in row)
    assert count > 700


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("5.7456 × 10⁶ N m and −0.26, 1.8e-9 or −3 × 10⁻² %", [5745600.0, -0.26, 1.8e-9, -0.03]),
        (
            "K1 = 77.7, a1/a2 = 0.7 of mode 2: 40 %, 141783 rad/s (1/s), lab2012-lab",
            [77.7, 0.7, 2, 40, 141783],
        ),
        ("[0.3035, 0.6428], 0 … 20.73; 12.8 ms.", [0.3035, 0.6428, 0, 20.73, 12.8]),
    ],
)
def test_numbers_are_read_as_they_stand(text, values):
    assert [each.value for each in shown_in(text)] == pytest.approx(values, rel=1e-14)
