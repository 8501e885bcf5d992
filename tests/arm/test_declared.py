"""A table of the file has the arguments of its record's constructor: keys, types and defaults, each declared once."""

import pytest

from tfarm.arm import load, schema
from tfarm.arm.chain import CHAIN_TABLES
from tfarm.arm.law_tables import LawTable, SignalTable
from tfarm.arm.schema import ARM_TABLES, SHAPE_TABLES, ArmTable, LinkTable, file_keys
from tfarm.fitting.recording import RunTable

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
    numbers = {
        key for key in keys if key.startswith("link.") and key.split(".")[-1] not in ("section", "shape", "material")
    }
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
