"""Cores of strings and bodies along a motion, and distances between them.

A core is the segment, box or ellipsoid that stands for a piece of a string or for a solid; a slack
string sags below its chord, the straight line between its ends. q_D and q_K are the dynamic and
driven coordinates. A link is a body on its joint.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fantoccini.base import Array, Indices, Vec3
from fantoccini.dynamics.clearance.path import MIN_SLACK
from fantoccini.dynamics.clearance.segments import (
    N_CHORDS,
    distance_bound_from_ellipsoid,
    distance_from_box,
    dot,
    segment_distance,
    slack_curves,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import Records

_MIN_SAG = 1e-5
"""Largest distance of a curve from its chord for a string to count as straight [m]."""

_CHUNK_SIZE = 10_000
"""Number of pairs measured at once, so that their arrays stay in the cache."""


@dataclass(frozen=True, eq=False)
class Cores:
    """Cores along a motion of T samples: pieces of strings first, then the solids of bodies.

    Attributes:
        a, b: (n, T, 3) ends of segments; of a box both are its centre [m].
        travelled: (n, T) sum of the largest moves of its points since the first sample [m].
        curves: (n_curves, N_CHORDS + 1, 3) points of slack pieces [m].
        curve: (n, T) index into the curves; -1 for straight pieces and bodies.
        sag: (n, T) largest distance of a curve from its chord; 0 without a curve [m].
        shape: (n,) index into boxes and ellipsoids, -1 for others.
        R, half: (n_shapes, T, 3, 3) axes in columns; (n_shapes, 3) half edges or axes [m].
        radius: (n_shapes,) radius of the capsule around an ellipsoid; 0 for boxes [m].
    """

    a: Vec3
    b: Vec3
    travelled: Array
    curves: Vec3
    curve: Indices
    sag: Array
    shape: Indices
    R: Array
    half: Array
    radius: Array

    @classmethod
    def along_motion(
        cls, marionette: Marionette, bodies: Records, links: list[int], q_D: Array, q_K: Array
    ) -> Cores:
        """The cores at T configurations.

        Args:
            marionette: a puppet or a scene.
            bodies: (n_bodies,) ``SOLID``; a mesh is the box around it.
            links: n_bodies links that carry them.
            q_D, q_K: (T, n_qD) dynamic and (T, n_qK) driven (kinematic) configurations.
        """
        pieces, lengths = _pieces(marionette, q_D, q_K)
        curves, curve, sag = _curves(pieces, lengths)
        n_pieces, T = lengths.shape
        n = n_pieces + len(bodies)
        a, b = np.empty((2, n, T, 3))
        travelled = np.empty((n, T))
        a[:n_pieces], b[:n_pieces] = pieces[:, 0], pieces[:, 1]
        for i, ends in enumerate(pieces):
            travelled[i] = _travel_of_piece(ends, curves, curve[i])
        shape = np.full(n, -1)
        with_volume = np.flatnonzero(bodies["half"].any(axis=1))
        axes = np.empty((len(with_volume), T, 3, 3))
        shape[n_pieces + with_volume] = np.arange(len(with_volume))
        poses = marionette.poses(q_D, q_K)
        for link in dict.fromkeys(links):
            # Transposed, so that points are rows.
            R = np.ascontiguousarray(poses[:, link, :, :3].swapaxes(1, 2))
            r = poses[:, link, :, 3]
            for body_index in np.flatnonzero(np.array(links) == link):
                i, body = n_pieces + body_index, bodies[body_index]
                a[i], b[i] = (np.einsum("i,tij->tj", body[end], R) + r for end in ("a", "b"))
                points = [a[i], b[i]]
                if shape[i] >= 0:
                    axes[shape[i]] = (body["R"].reshape(3, 3) @ R).swapaxes(1, 2)
                    points = _corners(0.5 * (a[i] + b[i]), axes[shape[i]], body["half"])
                travelled[i] = _travel(points)
        zeros = np.zeros((len(bodies), T))
        return cls(
            a,
            b,
            travelled,
            curves,
            np.concatenate([curve, zeros.astype(int) - 1]),
            np.concatenate([sag, zeros]),
            shape,
            axes,
            bodies["half"][with_volume],
            bodies["radius"][with_volume],
        )

    def chords(self) -> Cores:
        """The same cores with straight strings."""
        return replace(self, curve=np.full_like(self.curve, -1), sag=np.zeros_like(self.sag))

    def straight(self, i: Indices, j: Indices, k: Indices) -> Array:
        """Distances (m,) of chords i from cores j at samples k, all (m,), without radii [m]."""
        values = np.empty(len(i))
        for first in range(0, len(i), _CHUNK_SIZE):
            chunk = slice(first, first + _CHUNK_SIZE)
            a, b = self.a[i[chunk], k[chunk]], self.b[i[chunk], k[chunk]]
            values[chunk] = self._distances_from(a, b, j[chunk], k[chunk])[0]
        return values

    def exact(self, i: Indices, j: Indices, k: Indices) -> tuple[Array, Vec3]:
        """Distances (m,) [m] with sagging strings, and nearest places (m, 3) on pieces i."""
        distance, nearest = np.empty(len(i)), np.empty((len(i), 3))
        for first in range(0, len(i), _CHUNK_SIZE):
            chunk = slice(first, first + _CHUNK_SIZE)
            distance[chunk], nearest[chunk] = self._exact(i[chunk], j[chunk], k[chunk])
        return distance, nearest

    def _exact(self, i: Indices, j: Indices, k: Indices) -> tuple[Array, Vec3]:
        a, b = self.a[i, k], self.b[i, k]
        distance, s = self._distances_from(a, b, j, k)
        nearest = a + s[:, None] * (b - a)
        curved, other_curved = self.curve[i, k] >= 0, self.curve[j, k] >= 0
        for combination in (curved & ~other_curved, ~curved & other_curved, curved & other_curved):
            m = np.flatnonzero(combination)
            if not len(m):
                continue
            distance[m] = np.inf
            polyline = np.stack([a[m], b[m]], axis=1)
            if curved[m[0]]:
                polyline = self.curves[self.curve[i[m], k[m]]]
            for start, end in pairwise(polyline.swapaxes(0, 1)):
                for values, s in self._distances_from_each(
                    start, end, j[m], k[m], bool(other_curved[m[0]])
                ):
                    is_nearer = values < distance[m]
                    distance[m[is_nearer]] = values[is_nearer]
                    nearest[m[is_nearer]] = (start + s[:, None] * (end - start))[is_nearer]
        return distance, nearest

    def _distances_from_each(
        self, a: Vec3, b: Vec3, j: Indices, k: Indices, curved: bool
    ) -> Iterator[tuple[Array, Array]]:
        """Results of ``_distances_from`` for cores, or for each chord of their curves."""
        if not curved:
            yield self._distances_from(a, b, j, k)
            return
        for start, end in pairwise(self.curves[self.curve[j, k]].swapaxes(0, 1)):
            yield segment_distance(a, b, start, end)

    def _distances_from(self, a: Vec3, b: Vec3, j: Indices, k: Indices) -> tuple[Array, Array]:
        """Distances of segments a to b (m, 3) from cores, and s (m,) of their nearest points."""
        distance, s = segment_distance(a, b, self.a[j, k], self.b[j, k])
        shape = self.shape[j]
        m = np.flatnonzero(shape >= 0)
        if not len(m):
            return distance, s
        shape = shape[m]
        centre = 0.5 * (self.a[j[m], k[m]] + self.b[j[m], k[m]])
        R, half, radius = self.R[shape, k[m]], self.half[shape], self.radius[shape]
        start, end = (np.einsum("nij,ni->nj", R, x[m] - centre) for x in (a, b))
        box = np.flatnonzero(radius == 0.0)
        distance[m[box]], s[m[box]] = distance_from_box(start[box], end[box], half[box])
        # The capsule around an ellipsoid gives another bound, which is better far away.
        bound, t = distance_bound_from_ellipsoid(start, end, half)
        nearer = (radius > 0.0) & (bound + radius > distance[m])
        distance[m[nearer]], s[m[nearer]] = (bound + radius)[nearer], t[nearer]
        return distance, s


def _pieces(marionette: Marionette, q_D: Array, q_K: Array) -> tuple[Array, Array]:
    """Ends (n, 2, T, 3) of pieces and lengths (n, T) of slack ones, 0 of straight ones [m]."""
    ends, lengths = [], []
    string_lengths = marionette.string_lengths(q_D, q_K)
    paths = marionette.string_points(q_D, q_K).values()
    for string, points, length in zip(
        marionette.tree.strings, paths, string_lengths.T, strict=True
    ):
        spans = np.linalg.norm(np.diff(points, axis=1), axis=2)
        span_sum = spans.sum(axis=1)
        # Wires push too, and stay straight.
        slack = (length > span_sum * MIN_SLACK) & (span_sum > 0.0) & (not string.wire)
        stretch = np.where(slack, length, 0.0) / np.where(slack, span_sum, 1.0)
        for n, span in enumerate(spans.T):
            ends.append(points[:, n : n + 2].swapaxes(0, 1))
            lengths.append(stretch * span)
    T = len(q_D)
    return np.array(ends).reshape(-1, 2, T, 3), np.array(lengths).reshape(-1, T)


def _curves(pieces: Array, lengths: Array) -> tuple[Vec3, Array, Array]:
    """Curves (n_curves, N_CHORDS + 1, 3), their indices and distances from chords (n, T)."""
    curve, sag = np.full(lengths.shape, -1), np.zeros(lengths.shape)
    i, k = np.nonzero(lengths)
    start, end = pieces[i, 0, k], pieces[i, 1, k]
    curves = slack_curves(start, end, lengths[i, k])
    offset, chords = curves - start[:, None], end - start
    squared_length = np.maximum(dot(chords, chords), np.finfo(float).tiny)
    s = np.clip(np.einsum("npi,ni->np", offset, chords) / squared_length[:, None], 0.0, 1.0)
    offset -= s[..., None] * chords[:, None]
    max_offset = np.sqrt(np.max(dot(offset, offset), axis=1, initial=0.0))
    sags = max_offset > _MIN_SAG
    i, k = i[sags], k[sags]
    curve[i, k], sag[i, k] = np.arange(len(i)), max_offset[sags]
    return curves[sags], curve, sag


def _travel(points: list[Vec3]) -> Array:
    """Sum (T,) of the largest moves of several points (T, 3) in each step [m]."""
    steps = [np.sqrt(dot(d, d)) for d in (np.diff(x, axis=0) for x in points)]
    return np.concatenate([[0.0], np.cumsum(np.max(steps, axis=0))])


def _travel_of_piece(ends: Vec3, curves: Vec3, curve: Indices) -> Array:
    """Result of :func:`_travel` for a piece with ends (2, T, 3) and indices of curves (T,) [m]."""
    step = np.sqrt(np.max(dot(*[np.diff(ends, axis=1)] * 2), axis=0))
    is_curved = np.flatnonzero((curve[1:] >= 0) | (curve[:-1] >= 0))
    s = np.linspace(0.0, 1.0, N_CHORDS + 1)[:, None]

    def points(k: Indices) -> Vec3:
        values = ends[0, k, None] + s * (ends[1, k] - ends[0, k])[:, None]
        hangs = curve[k] >= 0
        values[hangs] = curves[curve[k[hangs]]]
        return values

    steps = points(is_curved + 1) - points(is_curved)
    step[is_curved] = np.maximum(
        step[is_curved], np.sqrt(np.max(dot(steps, steps), axis=1, initial=0.0))
    )
    return np.concatenate([[0.0], np.cumsum(step)])


def _corners(centre: Vec3, R: Array, half: Array) -> list[Vec3]:
    """Corners (T, 3) of a box, or of the box around an ellipsoid."""
    signs = itertools.product((-1.0, 1.0), repeat=3)
    return [centre + R @ (np.array(sign) * half) for sign in signs]
