"""Colours of mesh files, from the file to every picture and export."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pygltflib as gl
import pytest
import trimesh
from PIL import Image
from tests.animation.glb_reader import Player
from tests.animation.test_glb import validated
from tests.animation.three import three
from tests.meshes.written import Writer
from tests.show.browser import count_similar_pixels, picture

import fantoccini as fan
from fantoccini.model.meshes import LIMITS, read
from fantoccini.output.view import film
from fantoccini.output.view.meshes import coloured_surfaces
from fantoccini.output.view.shapes import shape_solid
from fantoccini.output.view.silhouettes import mesh_solid

pytestmark = pytest.mark.medium

RED, BLUE, GREEN = (0.5, 0.02, 0.03), (0.03, 0.05, 0.6), (0.04, 0.4, 0.1)
"""Linear colours."""


def srgb(linear) -> np.ndarray:
    """Conversion to sRGB, by IEC 61966-2-1."""
    x = np.array(linear, dtype=float)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def hanging_puppet(folder: Path, file: str, more: str = "") -> fan.Marionette:
    """A body that hangs on a string."""
    (folder / "toy.yaml").write_text(
        "puppet: toy\nfloor: 0\nbodies:\n  - name: head\n    joint: {type: free}\n"
        f"    shapes: [{{type: mesh, file: {file}, density: 300{more}}}]\n"
        "strings:\n  - {name: up, path: [{world: [0, 0, 1]}, {body: head, at: [0, 0, 0.1]}],"
        " length: 0.4}\npose: {head.z: 0.5}\n"
    )
    return fan.load(folder / "toy.yaml")


@pytest.fixture
def head(tmp_path: Path) -> Path:
    """Three boxes in three materials, as in a head with a hat; the third box has none."""
    writer = Writer()
    red, blue = writer.material(RED), writer.material(BLUE)
    writer.boxes(
        ((0.25, 0.25, 0.25), (0, 0, 0), red),
        ((0.5, 0.0625, 0.5), (0, 0.25, 0), blue),
        ((0.0625, 0.0625, 0.0625), (0, 0, 0.25)),
    )
    return writer.save(tmp_path / "head.glb")


def upper_faces(found, height: float) -> np.ndarray:
    """Faces of a file with a higher middle."""
    return found.vertices[found.faces].mean(axis=1)[:, 2] > height


def test_base_colours_are_linear_and_screens_have_srgb(head):
    file = read(head, head.parent)
    hat = upper_faces(file, 0.2)
    nose = file.vertices[file.faces].mean(axis=1)[:, 1] < -0.2
    assert np.allclose(file.colours[hat], srgb(BLUE), atol=0.51 / 255)
    assert np.isnan(file.colours[nose & ~hat]).all() and (nose & ~hat).sum() == 12
    assert np.allclose(file.colours[~hat & ~nose], srgb(RED), atol=0.51 / 255)


def test_corners_colour_the_faces_they_bound(tmp_path):
    """COLOR_0 in bytes or floats, times the base colour, all linear."""
    colours = np.tile([[51, 102, 255, 255]], (8, 1)).astype("uint8")
    for look in (None, RED):
        writer = Writer()
        material = None if look is None else writer.material(look)
        writer.node(writer.mesh(material=material, COLOR_0=writer.numbers(colours, True)))
        wanted = srgb(np.array([0.2, 0.4, 1.0]) * (1.0 if look is None else np.array(look)))
        file = read(writer.save(tmp_path / "a.glb"), tmp_path)
        assert np.allclose(file.colours, wanted, atol=0.51 / 255)


def square_colours(folder: Path, corners: np.ndarray, image: np.ndarray, **sampler) -> np.ndarray:
    """Colours of two triangles with texture coordinates (6, 2), times 255."""
    writer = Writer()
    look = writer.material(image=image, **sampler)
    uv = writer.numbers(np.asarray(corners, "float32"))
    places = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0], [3, 0, 0], [3, 1, 0]], float)
    writer.node(writer.mesh(places, np.arange(6), look, TEXCOORD_0=uv))
    return 255.0 * read(writer.save(folder / "q.glb"), folder).colours


def test_a_texture_colours_its_triangles(tmp_path):
    """A palette, as in low-poly models; v points down; beyond 1 it repeats or extends its edge."""
    image = np.array([[[250, 0, 0], [0, 250, 0]], [[0, 0, 250], [90, 90, 90]]], "uint8")

    def at(u: float, v: float, **sampler) -> list[float]:
        corners = np.concatenate([np.tile([u, v], (3, 1)), np.tile([0.75, 0.75], (3, 1))])
        file = square_colours(tmp_path, corners, image, **sampler)
        assert np.allclose(file[1], 90, atol=0.51)
        return np.round(file[0]).tolist()

    assert at(0.25, 0.25) == [250, 0, 0] and at(0.75, 0.25) == [0, 250, 0]
    assert at(0.25, 0.75) == [0, 0, 250]
    assert at(1.25, -0.75) == [250, 0, 0] and at(-0.25, 7.25) == [0, 250, 0]
    clamped = {"wrapS": 33071, "wrapT": 33071}
    assert at(1.25, 0.25, **clamped) == [0, 250, 0] and at(0.25, 9.0, **clamped) == [0, 0, 250]


def test_lost_properties_of_surfaces_are_reported(tmp_path):
    """Textures, and alpha in modes of translucent materials; in PLY any alpha below 1."""
    writer, image = Writer(), np.zeros((2, 2, 3), "uint8")
    plain, textured, clear = writer.material(), writer.material(image=image), writer.material()
    for lost, material in (([], plain), (["textures"], textured), (["transparency"], clear)):
        writer.gltf.materials[clear].alphaMode = "BLEND" if material == clear else "OPAQUE"
        writer.gltf.scenes[0].nodes.clear()
        writer.boxes(((1, 1, 1), (0, 0, 0), material))
        assert sorted(read(writer.save(tmp_path / "a.glb"), tmp_path).lost) == lost
    box = trimesh.creation.box()
    for alpha in (255, 254):
        box.visual.face_colors = [200, 100, 50, alpha]
        (tmp_path / "a.ply").write_bytes(box.export(file_type="ply"))
        assert len(read(tmp_path / "a.ply", tmp_path).lost) == (alpha < 255)


def test_a_triangle_has_the_mean_of_its_texture_in_linear_light(tmp_path):
    """Half of it is white, half black: 50 % of the light, sRGB 188."""
    image = np.zeros((2, 2, 3), "uint8")
    image[0] = 255
    corners = [[0.5, 0.0], [0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [1.0, 0.0], [0.5, 1.0]]
    file = square_colours(tmp_path, corners, image)
    # White parts are a quarter and three quarters of the triangles' areas.
    assert np.allclose(file[:, 0], 255 * srgb([0.25, 0.75]), atol=0.51)


def test_many_colours_become_few_close_ones(tmp_path):
    rng = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(subdivisions=3)
    image = np.linspace(0, 255, 256).astype("uint8")[None, :, None] * np.ones((4, 1, 3), "uint8")
    writer = Writer()
    look = writer.material(image=image)
    uv = np.column_stack([0.5 + 0.49 * ball.vertices[:, 2], rng.random(len(ball.vertices))])
    writer.node(
        writer.mesh(
            ball.vertices, ball.faces, look, TEXCOORD_0=writer.numbers(uv.astype("float32"))
        )
    )
    file = read(writer.save(tmp_path / "a.glb"), tmp_path)
    different = np.unique(file.colours, axis=0)
    assert 30 < len(different) <= LIMITS.max_colours
    # The image gets brighter towards glTF's z, which is our -y.
    middle = -file.vertices[file.faces].mean(axis=1)[:, 1]
    assert np.abs(file.colours[:, 0] - (0.5 + 0.49 * middle)).max() < 0.03


def obj(folder: Path, material: str) -> np.ndarray:
    """Colours of two triangles of the materials a and b in an OBJ."""
    (folder / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
        "vt 0.1 0.9\nvt 0.2 0.9\nvt 0.2 0.8\n"
        "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 4/3\n"
    )
    (folder / "a.mtl").write_text(material)
    file = read(folder / "a.obj", folder)
    lower = file.vertices[file.faces][:, :, 2].max(axis=1) == 0.0
    return file.colours[np.argsort(~lower)]


def test_an_obj_has_the_colours_of_its_materials(tmp_path):
    """Kd is used unchanged, or an image; missing images and those in other folders are left out."""
    pixels = np.zeros((10, 10, 3), "uint8")
    pixels[:5, :5] = [10, 200, 30]
    Image.fromarray(pixels).save(tmp_path / "look.png")
    (tmp_path / "secret.png").write_bytes((tmp_path / "look.png").read_bytes())
    two = "newmtl a\nKd 0.5 0.25 0.125\nnewmtl b\nKd 0 0 1\n"
    assert np.allclose(obj(tmp_path, two), [[0.5, 0.25, 0.125], [0, 0, 1]], atol=0.51 / 255)
    for name in ("look.png", "-s 1 1 1 look.png", "C:\\art\\look.png"):
        colours = obj(tmp_path, f"{two}map_Kd {name}\n")
        assert np.allclose(colours[0], [0.5, 0.25, 0.125], atol=0.51 / 255)
        assert np.allclose(255 * colours[1], [10, 200, 30], atol=0.51)
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("../secret.png", "lost.png", "http://example.org/look.png"):
        assert np.allclose(obj(folder, f"{two}map_Kd {name}\n")[1], [0, 0, 1], atol=0.51 / 255)
    (folder / "a.mtl").unlink()
    (folder / "b.obj").write_text((folder / "a.obj").read_text())
    assert read(folder / "b.obj", folder).colours is None


def test_a_colour_of_the_shape_has_precedence(head):
    model = hanging_puppet(head.parent, "head.glb", ', colour: "#102030"')
    solid = shape_solid(model.puppet.bodies[0].shapes[0], 0, np.zeros(3))
    assert solid.colours is None and np.allclose(solid.colour, np.array([16, 32, 48]) / 255)


def test_each_colour_is_one_surface(head):
    """Their areas are those of the boxes; faces without material have the body's colour."""
    model = hanging_puppet(head.parent, "head.glb")
    solid = shape_solid(model.puppet.bodies[0].shapes[0], 0, np.array([1.0, 1.0, 0.0]))
    areas = {}
    for colour, surface in coloured_surfaces(solid):
        mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
        areas[tuple(np.round(255 * colour).astype(int).tolist())] = mesh.area
        assert np.allclose(
            np.sum(surface.normals[surface.faces[:, 0]] * mesh.face_normals, axis=1), 1.0
        )
    wanted = {
        tuple(np.round(255 * srgb(RED)).astype(int).tolist()): 6 * 0.0625,
        tuple(np.round(255 * srgb(BLUE)).astype(int).tolist()): 2 * 0.25 + 4 * 0.03125,
        (255, 255, 0): 6 * 0.0625**2,
    }
    assert areas == pytest.approx(wanted)


