"""Every key of a chain in every answer: it changes the answer, is named in its certainty, or is refused."""

import re
from dataclasses import fields, replace
from functools import partial
from importlib import import_module

import pytest

import tfarm
from tests.shared import remembered
from tfarm.arm.chain import CHAIN_TABLES
from tfarm.arm.schema import file_keys
from tfarm.dsp import Actuator, Chain, Converters, stages
from tfarm.dsp.results import simulated_run
from tfarm.errors import ParameterError
from tfarm.exported import result
from tfarm.exported.live_loop import sampled_numbers, slew_numbers
from tfarm.loop.sampled_verdict import sampled, sampled_brief, sampled_verdict
from tfarm.report.live import explore
from tfarm.schema import to_dict
from tfarm.synthesis.judge import judge_of
from tfarm.tuner.guard import sector_guard
from tfarm.tuner.tuning import usual_plan

ARM, GAINS = tfarm.load("sasaki2012-lab"), tfarm.HubFeedback(K1=0.3, K2=0.3)
IDEAL = Chain()
DIFFERENCE, RANGES = {"hub_rate": "difference"}, {"moment_range": 5.0, "torque_range": 5.0}
CHANGES = {  # another value of each key, and what it needs beside it
    "sampling.period": (0.008, IDEAL),
    "sampling.delay_samples": (0.3, IDEAL),
    "sampling.antialias_corner": (300.0, IDEAL),
    "converters.encoder_counts": (1000, Chain(converters=Converters(**DIFFERENCE))),
    "converters.hub_rate": ("difference", IDEAL),
    "converters.rate_filter": (100.0, Chain(converters=Converters(**DIFFERENCE))),
    "converters.moment_bits": (6, Chain(converters=Converters(**RANGES))),
    "converters.moment_range": (0.5, IDEAL),
    "converters.torque_bits": (6, Chain(converters=Converters(**RANGES))),
    "converters.torque_range": (1.0, IDEAL),
    "converters.arithmetic": ("float32", IDEAL),
    "actuator.torque_limit": (1.0, IDEAL),
    "actuator.motor_constant": (0.5, IDEAL),
    "actuator.hub_damping": (0.1, IDEAL),
    "slew.travel": (0.7, IDEAL),
    "slew.rise_time": (0.8, IDEAL),
    "slew.reading": ("total", IDEAL),
}


def changed(key):
    """The chain without a key, and with its other value."""
    value, chain = CHANGES[key]
    table, name = key.split(".")
    return chain, replace(chain, **{table: replace(getattr(chain, table), **{name: value})})


def card_of(arm, chain):
    known = sampled(arm, GAINS, chain, count=3)
    return tfarm.result_card(arm, GAINS, chain, continuous=tfarm.margins(ARM, GAINS), at_samples=known)


def designed(arm, chain):
    """What a design is judged by: its objectives, and the verdict that is printed with it."""
    values = [
        judge_of(arm, arm, chain, objective, ("hub_rate", "root_moment"), 2, 8).value(GAINS)
        for objective in ("damping", "residual")
    ]
    return values, sampled_brief(arm, GAINS, chain).words


def tuned(arm, chain):
    """What a tuning is made of: the trial, its guard, and the end of the slew through the converters."""
    trial = usual_plan(arm, chain).trial(arm, chain)
    end = trial.simulator().linear(GAINS).at_samples.tip_displacement[-1]
    return trial.with_constant(0.3).cost, sector_guard(trial.loop, 0.33, 0.34).sentence, end


def exported(form, what):
    def export(arm, chain):
        precision = "float" if form == "c" else "double"
        task = result.ExportTask(
            arm=arm, given=GAINS, chain=chain, what=what, form=form, precision=precision, anyway=True
        )
        module, _, function = result.WRITERS[what, form].partition(":")
        made = getattr(import_module(f"tfarm.exported.{module}"), function)(task)
        return made.contents, made.verdict

    return export


def run_of(arm, chain):
    return simulated_run(arm, GAINS, chain, "slew", 1.5, count=3).signals


ANSWERS = {
    "continuous-time column": lambda arm, chain: to_dict(card_of(arm, chain).continuous),
    "verdict": lambda arm, chain: to_dict(sampled_verdict(arm, GAINS, chain, count=3)),
    "margins": lambda arm, chain: (sampled(arm, GAINS, chain, count=3).gain_factors, sampled_brief(arm, GAINS, chain)),
    "card": lambda arm, chain: to_dict(card_of(arm, chain)),
    "step": lambda arm, chain: {
        name: (loop.certainty, *map(list, loop.signals.values()))
        for name, loop in tfarm.step(arm, GAINS, chain, "slew", 0.3).loops.items()
    },
    "simulate": lambda arm, chain: {name: list(values) for name, values in run_of(arm, chain).items()},
    "design": designed,
    "tune": tuned,
    "export c": exported("c", "controller"),
    "export fmu": exported("fmu", "loop"),
    "export mat": exported("mat", "loop"),
    "export py": exported("py", "loop"),
    "live page": lambda arm, chain: (
        sampled_numbers(sampled_verdict(arm, GAINS, chain, count=3).loop), slew_numbers(arm, chain, GAINS)
    ),
}  # fmt: skip
PUBLIC = {  # the functions that users call, which refuse before any work
    "verdict": lambda arm, chain: sampled_verdict(arm, GAINS, chain),
    "margins": lambda arm, chain: tfarm.sampled(arm, GAINS, chain),
    "card": lambda arm, chain: tfarm.result_card(arm, GAINS, chain),
    "step": lambda arm, chain: tfarm.step(arm, GAINS, chain),
    "simulate": lambda arm, chain: tfarm.simulate(arm, GAINS, chain),
    "design": lambda arm, chain: tfarm.design(arm, chain=chain),
    "tune": lambda arm, chain: tfarm.tune(arm, chain=chain),
    "live page": lambda arm, chain: explore(arm, GAINS, chain),
    **{
        f"export {form}": lambda arm, chain, form=form, what=what: tfarm.export(
            arm, GAINS, chain=chain, what=what, form=form, folder="never-made"
        )
        for form, what in {"c": "controller", "fmu": "plant", "mat": "loop", "py": "plant"}.items()
    },
}


