"""The search tree: states, how they were reached, their costs and distances."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base import Array, Indices, MaskRows
from fantoccini.control.problems import TIME, Objective
from fantoccini.control.tasks import StateArrays, flattened
from fantoccini.kernel.runtime import STATE, Segments

_CAPACITY = 1024
"""Nodes for which a new tree has room."""


class SearchTree:
    """States and the segments that lead to them, in arrays that grow.

    Attributes:
        n: number of nodes.
        bound: on a plan's cost [s].
        objective: that defines the cost.
        q_D, v_D, slip, q_K, v_K: (n, ...) states.
        acceleration: (n, n_vK) of the driven coordinates in the segment that ends at the node.
        parent: (n,) node at which it begins; -1 for the root.
        looks: (n,) checks that it lasts.
        catches: (n,) strings and limits caught in it.
        time, cost: (n,) since the start [s].
        distance: (n,) from the goal.
        tried: (n,) rollouts that began at the node.

    Args:
        root: the start (1,).
        distance: of the start from the goal.
        n_vK: number of driven velocities.
        bound, objective: see above.
    """

    q_D: Array
    v_D: Array
    slip: Array
    q_K: Array
    v_K: Array
    acceleration: Array
    parent: Indices
    looks: Indices
    catches: Indices
    time: Array
    cost: Array
    distance: Array
    tried: Indices

    def __init__(
        self,
        root: StateArrays,
        distance: float,
        n_vK: int,
        bound: float = np.inf,
        objective: Objective = TIME,
    ):
        self.n, self.bound, self.objective = 0, bound, objective
        widths = {name: a.shape[-1] for name, a in root.parts.items()} | {"acceleration": n_vK}
        arrays: dict[str, Any] = {name: np.empty((_CAPACITY, w)) for name, w in widths.items()}
        for name in ("time", "cost", "distance"):
            arrays[name] = np.empty(_CAPACITY)
        for name in ("parent", "looks", "catches", "tried"):
            arrays[name] = np.empty(_CAPACITY, dtype=np.int64)
        self._arrays = arrays
        self.add(
            root,
            acceleration=0.0,
            parent=-1,
            looks=0,
            catches=0,
            time=0.0,
            cost=0.0,
            distance=distance,
        )

    @classmethod
    def of(cls, arrays: dict[str, Array], like: SearchTree, bound: float = np.inf) -> SearchTree:
        """A tree from its ``arrays``.

        Args:
            arrays: of a tree.
            like: a tree of the same puppet.
            bound: on a plan's cost [s].

        Raises:
            ValueError: the arrays are not a tree of this puppet.
        """
        made = cls.__new__(cls)
        made.n, made.bound = len(arrays["parent"]), bound
        made.objective = like.objective
        made._arrays = {name: arrays[name] for name in like.arrays}
        for name, a in made._arrays.items():
            known = like.arrays[name]
            if a.dtype != known.dtype or a.shape != (made.n, *known.shape[1:]):
                raise ValueError(f"{name} has the shape {a.shape} of {a.dtype}")
            if name not in ("distance", *STATE) and not np.all(np.isfinite(a)):
                raise ValueError(f"{name} is not finite")
        parent = made._arrays["parent"]
        if not made.n or parent[0] != -1 or np.any(parent[1:] < 0):
            raise ValueError("its nodes have no root")
        if np.any(parent >= np.arange(made.n)):
            raise ValueError("a node comes before its parent")
        return made

    @property
    def arrays(self) -> dict[str, Array]:
        """Name -> (n, ...), as above."""
        return {name: a[: self.n] for name, a in self._arrays.items()}

    def __len__(self) -> int:
        return self.n

    def __getattr__(self, name: str) -> Any:
        arrays = self.__dict__.get("_arrays", {})
        if name not in arrays:
            raise AttributeError(name)
        return arrays[name][: self.n]

    @property
    def states(self) -> StateArrays:
        """The states of all nodes."""
        return StateArrays(*(getattr(self, name) for name in STATE))

    def add(self, states: StateArrays, **arrays: ArrayLike) -> range:
        """Adds k nodes.

        Args:
            states: (k,).
            arrays: the other attributes of the nodes, (k, ...) or one for all.

        Returns:
            Their numbers.
        """
        k = len(states.q_D)
        while self.n + k > len(self._arrays["parent"]):
            self._arrays = {
                name: np.concatenate([a, np.empty_like(a)]) for name, a in self._arrays.items()
            }
        new = slice(self.n, self.n + k)
        for name, a in {**states.parts, **arrays, "tried": 0}.items():
            self._arrays[name][new] = a
        self.n += k
        return range(new.start, new.stop)

    def add_segments(self, made: Segments, chosen: Indices, interval: float) -> range:
        """Adds the ends of all segments that rollouts completed.

        Args:
            made: the rollouts.
            chosen: (n,) nodes at which they began.
            interval: between checks [s].

        Returns:
            Their numbers.
        """
        flat = np.flatnonzero(made.looks)
        rollout, place = np.divmod(flat, made.looks.shape[1])
        begin, chosen = place == 0, chosen[rollout]
        looks, catches = made.looks.ravel()[flat], made.catches.ravel()[flat]
        acceleration = flattened(made.acc_K)[flat]
        time = interval * _running(looks, begin)
        cost = self.objective.cost(
            time,
            _running(catches, begin),
            lambda: _running(interval * looks * (acceleration**2).sum(axis=1), begin),
        )
        return self.add(
            StateArrays(**{name: flattened(a)[flat] for name, a in made.states.items()}),
            acceleration=acceleration,
            parent=np.where(begin, chosen, self.n + np.arange(len(flat)) - 1),
            looks=looks,
            catches=catches,
            time=self.time[chosen] + time,
            cost=self.cost[chosen] + cost,
            distance=made.distance.ravel()[flat],
        )

    def path(self, node: int) -> list[int]:
        """Nodes from the root to a node."""
        found = [node]
        while self.parent[found[-1]] >= 0:
            found.append(int(self.parent[found[-1]]))
        return found[::-1]


def _running(a: Array | Indices, begin: MaskRows) -> Array:
    """(n,) cumulative sums that restart where a rollout begins."""
    sums = np.cumsum(a)
    before = (sums - a)[begin]
    return sums - before[np.cumsum(begin) - 1]
