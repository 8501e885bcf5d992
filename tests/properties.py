"""What holds for every arm, every s and every file: Hypothesis looks for a counterexample.

    python -m tests.properties SIZE SEED

SIZE examples of each property, chosen by SEED; the tests have 25.  The exit code is pytest's.
Budget: two minutes of CPU for each thousand examples.
"""

import os
import sys

import pytest

FILES = ("tests/exact/test_physics.py", "tests/arm/test_reading.py")


def survey(size: int, seed: int) -> int:
    """0 where no counterexample was found."""
    os.environ["EXAMPLES"] = str(size)  # for tests/conftest.py
    return pytest.main(["-q", "-n", "0", "--hypothesis-profile=search", f"--hypothesis-seed={seed}", *FILES])


if __name__ == "__main__":
    sys.exit(survey(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1))
