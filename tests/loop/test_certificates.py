"""Proven discs for the poles of any law: each holds one zero of the paper's determinant, its hub row changed.

At one s a law on the hub's signals is three complex gains; times the law's denominators the determinant is analytic.
"""

import cmath
import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tests.shell import run
from tests.spectrum.independent import delta
from tfarm import Hub, HubFeedback, Law, Payload
from tfarm.arm import as_law
from tfarm.arm.blocks import Rational
from tfarm.case import Case
from tfarm.errors import CertificationError
from tfarm.loop.poles import Poles
from tfarm.loop.stability import stability

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
W = 72.0  # rad/s, about the first mode
LAWS = {
    "gains": HubFeedback(K1=0.3, K2=0.5, Kp=2.0),
    "lead": Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}),
    "late": Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002),
    "notch": Law({"hub_rate": ([0.3, 0.03 * W, 0.3 * W * W], [1.0, 1.2 * W, W * W]), "hub_angle": 2.0}),
    "integral": Law({"hub_angle": ([1.0, 5.0, 1.0], [0.001, 1.0, 0.0]), "hub_rate": 0.4}),
    "order 6": Law({
        "hub_rate": {"zeros": [-10, -40, -3 + 60j, -3 - 60j], "poles": [-20, -100, -30 + 60j, -30 - 60j], "gain": 0.3},
        "root_moment": ([0.2], [1 / 300**2, 1.4 / 300, 1.0]),
    }),
    "matrices": Law.of_matrices([[-2.0, -5.0], [1.0, 0.0]], [[1.0], [0.0]], [[0.0, -3.0]], [[0.7]], ["hub_angle"]),
    "plus": Law({"hub_angle": ([-1.0, -3.0], [0.02, 1.0])}, sign=1, delay=1e-3),
}  # fmt: skip


def closed(arm, law, s):
    """The determinant under a law at s, times the law's denominators, at mpmath's precision."""
    gains, whole = dict.fromkeys(("hub_angle", "hub_rate", "root_moment"), mpmath.mpf(0)), mpmath.mpf(1)
    for part in law.parts:
        block = part.block
        if isinstance(block, Rational):
            den = mpmath.polyval([mpmath.mpf(c) for c in block.den], s)
            values = [mpmath.polyval([mpmath.mpf(c) for c in block.num], s) / den]
        else:
            n = block.order
            matrix = s * mpmath.eye(n) - mpmath.matrix(block.A.tolist())
            den, inner = mpmath.det(matrix), mpmath.inverse(matrix) * mpmath.matrix(block.B.tolist())
            values = [(mpmath.matrix(block.C.tolist()) * inner)[0, 0] + mpmath.mpf(block.D[0, 0])]
        whole *= den
        for name, value in zip(part.signals, values, strict=True):
            gains[name] += -law.sign * value * mpmath.exp(-s * mpmath.mpf(law.delay))
    return whole * delta(arm, s, Kp=gains["hub_angle"], K1=gains["hub_rate"], K2=gains["root_moment"])


def zeros_in(arm, law, middle, radius, away=0, points=16):
    """Winding number along a circle whose middle is `away` radii off."""
    with mpmath.workdps(90):
        circle = [middle + away * radius + radius * mpmath.expjpi(2 * mpmath.mpf(n) / points) for n in range(points)]
        values = [closed(arm, law, s) for s in circle]
        turned = sum(cmath.phase(complex(b / a)) for a, b in zip(values, [*values[1:], values[0]], strict=True))
    return round(turned / (2 * math.pi))


@pytest.mark.parametrize("name", thinned(LAWS, 5))
def test_each_disc_holds_one_zero_of_the_papers_determinant_and_its_neighbour_none(name):
    law = LAWS[name]
    poles = tfarm.closed_loop_poles(LAB, law, 5)
    discs = poles.certify(18)
    assert len(discs) == poles.moving.size > 3
    for disc, pole in zip(discs, poles.moving, strict=True):
        with mpmath.workdps(40):
            middle, radius = mpmath.mpc(disc.re, disc.im), mpmath.mpf(disc.radius)
        assert abs(complex(middle) - pole) < 1e-11 * abs(pole)
        assert zeros_in(LAB, as_law(law), middle, radius) == 1
        assert zeros_in(LAB, as_law(law), middle, radius, away=5) == 0


