"""The records of the chain, and the TOML tables that fill them: defaults are ideal, bad input is named in one line."""

import math
import tomllib

import numpy as np
import pytest

import tfarm
from tfarm.arm import to_toml
from tfarm.arm.chain import chain_of_tables, file_text
from tfarm.dsp import Actuator, Chain, Converters, ReferenceShaping, Sampling, Slew, load_chain
from tfarm.dsp.kernel import quantise
from tfarm.errors import ParameterError

ARM = tfarm.load("sasaki2012-lab")
LAB = to_toml(ARM)
LOOP = """
[sampling]
period = 0.005
delay_samples = 0.7
antialias_corner = 300.0
[converters]
encoder_counts = 20000
hub_rate = "difference"
rate_filter = 120.0
moment_bits = 12
moment_range = 20.0
torque_bits = 14
torque_range = 10.0
arithmetic = "float32"
[actuator]
torque_limit = 6.0
motor_constant = 0.8
hub_damping = 0.05
[slew]
travel = 0.5
rise_time = 0.8
reading = "total"
[reference]
profile = "s-curve"
shaper = "EI"
modes = 3
"""


def test_a_chain_is_ideal_by_default():
    chain = load_chain("sasaki2012")
    assert chain == Chain()
    assert (chain.sampling.period, chain.sampling.delay_samples) == (0.01, 0.0)
    assert (chain.slew.travel_of(1.0), chain.slew.rise_time, chain.slew.reading) == (1.15, 1.0, "vibration")
    assert chain.is_linear
    assert Converters(encoder_counts=2**31).encoder_counts == 2**31  # as far as 32 bits count
    assert math.isinf(chain.actuator.torque_limit)


def test_one_file_may_hold_the_arm_and_its_loop(tmp_path):
    file = tmp_path / "bench.toml"
    file.write_text(LAB + LOOP, encoding="utf-8")
    assert tfarm.load(str(file)) == ARM
    chain = load_chain(str(file))
    assert chain == Chain(
        sampling=Sampling(period=0.005, delay_samples=0.7, antialias_corner=300.0),
        converters=Converters(
            encoder_counts=20000, hub_rate="difference", rate_filter=120.0, moment_bits=12, moment_range=20.0,
            torque_bits=14, torque_range=10.0, arithmetic="float32",
        ),
        actuator=Actuator(torque_limit=6.0, motor_constant=0.8, hub_damping=0.05),
        slew=Slew(travel=0.5, rise_time=0.8, reading="total"),
        reference=ReferenceShaping(profile="s-curve", shaper="EI", modes=3),
    )  # fmt: skip
    alone = tmp_path / "loop.toml"
    alone.write_text(LOOP, encoding="utf-8")
    assert load_chain(str(alone)) == chain


def test_an_arm_still_refuses_other_tables(tmp_path):
    file = tmp_path / "bench.toml"
    file.write_text(LAB + "[samplings]\nperiod = 0.01\n", encoding="utf-8")
    with pytest.raises(ParameterError, match="samplings"):
        tfarm.load(str(file))
    with pytest.raises(ParameterError, match='did you mean "sampling"'):
        load_chain(str(file))


BAD = [
    ("sampling", {"period": 0.0}, "sampling.period = 0.0: a sampling period is a positive"),
    ("sampling", {"period": True}, "sampling.period = true"),
    ("sampling", {"delay_samples": -1.0}, "sampling.delay_samples = -1.0: a computational delay is zero or positive"),
    ("sampling", {"antialias_corner": 0.0}, "positive in rad/s, or inf"),
    ("sampling", {"perod": 0.01}, 'did you mean "period"'),
    ("converters", {"moment_bits": 0, "moment_range": 1.0}, "moment_bits = 0: a whole number of bits from 2 to 32"),
    ("converters", {"torque_bits": 12}, "converters.torque_range = None: 12 bits need a range"),
    ("converters", {"torque_range": -3.0}, "the range +-R of a converter"),
    ("converters", {"encoder_counts": 2**31 + 1}, "counts a revolution from 2"),
    ("converters", {"hub_rate": "guess"}, "converters.hub_rate = 'guess'"),
    ("converters", {"arithmetic": "float16"}, "'float32'"),
    ("actuator", {"torque_limit": 0.0}, "a torque limit is positive"),
    ("actuator", {"hub_damping": -1.0}, "hub damping is zero or positive"),
    ("actuator", {"motor_constant": 0.0}, "a motor constant is a positive number"),
    ("slew", {"travel": 0.0}, "slew.travel"),
    ("slew", {"reading": "both"}, "slew.reading"),
    ("slew", 3, "give a table, headed [slew]"),
]  # fmt: skip


@pytest.mark.parametrize(("table", "content", "message"), BAD)
def test_bad_tables_are_named(table, content, message):
    with pytest.raises(ParameterError) as refused:
        chain_of_tables({table: content})
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_quantise_rounds_clips_and_reports_it():
    given, row = (0.2, 0.3, -0.74, 1.6, 1.8, -2.3, 0.25), np.array([0.5, -2.0, 1.5])
    saturated = np.zeros((len(given), 3), np.bool_)
    values = [quantise(x, row, flags, 1) for x, flags in zip(given, saturated, strict=True)]
    assert values == [0.0, 0.5, -0.5, 1.5, 1.5, -2.0, 0.0]
    assert np.argwhere(saturated).tolist() == [[4, 1], [5, 1]]


def test_an_arm_and_its_chain_are_one_file_that_loads_to_both(tmp_path):
    chain = chain_of_tables(tomllib.loads(LOOP))
    file = tmp_path / "arm.toml"
    file.write_text(file_text(ARM, chain), encoding="utf-8")
    assert (tfarm.load(file), load_chain(file)) == (ARM, chain)
    assert file_text(ARM, Chain()) == file_text(ARM) == LAB