def hue(linear) -> tuple[int, int, int]:
    return tuple(np.round(255 * srgb(linear)).astype(int).tolist())


@pytest.mark.parametrize("renderer", ["matplotlib", "pyvista"])
def test_pictures_show_the_colours(head, tmp_path, renderer):
    if renderer == "pyvista":
        pytest.importorskip("pyvista")
    model = hanging_puppet(tmp_path, "head.glb")
    run = fan.simulate(model, model.rest(), t_end=0.1)
    path = tmp_path / "film.gif"
    film(model, run, path, fps=10, size=(300, 300), renderer=renderer, view=(-60, 15))
    with Image.open(path) as shown:
        pixels = np.asarray(shown.convert("RGB"))
    assert (
        count_similar_pixels(pixels, hue(RED), 60) > 300
        and count_similar_pixels(pixels, hue(BLUE), 60) > 300
    )
    assert count_similar_pixels(pixels, hue(GREEN), 30) < 100


def test_exports_carry_the_colours(head, tmp_path):
    """glTF has one material for each, which the validator and three.js know; USD has subsets."""
    model = hanging_puppet(tmp_path, "head.glb")
    run = fan.simulate(model, model.rest(), t_end=0.1)
    path = fan.export(run, tmp_path / "run.glb")
    player = Player(path)
    node = player.gltf.nodes[player.names.index("head_shape1")]
    colours = [
        player.gltf.materials[p.material].pbrMetallicRoughness.baseColorFactor[:3]
        for p in player.gltf.meshes[node.mesh].primitives
    ]
    for wanted in (RED, BLUE):
        # sRGB has 8 bits: a step of 1/255 is at most 0.009 of linear light.
        assert min(np.abs(np.array(c) - wanted).max() for c in colours) < 0.005
    assert len(colours) == 3
    # A round trip: the written file is read again.
    again = read(path, tmp_path).colours
    assert {hue(RED), hue(BLUE)} <= {
        tuple(np.round(255 * c).astype(int).tolist()) for c in np.unique(again, axis=0)
    }
    report = validated(path)["issues"]
    assert [report[f"num{kind}"] for kind in ("Errors", "Warnings")] == [0, 0], report


