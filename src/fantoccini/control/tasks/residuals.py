"""Residuals of costs at nodes, and their derivatives with respect to changes of the states.

A residual is the difference of a quantity from its path. q_D are dynamic and q_K driven
coordinates, v_D and v_K their velocities. A link is a body on its joint. A twist is a velocity of a
link, linear and angular; a screw is the twist per unit of one joint velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from fantoccini.base import Array, StateError, Times, UnknownNameError, rotation
from fantoccini.control.tasks.clip import Clip
from fantoccini.control.tasks.costs import Track
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.control.tasks.targets import values_at
from fantoccini.dynamics.compiled import moving_and_carrying
from fantoccini.dynamics.marionette import Marionette

_TIME_ROUNDING = 1e-9
"""Rounding error of times [s]."""


class NodeKinematics:
    """States at the nodes for the evaluation of costs; poses and screws are computed once."""

    def __init__(self, marionette: Marionette, nodes: Nodes):
        self.marionette, self.nodes = marionette, nodes

    @cached_property
    def _screws(self) -> tuple[Array, Array]:
        marionette, nodes = self.marionette, self.nodes
        kinematics = marionette.library.evaluate(
            "screws", q_D=nodes.q_D, q_K=nodes.q_K, p=marionette.p
        )
        screws = np.concatenate([kinematics.screw_D, kinematics.screw_K], axis=-1).swapaxes(-1, -2)
        return kinematics.poses.swapaxes(-1, -2), screws

    def pose(self, link: int) -> tuple[Array, Array]:
        """(N + 1, 3, 3) rotations and (N + 1, 3) positions of a link."""
        poses = self._screws[0][:, link]
        return poses[:, :9].reshape(-1, 3, 3).swapaxes(1, 2), poses[:, 9:]

    def twist_jacobian(self, link: int) -> Array:
        """(N + 1, 6, n_z) derivative of a link's displacement twist about the world's origin."""
        table = self.marionette.coordinates
        n, k = table.n_vD, table.n_vK
        is_moved = moving_and_carrying(self.marionette.tree)[0][link]
        screws = (self._screws[1] * is_moved[:, None]).swapaxes(1, 2)
        twist = np.zeros((len(screws), 6, 2 * (n + k)))
        twist[:, :, :n], twist[:, :, 2 * n : 2 * n + k] = screws[..., :n], screws[..., n:]
        return twist


class Residual(Protocol):
    """A residual at every node.

    Attributes:
        weights: (N + 1,) weights of |r|^2 / 2, including the length of intervals.
    """

    @property
    def weights(self) -> Array: ...

    def value(self, kinematics: NodeKinematics) -> Array:
        """(N + 1, m) residuals."""

    def derivatives(self, kinematics: NodeKinematics) -> Array:
        """(N + 1, m, n_z) derivatives of the residuals with respect to changes of the states."""


@dataclass(frozen=True, eq=False)
class PointResidual:
    """r = the position of a point of a link minus its path [m]."""

    weights: Array
    link: int
    at: Array
    path: Array

    def value(self, kinematics: NodeKinematics) -> Array:
        return self._position(kinematics) - self.path

    def derivatives(self, kinematics: NodeKinematics) -> Array:
        twist, position = kinematics.twist_jacobian(self.link), self._position(kinematics)
        return twist[:, :3] - rotation.skew(position) @ twist[:, 3:]

    def _position(self, kinematics: NodeKinematics) -> Array:
        R, origin = kinematics.pose(self.link)
        return origin + R @ self.at


@dataclass(frozen=True, eq=False)
class OrientationResidual:
    """r = log(R_path^T R), the rotation from the path to a link in the path's frame [rad]."""

    weights: Array
    link: int
    path: Array

    def value(self, kinematics: NodeKinematics) -> Array:
        return rotation.log(rotation.quaternion(self._rotation_error(kinematics)))

    def derivatives(self, kinematics: NodeKinematics) -> Array:
        r, R = self.value(kinematics), kinematics.pose(self.link)[0]
        body_rotation = R.swapaxes(1, 2) @ kinematics.twist_jacobian(self.link)[:, 3:]
        return rotation.right_jacobian_inverse(r) @ body_rotation

    def _rotation_error(self, kinematics: NodeKinematics) -> Array:
        return rotation.matrix(self.path).swapaxes(1, 2) @ kinematics.pose(self.link)[0]


