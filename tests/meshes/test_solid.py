"""Pieces of closed surfaces: touching ones stay separate; hollows belong to the outer piece."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.meshes.test_gltf import mesh
from tests.meshes.written import UP, Writer

from fantoccini.base.errors import PuppetError
from fantoccini.kernel.runtime.hulls import mesh_hulls
from fantoccini.model.meshes import LIMITS, inside, is_closed, pieces
from fantoccini.model.puppet import Box, Mesh, Sphere
from fantoccini.model.puppet.shapes import load_mesh, shape_inertia


def joined(*solids: trimesh.Trimesh) -> trimesh.Trimesh:
    """One mesh with merged vertices, as from a file."""
    mesh = trimesh.util.concatenate(solids)
    mesh.merge_vertices()
    return mesh


def cube(*at: float, size: tuple[float, ...] = (1.0, 1.0, 1.0)) -> trimesh.Trimesh:
    box = trimesh.creation.box(size)
    box.apply_translation(at)
    return box


def stl(folder: Path, solid: trimesh.Trimesh, **keys) -> Mesh:
    """The solid as a file's shape."""
    (folder / "a.obj").write_text(solid.export(file_type="obj", digits=17))
    return mesh(folder, "a.obj", **keys)


def test_three_boxes_in_one_file_have_the_inertia_of_three_box_shapes(tmp_path):
    """Agreement to 1e-12: their sizes are single-precision numbers, as in files."""
    rng, writer = np.random.default_rng(2), Writer()
    boxes = [
        (np.float32(rng.uniform(0.1, 0.4, 3)), np.float32(rng.uniform(-1, 1, 3))) for _ in range(3)
    ]
    writer.boxes(*((size.astype(float), at.astype(float)) for size, at in boxes))
    writer.save(tmp_path / "a.glb")
    volume, unit = shape_inertia(mesh(tmp_path, "a.glb"))
    parts = [
        shape_inertia(Box(size=tuple(np.abs(UP @ size)), at=tuple(UP @ at))) for size, at in boxes
    ]
    total = sum(v for v, _ in parts)
    com = sum(v * u.com for v, u in parts) / total
    about = (
        sum(
            v
            * (
                u.inertia
                + (u.com - com) @ (u.com - com) * np.eye(3)
                - np.outer(u.com - com, u.com - com)
            )
            for v, u in parts
        )
        / total
    )
    assert volume == pytest.approx(total, rel=1e-12)
    np.testing.assert_allclose(unit.com, com, rtol=0, atol=1e-12)
    np.testing.assert_allclose(unit.inertia, about, rtol=0, atol=1e-12)


def test_boxes_that_touch_in_a_face_an_edge_or_a_corner_are_pieces():
    """Their corners are the same vertices; each piece is found whole, in any order of faces."""
    rng = np.random.default_rng(4)
    rows = [
        (cube(0, 0, 0), cube(1, 0, 0), cube(2, 0, 0)),  # faces
        (cube(0, 0, 0), cube(1, 1, 0), cube(2, 0, 0), cube(1, -1, 0)),  # edges: a ring
        (cube(0, 0, 0), cube(1, 1, 1)),  # a corner
        (cube(0, 0, 0), cube(1, 0, 0), cube(0, 1, 0), cube(1, 1, 0), cube(0.5, 0.5, 4)),
    ]
    for solids in rows:
        mesh = joined(*solids)
        mesh.faces = mesh.faces[rng.permutation(len(mesh.faces))]
        assert is_closed(mesh.faces)
        parts = pieces(mesh)
        assert len(parts) == len(solids)
        centres = np.array([p.center_mass for p in parts])
        wanted = np.array([s.center_mass for s in solids])
        assert all(p.is_volume and len(p.faces) == 12 for p in parts)
        apart = np.linalg.norm(centres[:, None] - wanted[None], axis=2)
        assert np.allclose(np.sort(apart.min(axis=0)), 0.0, atol=1e-12)
        assert [p.volume for p in parts] == pytest.approx([1.0] * len(solids), rel=1e-12)


