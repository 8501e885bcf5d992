"""One law for several arms: each held by a Galerkin model, none inside the box worse, and no other gains better."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shell import answer, refused, run
from tests.synthesis.held_loop import HeldLoop
from tfarm import HubFeedback
from tfarm.arm import Hub
from tfarm.synthesis import worst_case
from tfarm.synthesis.design import design
from tfarm.synthesis.judge import RESERVE
from tfarm.synthesis.worst_case import ArmBox, arms_of, for_the_worst, vary_arm

LAB, T = tfarm.load("sasaki2012-lab"), 0.01
SHORT = replace(LAB, link=replace(LAB.link, length=0.8 * LAB.length), name="short")
MASSES = (0.1, 0.5)  # kg


@pytest.fixture(scope="module")
def found():
    """With a few arms tried inside: the test asks at seven of them itself."""
    with pytest.MonkeyPatch.context() as fewer:
        fewer.setattr(worst_case, "ARMS_TRIED", 6)
        return design(LAB, "damping", K1=(0.1, 30.0), K2=(-0.6, 0.95), also=[SHORT], ranges={"payload.mass": MASSES})


def test_a_further_search_is_given_what_the_one_before_found():
    """Score 1 at masses between the ends, 0 at these, until an arm inside is among the arms: then 1 everywhere."""
    given, box = [], ArmBox(LAB, {"payload.mass": MASSES})

    def find(arms, before, effort):
        given.append((len(arms), before, effort))
        return len(arms)

    def score_on(count, arm):
        return 1.0 if count > 3 or arm.payload.mass not in (0.0, *MASSES) else 0.0

    found, named, _ = for_the_worst(arms_of(LAB, (), box), box, find, score_on, lambda _: None)
    assert given == [(3, None, "sketch"), (4, 3, "sketch"), (4, 4, "whole")]
    assert (found, len(named)) == (4, 4)


def test_every_arm_is_held_and_damped_as_by_another_model(found):
    ends = [LAB.with_numbers(payload_mass=mass) for mass in MASSES]
    for each, arm in zip(found.arms, (LAB, SHORT, *ends), strict=False):
        held = HeldLoop(arm, T)
        assert held.damping(found.law, 2, 150) == pytest.approx(each.value, rel=1e-4)
        # on the edge of the reserve a radius is 1, and the Ritz model's is right to 1e-6
        assert max(held.radius(found.law.times(share)) for share in (1 / RESERVE, 1.0, RESERVE)) < 1 + 1e-6
        assert each.sampled.is_stable
        assert each.verdict.is_stable
    assert found.value == min(each.value for each in found.arms)
    # no arm inside the box is worse
    for mass in np.linspace(*MASSES, 9)[1:-1]:
        inside = HeldLoop(LAB.with_numbers(payload_mass=mass), T).damping(found.law, 2, 150)
        assert inside >= found.value * (1 - 0.02)


@pytest.mark.survey
def test_no_other_gains_serve_all_arms_better(found):
    """Nor those that are best for one of them."""
    alone = design(LAB, "damping", K1=(0.1, 30.0), K2=(-0.6, 0.95)).law
    models = [HeldLoop(arm, T) for arm in (LAB, SHORT, *(LAB.with_numbers(payload_mass=mass) for mass in MASSES))]
    rng = np.random.default_rng(4)
    K1, K2 = found.law.K1 * rng.uniform(0.8, 1.2, 30), found.law.K2 + rng.uniform(-0.1, 0.1, 30)
    for law in [alone, *(HubFeedback(K1=a, K2=b) for a, b in zip(K1, K2, strict=True))]:
        shares = (1 / RESERVE, 1.0, RESERVE)
        if all(model.radius(law.times(share)) < 1.0 for model in models for share in shares):
            values = (model.damping(law, 2, 100) for model in models)
            assert any(value <= found.value * (1 + 1e-3) for value in values)


def test_a_worst_arm_in_the_middle_of_a_box_is_found():
    """Its place is known: the badness is greatest there, and less at every corner."""
    box = ArmBox(LAB, {"payload.mass": (0.0, 1.0), "hub.friction": (0.01, 1.0)})

    def badness(arm):
        return -(((arm.payload.mass - 0.37) / 1.0) ** 2) - (np.log10(arm.hub.friction / 0.08) / 2) ** 2

    worst, score, tried = box.worst(badness)
    assert worst.arm.payload.mass == pytest.approx(0.37, abs=0.1)
    assert worst.arm.hub.friction == pytest.approx(0.08, rel=0.6)
    assert score == badness(worst.arm) > max(badness(each.arm) for each in box.corners)
    assert tried == 24 + 3 * 4


@pytest.mark.survey
def test_a_law_for_structures_serves_both_ends_too():
    both = design(LAB, "margin", structure="PD", ranges={"payload.mass": MASSES}, Kp=5.0)
    assert [each.numbers for each in both.arms[:3]] == [{}, {"payload.mass": 0.1}, {"payload.mass": 0.5}]
    assert both.value == min(each.value for each in both.arms)
    assert "no proof over the box" in both.worst_case.sentence(3)
    for each in both.arms:
        arm = vary_arm(LAB, "payload.mass", each.numbers.get("payload.mass", 0.0))
        assert HeldLoop(arm, T).radius(HubFeedback(Kp=5.0, K1=both.coefficients["K1"])) < 1.0


def test_a_number_is_named_as_in_the_file_or_as_of_a_locus():
    assert (
        vary_arm(LAB, "payload.mass", 0.2) == vary_arm(LAB, "payload_mass", 0.2) == LAB.with_numbers(payload_mass=0.2)
    )
    assert vary_arm(LAB, "hub.friction", 0.3).hub == Hub(inertia=LAB.hub.inertia, friction=0.3)
    assert ArmBox(LAB, {"link.damping": (1e-5, 1e-3)}).at(np.array([0.5])).arm.damping == pytest.approx(1e-4)
    assert ArmBox(LAB, {"payload.mass": (0.1, 0.5)}).at(np.array([0.5])).arm.payload.mass == pytest.approx(0.3)


NARROW = ("sasaki2012-lab", "--K1", "0.1,2", "--K2=-0.1,0.1")


def test_the_answer_names_every_arm(capsys, monkeypatch):
    monkeypatch.setattr(worst_case, "ARMS_TRIED", 4)  # inside: a worse one is not searched here
    code, out, err = run(capsys, "design", *NARROW, "--modes", "1", "--range", "payload.mass=0.0,0.2")
    assert (code, err) == (0, "")
    assert "payload.mass = 0.2" in out
    assert "no proof over the box" in " ".join(out.split())


def test_a_design_of_one_arm_has_no_worst_case_and_the_given_bounds(capsys):
    found = answer(capsys, "design", *NARROW)
    (own,) = found["arms"]
    assert (own["name"], own["value"]) == ("sasaki2012-lab", found["value"])
    assert own["sampled"] == "stable when sampled every 10 ms"
    assert (found["worst_arm"], found["arms_tried_inside"], found["worst_case_in_words"]) == ("sasaki2012-lab", 0, "")
    assert found["designed_for"] == "sampled"
    rows = {row["name"]: row for row in found["coefficients"]}
    assert rows["K1"]["optimum"] == "none: search cut off at the bound"
    assert rows["Kp"]["optimum"] == "fixed at 0"
    assert {name: row["bounds"] for name, row in rows.items()} == {"K1": [0.1, 2.0], "K2": [-0.1, 0.1], "Kp": None}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--range", "payload.mas=0.1,0.5"], "payload.mass"),
        (["--range", "payload.mass=0.5,0.1"], "the lower number first"),
        (["--range", "payload.mass=-1,0.1"], "a payload mass is zero, positive"),
        (["--range", "motor.resistance=1,2"], "known are"),
        ([f"--range=payload.{n}=0.1,0.2" for n in ("mass", "inertia", "offset")] + ["--range=hub.radius=0,1",
          "--range=hub.friction=0,1"], "at most 4"),
        (["--also", "quanser-srvms"], "no such preset"),
    ],
)  # fmt: skip
def test_invalid_ranges_are_refused_in_one_line(capsys, arguments, words):
    assert words in refused(capsys, "design", "sasaki2012-lab", *arguments)
