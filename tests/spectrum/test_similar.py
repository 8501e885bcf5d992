"""The same rig in other units of mass, length and time: tables, damped modes, and the units of gains."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.rigs import some_rig
from tests.shared import thinned
from tests.shell import answer, run
from tests.similar import EITHER, FAST, FREQUENCY, INERTIA, LENGTH, SLOW, TORQUE, Units
from tfarm import Hub, HubFeedback, Payload
from tfarm.arm.chain import Sampling
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.circle_crossings import stable_windows
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import stability
from tfarm.schema import quantities
from tfarm.spectrum.gains import (
    PAPER_GAINS,
    RATE_SHARE,
    angle_unit,
    check_gains,
    default_gains,
    gain_unit,
    most_gain,
    rate_unit,
    turning_inertia,
)
from tfarm.spectrum.listing import ListedMode, listed_modes
from tfarm.synthesis.design import design

STOCKY, LAB = tfarm.load("stocky-steel"), tfarm.load("sasaki2012-lab")
HEAVY = tfarm.load("quanser-2dsfl")
COUNT = 3


def close(here, there, unit=1.0, rel=1e-10, size=None):
    """Whether numbers are one in both units, to a share of the largest of them or of another size."""
    here, there = np.asarray(here) * unit, np.asarray(there)
    size = abs(there).max(initial=0.0) if size is None else size
    return here.shape == there.shape and bool((abs(here - there) <= rel * size).all())


def differing_tables(here, there, units):
    """What is not the same of two modal tables."""
    turns = 1 / math.sqrt(units.of(INERTIA))  # of a rotation at unit modal mass
    places = np.linspace(0.0, 1.0, 5)
    powers = {
        "natural_frequency": units.of(FREQUENCY),
        "natural_frequency_hz": units.of(FREQUENCY),
        "hub_participation": turns,
        "modal_moment": units.of(TORQUE) * turns,
    }
    same = {name: close(getattr(here, name), getattr(there, name), unit) for name, unit in powers.items()}
    for name, values in here.sensitivity.items():
        same[f"d ln w/d ln {name}"] = close(values, there.sensitivity[name], size=1.0)
    for n, (mine, theirs) in enumerate(zip(here.nodes, there.nodes, strict=True)):
        same[f"nodes of {n}"] = close(mine, theirs, units.of(LENGTH))
    fields = {"shape": units.of(LENGTH) * turns, "rotation": turns, "moment": units.of(TORQUE) * turns}
    fields["shear"] = fields["moment"] / units.of(LENGTH)
    for name, unit in fields.items():
        mine, theirs = (getattr(each, name)(places * each.arm.length) for each in (here, there))
        same[name] = close(mine, theirs, unit)
    return [name for name, is_one in same.items() if not is_one]


def size_of(unit, units):
    """How many times larger the number of an SI unit is in other units of mass, length and time."""
    of = {"rad": 1.0, "m": units.of(LENGTH), "N m": units.of(TORQUE), "kg m^2": units.of(INERTIA)}
    above, _, below = unit.partition("/sqrt(")
    return of[above] / math.sqrt(of[below.removesuffix(")")]) if below else of[above]


@pytest.mark.parametrize("units", [SLOW, FAST], ids=EITHER)
def test_columns_of_modes_have_the_units_of_their_numbers(units):
    """As dimensional analysis has them: a column's numbers change by what its printed unit changes by."""
    here, there = (listed_modes(tfarm.modes(arm, COUNT)).modes for arm in (LAB.elastic, units.arm(LAB).elastic))
    for name in ("hub_participation", "modal_moment", "nodes"):
        unit = size_of(quantities(ListedMode)[name].unit, units)
        mine, theirs = (np.concatenate([np.ravel(getattr(row, name)) for row in rows]) for rows in (here, there))
        assert close(mine, theirs, unit), name


def differing_damped(here, there, units):
    """What is not the same of two lists of damped modes."""
    rate = units.of(FREQUENCY)
    same = {
        "eigenvalues": close(here.eigenvalues, there.eigenvalues, rate),
        "others": close(here.others, there.others, rate),
        "single": close(here.single, there.single, rate),
        "damping ratio": close(here.damping_ratio, there.damping_ratio),
        "box": close(here.box, there.box, rate, 1e-3),  # on one side of one zero or another, and of none here
        "count": (here.count, here.left_out) == (there.count, there.left_out),
    }
    return [name for name, is_one in same.items() if not is_one]


