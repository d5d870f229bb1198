"""Declaration of a structure that Python and compiled code share.

A field is a number, an array or a structure in it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Field:
    """A field of a structure.

    Attributes:
        name: name in Python and C++.
        type: type in C++: a number, an array ``double[3]``, a pointer, a structure, or a function
            ``double(const Solid*, const Solid*)``.
        meaning: sentence with its shape and unit. An array's shape comes first, in parentheses:
            sizes by name, and sums of them.
    """

    name: str
    type: str
    meaning: str = ""

    @property
    def shape(self) -> tuple[str, ...]:
        """The lengths of an array's axes, such as ``2 n_vD + 1``; empty where none is stated."""
        stated = re.match(r"\(([^)]*)\)", self.meaning)
        return tuple(axis.strip() for axis in stated[1].split(",") if axis) if stated else ()


@dataclass(frozen=True)
class Structure:
    """A structure with the memory layout of C.

    Attributes:
        name: name in Python and C++.
        meaning: meaning in one sentence.
        fields: fields in order.
    """

    name: str
    meaning: str
    fields: tuple[Field, ...]


IN, OUT, MANY, INT = "const double*", "double*", "long long", "const int*"
"""Types of fields: arrays, and counts."""
