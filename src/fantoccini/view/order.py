"""What hides what: the order in which a painter lays things down, far to near.

Depth of centres alone puts a foot before its shin and loses a button on a belly. So every two
solids that overlap in the picture are compared along lines of sight through the overlap: whose
surface is met first on most of them, or for a box on which side of its visible faces the other
lies. The comparisons are sorted topologically, farther things first among those that are
free. Strings are cut only where what they pass before or behind changes.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

import numpy as np

from fantoccini.view.camera import Camera, Viewport

_SAMPLES = np.linspace(0.0, 1.0, 5)
_GRID = np.stack(np.meshgrid(*[np.linspace(0.08, 0.92, 5)] * 2), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class Sides:
    """Outward unit normals (n, 3) and centres (n, 3) of a box's faces in the world [m]."""

    normals: np.ndarray
    centres: np.ndarray

    def before(self, eye: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Which points (..., 3) lie on the outer side of a face that the eye sees."""
        visible = np.sum((eye - self.centres) * self.normals, axis=1) > 0.0
        normals, centres = self.normals[visible], self.centres[visible]
        outside = points @ normals.T - np.sum(normals * centres, axis=1)
        return np.any(outside > -1e-6, axis=-1)


@dataclass(frozen=True)
class Occluder:
    """What the order needs to know of a solid.

    Attributes:
        axis: (2, 3) its longest inner line in the world [m].
        girth: distance from that line to the surface [m].
        unit: (3, 3) maps it, or a capsule's cross-section, to the unit ball [1/m].
        slides: True for a capsule: its ball may sit anywhere on the axis.
        bounds: (4,) left, bottom, right, top in the picture [px].
        link: the link it is fixed on.
        sides: of a box, else None.
    """

    axis: np.ndarray
    girth: float
    unit: np.ndarray
    slides: bool
    bounds: np.ndarray
    link: int
    sides: Sides | None


@dataclass(frozen=True)
class Run:
    """Pieces ``start`` to ``stop`` of a thread, which pass before and behind the same solids."""

    thread: int
    start: int
    stop: int


def painting_order(
    camera: Camera, viewport: Viewport, solids: list[Occluder], threads: list[np.ndarray]
) -> list[int | Run]:
    """The order of painting solids and strings.

    Args:
        camera, viewport: the view.
        solids: what hides and is hidden.
        threads: polylines (n, 3) of strings [m]; piece k lies between points k and k + 1.

    Returns:
        Places in ``solids`` and runs of threads, far to near.
    """
    view = _View(camera, viewport, solids)
    after = view.pairs()
    items: list[int | Run] = list(range(len(solids)))
    depths = [float(d) for d in view.placed[:, :, 2].mean(axis=1)]
    for n, points in enumerate(threads):
        middles = 0.5 * (points[:-1] + points[1:])
        behind, before, seen = view.hits(middles)
        changes = np.any(behind[1:] != behind[:-1], axis=1) | np.any(
            before[1:] != before[:-1], axis=1
        )
        cuts = [0, *(np.flatnonzero(changes) + 1).tolist(), len(middles)]
        for start, stop in itertools.pairwise(cuts):
            after += [(len(items), k) for k in np.flatnonzero(behind[start]).tolist()]
            after += [(k, len(items)) for k in np.flatnonzero(before[start]).tolist()]
            items.append(Run(n, start, stop))
            depths.append(float(seen[start:stop, 2].mean()))
    return [items[k] for k in _sorted(depths, after)]


class _View:
    """The solids as arrays, seen from one place."""

    def __init__(self, camera: Camera, viewport: Viewport, solids: list[Occluder]):
        self.camera, self.viewport, self.solids = camera, viewport, solids
        self.axes = np.array([s.axis for s in solids]).reshape(-1, 2, 3)
        self.units = np.array([s.unit for s in solids]).reshape(-1, 3, 3)
        self.bounds = np.array([s.bounds for s in solids]).reshape(-1, 4)
        self.girths = np.array([s.girth for s in solids])
        self.slides = np.array([s.slides for s in solids], dtype=bool)
        self.links = np.array([s.link for s in solids], dtype=int)
        self.boxes = {k for k, s in enumerate(solids) if s.sides is not None}
        self.along = self.axes[:, :1] + _SAMPLES[:, None] * (self.axes[:, 1:] - self.axes[:, :1])
        self.placed = camera.project(self.along, viewport)

    def pairs(self) -> list[tuple[int, int]]:
        """(farther, nearer) for every two solids that overlap in the picture."""
        i, j = np.triu_indices(len(self.solids), 1)
        a, b = self.bounds[i], self.bounds[j]
        meet = np.all((a[:, :2] < b[:, 2:]) & (b[:, :2] < a[:, 2:]), axis=1)
        i, j = i[meet], j[meet]
        if not len(i):
            return []
        low = np.maximum(self.bounds[i, :2], self.bounds[j, :2])
        high = np.minimum(self.bounds[i, 2:], self.bounds[j, 2:])
        pixels = (low[:, None] + _GRID * (high - low)[:, None]).reshape(-1, 2)
        first, _, on_first = self.meets(np.repeat(i, len(_GRID)), pixels)
        second, _, on_second = self.meets(np.repeat(j, len(_GRID)), pixels)
        votes = np.where(on_first & on_second, np.sign(first - second), 0.0)
        votes = votes.reshape(len(i), -1).sum(axis=1)
        middles = self.placed[:, :, 2].mean(axis=1)
        farther = np.where(votes == 0.0, middles[i] - middles[j], votes) > 0.0
        return [
            (a, b) if self.box_says(a, b, first) else (b, a)
            for a, b, first in zip(i.tolist(), j.tolist(), farther.tolist(), strict=True)
        ]

    def box_says(self, a: int, b: int, first: bool) -> bool:
        """Whether a is farther than b, by the faces of the larger box if one is a box."""
        eye, half = self.camera.eye, len(_SAMPLES) / 2.0
        if a in self.boxes and (b not in self.boxes or self.girths[a] >= self.girths[b]):
            return self.solids[a].sides.before(eye, self.along[b]).sum() > half
        if b in self.boxes:
            return self.solids[b].sides.before(eye, self.along[a]).sum() < half
        return first

    def hits(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Which points (N, 3) are behind and before which solids: (N, S), (N, S), seen (N, 3)."""
        seen = self.camera.project(points, self.viewport)
        behind = np.zeros((len(points), len(self.solids)), dtype=bool)
        before = behind.copy()
        low, high = self.bounds[None, :, :2], self.bounds[None, :, 2:]
        place = seen[:, None, :2]
        point, solid = np.nonzero(np.all((low < place) & (place < high), axis=2))
        if len(point):
            _, middle, touched = self.meets(solid, seen[point, :2])
            away = np.linalg.norm(points[point] - self.camera.eye, axis=1)
            # A string tied to the middle of a limb is shown on top of it, not swallowed by it.
            front = away < middle + 0.15 * self.girths[solid]
            for k in self.boxes.intersection(solid.tolist()):
                mine = solid == k
                front[mine] = self.solids[k].sides.before(self.camera.eye, points[point[mine]])
                touched[mine] = True
            before[point, solid] = touched & front
            behind[point, solid] = touched & ~front
        return behind, before, seen

    def meets(self, solid: np.ndarray, pixel: np.ndarray) -> tuple:
        """Where lines of sight through pixels (P, 2) meet solids (P,).

        Returns:
            Distances from the eye (P,) [m] to the surface and to the middle of the inner piece,
            and whether the line meets the solid at all; where it does not, both distances are
            those of its nearest point.
        """
        ray = self.camera.rays(pixel, self.viewport)
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        a, b = self.placed[solid, 0, :2], self.placed[solid, -1, :2]
        along = b - a
        size = np.maximum(np.sum(along * along, axis=1), 1e-12)
        share = np.clip(np.sum((pixel - a) * along, axis=1) / size, 0.0, 1.0)
        share = np.where(self.slides[solid], share, 0.5)[:, None]
        axes, unit = self.axes[solid], self.units[solid]
        centre = axes[:, 0] + share * (axes[:, 1] - axes[:, 0])
        o = np.einsum("pij,pj->pi", unit, self.camera.eye - centre)
        e = np.einsum("pij,pj->pi", unit, ray)
        ee, oe, oo = (np.sum(x * y, axis=1) for x, y in ((e, e), (o, e), (o, o)))
        inner = oe * oe - ee * (oo - 1.0)
        middle = -oe / ee
        return middle - np.sqrt(np.maximum(inner, 0.0)) / ee, middle, inner > 0.0


def _sorted(depths: list[float], after: list[tuple[int, int]]) -> list[int]:
    """Topological order, far to near among those that are free; cycles are cut at the farthest."""
    n = len(depths)
    waiting = [0] * n
    nearer: list[list[int]] = [[] for _ in range(n)]
    for far, near in after:
        nearer[far].append(near)
        waiting[near] += 1
    free = [(-depths[k], k) for k in range(n) if waiting[k] == 0]
    heapq.heapify(free)
    rest = sorted(range(n), key=lambda k: -depths[k])
    done, order, cursor = [False] * n, [], 0
    while len(order) < n:
        if free:
            k = heapq.heappop(free)[1]
        else:
            while done[rest[cursor]]:
                cursor += 1
            k = rest[cursor]
        if done[k]:
            continue
        done[k] = True
        order.append(k)
        for m in nearer[k]:
            waiting[m] -= 1
            if waiting[m] == 0 and not done[m]:
                heapq.heappush(free, (-depths[m], m))
    return order