def test_three_js_shows_the_colours(head, tmp_path):
    model = hanging_puppet(tmp_path, "head.glb")
    run = fan.simulate(model, model.rest(), t_end=0.1)
    with three(fan.export(run, tmp_path / "run.glb")) as page:
        page.draw(0.0, (0.8, 0.7, 1.2), (0.0, 0.5, 0.0))
        pixels = picture(page.browser, "mesh_colours")
    assert (
        count_similar_pixels(pixels, hue(RED), 60) > 1000
        and count_similar_pixels(pixels, hue(BLUE), 60) > 1000
    )


def test_usd_has_a_material_for_each_colour(head, tmp_path):
    usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom, UsdShade

    model = hanging_puppet(tmp_path, "head.glb")
    run = fan.simulate(model, model.rest(), t_end=0.1)
    path = fan.export(run, tmp_path / "run.usda", fps=24)
    stage = usd.Stage.Open(str(path))
    (prim,) = [p for p in stage.Traverse() if p.GetName() == "head_shape1"]
    drawn = UsdGeom.Mesh(prim)
    n = len(drawn.GetFaceVertexCountsAttr().Get())
    shown = np.array(drawn.GetDisplayColorAttr().Get())
    assert shown.shape == (n, 3)
    parts = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    faces = np.concatenate([np.array(p.GetIndicesAttr().Get()) for p in parts])
    assert len(parts) == 3 and np.array_equal(np.sort(faces), np.arange(n))
    for part in parts:
        material, _ = UsdShade.MaterialBindingAPI(part.GetPrim()).ComputeBoundMaterial()
        shader = material.ComputeSurfaceSource()[0]
        colour = np.array(shader.GetInput("diffuseColor").Get())
        assert np.allclose(shown[np.array(part.GetIndicesAttr().Get())], colour, atol=1e-6)


