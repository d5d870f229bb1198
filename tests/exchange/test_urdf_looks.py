"""Colours, materials and meshes of URDF as those of shapes; losses are reported."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.exchange.test_import_urdf import import_text, tetrahedron

import fantoccini as fan
from fantoccini.output.exchange.draft import Draft
from fantoccini.output.exchange.model_file import read_model

RED_BLUE = """mtllib {0}.mtl
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1
usemtl red\nf 1 3 2\nf 1 2 4\nusemtl blue\nf 1 4 3\nf 2 3 4
"""


def import_coloured(visuals: str, folder: Path) -> tuple:
    """Shapes of the only body of a robot, with a mesh in red and blue, read from the disk."""
    (folder / "a.obj").write_text(RED_BLUE.format("a"))
    (folder / "a.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0.2 1\n")
    puppet_import = import_text(f'<robot name="r"><link name="a">{visuals}</link></robot>', folder)
    puppet_import.save(folder / "r.yaml")
    (body,) = fan.model.load(folder / "r.yaml").bodies
    return body.shapes, puppet_import.report


MESH = '<geometry><mesh filename="a.obj"/></geometry>'


def test_meshes_keep_the_colours_of_their_files(tmp_path):
    """Colours are those of the mesh's own file."""
    (shape,), report = import_coloured(f"<visual>{MESH}</visual>", tmp_path)
    assert shape.colour is None and not report
    wanted = fan.model.meshes.read(tmp_path / "a.obj", tmp_path)
    file = shape.read()
    middles = [m.vertices[m.faces].mean(axis=1) for m in (wanted, file)]
    order = [np.lexsort(x.round(6).T) for x in middles]
    assert np.allclose(middles[1][order[1]], middles[0][order[0]], atol=1e-7)
    assert np.array_equal(file.colours[order[1]], wanted.colours[order[0]])
    assert len(np.unique(file.colours, axis=0)) == 2 and file.closed


def test_a_colour_of_urdf_hides_those_of_the_mesh(tmp_path):
    green = '<material name="green"><color rgba="0 1 0 1"/></material>'
    (first, second), report = import_coloured(
        f"<visual>{MESH}{green}</visual><visual>{MESH}</visual>", tmp_path
    )
    assert (first.colour, second.colour) == ("#00ff00", None) and not report
    assert first.file == second.file


SURFACES = {
    "plain": ("Kd 1 0 0\nd 1", None),
    "transparent": ("Kd 1 0 0\nd 0.5", "has a mesh with transparency; "),
    "textured": ("map_Kd x.png", "has a mesh with textures; "),
    "both": ("Tr 0.5\nmap_Kd x.png", "has a mesh with textures and transparency; "),
}


@pytest.mark.parametrize(("red", "told"), SURFACES.values(), ids=SURFACES)
def test_lost_properties_of_mesh_files_are_reported(red, told, tmp_path):
    """This holds unless a colour of URDF hides them."""
    (tmp_path / "b.obj").write_text(RED_BLUE.format("b"))
    (tmp_path / "b.mtl").write_text(f"newmtl red\n{red}\nnewmtl blue\nKd 0 0 1\n")
    green = '<material name="green"><color rgba="0 1 0 1"/></material>'
    mesh = MESH.replace("a.obj", "b.obj")
    _, report = import_coloured(f"<visual>{mesh}</visual><visual>{mesh}{green}</visual>", tmp_path)
    assert [n.message for n in report] == (
        [] if told is None else [f"{told}each triangle has one opaque colour here"]
    )


def test_a_part_without_material_is_grey(tmp_path):
    corners, faces = tetrahedron()
    colours = np.array([[1, 0, 0], [np.nan] * 3, [np.nan] * 3, [0, 0, 1.0]])
    (tmp_path / "a.ply").write_bytes(fan.output.exchange.solids.ply(corners, faces, colours))
    face_colours = fan.model.meshes.read(tmp_path / "a.ply", tmp_path).colours
    assert np.array_equal(
        face_colours, np.array([[255, 0, 0], [178] * 3, [178] * 3, [0, 0, 255]]) / 255
    )