@pytest.mark.parametrize(("units", "seed"), thinned(list(product(EITHER.values(), range(8))), 9))
def test_random_rigs_have_the_same_table(units, seed):
    arm = some_rig(np.random.default_rng([61, seed]), damped=False)
    here, there = (tfarm.modes(each, COUNT) for each in (arm, units.arm(arm)))
    assert differing_tables(here, there, units) == []


DAMPED = [some_rig(np.random.default_rng([62, 2]), damped=True), LAB, HEAVY]  # of the first real zeros meet, slowly


@pytest.mark.parametrize(("arm", "units"), thinned(list(product(DAMPED, EITHER.values())), 2))
def test_damped_rigs_have_the_same_eigenvalues(arm, units):
    try:
        here = tfarm.damped_modes(tfarm.modes(arm, COUNT))
    except ConvergenceError:
        with pytest.raises(ConvergenceError):
            tfarm.damped_modes(tfarm.modes(units.arm(arm), COUNT))
        return
    there = tfarm.damped_modes(tfarm.modes(units.arm(arm), COUNT))
    assert differing_damped(here, there, units) == []
    places = np.linspace(0.0, 1.0, 4)
    for name, unit in (("shape", units.of(LENGTH)), ("rotation", 1.0), ("moment", units.of(TORQUE))):
        mine, theirs = (getattr(each, name)(places * each.undamped.arm.length) for each in (here, there))
        assert close(mine, theirs, unit / math.sqrt(units.of(INERTIA)), 1e-6), name


@pytest.mark.parametrize("units", [SLOW, FAST], ids=EITHER)
def test_gains_are_measured_in_the_arms_own_units(units):
    """J w1 and J w1^2 grow as a torque times a time and a torque do; what is too large for one is for the other."""
    for arm in (LAB, HEAVY):
        other = units.arm(arm)
        for name in ("K1", "K2", "Kp"):
            unit = units.law(arm, tfarm.HubFeedback(**{name: 1.0}))[name]
            assert gain_unit(other, name) == pytest.approx(gain_unit(arm, name) * unit, rel=1e-12)
            assert most_gain(other, name) == 1e9 * gain_unit(other, name)
            check_gains(other, tfarm.HubFeedback(**{name: -0.999 * most_gain(other, name)}))
            with pytest.raises(tfarm.ParameterError, match=name):
                check_gains(other, tfarm.HubFeedback(**{name: -1.001 * most_gain(other, name)}))
        w1 = float(tfarm.modes(arm.elastic, 1).natural_frequency[-1])
        assert angle_unit(arm) == pytest.approx(rate_unit(arm) * w1, rel=1e-15)
        law, same = units.law(arm, default_gains(arm)), default_gains(other)
        assert pytest.approx((same.K1, same.K2), rel=1e-2) == (law.K1, law.K2)


EPS = 2.0**-52
LARGE = Units(1e6, 100.0, 100.0)  # of the same material, a hundred times as long


def test_the_papers_arms_keep_the_papers_gains():
    """The misprinted density too, though its J w1 is twice as large; any other arm has its own."""
    papers = [tfarm.load(name) for name in tfarm.presets() if name.startswith("sasaki")]
    assert len(papers) == 3
    assert {default_gains(arm) for arm in papers} == {PAPER_GAINS}
    rounded = f"{RATE_SHARE * rate_unit(LAB):.3g}"
    assert float(rounded) == PAPER_GAINS.K1  # by the rule for every arm as well
    renamed = replace(LAB, name="mine", assumptions=())
    assert default_gains(renamed) == PAPER_GAINS
    assert default_gains(replace(LAB, hub=Hub(inertia=10.0))).K1 > 1.0


