"""A plugin of pytest for the sampler of mutants: begin with the tests that call one function.

With CALLS_TO set to a file, each test's seconds and the functions of tfarm that it calls are written there; with
CALLS_FROM set to that file and CALLED to "tfarm/room/file.py:LINE", the first line of a function, the tests that call
it come first, short ones before long ones, and then the others.  What numba has compiled calls unseen.
"""

import json
import os
import sys
import time
from pathlib import Path

import pytest

ROOT = str(Path(__file__).resolve().parents[1]) + os.sep
TO, FROM = os.environ.get("CALLS_TO"), os.environ.get("CALLS_FROM")
calls = {}  # of each test's name: its seconds, and the functions that it calls


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    if not TO:
        return (yield)
    codes, begun = set(), time.perf_counter()
    sys.setprofile(lambda frame, event, _: codes.add(frame.f_code) if event == "call" else None)
    try:
        return (yield)
    finally:
        sys.setprofile(None)
        own = {f"{code.co_filename.removeprefix(ROOT)}:{code.co_firstlineno}" for code in codes}
        calls[item.nodeid] = time.perf_counter() - begun, sorted(each for each in own if each.startswith("tfarm"))


def pytest_sessionfinish():
    if TO:
        Path(TO).write_text(json.dumps(calls), encoding="utf-8")


def pytest_collection_modifyitems(items):
    if FROM:
        known, function = json.loads(Path(FROM).read_text(encoding="utf-8")), os.environ["CALLED"]
        items.sort(key=lambda item: order(*known.get(item.nodeid, (0.0, [])), function))


def order(seconds, functions, function):
    return function not in functions, seconds
