"""Gestures: the coordinates that they move, changed copies of them, and sequences."""

from __future__ import annotations

import numpy as np
import pytest
from tests.gestures.available import available_gestures

import fantoccini as fan
from fantoccini.base import polynomial, rotation
from fantoccini.base.errors import InputError, StateError, UnknownNameError

pytestmark = pytest.mark.medium

TWINS = """
puppet: twins
bodies:
- {name: left_bob, joint: {type: translation, axes: [x, y, z]}, mass: 1.0}
- {name: right_bob, joint: {type: translation, axes: [x, y, z]}, mass: 1.0}
- {name: bar, joint: {type: free, driven: true}, shapes: [{type: sphere, radius: 0.01, mass: 0.1}]}
strings:
- {name: line_left, path: [{body: left_bob}, {driven: [x, y], at: [0, 0.2, 2]}], length: driven}
- {name: line_right, path: [{body: right_bob}, {driven: [x, y], at: [0, -0.2, 2]}], length: driven}
pose: {left_bob.y: 0.2, left_bob.z: 1.0, right_bob.y: -0.2, right_bob.z: 1.0,
       line_left.length: 1.0, line_right.length: 1.0}
"""


@pytest.fixture(scope="module")
def twins() -> fan.Marionette:
    return fan.loads(TWINS)


def offset_at(gesture: fan.theatre.Gesture, name: str, t: float) -> float:
    """Displacement d(t) of a coordinate from the start of the gesture."""
    i = gesture.coordinates.v_K.index(name)
    k = int(np.clip(np.searchsorted(gesture.breaks, t, "right") - 1, 0, len(gesture.coef) - 1))
    return float(np.polyval(gesture.coef[k, i, ::-1], t - gesture.breaks[k]))


def test_directions_are_coordinates_with_signs(twins):
    points = {
        "line_left.up": 0.1,
        "line_left.forward": 0.02,
        "line_left.out": 0.03,
        "line_right.down": 0.1,
        "line_right.back": 0.02,
        "line_right.out": 0.03,
    }
    gesture = fan.theatre.Gesture.from_points(
        twins, {name: [(0, 0), (1, offset)] for name, offset in points.items()}
    )
    expected = {
        "line_left.length": -0.1,
        "line_left.x": 0.02,
        "line_left.y": 0.03,
        "line_right.length": 0.1,
        "line_right.x": -0.02,
        "line_right.y": -0.03,
    }
    for name, offset in expected.items():
        assert offset_at(gesture, name, 1.0) == pytest.approx(offset, abs=1e-15)
        assert offset_at(gesture, name, 0.5) == pytest.approx(
            0.5 * offset, abs=1e-15
        )  # minimum jerk
    assert gesture.uses == ("line_left", "line_right") and gesture.duration == 1.0


def test_lengths_may_have_units(twins):
    gesture = fan.theatre.Gesture.from_points(
        twins, {"line_left.up": [(0, "0 mm"), (1, "12 cm"), (2, 0.05)]}
    )
    assert offset_at(gesture, "line_left.length", 1.0) == pytest.approx(-0.12)
    assert offset_at(gesture, "line_left.length", 2.0) == pytest.approx(-0.05)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ({"line_left.upp": [(0, 0)]}, "did you mean 'line_left.up'"),
        ({"bar.rotation": [(0, 0)]}, "found 0; needed: a rotation vector of 3 angles"),
        ({"left_bob.x": [(0, 0)]}, "is not a driven coordinate, or a string"),
        ({"line_left.tip_back": [(0, 0)]}, "no direction of line_left, which can move up, down"),
        ({"line_left.up": [(0, 0)], "line_left.length": [(0, 0)]}, "as line_left.up does"),
        ({"line_left.up": [(0, "3 ft")]}, "needed: a length"),
        ({"line_left.up": [(1, 0), (0, 0)]}, "times must increase"),
        ({"line_left.up": [(-1, 0), (0, 0)]}, "begins at 0 s"),
        ({"line_left.up": 3}, "needed: a list of pairs"),
    ],
)
def test_mistakes_are_named(twins, points, message):
    with pytest.raises(InputError, match=message):
        fan.theatre.Gesture.from_points(twins, points)


