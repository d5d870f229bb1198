"""Twins are mirror images, and the image of an image equals the original."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation
from tests.puppet.strategies import bodies, files, joints, quaternions

from fantoccini import puppets
from fantoccini.base.documents import Orientation
from fantoccini.base.documents.located import Located, validate
from fantoccini.model.puppet import Attachment, Joint, Mesh, Puppet, load, loads
from fantoccini.model.puppet.dump import plain
from fantoccini.model.puppet.elements import Body
from fantoccini.model.puppet.mirror import SIGNS, Reflection, reflected
from fantoccini.model.puppet.shapes import shape_inertia

planes = st.sampled_from(sorted(SIGNS))


def reflection(plane: str) -> np.ndarray:
    """Reflection matrix S (3, 3) of a plane."""
    return np.diag([float(s) for s in SIGNS[plane]])


@settings(max_examples=60, deadline=None)
@given(bodies(), planes)
def test_reflecting_twice_changes_nothing(body: dict, plane: str) -> None:
    body = plain(Body(**body))
    to_right, back = Reflection(plane, "left", "right"), Reflection(plane, "right", "left")
    twin = to_right.body(body)
    assert twin["name"] == "a_right"
    assert back.body(twin) == body
    assert not to_right.findings


@settings(max_examples=60, deadline=None)
@given(files(), st.data())
def test_twins_start_as_mirror_images(data: dict, draw) -> None:
    puppet = validate(Puppet, Located(data))
    if puppet.mirror is None:
        return
    full = plain(puppet.expanded())
    back = full | {"mirror": {"plane": data["mirror"]["plane"], "from": "right", "to": "left"}}
    again, _ = reflected(back)
    assert full.get("pose") == again.get("pose")
    twins = {b["name"]: b for b in again["bodies"]}
    assert all(twins[b["name"]] == b for b in full["bodies"])


def motion(joint: Joint, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and position (3,) that a joint gives its body, in the parent's frame."""
    R = np.eye(3) if joint.orientation is None else joint.orientation.matrix
    turn, move = np.eye(3), np.zeros(3)
    match joint.type:
        case "revolute":
            turn = Rotation.from_rotvec(q[0] * np.array(joint.axis)).as_matrix()
        case "prismatic":
            move = q[0] * np.array(joint.axis)
        case "translation":
            move = np.array([q["xyz".index(a)] if a in joint.axes else 0.0 for a in "xyz"])
        case "ball" | "free":
            turn = Rotation.from_quat(q[3:], scalar_first=True).as_matrix()
            move = q[:3] if joint.type == "free" else move
    return R @ turn, np.array(joint.at) + R @ move


