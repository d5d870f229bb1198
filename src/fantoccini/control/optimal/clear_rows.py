"""Rows that keep bodies and strings clear of obstacles, of other puppets and of one another.

d_i(q_{i+1}) >= margin, one row for every body and string
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fantoccini.base import Array, tangent
from fantoccini.control.tasks import Nodes
from fantoccini.dynamics.clearance import Clearance, HalfSpace
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import Obstacle
from fantoccini.motion import Trajectory

_NEAR = 0.1
"""Distance above the margin from which a clearance is not differentiated [m]."""
_STEP = 1e-6
"""Of differences [m or rad]."""


class ClearRows:
    """Clearances of every body and string at the nodes after the first.

    Attributes:
        margin: the least clearance [m].
        names: of the bodies and strings.
        whole: measures all of them at once.

    Args:
        marionette: the puppet, with the obstacles of its file.
        margin: see above.
        own_body: whether bodies of one puppet that no joint connects are kept clear of one another.
        obstacles: in addition to the puppet's.
    """

    def __init__(
        self,
        marionette: Marionette,
        margin: float,
        own_body: bool,
        obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
    ):
        self.margin = margin
        self.whole = Clearance(marionette, obstacles, self_collision=own_body)
        parts = self.whole.parts()
        self.names, self._parts = tuple(parts), tuple(parts.values())
        self._table = marionette.coordinates
        self._kept: tuple[Nodes | None, Array] = (None, np.zeros((0, 0)))

    def __len__(self) -> int:
        return len(self.names)

    def value(self, nodes: Nodes) -> Array:
        """(N, m) [m]."""
        if self._kept[0] is not nodes:
            q_D, q_K = nodes.q_D[1:], nodes.q_K[1:]
            made = [part.at(q_D, q_K) for part in self._parts]
            self._kept = nodes, np.stack(made, axis=1)
        return self._kept[1]

    def by(self, nodes: Nodes) -> Array:
        """(N, m, n_z) their derivatives, by differences; 0 where they are far above the margin."""
        t, value = self._table, self.value(nodes)
        n, k = t.n_vD, t.n_vK
        q_D, q_K = nodes.q_D[1:], nodes.q_K[1:]
        out = np.zeros((*value.shape, nodes.n_z))
        step_D, step_K = _STEP * np.eye(n)[:, None], _STEP * np.eye(k)[:, None]
        for j, part in enumerate(self._parts):
            near = np.flatnonzero(value[:, j] < self.margin + _NEAR)
            if not len(near):
                continue
            a, b = q_D[near], q_K[near]
            moved = tangent.moved(t.scalars_D, t.quaternions_D, np.repeat(a[None], n, 0), step_D)
            by_D = part.at(moved, b) - value[near, j]
            moved = tangent.moved(t.scalars_K, t.quaternions_K, np.repeat(b[None], k, 0), step_K)
            by_K = part.at(a, moved) - value[near, j]
            out[near, j, :n], out[near, j, 2 * n : 2 * n + k] = by_D.T / _STEP, by_K.T / _STEP
        return out

    def along(self, run: Trajectory) -> Array:
        """(T, m) at the samples of a run [m]."""
        return np.stack([part.of(run) for part in self._parts], axis=1)