def test_a_mirror_exchanges_left_and_right(twins):
    gesture = fan.theatre.Gesture.from_points(
        twins,
        {
            "line_left.up": [(0, 0), (1, 0.1)],
            "line_left.left": [(0, 0), (1, 0.03)],
            "bar.y": [(0, 0), (1, 0.2)],
        },
    )
    mirrored = gesture.mirrored()
    assert set(mirrored.uses) == {"line_right", "bar"}
    assert offset_at(mirrored, "line_right.length", 1.0) == pytest.approx(-0.1)
    assert offset_at(mirrored, "line_right.y", 1.0) == pytest.approx(-0.03)
    assert offset_at(mirrored, "bar.y", 1.0) == pytest.approx(-0.2)
    twice = mirrored.mirrored()
    assert np.array_equal(twice.coef, gesture.coef) and np.array_equal(twice.named, gesture.named)


def test_without_a_twin_there_is_no_mirror():
    puppet = fan.loads(TWINS.replace("line_right", "cord"))
    gesture_of_left_string = fan.theatre.Gesture.from_points(
        puppet, {"line_left.up": [(0, 0), (1, 0.1)]}
    )
    with pytest.raises(UnknownNameError, match="line_right"):
        gesture_of_left_string.mirrored()


def test_gestures_are_scaled_sped_up_delayed_and_moved(twins):
    gesture = fan.theatre.Gesture.from_points(
        twins, {"line_left.up": [(0, 0), (1, 0.1), (2, 0)]}, marks={"up": 1.0}
    )
    assert offset_at(gesture.scaled(1.5), "line_left.length", 1.0) == pytest.approx(-0.15)
    faster = gesture.faster(2.0)
    assert faster.duration == 1.0 and faster.marks == {"up": 0.5}
    assert offset_at(faster, "line_left.length", 0.3) == pytest.approx(
        offset_at(gesture, "line_left.length", 0.6)
    )
    assert gesture.lasting(3.0).duration == pytest.approx(3.0)
    delayed = gesture.delayed(0.5)
    assert delayed.duration == 2.5 and delayed.marks == {"up": 1.5}
    assert offset_at(delayed, "line_left.length", 0.4) == 0.0
    assert offset_at(delayed, "line_left.length", 1.1) == pytest.approx(
        offset_at(gesture, "line_left.length", 0.6)
    )
    moved = gesture.moved({"line_left.out": 0.05})
    assert offset_at(moved, "line_left.y", 2.0) == pytest.approx(0.05)


def test_joints_on_both_sides_have_equal_angles():
    puppet = fan.loads("""
puppet: levers
bodies:
- {name: arm_left, joint: {name: lever_left, type: revolute, axis: [1, 0, 0], driven: true}}
- {name: arm_right, joint: {name: lever_right, type: revolute, axis: [-1, 0, 0], driven: true}}
- {name: post, joint: {name: skew, type: revolute, axis: [0, 0.6, 0.8], driven: true}}
- {name: bob, parent: post, joint: {name: pin, type: revolute, axis: [0, 1, 0]}, mass: 1.0,
   com: [0, 0, -0.5], inertia: [0.1, 0.1, 0.01]}
""")
    lift = fan.theatre.Gesture.from_points(puppet, {"lever_left": [(0, 0), (1, "30 deg")]})
    assert offset_at(lift.mirrored(), "lever_right", 1.0) == pytest.approx(np.radians(30))
    with pytest.raises(StateError, match="mirror image of the joint skew"):
        fan.theatre.Gesture.from_points(puppet, {"skew": [(0, 0), (1, 0.1)]}).mirrored()


def test_marks_of_repetitions_are_numbered(twins):
    gesture = fan.theatre.Gesture.from_points(
        twins, {"line_left.up": [(0, 0), (1, 0.1), (2, 0)]}, marks={"up": 1.0}
    )
    assert gesture.repeated(3).marks == {"up": 1.0, "up 2": 3.0, "up 3": 5.0}
    with pytest.raises(ValueError, match="the mark 'up' is at 7 s"):
        fan.theatre.Gesture.from_points(
            twins, {"line_left.up": [(0, 0), (1, 0.1)]}, marks={"up": 7.0}
        )
    with pytest.raises(ValueError, match="a whole number"):
        gesture.repeated(1.5)


def test_peaks_are_those_of_the_motion(marionette):
    for name in ("wave", "bow", "jump"):
        gesture = fan.theatre.load_gesture(marionette, name)
        t = np.linspace(0.0, gesture.duration, 40_001)
        _, v_K, acc_K = gesture.inputs(marionette.rest()).evaluate(t)
        speed, acceleration = gesture.peaks
        np.testing.assert_allclose(acceleration, np.abs(acc_K).max(axis=0), rtol=1e-4, atol=1e-9)
        top_speed = np.abs(v_K).max(axis=0)
        assert np.all(speed >= top_speed * (1 - 1e-6)) and np.all(speed <= top_speed * 1.002 + 1e-9)


