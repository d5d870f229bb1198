"""Whether the positions of axes follow from the driven coordinates that they move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fantoccini.base import Array

_RANK = 1e-9
"""Singular values below this part of the largest count as 0."""
_SHARE = 1e-6
"""Part of an axis in a combination from which it is named."""


def factors(moves: Mapping[str, Mapping[str, float]]) -> tuple[tuple[str, ...], Array]:
    """The names of all coordinates that axes move, and J (m, n): axis -> coordinate -> factor."""
    names = tuple(dict.fromkeys(name for own in moves.values() for name in own))
    return names, np.array([[own.get(name, 0.0) for own in moves.values()] for name in names])


def undetermined(moves: Mapping[str, Mapping[str, float]]) -> tuple[str, str] | None:
    """An axis that does not follow from the coordinates, and why; None where all do."""
    names, J = factors(moves)
    axes, scale = list(moves), np.linalg.norm(J, axis=0)
    _, sizes, rows = np.linalg.svd(J / scale)
    rank = int(np.sum(sizes > _RANK * sizes[0]))
    if rank == len(axes):
        return None
    null = rows[rank]
    k = np.flatnonzero(np.abs(null) > _SHARE)
    part = null[k] / scale[k] / (null[k[0]] / scale[k[0]])
    combined = " with ".join(f"{axes[i]} by {x:.4g}" for i, x in zip(k, part, strict=True))
    moved = dict.fromkeys(name for i in k for name in moves[axes[i]])
    text = (
        f"{listed([axes[i] for i in k])} are not determined by what they move "
        f"({listed(list(moved))}): moving {combined} changes nothing; {len(axes)} axes move "
        f"{len(names)} coordinates, and {rank} of their motions differ"
    )
    return axes[k[-1]], text


def listed(names: Sequence[str]) -> str:
    """Names in a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
