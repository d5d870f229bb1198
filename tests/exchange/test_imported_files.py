"""Files of an import: readable meshes, comments and shapes; messages for mistakes."""

from __future__ import annotations

import numpy as np
import pytest
from tests.exchange.test_import_mjcf import import_text

import fantoccini as fan
from fantoccini.base.errors import ExchangeError


def test_two_imports_into_a_folder_have_meshes_of_their_own(tmp_path):
    for name, size in (("a", 0.1), ("b", 0.2)):
        text = (
            f'<mujoco model="same"><asset><mesh name="m" scale="{size} 1 1" '
            'vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody><body>'
            '<freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
        )
        import_text(text, tmp_path).save(tmp_path / f"{name}.yaml")
    for name, size in (("a", 0.1), ("b", 0.2)):
        (shape,) = fan.model.load(tmp_path / f"{name}.yaml").bodies[0].shapes
        assert fan.model.puppet.shapes.load_mesh(shape).extents[0] == pytest.approx(size, abs=1e-6)


def test_a_mesh_named_like_another_is_another(tmp_path):
    """Cylinders have their own mesh; names that differ only in case are equal on some disks."""
    corners = "0 0 0 1 0 0 0 1 0 0 0"
    names = ("cylinder", "part", "Part")
    assets = "".join(f'<mesh name="{n}" vertex="{corners} {k + 2}"/>' for k, n in enumerate(names))
    geoms = "".join(f'<geom type="mesh" mesh="{name}"/>' for name in names)
    puppet_import = import_text(
        f"<mujoco><asset>{assets}</asset><worldbody><body><freejoint/>"
        f'<geom type="cylinder" size="0.1 0.2"/>{geoms}</body></worldbody></mujoco>',
        tmp_path,
    )
    assert len({path.lower() for path in puppet_import.meshes}) == 4
    puppet_import.save(tmp_path / "a.yaml")
    shapes = fan.model.load(tmp_path / "a.yaml").bodies[0].shapes
    volumes = [fan.model.puppet.shapes.load_mesh(shape).volume for shape in shapes]
    around = 32 * np.sin(np.pi / 16) / 2
    assert np.allclose(volumes, [around * 0.1**2 * 0.4, 2 / 6, 3 / 6, 4 / 6], rtol=1e-6)


JOINT = """<mujoco><worldbody><body name="true"><joint name="a_joint_with_a_long_name" damping="1"
  axis="0.1 0.2 0.3" pos="0.1 0.2 0.3" armature="0.5" frictionloss="1" stiffness="3" springref="7"/>
  <geom size="0.1"/><body name="b"><joint frictionloss="1"/><geom size="0.1"/></body></body>
  </worldbody></mujoco>"""


def test_every_note_stands_in_the_puppet_file(tmp_path):
    """This includes notes on joints of several lines, and on names in quotes."""
    puppet_import = import_text(JOINT.replace('"0.1"/><body', '"1e7" mass="1"/><body'), tmp_path)
    assert "joint:\n" in puppet_import.text and len(puppet_import.report) == 4
    for note in puppet_import.report:
        assert puppet_import.text.count(f"{note.what}: {note.message}\n") == 1


def test_solids_that_no_puppet_has_are_left_out(tmp_path):
    """The written file can be read."""
    corners = "0 0 0 2e6 0 0 0 2e6 0 0 0 2e6"
    puppet_import = import_text(
        f'<mujoco><asset><mesh name="m" vertex="{corners}"/>'
        '<hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset><worldbody>'
        '<geom type="mesh" mesh="m"/><geom type="hfield" hfield="h"/>'
        '<geom type="box" size="1e-9 1 1"/>'
        '<body name="a"><freejoint/><geom type="mesh" mesh="m" mass="1"/>'
        '<geom type="capsule" size="1 2e6" mass="1"/><geom size="0.5"/></body>'
        "</worldbody></mujoco>",
        tmp_path,
    )
    assert not puppet_import.meshes
    (shape,) = fan.model.loads(puppet_import.text).bodies[0].shapes
    assert shape.type == "sphere" and not fan.model.loads(puppet_import.text).obstacles
    notes = "\n".join(map(str, puppet_import.report))
    assert (
        "body a: has a mesh, left out: " in notes and "body a: has a capsule, left out: " in notes
    )
    assert "geom obstacle: has a mesh, left out: " in notes
    assert "hfield: left out, has no counterpart of its kind" in notes
    assert "box: left out, has no counterpart of its size" in notes


def test_mistakes_have_the_names_of_the_model(tmp_path):
    joint = '<mujoco><worldbody><body name="a.b">\n<joint damping="{}"/><geom size="0.1"/></body>'
    text = joint + "</worldbody></mujoco>"
    with pytest.raises(ExchangeError, match=r":1: body a\.b: joint\.damping: found 1e\+1[02]"):
        import_text(text.format("1e12"), tmp_path)
    puppet = fan.model.loads(import_text(text.format("1e-30"), tmp_path).text)
    assert puppet.bodies[0].joint.damping == 0.0


def test_lost_properties_of_surfaces_are_reported(tmp_path):
    puppet_import = import_text(
        '<mujoco><asset><texture name="t" type="2d" builtin="flat" width="8" height="8"/>'
        '<material name="m" texture="t"/></asset><worldbody><body><freejoint/>'
        '<geom name="a" size="0.1" material="m"/><geom name="b" size="0.2" rgba="1 0 0 0.5"/>'
        '<geom name="c" size="0.3"/></body></worldbody></mujoco>',
        tmp_path,
    )
    assert [str(n).partition(":1: ")[2] for n in puppet_import.report if n.kind == "geom"] == [
        "geom a: has a texture, left out",
        "geom b: is transparent; here it is opaque",
    ]


def test_too_many_copies_are_refused(tmp_path):
    """The counts of nested copies are multiplied."""
    text = (
        '<mujoco><worldbody><body><freejoint/><geom size="0.1"/></body>\n'
        '<replicate count="{0}"><replicate count="{0}"><geom size="0.1"/></replicate></replicate>'
        "</worldbody></mujoco>"
    )
    with pytest.raises(ExchangeError, match=r":2: replicate: copies its content 160000 times"):
        import_text(text.format(400), tmp_path)
    assert len(fan.model.loads(import_text(text.format(3), tmp_path).text).obstacles) == 9


def test_meshes_that_mujoco_read_are_kept(tmp_path):
    (tmp_path / "a_meshes").mkdir()
    mesh_file = tmp_path / "a_meshes" / "part.stl"
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    mesh_file.write_bytes(b"mine" + fan.output.exchange.solids.stl(corners, faces)[4:])
    before = mesh_file.read_bytes()
    puppet_import = import_text(
        '<mujoco><compiler meshdir="a_meshes"/><asset><mesh file="part.stl"/></asset><worldbody>'
        '<body><freejoint/><geom type="mesh" mesh="part"/></body></worldbody></mujoco>',
        tmp_path,
    )
    with pytest.raises(ExchangeError, match=r"part\.stl: is part of the model"):
        puppet_import.save(tmp_path / "a.yaml", force=True)
    assert mesh_file.read_bytes() == before and not (tmp_path / "a.yaml").exists()
