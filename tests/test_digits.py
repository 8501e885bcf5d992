import math

import pytest

from tfarm.digits import aligned, fixed, how_many, listed, plain, scientific, significant, unit


@pytest.mark.parametrize(
    ("x", "digits", "text"),
    [
        (71.505682466890, 8, "71.505682"),
        (999.99996, 7, "1000.000"),
        (-0.8469415040, 4, "−0.8469"),
        (1631660.9088, 8, "1631660.9"),
        (1.8e-9, 2, "1.8 × 10⁻⁹"),
        (6.8944e10, 5, "6.8944 × 10¹⁰"),
        (0.0, 5, "0"),
        (math.inf, 5, "∞"),
        (-math.inf, 5, "−∞"),
    ],
)
def test_significant_digits(x, digits, text):
    assert significant(x, digits) == text


@pytest.mark.parametrize(
    ("x", "text"), [(2766.7, "2766.7"), (1.0, "1"), (100.0, "100"), (6e-4, "6 × 10⁻⁴"), (-20.5, "−20.5")]
)
def test_plain_numbers_have_no_trailing_zeros(x, text):
    assert plain(x) == text


def test_a_column_has_one_number_of_decimals():
    assert aligned([71.50568247, 7657.0526718], 8) == ("71.5057", "7657.0527")
    assert aligned([71.50568247, 7657.0526718], 8, least=7) == ("71.50568", "7657.05267")


def test_a_column_over_many_decades_has_powers_of_ten():
    assert aligned([1e-9, 1e9, 0.0, math.inf], 3) == ("1.00 × 10⁻⁹", "1.00 × 10⁹", "0", "∞")


def test_a_value_that_rounds_to_zero_has_no_sign():
    assert fixed([-1e-9, -0.25], 3) == ("0.000", "−0.250")


def test_powers_of_ten_and_units():
    assert scientific(94.96, 4) == "9.496 × 10¹"
    assert unit("kg m^2") == "kg m²"
    assert unit("m^-3") == "m⁻³"


def test_counts_and_lists_read_as_a_person_writes_them():
    assert [how_many(n, "pole") for n in (0, 1, 2, 0.5)] == ["no poles", "1 pole", "2 poles", "0.5 poles"]
    assert [listed(words) for words in (["a"], ["a", "b"], ["a", "b", "c"])] == ["a", "a and b", "a, b and c"]
