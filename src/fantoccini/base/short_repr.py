"""Short representations of dataclasses that hold arrays."""

from __future__ import annotations

import dataclasses

import numpy as np

MAX_LENGTH = 60
"""Longest representation of a field that is shown [characters]."""


class ShortRepr:
    """Base of dataclasses (``repr=False``) that prints them in one line.

    Arrays are given by their shapes, tuples and mappings by their lengths, longer parts by their
    type; private fields are left out.
    """

    def __repr__(self) -> str:
        fields = dataclasses.fields(self)  # type: ignore[arg-type]
        parts = [
            f"{f.name} {_short_text(getattr(self, f.name))}"
            for f in fields
            if not f.name.startswith("_")
        ]
        return f"<{type(self).__name__}: {', '.join(parts)}>"


def _short_text(value: object) -> str:
    if isinstance(value, np.ndarray):
        return "x".join(map(str, value.shape)) or "number"
    if isinstance(value, str | bool | int | float | complex | None):
        text = repr(value)
    elif isinstance(value, tuple | list | dict):
        return f"[{len(value)}]"
    elif type(value).__repr__ is object.__repr__ or dataclasses.is_dataclass(value):
        return type(value).__name__
    else:
        text = repr(value)
    return text if len(text) <= MAX_LENGTH and "\n" not in text else type(value).__name__
