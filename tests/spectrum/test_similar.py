"""The same rig in other units of mass, length and time: tables and damped modes, as dimensional analysis has them."""

import math
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.rigs import some_rig
from tests.shared import thinned
from tests.similar import EITHER, FAST, FREQUENCY, INERTIA, LENGTH, SLOW, TORQUE
from tfarm.errors import ConvergenceError
from tfarm.schema import quantities
from tfarm.spectrum.gains import DEFAULT_DIGITS, angle_unit, check_gains, default_gains, gain_unit, most_gain, rate_unit
from tfarm.spectrum.listing import ListedMode, listed_modes

LAB = tfarm.load("sasaki2012-lab")
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
        assert pytest.approx((same.K1, same.K2), rel=10.0 ** (1 - DEFAULT_DIGITS)) == (law.K1, law.K2)
