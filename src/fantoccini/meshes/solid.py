"""Closed surfaces: whether one is closed, the pieces it has, and which way they face."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.arrays import Array, Indices, Mask


def is_closed(faces: Indices) -> bool:
    """Whether triangles (m, 3) bound a volume: every edge is run through as often either way.

    Pieces may share edges and corners.
    """
    low, high, way, _ = _edges(faces)
    _, edge = np.unique(np.stack([low, high], axis=1), axis=0, return_inverse=True)
    return not np.any(np.bincount(edge.reshape(-1), weights=way))


def pieces(mesh: Any) -> list[Any]:
    """The pieces of a closed mesh, each a ``trimesh.Trimesh``, with the hollows in it.

    Where pieces share an edge, faces belong together that have the inside between them.
    """
    shells = _shells(mesh)
    if len(shells) == 1:
        return [mesh]
    made = [_submesh(mesh, shell) for shell in shells]
    solid = [k for k, shell in enumerate(made) if _volume(shell) > 0.0]
    inner: dict[int, list[int]] = {k: [k] for k in solid}
    for k in sorted(set(range(len(made))) - set(solid)):
        around = [i for i in solid if _within(made[k], made[i])]
        if around:
            inner[min(around, key=lambda i: _volume(made[i]))].append(k)
    joined = [np.sort(np.concatenate([shells[k] for k in group])) for group in inner.values()]
    return [_submesh(mesh, part) for part in joined]


def facing_out(mesh: Any) -> Mask:
    """(m,) faces of a closed mesh that must be turned over, so that each piece's face outwards.

    Pieces of negative volume within another piece are its hollows, and stay as they are.
    """
    turned = np.zeros(len(mesh.faces), dtype=bool)
    shells = _shells(mesh)
    made = [_submesh(mesh, shell) for shell in shells]
    sign = -1.0 if _volume(mesh) < 0.0 else 1.0
    volumes = [sign * _volume(shell) for shell in made]
    for k, shell in enumerate(shells):
        flip = sign < 0.0
        if volumes[k] < 0.0:
            around = [made[i] for i in range(len(made)) if volumes[i] > 0.0]
            flip ^= not any(_within(made[k], other) for other in around)
        turned[shell] = flip
    return turned


def inside(mesh: Any, points: Array) -> Mask:
    """(n,) whether points (n, 3) lie in a closed mesh: its winding number, by solid angles.

        tan(angle / 2) = a . (b x c) / (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|)

    (Van Oosterom, Strackee, IEEE Trans. Biomed. Eng. 30, 1983).
    """
    return np.array([_winding(mesh.triangles - x) > 0.5 for x in points], dtype=bool)


def _within(inner: Any, outer: Any) -> bool:
    """Whether a piece lies in another one, whichever way this one faces."""
    if np.any(inner.bounds[0] < outer.bounds[0]) or np.any(inner.bounds[1] > outer.bounds[1]):
        return False
    return abs(_winding(outer.triangles - inner.vertices[0])) > 0.5


def _volume(mesh: Any) -> float:
    """Volume of what a closed surface bounds; negative if it faces inwards."""
    return float(np.linalg.det(mesh.triangles - mesh.vertices[0]).sum() / 6.0)


def _winding(triangles: NDArray[np.float64]) -> float:
    """Turns of the surface (n, 3, 3) around the origin."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
    angle = np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(np.sum(angle) / (2.0 * np.pi))


def _submesh(mesh: Any, faces: Indices) -> Any:
    import trimesh

    used, renamed = np.unique(mesh.faces[faces], return_inverse=True)
    return trimesh.Trimesh(mesh.vertices[used], renamed.reshape(-1, 3), process=False)


def _edges(faces: Indices) -> tuple[Indices, Indices, NDArray[np.float64], Indices]:
    """Lower and higher corner of each side of each face, way (1, -1, or 0 for none), face."""
    start, end = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    way = np.sign(end - start).astype(float)
    return np.minimum(start, end), np.maximum(start, end), way, np.repeat(np.arange(len(faces)), 3)


def _shells(mesh: Any) -> list[Indices]:
    """Faces of each connected part of a closed mesh."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    low, high, way, face = _edges(mesh.faces)
    order = np.lexsort((way, high, low))
    order = order[way[order] != 0.0]
    ends = np.stack([low, high], axis=1)[order]
    begins = np.flatnonzero(np.any(np.diff(ends, axis=0, prepend=-1) != 0, axis=1))
    counts = np.diff(np.append(begins, len(order)))
    plain = begins[counts == 2]
    first, second = face[order[plain]], face[order[plain + 1]]
    more = [
        pair
        for at, n in zip(begins[counts > 2], counts[counts > 2], strict=True)
        for pair in _pairs(mesh, ends[at], face[order[at : at + n]], way[order[at : at + n]])
    ]
    if more:
        first, second = np.concatenate([np.stack([first, second]), np.array(more).T], axis=1)
    n = len(mesh.faces)
    links = coo_array((np.ones(len(first)), (first, second)), shape=(n, n))
    _, label = connected_components(links, directed=False)
    return [np.flatnonzero(label == k) for k in range(int(label.max()) + 1)]


def _pairs(
    mesh: Any, ends: Indices, faces: Indices, way: NDArray[np.float64]
) -> list[tuple[int, int]]:
    """Faces around one edge, in pairs with the inside between them.

    A face that runs up the edge has its inside on the side of smaller angles, seen with the edge
    towards the eye: its partner is the next one that runs down.
    """
    a, b = mesh.vertices[ends]
    axis = (b - a) / np.linalg.norm(b - a)
    third = mesh.vertices[[next(v for v in f if v not in ends) for f in mesh.faces[faces].tolist()]]
    away = third - a - np.outer((third - a) @ axis, axis)
    x = away[np.argmax(np.linalg.norm(away, axis=1))]
    angle = np.arctan2(away @ np.cross(axis, x), away @ x)
    down, pairs = np.flatnonzero(way < 0.0).tolist(), []
    for up in np.flatnonzero(way > 0.0):
        # Faces that lie on one another have nothing between them: the last choice.
        gap = np.mod(angle[up] - angle[down], 2.0 * np.pi)
        gap = np.where(gap < 1e-7, 2.0 * np.pi, gap)
        best = down.pop(int(np.argmin(gap)))
        pairs.append((int(faces[up]), int(faces[best])))
    return pairs
