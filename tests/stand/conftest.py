"""Runs that several tests of stands share."""

from __future__ import annotations

import pytest
from tests.stand.hoist import HOIST, lift

import fantoccini as fan


@pytest.fixture(scope="module")
def hoist():
    return fan.loads(HOIST)


@pytest.fixture(scope="module")
def run(hoist):
    return lift(hoist)


@pytest.fixture(scope="module")
def conduct():
    puppet = fan.puppets.stand6()
    moves = fan.Input.load(puppet, fan.puppets.performance("conduct"))
    return fan.simulate(puppet, puppet.rest(), moves, 5.0)
