"""Robots in URDF become puppets with the accelerations of MuJoCo and of Pinocchio."""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from benchmarks.exchange import models
from tests.exchange.test_import_mjcf import random_states

import fantoccini as fan
from fantoccini.base.errors import ExchangeError, MissingLibraryError, UnknownNameError
from fantoccini.output.exchange import ImportedPuppet, import_model
from harness import Model, State
from oracles import random_models

pytestmark = pytest.mark.medium

ROUNDING = 1e-11
"""Tolerance of accelerations, relative to the largest."""


def import_text(text: str, folder: Path) -> ImportedPuppet:
    path = folder / "robot.urdf"
    path.write_text(text)
    return import_model(path)


@pytest.mark.parametrize("seed", range(8))
def test_accelerations_are_mujocos(seed, tmp_path):
    """MuJoCo's own reader of URDF creates the model."""
    text = random_models.urdf(seed)
    puppet_import, m = import_text(text, tmp_path), mujoco.MjModel.from_xml_string(text)
    list(models.switch_off_features(m))
    assert sorted(puppet_import.joints) == sorted(m.joint(j).name for j in range(m.njnt))
    # MuJoCo's joints are in the order of its tree.
    puppet_import = ImportedPuppet(
        puppet_import.text, puppet_import.report, {}, tuple(m.joint(j).name for j in range(m.njnt))
    )
    for model, x, d, v in random_states(puppet_import, m, 2):
        acc = model.acceleration(x)
        assert np.abs(acc - d.qacc[v]).max() < ROUNDING * np.abs(d.qacc).max()


@pytest.mark.parametrize("seed", range(4))
def test_accelerations_are_pinocchios(seed, tmp_path):
    pin = pytest.importorskip("pinocchio")
    text = random_models.urdf(seed).replace("continuous", "revolute")
    puppet_import, robot = import_text(text, tmp_path), pin.buildModelFromXML(text)
    model, rng = Model.of(fan.model.loads(puppet_import.text)), np.random.default_rng(seed)
    names, none = list(robot.names)[1:], np.zeros(0)
    q, v = rng.normal(size=robot.nq), rng.normal(size=robot.nv)
    damping = {link.joint: link.damping for link in model.tree.links}
    force = -np.array([damping[name] for name in names]) * v
    wanted = pin.aba(robot, robot.createData(), q, v, force)
    order = [names.index(name) for name in model.table.v_D]
    acc = model.acceleration(State(q[order], v[order], none, none, none))
    assert np.allclose(acc, wanted[order], rtol=0, atol=ROUNDING * np.abs(wanted).max())


PLANE = """<robot name="puck">
<link name="world"/>
<link name="puck"><inertial><origin xyz="0.1 0.2 0" rpy="0.3 0 0"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0.02" ixz="0" iyz="0"/></inertial></link>
<link name="arm"><inertial><origin xyz="0 0 0.3"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="planar"><parent link="world"/><child link="puck"/>
<origin xyz="0.3 0 1"/><axis xyz="0 0 1"/></joint>
<joint name="hinge" type="continuous"><parent link="puck"/><child link="arm"/>
<axis xyz="0 1 0"/><dynamics damping="0.5"/></joint>
</robot>"""


