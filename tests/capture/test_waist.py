"""Clips on puppets whose trunk, neck and hips have several bodies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.capture.test_retarget import NAMES, STANDS, capture_of, write_clip

import fantoccini as fan
from fantoccini.base.errors import StateError
from fantoccini.theatre.capture import Capture
from fantoccini.theatre.retarget import figure_of, place_clip

pytestmark = [pytest.mark.medium, pytest.mark.long]

PELVIS_SHAPE = (
    "      - {type: ellipsoid, radii: [0.033, 0.050, 0.036], at: [0, 0, -0.055], density: 350"
)
WAIST = """
  - name: pelvis
    parent: torso
    joint:
      name: waist
      type: ball
      at: [0, 0, -0.03]
      damping: 1.5e-3
      spring: {stiffness: 0.02}
      cone: {max: 40 deg, axis: [0, 0, 1]}
      twist: {lower: -40 deg, upper: 40 deg}
    shapes:
      - {type: ellipsoid, radii: [0.033, 0.050, 0.036], at: [0, 0, -0.025], density: 350}

  - name: thigh_left
    parent: pelvis
"""


def waisted_text() -> str:
    """The bundled marionette with a pelvis that is jointed to its torso."""
    text = fan.puppets.path("marionette").read_text()
    lines = [line for line in text.splitlines() if not line.startswith(PELVIS_SHAPE)]
    text = "\n".join(lines).replace("puppet: marionette", "puppet: waisted")
    text = text.replace("\n  - name: thigh_left\n    parent: torso\n", WAIST)
    return text.replace("at: [0, 0.033, -0.075]", "at: [0, 0.033, -0.045]")


@pytest.fixture(scope="module")
def waisted() -> fan.Marionette:
    return fan.loads(waisted_text())


def twisted(degrees: float) -> Capture:
    """A person who stands, and then turns the shoulders to the left."""
    turn = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
    frame = STANDS.copy()
    upper = [i for i, name in enumerate(NAMES) if "Arm" in name or "Hand" in name or name == "Head"]
    frame[upper] = STANDS[upper] @ turn.T
    head = np.stack([np.eye(3), turn])
    return capture_of(np.stack([STANDS, frame]), head)


def test_a_puppet_with_a_waist_has_the_figure_of_one_without(waisted, marionette):
    figure, whole = (figure_of(m, m.rest()) for m in (waisted, marionette))
    assert figure.bodies["hips"] == "pelvis" and "hips" not in whole.bodies
    assert figure.points["trunk"][0] == "pelvis" and figure.lower_trunk is not None
    for part in whole.positions:
        np.testing.assert_allclose(
            figure.local_point(part)[:2], whole.local_point(part)[:2], atol=1e-12
        )
    assert figure.leg_length == pytest.approx(whole.leg_length)
    assert figure.height == pytest.approx(whole.height, rel=5e-3)
    np.testing.assert_allclose(figure.lower_trunk.waist, [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(figure.lower_trunk.waist_in_trunk, [0, 0, -0.03], atol=1e-12)


def test_shoulders_turn_the_upper_half_of_the_trunk_and_hips_the_lower(waisted):
    placed = place_clip(waisted, twisted(30.0))
    x = {part: path[1] - path[0] for part, path in placed.targets.parts.items()}
    for part in ("trunk", "hip_left", "hip_right", "knee_left", "foot_right"):
        np.testing.assert_allclose(x[part], 0.0, atol=1e-12, err_msg=part)
    lines = [
        placed.targets.parts["shoulder_left"][k] - placed.targets.parts["shoulder_right"][k]
        for k in (0, 1)
    ]
    turned = Rotation.from_euler("z", 30, degrees=True).apply(lines[0])
    np.testing.assert_allclose(lines[1], turned, atol=1e-12)
    for half, degrees in (("trunk", 30.0), ("hips", 0.0)):
        a, b = placed.targets.frames[half][:, :, :3]
        turn = Rotation.from_matrix(b @ a.T)
        np.testing.assert_allclose(turn.as_rotvec(degrees=True), [0, 0, degrees], atol=1e-9)
    # Both halves meet at the waist.
    lower = placed.figure.lower_trunk
    for point, body in ((lower.waist_in_trunk, "trunk"), (lower.waist, "hips")):
        frame = placed.targets.frames[body]
        joints = frame[:, :, :3] @ point + frame[:, :, 3]
        np.testing.assert_allclose(joints[1], joints[0], atol=1e-12)


LIMB = """
  - name: {0}_{1}
    parent: {2}
    joint: {{name: {0}_{1}_joint, type: ball, at: [0, {3}, {4}]}}
    shapes: [{{type: sphere, radius: 0.02, at: [0, 0, -0.05], mass: 0.05}}]
  - name: {5}_{1}
    parent: {0}_{1}
    joint: {{name: {5}_{1}_joint, type: revolute, axis: [0, 1, 0], at: [0, 0, -0.1]}}
    shapes: [{{type: sphere, radius: 0.02, at: [0, 0, -0.05], mass: 0.05}}]
