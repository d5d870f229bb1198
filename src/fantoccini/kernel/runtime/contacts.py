"""Solids that may touch, as compiled code reads them.

A solid is a shape of a body or an obstacle. A link is a body on its joint. A hull is the smallest
convex solid around a mesh or a piece of it.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array
from fantoccini.kernel.contract import SolidKind
from fantoccini.kernel.runtime.hulls import Hull
from fantoccini.kernel.runtime.packing import packed
from fantoccini.model.tree import WORLD


@dataclass(frozen=True, eq=False)
class Contacts:
    """Solids and the pairs of them that may touch.

    Attributes:
        solids: (n,) ``SOLID``: those of the links in their order, then those that stand.
        pairs: (m, 2) indices of solids; the first is a link's. Pairs of the same two links, and
            of a link and a standing solid, are adjacent.
        friction: (m,) coefficients of friction.
        restitution: (m,) coefficients of restitution, 0 to 1.
        names: (m,) names of the body and its partner: another body, an obstacle, ``floor``.
        hulls: hulls of solids of the kind ``HULL``; ``mesh`` is their index.
    """

    solids: NDArray[np.void]
    pairs: NDArray[np.int32]
    friction: Array
    restitution: Array
    names: tuple[tuple[str, str], ...]
    hulls: tuple[Hull, ...] = ()

    def subset(self, selection: NDArray[np.bool_]) -> Contacts:
        """The pairs that ``selection`` (m,) marks."""
        names = tuple(name for name, marked in zip(self.names, selection, strict=True) if marked)
        arrays = (self.pairs[selection], self.friction[selection], self.restitution[selection])
        return Contacts(self.solids, *arrays, names, self.hulls)

    def __reduce__(self) -> tuple[Any, ...]:
        fields = (self.solids, self.pairs, self.friction, self.restitution, self.names)
        return type(self), (*fields, self.hulls)

    @cached_property
    def structure(self) -> ctypes.Structure:
        """The structure for compiled code; it and its arrays live as long as this object."""
        groups = self._groups()
        return packed(
            "ContactArrays",
            n_solids=len(self.solids),
            n_pairs=len(self.pairs),
            n_groups=len(groups),
            solids=self._solids(),
            pairs=self.pairs,
            groups=groups,
            friction=self.friction,
            restitution=self.restitution,
            meetings=self._meetings(),
        )

    def _solids(self) -> NDArray[np.void]:
        """(n,) solids that point to their hulls."""
        solids = self.solids.copy()
        for i in np.flatnonzero(solids["kind"] == SolidKind.HULL):
            hull = self.hulls[solids["mesh"][i]]
            solids["hull"][i] = ctypes.addressof(hull.structure)
        return solids

    def _meetings(self) -> NDArray[np.int32]:
        """(m,) the first pair with the same two names: the parts of one body meet together."""
        first: dict[frozenset[str], int] = {}
        meetings = [first.setdefault(frozenset(pair), k) for k, pair in enumerate(self.names)]
        return np.array(meetings, dtype=np.int32)

    def _groups(self) -> NDArray[np.int32]:
        """(n, 3) the two links of adjacent pairs, -1 - solid for a standing one, and their end."""
        links = self.solids["link"][self.pairs]
        links[:, 1] = np.where(links[:, 1] == WORLD, -1 - self.pairs[:, 1], links[:, 1])
        last = np.flatnonzero(np.any(np.diff(links, axis=0, append=-links[-1:] - 9), axis=1))
        return np.column_stack([links[last], last + 1]).astype(np.int32)
