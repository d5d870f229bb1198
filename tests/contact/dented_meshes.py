"""Meshes that are not convex: a bowl, a ring, a hook."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh


def bowl(sections: int = 12, rings: int = 4) -> trimesh.Trimesh:
    """Half of a hollow ball, radii 0.08 and 0.1 m, open upwards, its lowest point at the origin."""
    turn = np.linspace(0.0, np.pi / 2, rings)
    outer, inner = (
        np.column_stack([r * np.sin(turn), 0.1 - r * np.cos(turn)]) for r in (0.1, 0.08)
    )
    return trimesh.creation.revolve(np.concatenate([outer, inner[::-1]]), sections=sections)


def ring() -> trimesh.Trimesh:
    """A torus around y, radii 0.1 and 0.02 m."""
    mesh = trimesh.creation.torus(0.1, 0.02, major_sections=16, minor_sections=8)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    return mesh


def hook() -> trimesh.Trimesh:
    """A U open downwards: legs 0.1 m wide and 0.3 m long, 0.1 m apart, 0.1 m deep."""
    outline = [(0, 0), (1, 0), (1, 2), (2, 2), (2, 0), (3, 0), (3, 3), (0, 3)]
    faces = [(0, 1, 2), (0, 2, 7), (2, 3, 6), (2, 6, 7), (3, 4, 5), (3, 5, 6)]
    n = len(outline)
    corners = [(0.1 * x - 0.15, y, 0.1 * z - 0.2) for y in (0.05, -0.05) for x, z in outline]
    front = [(a + n, b + n, c + n) for a, b, c in faces]
    back = [(c, b, a) for a, b, c in faces]
    sides = []
    for i in range(n):
        j = (i + 1) % n
        sides += [(i, j, j + n), (i, j + n, i + n)]
    mesh = trimesh.Trimesh(corners, front + back + sides, process=False)
    mesh.fix_normals()
    return mesh


def written(folder: Path, mesh: trimesh.Trimesh) -> None:
    """Write `thing.obj`."""
    (folder / "thing.obj").write_text(mesh.export(file_type="obj", digits=17))