def test_a_gain_is_too_large_for_an_arm_and_not_by_itself():
    """K1 = 2e9 N m s/rad is ordinary for an arm of J w1 = 5e9; LAB has a limit of its own, which is reported."""
    large, time = LARGE.arm(LAB), LARGE.time
    assert rate_unit(large) > 1e9
    law = HubFeedback(K1=0.5 * rate_unit(large), K2=0.3, Kp=0.1 * angle_unit(large))
    small = HubFeedback(K1=0.5 * rate_unit(LAB), K2=0.3, Kp=0.1 * angle_unit(LAB))
    here, there = (tfarm.closed_loop_poles(*each, 3).values for each in ((LAB, small), (large, law)))
    assert there * time == pytest.approx(here, rel=1e-9)
    for name, unit in (("K1", rate_unit(LAB)), ("Kp", angle_unit(LAB))):
        with pytest.raises(ParameterError, match=rf"{name} = .*for this arm at most 1e\+09 times J w1"):
            tfarm.margins(LAB, HubFeedback(**{name: 2e9 * unit}))
        with pytest.raises(ParameterError, match="for this arm"):
            sampled_verdict(Case(LAB, HubFeedback(**{name: 2e9 * unit})))


def test_windows_and_designs_of_a_large_arm_are_those_of_a_similar_small_one():
    """Nothing on the way compares a gain with a number: K1 goes beyond 1e9 N m s/rad here, continuous and sampled."""
    large, time, inertia = LARGE.arm(LAB), LARGE.time, LARGE.of(INERTIA)
    slow = Chain(sampling=Sampling(period=0.01 * time))
    chains, arms = (Chain(), slow), (LAB, large)
    laws = [HubFeedback(K1=2 * rate_unit(arm), K2=0.3) for arm in arms]
    ends = [stable_windows(sampled_loop(Case(*each), count=4), "K1") for each in zip(arms, laws, chains, strict=True)]
    assert np.ravel(ends[1]) * time / inertia == pytest.approx(np.ravel(ends[0]), rel=1e-6)
    found = [design(arm, "damping", chain=chain) for arm, chain in zip(arms, chains, strict=True)]
    assert found[1].law.K1 * time / inertia == pytest.approx(found[0].law.K1, rel=1e-3)
    assert found[1].value == pytest.approx(found[0].value, rel=1e-6)


def test_parts_that_do_not_turn_are_left_out():
    """J of an arm whose tip is pinned is that of hub and link; a locked hub leaves the link."""
    link = LAB.link
    beam = link.rhoA * link.length**3 / 3 + link.rhoI * link.length
    held = replace(LAB, payload=Payload(mass=math.inf))
    assert turning_inertia(held) == pytest.approx(LAB.hub.inertia + beam, rel=8 * EPS)
    assert turning_inertia(replace(LAB, hub=Hub(inertia=math.inf))) == pytest.approx(beam, rel=8 * EPS)
    assert turning_inertia(STOCKY) == STOCKY.total_inertia


def test_a_hub_without_inertia_has_no_moment_gain(capsys, tmp_path):
    """A K2 would be an algebraic loop; so K2 = 0 is the default of every command for such an arm."""
    pin = replace(LAB, hub=Hub(inertia=0.0), name="pin")
    assert default_gains(pin).K2 == 0.0
    file = tmp_path / "pin.toml"
    file.write_text(tfarm.arm.to_toml(pin), encoding="utf-8")
    found = answer(capsys, "margins", str(file))
    assert (found["K1"], found["K2"]) == (default_gains(pin).K1, 0.0)
    assert stability(Case(pin, HubFeedback(K1=found["K1"]))).word == found["verdict"]


VERBS = [
    ["poles"], ["margins"], ["sampled", "--modes", "2"], ["simulate", "--duration", "0.05"],
    ["locus", "--vary", "K1", "--from", "1", "--to", "2", "--points", "3", "--branches", "2"],
]  # fmt: skip


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb[0])
def test_gains_that_were_not_given_are_stated(capsys, verb):
    _, out, _ = run(capsys, verb[0], "stocky-steel", *verb[1:])
    assert "by default K1 = 77.7 N m s/rad (0.00642 J w1 of this arm) and K2 = 0.3\n" in out
    assert default_gains(STOCKY) == HubFeedback(K1=77.7, K2=0.3)


def test_gains_that_were_given_are_not(capsys):
    _, out, _ = run(capsys, "margins", "sasaki2012", "--K1", "1")
    assert "by default K2 = 0.3\n" in out
    _, out, _ = run(capsys, "margins", "sasaki2012", "--K1", "1", "--K2", "0")
    assert "by default" not in out
    found = answer(capsys, "margins", "sasaki2012", "--K2", "0")
    assert found["default_gains"] == ["K1"]
    assert found["default_gains_in_words"] == "K1 = 0.3 N m s/rad (as in the paper)"
