"""Planes of any two numbers of the law of a sampled loop: poles at their points, the command line, bad input."""

import csv

import numpy as np
import pytest

import tfarm
from tests.shell import answer, run
from tfarm import HubFeedback, Law
from tfarm.arm import as_law
from tfarm.arm.writing import save_law
from tfarm.dsp import Chain, sampled_loop
from tfarm.dsp.crossings import sampled_map

LAB = tfarm.load("sasaki2012-lab")
FOUR = Law({"hub_angle": ((4.0, 2.0), (0.05, 1.0)), "hub_rate": 1.0, "root_moment": (0.2, (0.01, 1.0))}, delay=0.004)
GAINS = HubFeedback(K1=0.3, K2=0.3, Kp=2.0)
PLANES = [
    (GAINS, ("Kp", "K2"), (0.2, 8.0), (-1.0, 1.2)),
    (FOUR, ("delay", "hub_angle"), (0.0, 0.04), (0.1, 6.0)),
    (FOUR, ("hub_rate", "hub_angle.den.0"), (-3.0, 8.0), (0.01, 0.3)),
    (FOUR, ("hub_angle.num.0", "root_moment.den.0"), (-9.0, 60.0), (0.002, 0.3)),
]


@pytest.mark.parametrize(("law", "vary", "across", "up"), PLANES)
def test_the_count_at_a_point_is_that_of_the_poles_of_its_own_loop(law, vary, across, up):
    """Of a loop made anew for the law at that point; stable and unstable ones are among them."""
    rng = np.random.default_rng(3)
    x, y = (np.sort(rng.uniform(*ends, 4)) for ends in (across, up))
    plane = sampled_map(sampled_loop(LAB, law, count=6), x, y, vary)
    counts = []
    for i, j in [(i, j) for i in range(4) for j in range(4) if (i + j) % 2]:
        there = as_law(law).having(vary[0], x[i]).having(vary[1], y[j])
        poles = sampled_loop(LAB, there, Chain(), count=6).poles
        counts.append(int((abs(poles.z) > 1).sum()))
        assert (plane.unstable[i, j], plane.counts[j, i]) == (counts[-1], counts[-1])
    assert min(counts) == 0 < max(counts)


def test_the_map_of_the_sampled_loop_from_the_command_line(capsys, tmp_path):
    """With the angle held, over the default ranges; and over a delay, which the loop does not survive."""
    found = answer(capsys, "map", "sasaki2012-lab", "--period", "0.01", "--Kp", "2", "--points", "4")
    assert (found["vary"], found["period_s"], np.shape(found["unstable_poles"])) == (["K1", "K2"], 0.01, (4, 4))
    i, j = 3, 2
    law = HubFeedback(K1=found["x"][i], K2=found["y"][j], Kp=2.0)
    poles = sampled_loop(LAB, law, count=found["modes_used"]).poles
    assert found["unstable_poles"][j][i] == poles.unstable
    law_file, table, picture = (tmp_path / name for name in ("law.toml", "map.csv", "map.png"))
    save_law(FOUR, law_file)
    code, out, _ = run(
        capsys, "map", "sasaki2012-lab", "--dsp", "sasaki2012-lab", "--law", str(law_file), "--vary", "delay=0,0.1",
        "--vary", "hub_angle=1,3", "--points", "3", "--csv", str(table), "--png", str(picture),
    )  # fmt: skip
    assert code == 0
    assert "; . stable, # unstable" in out
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert [len(rows), *rows[0]] == [9, "delay", "hub_angle", "unstable_roots"]
    assert picture.stat().st_size > 5000


@pytest.mark.parametrize("name", ["hub_angel", "hub_angle.num.7"])
def test_what_is_no_number_of_the_law_is_refused(name):
    with pytest.raises(tfarm.ParameterError, match="law"):
        sampled_map(sampled_loop(LAB, FOUR, count=4), [0.0, 1.0], [0.0, 1.0], (name, "hub_rate"))
