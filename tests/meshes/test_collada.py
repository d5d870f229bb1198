"""COLLADA as shapes: units, axes, instances of nodes, colours."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.meshes.test_gltf import box_properties, mesh
from tests.meshes.written import CORNERS, CUBE, UP, puppet

from fantoccini.base.errors import MissingLibraryError
from fantoccini.model.meshes import read
from fantoccini.model.puppet import loads
from fantoccini.model.puppet.shapes import shape_inertia


def dae(nodes: str, asset: str = "<up_axis>Z_UP</up_axis>", library: str = "") -> str:
    """A file with two unit cubes ``g0`` (triangles) and ``g1`` (quadrilaterals), of material m."""
    numbers = " ".join(str(x) for x in CORNERS.ravel())
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    flat = " ".join(str(k) for q in quads for k in q)
    triangles = " ".join(str(k) for k in CUBE.ravel())
    kinds = [
        f"<triangles count='12' material='m'><input semantic='VERTEX' source='#vK' offset='0'/>"
        f"<p>{triangles}</p></triangles>",
        f"<polylist count='6' material='m'><input semantic='VERTEX' source='#vK' offset='0'/>"
        f"<vcount>4 4 4 4 4 4</vcount><p>{flat}</p></polylist>",
    ]
    geometries = "".join(
        f"<geometry id='g{k}'><mesh><source id='s{k}'><float_array id='f{k}' count='24'>{numbers}"
        f"</float_array><technique_common><accessor source='#f{k}' count='8' stride='3'>"
        "<param name='X' type='float'/><param name='Y' type='float'/>"
        "<param name='Z' type='float'/></accessor></technique_common></source>"
        f"<vertices id='v{k}'><input semantic='POSITION' source='#s{k}'/></vertices>"
        f"{kind.replace('vK', f'v{k}')}</mesh></geometry>"
        for k, kind in enumerate(kinds)
    )
    return (
        '<?xml version="1.0" encoding="utf-8"?><COLLADA xmlns="http://www.collada.org/2005/11/'
        f'COLLADASchema" version="1.4.1"><asset>{asset}</asset>'
        "<library_effects><effect id='e'><profile_COMMON><technique sid='t'><lambert><diffuse>"
        "<color>0.8 0.4 0.2 1</color></diffuse></lambert></technique></profile_COMMON></effect>"
        "</library_effects><library_materials><material id='m1'><instance_effect url='#e'/>"
        f"</material></library_materials><library_geometries>{geometries}</library_geometries>"
        f"<library_nodes>{library}</library_nodes>"
        f"<library_visual_scenes><visual_scene id='s'>{nodes}</visual_scene>"
        '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )


BOUND = (
    "<bind_material><technique_common><instance_material symbol='m' target='#m1'/>"
    "</technique_common></bind_material>"
)


@pytest.mark.parametrize(
    ("asset", "unit", "up"),
    [
        ("<up_axis>Z_UP</up_axis>", 1.0, np.eye(3)),
        ("<unit name='centimeter' meter='0.01'/><up_axis>Y_UP</up_axis>", 0.01, UP),
        ("<unit name='inch' meter='0.0254'/>", 0.0254, UP),  # y is up by default
        # For X_UP, minus y is right, and z points towards the viewer.
        ("<up_axis>X_UP</up_axis>", 1.0, np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])),
    ],
)
def test_units_and_axes_become_metres_and_z(tmp_path, asset, unit, up):
    """Three nodes, one in another, one an instance that mirrors; closed forms."""
    nodes = (
        "<node><translate>1 2 3</translate><scale>1 2 0.5</scale>"
        "<instance_geometry url='#g0'/>"
        "<node><translate>3 0 0</translate><instance_geometry url='#g1'/></node></node>"
        "<node><matrix>-1 0 0 0  0 1 0 5  0 0 1 0  0 0 0 1</matrix>"
        "<instance_node url='#part'/></node>"
    )
    part = (
        "<node id='part'><translate>4 0 0</translate><rotate>0 0 1 90</rotate>"
        "<scale>1 3 1</scale><instance_geometry url='#g1'/></node>"
    )
    (tmp_path / "a.dae").write_text(dae(nodes, asset, part))
    scale, at = np.diag([1.0, 2.0, 0.5]), np.array([1.0, 2.0, 3.0])
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    mirror = np.diag([-1.0, 1.0, 1.0])
    maps = [
        (scale, at),
        (scale, scale @ [3.0, 0.0, 0.0] + at),
        (mirror @ quarter @ np.diag([1.0, 3.0, 1.0]), np.array([-4.0, 5.0, 0.0])),
    ]
    volume, com, about = box_properties([(unit * up @ A, unit * up @ b) for A, b in maps])
    mass, unit_inertia = shape_inertia(mesh(tmp_path, "a.dae"))
    # pycollada has numbers in single precision.
    assert mass == pytest.approx(volume, rel=1e-6)
    np.testing.assert_allclose(unit_inertia.com, com, rtol=1e-6, atol=1e-6 * unit)
    np.testing.assert_allclose(unit_inertia.inertia, about, rtol=1e-5, atol=1e-6 * unit**2)


def test_colours_are_those_of_the_materials(tmp_path):
    """One node has a material and the other has none."""
    nodes = (
        f"<node><instance_geometry url='#g0'>{BOUND}</instance_geometry></node>"
        "<node><translate>3 0 0</translate><instance_geometry url='#g1'/></node>"
    )
    (tmp_path / "a.dae").write_text(dae(nodes))
    file = read(tmp_path / "a.dae", tmp_path)
    right = file.vertices[file.faces].mean(axis=1)[:, 0] > 1.5
    assert np.allclose(file.colours[~right], [0.8, 0.4, 0.2], atol=0.5 / 255)
    assert np.isnan(file.colours[right]).all() and right.sum() == 12


CLEAR = {
    "": set(),
    "<transparent><color>1 1 1 1</color></transparent>": set(),
    "<transparency><float>0</float></transparency>": set(),  # some write only one
    "<transparent><color>1 1 1 0.5</color></transparent>": {"transparency"},
    "<transparent><color>1 1 1 1</color></transparent><transparency><float>0.5</float>"
    "</transparency>": {"transparency"},
    "<transparent opaque='RGB_ZERO'><color>0 0 0 1</color></transparent>"
    "<transparency><float>1</float></transparency>": set(),
    "<transparent opaque='RGB_ZERO'><color>0 0.5 0 1</color></transparent>"
    "<transparency><float>1</float></transparency>": {"transparency"},
}


@pytest.mark.parametrize(("more", "lost"), CLEAR.items(), ids=range(len(CLEAR)))
def test_transparency_is_known(more, lost, tmp_path):
    text = dae(f"<node><instance_geometry url='#g0'>{BOUND}</instance_geometry></node>")
    (tmp_path / "a.dae").write_text(text.replace("</diffuse>", f"</diffuse>{more}"))
    assert read(tmp_path / "a.dae", tmp_path).lost == lost


def textured(folder: Path, name: str) -> np.ndarray:
    """Colours of a square with its left and right half on an image of this name."""
    import collada
    from collada import material, scene, source

    document = collada.Collada()
    image = material.CImage("i", name)
    surface = material.Surface("sf", image)
    sampler = material.Sampler2D("sm", surface)
    effect = material.Effect(
        "e", [surface, sampler], "lambert", diffuse=material.Map(sampler, "UV")
    )
    own = material.Material("m1", "m1", effect)
    document.effects.append(effect)
    document.materials.append(own)
    document.images.append(image)
    corners = np.array([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0], float)
    uv = np.array([0.0, 0.6, 0.4, 0.6, 0.4, 0.9, 0.6, 0.1, 0.9, 0.1, 0.9, 0.4])
    geometry = collada.geometry.Geometry(
        document,
        "g",
        "g",
        [
            source.FloatSource("p", corners, ("X", "Y", "Z")),
            source.FloatSource("t", uv, ("S", "T")),
        ],
    )
    inputs = source.InputList()
    inputs.addInput(0, "VERTEX", "#p")
    inputs.addInput(1, "TEXCOORD", "#t", set="0")
    indices = np.array([0, 0, 1, 1, 2, 2, 0, 3, 2, 4, 3, 5])
    geometry.primitives.append(geometry.createTriangleSet(indices, inputs, "m"))
    document.geometries.append(geometry)
    bound = scene.GeometryNode(geometry, [scene.MaterialNode("m", own, inputs=[])])
    document.scenes.append(scene.Scene("s", [scene.Node("n", children=[bound])]))
    document.scene = document.scenes[0]
    document.write(str(folder / "t.dae"))
    return read(folder / "t.dae", folder).colours


def test_an_image_colours_its_triangles(tmp_path):
    """The upper left is red and the lower right blue: v points up."""
    pixels = np.zeros((8, 8, 3), "uint8")
    pixels[:4, :4], pixels[4:, 4:] = [200, 0, 0], [0, 0, 100]
    Image.fromarray(pixels).save(tmp_path / "look.png")
    for name in ("look.png", "./look.png", "file:///C:/art/look.png", "..\\art\\look.png"):
        assert np.allclose(255.0 * textured(tmp_path, name), [[200, 0, 0], [0, 0, 100]], atol=0.5)
    assert read(tmp_path / "t.dae", tmp_path).lost == {"textures"}
    assert textured(tmp_path, "lost.png") is None


def test_a_missing_pycollada_is_named(tmp_path, monkeypatch):
    (tmp_path / "a.dae").write_text(dae(""))
    monkeypatch.setitem(sys.modules, "collada", None)
    with pytest.raises(MissingLibraryError, match=r"a.dae needs pycollada.*fantoccini\[dae\]"):
        loads(puppet("{type: mesh, file: a.dae}"), folder=tmp_path)
