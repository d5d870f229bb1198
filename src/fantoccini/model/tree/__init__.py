"""The tree: links in topological order, one-sided rows, and the table of coordinates.

A link is an entry of the tree: a body on its joint, a driven string end, or a point mass of a
chain. A row is a string, limit, spring or drive; strings and limits have one-sided conditions h <=
0. q_D are the dynamic coordinates, which move by the equations of motion, and q_K the driven ones,
given as functions of time: ends and lengths of strings, driven joints. v_D and v_K are their
velocities, and n_qD, n_vD, n_qK, n_vK the numbers of these.
"""

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
