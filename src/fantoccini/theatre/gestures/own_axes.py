"""Axes of driven coordinates, expressed in the puppet's own axes: forward, left and up.

    d = (R_h^T R)^T d_own

d_own is an offset or a rotation vector along the puppet's own axes; R_h turns x to the direction in
which the puppet looks in its file, and R are the axes of the coordinate in that file: those of the
joint for an offset, those of the body for a rotation vector.

If a puppet looks along y, an end of a string that is driven along y alone is driven along its own
x alone. Such own coordinates keep the indices of the file's, but have names of their own.
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

    @property
    def _order(self) -> Indices:
        """(3,) index of the coordinate along each own axis; 0, 1, 2 if all are driven or askew."""
        is_askew = np.any(np.count_nonzero(self.axes, axis=0) != 1)
        if is_askew or np.all(self.places != _NOT_DRIVEN):
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

    def renamed(self) -> _Triple:
        """The triple with :attr:`own_names`, in the order of the own axes."""
        order = self._order
        return replace(self, places=self.places[order], axes=self.axes[:, order])


def _renamed(table: CoordinateTable, names: Mapping[str, str]) -> CoordinateTable:
    """The table with other names of coordinates."""

    def new(given: Iterable[str]) -> tuple[str, ...]:
        return tuple(names.get(name, name) for name in given)

    commands = zip(new(table.commands), new(table.commands.values()), strict=True)
    return replace(
        table,
        rows=tuple(replace(row, name=names.get(row.name, row.name)) for row in table.rows),
        q_K=new(table.q_K),
        v_K=new(table.v_K),
        commands=dict(commands),
    )


@dataclass(frozen=True, eq=False)
class OwnAxes:
    """Axes of a puppet's driven coordinates in its own axes.

    Attributes:
        coordinates: table of the puppet or scene.
        own: the same table, with axes of joints in the puppet's own axes, and with own names for
            ends and bodies whose x, y or z lies along another own axis, unless all are driven.
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
        axes, names = dict(table.axes), dict[str, str]()
        for own in body_parts:
            frames = _Frames.of(own)
            for triple in frames.triples():
                names |= triple.own_names
                triples.append(triple.renamed())
            axes |= frames.joint_axes()
        return cls(table, replace(_renamed(table, names), axes=axes), tuple(triples))

    @classmethod
    def moved_by(cls, uses: Iterable[str], puppet: Marionette) -> OwnAxes:
        """Axes of the members in ``uses``; those without a body map keep the axes of the file."""
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
        """Motion of the driven coordinates, from one along the puppet's own axes.

        Raises:
            StateError: it moves an end or a body along an axis that is not driven.
        """
        return self._changed(motion, inverse=False)

    def seen(self, motion: Motion) -> Motion:
        """Motion along the puppet's own axes, from one of the coordinates; inverts :meth:`placed`.

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
            # Components whose offsets are all 0 need no other coordinate.
            has_offset = moved & np.any(motion.coef[:, triple.places], axis=(0, 2))
            needed = np.asarray(np.abs(matrix[:, has_offset]) > _MIN_COMPONENT).any(axis=1)
            if lacking := np.flatnonzero(~is_driven & needed).tolist():
                first, other = _AXES[int(np.argmax(has_offset))], _AXES[lacking[0]]
                name = triple.name
                raise StateError(f"it moves {name}.{first}, and {name}.{other} is not driven")
            at, own = triple.places[is_driven], matrix[np.ix_(is_driven, is_driven)]
            coef[:, at] = own @ motion.coef[:, at]
            travel[at] = own @ motion.travel[at]
            named[at] = np.any(reached[is_driven] > _ROUNDING, axis=1)
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
            if name in table.axes:  # a joint may have the name x
                continue
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
        whole = np.round(own) + 0.0
        return np.where(np.abs(own - whole) < _ROUNDING, whole, own)

    @property
    def _tree(self) -> Tree:
        return self.body_parts.marionette.tree
