"""Puppets and runs shared by tests of stands."""

from __future__ import annotations

import pytest
from tests.stand.hoist import HOIST, lift

import fantoccini as fan


@pytest.fixture(scope="module")
def hoist() -> fan.Marionette:
    """A mass on one winch."""
    return fan.loads(HOIST)


@pytest.fixture(scope="module")
def lifted(hoist) -> fan.Trajectory:
    """The winch lifts the mass."""
    return lift(hoist)


@pytest.fixture(scope="module")
def stand6() -> fan.Marionette:
    """The puppet of the bundled stand ``six_winches``."""
    return fan.puppets.stand6()


@pytest.fixture(scope="module")
def conduct(stand6) -> fan.Trajectory:
    """It conducts for five seconds."""
    moves = fan.Input.load(stand6, fan.puppets.performance("conduct"))
    return fan.simulate(stand6, stand6.rest(), moves, 5.0)
