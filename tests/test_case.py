"""The record of arm, controller and chain, and the face with its questions."""

import pickle
from inspect import isfunction, signature

import numpy as np
import pytest

import tfarm
from tests.shared import refusal
from tfarm.arm import AT_HUB, Law
from tfarm.arm.chain import Chain, Sampling
from tfarm.case import Case
from tfarm.face import CaseFace, Question
from tfarm.schema.quantities import to_dict

LAB = tfarm.load("sasaki2012-lab")
GAINS = tfarm.HubFeedback(K1=0.3, K2=0.3)


def test_gains_have_one_normal_form_however_they_are_given():
    as_entries = Law({"hub_rate": 0.3, "root_moment": 0.3}, references=("hub_rate", "root_moment"))
    cases = [Case(LAB, law) for law in (GAINS, as_entries, Law.of_gains(GAINS))]
    assert cases[0] == cases[1] == cases[2]
    assert cases[0].law.signals == cases[0].law.references == ("hub_rate", "root_moment")
    assert cases[0].feedback.signals == cases[0].feedback.references == AT_HUB
    assert cases[0].gains == GAINS
    assert Case(LAB, cases[0].law) == Case(LAB, cases[0].feedback) == cases[0]


def test_gains_without_references_keep_their_signals_but_not_in_the_loop():
    case = Case(LAB, Law({"hub_rate": 0.3}))
    assert case.law.signals == ("hub_rate",)
    assert case.law.references == ()
    assert case.feedback.signals == AT_HUB
    assert case.feedback.references == ()
    assert case.gains == tfarm.HubFeedback(K1=0.3)


def test_another_controller_is_as_given_and_its_input_is_the_arms():
    law = Law({"hub_angle": ([1.0, 2.0], [0.01, 1.0])}, references=("hub_angle",), delay=0.002)
    case = Case(LAB, law)
    assert case.law == case.feedback == law
    assert case.gains is None
    motor = tfarm.load("quanser-flexlink")
    assert motor.input == "motor_voltage"
    assert Case(motor, Law({"hub_angle": 2.0}, input="hub_torque")).arm.input == "hub_torque"


def test_a_loop_needs_all_its_parts():
    assert Case(LAB, GAINS).chain == Chain()
    for arm, law, chain, key in ((None, GAINS, None, "arm"), (LAB, 0.3, None, "law"), (LAB, GAINS, 0.01, "chain")):
        assert refusal(Case, arm, law, chain).key == key


def test_signals_and_system_are_those_of_the_arm_and_the_controller():
    case = Case(LAB, GAINS)
    s = np.array([1.0 + 2.0j, 30.0j])
    expected = [tfarm.transfer(LAB, name)(s) for name in AT_HUB]
    assert case.signals.values(s) == pytest.approx(np.array(expected), rel=1e-12)
    assert case.system is case.signals.system
    assert case.spectrum == tfarm.modes(LAB, 10)


def test_other_cases_differ_in_one_part():
    case = Case(LAB, GAINS)
    assert case.with_number("K2", 0.5).gains == tfarm.HubFeedback(K1=0.3, K2=0.5)
    assert case.under(tfarm.HubFeedback(K1=1.0)).gains == tfarm.HubFeedback(K1=1.0)
    assert case.on(LAB.with_numbers(damping=0.01)).arm.damping == 0.01
    assert case.through(Chain(sampling=Sampling(period=0.005))).chain.sampling.period == 0.005
    assert case == Case(LAB, GAINS)
    assert pickle.loads(pickle.dumps(case)) == case


QUESTIONS = {each.name: method for method, each in vars(CaseFace).items() if isinstance(each, Question)}
PARAMETERS = {
    name: signature(getattr(tfarm, name)).parameters for name in tfarm.__all__ if isfunction(getattr(tfarm, name))
}


@pytest.mark.parametrize("name", [name for name, of in PARAMETERS.items() if {"arm", "law"} <= of.keys()])
def test_each_question_of_arm_and_law_is_a_method_with_the_parts_of_the_case(name):
    case = tfarm.Case(LAB, GAINS, Chain(sampling=Sampling(period=0.005)))
    asked = signature(getattr(case, QUESTIONS[name])).parameters
    left = {"arm", "law", "chain"} & asked.keys()
    assert all(asked[part].default == getattr(case, part) for part in left)
    assert asked.keys() | {"arm", "law", "chain"} == PARAMETERS[name].keys() | {"arm", "law", "chain"}


def test_a_map_of_the_face_is_that_of_its_controller():
    law = tfarm.HubFeedback(K1=0.3, K2=0.3, Kp=0.5)
    x, y = np.linspace(0.1, 1, 4), np.linspace(-1, 3, 5)
    found = tfarm.Case(LAB, law).map(x, y)
    assert found.unstable.tolist() == tfarm.map(LAB, x, y, 0.5).unstable.tolist()


@pytest.mark.parametrize("name", ["margins", "sampled", "card", "poles", "step"])
def test_a_method_of_the_face_is_the_function_of_the_package(name):
    chain = Chain(sampling=Sampling(period=0.005))
    function = {"card": tfarm.result_card, "poles": tfarm.closed_loop_poles}.get(name) or getattr(tfarm, name)
    with_chain = () if name in ("margins", "poles") else (chain,)
    case = tfarm.Case(LAB, GAINS, chain)
    assert to_dict(getattr(case, name)()) == to_dict(function(LAB, GAINS, *with_chain))
    assert getattr(tfarm.Case, name).__doc__ == function.__doc__


def test_the_face_is_shown_as_its_card_and_says_where_there_is_none():
    shown = repr(tfarm.Case(LAB, GAINS))
    card = tfarm.result_card(LAB, GAINS)
    assert shown.startswith("sasaki2012-lab: K1 = 0.3, K2 = 0.3, Kp = 0, sampled every 10 ms\n")
    assert f"{card.continuous.phase_margin.value:.4g} at" in shown
    locked = tfarm.Case(LAB.with_numbers(hub_inertia=float("inf")), GAINS)
    assert "\nno result card: " in repr(locked)
