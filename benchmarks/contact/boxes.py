"""Scenes for engines without strings: free boxes over a floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base.arrays import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import Box


class UnsupportedSceneError(Exception):
    """An engine cannot represent a scene, or lacks the measured quantity."""


@dataclass(frozen=True)
class FreeBox:
    """A box about the origin of its body: edges [m], mass [kg]."""

    name: str
    size: Array
    mass: float


@dataclass(frozen=True)
class Boxes:
    """Boxes over a floor [m], the friction of everything, and gravity (3,) [m/s^2]."""

    boxes: tuple[FreeBox, ...]
    floor: float
    friction: float
    gravity: Array


def free_boxes(marionette: Marionette) -> Boxes:
    """The boxes of a puppet of free boxes over a floor.

    Raises:
        Unlike: it is another puppet.
    """
    puppet = marionette.puppet
    rules = puppet.touching
    if rules is None or puppet.floor is None or puppet.strings:
        raise UnsupportedSceneError("only boxes over a floor, without strings")
    boxes = []
    for body in puppet.bodies:
        (box,) = body.shapes
        if not isinstance(box, Box) or np.any(box.at):
            raise UnsupportedSceneError(f"{body.name} is not one box about its origin")
        boxes.append(FreeBox(body.name, np.array(box.size, dtype=float), float(box.mass)))
    gravity = np.array(puppet.gravity, dtype=float)
    return Boxes(tuple(boxes), float(puppet.floor), float(rules.friction), gravity)
