"""Loads on the link as inputs, and the strain: against transition matrices, and by reciprocity."""

from pathlib import Path

import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tests.transition import response
from tfarm.errors import ParameterError

EPS = np.finfo(float).eps
FEW = 64  # roundings of a value that balls give, and of the oracle's numbers turned to float
BENCH = tfarm.load(str(Path(__file__).parents[1] / "rigs" / "bench-rig.toml"))
FLEX = tfarm.load("quanser-flexlink")
S = (3 + 50j, -2 + 900j, 0.2j)
READ = {  # tfarm's words and the oracle's, before, at and beyond a load at 0.6 of the length
    "hub_angle": ("hub_angle", None),
    "root_moment": ("root_moment", None),
    "tip_displacement": ("tip_displacement", None),
    "displacement": ("displacement", (0.3, 0.6, 0.9)),
    "moment": ("gauge", (0.4,)),
}


def inputs(arm):
    """Each load as tfarm writes it, and as the oracle does."""
    low, middle, high = (share * arm.length for share in (0.2, 0.6, 0.7))
    yield f"force@{middle!r}", ("force", middle)
    yield f"moment_pair@{low!r},{high!r}", ("moment_pair", low, high)


@pytest.mark.parametrize(("arm", "s"), thinned([(arm, s) for arm in (BENCH, FLEX) for s in S], 4))
def test_every_output_of_a_load(arm, s):
    for text, load in inputs(arm):
        for name, (theirs, shares) in READ.items():
            for share in shares or (None,):
                x = None if share is None else share * arm.length
                wanted = theirs if x is None else (theirs, x)
                exact = complex(response(arm, s, [wanted], 40, input=load)[wanted])
                found = tfarm.transfer(arm, name, x=x, input=text)(s)
                assert abs(found - exact) <= FEW * EPS * abs(exact)


@pytest.mark.parametrize("s", S)
@pytest.mark.parametrize("share", [0.0, 0.13, 0.6, 1.0])
def test_a_force_turns_the_hub_as_a_torque_moves_the_place(share, s):
    """Reciprocity (Maxwell and Betti), damping included; the inputs are a force and a torque."""
    x = share * BENCH.length
    moved = tfarm.transfer(BENCH, "displacement", x=x)(s)
    assert abs(tfarm.transfer(BENCH, "hub_angle", input=f"force@{x!r}")(s) - moved) <= FEW * EPS * abs(moved)


@pytest.mark.parametrize("x", [0.01, 0.3])
def test_strain_is_half_the_depth_times_the_curvature(x):
    link = BENCH.link if x < BENCH.link.length else BENCH.outer[0]
    for s in S:
        curvature = complex(response(BENCH, s, [("curvature", x)], 40)["curvature", x])
        expected = curvature * dict(link.section.dimensions)["depth"] / 2
        G = tfarm.transfer(BENCH, "strain", x=x)
        assert abs(G(s) - expected) <= FEW * EPS * (abs(expected) + abs(s * G.derivative(s)))


def test_what_is_no_load_is_refused():
    for text in ("force@3", "force@a", "force@0.1,0.2", "moment_pair@0.1", "moment_pair@0.1,0.1", "blow@0.1"):
        with pytest.raises(ParameterError, match=r"^input = "):
            tfarm.transfer(BENCH, "hub_angle", input=text)
    G = tfarm.transfer(BENCH, "hub_angle", input="force@0.1")
    for ask in (lambda: G.derivative(1j), lambda: G.digits(1j, 20), lambda: G.zeros(up_to=10.0), lambda: G.static):
        with pytest.raises(ParameterError, match=r"^input = "):
            ask()
