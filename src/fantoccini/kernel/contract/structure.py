"""Declaration of a structure that Python and compiled code share."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Field:
    """A field of a structure.

    Attributes:
        name: name in Python and C++.
        type: type in C++: a number, an array ``double[3]``, a pointer, a structure, or a function
            ``double(const Solid*, const Solid*)``.
        meaning: meaning with shape and unit.
    """

    name: str
    type: str
    meaning: str = ""


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
