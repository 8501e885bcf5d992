"""What `make reference` writes: every public name with its docstring and the types of its arguments."""

import io
import re
from contextlib import redirect_stderr
from pathlib import Path

import pytest

import tfarm

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of `tfarm`, by the very command of the Makefile."""
    folder = tmp_path_factory.mktemp("reference")
    (line,) = re.findall(r"^\t@\$\(BIN\)/python (-m pdoc .*?) && echo", (ROOT / "Makefile").read_text(), re.MULTILINE)
    from pdoc.__main__ import cli  # loads a quarter of a second

    module, *words = [str(folder) if word == "reference" else word for word in line.split()[1:]]
    assert module == "pdoc"
    with redirect_stderr(io.StringIO()) as said:  # in this process, which has loaded most of it
        cli(words)
    assert "Error" not in said.getvalue()
    assert (folder / "tfarm" / "plots.html").exists()
    return (folder / "tfarm.html").read_text(encoding="utf-8")


def test_every_public_name_is_in_it(page):
    shown = set(re.findall(r'<section id="(\w+)"', page))
    assert {name for name in tfarm.__all__ if name != "plots"} <= shown
    assert "tfarm/plots.html" in page


def test_it_needs_nothing_off_the_disk(page):
    assert re.findall(r'(?:src|<link[^>]*href)="https?:', page) == []


def test_units_and_shapes_are_read_there(page):
    for words in ("[rad/s]", "[1/s]", "rad/s", "complex"):
        assert words in page
