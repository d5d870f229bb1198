"""Clearance: distances of a puppet from obstacles and from itself.

q_D and q_K are the dynamic and driven coordinates of the puppet, here of many configurations at
once. A marionette is a puppet with its compiled equations; `marionette.puppet` is the description
in its file. A member is a puppet of a scene. A link is a body on its joint.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, StateError
from fantoccini.dynamics.clearance import solids
from fantoccini.dynamics.clearance.between import Places, advance
from fantoccini.dynamics.clearance.meshes import Meshes
from fantoccini.dynamics.clearance.obstacles import HalfSpace, standing
from fantoccini.dynamics.clearance.path import Path
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import Moves, Solids, default_threads, moved_by
from fantoccini.model.puppet import Obstacle
from fantoccini.model.tree import Role, Tree
from fantoccini.motion import State, Trajectory

_MAX_TOUCHING_DISTANCE = 1e-6
"""Overlap or, along paths, distance up to which solids touch [m]."""
_REL_ACCURACY = 0.01
"""Largest relative error of the least distance along a path."""
_MAX_SHORTFALL = 1e-4
"""Largest undetected shortfall of a distance below a limit between samples [m]."""


@dataclass(frozen=True)
class Nearest:
    """The nearest pair of solids.

    Attributes:
        first, second: names of a body, an obstacle or a string.
        distance: distance between them [m]; negative where they overlap.
    """

    first: str
    second: str
    distance: float

    def __str__(self) -> str:
        if -_MAX_TOUCHING_DISTANCE < self.distance < 0.0:  # thin solids have no depth
            return f"{self.first} meets {self.second}"
        if self.distance < 0.0:
            return f"{self.first} is {-self.distance:.3g} m inside {self.second}"
        return f"{self.first} is {self.distance:.3g} m from {self.second}"


@dataclass(frozen=True)
class LeastDistance:
    """The least distance on a path, with its time and configuration.

    Attributes:
        distance: least distance [m]; negative where solids overlap or pass one another.
        t: its time [s].
        q_D, q_K: (n_qD,), (n_qK,) its configuration.
    """

    distance: float
    t: float
    q_D: Array
    q_K: Array


class Clearance:
    """Distances of a puppet's bodies and strings from obstacles, for many configurations at once.

        d = min over pairs of (distance of their cores - radii)

    Cores are points, segments, boxes and meshes. Distances between them are exact, but an ellipsoid
    counts as the capsule around it (see :mod:`fantoccini.dynamics.clearance.solids`). A negative d
    means an overlap, and is not its depth. Closed meshes are solid, open ones are surfaces (see
    :class:`fantoccini.dynamics.clearance.meshes.Meshes`).

    Attributes:
        marionette: the puppet.
        obstacles: all obstacles, including those of the world and its floor.
        solids: measured solids and pairs, for the compiled library.
        meshes: the meshes among the solids.

    Args:
        marionette: the puppet.
        obstacles: additional obstacles; a mapping has the keys of a puppet file.
        strings: whether to measure strings against obstacles: straight from point to point, or
            along a hanging curve when slack. They may lie on half-spaces.
        string_radius: half the thickness of strings [m].
        self_collision: whether to measure distances between bodies of one puppet that no joint
            connects. Those between different puppets and props are always measured.
        free: pairs of names of bodies or obstacles that may touch and are not measured.

    Raises:
        FileError: an obstacle is invalid.
        ValueError: ``string_radius`` is not a finite number of at least 0.
    """

    def __init__(
        self,
        marionette: Marionette,
        obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
        *,
        strings: bool = True,
        string_radius: float = 0.0,
        self_collision: bool = False,
        free: Collection[frozenset[str]] = (),
    ):
        if not 0.0 <= string_radius < np.inf:
            raise ValueError(f"string_radius is {string_radius}; it must be a number >= 0 [m]")
        self.marionette = marionette
        self.obstacles = standing(marionette.puppet, obstacles)
        tree = marionette.tree
        self.meshes = Meshes()
        moving_solids, self._links = solids.moving(tree, self.meshes)
        standing_solids = solids.standing(self.obstacles, self.meshes)
        pairs = solids.separable_pairs(tree, self._links)
        if not self_collision:
            members = np.array(
                [marionette.puppet.member_of(tree.links[i].name) for i in self._links]
            )
            pairs = pairs[members[pairs[:, 0]] != members[pairs[:, 1]]]
        names = [tree.links[i].name for i in self._links]
        is_measured = [frozenset((names[a], names[b])) not in free for a, b in pairs]
        pairs = pairs[np.array(is_measured, dtype=bool)]
        left_out_rows = [[frozenset((a, o.name)) in free for o in self.obstacles] for a in names]
        is_left_out = np.array(left_out_rows, dtype=bool).reshape(len(names), len(self.obstacles))
        # A rail that stands on the floor is no collision: nothing moves either.
        is_left_out[[not _can_move(tree, i) for i in self._links]] = True
        string_radius_or_none = string_radius if strings and len(standing_solids) else -1.0
        exact = self.meshes.distance if len(self.meshes) else None
        radii = np.full(len(tree.strings), string_radius_or_none)
        self.solids = Solids(
            moving_solids, standing_solids, pairs, is_left_out, radii, *moved_by(tree), exact
        )

    @property
    def measures_nothing(self) -> bool:
        """Whether there is no pair to measure."""
        strings = int(np.sum(self.solids.string_radius >= 0.0))
        n_obstacle_pairs = len(self.solids.standing) * strings + int(np.sum(~self.solids.left_out))
        return not n_obstacle_pairs and not len(self.solids.pairs)

    def parts(self) -> dict[str, Clearance]:
        """Clearance of every body and string, by name; the puppet's clearance is their minimum.

        Pairs of bodies are measured with the second one. Parts without pairs are omitted.
        """
        all_solids, solids_by_name = self.solids, {}
        names = [self.marionette.tree.links[i].name for i in self._links]
        no_radii = np.full_like(all_solids.string_radius, -1.0)
        for name in dict.fromkeys(names):
            is_own = np.array([link_name == name for link_name in names])
            solids_by_name[name] = replace(
                all_solids,
                pairs=all_solids.pairs[is_own[all_solids.pairs[:, 0]]],
                left_out=all_solids.left_out | ~is_own[:, None],
                string_radius=no_radii,
            )
        for i, string in enumerate(self.marionette.tree.strings):
            radius = np.where(np.arange(len(no_radii)) == i, all_solids.string_radius, -1.0)
            solids_by_name[f"string {string.name}"] = replace(
                all_solids,
                pairs=all_solids.pairs[:0],
                left_out=np.ones_like(all_solids.left_out),
                string_radius=radius,
            )
        parts = {}
        for name, part_solids in solids_by_name.items():
            parts[name] = copy(self)
            parts[name].solids = part_solids
        return {
            name: clearance for name, clearance in parts.items() if not clearance.measures_nothing
        }

    def at(self, q_D: Array, q_K: Array, threads: int = 1) -> Array:
        """Clearances of configurations.

        Args:
            q_D, q_K: (..., n_qD) dynamic and (..., n_qK) driven (kinematic) configurations.
            threads: number of threads for large batches.

        Returns:
            Clearances (...) [m]; infinite without pairs, nan for configurations with nan.

        Raises:
            ValueError: the last axis of an array does not fit the puppet.
        """
        return self._measured(q_D, q_K, threads)[0]

    def of(self, motion: State | Trajectory | Sequence[State]) -> Array:
        """Clearance of a state, or of every sample of a trajectory or state of a sequence.

        Returns:
            () or (T,) clearances [m].
        """
        return self.at(*_configurations(motion), threads=default_threads())

    def least(self, motion: Trajectory | Path) -> LeastDistance:
        """The least distance along a motion, also between its samples.

        The error is at most 1 %. Solids nearer than a micrometre count as touching.
        """
        path = motion if isinstance(motion, Path) else Path.from_run(self.marionette, motion)
        minimum = LeastDistance(np.inf, float(path.t[0]), path.q_D[0], path.q_K[0])

        def criterion(places: Places, distance: Array, lower_bound: Array) -> Indices:
            nonlocal minimum
            k = int(np.argmin(np.nan_to_num(distance, nan=np.inf)))
            if distance[k] < minimum.distance:
                minimum = LeastDistance(
                    float(distance[k]), float(places.t[k]), places.q_D[k], places.q_K[k]
                )
            # Depths of overlaps are not refined: any overlap is a collision.
            tolerance = max(_REL_ACCURACY * minimum.distance, _MAX_TOUCHING_DISTANCE)
            return np.flatnonzero(
                (minimum.distance >= 0.0) & (lower_bound < minimum.distance - tolerance)
            )

        advance(path, self.bounded, criterion)
        if 0.0 <= minimum.distance < _MAX_TOUCHING_DISTANCE:
            minimum = replace(minimum, distance=minimum.distance - _MAX_TOUCHING_DISTANCE)
        return minimum

    def distances_along(self, path: Path, max_distance: float) -> tuple[Places, Array]:
        """Distances at the samples of a path, and between them where they are less than a limit.

        Args:
            path: path of the puppet.
            max_distance: limit [m]; shortfalls of up to 0.1 mm may remain undetected.

        Returns:
            The places (m,) in order of time, and the distances there (m,) [m].
        """
        measured = list[tuple[Places, Array]]()

        def criterion(at: Places, distance: Array, lower_bound: Array) -> Indices:
            selected = (distance < max_distance) | (at.s == 0.0)
            measured.append((at.subset(selected), distance[selected]))
            is_beyond = distance >= max_distance
            return np.flatnonzero(
                is_beyond & (lower_bound < np.minimum(max_distance, distance - _MAX_SHORTFALL))
            )

        advance(path, self.bounded, criterion)
        at = Places(*map(np.concatenate, zip(*(places for places, _ in measured), strict=True)))
        order = np.argsort(at.t, kind="stable")
        distance = np.concatenate([distance for _, distance in measured])
        return at.subset(order), distance[order]

    def nearest(self, motion: State | Trajectory | Sequence[State]) -> Nearest | None:
        """The nearest pair in the worst configuration; for runs, also between samples.

        None without pairs.
        """
        if self.measures_nothing:
            return None
        if isinstance(motion, Trajectory):
            minimum = self.least(motion)
            return replace(self.pair_at(minimum.q_D, minimum.q_K), distance=minimum.distance)
        q_D, q_K = (np.atleast_2d(q) for q in _configurations(motion))
        distance, _, pair = self._measured(q_D, q_K, 1)
        if not np.any(pair >= 0):
            return None
        nearest_configuration = int(np.nanargmin(distance))
        return self.pair_at(q_D[nearest_configuration], q_K[nearest_configuration])

    def pair_at(self, q_D: Array, q_K: Array) -> Nearest:
        """The nearest pair in a configuration (n_qD,), (n_qK,).

        Raises:
            ValueError: there are no pairs, or the arrays do not fit the puppet.
        """
        distance, _, pair = self._measured(q_D, q_K, 1)
        if pair < 0:
            raise ValueError("no pair is measured")
        return Nearest(*self._pair_names(int(pair)), float(distance))

    def bounded(self, q_D: Array, q_K: Array, moves: Moves) -> tuple[Array, Array]:
        """Distances at configurations, and lower bounds of the distances on moves about them."""
        return self._measured(q_D, q_K, default_threads(), moves)[:2]

    def _measured(
        self, q_D: Array, q_K: Array, threads: int, moves: Moves | None = None
    ) -> tuple[Array, Array, np.ndarray]:
        q_D, q_K = np.asarray(q_D, dtype=float), np.asarray(q_K, dtype=float)
        table = self.marionette.coordinates
        if (q_D.shape[-1:], q_K.shape[-1:]) != ((table.n_qD,), (table.n_qK,)):
            raise StateError(
                f"q_D and q_K have the shapes {q_D.shape} and {q_K.shape}; they must end in "
                f"{table.n_qD} and {table.n_qK}"
            )
        shape = np.broadcast_shapes(q_D.shape[:-1], q_K.shape[:-1])
        if self.measures_nothing or 0 in shape:
            return np.full(shape, np.inf), np.full(shape, np.inf), np.full(shape, -1)
        n = int(np.prod(shape))
        q_D, q_K = (
            np.broadcast_to(a, (*shape, a.shape[-1])).reshape(n, a.shape[-1]) for a in (q_D, q_K)
        )
        distance, lower_bound, pair = self.marionette.libraries.clearances.measure(
            self.solids, q_D, q_K, self.marionette.p, threads, moves
        )
        finite = np.isfinite(q_D).all(axis=1) & np.isfinite(q_K).all(axis=1)
        distance, lower_bound = (
            np.where(finite, x, np.nan).reshape(shape) for x in (distance, lower_bound)
        )
        return distance, lower_bound, pair.reshape(shape)

    def _pair_names(self, pair: int) -> tuple[str, str]:
        """Names of the two solids of a pair."""
        tree, obstacle_names = self.marionette.tree, [o.name for o in self.obstacles]
        body_names = [tree.links[i].name for i in self._links]
        if pair < len(body_names) * len(obstacle_names):
            return body_names[pair // len(obstacle_names)], obstacle_names[
                pair % len(obstacle_names)
            ]
        pair -= len(body_names) * len(obstacle_names)
        if pair < len(self.solids.pairs):
            a, b = self.solids.pairs[pair]
            return body_names[a], body_names[b]
        pair -= len(self.solids.pairs)
        segments = [f"string {s.name}" for s in tree.strings for _ in s.points[1:]]
        return segments[pair // len(obstacle_names)], obstacle_names[pair % len(obstacle_names)]


def _configurations(motion: State | Trajectory | Sequence[State]) -> tuple[Array, Array]:
    if isinstance(motion, (State, Trajectory)):
        return motion.q_D, motion.q_K
    if not len(motion):
        raise ValueError("no states; give at least one")
    return np.array([x.q_D for x in motion]), np.array([x.q_K for x in motion])


def _can_move(tree: Tree, link: int) -> bool:
    """Whether any coordinate moves a link."""
    return any(tree.links[i].role is not Role.FIXED for i in tree.ancestors(link))