def test_simultaneous_gestures_add_up(twins):
    up = fan.theatre.Gesture.from_points(twins, {"line_left.up": [(0, 0), (1, 0.1)]})
    shifted = fan.theatre.Gesture.from_points(
        twins, {"line_left.up": [(0.25, 0), (0.75, 0.02), (1.5, 0)]}
    )
    total = up + shifted
    assert total.duration == 1.5
    for t in np.linspace(0.0, 1.5, 31):
        expected_sum = offset_at(up, "line_left.length", min(t, 1.0)) + offset_at(
            shifted, "line_left.length", t
        )
        assert offset_at(total, "line_left.length", t) == pytest.approx(expected_sum, abs=1e-15)
    moving = fan.theatre.Gesture.from_input(
        fan.Input.segments(twins, [0.0, 1.0], twins.rest().q_K, np.zeros(12), 0.01 * np.eye(12)[:1])
    )
    with pytest.raises(StateError, match="ends in motion"):
        _ = moving + shifted


def test_transitions_are_as_fast_as_the_bounds_allow(twins):
    """The largest speed and acceleration from rest to rest are 1.875 d/T and 5.7735 d/T^2."""
    up = fan.theatre.Gesture.from_points(twins, {"line_left.up": [(0, 0), (1, 0.1)]})
    again = fan.theatre.Gesture.from_points(twins, {"line_left.up": [(0, 0), (1, 0.1)]})
    for speed, acceleration in ((0.5, 100.0), (100.0, 4.0)):
        whole = up.then(again, speed=speed, acceleration=acceleration)
        lead = whole.duration - 2.0
        min_time = max(1.875 * 0.1 / speed, np.sqrt(5.7735 * 0.1 / acceleration))
        assert min_time <= lead <= 1.11 * min_time
        assert offset_at(whole, "line_left.length", whole.duration) == pytest.approx(-0.1)


def test_unused_coordinates_keep_their_values_and_travel_adds_up(twins):
    walk = fan.theatre.Gesture.from_points(
        twins,
        {f"line_{side}.forward": [(0, 0), (1, 0.2)] for side in ("left", "right")},
        travels=True,
    )
    lift = fan.theatre.Gesture.from_points(twins, {"line_left.up": [(0, 0), (1, 0.1)]})
    sway = fan.theatre.Gesture.from_points(
        twins, {"line_left.forward": [(0, 0), (1, 0.05), (2, 0)]}
    )
    whole = walk.then(lift, sway, walk)
    assert whole.duration == 5.0  # no transition is needed
    assert offset_at(whole, "line_left.x", 3.0) == pytest.approx(0.25)
    assert offset_at(whole, "line_left.x", 5.0) == pytest.approx(0.4)
    assert offset_at(whole, "line_left.length", 5.0) == pytest.approx(-0.1)
    assert whole.travel[twins.coordinates.v_K.index("line_right.x")] == pytest.approx(0.4)
    assert lift.then(fan.theatre.Gesture.rest(twins)).ends[0][1] == pytest.approx(np.zeros(12))


def test_a_recording_is_a_gesture(twins):
    x0 = twins.rest()
    inputs = fan.Input.waypoints(twins, {"line_left.length": [(1, 1.0), (2, 0.9), (3, 1.0)]})
    gesture = fan.theatre.Gesture.from_input(inputs)
    assert gesture.duration == 2.0
    gesture_inputs = gesture.inputs(x0)
    t = np.linspace(0.0, 2.0, 41)
    for a, b in zip(gesture_inputs.evaluate(t), inputs.evaluate(t + 1.0), strict=True):
        i = twins.coordinates.q_K.index("line_left.length")
        columns = (
            [i]
            if a.shape[1] == twins.coordinates.n_qK
            else [twins.coordinates.v_K.index("line_left.length")]
        )
        np.testing.assert_allclose(a[:, columns], b[:, columns], atol=1e-12)