"""
ROBOT = """
puppet: robot
bodies:
  - name: base
    joint: {type: free}
    shapes: [{type: sphere, radius: 0.04, mass: 0.2}]
  - name: yaw
    parent: base
    joint: {name: waist_yaw, type: revolute, axis: [0, 0, 1], at: [0, 0, 0.05]}
    shapes: [{type: sphere, radius: 0.02, mass: 0.05}]
  - name: torso
    parent: yaw
    joint: {name: waist_pitch, type: revolute, axis: [0, 1, 0], at: [0, 0, 0.01]}
    shapes: [{type: sphere, radius: 0.04, at: [0, 0, 0.05], mass: 0.2}]
  - name: skull
    parent: torso
    joint: {name: neck, type: ball, at: [0, 0, 0.12]}
    shapes: [{type: sphere, radius: 0.04, at: [0, 0, 0.05], mass: 0.1}]
LIMBS
strings:
  - name: head
    path: [{body: skull, at: [0, 0, 0.1]}, {driven: [x, y], at: [0, 0, 1.2]}]
    length: driven
pose: {base.z: 0.5, head.length: 0.42}
"""


def test_a_trunk_whose_lower_half_carries_the_upper_one_has_a_waist():
    """Imported humanoids are such; the waist has two joints, and the upper one counts."""
    limbs = "".join(
        LIMB.format(upper, side, parent, y, z, lower)
        for side, sign in (("left", 1), ("right", -1))
        for upper, lower, parent, y, z in (
            ("upper_arm", "forearm", "torso", 0.07 * sign, 0.1),
            ("thigh", "shin", "base", 0.04 * sign, -0.03),
        )
    )
    robot = fan.loads(ROBOT.replace("LIMBS", limbs))
    figure = figure_of(robot, robot.rest())
    assert figure.bodies["hips"] == "base" and figure.lower_trunk is not None
    np.testing.assert_allclose(figure.lower_trunk.waist, [0, 0, 0.06], atol=1e-9)
    np.testing.assert_allclose(figure.lower_trunk.waist_in_trunk, 0.0, atol=1e-9)
    np.testing.assert_allclose(figure.local_point("trunk"), [0, 0, -0.03], atol=1e-9)
    np.testing.assert_allclose(figure.local_point("shoulder_left"), [0, 0.07, 0.1], atol=1e-9)


NECK = """
  - name: neck_bone
    parent: torso
    joint: {name: nod, type: revolute, axis: [0, 1, 0], at: [0, 0, 0.09], damping: 1.0e-3,
      limits: {lower: -20 deg, upper: 20 deg}}
    shapes:
      - {type: sphere, radius: 0.008, density: 450}

  - name: skull
    parent: neck_bone
"""


def test_a_neck_of_two_bodies_is_a_neck():
    text = fan.puppets.path("marionette").read_text()
    text = text.replace("\n  - name: skull\n    parent: torso\n", NECK)
    puppet = fan.loads(text.replace("      at: [0, 0, 0.1]\n", "      at: [0, 0, 0.01]\n"))
    figure = figure_of(puppet, puppet.rest())
    assert figure.points["neck"][0] == "torso" and figure.lower_trunk is None
    assert figure.local_point("neck")[2] == pytest.approx(0.1, abs=2e-3)


def test_parts_that_hang_at_other_parts_are_refused(marionette):
    text = fan.puppets.path("marionette").read_text()
    hung = text.replace("- name: skull\n    parent: torso", "- name: skull\n    parent: thigh_left")
    text = hung.replace(
        "name: neck\n      type: ball\n      at: [0, 0, 0.1]",
        "name: neck\n      type: ball\n      at: [0, 0, 0]",
    )
    with pytest.raises(StateError, match="head of a person is skull, which hangs at thigh_left"):
        figure_of(fan.loads(text), marionette.rest())


@pytest.mark.slow
def test_a_marionette_with_a_waist_follows_a_clip(waisted, tmp_path):
    followed = fan.theatre.follow_clip(waisted, write_clip(tmp_path, "lafan1", "wave"))
    assert followed, followed.status
    errors = {part.name: part.excess for part in followed.report}
    assert all(above < 0.02 for above in errors.values()), errors


def test_bodies_of_any_names_are_those_of_the_body_map():
    """Hans has other names, a waist, and his chest as the root."""
    hans = fan.puppets.hans()
    figure = figure_of(hans, hans.rest())
    assert figure.bodies["trunk"] == "chest" and figure.bodies["hips"] == "pelvis"
    for side in ("left", "right"):
        assert figure.bodies[f"forearm_{side}"] == f"lower_arm_{side}"
        assert figure.bodies[f"shin_{side}"] == f"shin_{side}"
    assert (
        figure.positions["head"][2]
        > figure.positions["hand_left"][2]
        > figure.positions["foot_left"][2]
    )
    assert figure.height == pytest.approx(hans.body_map.size, rel=0.1)
