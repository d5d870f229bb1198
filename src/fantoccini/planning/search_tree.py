"""The tree that a planner grows: states, how they were reached, and what it knows of them."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.planning.goals import Rows, all_rows
from fantoccini.planning.objective import TIME, Objective
from fantoccini.runtime import STATE, Segments

_FIRST = 1024

_OF_NODES = (
    "acceleration", "parent", "looks", "time", "cost", "distance", "catches", "tried",
)  # fmt: skip
"""What is known of a node beside its state."""


class SearchTree:
    """States and the motions that lead to them, in arrays that grow.

    Attributes:
        n: nodes.
        bound: of a plan's cost [s].
        objective: what that is.

    Args:
        root: the start, rows (1,).
        distance: of the start from the goal.
        n_vK: driven velocities.
        bound, objective: see above.
    """

    def __init__(
        self,
        root: Rows,
        distance: float,
        n_vK: int,
        bound: float = np.inf,
        objective: Objective = TIME,
    ):
        self.n, self.bound, self.objective = 0, bound, objective
        self._arrays = {name: np.empty((_FIRST, getattr(root, name).shape[-1])) for name in STATE}
        self._arrays |= {
            "acceleration": np.empty((_FIRST, n_vK)),
            "parent": np.empty(_FIRST, dtype=np.int64),
            "looks": np.empty(_FIRST, dtype=np.int64),
            "time": np.empty(_FIRST),
            "cost": np.empty(_FIRST),
            "distance": np.empty(_FIRST),
            "catches": np.empty(_FIRST, dtype=np.int64),
            "tried": np.empty(_FIRST, dtype=np.int64),
        }
        self.add(root, np.array([-1]), np.zeros((1, n_vK)), np.array([0]), 0.0, 0.0, distance, 0)

    @classmethod
    def of(cls, arrays: dict[str, Array], like: SearchTree, bound: float = np.inf) -> SearchTree:
        """A tree from its ``arrays``.

        Args:
            arrays: of a tree.
            like: a tree of the same puppet.
            bound: of the tree.

        Raises:
            ValueError: they are not those of a tree of this puppet.
        """
        made = cls.__new__(cls)
        made.n, made.bound = len(arrays["parent"]), bound
        made.objective = like.objective
        made._arrays = {name: arrays[name] for name in (*STATE, *_OF_NODES)}
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
        """All that is known of the nodes: name -> (n, ...)."""
        return {name: a[: self.n] for name, a in self._arrays.items()}

    def __len__(self) -> int:
        return self.n

    def __getattr__(self, name: str) -> Array:
        arrays = self.__dict__.get("_arrays", {})
        if name not in arrays:
            raise AttributeError(name)
        return arrays[name][: self.n]

    @property
    def rows(self) -> Rows:
        """The states of all nodes."""
        return Rows(*(getattr(self, name) for name in STATE))

    def add(
        self,
        rows: Rows,
        parent: Array,
        acceleration: Array,
        looks: Array,
        time: Array | float,
        cost: Array | float,
        distance: Array | float,
        catches: Array | int,
    ) -> range:
        """Adds nodes.

        Args:
            rows: (k,) states.
            parent: (k,) nodes they were reached from.
            acceleration: (k, n_vK) of the driven coordinates on the way.
            looks: (k,) how long, in intervals.
            time: (k,) since the start [s].
            cost: (k,) since the start [s].
            distance: (k,) from the goal.
            catches: (k,) of strings and limits on the way.

        Returns:
            Their numbers.
        """
        k = len(parent)
        while self.n + k > len(self._arrays["parent"]):
            self._arrays = {
                name: np.concatenate([a, np.empty_like(a)]) for name, a in self._arrays.items()
            }
        new = slice(self.n, self.n + k)
        arrays = self._arrays
        for name in STATE:
            arrays[name][new] = getattr(rows, name)
        arrays["parent"][new], arrays["acceleration"][new] = parent, acceleration
        arrays["looks"][new], arrays["distance"][new] = looks, distance
        arrays["catches"][new], arrays["tried"][new] = catches, 0
        arrays["time"][new], arrays["cost"][new] = time, cost
        self.n += k
        return range(new.start, new.stop)

    def add_segments(self, made: Segments, chosen: Array, interval: float) -> range:
        """Adds the ends of all segments that motions made.

        Args:
            made: the motions.
            chosen: (n,) nodes they began at.
            interval: between looks [s].

        Returns:
            Their numbers.
        """
        flat = np.flatnonzero(made.looks)
        motion, place = np.divmod(flat, made.looks.shape[1])
        begin, chosen = place == 0, chosen[motion]
        looks, catches = made.looks.ravel()[flat], made.catches.ravel()[flat]
        acceleration = all_rows(made.acc_K)[flat]
        time = interval * _running(looks, begin)
        cost = self.objective.cost(
            time,
            _running(catches, begin),
            lambda: _running(interval * looks * (acceleration**2).sum(axis=1), begin),
        )
        return self.add(
            Rows(*(all_rows(a)[flat] for a in made.states.values())),
            np.where(begin, chosen, self.n + np.arange(len(flat)) - 1), acceleration, looks,
            self.time[chosen] + time, self.cost[chosen] + cost, made.distance.ravel()[flat],
            catches,
        )  # fmt: skip

    def path(self, node: int) -> list[int]:
        """Nodes from the root to a node."""
        found = [node]
        while self.parent[found[-1]] >= 0:
            found.append(int(self.parent[found[-1]]))
        return found[::-1]


def _running(a: Array, begin: Array) -> Array:
    """(n,) sums of entries up to each one, anew where one begins."""
    sums = np.cumsum(a)
    before = (sums - a)[begin]
    return sums - before[np.cumsum(begin) - 1]