@dataclass(frozen=True, eq=False)
class ScalarResidual:
    """r = numbers of the states minus their paths."""

    weights: Array
    field: str
    indices: list[int]
    columns: list[int]
    path: Array

    def value(self, kinematics: NodeKinematics) -> Array:
        numbers: Array = getattr(kinematics.nodes, self.field)[:, self.indices]
        return numbers - self.path

    def derivatives(self, kinematics: NodeKinematics) -> Array:
        derivatives = np.zeros((len(kinematics.nodes) + 1, len(self.columns), kinematics.nodes.n_z))
        derivatives[:, np.arange(len(self.columns)), self.columns] = 1.0
        return derivatives


def track_residual(marionette: Marionette, track: Track, nodes: Nodes) -> Residual:
    """The residual of a track at the nodes of a motion.

    Raises:
        UnknownNameError, StateError: unknown name, or invalid path.
    """
    t, N = nodes.t, len(nodes)
    spans = np.full(N + 1, nodes.interval)
    spans[[0, -1]] *= 0.5
    weights = track.weight * spans * active_fraction(track, t)
    weights[-1] += track.end_weight
    if track.kind == "point":
        link = marionette.link_index(track.name)
        path = track_path(marionette, track, t)
        return PointResidual(weights, link, np.array(track.at), path)
    if track.kind == "orientation":
        link = marionette.link_index(track.name)
        path = track_path(marionette, track, t)
        if np.any(np.linalg.norm(path, axis=1) < 0.5):
            raise StateError(f"the path of {track.name}: needed: unit quaternions w, x, y, z")
        return OrientationResidual(weights, link, rotation.normalised(path))
    field, indices, columns = _numbers(marionette, track)
    path = track_path(marionette, track, t)
    return ScalarResidual(weights, field, indices, columns, path)


def track_path(marionette: Marionette, track: Track, t: Times) -> Array:
    """(len(t), width) the path of a track at given times.

    Raises:
        UnknownNameError, StateError: unknown name, or invalid path.
    """
    if isinstance(track.path, Clip):
        return track.path.values(marionette, track.kind, track.name, track.at, t)
    width = {"point": 3, "orientation": 4}.get(track.kind, 1)
    return values_at(f"the path of {track.name}", track.path, t, width)


def active_fraction(track: Track, t: Times) -> Array:
    """(n,) 1 at times at which a track counts, 1/2 at its start and end inside the motion, else 0.

    Raises:
        StateError: no time at which the track counts.
    """
    inside = (t >= track.start - _TIME_ROUNDING) & (t <= track.end + _TIME_ROUNDING)
    if not np.any(inside):
        raise StateError(
            f"the path of {track.name} counts from {track.start:g} s to {track.end:g} s, and no "
            f"node lies there: nodes are {t[1] - t[0]:g} s apart from {t[0]:g} s on"
        )
    at_end = (np.abs(t - track.start) <= _TIME_ROUNDING) | (np.abs(t - track.end) <= _TIME_ROUNDING)
    at_end[[0, -1]] = False
    return np.where(inside, np.where(at_end, 0.5, 1.0), 0.0)


def _numbers(marionette: Marionette, track: Track) -> tuple[str, list[int], list[int]]:
    """Part of a state, indices into it, and columns of z."""
    table = marionette.coordinates
    n, k = table.n_vD, table.n_vK
    if track.kind == "velocity":
        if track.name == "*":
            return "v_D", list(range(n)), list(range(n, 2 * n))
        if track.name in table.v_D:
            v = table.v_D.index(track.name)
            return "v_D", [v], [n + v]
        if track.name in table.v_K:
            v = table.v_K.index(track.name)
            return "v_K", [v], [2 * n + k + v]
        raise UnknownNameError("velocity", track.name, [*table.v_D, *table.v_K])
    targets = {table.q_D[q]: ("q_D", [q], [v]) for q, v in table.scalars_D}
    targets |= {table.q_K[q]: ("q_K", [q], [2 * n + v]) for q, v in table.scalars_K}
    if track.name not in targets:
        raise UnknownNameError("scalar coordinate", track.name, list(targets))
    return targets[track.name]
