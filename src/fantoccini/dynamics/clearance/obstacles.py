"""Obstacles of a puppet: those of its file, more of the same kinds, and half-spaces.

A half-space is everything on one side of a plane, such as the ground.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from fantoccini.base import FileError, Mistake
from fantoccini.base.documents import Located, Model, Name, Vector, validate, validation_error
from fantoccini.model.puppet import WORDS, AnyObstacle, Obstacle, Puppet


class HalfSpace(Model):
    """Solid half-space below a plane: a floor, a wall, a ceiling."""

    type: Literal["half_space"] = "half_space"
    name: Name
    """Name of the obstacle."""
    at: Vector = (0.0, 0.0, 0.0)
    """Point of the plane [m]."""
    normal: Vector = (0.0, 0.0, 1.0)
    """Outward direction."""

    @field_validator("normal")
    @classmethod
    def _normalise(cls, normal: tuple[float, float, float]) -> tuple[float, ...]:
        size = float(np.linalg.norm(normal))
        if size == 0.0:
            raise validation_error("found the zero vector; needed: a direction")
        return tuple(float(x) / size for x in normal)


Standing = Annotated[AnyObstacle | HalfSpace, Field(discriminator="type")]
"""An obstacle of a puppet file, or a half-space."""


class _Obstacles(Model):
    obstacles: tuple[Standing, ...]


def standing(
    puppet: Puppet, obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = ()
) -> tuple[Obstacle | HalfSpace, ...]:
    """The obstacles of a puppet, its floor, and additional ones.

    Args:
        puppet: puppet with obstacles and perhaps a floor.
        obstacles: additional ones; a mapping has the keys of an obstacle in a puppet file, or of a
            half-space: ``{"name": "wall", "type": "half_space", "at": [1, 0, 0],
            "normal": [-1, 0, 0]}``.

    Raises:
        FileError: a mapping is not an obstacle, or a name is used twice.
    """
    unchecked = [dict(o) if isinstance(o, Mapping) else o for o in obstacles]
    for k, o in enumerate(unchecked):
        if not isinstance(o, (Obstacle, HalfSpace, dict)):
            text = f"found {o!r}; needed: a mapping of keys and values, or an obstacle"
            raise FileError([Mistake("<python>", None, f"obstacles[{k}]", text)])
    mappings = [o for o in unchecked if isinstance(o, dict)]
    validated = iter(validate(_Obstacles, Located({"obstacles": mappings}), words=WORDS).obstacles)
    additional = [next(validated) if isinstance(o, dict) else o for o in unchecked]
    floor = [] if puppet.floor is None else [HalfSpace(name="floor", at=(0.0, 0.0, puppet.floor))]
    all_obstacles = (*puppet.obstacles, *floor, *additional)
    names = [o.name for o in all_obstacles]
    duplicates = sorted({name for name in names if names.count(name) > 1})
    if duplicates:
        text = f"the names {', '.join(duplicates)} are used twice; obstacles differ in name"
        raise FileError([Mistake("<python>", None, "obstacles", text)])
    return all_obstacles
