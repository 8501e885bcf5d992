"""Verdicts and proven discs: against a Legendre-Ritz model, Lyapunov's theorem and the paper's determinant."""

import cmath
import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.optimize import brentq

import tfarm
from tests.loop.agreement import loops, some_free_arm
from tests.loop.arms import held, held_stiffness, hub_units, loop_of, some_loop, verdict_of, window_arm
from tests.loop.ritz_loop import RitzLoop
from tests.shared import thinned
from tests.shell import run
from tests.spectrum.independent import delta
from tfarm import Arm, Hub, HubFeedback, Law, Link, Payload, Section
from tfarm.arm.blocks import Rational
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.exact.characteristic import Analytic
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.loop.stability import band_of_loop, hub_shares, is_controllable, is_quiet
from tfarm.loop.theorem import lyapunov
from tfarm.spectrum.box import argument_change

LAB, BARE, STOCKY = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "stocky-steel"))


def test_map_count_and_model_agree_on_random_loops() -> None:
    """`python -m tests.loop.agreement 2000` for more, of three times as many arms."""
    found = list(loops(6, 4, arms=4))
    assert [each.words for each in found if each.is_wrong] == []
    assert len(found) > 6
    assert {-1, 0, 1} <= {each.figures["unstable"] for each in found}


THEORY = {
    "stable": [(0.3, 0.3, 0.0), (0.3, 0.999, 0.0), (0.3, -40.0, 2.0)],
    "marginal": [(0.3, 1.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.0), (0.0, 0.3, 5.0)],
    "unstable": [(0.3, 1.001, 0.0), (-1e-3, 0.3, 0.0), (0.3, 0.3, -1e-3), (-0.3, 1.5, 0.0)],
}


@pytest.mark.parametrize(("verdict", "gains"), [(word, each) for word in THEORY for each in THEORY[word]])
def test_verdicts_at_no_damping_are_those_of_theory(verdict, gains) -> None:
    K1, K2, _ = gains
    found = verdict_of(BARE, HubFeedback(**dict(zip(("K1", "K2", "Kp"), gains, strict=True))))
    assert found.word == verdict
    assert found.unstable_roots_infinite == ((K1 > 0 and K2 > 1) or (K1 < 0 and K2 < 1))
    assert (found.unstable_roots > 0, found.is_stable) == (verdict == "unstable", verdict == "stable")


@pytest.mark.parametrize("K1", [1e-7, 0.3, 1e4])
def test_what_lyapunov_proves_is_stable_however_slowly_it_decays(K1) -> None:
    """Of a stocky arm some modes decay by less than 1e-11 of their frequency, too little for double precision."""
    found = verdict_of(STOCKY, HubFeedback(K1=K1, K2=0.3))
    assert found.word == "stable"


def test_the_word_of_a_verdict_has_its_former_name_too() -> None:
    found = verdict_of(BARE, HubFeedback(K1=0.3))
    with pytest.warns(DeprecationWarning, match=r"it is Stability\.word"):
        assert found.verdict == found.word == "stable"
    assert repr(found).startswith("Stability(word='stable'")


HELD_TIPS = (Payload(mass=math.inf), Payload(inertia=math.inf), Payload(mass=math.inf, inertia=math.inf))


@pytest.mark.parametrize("payload", HELD_TIPS)
def test_held_tips_have_verdicts_too(payload) -> None:
    arm = replace(LAB, payload=payload)
    model = RitzLoop(arm, 12)
    for law in (HubFeedback(K1=0.3, K2=0.3), HubFeedback(K1=-0.3, K2=0.3), HubFeedback(K1=0.3, K2=1.3)):
        rightmost = model.rightmost(law)
        found = verdict_of(arm, law)
        assert found.word == ("stable" if rightmost < 0 else "unstable")
        assert found.poles.spectral_abscissa == pytest.approx(rightmost, rel=1e-6)
        assert found.unstable_roots == int((model.eigenvalues(law).real > 0).sum())


def exceptional() -> Arm:
    """An arm one of whose modes the hub does not feel: L/h near 2.6."""

    def arm(depth: float) -> Arm:
        section = Section.rectangle(width=0.1, depth=depth)
        return Arm(link=replace(BARE.link, section=section), hub=Hub(inertia=0.1))

    def participation(depth: float) -> float:
        return float(tfarm.modes(arm(depth), 3).hub_participation[3])

    return arm(brentq(participation, 1 / 2.6, 1 / 2.6238, xtol=1e-15, rtol=1e-15))


def test_a_mode_without_hub_participation_stays_undamped_under_any_law() -> None:
    arm = exceptional()
    assert not is_controllable(arm, 3e4)
    assert is_controllable(arm, 2e4)
    found = verdict_of(arm, HubFeedback(K1=20.0, K2=0.3))
    assert found.word == "marginal"
    assert found.poles.spectral_abscissa > -1e-6
    heavy, light = (replace(BARE, hub=Hub(inertia=inertia)) for inertia in (1e6, 1e-6))
    assert is_controllable(heavy, 1e4)
    assert is_controllable(light, 1e4)


