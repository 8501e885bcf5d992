"""D. H. Hodges and M. J. Rutkowski (1981): a cantilever whose depth falls to a half towards the tip, at rest.

The rows at zero speed of their rotating tapered beam, EI = (1 - x/2)^3 and rhoA = 1 - x/2, Euler-Bernoulli.  Set down
without a copy at hand; each digit is confirmed here.
"""

from tests.published.chains import stepped, without_steps
from tfarm import Payload
from tfarm.audit.published import agrees

PRINTED = ("3.8238", "18.3173", "47.2648")


def test_every_printed_digit_is_right():
    found = without_steps(lambda n: stepped(n, lambda x: (1 - x / 2) ** 3, lambda x: 1 - x / 2, Payload()), 3)
    assert [agrees(ours, printed) for ours, printed in zip(found.tolist(), PRINTED, strict=True)] == [True] * 3
