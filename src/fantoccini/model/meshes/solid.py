"""Closed surfaces: test of closure, connected pieces, orientation of faces.

A piece is a connected part of the surface, with the hollows inside it. The winding number of a
surface around a point is 1 inside and 0 outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, Indices, Mask
from fantoccini.model.meshes.limits import LIMITS


def is_closed(faces: Indices) -> bool:
    """Whether triangles (m, 3) bound a volume: every edge is used equally often in both directions.

    Pieces may share edges and corners.
    """
    key, direction, _ = _edges(faces)
    _, edge = np.unique(key, return_inverse=True)
    return not np.any(np.bincount(edge, weights=direction))


def pieces(mesh: Any) -> list[Any]:
    """The pieces of a closed mesh with their hollows, each a ``trimesh.Trimesh``.

    At an edge shared by pieces, two faces belong to one piece if the inside is between them.
    """
    shells = _Shells.of(mesh)
    if len(shells.volumes) == 1:
        return [mesh]
    owner_of_shell = np.arange(len(shells.volumes))
    for k in np.flatnonzero(shells.volumes <= 0.0):
        enclosing = shells.containing(int(k), shells.volumes > 0.0)
        owner_of_shell[k] = (
            enclosing[np.argmin(shells.volumes[enclosing])] if len(enclosing) else -1
        )
    piece = owner_of_shell[shells.label]
    return [shells.submesh(np.flatnonzero(piece == k)) for k in np.unique(owner_of_shell) if k >= 0]


def faces_to_reverse(mesh: Any) -> Mask:
    """(m,) flags of the faces of a closed mesh to reverse, so that every piece faces outwards.

    Pieces of negative volume inside another piece are its hollows, and are not reversed.

    Raises:
        ValueError: there are too many pieces, or too many inside one another.
    """
    shells = _Shells.of(mesh)
    if len(shells.volumes) > LIMITS.max_pieces:
        raise ValueError(f"it has more than {LIMITS.max_pieces} closed pieces")
    is_inverted = float(shells.volumes.sum()) < 0.0
    volumes = -shells.volumes if is_inverted else shells.volumes
    is_reversed = np.full(len(volumes), is_inverted)
    for k in np.flatnonzero(volumes < 0.0):
        is_reversed[k] ^= len(shells.containing(int(k), volumes > 0.0)) == 0
    return np.asarray(is_reversed[shells.label])


def inside(mesh: Any, points: Array) -> Mask:
    """(n,) whether points (n, 3) lie in a closed mesh, from its winding number by solid angles.

        tan(angle / 2) = a . (b x c) / (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|)

    (Van Oosterom, Strackee, IEEE Trans. Biomed. Eng. 30, 1983).
    """
    return np.array([_winding_number(mesh.triangles - x) > 0.5 for x in points], dtype=bool)


@dataclass(eq=False)
class _Shells:
    """Connected parts of a closed mesh.

    Attributes:
        mesh: whole mesh.
        label: (m,) index of the part of each face.
        volumes: (k,) volumes of the parts; negative if the faces point inwards.
        lower, upper: (k, 3) corners of the boxes around the parts.
        n_tested: number of tests of a point against a face.
    """

    mesh: Any
    label: Indices
    volumes: Array
    lower: Array
    upper: Array
    n_tested: int = 0

    @classmethod
    def of(cls, mesh: Any) -> _Shells:
        """The shells of a closed mesh."""
        label = _component_of_face(mesh)
        count = int(label.max()) + 1
        a, b, c = np.moveaxis(np.array(mesh.triangles) - mesh.vertices[0], 1, 0)
        signed_volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
        lower, upper = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        for corner in (a, b, c):
            np.minimum.at(lower, label, corner)
            np.maximum.at(upper, label, corner)
        return cls(mesh, label, np.bincount(label, signed_volumes).astype(float), lower, upper)

    def containing(self, k: int, is_candidate: Mask) -> Indices:
        """Indices of the shells flagged in ``is_candidate`` that contain shell ``k``."""
        candidates = is_candidate & np.all(
            (self.lower <= self.lower[k]) & (self.upper >= self.upper[k]), axis=1
        )
        candidates[k] = False
        enclosing = []
        point = self.mesh.triangles[np.argmax(self.label == k), 0]
        for i in np.flatnonzero(candidates):
            shell_triangles = self.mesh.triangles[self.label == i]
            self.n_tested += len(shell_triangles)
            if self.n_tested > LIMITS.max_tested:
                raise ValueError("it has too many pieces inside one another")
            if abs(_winding_number(shell_triangles - point)) > 0.5:
                enclosing.append(i)
        return np.array(enclosing, dtype=int)

    def submesh(self, faces: Indices) -> Any:
        """The given faces as a mesh."""
        import trimesh

        used_vertices, new_indices = np.unique(self.mesh.faces[faces], return_inverse=True)
        return trimesh.Trimesh(
            self.mesh.vertices[used_vertices], new_indices.reshape(-1, 3), process=False
        )


def _winding_number(triangles: NDArray[np.float64]) -> float:
    """Winding number of triangles (n, 3, 3) around the origin."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
    angle = np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(np.sum(angle) / (2.0 * np.pi))


