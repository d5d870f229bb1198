"""Limits of twists in MuJoCo: tendons that are updated before every step.

MuJoCo limits the whole rotation of a ball joint, never its part about one axis. But a tendon
between two points 1 m from the joint's centre, a right angle apart about the axis g, lengthens at
the rate sqrt(1/2) g.w, with w the joint's angular velocity. An update sets g along J, where
hdot = J w, and the largest length to the present one minus sqrt(1/2) h/|J|. Then the tendon limits
the twist like the row h <= 0, to first order in the angle of a step.

A twist is the rotation of a ball joint about its own axis, and h <= 0 the condition of its limit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fantoccini.base import Array, cross, perpendicular, rotation
from fantoccini.model.tree import Tree

_TENDON_LENGTH, _LENGTH_PER_ANGLE = np.sqrt(2.0), np.sqrt(0.5)
"""Length of a tendon after an update [m], and its derivative by the angle about g [m/rad]."""

_NEXT_AXIS, _PREVIOUS_AXIS = [1, 2, 0], [2, 0, 1]
"""Axis after and before x, y and z in cyclic order."""


class Twists:
    """Tendons that limit a puppet's twists; false without twists.

    Attributes:
        row_indices: (n,) indices among the puppet's limits.
        tendons: (n,) tendons of the twists in MuJoCo.
        scale: (n,) change of a tendon's length per change of h, since the last update.

    Args:
        model: MuJoCo's model; :meth:`update` changes it.
        tree: the puppet's tree.
    """

    def __init__(self, model: Any, tree: Tree):
        indices = [i for i, limit in enumerate(tree.limits) if limit.side.startswith("twist")]
        limits = [tree.limits[i] for i in indices]
        self.row_indices, self._model = np.array(indices, dtype=int), model
        self.tendons = np.array([model.tendon(limit.name).id for limit in limits], dtype=int)
        joints = np.array(
            [model.joint(tree.links[limit.link].joint).id for limit in limits], dtype=int
        )
        self._q = model.jnt_qposadr[joints][:, None] + np.arange(4)
        # The joint frame in the parent: the body's pose where its joint is at zero.
        bodies = model.jnt_bodyid[joints]
        self._centre = model.body_pos[bodies].copy()
        self._frame = rotation.matrix(model.body_quat[bodies])
        sites = [model.site(f"{limit.name}.{end}").id for limit in limits for end in (0, 1)]
        self._sites = np.array(sites, dtype=int).reshape(-1, 2)
        self._b = np.array([limit.b for limit in limits]).reshape(-1, 3)
        self._bound = np.array([limit.bound for limit in limits])
        self._sign = np.array([-1.0 if limit.side == "twist.lower" else 1.0 for limit in limits])
        self.scale = np.ones(len(indices))

    def __bool__(self) -> bool:
        return len(self.row_indices) > 0

    def update(self, qpos: Array) -> None:
        """Moves the tendons' ends and limits to MuJoCo's configuration (n_q,)."""
        q, b = qpos[self._q], self._b
        s, v = q[:, :1], q[:, 1:]
        x = np.sum(v * b, axis=1, keepdims=True)
        twist = 2.0 * np.arctan2(np.where(s < 0.0, -x, x), np.abs(s))[:, 0]
        h = self._sign * (twist - self._bound)
        J = self._sign[:, None] * (s * (s * b + cross(b, v)) + x * v) / (s * s + x * x)
        norm = np.linalg.norm(J, axis=1)
        self.scale = _LENGTH_PER_ANGLE / norm
        g = J / norm[:, None]
        begin, end = tendon_ends(g)
        cross_term = 2.0 * cross(v, begin)
        start_point = self._frame @ (begin + s * cross_term + cross(v, cross_term))[..., None]
        self._model.site_pos[self._sites[:, 0]] = self._centre + start_point[..., 0]
        self._model.site_pos[self._sites[:, 1]] = end
        self._model.tendon_range[self.tendons, 1] = _TENDON_LENGTH - self.scale * h


def tendon_ends(g: Array) -> tuple[Array, Array]:
    """Unit vectors (..., 3): the second is the first after a quarter turn about g (..., 3)."""
    end = perpendicular(g)
    return cross(end, g), end
