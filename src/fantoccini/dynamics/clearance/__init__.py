"""Distances of a puppet from obstacles, from other puppets and from itself.

A solid is a shape of a body or an obstacle. A core is the segment, box or ellipsoid that stands for
a piece of a string or for a solid; a capsule is a segment with a radius. q_D and q_K are the
dynamic and driven coordinates of a puppet.
"""

from fantoccini.dynamics.clearance.measure import Clearance, LeastDistance, Nearest
from fantoccini.dynamics.clearance.obstacles import HalfSpace, Standing, standing
from fantoccini.dynamics.clearance.path import Path
from fantoccini.dynamics.clearance.string_distances import (
    Approach,
    Approaches,
    StringDistances,
    StringMotion,
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
    "StringDistances",
    "StringMotion",
    "Winding",
    "standing",
]
