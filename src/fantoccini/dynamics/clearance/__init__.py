"""Distances of a puppet from obstacles, from other puppets and from itself."""

from fantoccini.dynamics.clearance.measure import Clearance, LeastDistance, Nearest
from fantoccini.dynamics.clearance.obstacles import HalfSpace, Standing, standing
from fantoccini.dynamics.clearance.path import Path
from fantoccini.dynamics.clearance.strings_apart import (
    Approach,
    Approaches,
    StringMotion,
    StringsApart,
)
from fantoccini.dynamics.clearance.winding import Crossing, Winding

__all__ = [
    "Approach",
    "Approaches",
    "Clearance",
    "Crossing",
    "HalfSpace",
    "LeastDistance",
    "Nearest",
    "Path",
    "Standing",
    "StringMotion",
    "StringsApart",
    "Winding",
    "standing",
]