@settings(max_examples=100, deadline=None)
@given(joints(), planes, quaternions, st.floats(-2, 2))
def test_mirrored_coordinates_give_mirrored_motion(joint, plane, quaternion, x) -> None:
    S = reflection(plane)
    reflection_of_plane = Reflection(plane, "left", "right")
    original = Joint(**joint)
    twin = Joint(**reflection_of_plane.joint(plain(original)))
    q = np.array([x, 0.5 * x, 0.2 - x, *quaternion])
    place = q[:3] if joint["type"] in ("revolute", "prismatic") else S @ q[:3]
    q_twin = np.array([*place, *reflection_of_plane.rotation(list(quaternion))])
    R, p = motion(original, q)
    R_twin, p_twin = motion(twin, q_twin)
    np.testing.assert_allclose(R_twin, S @ R @ S, atol=1e-12)
    np.testing.assert_allclose(p_twin, S @ p, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(joints(kind="ball"), planes, quaternions)
def test_cones_and_twists_are_mirrored(joint: dict, plane: str, quaternion: list) -> None:
    reflection_of_plane = Reflection(plane, "left", "right")
    original = Joint(**joint)
    twin = Joint(**reflection_of_plane.joint(plain(original)))

    def limits(joint: Joint, quaternion: list) -> list[float]:
        R = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
        twist = 2 * np.arctan2(np.dot(quaternion[1:], joint.twist.axis), quaternion[0])
        swing = np.dot(joint.cone.axis, R @ np.array(joint.cone.of)) - np.cos(joint.cone.max)
        return [swing, twist - joint.twist.lower, joint.twist.upper - twist]

    quaternion[0] = abs(quaternion[0]) + 0.1  # not half a turn, where the twist changes its sign
    swing, above_lower, below_upper = limits(original, quaternion)
    values = limits(twin, reflection_of_plane.rotation(quaternion))
    np.testing.assert_allclose(values, [swing, below_upper, above_lower], atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(bodies(), planes)
def test_inertia_is_mirrored(body: dict, plane: str) -> None:
    S = reflection(plane)
    original = Body(**body)
    twin = Body(**Reflection(plane, "left", "right").body(plain(original)))
    for shape, twin_shape in zip(original.shapes, twin.shapes, strict=True):
        (v1, u1), (v2, u2) = shape_inertia(shape), shape_inertia(twin_shape)
        assert v1 == v2
        np.testing.assert_allclose(u2.com, S @ u1.com, atol=1e-15)
        np.testing.assert_allclose(u2.inertia, S @ u1.inertia @ S, atol=1e-12)
    if original.inertia and len(original.inertia) == 6:
        matrices = []
        for xx, yy, zz, xy, xz, yz in (original.inertia, twin.inertia):
            matrices.append(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        np.testing.assert_allclose(matrices[1], S @ matrices[0] @ S)


def test_a_mesh_is_mirrored(tmp_path, monkeypatch) -> None:
    trimesh = pytest.importorskip("trimesh")
    cone = trimesh.creation.cone(0.1, 0.3)
    cone.apply_transform(trimesh.transformations.euler_matrix(0.3, 0.4, 0.5))
    cone.export(tmp_path / "cone.stl")
    monkeypatch.chdir(tmp_path)
    turn = Orientation(rpy=(0.1, 0.2, 0.3))
    mesh = Mesh(file="cone.stl", scale=(1, 2, 3), at=(0.1, 0.2, 0.3), orientation=turn, mass=1)
    for plane in SIGNS:
        S = reflection(plane)
        twin = Mesh(**Reflection(plane, "left", "right").shape(plain(mesh)))
        (v1, u1), (v2, u2) = shape_inertia(mesh), shape_inertia(twin)
        assert v1 == pytest.approx(v2, rel=1e-12)
        np.testing.assert_allclose(u2.com, S @ u1.com, atol=1e-9)
        np.testing.assert_allclose(u2.inertia, S @ u1.inertia @ S, atol=1e-9)


TEXT = """\
puppet: p
mirror: {plane: xz, from: left, to: right}
bodies:
  - name: trunk
    mass: 1
  - name: arm_left
    parent: trunk
    joint: {name: shoulder_left, type: revolute, axis: [1, 0, 0], at: [0, 0.1, 0]}
    mass: 1
    inertia: [1, 1, 1]
  - name: hand_right
    parent: arm_right
strings:
  - name: lift_left
    path: [{body: arm_left, at: [0, 0.2, 0]}, {driven: [x, y], at: [0, 0.3, 1]}]
    length: driven
  - name: back
    path: [{body: trunk, at: [0, 0.2, 0]}, {body: arm_right}, {world: [0, 0.3, 1]}]
    length: 2
springs:
  - {name: k_left, between: [{body: trunk}, {body: arm_left}], stiffness: 1, rest: 0.1}
pose: {shoulder_left: 0.5, lift_left.length: 1, shoulder_right: 0.25}
"""


def test_parts_whose_name_has_the_side_get_a_twin() -> None:
    puppet = loads(TEXT, "p.yaml")
    full = puppet.expanded()
    assert [b.name for b in full.bodies] == ["trunk", "arm_left", "hand_right", "arm_right"]
    assert [s.name for s in full.strings] == ["lift_left", "back", "lift_right"]
    twin = full.bodies[3]
    assert (twin.parent, twin.joint.name) == ("trunk", "shoulder_right")
    assert twin.joint.axis == (-1.0, 0.0, 0.0)
    assert twin.joint.at == (0.0, -0.1, 0.0)
    assert full.strings[2].path == (
        Attachment(body="arm_right", at=(0, -0.2, 0)),
        Attachment(driven=("x", "y"), at=(0, -0.3, 1)),
    )
    assert [a.body for a in full.springs[1].between] == ["trunk", "arm_right"]
    assert full.locate("arm_right") == ("p.yaml", 6)
    assert puppet.locate("shoulder_right") == ("p.yaml", 8)
    assert full.mirror is None


def test_a_pose_written_for_a_twin_takes_precedence() -> None:
    pose = loads(TEXT).expanded().pose
    assert (pose["shoulder_left"], pose["shoulder_right"]) == (0.5, 0.25)
    assert pose["lift_right.length"] == 1


def test_the_bundled_marionette_is_symmetric() -> None:
    full = load(puppets.path("marionette")).expanded()
    names = {b.name for b in full.bodies}
    assert {n.replace("left", "right") for n in names} <= names
    assert len(full.strings) == 7
