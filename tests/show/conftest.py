"""The browser of the tests that look at a page."""

from __future__ import annotations

import pytest
from tests.show.browser import chrome


@pytest.fixture(scope="module")
def browser():
    """One browser a file: windows and settings of a page do not reach the next."""
    with chrome() as driver:
        yield driver
