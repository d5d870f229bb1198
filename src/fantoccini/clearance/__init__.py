"""Distances of a puppet from obstacles, from other puppets and from itself."""

from fantoccini.clearance.measure import Clearance, Least, Nearest
from fantoccini.clearance.obstacles import HalfSpace, Standing, standing
from fantoccini.clearance.path import Path
from fantoccini.clearance.strings_apart import Approach, Approaches, StringMotion, StringsApart
from fantoccini.clearance.winding import Crossing, Winding

__all__ = [
    "Approach",
    "Approaches",
    "Clearance",
    "Crossing",
    "HalfSpace",
    "Least",
    "Nearest",
    "Path",
    "Standing",
    "StringMotion",
    "StringsApart",
    "Winding",
    "standing",
]
