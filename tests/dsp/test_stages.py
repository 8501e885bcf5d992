"""Vectors of the stages of one sample, each alone and all together, through every consumer that computes a sample.

The truth is the compiled simulation.  References are a slew with seeded noise, so that no value is halfway between two
steps of a quantiser.  Signals agree to 1e-12 of their largest value, and every quantiser decides alike.
"""

import json
from dataclasses import asdict, replace
from functools import cache

import numpy as np
import pytest

import tfarm
from tests.exported.cases import on_steps, readings, realised, task_of
from tests.exported.compilers import needed, pumped, run, stepped
from tests.exported.tuners import exported, some_tuner
from tests.exported.units import Unit, driven, inputs_of, modes_of_units
from tests.shared import thinned
from tfarm.arm import HubFeedback
from tfarm.arm.law import REFERENCE
from tfarm.arm.stages import STAGES
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Converters, ReferenceShaping, Sampling, Simulator, Slew, kernel
from tfarm.dsp.kernel import AMPLIFIER, DAC, ENCODER
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.shaping import impulses_of
from tfarm.dsp.simulate import quantisers
from tfarm.exported import controller, fmu, live_loop, tuner_code
from tfarm.exported.controller import c_controller
from tfarm.exported.kernel import Status
from tfarm.exported.result import write_into
from tfarm.loop.sampled import sampled_loop
from tfarm.report.blocks import TEMPLATES
from tfarm.tuner import kernel as tuner
from tfarm.tuner.trial import Cost, Trial

ARM, LAW, MODES = tfarm.load("sasaki2012-lab"), tfarm.HubFeedback(K1=0.3, K2=0.3, Kp=0.5), 3
EQUAL, TIE = 1e-12, 1e-9  # of the largest value of a signal, and of a step
TABLES = {  # of each stage; steps need a range
    "reference": {
        "slew": {"travel": 0.7, "rise_time": 0.3, "reading": "total"},
        "reference": {"profile": "s-curve"},
    },
    "shaper": {"reference": {"shaper": "ZV", "modes": 1}},
    "anti-alias filter": {"sampling": {"antialias_corner": 300.0}},
    "encoder": {"converters": {"encoder_counts": 500}},
    "hub rate": {"converters": {"hub_rate": "difference", "rate_filter": 100.0}},
    "amplifier steps": {"converters": {"moment_bits": 8, "moment_range": 9.0}},
    "amplifier range": {"converters": {"moment_range": 1.5}},
    "law": {},
    "arithmetic": {"converters": {"arithmetic": "float32"}},
    "DAC steps": {"converters": {"torque_bits": 7, "torque_range": 90.0}},
    "DAC range": {"converters": {"torque_range": 9.0}},
    "torque limit": {"actuator": {"torque_limit": 6.0}},
    "hold": {"sampling": {"period": 0.008}},
    "delay": {"sampling": {"delay_samples": 1.3}},
    "hub damping": {"actuator": {"hub_damping": 0.1}},
    "plant": {},
    "volts": {"actuator": {"motor_constant": 0.5}},
}
KINDS = {
    "sampling": Sampling,
    "converters": Converters,
    "actuator": Actuator,
    "slew": Slew,
    "reference": ReferenceShaping,
}


def vectors(consumer, every=1):
    """The stages that a consumer has, each alone and all together."""
    alone = [(stage,) for stage in consumer.acts if stage != "shaper"]
    cases = [pytest.param(consumer.acts, id="together"), *thinned([(each,) for each in alone], every)]
    cases += [("shaper",)] * ("shaper" in consumer.acts)
    return pytest.mark.parametrize("stages", cases)


def chain_of(stages):
    own = {"slew": {"rise_time": 0.2}}
    for stage in stages:
        own |= {table: own.get(table, {}) | keys for table, keys in TABLES[stage].items()}
    return Chain(**{table: KINDS[table](**keys) for table, keys in own.items()})


