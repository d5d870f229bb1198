"""The marionette on an airplane control: it hangs like the plain one, nods, bows and walks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fantoccini as fan
from fantoccini.base import rotation
from fantoccini.base.errors import FileError, InputError, StateError
from fantoccini.theatre import load_gesture

pytestmark = pytest.mark.medium

HOLES = {
    "head": (0.1, 0.0, 0.6245),
    "shoulder_left": (0.0, 0.09, 0.7661),
    "knee_left": (0.14, 0.12, 1.064),
    "hand_left": (0.2, 0.14, 0.921),
}
"""String -> x and y of its hole, measured from the hand, and its length [m]."""


@pytest.fixture(scope="module")
def airplane() -> fan.Marionette:
    return fan.puppets.airplane()


@pytest.fixture(scope="module")
def x0(airplane):
    return airplane.rest()


def pitch_angle(airplane, x, body: str) -> float:
    """Angle by which a body leans forward [deg]."""
    R = airplane.pose(x, body)[:3, :3]
    return float(np.degrees(np.arctan2(R[0, 2], R[2, 2])))


def state_at(run: fan.Trajectory, t: float) -> fan.State:
    """State of the sample at a time, or next after it."""
    return run.state(int(np.searchsorted(run.t, t - 1e-9)))


def simulate_gesture(airplane, x0, gesture) -> fan.Trajectory:
    inputs = gesture.inputs(x0)
    return fan.simulate(airplane, x0, inputs, method=fan.TimeStepping(dt=2e-3))


def test_it_hangs_like_the_marionette_whose_hands_are_at_its_holes(airplane, x0, marionette):
    """The plain marionette has no bars: ends and lengths of its strings are driven."""
    values = {}
    for name, (x, y, length) in HOLES.items():
        for side_name, side in ((name, 1.0), (name.replace("left", "right"), -1.0)):
            values |= {f"{side_name}.x": x, f"{side_name}.length": length}
            values |= {f"{side_name}.y": side * y}
    reference = marionette.rest(values)
    q_D_by_name = {name: x0[name] for name in airplane.coordinates.q_D}
    assert q_D_by_name == pytest.approx({name: reference[name] for name in q_D_by_name}, abs=1e-9)
    tensions = [
        {
            string.name: puppet.forward_dynamics(x).tension[i]
            for i, string in enumerate(puppet.tree.strings)
        }
        for puppet, x in ((airplane, x0), (marionette, reference))
    ]
    assert tensions[0] == pytest.approx(tensions[1] | {"back": 0.0}, abs=1e-9)


def test_its_body_map_has_the_control(airplane):
    body_map = airplane.body_map
    assert (body_map.control, body_map.doubts) == ("bar", ())
    assert set(body_map.carrying) == {"shoulder_left", "shoulder_right", "back"}


@pytest.mark.parametrize(
    ("name", "bars"),
    [
        ("nod", ("bar",)),
        ("bow", ("bar",)),
        ("jump", ("bar",)),
        ("march", ("leg_rock",)),
        ("walk", ("bar", "leg_rock")),
        ("wave", ("hand_bar",)),
    ],
)
def test_bundled_gestures_move_its_bars_within_the_bounds_of_the_others(airplane, name, bars):
    gesture = load_gesture(airplane, name)
    assert gesture.uses == bars
    np.testing.assert_allclose(gesture.ends[0][1], gesture.travel, atol=1e-12)
    bounds = fan.theatre.gestures.motion_bounds(airplane.coordinates, 1.2, 11.0)
    assert np.all(gesture.peaks <= bounds * 1.002)


GREET = """gesture: greet
sizes: {whole: 30 cm, arm: 10 cm}
parts: {head.down: [[0, 0], [1, 1 cm]]}
on_control:
  control.tip_forward: [[0, 0], [1, 10 deg]]
  control.down: [[0, 0], [1, 3 cm]]
  arm_bar.up: [[0, 0], [1, 2 cm]]
