"""What the tests of pages share."""

from functools import partial

import pytest

from tests.report.written import report_elsewhere
from tests.shared import once


@pytest.fixture(scope="session")
def pages(tmp_path_factory, audit_file):
    """The folder of the full report on one arm that a session makes."""
    return once(tmp_path_factory, "pages", partial(report_elsewhere, audit_file))
