"""The browser for tests of pages."""

from __future__ import annotations

import pytest
from tests.show.browser import chrome


@pytest.fixture(scope="module")
def browser():
    """One browser for each file: windows and settings of a page do not affect the next."""
    with chrome() as driver:
        yield driver