def test_a_planar_joint_is_two_slides_and_a_hinge(tmp_path):
    """The same model is written by hand for MuJoCo."""
    puppet_import = import_text(PLANE, tmp_path)
    assert puppet_import.joints == ("slide_x", "slide_y", "slide", "hinge")
    c, s = np.cos(0.3), np.sin(0.3)
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    inertia = R @ np.array([[0.1, 0.02, 0], [0.02, 0.1, 0], [0, 0, 0.1]]) @ R.T
    full = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    m = mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody><body pos="0.3 0 1">
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
      <joint type="hinge" axis="0 0 1"/>
      <inertial pos="0.1 0.2 0" mass="2" fullinertia="{" ".join(map(repr, full.tolist()))}"/>
      <body><joint axis="0 1 0" damping="0.5"/>
      <inertial pos="0 0 0.3" mass="1" diaginertia="0.1 0.1 0.1"/></body>
      </body></worldbody></mujoco>""")
    for model, x, d, v in random_states(puppet_import, m, 2):
        acc = model.acceleration(x)
        assert np.abs(acc - d.qacc[v]).max() < ROUNDING * np.abs(d.qacc).max()


def test_a_planar_joint_is_damped_along_and_about(tmp_path):
    text = PLANE.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics damping="0.7"/>')
    puppet = fan.model.loads(import_text(text, tmp_path).text)
    assert [body.joint.damping for body in puppet.bodies] == [0.7, 0.7, 0.7, 0.5]


def test_a_material_is_known_after_its_first_visual(tmp_path):
    ball = '<visual><geometry><sphere radius="1"/></geometry><material name="red"{}</visual>'
    defined = '><color rgba="1 0 0 1"/></material>'
    text = (
        f'<robot name="r"><link name="a">{ball.format("/>")}</link>'
        f'<link name="b">{ball.format(defined)}</link>'
        f'<link name="c">{ball.format("/>")}</link>{joint("j", "fixed", "a", "b")}'
        f"{joint('k', 'fixed', 'a', 'c')}</robot>"
    )
    puppet = fan.model.loads(import_text(text, tmp_path).text)
    assert [body.shapes[0].colour for body in puppet.bodies] == ["#ff0000"] * 3


def test_meshes_of_the_model_are_kept(tmp_path):
    """They are not overwritten, even if the puppet's meshes have their names."""
    (tmp_path / "arm_meshes").mkdir()
    mesh_file = tmp_path / "arm_meshes" / "base.stl"
    mesh_file.write_bytes(b"mine" + fan.output.exchange.solids.stl(*tetrahedron())[4:])
    before = mesh_file.read_bytes()
    puppet_import = import_text(
        '<robot name="arm"><link name="a"><visual><geometry><mesh filename="arm_meshes/base.stl"/>'
        "</geometry></visual></link></robot>",
        tmp_path,
    )
    with pytest.raises(ExchangeError, match=r"base\.stl: is part of the model"):
        puppet_import.save(tmp_path / "arm.yaml", force=True)
    assert mesh_file.read_bytes() == before and not (tmp_path / "arm.yaml").exists()
    puppet_import.save(tmp_path / "other.yaml")


def test_a_mesh_too_large_with_its_scale_is_left_out(tmp_path):
    (tmp_path / "a.stl").write_bytes(fan.output.exchange.solids.stl(*tetrahedron()))
    visual = '<visual><geometry><mesh filename="a.stl" scale="{} 1 1"/></geometry></visual>'
    puppet_import = import_text(
        f'<robot name="r"><link name="a">{visual.format(1e7)}{visual.format(2)}</link></robot>',
        tmp_path,
    )
    (note,) = puppet_import.report
    assert "link a: has a mesh, left out: r_meshes/a.stl measures 1e+07 m" in str(note)
    puppet_import.save(tmp_path / "r.yaml")
    (shape,) = fan.model.load(tmp_path / "r.yaml").bodies[0].shapes
    assert shape.scale == (2.0, 1.0, 1.0)


def test_a_floating_joint_is_a_free_one(tmp_path):
    text = PLANE.replace('type="planar"', 'type="floating"').replace('<axis xyz="0 0 1"/>', "")
    puppet_import = import_text(text.replace("damping", "friction"), tmp_path)
    puppet = fan.model.loads(puppet_import.text)
    assert puppet.bodies[0].joint.type == "free"
    assert [str(n).partition(": ")[2] for n in puppet_import.report] == [
        "joint hinge: has friction, left out"
    ]


REST = """<robot name="arm">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="base"><visual><geometry><box size="0.1 0.1 0.2"/></geometry></visual></link>
  <link name="arm">
    <inertial><mass value="1"/>
      <inertia ixx="0.1" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><origin xyz="0 0 0.1"/><geometry><cylinder radius="0.1" length="0.4"/></geometry>
      <material name="blue"/></visual>
    <visual><geometry><mesh filename="package://thing/meshes/a.stl" scale="2 2 2"/></geometry>
      </visual>
    <visual><geometry><mesh filename="package://thing/meshes/none.stl"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/b.dae"/></geometry></visual>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="finger 1"><inertial><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="arm" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="5" velocity="1"/></joint>
  <joint name="grip" type="prismatic"><parent link="arm"/><child link="finger 1"/>
    <mimic joint="arm" multiplier="-1"/><dynamics friction="1"/></joint>
  <transmission name="drive"><type>simple</type></transmission>
  <gazebo reference="arm"><mu1>0.2</mu1></gazebo>
</robot>"""


