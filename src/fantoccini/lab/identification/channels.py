"""Channels of a record, the measured numbers: marker positions, scalar coordinates and tensions.

A record is measurements of a puppet in motion. q_D and q_K are the dynamic and driven coordinates
at its samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.compiled import OFFSETS, PARAMETER_STEP, WEIGHTS, moving_and_carrying


@dataclass(frozen=True)
class Marker:
    """A point of a body whose position is measured.

    Attributes:
        name: its columns are ``name.x``, ``name.y`` and ``name.z``.
        body: the body that carries it.
        at: its position in the body's frame [m]; the initial value if ``find``.
        find: whether its position is estimated.
    """

    name: str
    body: str
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    find: bool = False


@dataclass(frozen=True, eq=False)
class ChannelValues:
    """Channels except tensions at N configurations, with their derivatives.

    Attributes:
        value: (N, n_c) values.
        J_D: (N, n_c, n_vD) derivatives by the dynamic configuration.
        J_K: (N, n_c, n_vK) derivatives by the driven configuration.
        J_p: (N, n_c, n_p) derivatives by parameters at fixed configurations; None if all are 0.
        frames: (N, n_markers, 3, 3) axes of the markers' bodies.
    """

    value: Array
    J_D: Array
    J_K: Array
    J_p: Array | None
    frames: Array


class Channels:
    """The numbers measured at each sample: 3 for every marker, then coordinates, then tensions.

    Args:
        marionette: the puppet.
        markers: the measured points.
        coordinates: names of scalar dynamic coordinates.
        tensions: names of strings.

    Raises:
        UnknownNameError: the puppet lacks a body, coordinate or string.
        StateError: two markers have the same name.
    """

    def __init__(
        self,
        marionette: Marionette,
        markers: Sequence[Marker] = (),
        coordinates: Sequence[str] = (),
        tensions: Sequence[str] = (),
    ):
        table, strings = marionette.coordinates, [s.name for s in marionette.tree.strings]
        self.marionette, self.markers = marionette, tuple(markers)
        self.coordinates, self.tensions = tuple(coordinates), tuple(tensions)
        names = [marker.name for marker in self.markers]
        if duplicates := sorted({name for name in names if names.count(name) > 1}):
            raise StateError(
                f"two markers are called {duplicates[0]}; each needs a name of its own"
            )
        self._links = [marionette.link_index(marker.body) for marker in self.markers]
        scalars = {table.q_D[q]: (q, v) for q, v in table.scalars_D}
        for name in self.coordinates:
            if name not in scalars:
                raise UnknownNameError("scalar dynamic coordinate", name, tuple(scalars))
        for name in self.tensions:
            if name not in strings:
                raise UnknownNameError("string", name, tuple(strings))
        self._scalars = [scalars[name] for name in self.coordinates]
        self.rows = [strings.index(name) for name in self.tensions]
        columns = [f"{name}.{axis}" for name in names for axis in "xyz"]
        self.names = (*columns, *self.coordinates, *(f"{name}.tension" for name in self.tensions))
        groups = [name for name in names for _ in "xyz"]
        self.groups = (*groups, *self.names[len(columns) :])
        """Name of every channel's noise group, whose channels share a noise level."""

    def __len__(self) -> int:
        return len(self.names)

    @property
    def n_kinematic(self) -> int:
        """Number of channels that are not tensions."""
        return len(self.names) - len(self.rows)

    def evaluate(self, q_D: Array, q_K: Array, p: Array, marker_positions: Array) -> Array:
        """(N, n_c) channels at (N, n_qD) and (N, n_qK), with marker positions (n_markers, 3)."""
        marionette = self.marionette
        poses = marionette.library.evaluate("poses", q_D=q_D, q_K=q_K, p=p).poses.swapaxes(-1, -2)
        R, r = self._frames(poses)
        points = (R @ marker_positions[..., None])[..., 0] + r
        scalars = q_D[:, [q for q, _ in self._scalars]]
        return np.concatenate([points.reshape(len(q_D), 3 * len(self._links)), scalars], axis=1)

    def derivatives(
        self, q_D: Array, q_K: Array, p: Array, marker_positions: Array, with_parameters: bool
    ) -> ChannelValues:
        """The channels with their derivatives; by parameters only if ``with_parameters``."""
        marionette, N = self.marionette, len(q_D)
        n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
        kinematics = marionette.library.evaluate("screws", q_D=q_D, q_K=q_K, p=p)
        R, r = self._frames(kinematics.poses.swapaxes(-1, -2))
        points = (R @ marker_positions[..., None])[..., 0] + r
        screws = np.concatenate([kinematics.screw_D, kinematics.screw_K], axis=-1)
        is_moved_by = moving_and_carrying(marionette.tree)[0]
        derivative = np.zeros((N, self.n_kinematic, n + k))
        for i, link in enumerate(self._links):
            twist = screws * is_moved_by[link]
            rotation = np.cross(twist[:, 3:], points[:, i, :, None], axis=1)
            derivative[:, 3 * i : 3 * i + 3] = twist[:, :3] + rotation
        m = 3 * len(self._links)
        for j, (_, v) in enumerate(self._scalars):
            derivative[:, m + j, v] = 1.0
        scalars = q_D[:, [q for q, _ in self._scalars]]
        value = np.concatenate([points.reshape(N, 3 * len(self._links)), scalars], axis=1)
        J_p = self._parameter_jacobian(q_D, q_K, p, marker_positions) if with_parameters else None
        return ChannelValues(value, derivative[..., :n], derivative[..., n:], J_p, R)

    def _frames(self, poses: Array) -> tuple[Array, Array]:
        """(N, n_markers, 3, 3) axes and (N, n_markers, 3) origins of the markers' bodies."""
        frames = poses[:, self._links]
        return frames[..., :9].reshape(*frames.shape[:2], 3, 3).swapaxes(-1, -2), frames[..., 9:]

    def _parameter_jacobian(
        self, q_D: Array, q_K: Array, p: Array, marker_positions: Array
    ) -> Array:
        """(N, n_c, n_p) derivatives by parameters, from differences of sixth order."""
        derivative = np.zeros((len(q_D), self.n_kinematic, len(p)))
        for i in range(len(p)):
            step = PARAMETER_STEP * max(1.0, abs(p[i]))
            for offset, weight in zip(OFFSETS, WEIGHTS, strict=True):
                shifted_p = p.copy()
                shifted_p[i] += offset * step
                derivative[..., i] += (
                    weight / step * self.evaluate(q_D, q_K, shifted_p, marker_positions)
                )
        return derivative

    def depend_on(self, q_D: Array, q_K: Array, p: Array, parameter_indices: Sequence[int]) -> bool:
        """Whether one of these parameters changes a channel at a fixed configuration.

        The position of a joint does, a mass does not.
        """
        marker_positions = np.array([marker.at for marker in self.markers]).reshape(-1, 3)
        reference = self.evaluate(q_D[None], q_K[None], p, marker_positions)
        for i in parameter_indices:
            shifted_p = p.copy()
            shifted_p[i] += PARAMETER_STEP * max(1.0, abs(p[i]))
            if np.any(
                self.evaluate(q_D[None], q_K[None], shifted_p, marker_positions) != reference
            ):
                return True
        return False
