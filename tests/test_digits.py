import math
from functools import partial

import pytest

from tfarm.digits import (
    align_decimals,
    fix_decimals,
    how_many,
    join_words,
    plain,
    round_to_error,
    scientific,
    significant,
    unit,
)


@pytest.mark.parametrize(
    ("write", "given", "text"),
    [
        (significant, (71.505682466890, 8), "71.505682"),
        (significant, (999.99996, 7), "1000.000"),
        (significant, (-0.8469415040, 4), "−0.8469"),
        (significant, (1631660.9088, 8), "1631660.9"),
        (significant, (1.8e-9, 2), "1.8 × 10⁻⁹"),
        (significant, (6.8944e10, 5), "6.8944 × 10¹⁰"),
        (significant, (0.0, 5), "0"),
        (significant, (math.inf, 5), "∞"),
        (significant, (-math.inf, 5), "−∞"),
        *((plain, (x,), text) for x, text in ((2766.7, "2766.7"), (1.0, "1"), (100.0, "100"), (6e-4, "6 × 10⁻⁴"))),
        (plain, (-20.5,), "−20.5"),
        (
            align_decimals,
            ([71.50568247, 7657.0526718], 8),
            ("71.5057", "7657.0527"),
        ),  # a column: one number of decimals
        (partial(align_decimals, least=7), ([71.50568247, 7657.0526718], 8), ("71.50568", "7657.05267")),
        (align_decimals, ([1e-9, 1e9, 0.0, math.inf], 3), ("1.00 × 10⁻⁹", "1.00 × 10⁹", "0", "∞")),  # over many decades
        (fix_decimals, ([-1e-9, -0.25], 3), ("0.000", "−0.250")),  # what rounds to zero has no sign
        (scientific, (94.96, 4), "9.496 × 10¹"),
        (scientific, (-6.8e-300, 2), "−6.8 × 10⁻³⁰⁰"),
        (round_to_error, (0.0, 1e-9, 12), "0"),
        (round_to_error, (-1.57e-15, 1e-12, 12), "0 (+-1e-12)"),
        (round_to_error, (-0.004825413349860159, 2e-11, 12), "-0.0048254133"),  # the digits that its error leaves
        (round_to_error, (123.456789, 1e-20, 6), "123.457"),
        (unit, ("kg m^2",), "kg m²"),
        (unit, ("m^-3",), "m⁻³"),
        *((how_many, (n, "pole"), text) for n, text in ((0, "no poles"), (1, "1 pole"), (2, "2 poles"))),
        (how_many, (0.5, "pole"), "0.5 poles"),
        *((join_words, (["a", "b", "c"][:n],), text) for n, text in ((1, "a"), (2, "a and b"), (3, "a, b and c"))),
    ],
)
def test_numbers_and_lists_as_a_person_writes_them(write, given, text):
    assert write(*given) == text
