"""Path finding for puppets on a stage with obstacles and moving puppets."""

from fantoccini.theatre.ways.regions import Box, Disk, Rectangle, Region
from fantoccini.theatre.ways.ways import NoWay, Other, find_way

__all__ = ["Box", "Disk", "NoWay", "Other", "Rectangle", "Region", "find_way"]
