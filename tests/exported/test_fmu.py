"""Functional mock-up units, driven through their binary: equal to the simulation, and as the standard asks."""

import re
import zipfile
from ctypes import c_double
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import numpy as np
import pytest

import tfarm
from tests.exported.cases import CASES, GAINS, IDEAL, LAB, REAL, hinf
from tests.exported.compilers import COMPILERS, STRICT, needed, run
from tests.exported.units import (
    DISCARD,
    DRIVER,
    ERROR,
    LAST_SUCCESSFUL_TIME,
    TERMINATED,
    Unit,
    driven,
    inputs_of,
    modes_of_units,
)
from tests.hostile import C_TEXTS, NAME
from tests.odd_arms import odd_arms
from tests.shared import thinned
from tfarm import Law, ParameterError
from tfarm.arm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Simulator, scenario
from tfarm.dsp.results import simulate_scenario
from tfarm.exported import fmu as module

MODES = 4
EQUAL = 1e-12  # of the largest value of a signal: roundings in another order
LATE = replace(REAL, sampling=replace(REAL.sampling, delay_samples=1.3, antialias_corner=400.0))
SINGLE = replace(LATE, converters=replace(LATE.converters, arithmetic="float32", torque_bits=None))
STATES = Law(
    {"hub_angle": ([4.0, -3.6], [1.0, -0.5]), "deflection@0.3": 5.0, "hub_rate": 0.5},
    period=0.01, references=("hub_angle",), name=NAME,
)  # fmt: skip
SERVO = Law.of_matrices(
    [[0.9, 0.1], [0.0, 0.5]], [[0.1, -0.1], [0.0, 0.2]], [[1.0, 0.3]], [[2.0, -2.0]],
    ["hub_angle", "reference:hub_angle"], period=0.01, name="of a reference",
)  # fmt: skip
BAR = odd_arms()["heavy-hub"]
LOOPS = {
    **{name: (*case, "slew") for name, case in CASES.items()},
    "late": (LAB, GAINS, LATE, "slew"),
    "rig": (*hinf(), "slew"),
    "single": (LAB, STATES, SINGLE, "slew"),
    "states": (LAB, STATES, replace(LATE, converters=IDEAL.converters), "slew"),
    "reference": (LAB, SERVO, IDEAL, "slew"),
    "unstable": (LAB, tfarm.HubFeedback(K1=-3.0), IDEAL, "slew"),
    "pulse": (BAR, tfarm.HubFeedback(K1=1.0), IDEAL, "pulse"),
    "impulse": (LAB, STATES, LATE, "impulse"),
}

EVERY = pytest.mark.parametrize("what", ["plant", "controller", "loop"])
FOLDER = TemporaryDirectory(prefix="units-")
EXPORTED = {}


def made(what, case="gains", **how):
    """A new instance of an exported unit of few modes, and the record of its export, which is made once."""
    needed("cc")
    key = repr((what, case, how))
    if key not in EXPORTED:
        (arm, law, chain, _), folder = LOOPS[case], Path(FOLDER.name) / f"unit{len(EXPORTED)}"
        options = {"anyway": True} | how
        with modes_of_units(MODES):
            EXPORTED[key] = folder, tfarm.export(arm, law, what=what, form="fmu", folder=folder, chain=chain, **options)
    folder, found = EXPORTED[key]
    return Unit(folder / f"{what}.fmu", folder / "unpacked"), found


def assert_equal(found, truth, name=""):
    np.testing.assert_allclose(found, truth, rtol=0, atol=EQUAL * abs(truth).max(), err_msg=name)


@pytest.mark.parametrize("case", ["single", "impulse", "pulse", "windup", *thinned(["reference", "rig"], 2)])
def test_a_loop_is_that_of_the_simulation(case):
    """Laws with states and of another input, references, an impulse and a disturbance; `tests.dsp.test_stages` has
    gains under every stage of a chain."""
    arm, law, chain, name = LOOPS[case]
    unit, exported = made("loop", case)
    truth = simulate_scenario(Case(arm, law, chain), name, 1.5, count=MODES).simulation
    task, n = truth.scenario, truth.t.size
    assert truth.stopped is None
    unit.start(impulse=task.impulse)
    found = driven(unit, inputs_of(task), n)
    for signal in truth.at_samples.names:
        assert_equal(found[signal][:n], truth.at_samples.signal(signal), signal)
    assert_equal(found["torque"][1:], truth.torque)
    assert exported.details.modes == MODES
    assert [each.name for each in exported.details.variables] == list(unit.at)