def test_a_hollow_belongs_to_the_piece_around_it(tmp_path):
    """Two balls, one of them hollow with a ball inside; closed forms of meshed balls."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    outer, hollow, core = (ball.copy() for _ in range(3))
    hollow.apply_scale(0.7)
    hollow.invert()
    core.apply_scale(0.3)
    other = ball.copy()
    other.apply_translation([3, 0, 0])
    mesh = joined(outer, hollow, core, other)
    parts = pieces(mesh)
    v = ball.volume
    volumes = sorted(p.volume for p in parts)
    assert volumes == pytest.approx([0.027 * v, (1 - 0.343) * v, v], rel=1e-12)
    volume, _ = shape_inertia(stl(tmp_path, mesh))
    assert volume == pytest.approx(v * (2 - 0.343 + 0.027), rel=1e-12)


def test_pieces_that_face_inwards_are_turned_over(tmp_path):
    """They are not subtracted: one of three, or all of them."""
    for flipped in ({1}, {0, 1, 2}, {0, 2}):
        solids = [cube(2.0 * k, 0, 0, size=(1, 1, 1 + k)) for k in range(3)]
        for k in flipped:
            solids[k].invert()
        shape = stl(tmp_path, joined(*solids))
        volume, unit = shape_inertia(shape)
        assert volume == pytest.approx(6.0, rel=1e-12)
        assert unit.com[0] == pytest.approx((0 + 4 + 12) / 6, rel=1e-12)
        assert all(p.volume > 0 for p in pieces(load_mesh(shape)))


def test_each_piece_must_be_closed(tmp_path):
    broken = cube(3, 0, 0)
    broken.update_faces(np.arange(12) != 5)
    with pytest.raises(PuppetError, match=r"a\.obj is not closed"):
        stl(tmp_path, joined(cube(0, 0, 0), broken))
    mixed = cube(0, 0, 0)
    mixed.faces = np.where((np.arange(12) == 3)[:, None], mixed.faces[:, ::-1], mixed.faces)
    with pytest.raises(PuppetError, match="neighbouring triangles that face inwards and out"):
        stl(tmp_path, mixed)


def test_each_convex_piece_is_one_hull(tmp_path):
    """Boxes that nearly fill a box together are not merged; a box inside another is left out."""
    boxes = [cube(1.01 * k, 0, 0) for k in range(3)]
    inner = trimesh.creation.icosphere(subdivisions=1, radius=0.2)
    hulls = mesh_hulls(stl(tmp_path, joined(*boxes, inner)))
    assert sorted(hull.centroid[0] for hull in hulls) == pytest.approx([0.0, 1.01, 2.02])
    assert all(len(hull.vertices) == 8 and len(hull.planes) == 6 for hull in hulls)
    # A body of touching parts, such as bricks, is those parts.
    walls = joined(*(cube(float(x), 0.0, float(z)) for x in range(3) for z in range(2)))
    assert len(mesh_hulls(stl(tmp_path, walls))) == 6


def test_a_dented_piece_is_cut_and_the_others_are_not(tmp_path, monkeypatch):
    from contact.dented_meshes import hook

    monkeypatch.setenv("FANTOCCINI_CACHE", str(tmp_path / "cache"))
    bend = hook()
    bend.apply_translation([0, 0, 1])
    shape = stl(tmp_path, joined(cube(0, 0, 0), bend, cube(0, 0, 3)))
    first, again = mesh_hulls(shape), mesh_hulls(shape)
    assert len(first) >= 5
    for a, b in zip(first, again, strict=True):
        assert np.array_equal(a.vertices, b.vertices) and np.array_equal(a.centroid, b.centroid)
    cubes = [h for h in first if len(h.vertices) == 8 and np.ptp(h.vertices, axis=0).min() > 0.99]
    assert len(cubes) == 2
    # Except for the cubes, the pieces are those of the hook alone.
    alone = mesh_hulls(stl(tmp_path, bend))
    assert len(alone) == len(first) - 2


def test_too_many_pieces_are_refused_for_contact(tmp_path):
    shape = stl(tmp_path, joined(*(cube(2.0 * k, 0, 0) for k in range(130))))
    with pytest.raises(ValueError, match="needs 130 convex pieces in contact; allowed: 128"):
        mesh_hulls(shape)


def test_winding_numbers_separate_inside_from_outside():
    """Random points in a ball and a cube, compared with trimesh's nearest triangles."""
    mesh = joined(trimesh.creation.icosphere(subdivisions=2), cube(3, 0, 0))
    points = np.random.default_rng(0).uniform([-1.2, -1.2, -1.2], [3.6, 1.2, 1.2], (300, 3))
    planes = trimesh.creation.icosphere(subdivisions=2)
    flat = (
        planes.face_normals @ points.T
        - np.sum(planes.face_normals * planes.triangles_center, axis=1)[:, None]
    )
    wanted = (flat.max(axis=0) < 0) | np.all(np.abs(points - [3, 0, 0]) < 0.5, axis=1)
    assert np.array_equal(inside(mesh, points), wanted) and 20 < wanted.sum() < 280


def test_a_sphere_of_triangles_tends_to_the_sphere(tmp_path):
    """A finer ball in a .glb of trimesh: second order in the length of its edges."""
    off = []
    for n in (2, 3):
        ball = trimesh.creation.icosphere(subdivisions=n, radius=0.5)
        (tmp_path / "a.glb").write_bytes(trimesh.Scene(ball).export(file_type="glb"))
        volume, unit = shape_inertia(mesh(tmp_path, "a.glb"))
        exact, known = shape_inertia(Sphere(radius=0.5))
        off.append(1 - volume / exact)
        np.testing.assert_allclose(unit.inertia, known.inertia, rtol=0.05, atol=1e-6)
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)


def test_pieces_within_pieces_are_bounded(tmp_path, monkeypatch):
    """Shells that alternate, one in another; with smaller limits here."""
    shells = [cube(0, 0, 0, size=(1 + k, 1 + k, 1 + k)) for k in range(8)]
    for k in range(0, 8, 2):
        shells[k].invert()
    onion = joined(*shells)
    volume, _ = shape_inertia(stl(tmp_path, onion))
    # Pieces with inward normals are hollows of the pieces around them.
    assert volume == pytest.approx(sum((-1) ** k * k**3 for k in range(8, 0, -1)), rel=1e-12)
    (tmp_path / "a.obj").unlink()
    monkeypatch.setattr("fantoccini.model.meshes.solid.LIMITS", LIMITS._replace(max_tested=100))
    with pytest.raises(PuppetError, match="too many pieces inside one another"):
        onion.apply_translation([1, 0, 0])
        stl(tmp_path, onion)
    monkeypatch.setattr("fantoccini.model.meshes.solid.LIMITS", LIMITS._replace(max_pieces=7))
    with pytest.raises(PuppetError, match="more than 7 closed pieces"):
        stl(tmp_path, onion)