def unshaped(chain):
    """A slew of a chain with noise on its references, before its shaper."""
    rng = np.random.default_rng(1)
    task = slew_scenario(ARM, chain, 3.0 * chain.slew.rise_time)
    sizes = {"feedforward": 3.0, "hub_angle": 0.1, "hub_rate": 1.0, "rigid_moment": 1.0}
    noise = {name: getattr(task, name) + size * rng.normal(size=task.t.size) for name, size in sizes.items()}
    return replace(task, **noise)


@cache
def vector(chain, count=MODES):
    """The simulation of a slew of a chain with noise on its references, none of its values next to a tie."""
    task = unshaped(chain).through(impulses_of(ARM, chain, LAW))
    truth = Simulator(Case(ARM, LAW, chain), task, count=count).run()
    assert truth.stopped is None
    for value, row in ((truth.measured[:, 0], ENCODER), (truth.measured[:, 2], AMPLIFIER)):
        if (step := quantisers(chain)[row, 0]) > 0:
            assert abs(value / step % 1 - 0.5).min() > TIE
    return truth


def assert_equal(found, truth, step=0.0, name=""):
    np.testing.assert_allclose(found, truth, rtol=0, atol=EQUAL * abs(truth).max(), err_msg=name)
    if step:
        np.testing.assert_array_equal(np.rint(found / step), np.rint(truth / step), err_msg=name)


def test_every_stage_has_a_vector_in_which_it_acts():
    assert list(TABLES) == [stage.name for stage in STAGES]
    plain = vector(chain_of(()))
    for stage, tables in TABLES.items():
        truth = vector(chain_of([stage]))
        is_same = truth.torque.tobytes() == plain.torque.tobytes()
        assert is_same == (stage in ("law", "plant", "volts")), stage
        assert (truth.volts is None) == (stage != "volts")
        assert tables == {} or chain_of([stage]) != chain_of(())


@vectors(kernel.CONSUMER)
def test_a_controller_in_python(stages):
    """The law by its formula, every product and sum rounded, on what the simulation hands to a controller."""
    chain = chain_of(stages)
    truth, asked = vector(chain), []
    f = np.float32 if chain.converters.is_single else np.float64

    def torque(m):
        servo = f(m.feedforward) + f(LAW.Kp) * (f(m.angle_reference) - f(m.hub_angle))
        servo = servo + f(LAW.K1) * (f(m.rate_reference) - f(m.hub_rate))
        wanted = f(truth.scenario.moment_reference[m.k])
        asked.append(float(servo - f(LAW.K2) * (f(m.root_moment) - wanted)))
        return asked[-1]

    found = Simulator(Case(ARM, HubFeedback(), chain), truth.scenario, count=MODES).controller(torque)
    step = quantisers(chain)[DAC, 0]
    assert not step or abs(np.array(asked) / step % 1 - 0.5).min() > TIE
    assert_equal(found.torque, on_steps(np.array(asked), chain, DAC), step)
    assert_equal(found.torque, truth.torque, step)
    for values, row in ((truth.measured[:, 0], ENCODER), (truth.measured[:, 2], AMPLIFIER), (np.array(asked), DAC)):
        size, low, high = quantisers(chain)[row]
        near = np.rint(values / size) * size if size else values
        assert (truth.saturated_at[:, row] == ((near > high) | (near < low))).all()


@vectors(fmu.CONSUMER, 3)
def test_the_functional_mock_up_unit(stages, tmp_path):
    needed("cc")
    # a unit in float32 shapes in float32, the simulation in float64
    chain = chain_of([each for each in stages if each != "shaper" or "arithmetic" not in stages])
    truth = vector(chain)
    with modes_of_units(MODES):
        tfarm.export(ARM, LAW, what="loop", form="fmu", folder=tmp_path, chain=chain, anyway=True)
    unit = Unit(tmp_path / "loop.fmu", tmp_path / "unpacked")
    unit.start()
    found = driven(unit, inputs_of(unshaped(chain)), truth.t.size)
    steps = quantisers(chain)[:, 0]
    assert_equal(found["torque"][1:], truth.torque, steps[DAC])
    for (name, values), step in zip(readings(truth).items(), (steps[ENCODER], 0.0, steps[AMPLIFIER]), strict=True):
        assert_equal(found[f"measured:{name}"][:-1], values, step, name)
    for name in truth.at_samples.names:
        assert_equal(found[name][:-1], truth.at_samples.signal(name), name=name)


