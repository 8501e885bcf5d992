"""A quantity that is declared once is in JSON, CSV, on terminals, in tables and in comparisons."""

import math
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
import pytest

import tfarm
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.margins import Margins, margins
from tfarm.loop.nyquist import Nyquist, nyquist
from tfarm.schema import (
    At,
    Percent,
    Quantity,
    across,
    as_csv,
    compare_records,
    curve_table,
    entries,
    quantities,
    roots_table,
    sections,
    table,
    text,
    to_dict,
    to_json,
)
from tfarm.schema.html import as_html
from tfarm.schema.terminal import table_lines

LAB = tfarm.load("sasaki2012-lab")
PAPER_GAINS = tfarm.HubFeedback(K1=0.3, K2=0.3)


class Row(NamedTuple):
    mode: Annotated[int, Quantity("mode")]
    omega: Annotated[float, Quantity("frequency", "rad/s", 4)]
    hidden: float = 1.0


@dataclass(frozen=True)
class Inner:
    word: Annotated[str, Quantity("stability")]
    limit: Annotated[float | None, Quantity("limit", "s")] = None


@dataclass(frozen=True)
class Outer:
    inner: Annotated[Inner, Quantity(flat=True)]
    nested: Annotated[Inner, Quantity("nested")]
    margin: Annotated[At, Quantity("margin", "deg", 3, "least angle")]
    s: Annotated[np.ndarray, Quantity("s", "1/s", curve=True)]
    L: Annotated[np.ndarray, Quantity("L", curve=True)]
    rows: Annotated[list[Row], Quantity("modes")]
    own: Annotated[int, Quantity(key="json_alone")] = 3
    undeclared: int = 5

    @property
    def double(self) -> Annotated[int, Quantity("twice")]:
        return 2 * self.own


S = np.array([1j, 2j])
RECORD = Outer(Inner("stable", 0.5), Inner("unstable"), At(41.87, 77.2), S, S + 1, [Row(1, 71.50568), Row(2, 204.3)])


def test_json_has_every_quantity_under_its_key_with_the_unit():
    assert to_dict(RECORD) == {
        "word": "stable",
        "limit_s": 0.5,
        "nested": {"word": "unstable", "limit_s": None},
        "margin_deg": 41.87,
        "margin_at_rad_s": 77.2,
        "s": [[0.0, 1.0], [0.0, 2.0]],
        "L": [[1.0, 1.0], [1.0, 2.0]],
        "rows": [{"mode": 1, "omega_rad_s": 71.50568}, {"mode": 2, "omega_rad_s": 204.3}],
        "json_alone": 3,
        "double": 6,
    }
    assert '"limit_s": "inf"' in to_json(to_dict(replace(RECORD, inner=Inner("stable", math.inf))))


def test_stability_intervals_are_read_directly_after_the_card():
    """A terminal of 50 lines shows the card and the intervals of both loops."""
    for found in (tfarm.margins(LAB, PAPER_GAINS), tfarm.sampled(LAB, PAPER_GAINS)):
        table, values, *others = sections(found)
        assert table.title == "stability intervals"
        assert [next(iter(row.values())) for row in table.table] == ["K1", "K2", "Kp"]
        assert ("stability", "stable") in values.pairs
        assert "stability intervals" not in [each.title for each in others]


def test_a_person_reads_labels_values_and_units_then_tables():
    first, nested, rows = sections(RECORD)
    assert first.pairs == [
        ("stability", "stable"),
        ("limit", "0.5 s"),
        ("margin", "41.9 deg at 77.2 rad/s"),
        ("twice", "6"),
    ]
    assert (nested.title, nested.pairs) == ("nested", [("stability", "unstable"), ("limit", "-")])
    assert rows.title == "modes"
    lines = table_lines(rows.table, 80)
    assert rows.title == "modes"
    assert lines[0].split() == ["mode", "frequency", "[rad/s]"]
    assert lines[1].split() == ["1", "71.51"]


def test_curves_are_columns_of_csv_complex_ones_two():
    head, first, *_ = as_csv(curve_table(RECORD), units=True).splitlines()
    assert head == "re_s [1/s],im_s [1/s],re_L,im_L"
    assert first == "0.0,1.0,1.0,1.0"
    assert as_csv(curve_table(replace(RECORD, s=S.imag))).splitlines()[1] == "1.0,1.0,1.0"