def test_every_key_and_every_answer_is_in_the_table():
    rows = {key: words for keys in stages.stages().values() for key, words in keys.items()}
    chain = {f"{table}.{each.name}" for table in CHAIN_TABLES for each in fields(getattr(Chain(), table))}
    assert chain == set(CHANGES) == {key for key in rows if key.partition(".")[0] in CHAIN_TABLES}
    others = ("law", "measured", "sensor", *CHAIN_TABLES)
    arm = {key.removeprefix("top.") for key in file_keys() if key.partition(".")[0] not in others}
    tables = {"link", "hub", "clamp", "joint", "motor", "attachment", "gauge", "payload"}
    filled = {"link.material", "link.section"}  # by numbers that have their own keys
    assert arm - tables - filled == {key for key in rows if key.partition(".")[0] not in CHAIN_TABLES}
    assert all(words.keys() == ANSWERS.keys() for words in rows.values())
    assert {word for words in rows.values() for word in words.values()} <= {"acts", "named", "partly", "none"}


LIKE_OTHERS = ("continuous-time column", "margins", "export mat")  # of card, verdict and export py
WALKED = [pytest.param(each, marks=[pytest.mark.survey] * (each in LIKE_OTHERS)) for each in ANSWERS]


@pytest.mark.parametrize("answer", WALKED)
def test_a_key_changes_the_answer_or_is_named_in_it(answer, monkeypatch):
    monkeypatch.setattr(result.ExportTask, "sha256", "of the inputs")
    monkeypatch.setattr("tfarm.exported.fmu.binary_of", lambda sources, identifier: ({}, "none"))
    for place in ("exported.result.sampled", "exported.controller.sampled", "assessment.step.sampled_verdict"):
        few = partial(sampled if place.endswith("sampled") else sampled_verdict, count=3)
        monkeypatch.setattr(f"tfarm.{place}", few)
    ask = remembered(lambda chain: str(ANSWERS[answer](ARM, chain)))
    for key in CHANGES:
        before, after = map(ask, changed(key))
        word, name = stages.word_of(key, answer), stages.REMAINDERS.get(key, key.partition(".")[2])
        assert (before != after) == (word != "none"), key
        is_named = "not covered: " in after and name in after.partition("not covered: ")[2].partition("'")[0]
        if word in ("named", "partly"):
            assert is_named, key
            assert (without(before) != without(after)) == (word == "partly"), key


def without(text):
    """An answer without what it names."""
    return re.sub(r"; not covered: [\w, ]*", "", text)


FRICTION = replace(ARM, hub=replace(ARM.hub, friction=0.01))
NEW_KEYS = {  # an arm and a chain with a key that the table does not have yet, or that an answer refuses
    "actuator.hub_damping": (ARM, Chain(actuator=Actuator(hub_damping=0.1)), None),
    "hub.friction": (FRICTION, IDEAL, None),
    "actuator.torque_limit": (ARM, Chain(actuator=Actuator(torque_limit=1.0)), stages.REFUSED),
}


@pytest.mark.parametrize("key", NEW_KEYS)
@pytest.mark.parametrize("answer", PUBLIC)
def test_a_key_without_a_row_is_refused_by_default(key, answer, monkeypatch):
    arm, chain, word = NEW_KEYS[key]
    rows = {
        stage: {of: words if of != key else words | {answer: word} for of, words in keys.items() if of != key or word}
        for stage, keys in stages.stages().items()
    }
    monkeypatch.setattr(stages, "stages", lambda: rows)
    with pytest.raises(ParameterError) as refused:
        PUBLIC[answer](arm, chain)
    words = str(refused.value)
    assert words.startswith(f"{key} = ")
    assert words.endswith("does not have this key: leave it out")
    assert word is None or f": {answer} does not" in words


def test_code_in_c_is_in_the_arithmetic_of_the_chain(tmp_path):
    single = Chain(converters=Converters(arithmetic="float32"))
    wanted = {"what": "controller", "form": "c", "chain": single, "folder": tmp_path / "c"}
    for precision in ("double", "q31"):
        with pytest.raises(ParameterError, match=f"arithmetic = 'float32': the code is in {precision}"):
            tfarm.export(ARM, GAINS, precision=precision, **wanted)
    assert tfarm.export(ARM, GAINS, precision="float", **wanted).details.precision == "float"


def test_the_continuous_column_of_a_step_names_a_limit():
    found = tfarm.step(ARM, GAINS, Chain(actuator=Actuator(torque_limit=1.0)), duration=0.5)
    assert found.continuous.certainty.endswith(" poles; not covered: torque_limit")
    assert "not covered" not in found.sampled.certainty


@pytest.mark.parametrize("key", [key for key in CHANGES if key.startswith("slew.")])
def test_both_columns_of_a_step_follow_the_slew(key):
    """One that kept the usual slew would hide behind the other in the walk over all keys."""
    before, after = (tfarm.step(ARM, GAINS, chain, "slew", 0.3).loops for chain in changed(key))
    for name, loop in before.items():
        assert all((here[1:] != there[1:]).any() for here, there in zip(
            loop.signals.values(), after[name].signals.values(), strict=True))  # fmt: skip
