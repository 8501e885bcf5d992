"""A table of the file is what its record's constructor asks for: keys, types and defaults, each declared once."""

from dataclasses import dataclass

import pytest

from tfarm.arm import load, schema
from tfarm.arm.law_tables import LawTable, SignalTable
from tfarm.arm.schema import ARM_TABLES, SHAPE_TABLES, ArmTable, LinkTable, file_keys
from tfarm.dsp.chain import CHAIN_TABLES
from tfarm.errors import ParameterError
from tfarm.fitting.recording import RunTable


@dataclass(frozen=True, kw_only=True)
class Spring:
    stiffness: float
    coils: int = 7

    def __post_init__(self):
        if self.stiffness < 0:
            raise ParameterError(key="spring.stiffness", value=self.stiffness, remedy="zero or more")


@schema.of(Spring)
class SpringTable(schema.TomlTable):
    """[spring], with a colour that no spring asks for."""

    colour: str = "grey"


def test_keys_and_defaults_are_those_of_the_record():
    assert list(SpringTable.model_fields) == ["colour", "stiffness", "coils"]
    assert SpringTable.__doc__.startswith("[spring], with a colour")
    assert SpringTable.model_validate({"stiffness": 2.0, "colour": "red"}).build() == Spring(stiffness=2.0, coils=7)
    with pytest.raises(ParameterError, match="zero or more"):
        SpringTable.model_validate({"stiffness": -1.0}).build()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({}, "spring.stiffness is missing: give a number"),
        (3, "spring = 3: wrong type; give a table, headed [spring]"),
        ({"stiffness": "2"}, "spring.stiffness = '2': wrong type; give a number without quotes"),
        ({"stifness": 2.0}, 'spring.stifness = 2.0: unknown key; did you mean "stiffness"?'),
    ],
)
def test_one_wrong_key_is_named_in_a_line(table, words):
    with pytest.raises(ParameterError) as refused:
        schema.validated(SpringTable, table, "spring")
    assert str(refused.value).startswith(words)


FILE_TABLES = {
    "top": [ArmTable], "link": [LinkTable], "link.section": SHAPE_TABLES.values(), "law": [LawTable],
    "law.SIGNAL": [SignalTable], "measured": [RunTable],
    **{name: [table] for name, table in (ARM_TABLES | CHAIN_TABLES).items() if name not in ("", "link")},
}  # fmt: skip


def test_each_key_of_a_file_has_one_label_unit_and_meaning():
    """`keys.toml` is also the contract with every file there is: a key that a record renames is missing there."""
    keys = {f"{place}.{key}" for place, tables in FILE_TABLES.items() for table in tables for key in table.model_fields}
    assert file_keys().keys() == keys | {"sensor.gain", "sensor.delay"}
    for key, of in file_keys().items():
        assert of.label
        assert len(of.help.split()) > 1, key
    numbers = {key for key in keys if key.startswith("link.") and key.split(".")[-1] not in ("section", "shape")}
    assert {key for key in numbers if not file_keys()[key].unit} == {"link.poissons_ratio", "link.section.shear_factor"}


@pytest.mark.parametrize(
    ("key", "label", "unit"),
    [
        ("link.2.section.width", "width of the section", "m"),
        ("attachment.1.stiffness", "attached stiffness", "N/m"),
        ("hub.stiffness", "hub stiffness", "N m/rad"),
        ("gain:2", "sensor gain", ""),
        ("theory", "beam theory", ""),
        ("actuator.torque_limit", "limit of the input", "A"),
    ],
)
def test_a_number_of_a_file_is_found_by_its_place(key, label, unit):
    found = schema.file_key(key, load("quanser-2dsfl"))  # driven by a current
    assert (found.label, found.unit) == (label, unit)
