"""What holds for every arm, every s and every file: Hypothesis looks for a counterexample.

    python -m tests.properties SIZE SEED

SIZE examples of each property, chosen by SEED; the tests have 25.  Budget: two minutes of CPU for each thousand.
"""

import os

import pytest

from tests import survey
from tests.survey import Finding

FILES = ("tests/exact/test_physics.py", "tests/arm/test_reading.py")


def properties(size, seed):
    os.environ["EXAMPLES"] = str(size)  # for tests/conftest.py
    options = ["--hypothesis-profile=search", f"--hypothesis-seed={seed}"]
    for file in FILES:
        code = pytest.main(["-q", "-n", "0", *options, file])
        yield Finding("counterexample" if code else "holds", file, is_wrong=bool(code))


if __name__ == "__main__":
    survey.main(properties)
