"""Distances of a puppet from obstacles, from other puppets and from itself."""

from fantoccini.clearance.measure import Clearance, Nearest
from fantoccini.clearance.obstacles import HalfSpace, Standing, standing

__all__ = ["Clearance", "HalfSpace", "Nearest", "Standing", "standing"]
