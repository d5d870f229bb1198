"""Triangle meshes of solids: closed, with outward normals, the solid's volume and place."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from fantoccini.output.view.meshes import triangulate
from fantoccini.output.view.silhouettes import box_solid, capsule_solid, ellipsoid_solid, mesh_solid

GREY = np.full(3, 0.5)
TURN = Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()
CENTRE = np.array([0.3, -0.2, 0.5])
UNIT_BALL_VOLUME = 4.0 / 3.0 * np.pi

SOLIDS = {
    "capsule": (
        capsule_solid(0, GREY, np.array([[0.1, 0.0, 0.0], [0.1, 0.3, -0.4]]), 0.1),
        np.pi * 0.01 * 0.5 + UNIT_BALL_VOLUME * 0.001,
        [0.1, 0.15, -0.2],
    ),
    "upright capsule": (
        capsule_solid(0, GREY, np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), 0.2),
        np.pi * 0.04 + UNIT_BALL_VOLUME * 0.008,
        [0.0, 0.0, 0.5],
    ),
    "ball": (
        capsule_solid(0, GREY, np.tile(CENTRE, (2, 1)), 0.2),
        UNIT_BALL_VOLUME * 0.008,
        CENTRE,
    ),
    "speck": (
        capsule_solid(0, GREY, np.zeros((2, 3)), 1e-4),
        UNIT_BALL_VOLUME * 1e-12,
        [0.0, 0.0, 0.0],
    ),
    "ellipsoid": (
        ellipsoid_solid(0, GREY, CENTRE, TURN * [0.1, 0.2, 0.05]),
        UNIT_BALL_VOLUME * 0.001,
        CENTRE,
    ),
    "mirrored ellipsoid": (
        ellipsoid_solid(0, GREY, CENTRE, TURN * [-0.1, 0.2, 0.05]),
        UNIT_BALL_VOLUME * 0.001,
        CENTRE,
    ),
    "box": (box_solid(0, GREY, CENTRE, TURN * [0.1, 0.2, 0.05]), 8.0 * 0.001, CENTRE),
    "mirrored box": (box_solid(0, GREY, CENTRE, TURN * [-0.1, 0.2, 0.05]), 8.0 * 0.001, CENTRE),
    "mesh": (
        mesh_solid(
            0, GREY, *(lambda m: (m.vertices, m.faces))(trimesh.creation.box((0.2, 0.4, 0.6)))
        ),
        0.048,
        [0.0, 0.0, 0.0],
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_mesh_is_closed_and_has_the_solids_volume_and_centre(name):
    solid, volume, centre = SOLIDS[name]
    mesh = triangulate(solid)
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces)  # merges coincident corners
    assert surface.is_watertight and surface.is_winding_consistent
    exact = solid.kind == "faces"
    # Inscribed, so not above the solid's volume.
    assert (1.0 - 1e-9 if exact else 0.96) * volume < surface.volume < (1.0 + 1e-9) * volume
    assert np.allclose(surface.center_mass, centre, atol=1e-9)
    if not exact:
        assert 200 <= len(mesh.faces) <= 600


@pytest.mark.parametrize("name", ["capsule", "ball", "ellipsoid", "mirrored ellipsoid"])
def test_normals_have_length_1_and_point_outwards_as_the_triangles(name):
    mesh = triangulate(SOLIDS[name][0])
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)
    flat = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).face_normals
    assert np.min(np.sum(mesh.normals[mesh.faces] * flat[:, None], axis=-1)) > 0.8


def test_corners_of_round_solids_lie_on_the_surface():
    solid = SOLIDS["capsule"][0]
    along = np.clip((triangulate(solid).vertices - solid.points[0]) @ [0.0, 1.2, -1.6], 0.0, 1.0)
    axis = solid.points[0] + along[:, None] * (solid.points[1] - solid.points[0])
    assert np.allclose(np.linalg.norm(triangulate(solid).vertices - axis, axis=1), 0.1)
    solid = SOLIDS["ellipsoid"][0]
    unit = np.linalg.solve(solid.half_axes, (triangulate(solid).vertices - CENTRE).T)
    assert np.allclose(np.linalg.norm(unit, axis=0), 1.0)


def test_a_boxs_faces_keep_their_edges():
    mesh = triangulate(SOLIDS["box"][0])
    assert (len(mesh.vertices), len(mesh.faces), mesh.normals) == (24, 12, None)
