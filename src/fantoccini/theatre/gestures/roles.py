"""Parts of a body, such as a hand or the head, as strings of a puppet and directions of their ends.

A puppet on a control has bars as parts, too: the control, and for each kind of limb the bar to
which all its strings are tied. A gesture moves parts by offsets for a body of certain sizes; for
another body they are multiplied by the ratio of the sizes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import BodyMap
from fantoccini.model.tree import WORLD, Role, measure

KINDS = ("arm", "leg", "wing", "tail", "neck")
"""Kinds of limbs; a plural means all limbs of the kind, and none if the puppet has none."""
SizeKind: TypeAlias = Literal["whole", "arm", "leg", "wing", "tail", "neck"]
"""Kind of limb, or the whole body, whose size scales offsets of trunk and head."""
_TURN_DIGITS = 9
"""Decimals of the heading of a puppet [rad]."""


def not_driven(name: str, on_control: bool) -> str:
    """Name of a coordinate that a gesture moves and a puppet lacks, and what the gesture needs.

    Args:
        name: name of the coordinate.
        on_control: whether the gesture has moves for puppets on controls.
    """
    needed = "strings with driven lengths and with ends driven in x and y"
    if on_control:
        needed += ", or a driven control that carries the trunk on strings of fixed length"
    return f"{name}, which is not a driven coordinate; needed: {needed} (docs/gestures.md)"


@dataclass(frozen=True)
class Move:
    """A string or a bar, and a direction, that a part's name means.

    Attributes:
        string: name of the string, or of the bar's joint.
        way: direction, in which the puppet looks along x.
        kind: kind of limb, or ``whole``.
        size: length of the limb, or size of the body [m].
    """

    string: str
    way: str
    kind: SizeKind
    size: float


@dataclass(frozen=True, eq=False)
class Roles:
    """Body map of a puppet or of a scene's member, for gestures.

    Attributes:
        marionette: puppet or scene.
        member: name of the scene's member; empty for a single puppet.
        body_map: its body map.
    """

    marionette: Marionette
    member: str
    body_map: BodyMap

    @classmethod
    def of(cls, marionette: Marionette, member: str = "") -> Roles:
        """Roles of a puppet.

        Raises:
            StateError: it has no body map.
        """
        own = member if marionette.puppet.members else ""
        return cls(marionette, member, marionette.body_map_of(own))

    @property
    def heading(self) -> float:
        """Angle from x to the puppet's forward direction, in the frame of its file [rad]."""
        x, y, _ = self.own_axes(self.body_map.trunk[0]) @ np.array(self.body_map.facing)
        return round(float(np.arctan2(y, x)), _TURN_DIGITS) + 0.0

    def own_axes(self, body: str) -> Array:
        """(3, 3) axes of a body in the pose of its file, as columns in the frame of that file."""
        tree = self.marionette.tree
        poses = measure(tree, self.marionette.number).poses
        frame = tree.links[self.marionette.link_index(self.body_map.trunk[0])].parent
        own = poses[self.marionette.link_index(body), :, :3]
        return own if frame == WORLD else poses[frame, :, :3].T @ own

    @property
    def prefix(self) -> str:
        """Prefix of the names of a scene's member."""
        return f"{self.member}." if self.marionette.puppet.members else ""

    @property
    def on_control(self) -> bool:
        """Whether it hangs from its control on strings that keep their lengths."""
        known = {*self.marionette.coordinates.q_K, *self.marionette.coordinates.q_D}
        winds = any(f"{string}.length" in known for string in self.body_map.carrying)
        return bool(self.body_map.control) and not winds

    @cached_property
    def bars(self) -> dict[str, str]:
        """Bar -> its joint: ``control``, and ``leg_bar`` for the bar of all strings of the legs.

        Other kinds of limbs have such bars, too, unless their strings are tied to the control.
        """
        if not self.body_map.control:
            return {}
        links, index = self.marionette.tree.links, self.marionette.link_index
        bars = {"control": links[index(self.body_map.control)].joint}
        for kind in KINDS:
            limbs = [limb for limb in self.body_map.limbs if limb.kind == kind]
            joints = {self._holding(string) for limb in limbs for string in limb.strings}
            if len(joints) == 1 and not joints & {"", bars["control"]}:
                bars[f"{kind}_bar"] = joints.pop()
        return bars

    def _holding(self, string: str) -> str:
        """Joint of the driven body to which a string is tied; "" if there is none."""
        tree = self.marionette.tree
        (row,) = (row for row in (*tree.strings, *tree.chains) if row.name == string)
        for point in (row.points[0], row.points[-1]):
            for i in tree.ancestors(point.link):
                if tree.links[i].role is Role.DRIVEN:
                    return tree.links[i].joint
        return ""

    def strings(self, *parts: str) -> tuple[str, ...]:
        """Names of the strings that move parts, without the prefix of a scene's member.

        Raises:
            StateError: the puppet lacks a part, or no string moves it.
        """
        names = [move.string for part in parts for move in self.moves(f"{part}.up")]
        return tuple(dict.fromkeys(name.removeprefix(self.prefix) for name in names))

    def moves(self, name: str) -> list[Move]:
        """Strings and directions of a name such as ``arm_right.up``, ``head.left`` or ``legs.out``.

        ``control.tip_forward`` and ``leg_bar.roll_left`` are moves of a bar.

        Raises:
            StateError: the puppet has no such part, or no string moves it.
        """
        part, _, way = name.rpartition(".")
        body = self.body_map
        if part in self.bars:
            lengths = {f"{limb.kind}_bar": (limb.kind, limb.length) for limb in body.limbs}
            return [Move(self.bars[part], way, *lengths.get(part, ("whole", body.size)))]
        parts: list[tuple[str, SizeKind, float, str]] = [
            (own, limb.kind, limb.length, limb.side)
            for own, limb in body.parts.items()
            if part in (own, f"{limb.kind}s")
        ]
        if part in ("trunk", "head"):
            parts = [(part, "whole", body.size, "middle")]
        is_plural = part.removesuffix("s") in KINDS
        if (not parts and not is_plural) or (part == "head" and body.head is None):
            have = ("trunk", *(("head",) if body.head else ()), *body.parts, *self.bars)
            raise StateError(f"it moves {part}; {self._name} has {', '.join(have)}")
        moves = []
        for own, kind, size, side in parts:
            if not (strings := body.strings_of(own)):
                raise StateError(f"it moves {own}, which no string of {self._name} moves")
            turned = self._sideways(way, side)
            moves += [Move(string, turned, kind, size) for string in strings]
        return moves

    @property
    def _name(self) -> str:
        return self.member or self.marionette.name

    def _sideways(self, way: str, side: str) -> str:
        """The direction, with left or right in place of in and out."""
        if way not in ("in", "out"):
            return way
        if side not in ("left", "right"):
            raise StateError(f"it moves a part in the middle {way}; needed: left or right")
        other = {"left": "right", "right": "left"}
        return side if way == "out" else other[side]


def moves_of(roles: Roles, names: Iterable[str]) -> dict[str, tuple[str, Move]]:
    """Strings and directions that names of parts and directions mean.

    Returns:
        String and direction, such as ``hand_right.up`` -> the name, and its move.

    Raises:
        StateError: the puppet lacks a part, or two parts move a string in one direction.
    """
    moves: dict[str, tuple[str, Move]] = {}
    for name in names:
        for move in roles.moves(name):
            key = f"{move.string}.{move.way}"
            if key in moves:
                raise StateError(f"it moves {name} and {moves[key][0]}, which both move {key}")
            moves[key] = name, move
    return moves
