"""The tree: links in topological order, one-sided rows, and the table of coordinates."""

from fantoccini.tree.chains import placed
from fantoccini.tree.construction import grow
from fantoccini.tree.coordinates import COMMAND, Coordinate, CoordinateTable, Role
from fantoccini.tree.inertia import joint_inertias, link_inertia
from fantoccini.tree.joints import TURNS_WITH_LINK
from fantoccini.tree.placement import link_poses, place
from fantoccini.tree.size import Size, measure, path_lengths
from fantoccini.tree.structure import (
    WORLD,
    ChainRow,
    DriveRow,
    LimitRow,
    Link,
    Lump,
    Point,
    SpringRow,
    StringRow,
    Tree,
)

__all__ = [
    "COMMAND",
    "TURNS_WITH_LINK",
    "WORLD",
    "ChainRow",
    "Coordinate",
    "CoordinateTable",
    "DriveRow",
    "LimitRow",
    "Link",
    "Lump",
    "Point",
    "Role",
    "Size",
    "SpringRow",
    "StringRow",
    "Tree",
    "grow",
    "joint_inertias",
    "link_inertia",
    "link_poses",
    "measure",
    "path_lengths",
    "place",
    "placed",
]
