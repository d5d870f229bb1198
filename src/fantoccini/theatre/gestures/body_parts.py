"""Parts of a body, such as a hand or the head, and the strings and bars that move them.

A puppet on a control has bars as parts, too: the control, and for each kind of limb the bar to
which all its strings are tied. A gesture moves parts by offsets for a body of certain sizes; for
another body they are multiplied by the ratio of the sizes.

A body map says which bodies and strings are trunk, head and limbs. A bar is a body that the hand
holds and to which strings are tied. A member is a puppet of a scene. A marionette is a puppet with
its compiled equations; `marionette.puppet` is the description in its file. In names, D stands for
dynamic coordinates, which move by the equations of motion, and K for driven ones: ends and lengths
of strings, driven joints. A link is a body on its joint.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import BodyMap
from fantoccini.model.tree import WORLD, Role, measure, point_position

KINDS = ("arm", "leg", "wing", "tail", "neck")
"""Kinds of limbs; a plural means all limbs of the kind, and none if the puppet has none."""
_PLURAL_KINDS = tuple(f"{kind}s" for kind in KINDS)
SizeKind: TypeAlias = Literal["whole", "arm", "leg", "wing", "tail", "neck"]
"""Kind of limb, or the whole body, whose size scales offsets of trunk and head."""
TRUNK_ENDS = ("trunk_front", "trunk_hind")
"""Ends of the trunk of an animal, each with the carrying strings that are tied there."""
_MIN_TRUNK_SPAN = 0.1
"""Minimum span of the carrying strings along a trunk with two ends, relative to the size."""
_HEADING_DECIMALS = 9
"""Decimals to which the heading of a puppet is rounded [rad]."""
_SAME_POSITION_TOLERANCE = 1e-9
"""Tolerance of places along a trunk, relative to the size."""


@dataclass(frozen=True)
class Move:
    """Motion of a string or a bar in a direction.

    Attributes:
        string: name of the string, or of the bar's joint.
        direction: such as ``up``, for a puppet that looks along x.
        size_kind: kind of limb, or ``whole``, whose size scales the motion.
        size: length of the limb, or size of the body [m].
    """

    string: str
    direction: str
    size_kind: SizeKind
    size: float


@dataclass(frozen=True, eq=False)
class BodyParts:
    """Puppet or scene's member with its body map, for gestures.

    Attributes:
        marionette: puppet or scene.
        member: name of the scene's member; empty for a single puppet.
        body_map: its body map.
    """

    marionette: Marionette
    member: str
    body_map: BodyMap

    @classmethod
    def for_puppet(cls, marionette: Marionette, member: str = "") -> BodyParts:
        """Parts of a puppet, or of a scene's member.

        Raises:
            StateError: it has no body map.
        """
        member_with_map = member if marionette.puppet.members else ""
        return cls(marionette, member, marionette.body_map_of(member_with_map))

    @property
    def heading(self) -> float:
        """Angle from x to the puppet's forward direction, in the frame of its file [rad]."""
        x, y, _ = self.own_axes(self.body_map.trunk[0]) @ np.array(self.body_map.facing)
        return round(float(np.arctan2(y, x)), _HEADING_DECIMALS) + 0.0

    def own_axes(self, body: str) -> Array:
        """(3, 3) axes of a body in the pose of its file, as columns in the frame of that file."""
        return self.axes_in_file()[0][self.marionette.link_index(body)]

    def axes_in_file(self) -> tuple[Array, Array]:
        """(n_links, 3, 3) axes of all links, and (3, 3) axes of the world; see :meth:`own_axes`."""
        tree = self.marionette.tree
        axes: Array = measure(tree, self.marionette.number).poses[:, :, :3]
        frame = tree.links[self.marionette.link_index(self.body_map.trunk[0])].parent
        return (axes, np.eye(3)) if frame == WORLD else (axes[frame].T @ axes, axes[frame].T)

    @property
    def prefix(self) -> str:
        """Prefix of the names of a scene's member."""
        return f"{self.member}." if self.marionette.puppet.members else ""

    @property
    def on_control(self) -> bool:
        """Whether it hangs from its control on strings of fixed lengths."""
        names = {*self.marionette.coordinates.q_K, *self.marionette.coordinates.q_D}
        has_winches = any(f"{string}.length" in names for string in self.body_map.carrying)
        return bool(self.body_map.control) and not has_winches

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
            joints = {self._driven_joint(string) for limb in limbs for string in limb.strings}
            if len(joints) == 1 and not joints & {"", bars["control"]}:
                bars[f"{kind}_bar"] = joints.pop()
        return bars

    def _driven_joint(self, string: str) -> str:
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

    def size_of(self, kind: SizeKind) -> float:
        """Length of the longest limb of a kind, or size of the whole body [m].

        Raises:
            StateError: the puppet has no such limb.
        """
        if kind == "whole":
            return self.body_map.size
        lengths = [limb.length for limb in self.body_map.limbs if limb.kind == kind]
        if not lengths:
            raise StateError(f"the size of a {kind} scales its moves; {self._parts_text}")
        return max(lengths)

    def missing_parts_error(self, parts: Collection[str]) -> StateError:
        """Error of a gesture that moves only parts which the puppet lacks, or no string moves."""
        kinds = {limb.kind for limb in self.body_map.limbs}
        if unmoved_parts := [part for part in parts if part.removesuffix("s") in kinds]:
            return self._no_string_error(" and ".join(unmoved_parts))
        return StateError(f"it moves {' and '.join(parts)}; {self._parts_text}")

    def _no_string_error(self, part: str) -> StateError:
        return StateError(f"it moves {part}, which no string of {self._name} moves")

    @property
    def _parts_text(self) -> str:
        """Parts of the puppet, for messages."""
        head = ("head",) if self.body_map.head else ()
        ends = (end for end, strings in self.trunk_ends.items() if strings)
        part_names = ("trunk", *ends, *head, *self.body_map.parts, *self.bars)
        return f"{self._name} has {', '.join(part_names)}"

    @cached_property
    def trunk_ends(self) -> dict[str, tuple[str, ...]]:
        """Strings that carry the front and the hind part of the trunk; none if it has no length.

        A string belongs to the front if tied ahead of the middle between the first and the last;
        one tied in the middle belongs to the hind part.
        """
        tree, number = self.marionette.tree, self.marionette.number
        poses = measure(tree, number).poses
        trunk = self.marionette.link_index(self.body_map.trunk[0])
        forward = poses[trunk, :, :3] @ np.array(self.body_map.facing)
        positions = {
            row.name: float(point_position(poses[None], point, number)[0] @ forward)
            for row in (*tree.strings, *tree.chains)
            for point in (row.points[0], row.points[-1])
            if row.name in self.body_map.carrying and trunk in tree.ancestors(point.link)
        }
        first, last = max(positions.values(), default=0.0), min(positions.values(), default=0.0)
        if first - last < _MIN_TRUNK_SPAN * self.body_map.size:
            return dict.fromkeys(TRUNK_ENDS, ())
        middle = 0.5 * (first + last) + _SAME_POSITION_TOLERANCE * self.body_map.size
        front = tuple(name for name, position in positions.items() if position > middle)
        hind = tuple(name for name in positions if name not in front)
        return dict(zip(TRUNK_ENDS, (front, hind), strict=True))

    def moves(self, name: str) -> list[Move]:
        """Strings and directions of a name such as ``arm_right.up``, ``head.left`` or ``legs.out``.

        ``control.tip_forward`` and ``leg_bar.roll_left`` are moves of a bar. Of several limbs
        (``legs``), those without strings stay out.

        Raises:
            StateError: the puppet has no such part, or no string moves it.
        """
        part, _, direction = name.rpartition(".")
        body = self.body_map
        if part in self.bars:
            lengths = {f"{limb.kind}_bar": (limb.kind, limb.length) for limb in body.limbs}
            return [Move(self.bars[part], direction, *lengths.get(part, ("whole", body.size)))]
        parts: list[tuple[str, SizeKind, float, str]] = [
            (limb_name, limb.kind, limb.length, limb.side)
            for limb_name, limb in body.parts.items()
            if part in (limb_name, f"{limb.kind}s")
        ]
        if part in ("trunk", *TRUNK_ENDS, "head"):
            parts = [(part, "whole", body.size, "middle")]
        is_plural = part in _PLURAL_KINDS
        if (not parts and not is_plural) or (part == "head" and body.head is None):
            raise self.missing_parts_error([part])
        moves = []
        for part_name, kind, size, side in parts:
            is_end = part_name in TRUNK_ENDS
            strings = self.trunk_ends[part_name] if is_end else body.strings_of(part_name)
            if not (strings or is_plural):
                raise self._no_string_error(part_name)
            string_direction = self._without_in_and_out(direction, side)
            moves += [Move(string, string_direction, kind, size) for string in strings]
        return moves

    @property
    def _name(self) -> str:
        return self.member or self.marionette.name

    def _without_in_and_out(self, direction: str, side: str) -> str:
        """The direction, with left or right instead of ``in`` and ``out``."""
        if direction not in ("in", "out"):
            return direction
        if side not in ("left", "right"):
            raise StateError(f"it moves a part in the middle {direction}; needed: left or right")
        opposite_side = {"left": "right", "right": "left"}
        return side if direction == "out" else opposite_side[side]