def test_the_report_names_parts_without_a_counterpart(tmp_path):
    folder = tmp_path / "thing"
    for name in ("urdf", "meshes"):
        (folder / name).mkdir(parents=True)
    mesh = fan.output.exchange.solids.stl(*tetrahedron())
    (folder / "meshes" / "a.stl").write_bytes(mesh)
    puppet_import = import_text(REST, folder / "urdf")
    file = folder / "urdf" / "robot.urdf"
    assert [str(note).removeprefix(f"{file}:") for note in puppet_import.report] == [
        "4: link arm: has the principal moments 0.02, 0.03 and 0.1 kg m^2; here the largest is the "
        "sum of the others, 0.05: no solid has more",
        "4: link arm: has the mesh 'package://thing/meshes/none.stl', left out: it is not there",
        "4: link arm: has the mesh 'meshes/b.dae', left out: it is not there",
        "15: link finger 1: is called finger_1 here",
        "17: joint arm: has limits of effort and velocity, left out: it has no motor",
        "19: joint grip: has friction, left out",
        "19: joint grip: mimics 'arm'; here it moves freely",
        "21: transmission drive: left out: joints move freely",
        "22: gazebo arm: left out",
    ]
    puppet_import.save(tmp_path / "arm.yaml")
    puppet = fan.model.load(tmp_path / "arm.yaml")
    base, arm, finger = puppet.bodies
    assert base.joint.type == "fixed" and arm.joint.name is None and finger.joint.name == "grip"
    assert arm.joint.limits.upper == 2.0 and arm.inertia == (0.05, 0.02, 0.03)
    rod, solid = arm.shapes
    assert rod.colour == "#0000ff" and rod.at == (0.0, 0.0, 0.1)
    assert np.allclose(fan.model.puppet.shapes.load_mesh(solid).extents, [2.0, 2.0, 2.0])
    assert sorted(puppet_import.meshes) == ["arm_meshes/a.stl", "arm_meshes/cylinder.stl"]


@pytest.mark.parametrize("ending", ["glb", "dae", "obj", "ply"])
def test_meshes_of_all_formats(ending, tmp_path):
    size = np.array([0.1, 0.2, 0.4])
    box = trimesh.creation.box(size)
    if ending in ("glb", "dae"):  # with y up
        box.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    exported = box.export(file_type=ending)
    (tmp_path / f"box.{ending}").write_bytes(
        exported.encode() if isinstance(exported, str) else exported
    )
    puppet_import = import_text(
        '<robot name="r"><link name="a"><visual><geometry>'
        f'<mesh filename="package://r/box.{ending}"/></geometry></visual></link></robot>',
        tmp_path,
    )
    assert not puppet_import.report
    puppet_import.save(tmp_path / "r.yaml")
    (body,) = fan.model.load(tmp_path / "r.yaml").bodies
    assert np.allclose(fan.model.puppet.shapes.load_mesh(body.shapes[0]).extents, size, atol=1e-7)


def tetrahedron() -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    return corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


LINKS = '<robot name="r">\n<link name="a"/>\n<link name="b"/>\n'


def joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>\n'


