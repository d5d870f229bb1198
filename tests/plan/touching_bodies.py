"""An arm over a table, and an arm and a bob that push a crate: small and quickly compiled."""

from __future__ import annotations

from typing import Any

import fantoccini as fan

ARM = """
puppet: arm
contact: {friction: 0.4}
bodies:
  - {name: upper,
     joint: {name: shoulder, type: revolute, axis: [0, 1, 0], at: [0, 0, 0.6], damping: 0.02},
     shapes: [{type: capsule, from: [0, 0, 0], to: [0.2, 0, 0], radius: 0.015, mass: 0.1}]}
  - {name: hand, parent: upper,
     joint: {name: elbow, type: revolute, axis: [0, 1, 0], at: [0.2, 0, 0], damping: 0.02},
     shapes: [{type: capsule, from: [0, 0, 0], to: [0.2, 0, 0], radius: 0.015, mass: 0.1}]}
strings:
  - {name: wrist, length: driven,
     path: [{body: hand, at: [0.18, 0, 0]}, {driven: [x], at: [0.3, 0, 1.2]}]}
  - {name: sleeve, length: driven,
     path: [{body: upper, at: [0.18, 0, 0]}, {driven: [x], at: [0.2, 0, 1.2]}]}
obstacles:
  - {name: table, type: box, size: [0.2, 0.3, 0.02], at: [0.4, 0, 0.4]}
pose: {wrist.length: 0.6, sleeve.length: 0.6}
"""
"""An arm of two links, held out over a table by two strings."""

LEVEL = {"wrist.length": 0.55, "sleeve.length": 0.6}
"""Driven coordinates that hold it level, 0.2 m above the table."""

POST = {"name": "post", "type": "box", "size": [0.04, 0.3, 0.1], "at": [0.45, 0, 0.46]}
"""It stands on the table where the arm would come down directly."""

HANGING_ARM = """
puppet: arm
bodies:
  - {name: upper,
     joint: {name: shoulder, type: revolute, axis: [0, -1, 0], at: [0, 0, 0.55], damping: 0.02},
     shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.25], radius: 0.015, mass: 0.1}]}
  - {name: hand, parent: upper,
     joint: {name: elbow, type: revolute, axis: [0, -1, 0], at: [0, 0, -0.25], damping: 0.02},
     shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.25], radius: 0.015, mass: 0.1}]}
strings:
  - {name: wrist, length: driven,
     path: [{body: hand, at: [0, 0, -0.2]}, {driven: [x], at: [0.3, 0, 1.2]}]}
  - {name: sleeve, length: driven,
     path: [{body: upper, at: [0, 0, -0.2]}, {driven: [x], at: [0.2, 0, 1.2]}]}
pose: {wrist.length: 1.2, sleeve.length: 0.95}
"""
"""An arm of two links that hangs down to the floor, and is pulled forward by two strings."""

DRAWN = {"wrist.length": 1.12, "sleeve.length": 0.87}
"""Driven coordinates that hold its hand just behind the prop."""

BOB = """
puppet: bob
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z], damping: 0.05},
     shapes: [{type: sphere, radius: 0.03, mass: 0.1}]}
strings:
  - {name: line, path: [{body: bob}, {driven: [x], at: [0, 0, 1]}], length: driven}
pose: {bob.z: 0.08, line.length: 0.92}
"""
"""A light bob on one string, which can push only with a part of its weight."""


def over_table() -> tuple[fan.Marionette, fan.State]:
    """The arm over the table, and the state in which it is held level."""
    arm = fan.loads(ARM)
    return arm, arm.rest(LEVEL)


def before_prop(puppet: str, shape: dict[str, Any], height: float) -> fan.Marionette:
    """A puppet on a floor, and a prop 0.15 m ahead of it.

    Args:
        puppet: its file.
        shape: shape of the prop, with its mass.
        height: height of its centre when it stands on the floor [m].
    """
    prop = {"name": "crate", "shapes": [shape], "at": [0.15, 0, height]}
    return fan.Marionette(
        fan.Scene.model_validate(
            {
                "scene": "floor",
                "floor": 0,
                "contact": {"friction": 0.4},
                "puppets": [{"name": "one", "puppet": fan.loads(puppet).puppet}],
                "props": [prop],
            }
        )
    )
