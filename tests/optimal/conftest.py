"""A puppet shared by tests of optimal motions."""

from __future__ import annotations

import pytest
from tests.optimal.small_crane import CRANE_TEXT

import fantoccini as fan


@pytest.fixture(scope="module")
def small_crane() -> fan.Marionette:
    """A bob on a winch that moves along x."""
    return fan.loads(CRANE_TEXT)
