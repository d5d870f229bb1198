"""The search tree: states, the segments between them, costs and distances.

A node is a state, and a segment a piece of motion with constant accelerations of the driven
coordinates q_K; q_D are the dynamic ones. A catch is a slack string that becomes taut.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base import Array, Indices, MaskRows
from fantoccini.control.tasks import TIME, Objective, StateArrays, flattened
from fantoccini.kernel.runtime import STATE, Segments

_INITIAL_CAPACITY = 1024
"""Initial capacity of a tree in nodes."""


class SearchTree:
    """States and the segments between them, in arrays that grow.

    Attributes:
        n: number of nodes.
        bound: upper bound of a plan's cost [s].
        objective: definition of the cost.
        q_D, v_D, slip, q_K, v_K: (n, ...) states.
        acceleration: (n, n_vK) driven accelerations in the segment that ends at the node.
        parent: (n,) node at which that segment begins; -1 for the root.
        n_checks: (n,) number of checks in it.
        catches: (n,) number of strings and limits caught in it.
        time, cost: (n,) time and cost since the start [s].
        distance: (n,) distance from the goal.
        tried: (n,) number of rollouts that began at the node.

    Args:
        root: the start (1,).
        distance: distance of the start from the goal.
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
    n_checks: Indices
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
        widths = {name: values.shape[-1] for name, values in root.parts.items()} | {
            "acceleration": n_vK
        }
        arrays: dict[str, Any] = {
            name: np.empty((_INITIAL_CAPACITY, width)) for name, width in widths.items()
        }
        for name in ("time", "cost", "distance"):
            arrays[name] = np.empty(_INITIAL_CAPACITY)
        for name in ("parent", "n_checks", "catches", "tried"):
            arrays[name] = np.empty(_INITIAL_CAPACITY, dtype=np.int64)
        self._arrays = arrays
        self.add(
            root,
            acceleration=0.0,
            parent=-1,
            n_checks=0,
            catches=0,
            time=0.0,
            cost=0.0,
            distance=distance,
        )

    @classmethod
    def from_arrays(
        cls, arrays: dict[str, Array], template: SearchTree, bound: float = np.inf
    ) -> SearchTree:
        """A tree with the given ``arrays``.

        Args:
            arrays: arrays of a tree.
            template: a tree of the same puppet.
            bound: upper bound of a plan's cost [s].

        Raises:
            ValueError: arrays that are not a tree of this puppet.
        """
        tree = cls.__new__(cls)
        tree.n, tree.bound = len(arrays["parent"]), bound
        tree.objective = template.objective
        tree._arrays = {name: arrays[name] for name in template.arrays}
        for name, array in tree._arrays.items():
            expected = template.arrays[name]
            if array.dtype != expected.dtype or array.shape != (tree.n, *expected.shape[1:]):
                raise ValueError(f"{name} has the shape {array.shape} of {array.dtype}")
            if name not in ("distance", *STATE) and not np.all(np.isfinite(array)):
                raise ValueError(f"{name} is not finite")
        parent = tree._arrays["parent"]
        if not tree.n or parent[0] != -1 or np.any(parent[1:] < 0):
            raise ValueError("its nodes have no root")
        if np.any(parent >= np.arange(tree.n)):
            raise ValueError("a node comes before its parent")
        return tree

    @property
    def arrays(self) -> dict[str, Array]:
        """Name of an attribute -> (n, ...) array, as above."""
        return {name: values[: self.n] for name, values in self._arrays.items()}

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
            states: (k,) states.
            arrays: the other attributes of the nodes, (k, ...) or a single value for all.

        Returns:
            Indices of the new nodes.
        """
        k = len(states.q_D)
        while self.n + k > len(self._arrays["parent"]):
            self._arrays = {
                name: np.concatenate([values, np.empty_like(values)])
                for name, values in self._arrays.items()
            }
        rows = slice(self.n, self.n + k)
        for name, values in {**states.parts, **arrays, "tried": 0}.items():
            self._arrays[name][rows] = values
        self.n += k
        return range(rows.start, rows.stop)

    def add_segments(self, segments: Segments, start_nodes: Indices, interval: float) -> range:
        """Adds the ends of all segments that rollouts completed.

        Args:
            segments: segments of the rollouts.
            start_nodes: (n,) nodes at which they began.
            interval: time between checks [s].

        Returns:
            Indices of the new nodes.
        """
        completed = np.flatnonzero(segments.n_checks)
        rollout, segment_index = np.divmod(completed, segments.n_checks.shape[1])
        is_first, start_nodes = segment_index == 0, start_nodes[rollout]
        n_checks, catches = (
            segments.n_checks.ravel()[completed],
            segments.catches.ravel()[completed],
        )
        acceleration = flattened(segments.acc_K)[completed]
        time = interval * _cumulative(n_checks, is_first)
        cost = self.objective.cost(
            time,
            _cumulative(catches, is_first),
            lambda: _cumulative(interval * n_checks * (acceleration**2).sum(axis=1), is_first),
        )
        return self.add(
            StateArrays(**{name: flattened(a)[completed] for name, a in segments.states.items()}),
            acceleration=acceleration,
            parent=np.where(is_first, start_nodes, self.n + np.arange(len(completed)) - 1),
            n_checks=n_checks,
            catches=catches,
            time=self.time[start_nodes] + time,
            cost=self.cost[start_nodes] + cost,
            distance=segments.distance.ravel()[completed],
        )

    def path(self, node: int) -> list[int]:
        """Nodes from the root to a node."""
        path = [node]
        while self.parent[path[-1]] >= 0:
            path.append(int(self.parent[path[-1]]))
        return path[::-1]


def _cumulative(values: Array | Indices, is_first: MaskRows) -> Array:
    """(n,) cumulative sums that restart at the beginning of every rollout."""
    sums = np.cumsum(values)
    offset = (sums - values)[is_first]
    return sums - offset[np.cumsum(is_first) - 1]