"""


def test_lengths_are_in_proportion_to_the_puppet_and_angles_are_not(airplane, tmp_path):
    path = tmp_path / "greet.yaml"
    path.write_text(GREET)
    gesture, body_map = load_gesture(airplane, path), airplane.body_map
    offsets = dict(zip(airplane.coordinates.v_K, gesture.offsets(1.0)[0], strict=True))
    assert offsets["bar.wy"] == pytest.approx(np.radians(10.0))
    assert offsets["bar.z"] == pytest.approx(-0.03 * body_map.size / 0.3)
    assert offsets["hand_bar.z"] == pytest.approx(0.02 * body_map.parts["arm_left"].length / 0.1)


def test_moves_on_a_control_need_moves_of_parts_and_names_of_bars(airplane, tmp_path):
    path = tmp_path / "greet.yaml"
    path.write_text(GREET.replace("parts: {head.down: [[0, 0], [1, 1 cm]]}\n", ""))
    with pytest.raises(FileError, match=r"needed: one of them"):
        load_gesture(airplane, path)
    path.write_text(GREET.replace("arm_bar", "arms_bar"))
    with pytest.raises(
        FileError, match=r"it moves arms_bar; airplane has .*, control, arm_bar, leg"
    ):
        load_gesture(airplane, path)
    path.write_text(GREET.replace("10 deg", "10 dg"))
    with pytest.raises(FileError, match=r"greet.yaml:5: on_control.control.tip_forward\[1\]"):
        load_gesture(airplane, path)


def test_it_refuses_in_one_sentence_what_its_control_cannot_do(airplane):
    with pytest.raises(InputError, match="needed: 0, since a control walks straight on"):
        load_gesture(airplane, "walk", turn=0.3)
    with pytest.raises(FileError, match=r"would move hand_left.length, which is not a driven"):
        load_gesture(airplane, "clap")
    one_bar = fan.puppets.marionette_bar()
    with pytest.raises(StateError, match=r"it moves leg_bar; marionette_bar has .*, control$"):
        load_gesture(one_bar, "walk")
    with pytest.raises(FileError, match="gesture wave: it moves arm_bar; marionette_bar has"):
        load_gesture(one_bar, "wave")
    assert load_gesture(one_bar, "nod").uses == ("bar",)


def test_it_nods_when_its_control_is_tipped(airplane, x0):
    nod = load_gesture(airplane, "nod")
    run = simulate_gesture(airplane, x0, nod)
    head_angles = [
        pitch_angle(airplane, state_at(run, t), "skull") for t in (0.0, *nod.marks.values(), 0.75)
    ]
    assert min(head_angles[1:3]) > head_angles[0] + 8.0 and head_angles[3] < min(head_angles[1:3])
    assert abs(pitch_angle(airplane, state_at(run, nod.marks["first"]), "torso")) < 5.0


def test_it_bows_when_its_control_is_tipped_further(airplane, x0):
    bow = load_gesture(airplane, "bow")
    run = simulate_gesture(airplane, x0, bow)
    back_angles = [
        pitch_angle(airplane, state_at(run, t), "torso") for t in (0.0, 1.2, bow.duration)
    ]
    assert back_angles[1] > 25.0 and abs(back_angles[2]) < 10.0
    back = [s.name for s in airplane.tree.strings].index("back")
    assert airplane.forward_dynamics(state_at(run, 1.2)).tension[back] > 1.0


def test_it_walks_on_a_rocking_leg_bar_above_the_floor(airplane, x0):
    walk = load_gesture(airplane, "walk", steps=4, step=0.06)
    run = simulate_gesture(airplane, x0, walk)
    assert run.status is fan.Status.DONE
    assert tuple(walk.marks) == ("left", "right", "left 2", "right 2")
    for mark, t in walk.marks.items():
        knees = {s: float(state_at(run, t)[f"knee_joint_{s}"]) for s in ("left", "right")}
        lifted_side = mark.split()[0]
        standing_side = {"left": "right", "right": "left"}[lifted_side]
        feet = {s: airplane.pose(state_at(run, t), f"shin_{s}")[2, 3] for s in knees}
        assert knees[lifted_side] > knees[standing_side] + np.radians(15.0)
        assert feet[lifted_side] > feet[standing_side] + 5e-3
    assert state_at(run, walk.duration)["torso.x"] - x0["torso.x"] == pytest.approx(0.24, abs=0.05)
    soles = [
        airplane.pose(state_at(run, t), f"shin_{side}")[2, :3] @ [0.007, 0.0, -0.141]
        + airplane.pose(state_at(run, t), f"shin_{side}")[2, 3]
        for t in np.linspace(0.0, walk.duration, 60)
        for side in ("left", "right")
    ]
    assert min(soles) > 0.0


def test_a_take_of_a_tipped_control_is_a_gesture(airplane, tmp_path):
    live = fan.Performance(airplane)
    start_position, _ = live.place("bar")
    live.record()
    live.move("bar", start_position, rotation.exp(np.array([0.0, 0.2, 0.0])))
    live.advance(0.8)
    take = live.stop()
    take.save(tmp_path / "tip.npz")
    gesture = load_gesture(airplane, tmp_path / "tip.npz")
    assert gesture.uses == ("bar",)
    q, v = airplane.coordinates.rotations["bar.rotation"]
    assert gesture.named[v : v + 3].all()
    w, x, y, z = take.inputs.evaluate(take.inputs.end)[0][q : q + 4]
    expected = Rotation.from_quat([x, y, z, w]).as_rotvec()
    np.testing.assert_allclose(gesture.ends[0][1][v : v + 3], expected, atol=1e-9)
    assert np.linalg.norm(expected) > 0.1
