import pytest


@pytest.fixture
def arm(lossless):
    return lossless
