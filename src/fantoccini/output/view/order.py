"""Painting order of solids and strings, far to near.

Sorting by the depth of centres is not enough: it paints a foot over its shin. So every two solids
that overlap in the picture are compared: the one whose surface comes first on most lines of sight
through the overlap is nearer. For a box, the side of its visible faces on which the other solid
lies decides. The comparisons are sorted topologically, farther solids first. Strings are cut where
they pass from in front of a solid to behind it.
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
    sights: np.ndarray = np.stack(np.meshgrid(*[np.linspace(0.08, 0.92, 5)] * 2), axis=-1).reshape(
        -1, 2
    )
    """Lines of sight through the overlap of two solids, as shares of its sides, off its edges."""
    face_thickness: float = 1e-6
    """Distance behind a face up to which a point counts as in front of it [m]."""
    sunk: float = 0.15
    """Depth behind a solid's middle, relative to the girth, up to which a string counts as in
    front, so that a string tied to the middle of a limb is drawn over it."""


_COMPARISON = _Comparison()


@dataclass(frozen=True)
class BoxFaces:
    """Outward unit normals (n, 3) and centres (n, 3) [m] of a box's faces in the world frame."""

    normals: np.ndarray
    centres: np.ndarray

    def is_in_front(self, eye: np.ndarray, points: np.ndarray) -> np.ndarray:
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
        girth: distance from that line to the surface [m].
        unit: (3, 3) map of the solid, or of a capsule's cross-section, to the unit ball [1/m].
        slides: True for a capsule: its ball may be anywhere on the axis.
        bounds: (4,) left, bottom, right, top in the picture [px].
        faces: faces of a box, else None.
    """

    axis: np.ndarray
    girth: float
    unit: np.ndarray
    slides: bool
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
    after = view.pairs()
    items: list[int | StringPiece] = list(range(len(solids)))
    depths = [float(d) for d in view.projected[:, :, 2].mean(axis=1)]
    for n, points in enumerate(strings):
        middles = 0.5 * (points[:-1] + points[1:])
        behind, before, projected = view.hits(middles)
        changes = np.any(behind[1:] != behind[:-1], axis=1) | np.any(
            before[1:] != before[:-1], axis=1
        )
        cuts = [0, *(np.flatnonzero(changes) + 1).tolist(), len(middles)]
        for start, stop in itertools.pairwise(cuts):
            after += [(len(items), k) for k in np.flatnonzero(behind[start]).tolist()]
            after += [(k, len(items)) for k in np.flatnonzero(before[start]).tolist()]
            items.append(StringPiece(n, start, stop))
            depths.append(float(projected[start:stop, 2].mean()))
    return [items[k] for k in _sorted(depths, after)]


class _View:
    """The solids as arrays, as seen by the camera."""

    def __init__(self, camera: Camera, viewport: Viewport, solids: list[Occluder]):
        self.camera, self.viewport = camera, viewport
        self.axes = np.array([s.axis for s in solids]).reshape(-1, 2, 3)
        self.units = np.array([s.unit for s in solids]).reshape(-1, 3, 3)
        self.bounds = np.array([s.bounds for s in solids]).reshape(-1, 4)
        self.girths = np.array([s.girth for s in solids])
        self.slides = np.array([s.slides for s in solids], dtype=bool)
        self.boxes = {k: s.faces for k, s in enumerate(solids) if s.faces is not None}
        self.along = self.axes[:, :1] + _COMPARISON.axis_points[:, None] * (
            self.axes[:, 1:] - self.axes[:, :1]
        )
        self.projected = camera.project(self.along, viewport)

    def pairs(self) -> list[tuple[int, int]]:
        """(farther, nearer) solids for all pairs that overlap in the picture."""
        i, j = np.triu_indices(len(self.girths), 1)
        a, b = self.bounds[i], self.bounds[j]
        overlap = np.all((a[:, :2] < b[:, 2:]) & (b[:, :2] < a[:, 2:]), axis=1)
        i, j = i[overlap], j[overlap]
        if not len(i):
            return []
        low = np.maximum(self.bounds[i, :2], self.bounds[j, :2])
        high = np.minimum(self.bounds[i, 2:], self.bounds[j, 2:])
        sights = _COMPARISON.sights
        pixels = (low[:, None] + sights * (high - low)[:, None]).reshape(-1, 2)
        first, _, on_first = self.intersect(np.repeat(i, len(sights)), pixels)
        second, _, on_second = self.intersect(np.repeat(j, len(sights)), pixels)
        votes = np.where(on_first & on_second, np.sign(first - second), 0.0)
        votes = votes.reshape(len(i), -1).sum(axis=1)
        middles = self.projected[:, :, 2].mean(axis=1)
        farther = np.where(votes == 0.0, middles[i] - middles[j], votes) > 0.0
        return [
            (a, b) if self.is_farther(a, b, first) else (b, a)
            for a, b, first in zip(i.tolist(), j.tolist(), farther.tolist(), strict=True)
        ]

    def is_farther(self, a: int, b: int, default: bool) -> bool:
        """Whether a is farther than b, judged by the faces of the larger box; else ``default``."""
        eye, half = self.camera.eye, len(_COMPARISON.axis_points) / 2.0
        if a in self.boxes and (b not in self.boxes or self.girths[a] >= self.girths[b]):
            return bool(self.boxes[a].is_in_front(eye, self.along[b]).sum() > half)
        if b in self.boxes:
            return bool(self.boxes[b].is_in_front(eye, self.along[a]).sum() < half)
        return default

    def hits(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Masks (N, S) of points (N, 3) behind and in front of solids; projections (N, 3)."""
        projected = self.camera.project(points, self.viewport)
        behind = np.zeros((len(points), len(self.girths)), dtype=bool)
        before = behind.copy()
        low, high = self.bounds[None, :, :2], self.bounds[None, :, 2:]
        pixels = projected[:, None, :2]
        point, solid = np.nonzero(np.all((low < pixels) & (pixels < high), axis=2))
        if len(point):
            _, middle, hit = self.intersect(solid, projected[point, :2])
            distance = np.linalg.norm(points[point] - self.camera.eye, axis=1)
            in_front = distance < middle + _COMPARISON.sunk * self.girths[solid]
            for k in self.boxes.keys() & set(solid.tolist()):
                on_box = solid == k
                in_front[on_box] = self.boxes[k].is_in_front(self.camera.eye, points[point[on_box]])
                hit[on_box] = True
            before[point, solid] = hit & in_front
            behind[point, solid] = hit & ~in_front
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
        share = np.where(self.slides[solid], share, 0.5)[:, None]
        axes, unit = self.axes[solid], self.units[solid]
        centre = axes[:, 0] + share * (axes[:, 1] - axes[:, 0])
        o = np.einsum("pij,pj->pi", unit, self.camera.eye - centre)
        e = np.einsum("pij,pj->pi", unit, ray)
        ee, oe, oo = (np.sum(x * y, axis=1) for x, y in ((e, e), (o, e), (o, o)))
        discriminant = oe * oe - ee * (oo - 1.0)
        middle = -oe / ee
        return middle - np.sqrt(np.maximum(discriminant, 0.0)) / ee, middle, discriminant > 0.0


def _sorted(depths: list[float], after: list[tuple[int, int]]) -> list[int]:
    """Topological order, farthest first among free items; cycles are cut at the farthest item."""
    n = len(depths)
    n_farther = [0] * n
    nearer: list[list[int]] = [[] for _ in range(n)]
    for farther, nearer_item in after:
        nearer[farther].append(nearer_item)
        n_farther[nearer_item] += 1
    free = [(-depths[k], k) for k in range(n) if n_farther[k] == 0]
    heapq.heapify(free)
    by_depth = sorted(range(n), key=lambda k: -depths[k])
    painted, cursor = [False] * n, 0
    order: list[int] = []
    while len(order) < n:
        if free:
            k = heapq.heappop(free)[1]
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
                heapq.heappush(free, (-depths[m], m))
    return order