@vectors(controller.CONSUMER, 3)
def test_the_controller_in_c(stages, tmp_path):
    chain = chain_of(stages)
    truth = vector(chain)
    task = task_of((ARM, LAW, chain), anyway=True)
    write_into(tmp_path, c_controller(task).contents)
    own, given = realised(task)[0], unshaped(chain)
    columns = readings(truth) | {"feedforward": given.feedforward}
    columns |= {f"{REFERENCE}{name}": values for name, values in given.references.items()}
    names = [*own.signals, *(f"{REFERENCE}{name}" for name in own.references), "feedforward"]
    found, status = stepped(tmp_path, own, np.stack([columns[name] for name in names], axis=1), "gcc", "-O2")
    assert_equal(found, truth.torque, quantisers(chain)[DAC, 0])
    assert ((status == Status.SATURATED) == truth.saturated_at[:, DAC]).all()


@vectors(tuner.CONSUMER)
def test_the_matrices_of_the_tuner(stages):
    chain = chain_of(stages)
    truth = vector(chain)
    loop = sampled_loop(Case(ARM, LAW, chain), count=MODES)
    found = Trial(loop, truth.scenario, Cost(), "vibration").with_constant(LAW.K2)
    assert_equal(found.e + truth.scenario.feedforward, truth.torque)
    assert_equal(found.x + truth.scenario.moment_reference, truth.measured[:, 2])
    assert_equal(found.moment, truth.at_samples.root_moment)


@vectors(tuner_code.CONSUMER, 3)
def test_the_tuner_in_c(stages, tmp_path):
    """A network whose gain is the middle of its guard."""
    truth = vector(chain_of(stages))
    middle = {"guard": (0.2, 0.4), "guard_kind": "time-varying", "scales": [1.0] * 6, "signals": "vibration"}
    network = middle | {"W1": [[0.0] * 6], "w2": [0.0], "K1": LAW.K1, "Kp": LAW.Kp}
    own = exported(tmp_path, some_tuner(np.random.default_rng(0), **network), anyway=True)
    task, signals = truth.scenario, readings(truth).values()
    rows = np.stack([*signals, task.hub_angle, task.hub_rate, task.moment_reference, task.feedforward], axis=1)
    found, status = pumped(tmp_path, "tuner", own.real, rows, "gcc", "-O2")
    assert not status.any()
    assert_equal(found, truth.torque)


NODE = """
const fs = require("fs"), read = file => fs.readFileSync(file, "utf8"), { slew, law } = JSON.parse(read(0));
const text = process.argv.slice(1).map(read).join("\\n") + "; globalThis.Slew = Slew;";
require("vm").runInThisContext(text);
const { torque, moment, angle, tip } = new Slew(slew).run(law);
console.log(JSON.stringify({ torque: [...torque], moment, angle, tip }));
"""


@vectors(live_loop.CONSUMER)
def test_the_page_in_javascript(stages):
    chain = chain_of(stages)
    data = live_loop.slew_numbers(Case(ARM, LAW, chain))
    truth = vector(chain, data["modes"])
    task = truth.scenario
    ideal = [task.feedforward, task.hub_angle, task.hub_rate, task.moment_reference, task.rigid_moment]
    given = {"slew": data | {"ideal": live_loop.pack_doubles(np.stack(ideal, axis=1))}, "law": asdict(LAW)}
    scripts = [TEMPLATES / name for name in ("live_loop.js", "live_sampled.js")]
    found = json.loads(run(needed("node"), "-e", NODE, *scripts, input=json.dumps(given).encode()))
    seen = truth.at_samples
    assert_equal(np.array(found["torque"]), truth.torque, quantisers(chain)[DAC, 0])
    for name, values in (("moment", seen.root_moment), ("angle", seen.hub_angle), ("tip", seen.tip_displacement)):
        assert_equal(np.array(found[name]), values, name=name)
