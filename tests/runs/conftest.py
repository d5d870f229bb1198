"""Puppets and reference runs shared by tests of runs."""

from __future__ import annotations

import pytest
from tests.runs.cable_robot import robot
from tests.runs.references import references

import fantoccini as fan


@pytest.fixture(scope="module")
def reference():
    """Runs with another integrator, by the name of their case."""
    return references()


@pytest.fixture(scope="module")
def arm_reference(reference):
    """Reference of the planar arm: arguments of `simulate`, and the run."""
    return reference["arm"]


@pytest.fixture(scope="module")
def eight() -> fan.Marionette:
    """A platform on eight driven cables."""
    return robot()
