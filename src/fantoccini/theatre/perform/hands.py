"""Hands: groups of driven coordinates that move together, their bounds and motion to targets.

A handle is a driven string end, or a body on a driven joint, that a hand can hold. q_K are the
driven coordinates and v_K their velocities; q_D are the dynamic coordinates. A winch changes the
length of a string. A drive moves a coordinate by a motor towards its command. A link is a body on
its joint. A tick is the interval at which a performance advances.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fantoccini.base import (
    Array,
    ConfigK,
    Indices,
    Quaternion,
    StateError,
    UnknownNameError,
    Vec3,
    VecK,
    rotation,
)
from fantoccini.dynamics.compiled import check_step
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import ChainRow
from fantoccini.motion import State
from fantoccini.theatre.gestures import TURN_RADIUS
from fantoccini.theatre.perform import reach
from fantoccini.theatre.perform.handle import (
    Handle,
    HandlePose,
    find_handles,
    handle_coordinates,
    handle_pose,
)
from fantoccini.theatre.perform.player import TickOffsets


class Limits(NamedTuple):
    """Bounds of hands."""

    turning_radius: float = TURN_RADIUS
    """Distance from the axis at which the bounds of a translation apply to a rotation [m]."""
    min_length: float = 0.01
    """Shortest length of a driven string [m]."""
    relative_range: tuple[float, float] = (0.1, 2.0)
    """Range of a driven length, relative to that at the start."""
    n_chain_lengths: int = 20
    """Number of lengths to try as the shortest of a chain."""


LIMITS = Limits()
_NO_POSES = np.zeros((0, 3, 4))


class HandBounds(NamedTuple):
    """Bounds of driven coordinates by name; together they keep the bounds of their hands.

    Attributes:
        position: lowest and highest driven lengths [m].
        speed, acceleration: largest magnitudes.
    """

    position: dict[str, tuple[float, float]]
    speed: dict[str, float]
    acceleration: dict[str, float]


@dataclass(frozen=True, eq=False)
class Hands:
    """Groups of driven coordinates that move together, and their bounds.

    Attributes:
        marionette: puppet.
        handles: parts that can be held.
        lengths: string with a driven length -> shortest and longest [m].
        winch_indices: string with a driven length -> (q, v), its indices in q_K and v_K.
        names: (n_groups,) name of the handle or string of each group.
        group: (n_vK,) group of each driven velocity.
        speed, acceleration: (n_groups,) bounds [m/s, m/s^2 or rad/s, rad/s^2].
    """

    marionette: Marionette
    handles: tuple[Handle, ...]
    lengths: dict[str, tuple[float, float]]
    winch_indices: dict[str, tuple[int, int]]
    names: tuple[str, ...]
    group: Indices
    speed: Array
    acceleration: Array

    @classmethod
    def for_puppet(
        cls,
        marionette: Marionette,
        x: State,
        speed: float,
        acceleration: float,
        lengths: dict[str, tuple[float, float]],
    ) -> Hands:
        """Hands of a puppet.

        Args:
            marionette: puppet.
            x: state.
            speed: bound on the speed of handles and winches [m/s].
            acceleration: bound on their acceleration [m/s^2].
            lengths: string -> its range [m]; contains at least the driven ones.
        """
        handles = find_handles(marionette, marionette.poses(x.q_D, x.q_K))
        winch_indices = _winches(marionette)
        length_ranges = {name: lengths[name] for name in winch_indices}
        groups = [(h.name, h.translation_indices, 1.0) for h in handles if len(h.axes)]
        groups += [
            (h.name, h.rotation_indices, 1.0 / LIMITS.turning_radius)
            for h in handles
            if len(h.turn_axes)
        ]
        groups += [(name, slice(v, v + 1), 1.0) for name, (_, v) in winch_indices.items()]
        group = np.zeros(len(x.v_K), dtype=np.intp)
        for i, (_, indices, _) in enumerate(groups):
            group[indices] = i
        scale = np.array([factor for _, _, factor in groups])
        names = tuple(name for name, _, _ in groups)
        return cls(
            marionette,
            handles,
            length_ranges,
            winch_indices,
            names,
            group,
            speed * scale,
            acceleration * scale,
        )

    @staticmethod
    def default_ranges(
        marionette: Marionette, x: State, dt: float
    ) -> dict[str, tuple[float, float]]:
        """String with a driven length -> range about its length at a state [m].

        Chains are long enough for steps of ``dt`` [s].
        """
        ranges = {
            name: _length_range(float(x.q_K[q])) for name, (q, _) in _winches(marionette).items()
        }
        for chain in marionette.tree.chains:
            if chain.name in ranges:
                shortest, longest = ranges[chain.name]
                ranges[chain.name] = (
                    _shortest_chain_length(marionette, chain, x, shortest, dt),
                    longest,
                )
        return ranges

    def coordinate_bounds(self) -> HandBounds:
        """Bounds of every driven coordinate."""
        table = self.marionette.coordinates
        axis_share = 1.0 / np.sqrt(np.bincount(self.group, minlength=len(self.speed)))[self.group]
        speed, acceleration = (
            self.speed[self.group] * axis_share,
            self.acceleration[self.group] * axis_share,
        )
        scalars = {q for q, _ in table.scalars_K}
        position = {
            table.q_K[q]: self.lengths[name]
            for name, (q, _) in self.winch_indices.items()
            if q in scalars
        }
        return HandBounds(
            position,
            dict(zip(table.v_K, map(float, speed), strict=True)),
            dict(zip(table.v_K, map(float, acceleration), strict=True)),
        )

    def handle(self, name: str) -> Handle:
        """Handle with a name."""
        if name not in self._by_name:
            raise UnknownNameError("handle", name, [h.name for h in self.handles])
        return self._by_name[name]

    def carriers(self, handle: Handle) -> tuple[Handle, ...]:
        """Handles of the other parts of a handle's joint, if drives move some of its coordinates.

        Each part is a handle itself, such as ``bar.carriage1``, and has no carriers.
        """
        return self._carriers[handle.name]

    @cached_property
    def _by_name(self) -> dict[str, Handle]:
        return {h.name: h for h in reversed(self.handles)}

    @cached_property
    def _carriers(self) -> dict[str, tuple[Handle, ...]]:
        links = self.marionette.tree.links
        return {
            name: ()
            if ".carriage" in name
            else tuple(
                h
                for h in self.handles
                if links[h.link].joint == links[handle.link].joint and h.link < handle.link
            )
            for name, handle in self._by_name.items()
        }

    def length_index(self, string: str) -> int:
        """Index in q_K of a driven length, or of its drive's command."""
        if string not in self.winch_indices:
            raise UnknownNameError("string with a driven length", string, self.winch_indices)
        return self.winch_indices[string][0]

    def place(self, name: str, x: State) -> HandlePose:
        """Position (3,) [m] and orientation (w, x, y, z) of a handle in the world."""
        return self._place(self.handle(name), x.q_K, x)

    def place_at(self, name: str, q_K: ConfigK, x: State) -> HandlePose:
        """Place of a handle at other driven coordinates, with those of its joint's parts.

        Args:
            name: name of the handle.
            q_K: (n_qK,) driven coordinates.
            x: state, for all other motion of the handle.
        """
        handle = self.handle(name)
        r, wxyz = self._place(handle, q_K, x)
        if parts := self.carriers(handle):
            poses = self.marionette.poses(x.q_D, x.q_K)
            shifts = [self._place(h, q_K, x)[0] - poses[h.link, :, 3] for h in parts]
            r = r + np.sum(shifts, axis=0)
        return r, wxyz

    def configuration_at(
        self, q_K: ConfigK, name: str, position: Vec3 | None, wxyz: Quaternion | None, x: State
    ) -> ConfigK:
        """(n_qK,) driven coordinates that move a handle as near to a place as its joint allows.

        Args:
            q_K: (n_qK,) coordinates; those of other handles do not change.
            name: name of the handle.
            position: (3,) position in the world [m]; unchanged by default.
            wxyz: (4,) orientation in the world; unchanged by default.
            x: state, for all other motion of the handle.

        Raises:
            UnknownNameError: no handle has this name.
            StateError: a position or orientation is invalid.
        """
        coordinates, handle = np.array(q_K), self.handle(name)
        for h in (*self.carriers(handle), handle):
            poses = self._poses(h, x)
            coordinates[h.q] = handle_coordinates(
                self.marionette, h, q_K[h.q], poses, position, wxyz
            )
        return coordinates

    def _place(self, handle: Handle, q_K: ConfigK, x: State) -> HandlePose:
        return handle_pose(self.marionette, handle, q_K, self._poses(handle, x))

    def _poses(self, handle: Handle, x: State) -> Array:
        """(n_links, 3, 4) poses of the links; empty if the handle's joint is at a fixed place."""
        if handle.fixed_frame is not None:
            return _NO_POSES
        return self.marionette.poses(x.q_D, x.q_K)

    def displacement(self, q_K: ConfigK, target: ConfigK) -> VecK:
        """(n_vK,) tangent vector from one driven configuration to another."""
        table, vector = self.marionette.coordinates, np.zeros(len(self.group))
        q, v = table.scalar_indices_K
        vector[v] = target[q] - q_K[q]
        for q_index, v_index in table.quaternions_K:
            quaternion = slice(q_index, q_index + 4)
            vector[v_index : v_index + 3] = rotation.between(q_K[quaternion], target[quaternion])
        return vector

    def wanted_velocity(
        self, x: State, target: ConfigK, tick: float, offsets: TickOffsets | None = None
    ) -> VecK:
        """(n_vK,) wanted velocities after the next tick; see ``reach``.

        Args:
            x: state.
            target: (n_qK,) targets.
            tick: duration of a tick [s].
            offsets: offsets that are added over the tick.
        """
        if offsets is None:
            displacement, v_K = self.displacement(x.q_K, target), x.v_K
        else:
            displacement = self.displacement(x.q_K, self.with_offsets(target, offsets.d))
            v_K = x.v_K - self._velocities(target, offsets.d, offsets.rate, displacement)
        velocity = reach.wanted_velocity(
            displacement, v_K, tick, self.group, self.speed, self.acceleration
        )
        if offsets is None:
            return velocity
        return self.bounded_velocity(
            velocity + self._velocities(target, offsets.d_next, offsets.rate_next, displacement)
        )

    def with_offsets(self, q_K: ConfigK, d: VecK) -> ConfigK:
        """(n_qK,) driven configuration plus offsets (n_vK,), with lengths in their ranges."""
        table, shifted = self.marionette.coordinates, np.array(q_K)
        q, v = table.scalar_indices_K
        shifted[q] += d[v]
        for q_index, v_index in table.quaternions_K:
            shifted[q_index : q_index + 4] = rotation.multiply(
                q_K[q_index : q_index + 4], rotation.exp(d[v_index : v_index + 3])
            )
        for name, (q_index, _) in self.winch_indices.items():
            shifted[q_index] = np.clip(shifted[q_index], *self.lengths[name])
        return shifted

    def _velocities(self, target: ConfigK, d: VecK, rate: VecK, displacement: VecK) -> VecK:
        """(n_vK,) velocities of :meth:`with_offsets`; of rotations in the frame of the hand."""
        velocities = np.array(rate)
        for _, v_index in self.marionette.coordinates.quaternions_K:
            indices = slice(v_index, v_index + 3)
            angular_velocity = rotation.right_jacobian(d[indices]) @ rate[indices]
            velocities[indices] = (
                rotation.matrix(rotation.exp(displacement[indices])) @ angular_velocity
            )
        for name, (q_index, v) in self.winch_indices.items():
            shortest, longest = self.lengths[name]
            if not shortest <= target[q_index] + d[v] <= longest:
                velocities[v] = 0.0
        return velocities

    def bounded_velocity(self, v_K: VecK) -> VecK:
        """(n_vK,) velocities within the bound on speed."""
        size = reach.lengths(v_K, self.group, len(self.speed))
        return v_K * np.minimum(1.0, self.speed / np.maximum(size, self.speed))[self.group]

    def bounded_acceleration(self, wanted: VecK, v_K: VecK, tick: float) -> VecK:
        """(n_vK,) accelerations towards wanted velocities; see ``reach``."""
        return reach.bounded_acceleration(wanted, v_K, tick, self.group, self.acceleration)


