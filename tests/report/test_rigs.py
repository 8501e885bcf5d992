"""Pages of rigs: every part is in a table, hub-locked frequencies are listed with the free ones."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import tfarm
from tfarm import plots
from tfarm.arm import Gauge, written_unit
from tfarm.dsp import Chain
from tfarm.loop.circle_crossings import sampled_map
from tfarm.report.overview import summary
from tfarm.report.page import ArmReport, has_loop, sign_words
from tfarm.report.response_sections import arm_section, assumptions_section, locked_table
from tfarm.report.sampled_section import why_not

RIGS = {arm.name: arm for arm in map(tfarm.load, ("tests/rigs/bench-rig.toml", "quanser-2dsfl", "quanser-flexlink"))}


def values_of(table):
    columns = {column.key: column.values for column in table.columns}
    return dict(zip(columns.get("quantity") or columns["key"], columns["value"], strict=True))


@pytest.mark.parametrize("name", RIGS)
def test_every_number_of_the_file_is_in_the_table_of_parameters(name):
    arm = RIGS[name]
    _, given, _ = arm_section(ArmReport(arm, Chain())).blocks
    shown = values_of(given)
    numbers = [getattr(link, key) for link in arm.links for key in ("length", "density", "youngs_modulus", "damping")]
    numbers += [arm.hub.inertia, arm.hub.friction, arm.payload.mass, arm.payload.inertia]
    numbers += [each.mass for each in arm.attachments] + [arm.payload.offset or 0.0, arm.hub.radius or 0.0]
    if arm.motor is not None:
        numbers += [arm.motor.resistance, arm.motor.torque_constant, arm.motor.gear_ratio, arm.motor.rotor_inertia]
    assert set(numbers) - {0.0} <= set(shown.values())


def test_the_page_has_the_gauge_s_place_and_the_shear_cut_off():
    """The second pair of waves travels in Timoshenko's theory alone (tests/spectrum/test_tables.py)."""
    rig = RIGS["bench-rig"]
    for arm in (rig, replace(rig, gauge=Gauge(x=0.013)), rig.under("rayleigh")):
        section = arm_section(ArmReport(arm, Chain()))
        _, given, derived = section.blocks
        assert values_of(given).get("gauge.x", 0.0) == arm.gauge.x
        labels = [fact.label for fact in section.facts]
        assert any("shear cut-off" in each for each in labels) == (arm.theory == "timoshenko")
        assert ("no shear cut-off" in derived.caption) == (arm.theory == "rayleigh")


def test_free_and_locked_frequencies_are_those_of_the_commands():
    arm = RIGS["quanser-2dsfl"]
    columns = {each.key: list(each.values) for each in locked_table(ArmReport(arm, Chain()), 6).columns}
    assert columns["index"] == list(range(1, 7))
    assert columns["natural_frequency_rad_s"] == tfarm.modes(arm, 6).natural_frequency[1:].tolist()
    held = tfarm.modes(arm.with_numbers(hub_inertia=math.inf), 6)
    assert columns["hub_locked_rad_s"] == held.natural_frequency.tolist()


def test_words_of_a_rig_are_true_of_it():
    voltage, bench = RIGS["quanser-flexlink"], RIGS["bench-rig"]
    assert "the motor's voltage [V]" in sign_words(voltage)
    assert "(J − I_h)/J" not in sign_words(voltage) + sign_words(bench)
    assert [written_unit(gain, voltage) for gain in ("K1", "K2")] == [" V s/rad", " V/(N m)"]
    assert "2 segments" in summary(ArmReport(bench, Chain()))
    assert ", damped" in summary(ArmReport(voltage, Chain()))
    assert has_loop(voltage)
    assert "C = 0" in why_not(voltage, Chain())
    assert not why_not(bench, Chain())
    (section,) = assumptions_section(ArmReport(bench, Chain())).words
    assert "this is a rig" in section


@pytest.mark.parametrize("name", ["bench-rig", "sasaki2012-lab"])
def test_no_line_of_energy_where_it_is_no_argument(name):
    """The sampled map of a rig has none of the arm's line K2 = 1, below which C = 0 would be proven."""
    arm = RIGS.get(name) or tfarm.load(name)
    law = tfarm.default_gains(arm)
    K1, K2 = law.K1 * np.geomspace(0.5, 2.0, 3), np.linspace(-1.0, 2.0, 4)
    sampled = sampled_map(tfarm.sampled(arm, law).verdict.loop, K1, K2)
    ax = Figure().subplots()
    plots.gain_regions(tfarm.map(arm, K1, K2), sampled, ax=ax)
    words = " ".join(ax.get_legend_handles_labels()[1])
    assert ("proven by energy" in words) == arm.is_uniform
