"""Every key of a chain in every answer: it changes the answer, is named in its certainty, or is refused."""

import re
from dataclasses import fields, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import tfarm
from tests.exported.tuners import some_tuner
from tests.shared import docs_module, remembered
from tfarm.arm.chain import CHAIN_TABLES, stated_keys
from tfarm.arm.schema import file_keys
from tfarm.arm.stages import ARM_KEYS, STAGE_OF, STAGES, Consumer, Stage
from tfarm.assessment import step
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Converters, ReferenceShaping, kernel
from tfarm.dsp.results import simulate_scenario
from tfarm.errors import ParameterError
from tfarm.exact import system
from tfarm.exact.system import system_of
from tfarm.exported import controller, fmu, live_loop, result, systems, tuner_code
from tfarm.loop import sampled_verdict as verdicts
from tfarm.loop.sampled_analysis import sampled
from tfarm.loop.sampled_brief import sampled_brief
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import CONTINUOUS
from tfarm.report import live
from tfarm.schema import to_dict
from tfarm.synthesis import design
from tfarm.synthesis.judge import judge_of
from tfarm.synthesis.slew_measures import SlewMeasures
from tfarm.tuner import kernel as tuner
from tfarm.tuner.guard import sector_guard
from tfarm.tuner.trial import to_text
from tfarm.tuner.tuning import usual_plan

ARM, GAINS = tfarm.load("sasaki2012-lab"), tfarm.HubFeedback(K1=0.3, K2=0.3)
IDEAL = Chain()
FOLDER = TemporaryDirectory()
PROFILES = [f"{FOLDER.name}/{name}.csv" for name in "ab"]
for path, middle in zip(PROFILES, (0.5, 0.4), strict=True):
    Path(path).write_text(f"t,angle\n0,0\n1,{middle / 2}\n2,{middle}\n3,1\n", encoding="utf-8")
DIFFERENCE, RANGES = {"hub_rate": "difference"}, {"moment_range": 5.0, "torque_range": 5.0}
QUANTISERS = ("encoder", "amplifier steps", "amplifier range", "DAC steps", "DAC range", "torque limit")
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
    "reference.profile": ("polynomial", IDEAL),
    "reference.shaper": ("ZV", IDEAL),
    "reference.modes": (1, Chain(reference=ReferenceShaping(shaper="ZV"))),
    "reference.file": (PROFILES[1], Chain(reference=ReferenceShaping(profile="file", file=PROFILES[0]))),
    "reference.feedforward": ("inverse", Chain(reference=ReferenceShaping(profile="polynomial"))),
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
    values += SlewMeasures(arm, arm, chain, 8).of(GAINS).values()
    return values, sampled_brief(Case(arm, GAINS, chain)).words


def tuned(arm, chain):
    """What a tuning is made of: the trial, its guard, and the end of the slew through the converters."""
    trial = usual_plan(arm, chain).trial(arm, chain)
    end = trial.simulator().linear(GAINS).at_samples.tip_displacement[-1]
    return trial.with_constant(0.3).cost, sector_guard(trial.loop, 0.33, 0.34).sentence, end


def exported(form, what, tuned=None):
    def export(arm, chain):
        precision = "float" if (form, what) == ("c", "controller") else "double"
        case = Case(arm, GAINS, chain)
        task = result.ExportTask(case=case, what=what, form=form, precision=precision, anyway=True, tuned=tuned)
        module, _, function = result.WRITERS[what, form].partition(":")
        made = getattr(import_module(f"tfarm.exported.{module}"), function)(task)
        return made.contents, made.verdict

    return export


def tuner_in_c(arm, chain):
    """A tuner of the period of the chain, whose file has one name."""
    saved = some_tuner(
        np.random.default_rng(0), period=chain.sampling.period, guard_kind="time-varying", guard=(0.33, 0.34)
    )
    with TemporaryDirectory() as folder:
        file = Path(folder) / "tuned.json"
        file.write_text(to_text(saved), encoding="utf-8")
        return exported("c", "tuner", file)(arm, chain)