def test_hub_shares_of_a_slender_beam_are_those_of_euler_bernoulli_modes() -> None:
    """Pinned-free and clamped-free Euler-Bernoulli modes: slope sqrt(2/m) k and curvature 2 k^2/sqrt m at the root."""
    section = Section.rectangle(width=0.02, depth=0.001)
    slender = replace(BARE, link=replace(BARE.link, section=section))
    top = float(tfarm.modes(slender, 9).natural_frequency[-1])
    for inertia, expected in ((1e-9, [2**0.5, 0.0]), (1e3, [0.0, 2.0])):
        shares = hub_shares(replace(slender, hub=Hub(inertia=inertia)), top)
        assert shares[:, 3:] == pytest.approx(np.tile(expected, (shares.shape[1] - 3, 1)).T, abs=0.01)


def test_a_pole_on_the_axis_to_working_precision_is_refused_with_its_reason() -> None:
    edge = 1.0305375542174282
    with pytest.raises(ConvergenceError, match="on the imaginary axis to working precision"):
        verdict_of(LAB, HubFeedback(K1=0.3, K2=edge))
    assert verdict_of(LAB, HubFeedback(K1=0.3, K2=edge * (1 - 1e-9))).word == "stable"
    assert verdict_of(LAB, HubFeedback(K1=0.3, K2=edge * (1 + 1e-9))).word == "unstable"
    assert verdict_of(LAB, HubFeedback(K2=0.3)).word == "marginal"


def test_beyond_the_band_the_loop_is_quiet_far_up_between_shear_resonances_too() -> None:
    """|L| over nine decades, with points as dense as the waves along the arm need."""
    rng = np.random.default_rng(8)
    for arm in (LAB, window_arm(), some_free_arm(rng, True), some_free_arm(rng, True)):
        inertia, omega = hub_units(arm)
        loop = loop_of(arm, HubFeedback(K1=inertia * omega, K2=-7.0))
        band, quiet = band_of_loop(loop)
        assert quiet
        shear = math.pi / arm.link.length * math.sqrt(arm.link.kGA / arm.link.rhoA)
        close = np.arange(band, band + 300 * shear, shear / 300)
        assert abs(loop.loop_function(1j * close)).max() < 0.5
        assert abs(loop.loop_function(1j * np.geomspace(band, 1e9 * band, 4000))).max() < 0.5


def test_a_tail_that_needs_too_many_modes_is_reported() -> None:
    thin = Link.isotropic(
        length=1.0, density=2700.0, youngs_modulus=7e10, poissons_ratio=0.3,
        section=Section.rectangle(width=0.1, depth=0.002), damping=1e-12,
    )  # fmt: skip
    found = verdict_of(Arm(link=thin, hub=Hub(inertia=1e-4)), HubFeedback(K1=0.001, K2=0.3), band=200.0)
    assert "not determined beyond" in found.tail
    assert not is_quiet(found.loop, 200.0)


def test_a_turn_that_is_no_number_is_refused() -> None:
    """Where 1 + L cannot be evaluated nothing is counted: a NaN is not a slow turn."""

    def unknown(s):
        return Analytic(np.where(abs(s - 2j) < 0.5, np.nan, 1 + 1.0 / (s + 1.0)), 0 * s, 0 * s)

    path = 1j * np.linspace(0.0, 4.0, 50)
    with pytest.raises(ConvergenceError, match="a zero lies on the contour"):
        argument_change(unknown, path, 4.0)
    assert abs(argument_change(unknown, path[path.imag < 1.4], 4.0)) < 1.0


SPRING = 3.0  # N m/rad
HELD = replace(LAB, hub=Hub(inertia=0.1, stiffness=SPRING, friction=0.1))
PUSHES = Law({"hub_angle": ([-SPRING], [1e-2, 1.0])})


@pytest.mark.parametrize(("more", "verdict"), [(0.0, "marginal"), (1e-6, "unstable"), (-1e-6, "stable")])
def test_a_law_as_stiff_as_the_spring_has_its_pole_at_0_and_none_next_to_it(more, verdict):
    for law in (HubFeedback(Kp=-SPRING * (1 + more)), PUSHES.with_number("gain", 1 + more)):
        assert tfarm.margins(HELD, law).stability.word == verdict
        poles = tfarm.closed_loop_poles(HELD, law, 3)
        assert ((poles.values == 0).sum(), poles.unstable) == (more == 0, more > 0)


def test_without_losses_two_poles_meet_there():
    arm, feedback = replace(LAB.elastic, hub=Hub(inertia=0.1, stiffness=SPRING)), HubFeedback(Kp=-SPRING)
    assert (tfarm.closed_loop_poles(arm, feedback, 4).values == 0).sum() == 2
    assert verdict_of(arm, feedback).word == "marginal"


def test_a_map_may_have_it_among_its_points():
    x, y = np.linspace(0, 2, 5), np.array([0.5, 0.8, 1.0])
    found = tfarm.map(HELD, x, y, law=PUSHES, vary=("gain", "hub_angle"))
    product = np.outer(y, x)
    clear = abs(product - 1) > 1e-9
    np.testing.assert_array_equal(found.unstable[clear], (product > 1)[clear])


