"""The tree: links in topological order, one-sided rows, and the table of coordinates."""

from fantoccini.tree.chains import placed
from fantoccini.tree.grow import grow
from fantoccini.tree.place import link_poses, place
from fantoccini.tree.structure import (
    WORLD,
    ChainRow,
    Coordinate,
    CoordinateTable,
    LimitRow,
    Link,
    Lump,
    Point,
    Role,
    SpringRow,
    StringRow,
    Tree,
)

__all__ = [
    "WORLD",
    "ChainRow",
    "Coordinate",
    "CoordinateTable",
    "LimitRow",
    "Link",
    "Lump",
    "Point",
    "Role",
    "SpringRow",
    "StringRow",
    "Tree",
    "grow",
    "link_poses",
    "place",
    "placed",
]
