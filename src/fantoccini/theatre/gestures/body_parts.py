"""Parts of a body, such as a hand or the head, and the strings and bars that move them.

A puppet on a control has bars as parts, too: the control, and for each kind of limb the bar to
which all its strings are tied. A gesture moves parts by offsets for a body of certain sizes; for
another body they are multiplied by the ratio of the sizes.

Directions are the puppet's own: forward, to its left and up. Coordinates may have other axes:

    d = (R_h^T R)^T d_own

d_own is an offset or a rotation vector along the puppet's own axes; R_h turns x to the direction in
which the puppet looks in its file, and R are the axes of the coordinate in that file: those of the
joint for an offset, those of the body for a rotation vector.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from fantoccini.base import Array, Indices, StateError, rotation
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import BodyMap
from fantoccini.model.tree import (
    COMMAND,
    WORLD,
    CoordinateTable,
    Role,
    Tree,
    measure,
    point_position,
)
from fantoccini.motion import pieces
from fantoccini.theatre.gestures.joining import Motion

KINDS = ("arm", "leg", "wing", "tail", "neck")
"""Kinds of limbs; a plural means all limbs of the kind, and none if the puppet has none."""
SizeKind: TypeAlias = Literal["whole", "arm", "leg", "wing", "tail", "neck"]
"""Kind of limb, or the whole body, whose size scales offsets of trunk and head."""
TRUNK_ENDS = ("trunk_front", "trunk_hind")
"""Ends of the trunk of an animal, each with the carrying strings that are tied there."""
_MIN_TRUNK_SPAN = 0.1
"""Smallest distance between carrying strings along a trunk with two ends, relative to the size."""
_HEADING_DECIMALS = 9
"""Decimals to which the heading of a puppet is rounded [rad]."""
_AXES = "xyz"
_ROUNDING = 1e-12
"""Smaller entries of a matrix of axes are 0."""
_STRAIGHT = 1e-6
"""Smaller components of an offset need no coordinate, relative to the offset."""
_NOT_DRIVEN = -1


@dataclass(frozen=True)
class Move:
    """Motion of a string or a bar in a direction.

    Attributes:
        string: name of the string, or of the bar's joint.
        way: direction such as ``up``, for a puppet that looks along x.
        kind: kind of limb, or ``whole``.
        size: length of the limb, or size of the body [m].
    """

    string: str
    way: str
    kind: SizeKind
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
    def of(cls, marionette: Marionette, member: str = "") -> BodyParts:
        """Parts of a puppet, or of a scene's member.

        Raises:
            StateError: it has no body map.
        """
        own = member if marionette.puppet.members else ""
        return cls(marionette, member, marionette.body_map_of(own))

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
            raise self.lacks(f"{kind}s")
        return max(lengths)

    def lacks(self, part: str) -> StateError:
        """Error of a gesture that moves a part which the puppet lacks."""
        body = self.body_map
        have = ("trunk", *(("head",) if body.head else ()), *body.parts, *self.bars)
        return StateError(f"it moves {part}; {self._name} has {', '.join(have)}")

    @cached_property
    def trunk_ends(self) -> dict[str, tuple[str, ...]]:
        """Strings that carry the front and the hind part of the trunk; none if it has no length.

        A string is of the front if it is tied before the middle between the first and the last one.
        """
        tree, number = self.marionette.tree, self.marionette.number
        poses = measure(tree, number).poses
        trunk = self.marionette.link_index(self.body_map.trunk[0])
        forward = poses[trunk, :, :3] @ np.array(self.body_map.facing)
        ahead = {
            row.name: float(point_position(poses[None], point, number)[0] @ forward)
            for row in (*tree.strings, *tree.chains)
            for point in (row.points[0], row.points[-1])
            if row.name in self.body_map.carrying and trunk in tree.ancestors(point.link)
        }
        first, last = max(ahead.values(), default=0.0), min(ahead.values(), default=0.0)
        if first - last < _MIN_TRUNK_SPAN * self.body_map.size:
            return dict.fromkeys(TRUNK_ENDS, ())
        middle = 0.5 * (first + last)
        front = tuple(name for name, x in ahead.items() if x > middle)
        hind = tuple(name for name in ahead if name not in front)
        return dict(zip(TRUNK_ENDS, (front, hind), strict=True))

    def moves(self, name: str) -> list[Move]:
        """Strings and directions of a name such as ``arm_right.up``, ``head.left`` or ``legs.out``.

        ``control.tip_forward`` and ``leg_bar.roll_left`` are moves of a bar. Of several limbs
        (``legs``), those without strings stay out.

        Raises:
            StateError: the puppet has no such part, or no string moves it.
        """
        part, _, way = name.rpartition(".")
        body = self.body_map
        if part in self.bars:
            lengths = {f"{limb.kind}_bar": (limb.kind, limb.length) for limb in body.limbs}
            return [Move(self.bars[part], way, *lengths.get(part, ("whole", body.size)))]
        parts: list[tuple[str, SizeKind, float, str]] = [
            (limb_name, limb.kind, limb.length, limb.side)
            for limb_name, limb in body.parts.items()
            if part in (limb_name, f"{limb.kind}s")
        ]
        if part in ("trunk", *TRUNK_ENDS, "head"):
            parts = [(part, "whole", body.size, "middle")]
        is_plural = part.removesuffix("s") in KINDS
        if (not parts and not is_plural) or (part == "head" and body.head is None):
            raise self.lacks(part)
        moves = []
        for part_name, kind, size, side in parts:
            is_end = part_name in TRUNK_ENDS
            strings = self.trunk_ends[part_name] if is_end else body.strings_of(part_name)
            if not (strings or is_plural):
                raise StateError(f"it moves {part_name}, which no string of {self._name} moves")
            direction = self._left_or_right(way, side)
            moves += [Move(string, direction, kind, size) for string in strings]
        return moves

    @property
    def _name(self) -> str:
        return self.member or self.marionette.name

    def _left_or_right(self, way: str, side: str) -> str:
        """The direction, with left or right instead of ``in`` and ``out``."""
        if way not in ("in", "out"):
            return way
        if side not in ("left", "right"):
            raise StateError(f"it moves a part in the middle {way}; needed: left or right")
        other = {"left": "right", "right": "left"}
        return side if way == "out" else other[side]


def moves_of(
    body_parts: BodyParts, names: Iterable[str], scaled_by: Mapping[str, SizeKind] | None = None
) -> dict[str, tuple[str, Move]]:
    """Moves of strings for names of parts and directions, such as ``arm_right.up``.

    Args:
        body_parts: parts of the puppet's body.
        names: parts and directions, such as ``trunk.down``.
        scaled_by: part -> kind of limb whose size scales its moves, in place of its own.

    Returns:
        String and direction, such as ``hand_right.up`` -> the part's name, and the move.

    Raises:
        StateError: the puppet lacks a part, none of the names moves a string, or two parts move a
            string in one direction.
    """
    sizes = {part: (kind, body_parts.size_of(kind)) for part, kind in (scaled_by or {}).items()}
    moves: dict[str, tuple[str, Move]] = {}
    parts: dict[str, None] = {}
    for name in names:
        part = name.rpartition(".")[0]
        parts[part] = None
        for move in body_parts.moves(name):
            key = f"{move.string}.{move.way}"
            if key in moves:
                raise StateError(f"it moves {name} and {moves[key][0]}, which both move {key}")
            kind, size = sizes.get(part, (move.kind, move.size))
            moves[key] = name, replace(move, kind=kind, size=size)
    if not moves:
        raise body_parts.lacks(" and ".join(parts))
    return moves


@dataclass(frozen=True, eq=False)
class _Triple:
    """Three coordinates that are one vector: an offset, or a rotation vector.

    Attributes:
        name: name of the end or body.
        places: (3,) indices in v_K; -1 for a component that is not driven.
        axes: (3, 3) axes of the coordinates in the puppet's own axes, as columns.
    """

    name: str
    places: Indices
    axes: Array


@dataclass(frozen=True, eq=False)
class OwnAxes:
    """Axes of a puppet's driven coordinates in its own axes.

    Attributes:
        coordinates: table of the puppet or scene.
        own: the same table, with axes of joints in the puppet's own axes.
        triples: coordinates whose axes are not the puppet's own.
    """

    coordinates: CoordinateTable
    own: CoordinateTable
    triples: tuple[_Triple, ...]

    @classmethod
    def of(cls, puppet: Marionette, body_parts: Iterable[BodyParts]) -> OwnAxes:
        """Axes of one or several members of a scene, or of a single puppet."""
        table = puppet.coordinates
        triples: list[_Triple] = []
        axes = dict(table.axes)
        for own in body_parts:
            frames = _Frames.of(own)
            triples += frames.triples()
            axes |= frames.joint_axes()
        return cls(table, replace(table, axes=axes), tuple(triples))

    @classmethod
    def moved_by(cls, uses: Iterable[str], puppet: Marionette) -> OwnAxes:
        """Axes of the members whose strings are moved; those without a body map keep theirs."""
        moving = {name.partition(".")[0] for name in uses}
        moving_parts = []
        for member in puppet.puppet.members or ("",):
            if member and member not in moving:
                continue
            try:
                moving_parts.append(BodyParts.of(puppet, member))
            except StateError:
                continue
        return cls.of(puppet, moving_parts)

    def placed(self, motion: Motion) -> Motion:
        """Motion of the puppet, from offsets along its own axes.

        Raises:
            StateError: it moves an end or a body along an axis that is not driven.
        """
        return self._changed(motion, inverse=False)

    def seen(self, motion: Motion) -> Motion:
        """Offsets along the puppet's own axes, of a motion: the inverse of :meth:`placed`.

        Raises:
            StateError: an own axis along which it moves is not driven.
        """
        return self._changed(motion, inverse=True)

    def _changed(self, motion: Motion, *, inverse: bool) -> Motion:
        coef, travel, named = np.array(motion.coef), np.array(motion.travel), motion.named.copy()
        for triple in self.triples:
            matrix = triple.axes if inverse else triple.axes.T
            is_driven = np.asarray(triple.places != _NOT_DRIVEN)
            moved = np.zeros(3, dtype=bool)
            moved[is_driven] = motion.named[triple.places[is_driven]]
            reached = np.asarray(np.abs(matrix[:, moved]))
            if lacking := np.flatnonzero(~is_driven & (reached > _STRAIGHT).any(axis=1)).tolist():
                first, other = _AXES[int(np.argmax(moved))], _AXES[lacking[0]]
                name = triple.name
                raise StateError(f"it moves {name}.{first}, and {name}.{other} is not driven")
            at, own = triple.places[is_driven], matrix[np.ix_(is_driven, is_driven)]
            coef[:, at] = own @ motion.coef[:, at]
            travel[at] = own @ motion.travel[at]
            named[at] = np.any(reached[is_driven] > 0.0, axis=1)
        return Motion(motion.breaks, coef, named, travel)


@dataclass(frozen=True, eq=False)
class _Frames:
    """Axes of the joints of one member.

    Attributes:
        body_parts: parts of the member.
        turn: (3, 3) R_h.
        links: (n_links, 3, 3) axes of links in the member's file, as columns.
        world: (3, 3) axes of the world in that file.
    """

    body_parts: BodyParts
    turn: Array
    links: Array
    world: Array

    @classmethod
    def of(cls, body_parts: BodyParts) -> _Frames:
        turn = rotation.matrix(rotation.exp(np.array([0.0, 0.0, body_parts.heading])))
        return cls(body_parts, turn, *body_parts.axes_in_file())

    def joint(self, name: str, *, first: bool) -> int:
        """Index of the first or last link that a joint, a string's end or a drive moves."""
        joint = name.removesuffix(COMMAND)
        links = [i for i, x in enumerate(self._tree.links) if x.joint == joint]
        return links[0] if first else links[-1]

    def triples(self) -> list[_Triple]:
        """Offsets and rotation vectors along other axes than the puppet's own."""
        table = self.body_parts.marionette.coordinates
        places: dict[str, Indices] = {}
        for name, (_, v) in pieces.channel_names(table).items():
            owner, _, part = name.rpartition(".")
            if name.startswith(self.body_parts.prefix) and owner and part in _AXES:
                own = places.setdefault(owner, np.full(3, _NOT_DRIVEN))
                own[_AXES.index(part)] = v.start
        triples = [_Triple(name, v, self._carrying(name)) for name, v in places.items()]
        for name, (_, first) in table.rotations.items():
            if name.startswith(self.body_parts.prefix):
                owner = name.rpartition(".")[0]
                body = self.links[self.joint(owner, first=False)]
                triples.append(_Triple(owner, np.arange(first, first + 3), self._seen(body)))
        return [triple for triple in triples if not np.array_equal(triple.axes, np.eye(3))]

    def joint_axes(self) -> dict[str, tuple[float, ...]]:
        """Driven joint -> its axis, in the puppet's own axes."""
        axes = {}
        for name, axis in self.body_parts.marionette.coordinates.axes.items():
            if name.startswith(self.body_parts.prefix):
                carrier = self._tree.links[self.joint(name, first=True)].parent
                axes[name] = tuple((self._seen(self._axes(carrier)) @ axis).tolist())
        return axes

    def _carrying(self, owner: str) -> Array:
        """Axes along which a joint or a string's end moves, in the puppet's own axes."""
        link = self._tree.links[self.joint(owner, first=True)]
        return self._seen(self._axes(link.parent) @ link.rotation)

    def _axes(self, link: int) -> Array:
        return self.world if link == WORLD else self.links[link]

    def _seen(self, axes: Array) -> Array:
        """Axes of the file, in the puppet's own axes."""
        own = self.turn.T @ axes
        return np.where(np.abs(own) < _ROUNDING, 0.0, own)

    @property
    def _tree(self) -> Tree:
        return self.body_parts.marionette.tree