def test_near_it_a_sampled_loop_has_a_delay_margin():
    assert tfarm.sampled(HELD, PUSHES.with_number("gain", 1 - 1e-11)).delay_margin.is_bound
    for less in (1e-13, 1e-14, 0.0):  # rounding decides on which side of the circle it is, and is no error
        assert tfarm.sampled(HELD, PUSHES.with_number("gain", 1 - less)).delay_margin.samples >= 0


def law(K1=0.3, K2=0.3, Kp=0.0):
    return HubFeedback(K1=K1, K2=K2, Kp=Kp)


def unstable(arm, feedback, count=8):
    return closed_loop_poles(arm, feedback, count).unstable


def test_without_K1_V_is_constant() -> None:
    found = lyapunov(loop_of(BARE, law(K1=0.0)))
    assert (found.proven, found.kind, found.a1_over_a2) == (True, "conserved", 0.7)
    poles = closed_loop_poles(BARE, law(K1=0.0), 8)
    assert abs(poles.values.real).max() < 1e-12 * abs(poles.values).max()


@pytest.mark.parametrize(
    ("arm", "feedback", "words"),
    [
        (BARE, law(K1=-0.1), "K1 = -0.1 supplies energy"),
        (BARE, law(K2=1.0), "hub alone"),
        (BARE, law(K2=1.5), "1 - K2 = -0.5 is negative"),
        (BARE, law(Kp=-2.0), "Kp = -2 is below"),
        (LAB, law(K2=0.1), "gauge signal has no term in the damping"),
        (LAB, law(K2=-0.1), "gauge signal has no term in the damping"),
    ],
)
def test_where_no_weights_exist(arm, feedback, words: str) -> None:
    found = lyapunov(loop_of(arm, feedback))
    assert (found.proven, found.a1_over_a2, found.kind) == (False, None, "unproven")
    assert words in found.reason


@pytest.mark.parametrize("seed", thinned(range(4), 2))
def test_at_zero_damping_proven_is_stable_and_unproven_unstable(seed: int) -> None:
    """On random arms, payloads and tips, off the edges K1 = 0 and K2 = 1 of the region."""
    rng, seen = np.random.default_rng(seed), []
    while len(seen) < 12:
        arm, feedback = some_loop(rng, damping=0.0)
        if feedback.K1:
            proven = lyapunov(loop_of(arm, feedback)).proven
            seen.append(proven)
            assert proven == (unstable(arm, feedback, 6) == 0), (arm, feedback)
    assert 0 < sum(seen) < len(seen)


def test_a_negative_spring_is_proven_up_to_the_stiffness_of_a_held_tip() -> None:
    arm, K2 = held(0.0), 0.4
    edge = -(1 - K2) * held_stiffness(arm)
    for Kp, proven in ((edge * (1 - 1e-9), True), (edge * (1 + 1e-9), False)):
        assert lyapunov(loop_of(arm, law(K2=K2, Kp=Kp))).proven is proven
    assert unstable(arm, law(K2=K2, Kp=0.999 * edge)) == 0
    assert unstable(arm, law(K2=K2, Kp=1.001 * edge)) == 1


@pytest.mark.parametrize("seed", thinned(range(3), 2))
def test_without_K2_damping_does_no_harm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(6):
        arm, drawn = some_loop(rng)
        feedback = HubFeedback(K1=abs(drawn.K1), Kp=abs(drawn.Kp))
        assert lyapunov(loop_of(arm, feedback)).proven
        assert unstable(arm, feedback, 6) == 0


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
    poles = tfarm.closed_loop_poles(LAB, LAWS[name], 5)
    law, discs = poles.loop.law, poles.certify(18)
    assert len(discs) == poles.nonzero.size > 3
    for disc, pole in zip(discs, poles.nonzero, strict=True):
        with mpmath.workdps(40):
            middle, radius = mpmath.mpc(disc.re, disc.im), mpmath.mpf(disc.radius)
        assert abs(complex(middle) - pole) < 1e-11 * abs(pole)
        assert zeros_in(LAB, law, middle, radius) == 1
        assert zeros_in(LAB, law, middle, radius, away=5) == 0


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
    found = verdict_of(arm, HubFeedback())
    assert (found.word, found.unstable_roots, found.is_known_beyond) == ("stable", 0, True)
    assert (found.poles.values == 0).sum() == (stiffness == 0)
    law = loop_of(BARE, HubFeedback(K1=friction, Kp=stiffness)).law
    for pole in found.poles.nonzero[:: max(1, found.poles.nonzero.size // 6)]:
        assert pole.real < 0
        assert zeros_in(BARE, law, mpmath.mpc(pole), -pole.real / 9) == 1  # left of the axis, on which roots are cut


def test_friction_at_a_held_tip_is_stable():
    held = replace(BARE, hub=Hub(inertia=0.1, friction=0.5), payload=Payload(mass=math.inf))
    found = verdict_of(held, HubFeedback())
    assert (found.word, (found.poles.values == 0).any()) == ("stable", False)
