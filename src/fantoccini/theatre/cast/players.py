"""Players of a cast: each puppet in a scene of its own, and its state on the stage.

A footing is a place on the stage with a heading. q_D are the dynamic coordinates of a puppet, q_K
the driven ones: ends and lengths of its strings. A marionette is a puppet with its compiled
equations; `marionette.puppet` is the description in its file. A link is a body on its joint.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.cast.contacts import ContactBodies
from fantoccini.theatre.cast.footing import Footing
from fantoccini.theatre.gaits import Gait, standing_lengths
from fantoccini.theatre.gestures import BodyParts, Ends, Gesture, leg_length, leg_ratio


@dataclass(frozen=True, eq=False)
class Player:
    """Puppet of the cast. Its own scene and the stage have the same frame.

    Attributes:
        name: name in the play.
        marionette: the puppet in a scene of its own.
        rest_state: rest at the origin with the heading of its file; gestures begin there.
        x0: state at the start of the play.
        start: footing at the start of the play.
        gait: gait of its straight walks on the floor; None if it walks above the floor.
    """

    name: str
    marionette: Marionette
    rest_state: State
    x0: State
    start: Footing
    gait: Gait | None = None

    @cached_property
    def content_hash(self) -> str:
        """Hash of the puppet and its meshes, and of the floor."""
        return hashlib.blake2b(self.marionette.puppet.canonical().encode()).hexdigest()

    @cached_property
    def bodies(self) -> ContactBodies:
        """Bodies that touch props and seats; none without a body map."""
        try:
            return ContactBodies.of(self.name, BodyParts.for_puppet(self.marionette).body_map)
        except StateError:
            return ContactBodies(self.name)

    @cached_property
    def facing(self) -> float:
        """Heading in the puppet's file, from which it and its gestures are turned [rad]."""
        return facing_of(self.marionette)

    def turned(self, gesture: Gesture, heading: float) -> Gesture:
        """A gesture of the puppet's file for the puppet at a heading on the stage [rad]."""
        return gesture.turned(heading - self.facing)

    @cached_property
    def middle(self) -> complex:
        """Position x + i y of the player: middle between the ends of its carrying strings [m]."""
        return middle_of(self.marionette, self.rest_state)

    @cached_property
    def leg_ratio(self) -> float:
        """Length of its legs, relative to that for which walks are written; 1 without legs."""
        try:
            return leg_ratio(BodyParts.for_puppet(self.marionette)) or 1.0
        except StateError:
            return 1.0

    @cached_property
    def leg_length(self) -> float:
        """Mean length of its legs [m]; 0 without legs.

        Raises:
            StateError: it has no body map.
        """
        return leg_length(BodyParts.for_puppet(self.marionette).body_map)

    @cached_property
    def standing_lengths(self) -> Mapping[str, float]:
        """String -> length at which its soles just reach the floor [m].

        Raises:
            StateError: see :func:`fantoccini.theatre.gaits.standing_lengths`.
        """
        return standing_lengths(BodyParts.for_puppet(self.marionette), self.rest_state)

    @cached_property
    def height(self) -> float:
        """Height of the top of its head, or else of its highest joint, where it hangs [m]."""
        poses = self.marionette.poses(self.rest_state.q_D[None], self.rest_state.q_K[None])[0]
        links = [link.name for link in self.marionette.tree.links]
        heights = [z for name, z in zip(links, poses[:, 2, 3], strict=True) if name in self._bodies]
        try:
            head = BodyParts.for_puppet(self.marionette).body_map.head
        except StateError:
            head = None
        if head is not None:
            pose = poses[links.index(head.body)]
            heights.append(pose[2, :3] @ head.end + pose[2, 3])
        return float(max(heights))

    @property
    def _bodies(self) -> set[str]:
        return {body.name for body in self.marionette.puppet.expanded().bodies}

    @cached_property
    def radius(self) -> float:
        """Radius of the disk around its position that contains its strings' ends and joints [m]."""
        table, rest_state = self.marionette.coordinates, self.rest_state
        part_names = dict.fromkeys(name.rpartition(".")[0] for name in table.q_K)
        points = [
            complex(rest_state[f"{part}.x"], rest_state[f"{part}.y"])
            for part in part_names
            if {f"{part}.x", f"{part}.y"} <= {*table.q_K} and part not in table.carried
        ]
        poses = self.marionette.poses(rest_state.q_D[None], rest_state.q_K[None])[0]
        points += [complex(x, y) for x, y in poses[:, :2, 3]]
        return max((abs(xy - self.middle) for xy in points), default=0.0)

    def ends(self) -> Ends:
        """Ends of its strings, for a gesture.

        Raises:
            StateError: it has no body map, or an end or length of a string is not driven.
        """
        return Ends(BodyParts.for_puppet(self.marionette), self.rest_state)

    def in_own_frame(self, point: Array, footing: Footing) -> Array:
        """(3,) point of the stage in the frame of the puppet's file, for a footing [m]."""
        local_place = footing.seen(complex(point[0], point[1]))
        z = self.middle + local_place * np.exp(1j * self.facing)
        return np.array([z.real, z.imag, point[2]])


def middle_of(marionette: Marionette, rest_state: State) -> complex:
    """Middle x + i y between the ends of the carrying strings; 0 without a body map [m]."""
    try:
        return Ends(BodyParts.for_puppet(marionette), rest_state).middle
    except StateError:
        return 0j


def facing_of(marionette: Marionette) -> float:
    """Heading of a puppet in its file; 0 without a body map [rad]."""
    try:
        return BodyParts.for_puppet(marionette).heading
    except StateError:
        return 0.0


def moved_to_footing(marionette: Marionette, rest_state: State, footing: Footing) -> State:
    """State moved rigidly from where the puppet hangs to a footing on the stage.

        z' = z_footing + exp(i (heading - heading_file)) (z - z_middle)

    z = x + i y of the ends of strings and of free bodies. Parts on a moving body move with it.
    """
    angle = footing.heading - facing_of(marionette)
    table, rotation = marionette.coordinates, np.exp(1j * angle)
    middle = middle_of(marionette, rest_state)
    q = values_by_name(marionette, rest_state)
    owners = dict.fromkeys(name.rpartition(".")[0] for name in q)
    for owner in (owner for owner in owners if owner not in table.carried):
        x, y = f"{owner}.x", f"{owner}.y"
        if x in q and y in q:
            z = footing.place + rotation * (complex(q[x], q[y]) - middle)
            q[x], q[y] = float(z.real), float(z.imag)
        if x in q and f"{owner}.qw" in q:
            quaternion_names = [f"{owner}.{component}" for component in ("qw", "qx", "qy", "qz")]
            c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
            w, a, b, d = (q[component] for component in quaternion_names)
            product = (c * w - s * d, c * a - s * b, c * b + s * a, c * d + s * w)
            q.update(zip(quaternion_names, map(float, product), strict=True))
    return dataclasses.replace(
        rest_state,
        q_D=np.array([q[name] for name in table.q_D]),
        q_K=np.array([q[name] for name in table.q_K]),
    )


def values_by_name(marionette: Marionette, x: State) -> dict[str, float]:
    """Values of all coordinates by name."""
    table = marionette.coordinates
    return dict(zip((*table.q_D, *table.q_K), (*x.q_D.tolist(), *x.q_K.tolist()), strict=True))
