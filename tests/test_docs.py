"""The pages of the documentation that are made from the code name every command, option, key and public name."""

import re
from pathlib import Path

import pytest

from tests.shared import docs_module
from tfarm.arm.schema import SHAPE_TABLES
from tfarm.cli.running import commands_of, whole_command
from tfarm.schema.glossary import declared_records

DOCS = Path(__file__).parent.parent / "docs"


@pytest.fixture(scope="module")
def conf():
    return docs_module("conf")


def test_every_command_and_option_is_on_the_page_of_commands(conf):
    sections = dict(
        re.findall(r"^##+ `tfarm ([\w ]+)`$(.*?)(?=^##|\Z)", conf.commands_page(), re.MULTILINE | re.DOTALL)
    )
    commands = commands_of(whole_command())
    assert sections.keys() == commands.keys() | {"proof"}
    for name, command in commands.items():
        for each in command.params:
            assert all(option in sections[name] for option in each.opts if option.startswith("--")), (name, each)


def test_every_key_of_an_arm_file_is_on_its_page(conf):
    page = conf.arm_file_page()
    for table in (*SHAPE_TABLES.values(), *conf.FILE_TABLES.values()):
        assert all(f"| `{key}` |" in page for key in table.model_fields)
    assert "| `friction` | hub friction b | N m s/rad | float | `0.0` | viscous torque" in page
    assert "| `inertia` | hub inertia I_h | kg m^2 | float |  | about the axis" in page


def test_the_table_of_keys_has_each_key_and_each_answer(conf):
    table = conf.arm_file_page().partition("## Keys and answers")[2]
    titles = (
        "keys | continuous-time column | sampled loop | step | simulate | design | tune | "
        "export c | export c of a tuner | export fmu | export mat, py | live page"
    )
    assert f"| {titles} |" in table
    assert "| `actuator.hub_damping` | acts | acts |" in table
    assert all(f"`{name}.{key}`" in table for name, kind in conf.CHAIN_TABLES.items() for key in kind.model_fields)


def test_every_json_key_of_every_record_is_in_its_section(conf):
    sections = dict(re.findall(r"^## (\S+ \(\w+\))$(.*?)(?=^## |\Z)", conf.json_page(), re.MULTILINE | re.DOTALL))
    records = list(declared_records())
    assert len(sections) == len(records)
    assert {"Margins (loop)", "ModeList (spectrum)", "Verdict (loop)"} <= sections.keys()
    for kind, declared in records:
        section = sections[f"{kind.__name__} ({kind.__module__.split('.')[1]})"]
        assert all(f"| `{of.key}` | {of.label} |" in section.replace(r"\|", "|") for of in declared.values()), kind


def test_every_labelled_quantity_has_a_help_that_is_not_its_label():
    records = declared_records()
    assert len({kind.__module__.split(".")[1] for kind, _ in records}) > 12
    for kind, declared in records:
        bare = [name for name, of in declared.items() if of.label and of.help.casefold() in ("", of.label.casefold())]
        assert bare == [], kind


def test_the_page_of_words_has_the_five_words_with_their_conditions(conf):
    assert "{{ certainty }}" in (DOCS / "words.md").read_text(encoding="utf-8")
    rows = conf.myst_substitutions["certainty"].splitlines()[2:]
    assert [row.split("**")[1] for row in rows] == ["exact", "certified", "converged", "approximate", "not determined"]
    assert all(len(row.split(" | ")) == 3 for row in rows)


def test_every_page_is_in_a_table_of_contents():
    listed = set(re.findall(r"^[\w/-]+$", (DOCS / "index.md").read_text(encoding="utf-8"), re.MULTILINE))
    pages = {str(path.relative_to(DOCS).with_suffix("")) for path in DOCS.rglob("*.md") if "_build" not in path.parts}
    assert listed == (pages | {"reference/commands", "reference/json", "reference/arm-file"}) - {"index"}
