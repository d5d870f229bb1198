"""Strings and bodies along a motion: where their cores are, and distances between these."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, Indices, Vec3
from fantoccini.clearance.segments import N_CHORDS, between_segments, dot, from_box, hanging
from fantoccini.marionette import Marionette
from fantoccini.runtime import BOX
from fantoccini.runtime.clearance import Records

_MIN_SLACK = 1.0 + 1e-6
"""Length over span above which a string sags, as in compiled code."""

_MIN_SAG = 1e-5
"""Distance of a curve from its chord up to which a string counts as straight [m]."""

_AT_ONCE = 100_000
"""Pairs that are measured at once: their arrays stay in the cache."""


@dataclass(frozen=True, eq=False)
class Cores:
    """Cores along a motion of T samples: pieces of strings first, then the solids of bodies.

    Attributes:
        a, b: (n, T, 3) ends of segments; of a box both are its centre [m].
        travelled: (n, T) path of the point that moves most, from the first sample on [m].
        length: (n, T) of slack pieces; 0 where one is straight, and of bodies [m].
        stray: (n, T) largest distance of a slack piece's curve from its chord; 0 of a straight
            one [m].
        box: (n,) number among the boxes, -1 for segments.
        R, half: (n_boxes, T, 3, 3) axes in columns, and (n_boxes, 3) half edges [m].
    """

    a: Vec3
    b: Vec3
    travelled: Array
    length: Array
    stray: Array
    box: Indices
    R: Array
    half: Array

    @classmethod
    def of(
        cls, marionette: Marionette, bodies: Records, links: list[int], q_D: Array, q_K: Array
    ) -> Cores:
        """The cores at T configurations.

        Args:
            marionette: a puppet or a scene.
            bodies: (n_bodies,) ``SOLID``, and the links that carry them; a mesh is the box around
                it.
            links: n_bodies links.
            q_D, q_K: (T, n_qD), (T, n_qK).
        """
        T = len(q_D)
        parts = [
            (a, b, length, _path(a, b)) for a, b, length in _pieces(marionette, q_D, q_K)
        ]
        box = [-1] * len(parts)
        boxes: list[tuple[Array, Array]] = []
        poses = marionette.poses(q_D, q_K)
        for body, link in zip(bodies, links, strict=True):
            R, r = poses[:, link, :, :3], poses[:, link, :, 3]
            a, b = R @ body["a"] + r, R @ body["b"] + r
            path = _path(a, b)
            box.append(-1)
            if body["kind"] == BOX:
                box[-1] = len(boxes)
                boxes.append((R @ body["R"].reshape(3, 3).T, body["half"]))
                path = _path(*_corners(a, *boxes[-1]))
            parts.append((a, b, np.zeros(T), path))
        a, b = (np.array([part[n] for part in parts]).reshape(-1, T, 3) for n in (0, 1))
        length, path = (np.array([part[n] for part in parts]).reshape(-1, T) for n in (2, 3))
        R = np.array([R for R, _ in boxes]).reshape(-1, T, 3, 3)
        half = np.array([half for _, half in boxes]).reshape(-1, 3)
        return cls(a, b, path, length, _stray(a, b, length), np.array(box, dtype=int), R, half)

    def straight(self, i: Indices, j: Indices, k: Indices) -> Array:
        """(m,) distances of chords i from cores j, all (m,), at samples k, without radii [m]."""
        found = np.empty(len(i))
        for first in range(0, len(i), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            a, b = self.a[i[part], k[part]], self.b[i[part], k[part]]
            found[part] = self._from(a, b, j[part], k[part])[0]
        return found

    def exact(self, i: Indices, j: Indices, k: Indices) -> tuple[Array, Vec3]:
        """The same where slack strings hang: (m,) [m], and the places (m, 3) on the pieces i."""
        distance, place = np.empty(len(i)), np.empty((len(i), 3))
        for first in range(0, len(i), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            distance[part], place[part] = self._exact(i[part], j[part], k[part])
        return distance, place

    def _exact(self, i: Indices, j: Indices, k: Indices) -> tuple[Array, Vec3]:
        a, b = self.a[i, k], self.b[i, k]
        distance, s, _ = self._from(a, b, j, k)
        place = a + s[:, None] * (b - a)
        curved, other = self.stray[i, k] > 0.0, self.stray[j, k] > 0.0
        for bent in (curved & ~other, ~curved & other, curved & other):
            m = np.flatnonzero(bent)
            if not len(m):
                continue
            distance[m] = np.inf
            own = self._curve(i[m], k[m]) if curved[m[0]] else np.stack([a[m], b[m]], axis=1)
            of_other = self._curve(j[m], k[m]) if other[m[0]] else None
            for c, e in itertools.product(
                range(own.shape[1] - 1), range(1 if of_other is None else N_CHORDS)
            ):
                from_, to = own[:, c], own[:, c + 1]
                if of_other is None:
                    found, s, _ = self._from(from_, to, j[m], k[m])
                else:
                    found, s, _ = between_segments(from_, to, of_other[:, e], of_other[:, e + 1])
                nearer = found < distance[m]
                distance[m[nearer]] = found[nearer]
                place[m[nearer]] = (from_ + s[:, None] * (to - from_))[nearer]
        return distance, place

    def _curve(self, i: Indices, k: Indices) -> Vec3:
        return hanging(self.a[i, k], self.b[i, k], self.length[i, k])

    def _from(self, a: Vec3, b: Vec3, j: Indices, k: Indices) -> tuple[Array, Array, Array]:
        """Distances of segments a to b (m, 3) from cores, and s and t of the nearest points."""
        distance, s, t = between_segments(a, b, self.a[j, k], self.b[j, k])
        m = np.flatnonzero(self.box[j] >= 0)
        if len(m):
            box, centre = self.box[j[m]], self.a[j[m], k[m]]
            R = self.R[box, k[m]]
            ends = [np.einsum("nij,ni->nj", R, end[m] - centre) for end in (a, b)]
            distance[m], s[m] = from_box(*ends, self.half[box])
        return distance, s, t


def _pieces(marionette: Marionette, q_D: Array, q_K: Array) -> list[tuple[Vec3, Vec3, Array]]:
    """Ends (T, 3) and slack length (T,) of every piece; slack is shared in proportion to spans."""
    lengths = marionette.model.string_lengths(q_D, q_K)
    found = []
    paths = marionette.string_points(q_D, q_K)
    for string, points, length in zip(marionette.tree.strings, paths, lengths.T, strict=True):
        spans = np.linalg.norm(np.diff(points, axis=1), axis=2)
        whole = spans.sum(axis=1)
        # Wires push too, and stay straight.
        slack = (length > whole * _MIN_SLACK) & (not string.wire)
        for n, span in enumerate(spans.T):
            own = np.where(slack, length * span / np.where(whole > 0.0, whole, 1.0), 0.0)
            found.append((points[:, n], points[:, n + 1], own))
    return found


def _stray(a: Vec3, b: Vec3, length: Array) -> Array:
    """Distance of slack curves from their chords: that of the farthest point (n, T) [m]."""
    stray = np.zeros_like(length)
    slack = np.argwhere(length > 0.0)
    for first in range(0, len(slack), _AT_ONCE):
        i, k = slack[first : first + _AT_ONCE].T
        start, along = a[i, k], b[i, k] - a[i, k]
        offset = hanging(start, b[i, k], length[i, k]) - start[:, None]
        square = np.maximum(dot(along, along), np.finfo(float).tiny)
        s = np.clip(np.einsum("npi,ni->np", offset, along) / square[:, None], 0.0, 1.0)
        offset -= s[..., None] * along[:, None]
        stray[i, k] = np.sqrt(np.max(dot(offset, offset), axis=1))
    return np.where(stray > _MIN_SAG, stray, 0.0)


def _path(*points: Vec3) -> Array:
    """(T,) path of the one of several points (T, 3) that moves most in each step [m]."""
    steps = [np.sqrt(dot(d, d)) for d in (np.diff(x, axis=0) for x in points)]
    return np.concatenate([[0.0], np.cumsum(np.max(steps, axis=0))])


def _corners(centre: Vec3, R: Array, half: Array) -> list[Vec3]:
    """The corners (T, 3) of a box."""
    signs = itertools.product((-1.0, 1.0), repeat=3)
    return [centre + R @ (np.array(sign) * half) for sign in signs]