@pytest.mark.parametrize("case", ["gains", "late"])
def test_a_plant_is_that_of_the_simulation_under_any_torque(case):
    (unit, _), chain = made("plant", case), LOOPS[case][2]
    task = scenario("pulse", LAB, chain, 2.0)
    torque, seen = np.random.default_rng(1).normal(size=task.t.size), []

    def controller(m):
        seen.append((m.hub_angle, m.hub_rate, m.root_moment))
        return torque[m.k]

    truth, n = Simulator(Case(LAB, HubFeedback(), chain), task, count=MODES).controller(controller), task.t.size
    assert case == "gains" or min(truth.saturated["moment"], truth.saturated["torque"]) > 9
    unit.start()
    found = driven(unit, {"hub_torque": torque, "disturbance": task.disturbance}, n)
    for name, readings in zip(("hub_angle", "hub_rate", "root_moment"), np.array(seen).T, strict=True):
        assert_equal(found[f"measured:{name}"][:n], readings, name)
        assert_equal(found[name][:n], truth.at_samples.signal(name), name)
    assert_equal(found["torque"][1:], truth.torque)


@pytest.mark.parametrize("case", thinned(["integral", "late", "single", "reference"], 2))
def test_plant_and_controller_in_turn_are_the_loop(case):
    """First the controller, then the plant, in each step; the delay of the law is the controller's here."""
    plant, control, loop = (made(what, case)[0] for what in ("plant", "controller", "loop"))
    inputs = inputs_of(scenario("slew", LAB, LOOPS[case][2], 1.0))
    n = inputs["feedforward"].size
    for each in (plant, control, loop):
        each.start()
    truth = driven(loop, inputs, n)
    sensors, rows = [name for name in control.at if name.startswith("measured:")], []
    names = [name for name in truth if name != "torque"]
    for k in range(n):
        rows.append(plant.get(names))
        control.set(dict(zip(sensors, plant.get(sensors), strict=True)))
        control.set({name: values[k] for name, values in inputs.items() if name in control.at})
        control.step()
        plant.set({"hub_torque": control.get(["hub_torque"])[0]})
        plant.step()
    for name, values in zip(names, np.array(rows).T, strict=True):
        assert_equal(values, truth[name][:n], name)


def test_steps_of_any_length_have_the_same_samples():
    """Inputs count from the step that begins at a sample or contains it."""
    unit, _ = made("loop")
    inputs = {"feedforward": np.random.default_rng(0).normal(size=40)}
    unit.start()
    truth = driven(unit, inputs, 40)["root_moment"]
    T = unit.period
    for parts in ((0.25, 0.25, 0.5), (0.1,) * 10, (1 / 3,) * 3, (1 - 1e-7, 1e-7)):
        unit.call("Reset")
        unit.start(start=7.0)
        for k in range(40):
            assert unit.get(["root_moment"]) == [truth[k]]
            unit.set({"feedforward": inputs["feedforward"][k]})
            for n, part in enumerate(parts):
                unit.step(part * T)
                unit.set({"feedforward": 5.0})  # within a sample: without effect
                assert sum(parts[: n + 1]) > 0.999 or unit.get(["root_moment"]) == [truth[k]]
    unit.call("Reset")
    unit.start()
    unit.set({"feedforward": 1.0})
    unit.step(2.5 * T)
    unit.set({"feedforward": -1.0})
    unit.step(2.5 * T)  # samples 0, 1, 2 have the first input, 3 and 4 the second
    unit.set({"feedforward": 0.0})
    unit.step(T)
    other, _ = made("loop")
    other.start()
    assert unit.get(["root_moment"]) == [driven(other, {"feedforward": [1, 1, 1, -1, -1, 0]}, 6)["root_moment"][-1]]


def test_a_controller_computes_at_the_beginning_of_a_step():
    unit, _ = made("controller")
    unit.start()
    assert unit.get(["hub_torque"]) == [0.0]
    unit.set({"feedforward": 2.0})
    unit.step(0.1 * unit.period)
    assert unit.get(["hub_torque"]) == [2.0]
    unit.set({"feedforward": 3.0})
    unit.step(0.9 * unit.period)
    assert unit.get(["hub_torque"]) == [2.0]
    unit.step()
    assert unit.get(["hub_torque"]) == [3.0]


def test_two_instances_and_a_reset_do_not_share_a_state():
    one, _ = made("loop", "integral")
    two, _ = made("loop", "integral")
    inputs = {"feedforward": np.ones(30)}
    one.start()
    truth = driven(one, inputs, 30)
    two.start(impulse=0.1)
    driven(two, inputs, 30)
    for unit in (one, two):
        unit.call("Terminate")
        unit.call("Reset")
        unit.start()
        found = driven(unit, inputs, 30)
        assert all((found[name] == truth[name]).all() for name in truth)


