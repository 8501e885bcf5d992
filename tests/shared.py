"""What is dear and the same for every test: made once a session, by the first of its processes to want it."""

import fcntl
import importlib.util
import os
from pathlib import Path

import pytest

import tfarm
from tfarm.errors import ParameterError
from tfarm.loop.circle_crossings import crossings_along, line_of


def refusal(call, *given, kind=ParameterError, **named):
    """The error that a call ends with, which is one line."""
    with pytest.raises(kind) as caught:
        call(*given, **named)
    assert "\n" not in str(caught.value)
    return caught.value


def once(factory, name, make):
    """The file `name`, which make(file) wrote in this process or in another; those that come meanwhile wait for it.

    `factory` is pytest's tmp_path_factory, whose folders lie in one of the session where xdist shares the work.
    """
    base = factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "shared"
    folder.mkdir(exist_ok=True)
    with open(folder / f"{name}.lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / name).exists():
            make(folder / f"{name}.part")
            (folder / f"{name}.part").rename(folder / name)
    return folder / name


def thinned(cases, every):
    """Of a family of cases each `every`th for `make test`; the others are marked, and run by `make survey`.

    Cases are values, or tuples of them where a test has several arguments, in an order in which neighbours are alike.
    """
    own = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [pytest.param(*each, marks=() if n % every == 0 else pytest.mark.survey) for n, each in enumerate(own)]


def sized(small, full):
    """A size for `make test`, and the full one, which is marked and run by `make survey`."""
    return [small, pytest.param(full, marks=pytest.mark.survey)]


def remembered(function):
    """The function, called once for the same arguments, as they are printed; where a test needs an answer twice."""
    answers = {}

    def again(*given, **named):
        key = repr((given, named))
        if key not in answers:
            answers[key] = function(*given, **named)
        return answers[key]

    return again


def remember(monkeypatch, module, name):
    """Replace a module's function by its `remembered` form for one test, where several commands call it alike."""
    getattr(tfarm, name, None)  # tfarm keeps the function once it is read: not the replacement
    monkeypatch.setattr(module, name, remembered(getattr(module, name)))


def docs_module(name):
    """The module docs/NAME.py; it needs no Sphinx to be imported."""
    spec = importlib.util.spec_from_file_location(f"docs_{name}", Path(__file__).parent.parent / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def circle_crossings(loop, name):
    """The crossings of the unit circle by poles of a sampled loop along one number of its law."""
    (found,) = crossings_along(loop.rig.grid, [line_of(loop, name)])
    return found
