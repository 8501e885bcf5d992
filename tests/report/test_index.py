"""The table of arms on the index: verdicts of the laws that a page is about, else of the default gains."""

import pytest

import tfarm
from tfarm.dsp import Chain, load_chain
from tfarm.report.cases import Case, GivenLaw
from tfarm.report.writing import Card, index_page, kept, save_card

LAB = tfarm.load("sasaki2012-lab")
FAST = tfarm.Law({"hub_angle": ((2.0, 30.0), (0.002, 1.0)), "root_moment": -0.2}, delay=0.002, name="PD, fast")
SLOW = tfarm.Law({"hub_angle": ((0.2, 0.3), (0.1, 1.0))}, name="PD, slow")
SAMPLED = tfarm.Law({"hub_rate": ((0.3,), (1.0,))}, period=0.01, name="sampled")


def rows_of(tmp_path, laws, chain):
    """The rows that the index has of an arm with a page."""
    folder = tmp_path / LAB.name
    folder.mkdir()
    save_card(Case(LAB, chain, tuple(laws)), folder)
    (folder / "index.html").write_text("a page")
    (card,) = kept(tmp_path, "card", Card).values()
    return card.loops, index_page(tmp_path, trust="")


@pytest.mark.parametrize("law", [FAST, SLOW])
def test_a_law_has_its_own_verdicts_and_nothing_of_the_default_gains(tmp_path, law):
    """Those of the answers to `margins` and `sampled`; at 10 ms one of them does not hold."""
    chain = load_chain(LAB.name)
    (row,), page = rows_of(tmp_path, [GivenLaw(law)], chain)
    word = tfarm.sampled(LAB, law).verdict.word
    assert row["law"] == law.name
    assert row["verdict"] == tfarm.margins(LAB, law).stability.verdict == "stable"
    assert row["sampled"].lower() == f"{word} when sampled every 10 ms"
    assert row["sampled"].startswith("UNSTABLE") == (law is FAST)
    assert not {"K1", "K2"} & row.keys()
    assert law.name in page
    assert "K1 = 0.3" not in page


def test_each_law_has_a_row_and_one_in_z_no_continuous_verdict(tmp_path):
    rows, page = rows_of(tmp_path, [GivenLaw(SAMPLED), GivenLaw(tfarm.HubFeedback(K1=0.3, K2=0.3))], Chain())
    assert [row.get("verdict") for row in rows] == [None, "stable"]
    assert [row["sampled"] for row in rows] == ["stable when sampled every 10 ms"] * 2
    assert page.count(f'{LAB.name}/index.html">{LAB.name}</a></td>') == 2
