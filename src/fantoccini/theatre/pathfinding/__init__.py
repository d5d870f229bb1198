"""Path finding for puppets on a stage with obstacles and moving puppets.

A leg of a path is a straight part of it. A footing is a place on the stage with a heading.
"""

from fantoccini.theatre.pathfinding.planning import NoPath, OtherPlayer, plan_walk
from fantoccini.theatre.pathfinding.regions import Box, Disk, Rectangle, Region

__all__ = ["Box", "Disk", "NoPath", "OtherPlayer", "Rectangle", "Region", "plan_walk"]
