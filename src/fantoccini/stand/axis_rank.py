"""Check that the driven coordinates determine the positions of all axes: J has full column rank.

An axis is a motor of the stand; J is the matrix of factors by which axes move driven coordinates,
the ends and lengths of strings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fantoccini.base import Array

RANK_TOLERANCE = 1e-9
"""Singular values below this fraction of the largest count as 0."""
MIN_SHARE = 1e-6
"""Smallest component of an axis in a combination for which the error names it."""


def factor_matrix(moves: Mapping[str, Mapping[str, float]]) -> tuple[tuple[str, ...], Array]:
    """Names of all coordinates that axes move, and J (m, n), from axis -> coordinate -> factor."""
    names = tuple(
        dict.fromkeys(name for factors_of_axis in moves.values() for name in factors_of_axis)
    )
    return names, np.array(
        [[factors_of_axis.get(name, 0.0) for factors_of_axis in moves.values()] for name in names]
    )


def undetermined_axis(moves: Mapping[str, Mapping[str, float]]) -> tuple[str, str] | None:
    """An axis that the coordinates do not determine, and the reason; None if they determine all."""
    names, J = factor_matrix(moves)
    axes, norms = list(moves), np.linalg.norm(J, axis=0)
    _, singular_values, rows = np.linalg.svd(J / norms)
    rank = int(np.sum(singular_values > RANK_TOLERANCE * singular_values[0]))
    if rank == len(axes):
        return None
    combination = rows[rank]
    involved = np.flatnonzero(np.abs(combination) > MIN_SHARE)
    amounts = (
        combination[involved] / norms[involved] / (combination[involved[0]] / norms[involved[0]])
    )
    moves_of_axes = " with ".join(
        f"{axes[i]} by {x:.4g}" for i, x in zip(involved, amounts, strict=True)
    )
    moved = dict.fromkeys(name for i in involved for name in moves[axes[i]])
    text = (
        f"{joined_names([axes[i] for i in involved])} are not determined by the bodies that they "
        "move "
        f"({joined_names(list(moved))}): moving {moves_of_axes} changes nothing; {len(axes)} axes "
        f"move {len(names)} coordinates, and {rank} of their motions differ"
    )
    return axes[involved[-1]], text


def joined_names(names: Sequence[str]) -> str:
    """Names joined for a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
