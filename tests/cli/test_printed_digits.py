"""Every digit that is printed of an eigenvalue holds."""

import math
from dataclasses import replace
from decimal import Decimal

import pytest

import tfarm
from tests.shell import run
from tfarm.arm.writing import to_toml
from tfarm.digits import within
from tfarm.loop.poles import closed_loop_poles
from tfarm.schema.quantities import COMPLEX_ERROR


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.0, 1e-9, "0"),
        (-1.57e-15, 1e-12, "0 (+-1e-12)"),
        (-0.004825413349860159, 2e-11, "-0.0048254133"),
        (123.456789, 1e-20, "123.457"),
    ],
)
def test_a_number_has_the_digits_that_its_error_leaves(value: float, error: float, text: str) -> None:
    assert within(value, error, 6 if error < 1e-15 else 12) == text


def pole_rows(printed):
    """The cells of the table of poles."""
    _, after = printed.split("damping ratio\n")
    return [line.split() for line in after.splitlines() if "default" not in line]


def test_poles_of_a_hardly_damped_arm_are_printed_as_far_as_they_are_proven(capsys, tmp_path) -> None:
    """C = 1e-10 s and a weak law: real parts below a millionth of the frequencies, against discs of 25 digits."""
    lab = tfarm.load("sasaki2012-lab")
    arm, file = replace(lab, link=replace(lab.link, damping=1e-10)), tmp_path / "arm.toml"
    file.write_text(to_toml(arm), encoding="utf-8")
    code, out, _ = run(capsys, "poles", str(file), "--K1", "1e-6", "--K2", "0", "--count", "6")
    assert code == 0
    discs = closed_loop_poles(arm, tfarm.HubFeedback(K1=1e-6), 6).certify(25)
    for row, disc in zip(pole_rows(out)[-len(discs) :], discs, strict=True):
        unit = Decimal(row[0]).as_tuple().exponent
        assert abs(Decimal(row[0]) - Decimal(disc.re)) <= Decimal(10) ** unit
        assert abs(Decimal(disc.re)) > COMPLEX_ERROR * math.hypot(float(disc.re), float(disc.im))


def test_a_lossless_loop_has_zeros_and_no_noise(capsys) -> None:
    code, out, _ = run(capsys, "poles", "sasaki2012", "--K1", "0", "--K2", "0.3", "--count", "6")
    assert code == 0
    assert [row[0] for row in pole_rows(out)] == ["0"] * 6
    code, out, _ = run(capsys, "sampled", "sasaki2012", "--K1", "0", "--K2", "0", "--modes", "4")
    assert code == 0
    assert "-0.000e+00" not in out
