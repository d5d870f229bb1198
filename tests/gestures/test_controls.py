"""Gestures that move a control: turns of driven bodies, hinges of bars, and their bounds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fantoccini as fan
from fantoccini.base.errors import FileError, InputError, StateError
from fantoccini.theatre import Gesture
from fantoccini.theatre.gestures import Hands, MotionSequence, motion_bounds
from fantoccini.theatre.gestures.turns import TurnError

pytestmark = pytest.mark.medium

CONTROL = """
puppet: control
bodies:
- {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1.0}
- name: bar
  joint: {type: free, driven: true}
  shapes: [{type: box, size: [0.3, 0.02, 0.01], density: 600}]
- name: leg_bar
  parent: bar
  joint: {name: rock, type: revolute, axis: [1, 0, 0], at: [0.1, 0, 0], driven: true}
- name: slide
  parent: bar
  joint: {name: rail, type: prismatic, axis: [-1, 0, 0], driven: true}
strings:
- {name: line, path: [{body: bob}, {body: bar, at: [0.1, 0, 0]}], length: 0.5}
pose: {bar.z: 1.0, bob.x: 0.1, bob.z: 0.5}
"""
SIGNS = {
    "tip_forward": [0, 1, 0],
    "tip_back": [0, -1, 0],
    "roll_left": [-1, 0, 0],
    "roll_right": [1, 0, 0],
    "turn_left": [0, 0, 1],
    "turn_right": [0, 0, -1],
}
"""Direction -> axis about which the body turns by the right-hand rule, with y to its left."""


@pytest.fixture(scope="module")
def control() -> fan.Marionette:
    return fan.loads(CONTROL)


def orientation(gesture: Gesture, puppet: fan.Marionette, t: float, **start: object) -> Rotation:
    """Orientation of the bar at a time of the gesture."""
    x0 = puppet.state({"bar.rotation": start.get("rotation", [0, 0, 0])})
    q, _ = puppet.coordinates.rotations["bar.rotation"]
    w, x, y, z = gesture.inputs(x0).evaluate(t)[0][q : q + 4]
    return Rotation.from_quat([x, y, z, w])


@pytest.mark.parametrize("direction", SIGNS)
def test_a_control_turns_in_each_direction(control, direction):
    gesture = Gesture.from_points(control, {f"bar.{direction}": [(0, 0), (1, "30 deg"), (2, 0)]})
    expected = Rotation.from_rotvec(np.radians(30) * np.array(SIGNS[direction]))
    assert (orientation(gesture, control, 1.0) * expected.inv()).magnitude() < 1e-12
    assert orientation(gesture, control, 2.0).magnitude() < 1e-12
    half = Rotation.from_rotvec(np.radians(15) * np.array(SIGNS[direction]))
    assert (orientation(gesture, control, 0.5) * half.inv()).magnitude() < 1e-12  # minimum jerk
    assert gesture.uses == ("bar",)


def test_the_front_goes_down_forward_and_the_left_side_down_to_the_left(control):
    tip = orientation(
        Gesture.from_points(control, {"bar.tip_forward": [(0, 0), (1, 0.2)]}), control, 1.0
    )
    assert tip.apply([1, 0, 0])[2] == pytest.approx(-np.sin(0.2))
    roll = orientation(
        Gesture.from_points(control, {"bar.roll_left": [(0, 0), (1, 0.2)]}), control, 1.0
    )
    assert roll.apply([0, 1, 0])[2] == pytest.approx(-np.sin(0.2))
    turn = orientation(
        Gesture.from_points(control, {"bar.turn_left": [(0, 0), (1, 0.2)]}), control, 1.0
    )
    assert turn.apply([1, 0, 0])[1] == pytest.approx(np.sin(0.2))


@pytest.mark.parametrize(("axis", "sign"), [([0, 0, 1], 1.0), ([0, 0, -1], -1.0)])
def test_up_raises_an_upright_slide(axis, sign):
    puppet = fan.loads(CONTROL.replace("axis: [-1, 0, 0]", f"axis: {axis}"))
    gesture = Gesture.from_points(puppet, {"rail.up": [(0, 0), (1, 0.05)]})
    offsets = gesture.offsets(1.0)[0]
    assert offsets[puppet.coordinates.v_K.index("rail")] == pytest.approx(0.05 * sign)


def test_turns_are_relative_to_where_the_control_is(control):
    gesture = Gesture.from_points(control, {"bar.tip_forward": [(0, 0), (1, 0.3)]})
    first = [0.1, -0.2, 0.7]
    expected = Rotation.from_rotvec(first) * Rotation.from_rotvec([0, 0.3, 0])
    turned = orientation(gesture, control, 1.0, rotation=first)
    assert (turned * expected.inv()).magnitude() < 1e-12


def test_parts_of_a_turn_have_their_own_times_and_add(control):
    tip = Gesture.from_points(control, {"bar.tip_forward": [(0, 0), (1.2, 0.3), (2, 0)]})
    roll = Gesture.from_points(
        control, {"bar.roll_left": [(0, 0), (0.7, 0.2), (1.4, -0.1), (2.5, 0)]}
    )
    combined = Gesture.from_points(
        control,
        {
            "bar.tip_forward": [(0, 0), (1.2, 0.3), (2, 0)],
            "bar.roll_left": [(0, 0), (0.7, 0.2), (1.4, -0.1), (2.5, 0)],
        },
    )
    for t in np.linspace(0.0, 2.5, 11):
        vectors = [orientation(part, control, t).as_rotvec() for part in (tip, roll)]
        for sum_of_parts in (combined, tip + roll):
            difference = (
                orientation(sum_of_parts, control, t) * Rotation.from_rotvec(sum(vectors)).inv()
            )
            assert difference.magnitude() < 1e-12


def test_a_rotation_vector_is_its_parts(control):
    whole = Gesture.from_points(
        control, {"bar.rotation": [(0, [0, 0, 0]), (1, [0.1, "20 deg", -0.3])]}
    )
    parts = Gesture.from_points(
        control,
        {
            "bar.roll_right": [(0, 0), (1, 0.1)],
            "bar.tip_forward": [(0, 0), (1, "20 deg")],
            "bar.turn_right": [(0, 0), (1, 0.3)],
        },
    )
    np.testing.assert_allclose(whole.coef, parts.coef, atol=1e-15)


def test_bodies_and_joints_move_along_and_about_their_axes(control):
    gesture = Gesture.from_points(
        control,
        {
            "bar.up": [(0, 0), (1, "5 cm")],
            "bar.left": [(0, 0), (1, 0.02)],
            "rock.roll_left": [(0, 0), (1, "10 deg")],
            "rail.forward": [(0, 0), (1, 0.03)],
        },
    )
    offsets = dict(zip(control.coordinates.v_K, gesture.offsets(1.0)[0], strict=True))
    expected = {"bar.z": 0.05, "bar.y": 0.02, "rock": -np.radians(10), "rail": -0.03}
    assert {name: offsets[name] for name in expected} == pytest.approx(expected)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ({"bar.tip_forwards": [(0, 0)]}, "did you mean 'bar.tip_forward'"),
        ({"bar.tip_forward": [(0, "200 deg")]}, "turn by 200 deg; .*at most 177 deg"),
        ({"bar.tip_forward": [(0, "3 cm")]}, "3 cm"),
        ({"bar.rotation": [(0, [0, 0])]}, "needed: a rotation vector of 3 angles"),
        (
            {"bar.rotation": [(0, [0, 0, 0])], "bar.tip_back": [(0, 0)]},
            "moves bar.wy, as bar.rotation does",
        ),
        ({"bar.tip_forward": [(0, 0)], "bar.tip_back": [(0, 0)]}, "as bar.tip_forward does"),
        ({"rock.tip_forward": [(0, 0)]}, "no direction of rock, which can move roll_left, roll_ri"),
        ({"bob.up": [(0, 0)]}, "is not a driven coordinate, or a string"),
    ],
)
def test_mistakes_are_named(control, points, message):
    with pytest.raises(InputError, match=message):
        Gesture.from_points(control, points)


def test_the_mirror_image_of_a_turn_is_that_of_the_bar(control):
    """S R S with S the reflection in the x-z plane."""
    points = {"bar.rotation": [(0, [0, 0, 0]), (1, [0.3, 0.2, -0.4])]}
    gesture = Gesture.from_points(
        control, points | {"rock": [(0, 0), (1, 0.1)], "rail": [(0, 0), (1, 0.1)]}
    )
    mirror = np.diag([1.0, -1.0, 1.0])
    expected = mirror @ orientation(gesture, control, 0.8).as_matrix() @ mirror
    image = gesture.mirrored()
    np.testing.assert_allclose(orientation(image, control, 0.8).as_matrix(), expected, atol=1e-12)
    offsets = dict(zip(control.coordinates.v_K, image.offsets(1.0)[0], strict=True))
    assert (offsets["rock"], offsets["rail"]) == (pytest.approx(-0.1), pytest.approx(0.1))


def test_a_puppet_that_has_turned_took_its_control_with_it(control):
    """x and y of the stage turn; the control and the bars on it keep their own axes."""
    points = {"bar.tip_forward": [(0, 0), (1, 0.3)], "bar.forward": [(0, 0), (1, 0.1)]}
    gesture = Gesture.from_points(control, points | {"rail.forward": [(0, 0), (1, 0.02)]})
    offsets = gesture.turned(0.5).offsets(1.0)[0]
    names = control.coordinates.v_K
    expected = {
        "bar.x": 0.1 * np.cos(0.5),
        "bar.y": 0.1 * np.sin(0.5),
        "bar.wy": 0.3,
        "rail": -0.02,
    }
    assert {n: offsets[names.index(n)] for n in expected} == pytest.approx(expected)


def test_a_control_tips_towards_the_front_of_its_puppet_however_it_stands(tmp_path):
    """R(t) R_0^T turns about the left of a puppet that looks along (0.6, 0.8)."""
    rig = "rig: {trunk: [bob], facing: [0.6, 0.8, 0], limbs: [], carrying: [line], control: bar}\n"
    askew = CONTROL.replace("bar.z: 1.0,", "bar.z: 1.0, bar.rotation: [0.2, 0, 0.5],")
    puppet, first = fan.loads(askew + rig), [0.2, 0, 0.5]
    path = tmp_path / "tip.yaml"
    path.write_text(
        "gesture: tip\nparts: {trunk.up: [[0, 0], [1, 1 cm]]}\n"
        "on_control: {control.tip_forward: [[0, 0], [1, 0.3]]}\n"
    )
    gesture = fan.theatre.load_gesture(puppet, path)
    turn = orientation(gesture, puppet, 1.0, rotation=first) * Rotation.from_rotvec(first).inv()
    np.testing.assert_allclose(turn.as_rotvec(), [-0.3 * 0.8, 0.3 * 0.6, 0.0], atol=1e-9)


def test_a_gesture_travels_with_turns_only_if_they_end(control):
    forward_points = {"bar.forward": [(0, 0), (2, 0.1)]}
    rocks = Gesture.from_points(
        control, forward_points | {"bar.roll_left": [(0, 0), (1, 0.2), (2, 0)]}, travels=True
    )
    assert rocks.travel.sum() == pytest.approx(0.1)
    with pytest.raises(StateError, match=r"ends with bar\.rotation turned"):
        Gesture.from_points(
            control, forward_points | {"bar.roll_left": [(0, 0), (1, 0.2)]}, travels=True
        )


def test_a_file_that_travels_turned_is_a_mistake_of_its_line(control, tmp_path):
    path = tmp_path / "lean.yaml"
    path.write_text("gesture: lean\ntravels: true\nmoves: {bar.tip_back: [[0, 0], [1, 9 deg]]}\n")
    with pytest.raises(FileError, match=r"lean.yaml:2: travels: .*bar.rotation turned"):
        fan.theatre.load_gesture(control, path)


def test_offsets_of_a_turn_can_be_added(control):
    moved = Gesture.from_points(control, {"bar.up": [(0, 0), (1, 0.1)]}).moved(
        {"bar.tip_back": 0.2}
    )
    np.testing.assert_allclose(orientation(moved, control, 1.0).as_rotvec(), [0, -0.2, 0])


def test_a_score_tips_the_control_and_judges_turns_in_their_own_unit(control, tmp_path):
    (tmp_path / "nod.yaml").write_text(
        "gesture: nod\nmoves:\n  bar.tip_forward: [[0, 0], [0.2, 20 deg], [0.6, 0]]\n"
        "marks: {low: 0.2}\n"
    )
    (tmp_path / "rock.yaml").write_text("gesture: rock\nmoves: {rock: [[0, 0], [1, 9 deg]]}\n")
    text = (
        "score: number\n{}lanes:\n  bar: [{{gesture: nod.yaml, on: {{low: 1}}}}]\n"
        "  legs: [{{gesture: rock.yaml, at: 0, mirrored: true}}]\n"
    )
    path = tmp_path / "number.yaml"
    path.write_text(text.format("speed: 1.2\nacceleration: 8\n"))
    score = fan.load_score(control, path)
    changes = [str(change) for change in score.changes]
    assert any("bar.rotation moves at 3.27" in x and "the bound is 3:" in x for x in changes)
    assert any("bar.rotation changes by 50.38 rad/s^2" in x and "is 20:" in x for x in changes)
    assert not any("m/s" in change for change in changes)
    path.write_text(text.format("speed: {bar.rotation: 4}\nacceleration: {bar.rotation: 60}\n"))
    score = fan.load_score(control, path)
    assert score.changes == ()
    q, _ = control.coordinates.rotations["bar.rotation"]
    q_K = score.inputs(control.rest()).evaluate(1.0)[0]
    assert q_K[q + 2] == pytest.approx(np.sin(np.radians(10.0)))  # half of 20 deg
    assert q_K[control.coordinates.q_K.index("rock")] == pytest.approx(-np.radians(9.0))


def test_turns_that_add_up_to_more_than_half_a_circle_are_refused(control, tmp_path):
    tip = Gesture.from_points(control, {"bar.tip_forward": [(0, 0), (1, "100 deg"), (2, 0)]})
    message = r"bar\.rotation turns by 200 deg from rest at 1\.00 s; .* at most 177 deg"
    for change in (lambda: tip + tip, lambda: tip.scaled(2.0)):
        with pytest.raises(StateError, match=message):
            change()
    turn = Gesture.from_points(control, {"bar.turn_left": [(0, 0), (1, "140 deg"), (2, 0)]})
    assert np.hypot(100, 140) < 177 < 100 + 140
    np.testing.assert_allclose(
        (tip + turn).offsets(1.0)[0], tip.offsets(1.0)[0] + turn.offsets(1.0)[0]
    )
    (tmp_path / "tip.yaml").write_text(
        "gesture: tip\nmoves: {bar.tip_forward: [[0, 0], [5, 100 deg], [10, 0]]}\n"
    )
    path = tmp_path / "twice.yaml"
    path.write_text(
        "score: twice\nlanes:\n  one: [{gesture: tip.yaml, at: 0}]\n"
        "  other: [{gesture: tip.yaml, at: 0}]\n"
    )
    with pytest.raises(
        FileError, match=r"twice\.yaml:3: lanes\.one\[0\]: bar\.rotation turns by 200"
    ):
        fan.load_score(control, path)


def test_a_turn_too_far_is_located_at_its_moves(control, tmp_path):
    text = "gesture: over\nmoves:\n  rock: [[0, 0], [1, 9 deg], [2, 0]]\n"
    text += "  bar.tip_forward: [[0, 0], [1, 150 deg], [2, 0]]\n"
    text += "  bar.turn_left: [[0, 0], [1, 150 deg], [2, 0]]\n"
    poses = "poses:\n  strings: [bar]\n  at: [0, 1]\n  points: {bob: [[0, 0, 0], [0, 0, 0]]}\n"
    path = tmp_path / "over.yaml"
    for more in ("", poses):
        path.write_text(text + more)
        with pytest.raises(FileError, match=r"bar\.rotation turns by 212 deg") as error:
            fan.theatre.load_gesture(control, path)
        for key, line in (("tip_forward", 4), ("turn_left", 5)):
            assert f"over.yaml:{line}: moves.bar.{key}: " in str(error.value)
        assert "travels" not in str(error.value) and "rock" not in str(error.value)


def test_a_turn_too_far_names_a_cue_of_its_time(control, tmp_path):
    """The cue that turns the bar farthest is over when two others turn it too far together."""
    for name, angle in (("tip", 100), ("far", 170)):
        (tmp_path / f"{name}.yaml").write_text(
            f"gesture: {name}\nmoves: {{bar.tip_forward: [[0, 0], [5, {angle} deg], [10, 0]]}}\n"
        )
    path = tmp_path / "twice.yaml"
    path.write_text(
        "score: twice\nlanes:\n  one: [{gesture: far.yaml, at: 0}, {gesture: tip.yaml, at: 12}]\n"
        "  other: [{gesture: tip.yaml, at: 12}]\n"
    )
    with pytest.raises(FileError, match=r"lanes\.one\[1\]: bar\.rotation turns by 200"):
        fan.load_score(control, path)


def test_hands_are_checked_where_a_lane_is_added(control):
    """Turns of two lanes add, also those before the last motion of a lane."""
    table = control.coordinates
    tip = Gesture.from_points(control, {"bar.tip_forward": [(0, 0), (5, "100 deg"), (10, 0)]})
    hands = Hands((MotionSequence.empty(motion_bounds(table, 1.0, 6.0)),))
    first, _ = hands.add(0, tip, 0.0)
    two, _ = first.add(0, tip, 20.0)
    for before, after in ((hands, first), (first, two), (two, two.add(1, tip, 31.0)[0])):
        after.check_turns(table, before)
    for begin, t in ((1.0, 5.5), (20.0, 25.0)):
        with pytest.raises(TurnError) as error:
            two.add(1, tip, begin)[0].check_turns(table, two)
        assert error.value.t == pytest.approx(t, abs=0.3)
        both, _ = two.add(1, tip, begin)
        with pytest.raises(TurnError, match=r"bar\.rotation turns by"):
            both.motion(table, ["one", "other"], both.end)


def test_key_poses_tip_a_control(control, tmp_path):
    """A bob on a string from the bar's front comes down as the bar is tipped, and only tipped."""
    path = tmp_path / "dip.yaml"
    path.write_text(
        "gesture: dip\nposes:\n  strings: [bar]\n  at: [0, 1]\n"
        "  points: {bob: [[0, 0, 0], [0, 0, -0.03]]}\n"
    )
    gesture = fan.theatre.load_gesture(control, path)
    x0 = control.rest()
    q_K = gesture.inputs(x0).evaluate(1.0)[0]
    hanging_state = control.rest(x0.replace(q_K=q_K))
    down = control.pose(hanging_state, "bob")[:3, 3] - control.pose(x0, "bob")[:3, 3]
    np.testing.assert_allclose(down, [0, 0, -0.03], atol=1e-4)