def _winches(marionette: Marionette) -> dict[str, tuple[int, int]]:
    """String or chain -> index in (q_K, v_K) of its length, or of its drive's command."""
    tree = marionette.tree
    places = {s.name: tree.commanding_length(s) for s in (*tree.strings, *tree.chains)}
    return {name: place for name, place in places.items() if place is not None}


def _shortest_chain_length(
    marionette: Marionette, chain: ChainRow, x: State, min_length: float, dt: float
) -> float:
    """Shortest of a few lengths from ``min_length`` [m] that permits steps of dt [s]."""
    assert chain.length_index is not None  # its length is driven, or wound by a drive
    q, length_index = (x.q_K, x.q_D)[chain.driven_length is None].copy(), chain.length_index[0]
    present_length = float(q[length_index])
    for length in np.geomspace(
        min(min_length, present_length), present_length, LIMITS.n_chain_lengths
    )[:-1]:
        q[length_index] = length
        configuration = (x.q_D, q) if chain.driven_length else (q, x.q_K)
        try:
            check_step(marionette, "timestepping", *configuration, dt)
        except StateError:
            continue
        return float(length)
    return present_length


def _length_range(length: float) -> tuple[float, float]:
    """Range of a driven length that is ``length`` at the start [m]."""
    shortest, longest = (factor * length for factor in LIMITS.relative_range)
    return max(LIMITS.min_length, shortest), max(2.0 * LIMITS.min_length, longest)
