"""Laws in float32: verdict and margins are those of the rounded numbers that run."""

import numpy as np
import pytest

import tfarm
from tests.loop.single_laws import ARM, SINGLE, T, judge
from tests.survey import each_of, tally
from tfarm import Law, ParameterError
from tfarm.arm.blocks import Rational
from tfarm.arm.law import Part
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.loop.sampled_verdict import sampled_verdict

NUM = [5.309725302697796, -26.46200484409234, 52.751661323395226, -52.58020328197535, 26.20481547108505,
       -5.223993971090474]  # fmt: skip
DEN = [1.0, -4.890597913089231, 9.56386468630438, -9.3479944276151, 4.566786481366978, -0.8920588268955377]
FIVE = Law({"hub_angle": (NUM, DEN)}, period=T, references=("hub_angle",))  # five poles next to z = 1


def test_the_certified_loop_is_the_one_that_runs_in_float32():
    """In float64 it is stable, in float32 it is neither in the verdict, nor on the card, nor in a simulation."""
    assert sampled_verdict(Case(ARM, FIVE, Chain(sampling=Sampling(period=T)))).word == "stable"
    found, card = sampled_verdict(Case(ARM, FIVE, SINGLE)), tfarm.result_card(ARM, FIVE, SINGLE).sampled
    assert (found.word, found.is_settled, card.stability, card.grade) == ("unstable", True, "unstable", "-")
    A = np.eye(5, k=-1)
    A[0] = -np.float32(DEN[1:])
    poles = np.sort_complex(1 + found.loop.in_z.poles)
    np.testing.assert_allclose(poles, np.sort_complex(np.linalg.eigvals(A)), atol=5e-3)  # by its own rounding
    assert tfarm.simulate(ARM, FIVE, SINGLE).stopped.time < 1.0


def test_rounded_laws_have_their_own_poles_and_growth():
    outcomes, _, wrong = tally(each_of(judge), 10, 3)
    assert (wrong, outcomes["unstable by rounding"] >= 3) == (0, True), outcomes


def test_gains_at_the_hub_are_rounded_too():
    gains = tfarm.HubFeedback(K1=0.3, K2=0.7)
    assert sampled_verdict(Case(ARM, gains, SINGLE)).loop.weights == (
        0.0,
        float(np.float32(0.3)),
        float(np.float32(0.7)),
    )


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (Law({}, parts=(Part(("hub_rate",), Rational((0.1,))),) * 2, period=T), "a signal has one part"),
        (Law({"hub_rate": ([1e39], [1.0, -0.5])}, period=T), "is beyond 3.4e+38"),
    ],
)
def test_what_float32_does_not_have_is_refused(law, message):
    for ask in (tfarm.sampled, tfarm.simulate):
        with pytest.raises(ParameterError, match=r"converters\.arithmetic = 'float32'") as refused:
            ask(ARM, law, SINGLE)
        assert message in str(refused.value)


def test_code_has_a_realisation_of_its_own(tmp_path):
    """In sections of second order a law keeps its poles in float32, and the code is certified with them."""
    den, num = (np.poly(np.exp(np.array(poles) * T)) for poles in ((-4.0, -13.0, -21.0, -39.0), (-5.0,)))
    law = Law({"hub_angle": (0.05 * den.sum() / num.sum() * num, den), "hub_rate": 0.3}, period=T)
    found = tfarm.export(ARM, law, chain=SINGLE, what="controller", form="c", precision="float", folder=tmp_path)
    assert found.details.realisation == "second-order sections"
    assert found.verdict.startswith("stable (certified up to ")
    with pytest.raises(ParameterError, match="is not certified stable: unstable"):  # as given, in every entry
        tfarm.export(ARM, law, chain=SINGLE, what="controller", form="py", folder=tmp_path)