def string_moves(
    body_parts: BodyParts,
    names: Iterable[str],
    scaled_by: Mapping[str, SizeKind] | None = None,
    zero_names: Collection[str] = (),
) -> dict[str, tuple[str, Move]]:
    """Moves of strings for names of parts and directions, such as ``arm_right.up``.

    Args:
        body_parts: parts of the puppet's body.
        names: parts and directions, such as ``trunk.down``.
        scaled_by: part -> kind of limb whose size scales its moves, in place of its own.
        zero_names: names whose offsets are all 0; their ``out`` and ``in`` are read as ``left``, so
            that they also work for parts in the middle.

    Returns:
        String and direction, such as ``hand_right.up`` -> the part's name, and the move.

    Raises:
        StateError: the puppet lacks a part, or a limb whose size is needed; none of the names
            moves a string; or two parts move a string in one direction.
    """
    moves: dict[str, tuple[str, Move]] = {}
    parts: dict[str, None] = {}
    for name in names:
        part, _, direction = name.rpartition(".")
        parts[part] = None
        is_sideways = name in zero_names and direction in ("in", "out")
        for move in body_parts.moves(f"{part}.left" if is_sideways else name):
            key = f"{move.string}.{move.direction}"
            if key in moves:
                raise StateError(f"it moves {name} and {moves[key][0]}, which both move {key}")
            size_kind = (scaled_by or {}).get(part)
            scaled_move = (
                replace(move, size_kind=size_kind, size=body_parts.size_of(size_kind))
                if size_kind
                else move
            )
            moves[key] = name, scaled_move
    if not moves:
        raise body_parts.missing_parts_error([*parts])
    return moves