def test_key_poses_leave_a_driven_body_where_it_is(tmp_path):
    """A bar that the poses do not move was refused: `no driven velocity is called 'bar.qw'`."""
    puppet = fan.loads(
        "puppet: held\nbodies:\n"
        "- {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1.0}\n"
        "- {name: bar, joint: {type: free, driven: true}}\n"
        "strings:\n"
        "- {name: line, path: [{body: bob}, {driven: [x, y], at: [0, 0, 1]}], length: driven}\n"
        "pose: {bob.z: 0.5, line.length: 0.5}\n"
    )
    path = tmp_path / "lift.yaml"
    path.write_text(
        "gesture: lift\nposes:\n  strings: [line]\n  at: [0, 1]\n"
        "  points: {bob: [[0, 0, 0], [0, 0.02, 0.03]]}\n"
    )
    gesture = fan.theatre.load_gesture(puppet, path)
    x0 = puppet.rest()
    q_K = gesture.inputs(x0).evaluate(1.0)[0]
    hanging_state = puppet.rest(x0.replace(q_K=q_K))
    moved = puppet.pose(hanging_state, "bob")[:3, 3] - puppet.pose(x0, "bob")[:3, 3]
    np.testing.assert_allclose(moved, [0, 0.02, 0.03], atol=1e-4)
    assert gesture.uses == ("line",)
    np.testing.assert_allclose(
        puppet.pose(hanging_state, "bar"), puppet.pose(x0, "bar"), atol=1e-12
    )
