"""The exported state spaces against the analysis, the simulator, python-control's interconnection and aliasing."""

import math
import runpy
from zipfile import ZipFile

import control
import numpy as np
import pytest

import tfarm
from tfarm import HubFeedback, Law
from tfarm.arm import AT_HUB
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Converters, ReferenceShaping, Sampling
from tfarm.dsp.scenarios import scenario, slew_scenario
from tfarm.dsp.simulate import Simulator
from tfarm.exported.systems import controller_system, loop_system, plant_system, reduced_systems
from tfarm.loop.sampled import sampled_loop
from tfarm.response.signals import Signals

T = 0.01
LAB = tfarm.load("sasaki2012-lab")
SERVO = Law(
    {"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "hub_rate": 0.3}, references=("hub_angle", "hub_rate"), delay=0.004
)
MATRICES = Law.of_matrices(
    [[0.5, 0.1], [0.0, 0.7]], [[1.0, 0.2, -1.0], [0.3, 0.0, -0.3]], [[0.4, 0.2]], [[0.9, 0.05, -0.9]],
    ["hub_angle", "root_moment", "reference:hub_angle"], period=T,
)  # fmt: skip
ESTIMATED = Converters(hub_rate="difference", rate_filter=300.0)
CASES = {  # law and chain
    "gains": (HubFeedback(K1=0.3, K2=0.3, Kp=0.5), Chain()),
    "filters and delays": (SERVO, Chain(sampling=Sampling(delay_samples=1.25, antialias_corner=300.0))),
    "estimated rate": (SERVO, Chain(converters=ESTIMATED, actuator=Actuator(hub_damping=0.02))),
    "gains, estimated rate": (HubFeedback(K1=0.3, K2=0.3, Kp=0.5), Chain(converters=ESTIMATED)),
    "matrices": (MATRICES, Chain()),
    "two places": (Law({"hub_rate": 0.3, "moment@0.1": 0.1, "moment@0.3": ([0.1], [0.05, 1.0])}), Chain()),
    "positive sign": (Law({"hub_rate": -0.3, "root_moment": ([-0.1], [0.02, 1])}, sign=1, rule="zoh"), Chain()),
}
EVERY = pytest.mark.parametrize(("law", "chain"), CASES.values(), ids=CASES)


def systems(law, chain):
    plant, controller = (make(Case(LAB, law, chain)) for make in (plant_system, controller_system))
    return plant, controller, loop_system(plant, controller)


def built(system):
    """The system as an object of python-control."""
    names = (system.inputs, system.outputs, system.states)
    inputs, outputs, states = ([each.replace(".", "_") for each in these] for these in names)
    return control.StateSpace(*system.matrices, system.period, inputs=inputs, outputs=outputs, states=states)


def value(system, z):
    """The transfer functions of a system at z."""
    A, B, C, D = system.matrices
    return C @ np.linalg.solve(z * np.eye(len(A)) - A, B.astype(complex)) + D


@EVERY
def test_the_loop_has_the_matrix_of_the_analysis(law, chain):
    loop, mine = sampled_loop(Case(LAB, law, chain)), systems(law, chain)[2].matrices[0]
    assert mine == pytest.approx(loop.matrix(), rel=0, abs=1e-14 * abs(mine).max())  # one rounding a product


@EVERY
def test_the_loop_is_the_interconnection_of_plant_and_controller(law, chain):
    plant, controller, loop = systems(law, chain)
    P, K = built(plant), built(controller)
    K.output_labels = ["share"]
    adder = control.summing_junction(["share", "feedforward"], plant.inputs[0], name="adder")
    whole = control.interconnect(
        [P, K, adder], inplist=[each.replace(".", "_") for each in loop.inputs],
        inputs=[each.replace(".", "_") for each in loop.inputs], outputs=[*P.output_labels, plant.inputs[0]],
    )  # fmt: skip
    for z in np.exp(1j * np.array([0.03, 0.4, 2.0])) * 1.01:
        mine = value(loop, z)
        assert whole(z) == pytest.approx(mine, rel=1e-8, abs=1e-9 * abs(mine).max())  # poles 0.01 away


@EVERY
@pytest.mark.parametrize("name", ["slew", "step"])
def test_the_loop_steps_as_the_simulation_does(law, chain, name):
    """Sample by sample, by the recursion of its matrices; recorded signals of the simulation are not filtered."""
    task = scenario(name, LAB, chain, 0.8)
    found, loop = Simulator(Case(LAB, law, chain), task).run(), systems(law, chain)[2]
    (A, B, C, D), x, y = loop.matrices, np.zeros(len(loop.states)), []
    known = {"feedforward": task.feedforward} | {f"reference:{key}": value for key, value in task.references.items()}
    for u in np.array([known[each] for each in loop.inputs]).T:
        y.append(C @ x + D @ u)
        x = A @ x + B @ u
    y = dict(zip(loop.outputs, np.array(y).T, strict=True))
    for mine, theirs in (("hub_torque", found.torque), ("tip_displacement", found.at_samples.tip_displacement)):
        assert y[mine] == pytest.approx(theirs, rel=0, abs=1e-9 * abs(theirs).max())  # 80 samples of two orders of sums


def test_a_loop_behind_its_shaper_is_the_shaped_slew(tmp_path):
    """The script of python-control: each reference and the feedforward through `shaper`, then the loop."""
    law, chain = CASES["gains"][0], Chain(reference=ReferenceShaping(shaper="ZVD"))
    tfarm.export(LAB, law, what="loop", form="py", folder=tmp_path, chain=chain)
    own, task = runpy.run_path(str(tmp_path / "loop.py")), slew_scenario(LAB, chain, 1.2)
    known = {"feedforward": task.feedforward} | {f"reference:{key}": value for key, value in task.references.items()}
    late = [control.forced_response(own["shaper"], U=known[each]).y[0] for each in own["loop"].input_labels]
    found = control.forced_response(own["loop"], U=np.array(late)).y
    truth = tfarm.simulate(LAB, law, chain, "slew", 1.2)
    torque = found[own["loop"].output_labels.index("hub_torque")]
    assert torque == pytest.approx(truth.torque, rel=0, abs=1e-6 * abs(truth.torque).max())


def test_reduced_models_are_within_their_error():
    """|dG| / (|G| + |w dG/dw|), the slope by a central difference."""
    names = ("hub_rate", "moment@0.1", "moment@0.3", "tip_displacement")
    read, omega, found = Signals(LAB, names), np.geomspace(0.2, 900.0, 40), reduced_systems(LAB, names)
    assert list(found) == ["reduced", "reduced_2"]
    assert sorted(name for each in found.values() for name in each.outputs) == sorted(names)
    for each in found.values():
        rows, h = [names.index(name) for name in each.outputs], 1e-5
        exact, above, below = (read.values(1j * omega * factor)[rows] for factor in (1, 1 + h, 1 - h))
        mine = np.array([value(each, 1j * w)[:, 0] for w in omega]).T
        error = abs(mine - exact) / (abs(exact) + abs(above - below) / (2 * h))
        assert error.max() < each.facts["worst_error"] + 1e-11  # rounding of the solution of order 42
        assert math.isclose(each.facts["band"][1], 1000.0)


def test_references_of_gains_are_those_of_their_signals():
    _, controller, loop = systems(*CASES["gains"])
    assert controller.inputs == (*AT_HUB, *(f"reference:{name}" for name in AT_HUB))
    assert loop.outputs[-1] == "hub_torque"
    assert controller.matrices[3][0] == pytest.approx([-0.5, -0.3, -0.3, 0.5, 0.3, 0.3])


def test_gains_without_references_are_exported_with_their_own_signals(tmp_path):
    law = Law({"root_moment": 0.2, "hub_rate": 0.3})
    assert systems(law, Chain())[1].inputs == law.signals
    tfarm.export(LAB, law, what="controller", form="fmu", folder=tmp_path, anyway=True)
    with ZipFile(next(tmp_path.iterdir())) as unit:
        described = unit.read("modelDescription.xml").decode()
    assert [name in described for name in AT_HUB] == [False, True, True]
