"""Axes of driven coordinates, as the puppet sees them: forward, to its left and up.

    d = (R_h^T R)^T d_own

d_own is an offset of an end or a body, or a rotation vector, along a puppet's own axes; R_h turns x
to the direction in which the puppet looks in its file, and R are the axes of the coordinate in that
file: those of the joint for an offset, those of the body for a rotation vector.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array, Indices, StateError, rotation
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import COMMAND, WORLD, CoordinateTable, Tree
from fantoccini.motion import pieces
from fantoccini.theatre.gestures.roles import Roles

if TYPE_CHECKING:
    from fantoccini.theatre.gestures.gesture import Gesture

_AXES = "xyz"
_ROUNDING = 1e-12
"""Smaller entries of a matrix of axes are 0."""
_STRAIGHT = 1e-6
"""Smaller components of an offset need no coordinate, relative to the offset."""
_NOT_DRIVEN = -1


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
    def of(cls, puppet: Marionette, roles: Iterable[Roles]) -> OwnAxes:
        """Axes of one or several members of a scene, or of a single puppet."""
        table = puppet.coordinates
        triples: list[_Triple] = []
        axes = dict(table.axes)
        for own in roles:
            frames = _Frames.of(own)
            triples += frames.triples()
            axes |= frames.joint_axes()
        return cls(table, replace(table, axes=axes), tuple(triples))

    @classmethod
    def moved_by(cls, gesture: Gesture, puppet: Marionette) -> OwnAxes:
        """Axes of the members that a gesture moves; those of a puppet without a body map stay."""
        moving = {name.partition(".")[0] for name in gesture.uses}
        roles = []
        for member in puppet.puppet.members or ("",):
            if member and member not in moving:
                continue
            try:
                roles.append(Roles.of(puppet, member))
            except StateError:
                continue
        return cls.of(puppet, roles)

    def placed(self, gesture: Gesture) -> Gesture:
        """Gesture of the puppet, from offsets along its own axes.

        Raises:
            StateError: it moves an end or a body along an axis that is not driven.
        """
        return self._changed(gesture, self.coordinates, inverse=False)

    def seen(self, gesture: Gesture) -> Gesture:
        """Offsets along the puppet's own axes, of a gesture: the inverse of :meth:`placed`.

        Raises:
            StateError: an own axis along which it moves is not driven.
        """
        return self._changed(gesture, self.own, inverse=True)

    def _changed(self, gesture: Gesture, table: CoordinateTable, *, inverse: bool) -> Gesture:
        coef, travel, named = np.array(gesture.coef), np.array(gesture.travel), gesture.named.copy()
        for triple in self.triples:
            matrix = triple.axes if inverse else triple.axes.T
            is_driven = triple.places != _NOT_DRIVEN
            moved = np.zeros(3, dtype=bool)
            moved[is_driven] = gesture.named[triple.places[is_driven]]
            reached = np.abs(matrix[:, moved])
            if lacking := np.flatnonzero(~is_driven & (reached > _STRAIGHT).any(axis=1)).tolist():
                first, other = _AXES[int(np.argmax(moved))], _AXES[lacking[0]]
                name = triple.name
                raise StateError(f"it moves {name}.{first}, and {name}.{other} is not driven")
            at, own = triple.places[is_driven], matrix[np.ix_(is_driven, is_driven)]
            coef[:, at] = own @ gesture.coef[:, at]
            travel[at], named[at] = own @ gesture.travel[at], (reached > 0.0).any(axis=1)[is_driven]
        return replace(gesture, coordinates=table, coef=coef, travel=travel, named=named)


@dataclass(frozen=True, eq=False)
class _Frames:
    """Axes of the joints of one member.

    Attributes:
        roles: parts of the member.
        turn: (3, 3) R_h.
        links: (n_links, 3, 3) axes of links in the member's file, as columns.
        world: (3, 3) axes of the world in that file.
    """

    roles: Roles
    turn: Array
    links: Array
    world: Array

    @classmethod
    def of(cls, roles: Roles) -> _Frames:
        turn = rotation.matrix(rotation.exp(np.array([0.0, 0.0, roles.heading])))
        return cls(roles, turn, *roles.axes_in_file())

    def joint(self, name: str, *, first: bool) -> int:
        """Index of the first or last link that a joint, a string's end or a drive moves."""
        joint = name.removesuffix(COMMAND)
        links = [i for i, x in enumerate(self._tree.links) if x.joint == joint]
        return links[0] if first else links[-1]

    def triples(self) -> list[_Triple]:
        """Offsets and rotation vectors along other axes than the puppet's own."""
        table = self.roles.marionette.coordinates
        places: dict[str, Indices] = {}
        for name, (_, v) in pieces.channel_names(table).items():
            owner, _, part = name.rpartition(".")
            if name.startswith(self.roles.prefix) and owner and part in _AXES:
                own = places.setdefault(owner, np.full(3, _NOT_DRIVEN))
                own[_AXES.index(part)] = v.start
        triples = [_Triple(name, v, self._carrying(name)) for name, v in places.items()]
        for name, (_, v) in table.rotations.items():
            if name.startswith(self.roles.prefix):
                owner = name.rpartition(".")[0]
                body = self.links[self.joint(owner, first=False)]
                triples.append(_Triple(owner, np.arange(v, v + 3), self._seen(body)))
        return [triple for triple in triples if not np.array_equal(triple.axes, np.eye(3))]

    def joint_axes(self) -> dict[str, tuple[float, ...]]:
        """Driven joint -> its axis, in the puppet's own axes."""
        axes = {}
        for name, axis in self.roles.marionette.coordinates.axes.items():
            if name.startswith(self.roles.prefix):
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
        return self.roles.marionette.tree