def test_an_unstable_loop_stops_where_the_simulation_does():
    law = LOOPS["unstable"][1]
    with pytest.raises(ParameterError, match="not certified stable"):
        made("loop", "unstable", anyway=False)
    unit, exported = made("loop", "unstable")
    assert exported.verdict.startswith("NOT CERTIFIED STABLE")
    assert "NOT CERTIFIED STABLE" in unit.xml.get("description")
    truth = simulate_scenario(Case(LAB, law, IDEAL), "slew", 30.0, count=MODES).simulation
    unit.start()
    inputs, last = inputs_of(truth.scenario), truth.t.size - 1
    for k in range(last):
        unit.set({name: values[k] for name, values in inputs.items()})
        unit.step()
    unit.set({name: values[last] for name, values in inputs.items()})
    assert unit.step_status(unit.period) == DISCARD
    assert unit.status_of("Real", LAST_SUCCESSFUL_TIME) == pytest.approx(truth.t[last], abs=1e-9)
    assert unit.status_of("Boolean", TERMINATED) == 1
    assert unit.get(["root_moment"])[0] == pytest.approx(truth.at_samples.root_moment[last], rel=1e-9)
    assert "beyond its bound" in unit.logged[-1]
    assert unit.step_status(unit.period) == ERROR


@EVERY
def test_wrong_calls_have_an_error_and_no_effect(what):
    unit, _ = made(what)
    (first, *_), output = unit.at, next(name for name, of in unit.causality.items() if of == "output")
    n = len(unit.at)
    assert unit.step_status(unit.period) == ERROR  # not started
    unit.start()
    before = unit.get(list(unit.at))
    for value in (np.nan, np.inf, -np.inf):
        assert unit.set_status({first: 1.0, next(name for name in list(unit.at)[1:]): value}) == ERROR
    for reference in (unit.at[output], n, 2**32 - 1):
        assert unit.real("Set", [reference], (c_double * 1)()) == ERROR
    assert unit.real("Get", [n], (c_double * 1)()) == unit.real("Get", [2**32 - 1], (c_double * 1)()) == ERROR
    if what != "controller":
        assert unit.set_status({"impulse": 1.0}) == ERROR  # started
    for step in (0.0, -unit.period, np.nan, np.inf, 1e30):
        assert unit.step_status(step) == ERROR
    unit.time = 3.0
    assert unit.step_status(unit.period) == ERROR
    assert unit.get(list(unit.at)) == before
    assert unit.another(guid="other") is None
    assert unit.another(kind=0) is None  # model exchange


def test_every_function_of_the_standard_is_there_and_no_other():
    unit, _ = made("loop")
    names = set(re.findall(r" (\w+)$", run(needed("nm"), "-D", "--defined-only", unit.binary).decode(), re.MULTILINE))
    kinds = ("Real", "Integer", "Boolean", "String")
    assert {name.removeprefix("fmi2") for name in names if name.startswith("fmi2")} == {
        "GetTypesPlatform", "GetVersion", "SetDebugLogging", "Instantiate", "FreeInstance", "SetupExperiment",
        "EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset", "GetFMUstate", "SetFMUstate",
        "FreeFMUstate", "SerializedFMUstateSize", "SerializeFMUstate", "DeSerializeFMUstate",
        "GetDirectionalDerivative", "SetRealInputDerivatives", "GetRealOutputDerivatives", "DoStep", "CancelStep",
        "GetStatus",
        *(f"{act}{kind}" for act in ("Get", "Set") for kind in kinds), *(f"Get{kind}Status" for kind in kinds),
    }  # fmt: skip
    assert {name for name in names if not name.startswith("_")} == {each for each in names if each.startswith("fmi2")}
    needs = run("nm", "-D", "--undefined-only", unit.binary).decode()
    assert set(re.findall(r" U (\w+)", needs)) <= {"calloc", "free", "memcpy", "memset", "strcmp", "strncpy"}
    source = (unit.folder / "sources" / "fmu.c").read_text(encoding="ascii")
    assert (source.count("alloc("), source.count("calloc(1, sizeof *m)"), source.count("free(c)")) == (1, 1, 1)


@pytest.mark.parametrize("compiler", COMPILERS)
@EVERY
def test_the_source_compiles_without_a_warning(tmp_path, compiler, what):
    unit, _ = made(what, "single")
    for file in sorted(unit.folder.glob("sources/*.c")):
        made_of = tmp_path / f"{file.stem}.o"
        run(needed(compiler), *STRICT, "-Wshadow", "-O2", "-c", file, "-o", made_of)
        assert made_of.stat().st_size > 0


