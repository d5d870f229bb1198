"""Every library of a puppet with contact compiles: each instantiates the runtime in its own way."""

from __future__ import annotations

import pytest

import fantoccini as fan
from fantoccini.kernel.contract import LIBRARIES

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

BOX = """
puppet: box
floor: 0
contact: {friction: 0.5, restitution: 0.4}
bodies:
- {name: box, joint: {type: free}, shapes: [{type: box, size: [0.1, 0.1, 0.1], mass: 1}]}
strings:
- name: line
  path: [{body: box, at: [0, 0, 0.05]}, {driven: [x], at: [0.1, 0, 2]}]
  length: driven
pose: {box.z: 0.05, line.length: 2.1}
"""
ATTRIBUTES = {"model": "library", "clearance": "clearances"}
"""Library -> attribute of another name."""


@pytest.fixture(scope="module")
def box() -> fan.Marionette:
    return fan.loads(BOX)


@pytest.mark.parametrize("library", LIBRARIES)
def test_it_compiles_and_loads(box, library, monkeypatch):
    monkeypatch.setenv("FANTOCCINI_CXXFLAGS", "-O0")
    assert getattr(box.libraries, ATTRIBUTES.get(library, library)) is not None
