"""Puppets and reference runs that several tests of runs share."""

from __future__ import annotations

import pytest
from tests.runs.cable_robot import robot
from tests.runs.references import references

import fantoccini as fan


@pytest.fixture(scope="module")
def reference():
    """Runs with an outside integrator, by the name of their case."""
    return references()


@pytest.fixture(scope="module")
def arm_reference(reference):
    """That of the planar arm: arguments of ``simulate``, and the run."""
    return reference["arm"]


@pytest.fixture(scope="module")
def eight() -> fan.Marionette:
    """A platform on eight driven cables."""
    return robot()
