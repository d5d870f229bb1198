"""The tree: links in topological order, one-sided rows, and the table of coordinates."""

from fantoccini.tree.grow import grow
from fantoccini.tree.structure import (
    COMMAND,
    WORLD,
    Coordinate,
    CoordinateTable,
    DriveRow,
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
    "COMMAND",
    "WORLD",
    "Coordinate",
    "CoordinateTable",
    "DriveRow",
    "LimitRow",
    "Link",
    "Lump",
    "Point",
    "Role",
    "SpringRow",
    "StringRow",
    "Tree",
    "grow",
]