def _edges(faces: Indices) -> tuple[Indices, NDArray[np.float64], Indices]:
    """(3 m,) edge numbers of the faces, directions (1, -1; 0 if collapsed), and face indices."""
    start, end = faces[:, [0, 1, 2]].ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel()
    key = np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)
    return key, np.sign(end - start).astype(float), np.repeat(np.arange(len(faces)), 3)


def _component_of_face(mesh: Any) -> Indices:
    """(m,) connected part of each face of a closed mesh."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    key, direction, face = _edges(mesh.faces)
    order = np.argsort(2 * key + (direction > 0.0), kind="stable")
    order = order[direction[order] != 0.0]
    edge_starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    counts = np.diff(np.append(edge_starts, len(order)))
    with_two_faces = edge_starts[counts == 2]
    first, second = face[order[with_two_faces]], face[order[with_two_faces + 1]]
    shared_edges = [
        pair
        for start, n in zip(edge_starts[counts > 2], counts[counts > 2], strict=True)
        for pair in _pairs(
            mesh,
            key[order[start]],
            face[order[start : start + n]],
            direction[order[start : start + n]],
        )
    ]
    if shared_edges:
        first, second = np.concatenate(
            [np.stack([first, second]), np.array(shared_edges).T], axis=1
        )
    n = len(mesh.faces)
    links = coo_array((np.ones(len(first)), (first, second)), shape=(n, n))
    return np.asarray(connected_components(links, directed=False)[1])


def _pairs(
    mesh: Any, key: int, faces: Indices, direction: NDArray[np.float64]
) -> list[tuple[int, int]]:
    """Pairs of the faces around one edge, with the inside between them.

    A face that runs up the edge has its inside on the side of smaller angles, seen with the edge
    pointing to the eye: its partner is the next one that runs down.
    """
    end_vertices = divmod(int(key), int(mesh.faces.max()) + 1)
    a, b = mesh.vertices[list(end_vertices)]
    axis = (b - a) / np.linalg.norm(b - a)
    opposite_vertices = mesh.vertices[
        [next(v for v in f if v not in end_vertices) for f in mesh.faces[faces].tolist()]
    ]
    offset = opposite_vertices - a - np.outer((opposite_vertices - a) @ axis, axis)
    x = offset[np.argmax(np.linalg.norm(offset, axis=1))]
    angle = np.arctan2(offset @ np.cross(axis, x), offset @ x)
    backward, pairs = np.flatnonzero(direction < 0.0).tolist(), []
    for forward in np.flatnonzero(direction > 0.0):
        # Coincident faces enclose no volume: they are paired last.
        gap = np.mod(angle[forward] - angle[backward], 2.0 * np.pi)
        gap = np.where(gap < 1e-7, 2.0 * np.pi, gap)
        partner = backward.pop(int(np.argmin(gap)))
        pairs.append((int(faces[forward]), int(faces[partner])))
    return pairs
