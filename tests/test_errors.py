import pickle
import re

import pytest

from tfarm.errors import (
    MISSING,
    CertificationError,
    ConvergenceError,
    ParameterError,
    TfarmError,
    did_you_mean,
    name_file,
)


def error(key="link.length", value=-1.0, remedy="a length is positive", file=None):
    return ParameterError(key=key, value=value, remedy=remedy, file=file)


def test_a_parameter_error_names_file_key_value_and_remedy():
    assert str(error()) == "link.length = -1.0: a length is positive"
    assert str(error().in_file("my arm.toml")) == "my arm.toml: link.length = -1.0: a length is positive"
    assert str(error(value=MISSING)) == "link.length is missing: a length is positive"
    assert str(error(value=True)) == "link.length = true: a length is positive"
    assert isinstance(error(), ValueError)
    assert isinstance(error(), TfarmError)


@pytest.mark.parametrize(("own", "start"), [(None, "arm.toml: link"), ("c.mat", "c.mat: link")])
def test_an_error_in_a_file_names_that_file_or_its_own(own, start):
    with pytest.raises(ParameterError) as refused, name_file("arm.toml"):
        raise error(file=own)
    assert str(refused.value).startswith(start)
    assert refused.value.__suppress_context__
    with pytest.raises(ConvergenceError), name_file("arm.toml"):
        raise ConvergenceError("stopped", 1.0, 0.0)


@pytest.mark.parametrize("word", ["a\nb", "\x1b[31m", "\u2028", "\ud800", "x\x00", "\r", "\u202e"])
def test_whatever_the_input_the_text_is_one_printable_line(word):
    text = str(error(key=word, value=word, remedy=word, file=word))
    assert text.isprintable()
    text.encode("utf-8")


@pytest.mark.parametrize("long", ["x" * 50_000, 10**5000, ["a"] * 50_000], ids=["text", "integer", "list"])
def test_long_values_are_shortened(long):
    assert len(str(error(value=long))) < 120


@pytest.mark.parametrize("count", [1, 3, 40])
def test_a_list_of_keys_is_never_cut_in_its_middle(count):
    """Each that is there is whole, they are the first ones, and the others are counted."""
    keys = [f"link.{n}.youngs_modulus" for n in range(count)]
    for text in (str(error(value=keys)), str(error(remedy=did_you_mean("lnk.7", keys)))):
        named = re.findall(r"link\.\d+\.youngs_modulus", text.rpartition("known are: ")[2])
        assert named == keys[: len(named)]
        assert "..." not in text
        more = re.search(r" and (\d+) more", text)
        assert len(named) + int(more[1] if more else 0) == count


def test_a_long_key_keeps_its_beginning_and_end():
    text = str(error(key="begin." + "a." * 20_000 + "end"))
    assert text.startswith("begin.")
    assert "a.end = -1.0" in text
    assert len(text) < 150


@pytest.mark.parametrize(
    "original",
    [
        error(value=MISSING).in_file("a.toml"),
        ConvergenceError("stopped at 12 rad/s", 12.0, 1e-3),
        CertificationError("two roots in one box"),
    ],
)
def test_errors_survive_pickling_as_worker_processes_need(original):
    """A convergence error with its best value and residual."""
    copy = pickle.loads(pickle.dumps(original))
    assert type(copy) is type(original)
    assert str(copy) == str(original)
    assert vars(copy) == vars(original)


def test_did_you_mean_names_the_nearest_and_all():
    assert did_you_mean("rot_moment", ["hub_angle", "root_moment"]) == (
        'did you mean "root_moment"? known are: hub_angle, root_moment'
    )
    assert did_you_mean("zzz", ["hub_angle"]) == "known are: hub_angle"