def run_of(arm, chain):
    return simulate_scenario(Case(arm, GAINS, chain), "slew", 1.5, count=3).signals


def answers_of_samples(arm, chain):
    """Verdict, margins, and the column of the card."""
    found = sampled(arm, GAINS, chain, count=3)
    brief = sampled_brief(Case(arm, GAINS, chain))
    return to_dict(found.verdict), found.gain_factors, brief, to_dict(card_of(arm, chain).sampled)


ANSWERS = {
    CONTINUOUS: lambda arm, chain: to_dict(card_of(arm, chain).continuous),
    verdicts.SAMPLED_LOOP: answers_of_samples,
    step.CONSUMER: lambda arm, chain: {
        name: (loop.certainty, *map(list, loop.signals.values()))
        for name, loop in tfarm.step(arm, GAINS, chain, "slew", 0.3).loops.items()
    },
    kernel.CONSUMER: lambda arm, chain: {name: list(values) for name, values in run_of(arm, chain).items()},
    design.CONSUMER: designed,
    tuner.CONSUMER: tuned,
    controller.CONSUMER: exported("c", "controller"),
    tuner_code.CONSUMER: tuner_in_c,
    fmu.CONSUMER: exported("fmu", "loop"),
    systems.CONSUMER: exported("py", "loop"),
    live_loop.CONSUMER: lambda arm, chain: (
        live_loop.sampled_numbers(sampled_verdict(Case(arm, GAINS, chain), count=3).loop),
        live_loop.slew_numbers(Case(arm, GAINS, chain)),
    ),
}  # fmt: skip
PUBLIC = {  # the functions that users call, which refuse before any work
    "transfer": lambda arm, _: tfarm.transfer(arm, "hub_angle"),
    "modes": lambda arm, _: tfarm.modes(arm, 3),
    "margins": lambda arm, _: tfarm.margins(arm, GAINS),
    "verdict": lambda arm, chain: sampled_verdict(Case(arm, GAINS, chain)),
    "sampled": lambda arm, chain: tfarm.sampled(arm, GAINS, chain),
    "card": lambda arm, chain: tfarm.result_card(arm, GAINS, chain),
    "step": lambda arm, chain: tfarm.step(arm, GAINS, chain),
    "simulate": lambda arm, chain: tfarm.simulate(arm, GAINS, chain),
    "design": lambda arm, chain: tfarm.design(arm, chain=chain),
    "tune": lambda arm, chain: tfarm.tune(arm, chain=chain),
    "live page": lambda arm, chain: live.explore(arm, GAINS, chain),
    **{
        f"export {what} {form}": lambda arm, chain, form=form, what=what: tfarm.export(
            arm, GAINS, chain=chain, what=what, form=form, folder="never-made"
        )
        for what, form in result.WRITERS
    },
}


def test_every_key_has_a_stage_and_every_consumer_states_stages_that_there_are():
    chain = {f"{table}.{each.name}" for table in CHAIN_TABLES for each in fields(getattr(Chain(), table))}
    assert chain == set(CHANGES) == set(STAGE_OF) - set(ARM_KEYS)
    others = ("law", "weights", "measured", "sensor", "drive", *CHAIN_TABLES)
    arm = {key.removeprefix("top.") for key in file_keys() if key.partition(".")[0] not in others}
    tables = {"link", "hub", "clamp", "joint", "motor", "attachment", "gauge", "payload"}
    filled = {"link.material", "link.section"}  # by numbers that have their own keys
    assert arm - tables - filled == set(ARM_KEYS)
    assert len(STAGE_OF) == sum(len(stage.keys) for stage in STAGES)
    for consumer in ANSWERS:
        stated = [*consumer.acts, *consumer.named, *consumer.partly, *consumer.none]
        # which are refused
        left = ["shaper"] * (consumer is tuner_code.CONSUMER)
        assert sorted([*stated, *left]) == sorted(stage.name for stage in STAGES), consumer.name


