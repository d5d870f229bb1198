"""Hands: groups of driven coordinates that move together, their bounds and motion to targets."""

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
from fantoccini.theatre.gestures import ARM
from fantoccini.theatre.perform import reach
from fantoccini.theatre.perform.handle import Handle, Place, handles_of, place_of, wanted
from fantoccini.theatre.perform.player import Steps


class Limits(NamedTuple):
    """Bounds of hands."""

    arm: float = ARM
    """Distance from the axis at which the bounds of a translation apply to a rotation [m]."""
    min_length: float = 0.01
    """Shortest length of a driven string [m]."""
    relative_range: tuple[float, float] = (0.1, 2.0)
    """Range of a driven length, relative to that at the start."""
    chain_lengths: int = 20
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
        winch: string with a driven length -> (q, v), its indices in q_K and v_K.
        names: (n_groups,) name of the handle or string of each group.
        group: (n_vK,) group of each driven velocity.
        speed, acceleration: (n_groups,) bounds [m/s, m/s^2 or rad/s, rad/s^2].
    """

    marionette: Marionette
    handles: tuple[Handle, ...]
    lengths: dict[str, tuple[float, float]]
    winch: dict[str, tuple[int, int]]
    names: tuple[str, ...]
    group: Indices
    speed: Array
    acceleration: Array

    @classmethod
    def of(
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
        handles = handles_of(marionette, marionette.poses(x.q_D, x.q_K))
        winch = _winches(marionette)
        ranges = {name: lengths[name] for name in winch}
        groups = [(h.name, h.moves, 1.0) for h in handles if len(h.axes)]
        groups += [(h.name, h.rotates, 1.0 / LIMITS.arm) for h in handles if len(h.turns)]
        groups += [(name, slice(v, v + 1), 1.0) for name, (_, v) in winch.items()]
        group = np.zeros(len(x.v_K), dtype=np.intp)
        for i, (_, place, _) in enumerate(groups):
            group[place] = i
        scale = np.array([factor for _, _, factor in groups])
        names = tuple(name for name, _, _ in groups)
        return cls(
            marionette, handles, ranges, winch, names, group, speed * scale, acceleration * scale
        )

    @staticmethod
    def ranges_of(marionette: Marionette, x: State, dt: float) -> dict[str, tuple[float, float]]:
        """String with a driven length -> range about its length at a state [m].

        Chains are long enough for steps of ``dt`` [s].
        """
        ranges = {name: _range(float(x.q_K[q])) for name, (q, _) in _winches(marionette).items()}
        for chain in marionette.tree.chains:
            if chain.name in ranges:
                low, high = ranges[chain.name]
                ranges[chain.name] = _shortest(marionette, chain, x, low, dt), high
        return ranges

    def coordinate_bounds(self) -> HandBounds:
        """Bounds of every driven coordinate."""
        table = self.marionette.coordinates
        share = 1.0 / np.sqrt(np.bincount(self.group, minlength=len(self.speed)))[self.group]
        speed, acceleration = self.speed[self.group] * share, self.acceleration[self.group] * share
        scalars = {q for q, _ in table.scalars_K}
        position = {
            table.q_K[q]: self.lengths[name] for name, (q, _) in self.winch.items() if q in scalars
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
        if string not in self.winch:
            raise UnknownNameError("string with a driven length", string, self.winch)
        return self.winch[string][0]

    def place(self, name: str, x: State) -> Place:
        """Position (3,) [m] and orientation (w, x, y, z) of a handle in the world."""
        return self._place(self.handle(name), x.q_K, x)

    def place_at(self, name: str, q_K: ConfigK, x: State) -> Place:
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
        moved, handle = np.array(q_K), self.handle(name)
        for h in (*self.carriers(handle), handle):
            poses = self._poses(h, x)
            moved[h.q] = wanted(self.marionette, h, q_K[h.q], poses, position, wxyz)
        return moved

    def _place(self, handle: Handle, q_K: ConfigK, x: State) -> Place:
        return place_of(self.marionette, handle, q_K, self._poses(handle, x))

    def _poses(self, handle: Handle, x: State) -> Array:
        """(n_links, 3, 4) poses of the links; empty if the handle's joint is at a fixed place."""
        if handle.base is not None:
            return _NO_POSES
        return self.marionette.poses(x.q_D, x.q_K)

    def away(self, q_K: ConfigK, wanted: ConfigK) -> VecK:
        """(n_vK,) tangent vector from one driven configuration to another."""
        table, away = self.marionette.coordinates, np.zeros(len(self.group))
        q, v = table.scalar_indices_K
        away[v] = wanted[q] - q_K[q]
        for at, w in table.quaternions_K:
            turned = slice(at, at + 4)
            away[w : w + 3] = rotation.between(q_K[turned], wanted[turned])
        return away

    def wanted_velocity(
        self, x: State, wanted: ConfigK, tick: float, steps: Steps | None = None
    ) -> VecK:
        """(n_vK,) wanted velocities after the next tick; see ``reach``.

        Args:
            x: state.
            wanted: (n_qK,) targets.
            tick: duration of a tick [s].
            steps: offsets that are added over the tick.
        """
        if steps is None:
            away, v_K = self.away(x.q_K, wanted), x.v_K
        else:
            away = self.away(x.q_K, self.moved(wanted, steps.d))
            v_K = x.v_K - self._rates(wanted, steps.d, steps.rate, away)
        velocity = reach.wanted_velocity(away, v_K, tick, self.group, self.speed, self.acceleration)
        if steps is None:
            return velocity
        return self.bounded(velocity + self._rates(wanted, steps.d_next, steps.rate_next, away))

    def moved(self, q_K: ConfigK, d: VecK) -> ConfigK:
        """(n_qK,) driven configuration plus offsets (n_vK,), with lengths in their ranges."""
        table, moved = self.marionette.coordinates, np.array(q_K)
        q, v = table.scalar_indices_K
        moved[q] += d[v]
        for at, w in table.quaternions_K:
            moved[at : at + 4] = rotation.multiply(q_K[at : at + 4], rotation.exp(d[w : w + 3]))
        for name, (place, _) in self.winch.items():
            moved[place] = np.clip(moved[place], *self.lengths[name])
        return moved

    def _rates(self, wanted: ConfigK, d: VecK, rate: VecK, away: VecK) -> VecK:
        """(n_vK,) velocities of :meth:`moved`; those of rotations in the frame of the hand."""
        rates = np.array(rate)
        for _, w in self.marionette.coordinates.quaternions_K:
            turn = slice(w, w + 3)
            angular_velocity = rotation.right_jacobian(d[turn]) @ rate[turn]
            rates[turn] = rotation.matrix(rotation.exp(away[turn])) @ angular_velocity
        for name, (place, v) in self.winch.items():
            low, high = self.lengths[name]
            if not low <= wanted[place] + d[v] <= high:
                rates[v] = 0.0
        return rates

    def bounded(self, v_K: VecK) -> VecK:
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


def _shortest(marionette: Marionette, chain: ChainRow, x: State, low: float, dt: float) -> float:
    """Shortest of a few lengths from ``low`` [m] that permits steps of dt [s]."""
    assert chain.length_index is not None  # its length is driven, or wound by a drive
    q, index = (x.q_K, x.q_D)[chain.driven_length is None].copy(), chain.length_index[0]
    present = float(q[index])
    for length in np.geomspace(min(low, present), present, LIMITS.chain_lengths)[:-1]:
        q[index] = length
        configuration = (x.q_D, q) if chain.driven_length else (q, x.q_K)
        try:
            check_step(marionette, "timestepping", *configuration, dt)
        except StateError:
            continue
        return float(length)
    return present


def _range(length: float) -> tuple[float, float]:
    """Range of a driven length that is ``length`` at the start [m]."""
    short, long = (factor * length for factor in LIMITS.relative_range)
    return max(LIMITS.min_length, short), max(2.0 * LIMITS.min_length, long)
