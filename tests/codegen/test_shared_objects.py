"""Libraries of puppets that differ only in numbers share the runtime's object files."""

from __future__ import annotations

import pytest

import fantoccini as fan
from fantoccini.kernel.build import Source
from fantoccini.kernel.contract import LIBRARIES
from fantoccini.kernel.equations.system import Loads, System

PUPPET = """
puppet: swing
bodies:
  - name: upper
    joint:
      name: shoulder
      type: revolute
      axis: [0, -1, 0]
      limits: {{lower: -{limit}, upper: {limit}}}
      damping: {damping}
    com: [{length}, 0, 0]
    mass: {mass}
    inertia: [1e-3, 2e-3, 2e-3]
  - name: lower
    parent: upper
    joint: {{name: elbow, type: ball, at: [{length}, 0, 0]}}
    shapes:
      - {{type: sphere, at: [{length}, 0, 0], radius: {radius}, density: 500}}
strings:
  - name: hand
    path: [{{body: lower, at: [{length}, 0, 0]}}, {{world: [0, 0, {height}]}}]
    length: {string}
pose: {{shoulder: {angle}}}
"""
FLOOR = """
contact: {{friction: {friction}}}
floor: -{height}
"""
NUMBERS = {
    "limit": 1.5,
    "length": 0.2,
    "mass": 0.3,
    "damping": 0.01,
    "radius": 0.03,
    "height": 0.9,
    "string": 0.95,
    "angle": -0.3,
    "friction": 0.4,
}


def sources(
    text: str, libraries: tuple[str, ...] = LIBRARIES, **changed: float
) -> dict[str, Source]:
    """The sources of libraries, by their names."""
    puppet = fan.loads(text.format(**NUMBERS | changed))
    return {library: puppet.libraries.source_files(library) for library in libraries}


@pytest.mark.parametrize("contact", [False, True])
def test_other_numbers_share_object_files(contact):
    """Numbers are arguments, or have separate units."""
    text = PUPPET + FLOOR * contact
    first = sources(text)
    other = sources(text, **{name: 1.1 * number for name, number in NUMBERS.items()})
    for library, source in first.items():
        assert other[library].shared_objects() == source.shared_objects(), library
        pieces = [source.files[name] for name in source.pieces]
        assert [other[library].files[name] for name in other[library].pieces] != pieces, library


@pytest.mark.parametrize("contact", [False, True])
def test_objects_are_known_before_the_forces_are_derived(contact, monkeypatch):
    """They are compiled while the rest is derived."""

    def refuse(system: System) -> Loads:
        raise AssertionError("forces were derived")

    text = (PUPPET + FLOOR * contact).format(**NUMBERS)
    with monkeypatch.context() as patch:
        patch.setattr(System, "free_loads", property(refuse))
        patch.setattr(System, "step_loads", property(refuse))
        early = {library: fan.loads(text).libraries.early_objects(library) for library in LIBRARIES}
    for library, source in sources(PUPPET + FLOOR * contact).items():
        assert source.shared_objects() == early[library], library


@pytest.mark.parametrize("contact", [False, True])
def test_the_pose_and_colours_change_no_library(contact):
    text = PUPPET + FLOOR * contact
    coloured = text.replace("density: 500", 'density: 500, colour: "#ff0000"').replace(
        "length: {string}", 'length: {string}\n    colour: "#00ff00"'
    )
    assert sources(coloured, angle=-0.25) == sources(text)
    first, other = (
        fan.loads(t.format(**NUMBERS | more)).puppet
        for t, more in ((text, {}), (coloured, {"angle": -0.25}))
    )
    assert first.canonical() != other.canonical()
    assert first.canonical(values=False) == other.canonical(values=False)


def test_another_structure_has_another_main_object():
    first = sources(PUPPET, libraries=("model",))["model"]
    text = PUPPET.replace("type: ball", "type: revolute, axis: [0, -1, 0]")
    other = sources(text, libraries=("model",))["model"]
    assert other.shared_objects()["main.o"] != first.shared_objects()["main.o"]