def test_a_recorded_bar_turns_as_the_hands_turned_it():
    live = fan.Performance(fan.puppets.marionette_bar(), speed=0.5, acceleration=3.0)
    position, orientation = live.place("bar")
    live.record()
    for turn in ([0.5, 0.3, -0.4], [-0.4, 0.6, 0.2]):
        live.move("bar", position + np.array([0.05, 0.0, 0.02]), rotation.exp(np.array(turn)))
        live.advance(0.7)
    live.move("bar", position, orientation)
    live.advance(0.7)
    take = live.stop()
    gesture = fan.theatre.Gesture.from_input(take.inputs)
    t = np.linspace(0.0, take.duration, 1001)
    values = gesture.inputs(take.start).evaluate(t)
    recorded = take.inputs.evaluate(t + take.start.t)
    ((q, _),) = take.marionette.coordinates.rotations.values()
    difference = rotation.between(values[0][:, q : q + 4], recorded[0][:, q : q + 4])
    assert np.abs(difference).max() < 1e-8
    np.testing.assert_allclose(values[1], recorded[1], atol=1e-5)
    assert np.linalg.norm(values[0][500, q : q + 4] - values[0][0, q : q + 4]) > 0.1
    # The same turns from another orientation.
    x = take.start.replace(q_K=recorded[0][300])
    moved = gesture.inputs(x.replace(v_K=np.zeros(6))).evaluate(0.9)[0][q : q + 4]
    turn_elsewhere, turn_at_start = (
        rotation.between(a, b)
        for a, b in (
            (recorded[0][300, q : q + 4], moved),
            (recorded[0][0, q : q + 4], gesture.inputs(take.start).evaluate(0.9)[0][q : q + 4]),
        )
    )
    np.testing.assert_allclose(turn_elsewhere, turn_at_start, atol=1e-12)
    several_turns = fan.Input.waypoints(
        take.marionette, {"bar.rotation": [(0, [0, 0, 0]), (1, [0, 0, 2]), (2, [0, 0, 3.5])]}
    )
    with pytest.raises(StateError, match="deg at most"):
        fan.theatre.Gesture.from_input(several_turns)


def test_a_thousand_gestures_in_any_order_neither_jump_nor_break_bounds(marionette):
    speed, acceleration, x0 = 1.2, 11.0, marionette.rest()
    gestures = [*available_gestures(marionette).values()]
    gestures += [gesture.mirrored() for gesture in gestures]
    # Gestures cut from the middle of a piece, so that they begin and end in motion.
    for gesture in gestures[:10]:
        k = int(np.argmax(gesture.peaks_of_pieces[:, 0].max(axis=1)))
        h = 0.25 * (gesture.breaks[k + 1] - gesture.breaks[k])
        part = polynomial.shifted(gesture.coef[k : k + 1], np.array([h]))
        cut = fan.theatre.Gesture(
            gesture.coordinates, [0.0, h], part, gesture.named, np.zeros(21), gesture.name
        )
        gestures.append(cut)
    assert sum(np.abs(gesture.ends[1]).max() > 0.1 for gesture in gestures) >= 6
    for gesture in gestures:
        top_speed, hardest_acceleration = gesture.peaks
        assert top_speed.max() < speed and hardest_acceleration.max() < acceleration, gesture
    rng = np.random.default_rng(0)
    for _ in range(100):
        chosen = [gestures[i] for i in rng.integers(len(gestures), size=10)]
        whole = chosen[0].then(
            *chosen[1:],
            fan.theatre.Gesture.rest(marionette),
            speed=speed,
            acceleration=acceleration,
        )
        top_speed, hardest_acceleration = whole.peaks
        assert (
            top_speed.max() <= speed * 1.001 and hardest_acceleration.max() <= acceleration * 1.001
        )
        inputs = whole.inputs(x0, speed=speed, acceleration=acceleration)  # checked: C^1
        q_K, v_K, _ = inputs.evaluate(inputs.end)
        np.testing.assert_allclose(q_K, x0.q_K + whole.travel, atol=1e-12)
        np.testing.assert_allclose(v_K, 0.0, atol=1e-12)


def test_the_right_hand_waves(marionette):
    x0 = marionette.rest()
    wave = fan.theatre.load_gesture(marionette, "wave")
    run = fan.simulate(marionette, x0, wave.inputs(x0), t_end=8.0, method="timestepping")
    hand = np.array(
        [marionette.pose(run.state(i), "forearm_right")[:3, 3] for i in range(0, len(run.t), 20)]
    )
    assert hand[:, 2].max() - hand[0, 2] > 0.1
    final = hand[-len(hand) // 4 :].mean(axis=0)  # it still swings slightly
    assert np.linalg.norm(final - hand[0]) < 5e-3