def test_recordings_contain_all_files(tmp_path):
    """A .gltf with its numbers and image in a run's file, read elsewhere."""
    folder = tmp_path / "there" / "art"
    folder.mkdir(parents=True)
    writer = Writer()
    look = writer.material(image=np.full((2, 2, 3), 77, "uint8"))
    writer.node(
        writer.mesh(material=look, TEXCOORD_0=writer.numbers(np.zeros((8, 2), "float32"))),
        scale=[0.1] * 3,
    )
    writer.gltf.images[0] = gl.Image(uri="paint.png")
    Image.fromarray(np.full((2, 2, 3), 77, "uint8")).save(folder / "paint.png")
    writer.save(folder / "a.gltf")
    model = hanging_puppet(tmp_path / "there", "art/a.gltf")
    run = fan.simulate(model, model.rest(), t_end=0.05)
    run.save(tmp_path / "run.npz")
    for file in folder.iterdir():
        file.unlink()
    again = fan.Trajectory.load(tmp_path / "run.npz")
    mesh_file = again.puppet.bodies[0].shapes[0].read()
    assert set(mesh_file.linked_contents) == {"a.bin", "paint.png"}
    assert np.allclose(255 * mesh_file.colours, 77, atol=0.51)


def test_the_outline_has_the_mean_by_area(tmp_path):
    """A triangle divided into four counts as one."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    colours = np.array([[1.0, 0, 0], [0, 0, 1]])
    coarse = mesh_solid(0, np.zeros(3), vertices, np.array([[0, 1, 2], [0, 2, 3]]), colours)
    points, faces = trimesh.remesh.subdivide(vertices, np.array([[0, 1, 2]]))
    fine = mesh_solid(
        0,
        np.zeros(3),
        np.vstack([points, vertices]),
        np.vstack([faces, [[len(points) + k for k in (0, 2, 3)]]]),
        np.vstack([np.tile(colours[0], (len(faces), 1)), colours[1]]),
    )
    assert len(fine.faces) == 5
    assert np.allclose(fine.colour, coarse.colour) and np.allclose(coarse.colour, [0.5, 0, 0.5])