@pytest.mark.parametrize("key", CHANGES)
def test_a_chain_is_linear_where_its_stages_are(key):
    before, after = changed(key)
    keys = [key, *(f"{table}.{name}" for table, own in stated_keys(before).items() for name in own)]
    assert after.is_linear == all(STAGE_OF[each].is_linear for each in keys)
    assert Chain().is_linear
    assert STAGE_OF[key].is_linear == (STAGE_OF[key].name not in QUANTISERS)


def test_the_table_of_the_documentation_has_every_consumer():
    root = Path(tfarm.__file__).parent
    declared = [path for path in root.rglob("*.py") if re.search(r"= Consumer\(", path.read_text("utf-8"))]
    found = {
        value
        for path in declared
        for value in vars(import_module(".".join(["tfarm", *path.relative_to(root).with_suffix("").parts]))).values()
        if isinstance(value, Consumer)
    }
    assert found - {system.CONSUMER} == set(ANSWERS) == set(docs_module("conf").CONSUMERS)


WALKED = [pytest.param(each, id=each.name, marks=[pytest.mark.survey] * (each is CONTINUOUS)) for each in ANSWERS]


@pytest.mark.parametrize("consumer", WALKED)
def test_a_key_changes_the_answer_or_is_named_in_it(consumer, monkeypatch):
    monkeypatch.setattr(result.ExportTask, "sha256", "of the inputs")
    monkeypatch.setattr("tfarm.exported.fmu.binary_of", lambda sources, identifier: ({}, "none"))
    for place in ("exported.result.sampled", "assessment.step.sampled_verdict"):
        few = partial(sampled if place.endswith("sampled") else sampled_verdict, count=3)
        monkeypatch.setattr(f"tfarm.{place}", few)
    ask = remembered(lambda chain: str(ANSWERS[consumer](ARM, chain)))
    for key in [key for key in CHANGES if consumer.word(STAGE_OF[key].name)]:
        before, after = map(ask, changed(key))
        stage = STAGE_OF[key]
        word, name = consumer.word(stage.name), stage.remainder or key.partition(".")[2]
        is_named = "not covered: " in after and name in after.partition("not covered: ")[2].partition("'")[0]
        assert (before != after) == (word != "none"), key
        if word in ("named", "partly"):
            assert is_named, key
            assert (without(before) != without(after)) == (word == "partly"), key


def without(text):
    """An answer without what it names."""
    return re.sub(r"; not covered: [\w, ]*", "", text)


FRICTION = replace(ARM, hub=replace(ARM.hub, friction=0.0123))
DAMPED = Chain(actuator=Actuator(hub_damping=0.1))
NEW = {  # an arm or a chain with a key that has no stage yet, or a stage that no consumer states
    "hub.friction": (FRICTION, IDEAL),
    "actuator.hub_damping": (ARM, DAMPED),
}
OF_ARM_ALONE = ("transfer", "modes", "margins")
REFUSALS = [(answer, key) for answer in PUBLIC for key in NEW if key == "hub.friction" or answer not in OF_ARM_ALONE]


@pytest.mark.parametrize("stage", [None, "dry friction"])
@pytest.mark.parametrize(("answer", "key"), REFUSALS)
def test_a_new_key_and_a_new_stage_are_refused_by_default(answer, key, stage, monkeypatch):
    if stage:
        monkeypatch.setitem(STAGE_OF, key, Stage(stage, (key,), "", "", is_linear=False))
    else:
        monkeypatch.delitem(STAGE_OF, key)
    system_of.cache_clear()
    with pytest.raises(ParameterError) as refused:
        PUBLIC[answer](*NEW[key])
    words = f"does not have the stage {stage}: leave it out" if stage else "does not have this key: leave it out"
    assert str(refused.value).startswith(f"{key} = ")
    assert str(refused.value).endswith(words)


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