TIP = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_acceleration": ([0.05], [0.02, 1.0])}, delay=0.002)
INSIDE = Law({"hub_rate": 0.3, "moment@0.35": ([0.2], [0.01, 1.0]), "tip_displacement": 0.1})


@pytest.mark.parametrize(("law", "count"), [(TIP, 5), (INSIDE, 2)], ids=["tip", "inside"])
def test_a_law_on_signals_along_the_link_has_discs_where_one_plus_l_vanishes(law, count):
    """L from the paper's appendix, a step of Newton's method; real poles among fast waves have a disc too."""
    poles = tfarm.closed_loop_poles(LAB, law, count)
    read = [name.partition("@") for name in law.signals]
    G = [tfarm.transfer(LAB, name, x=float(x) if x else None, method="appendix") for name, _, x in read]

    def f(s):
        late = np.exp(-s * law.delay)
        return 1 + late * (law.values(np.array([s]))[:, 0] * np.array([complex(each(s)) for each in G])).sum()

    for disc in poles.certify():
        s = complex(float(disc.re), float(disc.im))
        h = 1e-5 * abs(s)
        assert abs(f(s) * 2 * h / (f(s + h) - f(s - h))) < 1e-9 * abs(s)


def test_a_list_that_misses_a_pole_is_not_proven():
    poles = tfarm.closed_loop_poles(LAB, LAWS["lead"], 5)
    with pytest.raises(CertificationError, match="contains"):
        Poles(poles.loop, poles.values[:-1], poles.box).certify()


def test_the_command_proves_a_law_of_a_file(capsys, tmp_path):
    path = tmp_path / "law.toml"
    path.write_text("[law]\ndelay = 0.002\n[law.hub_angle]\nnum = [2.0, 1.0]\nden = [0.01, 1.0]\n")
    code, out, _ = run(capsys, "poles", "sasaki2012-lab", "--law", str(path), "--count", "4", "--certify", "--json")
    assert code == 0
    assert '"completeness": "certified"' in out


@pytest.mark.parametrize("stiffness", [0.0, 3.0])
@pytest.mark.parametrize("friction", [0.05, 20.0])
def test_friction_at_the_hub_alone_damps_every_mode_that_the_hub_takes_part_in(friction, stiffness):
    """V_t = -b theta_t^2 without damping in the link: poles of the determinant with K1 = b, Kp = k are left of it.

    The free hub's pole at 0 is apart; no gain is needed, and no theorem on the link's damping.
    """
    arm = replace(BARE, hub=Hub(inertia=BARE.hub.inertia, friction=friction, stiffness=stiffness))
    found = stability(Case(arm, HubFeedback()))
    assert (found.word, found.unstable_roots, found.is_known_beyond) == ("stable", 0, True)
    assert (found.poles.values == 0).sum() == (stiffness == 0)
    law = as_law(HubFeedback(K1=friction, Kp=stiffness))
    for pole in found.poles.moving[:: max(1, found.poles.moving.size // 6)]:
        assert pole.real < 0
        assert zeros_in(BARE, law, mpmath.mpc(pole), -pole.real / 9) == 1  # left of the axis, on which roots are cut


def test_without_losses_the_verdict_is_marginal_and_friction_at_a_held_tip_is_stable():
    assert stability(Case(BARE, HubFeedback())).word == "marginal"
    held = replace(BARE, hub=Hub(inertia=0.1, friction=0.5), payload=Payload(mass=math.inf))
    found = stability(Case(held, HubFeedback()))
    assert (found.word, (found.poles.values == 0).any()) == ("stable", False)
