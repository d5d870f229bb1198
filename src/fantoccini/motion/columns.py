"""Named columns: an array whose last axis has names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from fantoccini.base import Array, Mask, ShortRepr, UnknownNameError, frozen


@dataclass(frozen=True, eq=False, repr=False)
class Columns(ShortRepr):
    """Columns with names: ``run.tension["hand"]`` is the column (T,) called ``hand``.

    Attributes:
        names: names of the columns.
        values: (..., T, n) numbers or flags, read-only; an array that is not read-only is copied.
            The first axis of a batch is its trajectories.
        noun: noun for a column in messages: string, limit, entry.
    """

    names: tuple[str, ...]
    values: Array
    noun: str = "column"

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(self.names))
        values = np.asarray(self.values)
        if values.flags.writeable:
            values = frozen(values, bool if values.dtype.kind == "b" else float)
        if values.ndim < 2 or values.shape[-1] != len(self.names):
            raise ValueError(
                f"values have the shape {values.shape}; {len(self.names)} names need "
                f"(T, {len(self.names)})"
            )
        object.__setattr__(self, "values", values)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Array:
        return np.array(self.values, dtype=dtype, copy=copy)

    def __getitem__(self, name: str) -> Array:
        if name not in self.names:
            raise UnknownNameError(self.noun, name, self.names)
        return self.values[..., self.names.index(name)]

    def flags(self, name: str) -> Mask:
        """A column of flags."""
        return np.asarray(self[name], dtype=bool)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def items(self) -> Iterator[tuple[str, Array]]:
        """Pairs of a name and its column (T,)."""
        return ((name, self[name]) for name in self.names)

    def like(self, values: Array) -> Columns:
        """Columns with the same names and other values."""
        return Columns(self.names, values, self.noun)
