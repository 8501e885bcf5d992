"""Laws as files: there and back to the last bit, whatever they hold."""

import numpy as np
import pytest

from tfarm import Law, ParameterError
from tfarm.arm.law_tables import load_law
from tfarm.arm.writing import law_toml, save_law


def some_law(rng):
    """A law of one to three signals, each a gain or a rational of order up to four."""
    names = rng.permutation(["hub_angle", "hub_rate", "root_moment", "strain@0.05", "strain@0.3"])[: rng.integers(1, 4)]
    entries = {}
    for name in names:
        order = int(rng.integers(0, 5))
        den = np.r_[1.0, np.exp(rng.normal(size=order) * 5)]
        entries[str(name)] = float(rng.normal()) if not order else (rng.normal(size=order + 1), den)
    sign, references = int(rng.choice([-1, 1])), (str(names[0]),) if rng.random() < 0.5 else ()
    period = None if rng.random() < 0.5 else 0.01
    return Law(entries, delay=float(rng.random()), sign=sign, references=references, period=period, name='a "law", θ')


@pytest.mark.parametrize("seed", range(20))
def test_there_and_back(seed, tmp_path):
    law = some_law(np.random.default_rng(seed))
    save_law(law, tmp_path / "law.toml")
    again = load_law(tmp_path / "law.toml")
    assert again == law
    assert law_toml(again) == law_toml(law)


def test_what_is_not_usual_is_kept(tmp_path):
    law = Law({"root_moment": ((1.0, 0.0), (0.1, 1.0))}, input="motor_voltage", rule="zoh", prewarp=30.0)
    save_law(law, tmp_path / "law.toml")
    assert load_law(tmp_path / "law.toml") == law


def test_a_state_space_is_refused_in_one_line():
    law = Law.of_matrices([[-1.0]], [[1.0, 0.5]], [[1.0]], [[0.0, 0.0]], ["hub_angle", "hub_rate"])
    with pytest.raises(ParameterError, match="savemat"):
        law_toml(law)
