"""Painting order of solids and strings, far to near.

Sorting by the depth of centres is not enough: it paints a foot over its shin. So every two solids
that overlap in the picture are compared: the one whose surface comes first on most lines of sight
through the overlap is nearer. For a box, the side of its visible faces on which the other solid
lies decides. The comparisons are sorted topologically, farther solids first. Strings are cut where
they pass from in front of a solid to behind it.

An occluder is a solid with its outline in the picture.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fantoccini.output.view.camera import Camera, Viewport


class _Comparison(NamedTuple):
    """Resolution and tolerances of the comparison of solids."""

    axis_points: np.ndarray = np.linspace(0.0, 1.0, 5)
    """Points along a solid's axis, as shares of its length."""
    sight_shares: np.ndarray = np.stack(
        np.meshgrid(*[np.linspace(0.08, 0.92, 5)] * 2), axis=-1
    ).reshape(-1, 2)
    """Lines of sight through the overlap of two solids, as shares of its sides, off its edges."""
    face_thickness: float = 1e-6
    """Distance behind a face up to which a point counts as in front of it [m]."""
    max_sunk_depth: float = 0.15
    """Depth behind a solid's middle, relative to the girth, up to which a string counts as in
    front, so that a string tied to the middle of a limb is drawn over it."""


_COMPARISON = _Comparison()