def test_differences_are_in_the_unit_and_rows_are_paired_by_their_first_quantity():
    other = replace(RECORD, margin=At(40.87, 70.0), rows=[Row(2, 205.3), Row(3, 1.0)], inner=Inner("marginal", 0.25))
    found = {each.quantity: each for each in compare_records(RECORD, other)}
    assert found["margin"].difference == pytest.approx(-1.0)
    assert found["margin"].unit == "deg"
    assert found["limit"].difference == pytest.approx(-0.25)
    assert (found["stability"].one, found["stability"].other) == ("stable", "marginal")
    assert found["stability"].difference is None
    assert found["mode 2: frequency"].difference == pytest.approx(1.0)
    assert "mode 1: frequency" not in found
    assert "nested: limit" not in found  # of neither
    assert found["twice"].difference == 0.0


def test_records_are_columns_of_one_table():
    found = across({"a": RECORD, "b": replace(RECORD, own=4)}, keys=("one", "two"))
    by_key = {column.key: dict(zip(found.columns[0].values, column.values, strict=True)) for column in found.columns}
    assert by_key["one"]["twice"] == 6
    assert by_key["two"]["twice"] == 8
    assert by_key["unit"]["margin"] == "deg"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, "-"),
        (True, "yes"),
        (1234567.8, "1.23457e+06"),
        (math.inf, "inf"),
        (-3.5974266 + 75.90663j, "-3.59743+75.9066i"),
        (2.0 + 0j, "2"),
        (1e-18 + 5j, "0 (+-1e-13)+5i"),
        ((0.0, 934.3), "(0, 934.3)"),
        ([(0.0, 1.0), (2.0, math.inf)], "(0, 1), (2, inf)"),
        (Percent(0.05), "5 %"),
        ({"hub_rate": "rad/s"}, "hub_rate rad/s"),
        ([], ""),
    ],
)
def test_one_value_as_a_person_reads_it(value, shown):
    assert text(value) == shown


def test_poles_have_their_damping_ratio():
    found = roots_table(np.array([-3.0 + 4.0j, -2.0 + 0.0j]), Quantity("s", "1/s"))
    assert [column.cells for column in found.columns][2] == ["0.6", "-"]


def test_a_quantity_without_a_label_is_in_no_table():
    assert [column.key for column in table(RECORD.rows).columns] == ["mode", "omega_rad_s"]
    assert [column.key for column in table(RECORD.rows, ("omega",)).columns] == ["omega_rad_s"]


def test_a_table_without_rows_is_a_page_s_too():
    @dataclass(frozen=True)
    class Columns:
        is_table = True

        omega: Annotated[np.ndarray, Quantity("frequency", "rad/s")]

    assert "frequency" in as_html(table(Columns(np.empty(0))))
    assert "none" in as_html(table([]))
    assert as_csv(table([])) == "\n"


def test_every_quantity_of_a_real_loop_is_read():
    """Keys are unique, what has a label has one meaning, and nothing that is declared is lost."""
    found = margins(LAB, PAPER_GAINS)
    answer = to_dict(found)
    flat = [name for name, of in quantities(Margins).items() if not of.flat]
    assert {quantities(Margins)[name].key for name in flat} <= answer.keys()
    assert {of.key for of in quantities(type(found.stability)).values() if not of.flat} <= answer.keys()
    labels = [label for label, _, _ in entries(found)]
    assert len(labels) == len(set(labels))
    assert answer["in_range"]["phase_margin_deg"] == found.in_band.phase
    assert quantities(ContinuousLoop)["warnings"].label == "warnings"


def test_a_record_with_flat_records_has_its_own_curves():
    found = nyquist(LAB, PAPER_GAINS)
    assert [column.key for column in curve_table(found).columns] == ["re_s", "im_s", "re_L", "im_L"]
    assert len(curve_table(found).columns[0].values) == found.s.size
    assert "encirclements" in quantities(Nyquist)


def test_labels_and_units_may_depend_on_the_record():
    class Sample(NamedTuple):
        size: Annotated[float, Quantity("magnitude", unit_of="gain_unit")]

    @dataclass(frozen=True)
    class Response:
        gain_unit: str
        titles: dict[str, tuple[str, str]]
        value: Annotated[float, Quantity("value")]
        samples: Annotated[list[Sample], Quantity("samples")]

    found = Response("m/N", {"value": ("K1", "N m s/rad")}, 0.3, [Sample(2.0)])
    first, rows = sections(found)
    assert first.pairs == [("K1", "0.3 N m s/rad")]
    assert [(label, of.unit) for label, of, _ in entries(found)] == [("K1", "N m s/rad")]
    assert [(column.title, column.unit) for column in rows.table.columns] == [("magnitude", "m/N")]
