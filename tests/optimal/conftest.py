"""A puppet that several tests of optimal motions share."""

from __future__ import annotations

import pytest
from tests.optimal.small_crane import SMALL_CRANE

import fantoccini as fan


@pytest.fixture(scope="module")
def small_crane() -> fan.Marionette:
    """A bob on a winch that moves along x."""
    return fan.loads(SMALL_CRANE)
