"""Springs between two points, and the pieces of chains.

With the stretch s = d - l of points at the distance d:

    V = k s^2 / 2,    pull = k s + c sdot.

A piece of a chain has l = L / n, k = EA / l, c = damping / l. If L is driven, l and k depend on it:
winding in removes relaxed string, and virtual work gives

    -dV/dl = k s + k s^2 / (2 l) = EA e (1 + e / 2),    e = s / l.

k is the stiffness, c the damping, l the unstretched length, and L the length of the chain in n
pieces. In names, D stands for dynamic coordinates, which move by the equations of motion. A row of
the tree describes a string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from fantoccini.kernel.equations.algebra import scaled
from fantoccini.kernel.equations.rows import PathRow, RowArguments, path_row
from fantoccini.model.tree import ChainRow


@dataclass(frozen=True)
class ElasticForce:
    """A spring between two points.

    Attributes:
        row: stretch s and its derivatives.
        k: stiffness [N/m].
        c: damping [N s/m].
        relaxed: relaxed length l [m] if it is part of a driven length; else None.
    """

    row: PathRow
    k: ca.SX
    c: ca.SX
    relaxed: ca.SX | None = None

    @property
    def energy(self) -> ca.SX:
        """V = k s^2 / 2 [J]."""
        return 0.5 * self.k * self.row.length**2

    def add_gradient(self, f_D: np.ndarray, f_K: np.ndarray) -> None:
        """Adds dV/dq_D (n_vD,) and dV/dq_K (n_vK,)."""
        self._pull(self.k * self.row.length, f_D, f_K)
        string = self.row.string
        if self.relaxed is None or string is None:
            return
        for f, place in ((f_D, string.wound_length), (f_K, string.driven_length)):
            if place is not None:
                f[place[1]] -= self.row.factor * self.energy / self.relaxed

    def add_damping(self, f_D: np.ndarray, f_K: np.ndarray) -> ca.SX:
        """Adds the damping forces, with the sign of the bias; returns their power [W]."""
        pull = self.c * self.row.rate
        self._pull(pull, f_D, f_K)
        return pull * self.row.rate

    def _pull(self, pull: ca.SX, f_D: np.ndarray, f_K: np.ndarray) -> None:
        f_D += scaled(pull, self.row.A_D)
        f_K += scaled(pull, self.row.A_K)


def elastics(
    arguments: RowArguments, unstretched_length: Callable[[ChainRow], tuple[ca.SX, ca.SX, ca.SX]]
) -> list[ElasticForce]:
    """The springs of a tree, then the pieces of its chains.

    Args:
        arguments: arguments of rows.
        unstretched_length: returns L of a chain, its rate and its acceleration.
    """
    springs = []
    for spring in arguments.tree.springs:
        row = path_row(arguments, spring.points)
        row = replace(row, length=row.length - arguments.value(spring.rest))
        springs.append(
            ElasticForce(row, arguments.value(spring.stiffness), arguments.value(spring.damping))
        )
    for chain in arguments.tree.chains:
        springs.extend(_pieces(arguments, chain, *unstretched_length(chain)[:2]))
    return springs


def _pieces(
    arguments: RowArguments, chain: ChainRow, length: ca.SX, rate: ca.SX
) -> Iterator[ElasticForce]:
    length_share = 1.0 / chain.pieces
    relaxed = length_share * length
    k, c = arguments.value(chain.stiffness) / relaxed, arguments.value(chain.damping) / relaxed
    for end_points in pairwise(chain.points):
        row = path_row(arguments, end_points)
        if chain.length_index is None:
            yield ElasticForce(replace(row, length=row.length - relaxed), k, c)
            continue
        moving = replace(
            row,
            length=row.length - relaxed,
            rate=row.rate - length_share * rate,
            string=chain,
            factor=length_share,
        )
        yield ElasticForce(moving, k, c, relaxed)