WRONG = {
    "no name": ("<robot>\n<link/>", ":2: link: name is missing"),
    "no numbers": (
        LINKS + joint("j", "fixed", "a", "b", '<origin xyz="1 2 x"/>'),
        ":4: origin: xyz: found '1 2 x'; needed: 3 finite numbers",
    ),
    "a unit": (
        '<robot name="r">\n<link name="a"><inertial><mass value="1kg"/></inertial></link>',
        ":2: mass: value: found '1kg'; needed: 1 finite number",
    ),
    "a twin": (LINKS + '<link name="a"/>', ":4: link: 'a' occurs already, in line 2"),
    "an unknown link": (
        LINKS + joint("j", "fixed", "a", "c"),
        ":4: joint j: no link is called 'c'",
    ),
    "an unknown type": (
        LINKS + joint("j", "ball", "a", "b"),
        ":4: joint j: found the type 'ball'; allowed: revolute",
    ),
    "two parents": (
        LINKS + joint("j", "fixed", "a", "b") + joint("k", "fixed", "a", "b"),
        ":5: joint k: 'b' is carried by 'j' already",
    ),
    "a circle": (
        LINKS + joint("j", "fixed", "a", "b") + joint("k", "fixed", "b", "a"),
        ":4: joint j: carries itself",
    ),
    "no child": (LINKS + '<joint name="j" type="fixed"><parent link="a"/></joint>', "<child>"),
    "a solid of another kind": (
        '<robot name="r">\n<link name="a"><visual>\n<geometry><cone/></geometry></visual></link>',
        ":3: geometry: found cone",
    ),
    "no mass": (
        LINKS + joint("j", "continuous", "a", "b"),
        ":3: link b: joint: this joint moves no mass",
    ),
    "no axis": (
        LINKS + joint("j", "continuous", "a", "b", '<axis xyz="0 0 0"/>'),
        ":4: joint j: found an axis of zero length",
    ),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_file_is_a_located_mistake(text, message, tmp_path):
    with pytest.raises(ExchangeError) as caught:
        import_text(f"{text}</robot>", tmp_path)
    assert str(caught.value).startswith(str(tmp_path / "robot.urdf"))
    assert message in str(caught.value)


def test_urdf_has_no_keyframes(tmp_path):
    (tmp_path / "robot.urdf").write_text(PLANE)
    with pytest.raises(UnknownNameError, match="no keyframe is called 'home'"):
        import_model(tmp_path / "robot.urdf", keyframe="home")


def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "yourdfpy", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'fantoccini\[urdf\]'"):
        import_text(PLANE, tmp_path)


BULLET = ("kuka_iiwa/model.urdf", "franka_panda/panda.urdf", "a1/a1.urdf", "laikago/laikago.urdf")


@pytest.mark.parametrize("name", BULLET)
def test_real_robots_agree_with_pinocchio(name, tmp_path):
    """Robots of `pybullet`, with their first link fixed."""
    pin, data = pytest.importorskip("pinocchio"), pytest.importorskip("pybullet_data")
    path = Path(data.getDataPath()) / name
    puppet_import, robot = import_model(path), pin.buildModelFromUrdf(str(path))
    puppet_import.save(tmp_path / "robot.yaml")
    model = Model.of(fan.model.load(tmp_path / "robot.yaml"))
    rng, none = np.random.default_rng(0), np.zeros(0)
    names = list(robot.names)[1:]
    q, v = pin.neutral(robot), rng.normal(size=robot.nv)
    q = pin.integrate(robot, q, rng.uniform(-1.0, 1.0, robot.nv))
    angles = [_angle(robot.joints[i + 1], q) for i in range(robot.nv)]
    damping = {link.joint: link.damping for link in model.tree.links}
    force = -np.array([damping[n] for n in names]) * v
    wanted = pin.aba(robot, robot.createData(), q, v, force)
    order = [names.index(n) for n in model.table.v_D]
    x = State(np.array(angles)[order], v[order], none, none, none)
    acc = model.acceleration(x)
    assert np.allclose(acc, wanted[order], rtol=0, atol=1e-9 * np.abs(wanted).max())


def _angle(joint, q: np.ndarray) -> float:
    """A joint's coordinate; continuous joints have cosine and sine."""
    own = q[joint.idx_q : joint.idx_q + joint.nq]
    return float(own[0]) if joint.nq == 1 else float(np.arctan2(own[1], own[0]))


BALL = '<geometry><sphere radius="0.1"/></geometry>'
INERTIA = (
    '<inertial><mass value="2"/><inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="{1}" ixz="{1}" '
    'iyz="{1}"/></inertial>'
)


def hinged_robot(inside: str, base: str = "", head: str = "") -> str:
    """A link on a hinge of another link."""
    return (
        f'<robot name="r" {head}>\n<link name="a">{base}</link>\n<link name="b">{inside}</link>\n'
        + joint("j", "continuous", "a", "b", '<axis xyz="0 1 0"/>')
        + "</robot>"
    )


WITH = INERTIA.format(0.1, 0)
LEFT_OVER = {
    "a macro in a visual": (f"<visual>{BALL}<xacro:material_black/></visual>", "<xacro:material_"),
    "a block in a visual": (f'<visual>{BALL}<xacro:insert_block name="o"/></visual>', "<xacro:ins"),
    "with more inside": (
        f"<visual>{BALL}<xacro:if value='1'><origin/></xacro:if></visual>",
        "<xacro:if>",
    ),
    "a macro in a collision": (
        f"<visual>{BALL}</visual><collision>{BALL}<xacro:c/></collision>",
        "<xacro:c>",
    ),
    "an empty visual": (f"<visual/><visual>{BALL}</visual>", "has an empty visual, left out"),
    "a visual of an origin": (f"<visual><origin/></visual><visual>{BALL}</visual>", "empty visual"),
    "an empty geometry": (f"<visual><geometry/></visual><visual>{BALL}</visual>", "empty visual"),
    "a geometry of a comment": (
        f"<visual><geometry><!-- a --></geometry></visual><visual>{BALL}</visual>",
        "empty visual",
    ),
    "a geometry of a macro": (
        f"<visual><geometry><xacro:g/></geometry></visual><visual>{BALL}</visual>",
        "<xacro:g>",
    ),
    "an empty collision": (f"<collision/><visual>{BALL}</visual>", "has an empty collision"),
    "an empty collision beside another": (
        f"<collision/><collision>{BALL}</collision>",
        "has an empty collision",
    ),
    "a capsule beside a visual": (
        f"<visual>{BALL}</visual><collision><geometry><capsule "
        'radius="1" length="2"/></geometry></collision>',
        "",
    ),
}


@pytest.mark.parametrize("head", ["", 'xmlns:xacro="http://www.ros.org/wiki/xacro"'])
@pytest.mark.parametrize(("inside", "says"), LEFT_OVER.values(), ids=LEFT_OVER)
def test_empty_and_surplus_parts_of_a_solid_are_left_out_with_a_note(inside, says, head, tmp_path):
    puppet_import = import_text(hinged_robot(WITH + inside, head=head), tmp_path)
    (ball,) = fan.model.loads(puppet_import.text).bodies[1].shapes
    assert ball.radius == 0.1
    notes = [note for note in puppet_import.report if says in str(note)]
    assert (notes and notes[0].line == 3) if says else not puppet_import.report


def test_declarations_of_xacro_are_no_parts(tmp_path):
    declared = (
        '<xacro:property name="x" value="1"/><xacro:arg name="y" default="2"/>'
        '<xacro:macro name="leg"><link name="c"/></xacro:macro>'
    )
    puppet_import = import_text(
        hinged_robot(WITH).replace("<link", f"{declared}<link", 1), tmp_path
    )
    assert len(fan.model.loads(puppet_import.text).bodies) == 2


@pytest.mark.parametrize(
    "text",
    [
        hinged_robot(WITH).replace("<link", "<xacro:leg/><link", 1),
        hinged_robot(WITH).replace("<link", '<xacro:include filename="a"/><link', 1),
        hinged_robot(f"<xacro:inertia/><visual>{BALL}</visual>"),
        hinged_robot(WITH).replace("<axis", "<xacro:limits/><axis"),
        hinged_robot(WITH.replace("<mass", "<xacro:m/><mass")),
    ],
)
def test_a_macro_that_may_be_a_part_is_refused(text, tmp_path):
    with pytest.raises(ExchangeError, match="run xacro on the file first"):
        import_text(text, tmp_path)


def test_a_capsule_is_a_capsule(tmp_path):
    solid = (
        '<{0}><origin xyz="1 2 3" rpy="0 1.5707963267948966 0"/><geometry>'
        '<capsule radius="0.1" length="0.6"/></geometry></{0}>'
    )
    for kind in ("visual", "collision"):
        puppet_import = import_text(
            hinged_robot(WITH + f"<{kind}/>" + 2 * solid.format(kind)), tmp_path
        )
        for shape in fan.model.loads(puppet_import.text).bodies[1].shapes:
            assert shape.radius == 0.1
            np.testing.assert_allclose(shape.from_, [0.7, 2, 3], atol=1e-12)
            np.testing.assert_allclose(shape.to, [1.3, 2, 3], atol=1e-12)


@pytest.mark.parametrize("number", [1e-9, 0.001, 0.3, 1.0, 7.7, 1e4])
def test_six_equal_numbers_are_three_moments(number, tmp_path):
    puppet_import = import_text(hinged_robot(INERTIA.format(number, number)), tmp_path)
    assert fan.model.loads(puppet_import.text).bodies[1].inertia == (number,) * 3
    (note,) = puppet_import.report
    assert "here it has its moments alone" in note.message and note.line == 3


@pytest.mark.parametrize("products", [(0.5, 0.0, 0.0), (0.2, 0.2, 0.2), (-0.1, 0.1, -0.1)])
def test_products_that_no_solid_has_are_left_out(products, tmp_path):
    text = INERTIA.format(0.1, 0)
    for key, value in zip(("ixy", "ixz", "iyz"), products, strict=True):
        text = text.replace(f'{key}="0"', f'{key}="{value}"')
    puppet_import = import_text(hinged_robot(text), tmp_path)
    inertia = np.array(fan.model.loads(puppet_import.text).bodies[1].inertia)
    assert np.allclose(inertia, 0.1) and "products of inertia" in str(puppet_import.report)


@pytest.mark.parametrize(
    "name",
    [
        "file://{}",
        "file://localhost{}",
        "package://r/my%20box.stl",
        "my%20box.stl",
        "my box.stl",
        "file://my%20box.stl",
    ],
)
def test_a_uri_may_have_spaces_as_percent_20(name, tmp_path):
    folder = tmp_path / "a folder"
    folder.mkdir()
    (folder / "my box.stl").write_bytes(trimesh.creation.box().export(file_type="stl"))
    uri = name.format(str(folder / "my box.stl").replace(" ", "%20"))
    puppet_import = import_text(
        hinged_robot(f'{WITH}<visual><geometry><mesh filename="{uri}"/></geometry></visual>'),
        folder,
    )
    assert not puppet_import.report and len(puppet_import.meshes) == 1


def test_masses_of_links_without_inertia_are_those_of_their_solids(tmp_path):
    """This applies if a joint would move no mass, or if a density is given."""
    solids = (
        '<visual><origin xyz="0 0 0.3"/><geometry><box size="0.1 0.2 0.3"/></geometry></visual>'
        f'<visual><origin xyz="0 0 -0.1"/>{BALL}</visual>'
    )
    volumes = 0.006, 4 / 3 * np.pi * 1e-3
    for density in (None, 500.0):
        (tmp_path / "r.urdf").write_text(hinged_robot(solids, f"<visual>{BALL}</visual>"))
        puppet_import = import_model(tmp_path / "r.urdf", density=density)
        base, body = fan.model.loads(puppet_import.text).bodies
        own = density or 1000.0
        assert body.mass == pytest.approx(own * sum(volumes), rel=1e-12)
        com = (0.3 * volumes[0] - 0.1 * volumes[1]) / sum(volumes)
        np.testing.assert_allclose(body.com, [0, 0, com], atol=1e-12)
        by_hand = own * (
            volumes[0] * ((0.2**2 + 0.3**2) / 12 + (0.3 - com) ** 2)
            + volumes[1] * (0.4 * 0.01 + (0.1 + com) ** 2)
        )
        assert body.inertia[0] == pytest.approx(by_hand, rel=1e-12)
        notes = [str(note) for note in puppet_import.report if "has no inertia" in note.message]
        assert len(notes) == 2 and f"at {own:g} kg/m^3 (--density)" in notes[1]
        assert base.mass == pytest.approx(own * volumes[1])


def test_links_without_inertia_stay_light_if_every_joint_moves_mass(tmp_path):
    text = hinged_robot(WITH + f"<visual>{BALL}</visual>", f"<visual>{BALL}</visual>")
    puppet_import = import_text(text, tmp_path)
    assert not puppet_import.report and fan.model.loads(puppet_import.text).bodies[0].mass is None


def test_the_mass_of_an_open_mesh_is_that_of_its_convex_hull(tmp_path):
    corners, faces = tetrahedron()
    (tmp_path / "a.stl").write_bytes(fan.output.exchange.solids.stl(corners, faces[1:]))
    visual = '<visual><geometry><mesh filename="a.stl" scale="0.1 0.1 0.1"/></geometry></visual>'
    puppet_import = import_text(hinged_robot(visual), tmp_path)
    puppet_import.save(tmp_path / "r.yaml")
    body = fan.model.load(tmp_path / "r.yaml").bodies[1]
    assert body.mass == pytest.approx(1000 / 6 * 1e-3) and len(body.shapes) == 1
    np.testing.assert_allclose(body.com, [0.025] * 3, rtol=1e-6)
    assert "counts as its convex hull" in str(puppet_import.report)


def test_a_density_is_positive_and_of_urdf(tmp_path):
    (tmp_path / "r.urdf").write_text(hinged_robot(f"<visual>{BALL}</visual>"))
    for density in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(fan.errors.StateError, match="the density is"):
            import_model(tmp_path / "r.urdf", density=density)
    (tmp_path / "r.xml").write_text("<mujoco><worldbody><body><geom/></body></worldbody></mujoco>")
    with pytest.raises(fan.errors.StateError, match="density applies to URDF"):
        import_model(tmp_path / "r.xml", density=1000.0)
