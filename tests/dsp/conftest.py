"""The two presets of the paper: with a little damping, and with none."""

import pytest

import tfarm


@pytest.fixture(scope="session")
def lab():
    return tfarm.load("sasaki2012-lab")


@pytest.fixture(scope="session")
def lossless():
    return tfarm.load("sasaki2012")