def test_64_colours_allow_a_part_without_one(tmp_path):
    """A mesh has no more colours; another one would merge colours when the file is read."""
    ball = trimesh.creation.icosphere(1)
    colours = np.full((len(ball.faces), 3), np.nan)
    colours[:64] = np.column_stack([np.arange(64.0), np.full((64, 2), 178.0)]) / 255
    ply = fan.output.exchange.solids.ply(ball.vertices, ball.faces, colours)
    (tmp_path / "a.ply").write_bytes(ply)
    face_colours = fan.model.meshes.read(tmp_path / "a.ply", tmp_path).colours
    wanted = np.where(np.isfinite(colours), colours, colours[63])
    assert np.array_equal(np.sort(face_colours, axis=0), np.sort(wanted, axis=0))


def test_materials_without_a_name_belong_only_to_their_visuals(tmp_path):
    ball = '<geometry><sphere radius="1"/></geometry>'
    red = '<color rgba="1 0 0 1"/></material>'
    shapes, (note,) = import_coloured(
        f"<visual>{ball}<material>{red}</visual><visual>{ball}<material/></visual>"
        f'<visual>{ball}<material name="">{red}</visual><visual>{ball}<material name=""/></visual>'
        f'<visual>{ball}<material name="red"/></visual>',
        tmp_path,
    )
    assert [shape.colour for shape in shapes] == [
        "#ff0000",
        "#b2b2b2",
        "#ff0000",
        "#b2b2b2",
        "#b2b2b2",
    ]
    assert note.message == "has a solid of the material 'red', which is not defined; there are none"


def test_many_parts_of_one_mesh_without_names_are_named_quickly(tmp_path, monkeypatch):
    """The file is read once, and names are not searched from number 2 each time."""
    reads = []
    read = fan.model.meshes.read
    monkeypatch.setattr(
        fan.model.meshes, "read", lambda *given: reads.append(given) or read(*given)
    )
    shapes, _ = import_coloured(f"<visual>{MESH}</visual>" * 50, tmp_path)
    assert len(shapes) == 50 and len([path for path, _ in reads if path.suffix == ".obj"]) == 1
    draft = Draft(read_model(tmp_path / "robot.urdf"), "r")
    before = time.monotonic()
    names = [draft.unique_name("geom", "") for _ in range(30_000)]
    assert time.monotonic() - before < 5.0  # a search from 2 takes minutes
    assert len(set(names)) == 30_000 and names[:3] == ["geom", "geom_2", "geom_3"]


def test_an_undefined_material_is_reported(tmp_path):
    ball = '<geometry><sphere radius="1"/></geometry>'
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    shapes, (note,) = import_coloured(
        f'<visual>{ball}{red}</visual><visual>{ball}<material name="rad"/></visual>'
        f'<visual>{ball}<material name="red"/></visual><visual>{ball}<material name=""/></visual>',
        tmp_path,
    )
    assert [shape.colour for shape in shapes] == ["#ff0000", "#b2b2b2", "#ff0000", "#b2b2b2"]
    assert note.message == (
        "has a solid of the material 'rad', which is not defined; did you mean 'red'?"
    )


def test_textures_of_urdf_are_reported(tmp_path):
    """This includes textures of a material that another visual defines."""
    wood = '<material name="wood"><texture filename="wood.png"/></material>'
    (first, second), report = import_coloured(
        f'<visual>{MESH}{wood}</visual><visual><geometry><sphere radius="1"/></geometry>'
        '<material name="wood"/></visual>',
        tmp_path,
    )
    assert (first.colour, second.colour) == (None, "#b2b2b2")
    assert [n.message for n in report] == ["has the texture 'wood.png', left out"] * 2
