"""Axes of driven coordinates, expressed in the puppet's own axes: forward, left and up.

    d = (R_h^T R)^T d_own

d_own is an offset or a rotation vector along the puppet's own axes; R_h turns x to the direction in
which the puppet looks in its file, and R are the axes of the coordinate in that file: those of the
joint for an offset, those of the body for a rotation vector.

If a puppet looks along y, an end of a string that is driven along y alone is driven along its own
x alone. Such own coordinates keep the indices of the file's, but have names of their own.

A driven coordinate is the end or length of a string, or a driven joint; v_K are their velocities. A
member is a puppet of a scene. Breaks are the times at which the pieces of a motion meet, and `coef`
their coefficients. A link is a body on its joint. A row of the tree describes a string, limit,
spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Indices, StateError, rotation
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import COMMAND, WORLD, CoordinateTable, Tree
from fantoccini.motion import pieces
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.joining import Motion

_AXES = "xyz"
_ROUNDING = 1e-8
"""Tolerance for rounding entries of axis matrices to -1, 0 or 1; the heading is rounded, too."""
_MIN_COMPONENT = 1e-6
"""Component of an offset, relative to the offset, above which its coordinate must be driven."""
_NOT_DRIVEN = -1


@dataclass(frozen=True, eq=False)
class _AxisTriple:
    """Three coordinates that are one vector: an offset, or a rotation vector.

    Attributes:
        name: name of the end or body.
        indices: (3,) indices in v_K; -1 for a component that is not driven.
        axes: (3, 3) axes of the coordinates in the puppet's own axes, as columns.
    """

    name: str
    indices: Indices
    axes: Array

    @property
    def _order(self) -> Indices:
        """(3,) index of the coordinate along each own axis; 0, 1, 2 if all are driven or askew."""
        is_askew = np.any(np.count_nonzero(self.axes, axis=0) != 1)
        if is_askew or np.all(self.indices != _NOT_DRIVEN):
            return np.arange(3)
        return np.argmax(np.abs(self.axes), axis=1)

    @property
    def own_names(self) -> dict[str, str]:
        """Coordinate or its command -> its own name, which ends in the own axis that it lies on."""
        return {
            f"{owner}.{_AXES[j]}": f"{owner}.{_AXES[i]}"
            for owner in (self.name, self.name.removesuffix(COMMAND))
            for i, j in enumerate(self._order.tolist())
            if i != j
        }

    def renamed(self) -> _AxisTriple:
        """The triple with :attr:`own_names`, in the order of the own axes."""
        order = self._order
        return replace(self, indices=self.indices[order], axes=self.axes[:, order])


def _renamed(table: CoordinateTable, names: Mapping[str, str]) -> CoordinateTable:
    """The table with other names of coordinates."""

    def renamed_all(old_names: Iterable[str]) -> tuple[str, ...]:
        return tuple(names.get(name, name) for name in old_names)

    commands = zip(renamed_all(table.commands), renamed_all(table.commands.values()), strict=True)
    return replace(
        table,
        rows=tuple(replace(row, name=names.get(row.name, row.name)) for row in table.rows),
        q_K=renamed_all(table.q_K),
        v_K=renamed_all(table.v_K),
        commands=dict(commands),
    )


@dataclass(frozen=True, eq=False)
class OwnAxes:
    """Axes of a puppet's driven coordinates in its own axes.

    Attributes:
        coordinates: table of the puppet or scene.
        own_table: the same table, with axes of joints in the puppet's own axes, and with own names
            for ends and bodies whose x, y or z lies along another own axis, unless all are driven.
        triples: coordinates whose axes are not the puppet's own.
    """

    coordinates: CoordinateTable
    own_table: CoordinateTable
    triples: tuple[_AxisTriple, ...]

    @classmethod
    def for_members(cls, puppet: Marionette, body_parts: Iterable[BodyParts]) -> OwnAxes:
        """Axes of one or several members of a scene, or of a single puppet."""
        table = puppet.coordinates
        triples: list[_AxisTriple] = []
        axes, names = dict(table.axes), dict[str, str]()
        for member_parts in body_parts:
            frames = _MemberAxes.for_member(member_parts)
            for triple in frames.triples():
                names |= triple.own_names
                triples.append(triple.renamed())
            axes |= frames.joint_axes()
        return cls(table, replace(_renamed(table, names), axes=axes), tuple(triples))

    @classmethod
    def for_names(cls, moved_names: Iterable[str], puppet: Marionette) -> OwnAxes:
        """Axes of the members that move; those without a body map keep the axes of the file."""
        member_names = {name.partition(".")[0] for name in moved_names}
        member_parts = []
        for member in puppet.puppet.members or ("",):
            if member and member not in member_names:
                continue
            try:
                member_parts.append(BodyParts.for_puppet(puppet, member))
            except StateError:
                continue
        return cls.for_members(puppet, member_parts)

    def to_driven(self, motion: Motion) -> Motion:
        """Motion of the driven coordinates, from one along the puppet's own axes.

        Raises:
            StateError: it moves an end or a body along an axis that is not driven.
        """
        return self._transformed(motion, inverse=False)

    def to_own(self, motion: Motion) -> Motion:
        """Motion along the puppet's own axes, from one of the coordinates: inverse of `to_driven`.

        Raises:
            StateError: an own axis along which it moves is not driven.
        """
        return self._transformed(motion, inverse=True)

    def _transformed(self, motion: Motion, *, inverse: bool) -> Motion:
        coef, travel, named = np.array(motion.coef), np.array(motion.travel), motion.named.copy()
        for triple in self.triples:
            matrix = triple.axes if inverse else triple.axes.T
            is_driven = np.asarray(triple.indices != _NOT_DRIVEN)
            moved = np.zeros(3, dtype=bool)
            moved[is_driven] = motion.named[triple.indices[is_driven]]
            reached_axes = np.asarray(np.abs(matrix[:, moved]))
            # Components whose offsets are all 0 need no other coordinate.
            has_offset = moved & np.any(motion.coef[:, triple.indices], axis=(0, 2))
            needed = np.asarray(np.abs(matrix[:, has_offset]) > _MIN_COMPONENT).any(axis=1)
            if lacking := np.flatnonzero(~is_driven & needed).tolist():
                moved_axis, lacking_axis = _AXES[int(np.argmax(has_offset))], _AXES[lacking[0]]
                name = triple.name
                raise StateError(
                    f"it moves {name}.{moved_axis}, and {name}.{lacking_axis} is not driven"
                )
            driven_indices, driven_matrix = (
                triple.indices[is_driven],
                matrix[np.ix_(is_driven, is_driven)],
            )
            coef[:, driven_indices] = driven_matrix @ motion.coef[:, driven_indices]
            travel[driven_indices] = driven_matrix @ motion.travel[driven_indices]
            named[driven_indices] = np.any(reached_axes[is_driven] > _ROUNDING, axis=1)
        return Motion(motion.breaks, coef, named, travel)


@dataclass(frozen=True, eq=False)
class _MemberAxes:
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
    def for_member(cls, body_parts: BodyParts) -> _MemberAxes:
        turn = rotation.matrix(rotation.exp(np.array([0.0, 0.0, body_parts.heading])))
        return cls(body_parts, turn, *body_parts.axes_in_file())

    def joint(self, name: str, *, first: bool) -> int:
        """Index of the first or last link that a joint, a string's end or a drive moves."""
        joint_name = name.removesuffix(COMMAND)
        links = [i for i, link in enumerate(self._tree.links) if link.joint == joint_name]
        return links[0] if first else links[-1]

    def triples(self) -> list[_AxisTriple]:
        """Offsets and rotation vectors along other axes than the puppet's own."""
        table = self.body_parts.marionette.coordinates
        indices: dict[str, Indices] = {}
        for name, (_, v) in pieces.channel_names(table).items():
            owner, _, part = name.rpartition(".")
            if name in table.axes:  # a joint may have the name x
                continue
            if name.startswith(self.body_parts.prefix) and owner and part in _AXES:
                axis_indices = indices.setdefault(owner, np.full(3, _NOT_DRIVEN))
                axis_indices[_AXES.index(part)] = v.start
        triples = [_AxisTriple(name, v, self._end_axes(name)) for name, v in indices.items()]
        for name, (_, start) in table.rotations.items():
            if name.startswith(self.body_parts.prefix):
                owner = name.rpartition(".")[0]
                body = self.links[self.joint(owner, first=False)]
                triples.append(
                    _AxisTriple(owner, np.arange(start, start + 3), self._in_own_axes(body))
                )
        return [triple for triple in triples if not np.array_equal(triple.axes, np.eye(3))]

    def joint_axes(self) -> dict[str, tuple[float, ...]]:
        """Driven joint -> its axis, in the puppet's own axes."""
        axes = {}
        for name, axis in self.body_parts.marionette.coordinates.axes.items():
            if name.startswith(self.body_parts.prefix):
                carrier = self._tree.links[self.joint(name, first=True)].parent
                axes[name] = tuple((self._in_own_axes(self._link_axes(carrier)) @ axis).tolist())
        return axes

    def _end_axes(self, owner: str) -> Array:
        """Axes along which a joint or a string's end moves, in the puppet's own axes."""
        link = self._tree.links[self.joint(owner, first=True)]
        return self._in_own_axes(self._link_axes(link.parent) @ link.rotation)

    def _link_axes(self, link: int) -> Array:
        return self.world if link == WORLD else self.links[link]

    def _in_own_axes(self, axes: Array) -> Array:
        """Axes of the file, in the puppet's own axes."""
        own_axes = self.turn.T @ axes
        rounded = np.round(own_axes) + 0.0
        return np.where(np.abs(own_axes - rounded) < _ROUNDING, rounded, own_axes)

    @property
    def _tree(self) -> Tree:
        return self.body_parts.marionette.tree
