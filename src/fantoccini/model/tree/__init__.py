"""The tree: links in topological order, one-sided rows, and the table of coordinates."""

from fantoccini.model.tree.chains import placed
from fantoccini.model.tree.construction import grow
from fantoccini.model.tree.coordinates import COMMAND, Coordinate, CoordinateTable, Role
from fantoccini.model.tree.inertia import joint_inertias, link_inertia
from fantoccini.model.tree.joints import TURNS_WITH_LINK
from fantoccini.model.tree.placement import joint_transform, link_poses, point_position
from fantoccini.model.tree.size import Size, measure, path_lengths, shape_box
from fantoccini.model.tree.structure import (
    WORLD,
    ChainRow,
    DriveRow,
    LimitRow,
    Link,
    MassShare,
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
    "MassShare",
    "Point",
    "Role",
    "Size",
    "SpringRow",
    "StringRow",
    "Tree",
    "grow",
    "joint_inertias",
    "joint_transform",
    "link_inertia",
    "link_poses",
    "measure",
    "path_lengths",
    "placed",
    "point_position",
    "shape_box",
]
