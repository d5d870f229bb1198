"""Rows that keep bodies and strings clear of obstacles, of other puppets and of one another.

d_j(q_{i+1}) >= margin, with one row for every body and string

A row is a condition on a number of the motion. d_j is the distance of body or string j, and q_{i+1}
the configuration at the end of an interval; q_D are its dynamic coordinates, q_K its driven ones. A
node is a time at which the inputs may change, with its state; an interval leads to the next node.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from fantoccini.base import Array, tangent
from fantoccini.control.tasks import Nodes
from fantoccini.dynamics.clearance import Clearance, HalfSpace
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import Obstacle
from fantoccini.motion import Trajectory

_MAX_MARGIN_EXCESS = 0.1
"""Distance above the margin beyond which a clearance is not differentiated [m]."""
_DIFFERENCE = 1e-6
"""Step of finite differences [m or rad]."""


class ClearanceRows:
    """Clearances of every body and string at the nodes after the first.

    Attributes:
        margin: the least clearance [m].
        names: names of the bodies and strings.
        clearance: measures all clearances at once.

    Args:
        marionette: the puppet, with the obstacles of its file.
        margin: see above.
        self_collision: whether bodies of one puppet that no joint connects are kept clear of one
            another.
        obstacles: obstacles in addition to the puppet's.
        strings: whether strings are kept clear of obstacles, too.
        allowed_pairs: pairs of names that may touch.
    """

    def __init__(
        self,
        marionette: Marionette,
        margin: float,
        self_collision: bool,
        obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
        *,
        strings: bool = True,
        allowed_pairs: Collection[frozenset[str]] = (),
    ):
        self.margin = margin
        self.clearance = Clearance(
            marionette,
            obstacles,
            strings=strings,
            self_collision=self_collision,
            free=allowed_pairs,
        )
        parts = self.clearance.parts()
        self.names, self._clearances = tuple(parts), tuple(parts.values())
        self._table = marionette.coordinates
        self._cached: tuple[Nodes | None, Array] = (None, np.zeros((0, 0)))

    def __len__(self) -> int:
        return len(self.names)

    def value(self, nodes: Nodes) -> Array:
        """(N, m) clearances [m]."""
        if self._cached[0] is not nodes:
            q_D, q_K = nodes.q_D[1:], nodes.q_K[1:]
            clearances = [part.at(q_D, q_K) for part in self._clearances]
            self._cached = nodes, np.stack(clearances, axis=1)
        return self._cached[1]

    def derivatives(self, nodes: Nodes) -> Array:
        """(N, m, n_z) derivatives of the clearances, by differences; 0 far above the margin."""
        t, value = self._table, self.value(nodes)
        n, k = t.n_vD, t.n_vK
        q_D, q_K = nodes.q_D[1:], nodes.q_K[1:]
        derivatives = np.zeros((*value.shape, nodes.n_z))
        step_D, step_K = _DIFFERENCE * np.eye(n)[:, None], _DIFFERENCE * np.eye(k)[:, None]
        for j, part in enumerate(self._clearances):
            near_nodes = np.flatnonzero(value[:, j] < self.margin + _MAX_MARGIN_EXCESS)
            if not len(near_nodes):
                continue
            near_q_D, near_q_K = q_D[near_nodes], q_K[near_nodes]
            perturbed = tangent.moved(
                t.scalars_D, t.quaternions_D, np.repeat(near_q_D[None], n, 0), step_D
            )
            by_D = part.at(perturbed, near_q_K) - value[near_nodes, j]
            perturbed = tangent.moved(
                t.scalars_K, t.quaternions_K, np.repeat(near_q_K[None], k, 0), step_K
            )
            by_K = part.at(near_q_D, perturbed) - value[near_nodes, j]
            derivatives[near_nodes, j, :n], derivatives[near_nodes, j, 2 * n : 2 * n + k] = (
                by_D.T / _DIFFERENCE,
                by_K.T / _DIFFERENCE,
            )
        return derivatives

    def in_run(self, run: Trajectory) -> Array:
        """(T, m) clearances at the samples of a run [m]."""
        return np.stack([part.of(run) for part in self._clearances], axis=1)