@dataclass(frozen=True)
class BoxFaces:
    """Outward unit normals (n, 3) and centres (n, 3) [m] of a box's faces in the world frame."""

    normals: np.ndarray
    centres: np.ndarray

    def in_front_mask(self, eye: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Mask of the points (..., 3) on the outer side of a face that the eye sees."""
        visible = np.sum((eye - self.centres) * self.normals, axis=1) > 0.0
        normals, centres = self.normals[visible], self.centres[visible]
        outside = points @ normals.T - np.sum(normals * centres, axis=1)
        return np.any(outside > -_COMPARISON.face_thickness, axis=-1)


@dataclass(frozen=True)
class Occluder:
    """Solid with the data that the painting order needs.

    Attributes:
        axis: (2, 3) ends of its longest inner line in the world frame [m].
        half_thickness: distance from that line to the surface [m].
        to_unit_ball: (3, 3) map of the solid, or of a capsule's cross-section, to the unit ball
            [1/m].
        is_capsule: True for a capsule: its ball may be anywhere on the axis.
        bounds: (4,) left, bottom, right, top in the picture [px].
        faces: faces of a box, else None.
    """

    axis: np.ndarray
    half_thickness: float
    to_unit_ball: np.ndarray
    is_capsule: bool
    bounds: np.ndarray
    faces: BoxFaces | None


@dataclass(frozen=True)
class StringPiece:
    """Pieces ``start`` to ``stop`` of a string, in front of and behind the same solids."""

    string: int
    start: int
    stop: int


def painting_order(
    camera: Camera, viewport: Viewport, solids: list[Occluder], strings: list[np.ndarray]
) -> list[int | StringPiece]:
    """Painting order, far to near: indices of solids, and pieces of strings.

    Args:
        camera, viewport: the view.
        solids: solids to paint.
        strings: polylines (n, 3) [m]; piece k lies between points k and k + 1.
    """
    view = _View(camera, viewport, solids)
    farther_first = view.farther_nearer_pairs()
    items: list[int | StringPiece] = list(range(len(solids)))
    depths = [float(d) for d in view.projected[:, :, 2].mean(axis=1)]
    for n, points in enumerate(strings):
        midpoints = 0.5 * (points[:-1] + points[1:])
        behind, in_front, projected = view.occlusion_masks(midpoints)
        changes = np.any(behind[1:] != behind[:-1], axis=1) | np.any(
            in_front[1:] != in_front[:-1], axis=1
        )
        cuts = [0, *(np.flatnonzero(changes) + 1).tolist(), len(midpoints)]
        for start, stop in itertools.pairwise(cuts):
            farther_first += [(len(items), k) for k in np.flatnonzero(behind[start]).tolist()]
            farther_first += [(k, len(items)) for k in np.flatnonzero(in_front[start]).tolist()]
            items.append(StringPiece(n, start, stop))
            depths.append(float(projected[start:stop, 2].mean()))
    return [items[k] for k in _topological_order(depths, farther_first)]


class _View:
    """The solids as arrays, as seen by the camera."""

    def __init__(self, camera: Camera, viewport: Viewport, solids: list[Occluder]):
        self.camera, self.viewport = camera, viewport
        self.axes = np.array([s.axis for s in solids]).reshape(-1, 2, 3)
        self.to_unit_balls = np.array([s.to_unit_ball for s in solids]).reshape(-1, 3, 3)
        self.bounds = np.array([s.bounds for s in solids]).reshape(-1, 4)
        self.half_thicknesses = np.array([s.half_thickness for s in solids])
        self.is_capsule = np.array([s.is_capsule for s in solids], dtype=bool)
        self.box_faces = {k: s.faces for k, s in enumerate(solids) if s.faces is not None}
        self.points_on_axes = self.axes[:, :1] + _COMPARISON.axis_points[:, None] * (
            self.axes[:, 1:] - self.axes[:, :1]
        )
        self.projected = camera.project(self.points_on_axes, viewport)

    def farther_nearer_pairs(self) -> list[tuple[int, int]]:
        """(farther, nearer) solids for all pairs that overlap in the picture."""
        i, j = np.triu_indices(len(self.half_thicknesses), 1)
        a, b = self.bounds[i], self.bounds[j]
        overlap = np.all((a[:, :2] < b[:, 2:]) & (b[:, :2] < a[:, 2:]), axis=1)
        i, j = i[overlap], j[overlap]
        if not len(i):
            return []
        low = np.maximum(self.bounds[i, :2], self.bounds[j, :2])
        high = np.minimum(self.bounds[i, 2:], self.bounds[j, 2:])
        sight_shares = _COMPARISON.sight_shares
        pixels = (low[:, None] + sight_shares * (high - low)[:, None]).reshape(-1, 2)
        distance_i, _, hits_i = self.intersect(np.repeat(i, len(sight_shares)), pixels)
        distance_j, _, hits_j = self.intersect(np.repeat(j, len(sight_shares)), pixels)
        votes = np.where(hits_i & hits_j, np.sign(distance_i - distance_j), 0.0)
        votes = votes.reshape(len(i), -1).sum(axis=1)
        mean_depths = self.projected[:, :, 2].mean(axis=1)
        farther = np.where(votes == 0.0, mean_depths[i] - mean_depths[j], votes) > 0.0
        return [
            (a, b) if self.is_farther(a, b, is_farther) else (b, a)
            for a, b, is_farther in zip(i.tolist(), j.tolist(), farther.tolist(), strict=True)
        ]

    def is_farther(self, a: int, b: int, default: bool) -> bool:
        """Whether a is farther than b, judged by the faces of the larger box; else ``default``."""
        eye, half = self.camera.eye, len(_COMPARISON.axis_points) / 2.0
        if a in self.box_faces and (
            b not in self.box_faces or self.half_thicknesses[a] >= self.half_thicknesses[b]
        ):
            return bool(self.box_faces[a].in_front_mask(eye, self.points_on_axes[b]).sum() > half)
        if b in self.box_faces:
            return bool(self.box_faces[b].in_front_mask(eye, self.points_on_axes[a]).sum() < half)
        return default

    def occlusion_masks(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Masks (N, S) of points (N, 3) behind and in front of solids; projections (N, 3)."""
        projected = self.camera.project(points, self.viewport)
        behind = np.zeros((len(points), len(self.half_thicknesses)), dtype=bool)
        before = behind.copy()
        low, high = self.bounds[None, :, :2], self.bounds[None, :, 2:]
        pixels = projected[:, None, :2]
        point, solid = np.nonzero(np.all((low < pixels) & (pixels < high), axis=2))
        if len(point):
            _, middle, hit = self.intersect(solid, projected[point, :2])
            distance = np.linalg.norm(points[point] - self.camera.eye, axis=1)
            is_nearer = (
                distance < middle + _COMPARISON.max_sunk_depth * self.half_thicknesses[solid]
            )
            for k in self.box_faces.keys() & set(solid.tolist()):
                on_box = solid == k
                is_nearer[on_box] = self.box_faces[k].in_front_mask(
                    self.camera.eye, points[point[on_box]]
                )
                hit[on_box] = True
            before[point, solid] = hit & is_nearer
            behind[point, solid] = hit & ~is_nearer
        return behind, before, projected

    def intersect(
        self, solid: np.ndarray, pixel: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Intersections of lines of sight through pixels (P, 2) with solids (P,).

        Returns:
            Distances from the eye (P,) [m] to the surface and to the middle of the inner piece, and
            whether the line hits the solid. If it misses, both distances are those of the line's
            nearest point.
        """
        ray = self.camera.rays(pixel, self.viewport)
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        a, b = self.projected[solid, 0, :2], self.projected[solid, -1, :2]
        along = b - a
        size = np.maximum(np.sum(along * along, axis=1), 1e-12)
        share = np.clip(np.sum((pixel - a) * along, axis=1) / size, 0.0, 1.0)
        share = np.where(self.is_capsule[solid], share, 0.5)[:, None]
        axes, unit = self.axes[solid], self.to_unit_balls[solid]
        centre = axes[:, 0] + share * (axes[:, 1] - axes[:, 0])
        o = np.einsum("pij,pj->pi", unit, self.camera.eye - centre)
        e = np.einsum("pij,pj->pi", unit, ray)
        ee, oe, oo = (np.sum(x * y, axis=1) for x, y in ((e, e), (o, e), (o, o)))
        discriminant = oe * oe - ee * (oo - 1.0)
        middle = -oe / ee
        return middle - np.sqrt(np.maximum(discriminant, 0.0)) / ee, middle, discriminant > 0.0


def _topological_order(depths: list[float], farther_first: list[tuple[int, int]]) -> list[int]:
    """Topological order, farthest first among free items; cycles are cut at the farthest item."""
    n = len(depths)
    n_farther = [0] * n
    nearer: list[list[int]] = [[] for _ in range(n)]
    for farther, nearer_item in farther_first:
        nearer[farther].append(nearer_item)
        n_farther[nearer_item] += 1
    ready = [(-depths[k], k) for k in range(n) if n_farther[k] == 0]
    heapq.heapify(ready)
    by_depth = sorted(range(n), key=lambda k: -depths[k])
    painted, cursor = [False] * n, 0
    order: list[int] = []
    while len(order) < n:
        if ready:
            k = heapq.heappop(ready)[1]
        else:
            while painted[by_depth[cursor]]:
                cursor += 1
            k = by_depth[cursor]
        if painted[k]:
            continue
        painted[k] = True
        order.append(k)
        for m in nearer[k]:
            n_farther[m] -= 1
            if n_farther[m] == 0 and not painted[m]:
                heapq.heappush(ready, (-depths[m], m))
    return order