def test_the_check_of_c_finds_nothing():
    checks = ("--std=c99", "--enable=warning,performance,portability", "--error-exitcode=1", "--quiet")
    run(needed("cppcheck"), *checks, made("loop", "single")[0].folder / "sources")


@pytest.mark.parametrize("what", thinned(["loop", "plant", "controller"], 3))
def test_sanitizers_find_nothing_in_random_calls(tmp_path, what):
    """Values of any size, unknown references, steps of any length and order, and resets."""
    unit, _ = made(what, "single")
    driver = tmp_path / "driver.c"
    driver.write_text(DRIVER.replace("GUID", unit.xml.get("guid")), encoding="ascii")
    sources, program = sorted(unit.folder.glob("sources/*.c")), tmp_path / "driver"
    options = ("-std=c99", "-g", "-O1", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
    run(needed("gcc"), *options, f"-I{unit.folder / 'sources'}", driver, *sources, "-o", program)
    assert int(run(program).split()[0]) > 500


# ------------------------------------------------------------ the description


@EVERY
def test_the_description_is_consistent(what):
    """Every rule of the standard for co-simulation that a unit of real variables can break."""
    unit, exported = made(what, "single")
    xml, variables = unit.xml, list(unit.xml.iter("ScalarVariable"))
    assert [int(each.get("valueReference")) for each in variables] == list(range(len(variables)))
    assert len({each.get("name") for each in variables}) == len(variables)
    order = "CoSimulation UnitDefinitions LogCategories DefaultExperiment ModelVariables ModelStructure"
    assert " ".join(each.tag for each in xml) == order
    units = {each.get("name") for each in xml.iter("Unit")}
    assert {each.find("Real").get("unit") for each in variables} == units
    unknown = {tag: [int(each.get("index")) for each in xml.iterfind(f"ModelStructure/{tag}/Unknown")]
               for tag in ("Outputs", "InitialUnknowns")}  # fmt: skip
    outputs = [n for n, each in enumerate(variables, 1) if each.get("causality") == "output"]
    assert unknown["Outputs"] == outputs
    computed = [n for n, each in enumerate(variables, 1) if each.get("initial") == "calculated"]
    assert unknown["InitialUnknowns"] == computed == ([] if what == "controller" else outputs)
    for each in variables:
        has_start = each.find("Real").get("start") is not None
        assert has_start == (each.get("initial") != "calculated")
        assert (each.get("causality"), each.get("variability")) in {
            ("input", "discrete"), ("output", "discrete"), ("parameter", "fixed")
        }  # fmt: skip
    sources = [each.get("name") for each in xml.iter("File")]
    assert sources == (["fmu.c"] if what == "plant" else ["fmu.c", "controller.c"])
    assert f'"{xml.get("guid")}"' in (unit.folder / "sources" / "fmu.c").read_text(encoding="ascii")
    assert exported.details.binary.startswith(f"{unit.binary.parent.name}, by ")


def test_declared_dependencies_are_true():
    """At the start, and at a communication point, outputs change with no input and no parameter."""
    unit, _ = made("loop", "states")
    assert {each.get("dependencies") for each in unit.xml.iterfind("ModelStructure/*/Unknown")} == {""}
    outputs = [name for name, of in unit.causality.items() if of == "output"]
    given = {name: 0.3 for name, of in unit.causality.items() if of != "output"}
    unit.set(given)
    assert unit.get(outputs) == [0.0] * len(outputs)
    unit.start(impulse=0.3)
    unit.step()
    seen = unit.get(outputs)
    unit.set({name: 0.7 for name in given if name != "impulse"})
    assert unit.get(outputs) == seen
    assert any(seen)


def test_equal_inputs_have_equal_bytes(tmp_path):
    for folder in ("one", "two"):
        with modes_of_units(MODES):
            tfarm.export(LAB, GAINS, what="loop", form="fmu", folder=tmp_path / folder)
    one, two = (zipfile.ZipFile(tmp_path / folder / "loop.fmu") for folder in ("one", "two"))
    assert [(each.filename, each.date_time) for each in one.infolist()] == [
        (each.filename, (1980, 1, 1, 0, 0, 0)) for each in two.infolist()
    ]
    assert all(one.read(name) == two.read(name) for name in one.namelist() if not name.startswith("binaries/"))
    assert "generationDateAndTime" not in one.read("modelDescription.xml").decode()


@pytest.mark.parametrize("text", thinned(C_TEXTS, 3))
def test_names_of_a_user_reach_c_and_xml_as_text(tmp_path, text, monkeypatch):
    """The name of the arm where it is a legal one, and that of the identifiers."""
    monkeypatch.setattr(module, "binary_of", lambda sources, identifier: ({}, "none"))
    try:
        arm = replace(LAB, name=text)
    except ParameterError:
        arm = LAB
    with modes_of_units(1):
        found = tfarm.export(arm, GAINS, what="plant", form="fmu", folder=tmp_path, name=text)
    with zipfile.ZipFile(tmp_path / "plant.fmu") as archive:
        assert archive.namelist() == ["modelDescription.xml", "sources/fmi2.h", "sources/fmu.c"]
        source, xml = archive.read("sources/fmu.c"), ElementTree.fromstring(archive.read("modelDescription.xml"))
        archive.extractall(tmp_path)
    ((name, identifier),) = found.names
    assert (name, identifier) == (text, xml.find("CoSimulation").get("modelIdentifier"))
    assert re.fullmatch(r"fmu_[A-Za-z0-9_]{1,27}", identifier)
    assert xml.get("description").startswith(f"plant of {arm.name[:150]}")
    plain, _ = made("plant")
    assert {each.tag for each in xml.iter()} == {each.tag for each in plain.xml.iter()}
    head = (
        r"/\* FMI 2.0 co-simulation: plant of .*\n   SHA-256 of the inputs: .* nor Python. \*/\n#include <stdlib.h>\n"
    )
    assert re.match(head, source.decode("ascii"))
    run(needed("cc"), "-std=c99", "-fsyntax-only", "-Wall", "-Werror", tmp_path / "sources" / "fmu.c")


@pytest.mark.parametrize(
    ("script", "reason"),
    [
        (None, "no compiler found .*"),
        ("exec /bin/sleep 9", r".*timed out after 0\.2 seconds"),
        ("exit 3", r".*exit status 3\."),
    ],
)
def test_without_a_compiler_that_works_there_is_the_source(tmp_path, monkeypatch, script, reason):
    broken = tmp_path / "cc"
    if script:
        broken.write_text(f"#!/bin/sh\n{script}\n", encoding="ascii")
        broken.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(module, "binary_of", partial(module.binary_of, longest=0.2))
    with modes_of_units(1):
        found = tfarm.export(LAB, GAINS, what="plant", form="fmu", folder=tmp_path)
    assert re.fullmatch(f"none: {reason}", found.details.binary)
    names = ["modelDescription.xml", "sources/fmi2.h", "sources/fmu.c"]
    assert sorted(zipfile.ZipFile(tmp_path / "plant.fmu").namelist()) == names


def test_an_arm_without_a_slew_has_the_modes_of_a_step(tmp_path, monkeypatch):
    """A hub held by a spring."""
    monkeypatch.setattr(module, "binary_of", lambda sources, identifier: ({}, "none"))
    held = replace(LAB, hub=replace(LAB.hub, stiffness=20.0))
    found = tfarm.export(held, GAINS, what="plant", form="fmu", folder=tmp_path)
    assert found.details.modes == simulate_scenario(Case(held, GAINS, IDEAL), "step", 3.0).used.modes


@EVERY
def test_fmpy_finds_no_problem(what):
    pytest.importorskip("fmpy", reason="FMPy is not installed: extra fmu")
    from fmpy.validation import validate_fmu

    for case in ("gains", "single", "reference"):
        assert validate_fmu(str(made(what, case)[0].folder.parent / f"{what}.fmu")) == []


@pytest.mark.parametrize("case", ["gains", "integral", "estimate"])
def test_fmpy_simulates_the_slew(tmp_path, case):
    """With the usual modes and duration, those of `tfarm simulate`."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: extra fmu")
    arm, law, chain, _ = LOOPS[case]
    tfarm.export(arm, law, what="loop", form="fmu", folder=tmp_path, chain=chain, anyway=True)
    truth = simulate_scenario(Case(arm, law, chain), "slew", 3.0).simulation
    inputs = {"time": truth.t} | inputs_of(truth.scenario)
    table = np.array(list(zip(*inputs.values(), strict=True)), dtype=[(name, float) for name in inputs])
    found = fmpy.simulate_fmu(str(tmp_path / "loop.fmu"), stop_time=3.0, input=table)
    np.testing.assert_allclose(found["time"], truth.t, rtol=1e-12)
    for signal in truth.at_samples.names:
        assert_equal(found[signal], truth.at_samples.signal(signal), signal)
    assert_equal(found["torque"][1:], truth.torque[:-1])
