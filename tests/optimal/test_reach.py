"""Hanging poses nearest to places, compared with closed forms, SciPy and sweeps."""

from __future__ import annotations

import importlib.resources
import warnings

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

import fantoccini as fan

pytestmark = pytest.mark.slow

PLUMB_YAML = """
puppet: plumb
bodies:
- {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1.0}
strings:
- {name: line, path: [{body: bob}, {driven: [x, y], at: [0, 0, 2]}], length: driven}
pose: {bob.z: 1.0}
"""
BETWEEN_YAML = """
puppet: between
bodies:
- {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1.0}
strings:
- {name: left, path: [{body: bob}, {world: [-1, 0, 0]}], length: driven}
- {name: right, path: [{body: bob}, {world: [1, 0, 0]}], length: driven}
pose: {bob.z: -1.0}
"""
ROD_YAML = """
puppet: rod
bodies:
- {name: rod, joint: {name: pin, type: revolute, axis: [0, -1, 0]}, mass: 1.0, com: [0, 0, -0.5],
   inertia: [0.1, 0.1, 0.001]}
strings:
- {name: line, path: [{body: rod, at: [0, 0, -0.6]}, {driven: [x], at: [0.8, 0, 1]}],
   length: driven}
pose: {pin: 40 deg}
"""
LEVER_YAML = """
puppet: lever
bodies:
- {name: rod, joint: {name: pin, type: revolute, axis: [0, -1, 0]}, mass: 1.0, com: [0, 0, -0.5],
   inertia: [0.1, 0.1, 0.001]}
strings:
- {name: line, path: [{body: rod, at: [0, 0, {parameter: tie, value: -0.6}]},
                       {world: [0.8, 0, 0.2]}],
   length: 0.5}
pose: {pin: 60 deg}
"""
HAND = ("forearm_right", (0.0, 0.0, -0.09))


def hand_position(marionette: fan.Marionette, x: fan.State) -> np.ndarray:
    pose = marionette.pose(x, HAND[0])
    return pose[:3, :3] @ HAND[1] + pose[:3, 3]


def test_a_plumb_bob_hangs_straight_below_its_end():
    plumb = fan.loads(PLUMB_YAML)
    places = np.array([[0.3, -0.2, 0.7], [-0.5, 0.1, 1.2]])
    poses = fan.reach(plumb, {"bob": places})
    assert poses and poses.distance.max() < 1e-6
    np.testing.assert_allclose(poses.q_D, places, atol=1e-6)
    ends = np.column_stack([places[:, :2], 2.0 - places[:, 2]])
    np.testing.assert_allclose(poses.q_K, ends, atol=1e-6)
    np.testing.assert_allclose(poses.tension[:, 0], 9.81, rtol=1e-9)
    np.testing.assert_allclose(poses.jacobian[0], np.diag([1.0, 1.0, -1.0]), atol=1e-9)
    assert poses[0].immovable == () and poses[0].taut == ("line",)


def test_limits_of_a_bob_are_named():
    plumb = fan.loads(PLUMB_YAML)
    too_high = fan.reach(
        plumb,
        {"bob": [0.0, 0.0, 2.5]},
        bounds=fan.control.Bounds(position={"line.length": (0.02, 3.0)}),
    )[0]
    assert too_high.status is fan.control.AnswerStatus.OUT_OF_REACH and not too_high
    assert too_high.distance == pytest.approx(0.52, abs=1e-6)
    assert too_high.limits == ("the string line would have to be shorter than 0.02 m",)
    assert "bob comes no nearer than 520 mm" in too_high.summary()
    held_along_x = fan.reach(
        plumb, {"bob": [0.4, 0.3, 1.0]}, bounds=fan.control.Bounds(held=("line.x",))
    )[0]
    assert held_along_x.distance == pytest.approx(0.4, abs=1e-6)
    assert held_along_x.limits == (
        "no driven coordinate moves bob any further along (1.00, 0.00, 0.00)",
    )


def test_a_free_direction_does_not_count():
    plumb = fan.loads(PLUMB_YAML)
    poses = fan.reach(
        plumb, {"bob": [np.nan, 0.3, 0.8]}, bounds=fan.control.Bounds(held=("line.x",))
    )
    assert poses and poses.q_D[0] == pytest.approx([0.0, 0.3, 0.8], abs=1e-6)


def test_two_strings_lower_a_bob_to_the_intersection_of_their_circles():
    between = fan.loads(BETWEEN_YAML)
    target_position = np.array([0.3, 0.0, -0.7])
    poses = fan.reach(between, {"bob": target_position})
    assert poses
    lengths = [np.hypot(1.3, 0.7), np.hypot(0.7, 0.7)]
    np.testing.assert_allclose(poses.q_K[0], lengths, atol=1e-6)


def test_contradictory_places_are_weighted():
    """Two places of one bob contradict: the result is their weighted mean, by least squares."""
    plumb = fan.loads(PLUMB_YAML)
    first, second = np.array([0.3, 0.0, 0.8]), np.array([-0.1, 0.2, 1.2])
    upper_point = ("bob", (0.0, 0.0, 0.1))
    targets = {"bob": first, upper_point: second + np.array([0.0, 0.0, 0.1])}
    poses = fan.reach(plumb, targets, weights={upper_point: 3.0})[0]
    np.testing.assert_allclose(poses.state.q_D, (first + 3.0 * second) / 4.0, atol=1e-5)
    distance = np.linalg.norm(first - second)
    assert not poses
    assert poses.distances == pytest.approx(
        {"bob": 0.75 * distance, "bob at (0, 0, 0.1)": 0.25 * distance}, abs=1e-5
    )
    with pytest.raises(fan.errors.UnknownNameError, match="no target is called 'bib'"):
        fan.reach(plumb, targets, weights={"bib": 1.0})
    with pytest.raises(ValueError, match="weight is 0"):
        fan.reach(plumb, targets, weights={"bob": 0.0})


def test_a_target_without_weight_is_not_reached():
    """Weights choose the pose; its success depends on distance and bounds."""
    between = fan.loads(BETWEEN_YAML)
    target_position = np.array([1.4, 0.0, -0.7])
    pose = fan.reach(between, {"bob": target_position}, weights={"bob": 1e-12})[0]
    assert not pose and pose.distance > 0.1
    rod = fan.loads(ROD_YAML)
    tip = ("rod", (0.0, 0.0, -1.0))
    held = fan.control.Bounds(joint={"pin": (0.5, 0.8)})
    target_position = [np.sin(0.85), 0.0, -np.cos(0.85)]
    for single_pass in (False, True):
        poses = fan.reach(
            rod, {tip: target_position}, bounds=held, single_pass=single_pass, tolerance=0.06
        )
        assert not poses or poses.q_D[0, 0] <= 0.8 + 1e-6


def test_a_path_is_followed_pose_by_pose(marionette):
    """Each pose starts from the previous one only: the poses equal those of a repeated search."""
    x = marionette.rest()
    places = hand_position(marionette, x) + np.linspace(0, 1, 30)[:, None] * [0.03, -0.04, 0.08]
    poses = fan.reach(marionette, {HAND: places}, x, single_pass=True)
    assert poses and poses.distance.max() < 1e-6
    for pose in (poses[7], poses[29]):
        assert np.abs(marionette.forward_dynamics(pose.state).acc_D).max() < 1e-6
    rod = fan.loads(ROD_YAML)
    path_beyond_reach = np.linspace([0.6, 0.0, -0.8], [1.2, 0.0, -1.6], 20)
    poses_beyond_reach = fan.reach(
        rod, {("rod", (0, 0, -1.0)): path_beyond_reach}, single_pass=True
    )
    np.testing.assert_allclose(poses_beyond_reach.distance, np.linspace(0.0, 1.0, 20), atol=1e-5)
    assert poses_beyond_reach[0] and not poses_beyond_reach[19]


@pytest.mark.parametrize("slack", [False, True])
def test_beside_its_ends_a_bob_hangs_from_one_string(slack):
    """Beyond x = 1 the left string would push: both pull between the ends only."""
    between = fan.loads(BETWEEN_YAML)
    target_position = np.array([1.4, 0.0, -0.7])
    pose = fan.reach(between, {"bob": target_position}, slack=slack)[0]
    assert not pose
    if slack:
        assert pose.state.q_D == pytest.approx([1.0, -0.7], abs=1e-5)
        assert pose.distance == pytest.approx(0.4, abs=1e-6)
    else:
        min_tension = 5e-3 * between.weight
        assert pose.tension["left"] == pytest.approx(min_tension, rel=1e-4)
        assert "left would pull with less than" in pose.limits[0]


def test_an_arm_reaches_up_to_its_length():
    rod = fan.loads(ROD_YAML)
    for target_position in ([1.5, 0.0, -0.8], [0.4, 0.0, -0.2]):
        pose = fan.reach(rod, {("rod", (0, 0, -1.0)): target_position})[0]
        size = np.hypot(target_position[0], target_position[2])
        assert pose.distance == pytest.approx(abs(size - 1.0), abs=1e-6)
        tip = rod.pose(pose.state, "rod")[:3, 2] * -1.0
        np.testing.assert_allclose(tip, np.array(target_position) / size, atol=1e-4)
        assert pose.limits[0].startswith("no driven coordinate moves rod any further")


def test_poses_hang_and_inputs_move_them_by_their_derivatives(marionette):
    """Each pose is an equilibrium that rest finds too; dq_D/dq_K is that of rest."""
    x = marionette.rest()
    places = hand_position(marionette, x) + np.linspace(0, 1, 9)[:, None] * [0.03, -0.04, 0.08]
    poses = fan.reach(marionette, {HAND: places}, x)
    assert poses and poses.iterations.max() <= 8
    pose = poses[4]
    assert np.abs(marionette.forward_dynamics(pose.state).acc_D).max() < 1e-7
    assert hand_position(marionette, pose.state) == pytest.approx(places[4], abs=1e-6)
    repeated = marionette.rest(pose.state)
    assert np.abs(marionette.difference(pose.state.q_D, repeated.q_D)).max() < 1e-7
    k, step = marionette.coordinates.v_K.index("hand_right.length"), 1e-4
    rests = []
    for change in (step, -step):
        q_K = pose.state.q_K.copy()
        q_K[k] += change
        rests.append(marionette.rest(pose.state.replace(q_K=q_K)))
    slope = marionette.difference(rests[1].q_D, rests[0].q_D) / (2.0 * step)
    # Legs that hang straight turn about themselves almost freely: rest leaves their angle.
    turning_rows = [
        i
        for i, v in enumerate(marionette.coordinates.v_D)
        if v.startswith("hip") and v.endswith("wz")
    ]
    other_rows = np.setdiff1d(np.arange(25), turning_rows)
    assert len(other_rows) == 23
    differences = np.abs(poses.jacobian[4][other_rows, k] - slope[other_rows])
    assert differences.max() < 1e-6 * np.abs(slope).max()


def test_the_marionettes_hand_is_as_near_as_with_scipy(marionette):
    """The place is too high for the hand's own string: SciPy over rests finds no nearer pose."""
    x = marionette.rest()
    moved_names = ["hand_right.x", "hand_right.length"]
    columns = [marionette.coordinates.q_K.index(name) for name in moved_names]
    held = tuple(name for name in marionette.coordinates.v_K if name not in moved_names)
    target_position = hand_position(marionette, x) + np.array([0.0, 0.15, 0.05])
    pose = fan.reach(marionette, {HAND: target_position}, x, bounds=fan.control.Bounds(held=held))[
        0
    ]
    assert pose.status is fan.control.AnswerStatus.OUT_OF_REACH and pose.distance > 0.05

    def distance_by(u: np.ndarray) -> float:
        q_K = x.q_K.copy()
        q_K[columns] = u
        hanging = marionette.rest(x.replace(q_K=q_K))
        return float(np.linalg.norm(hand_position(marionette, hanging) - target_position))

    options = {"xatol": 1e-4, "fatol": 1e-8, "maxfev": 150}
    best = minimize(distance_by, x.q_K[columns], method="Nelder-Mead", options=options)
    assert pose.distance == pytest.approx(best.fun, abs=2e-6)
    assert distance_by(pose.state.q_K[columns]) == pytest.approx(pose.distance, abs=1e-8)


def test_poses_begin_at_the_nearest_one_found_before(marionette):
    """Alternating places of two distant groups cost as little as those of one."""
    hanging = marionette.rest()
    rest_position = hand_position(marionette, hanging)
    rng, n = np.random.default_rng(0), 20
    near_places = rest_position + 1e-3 * rng.normal(size=(n, 3))
    distant_places = rest_position + np.array([0.1, 0.0, 0.1]) + 1e-3 * rng.normal(size=(n, 3))
    alternating = np.empty((2 * n, 3))
    alternating[::2], alternating[1::2] = near_places, distant_places
    poses = fan.reach(marionette, {HAND: alternating}, hanging)
    assert all(poses)
    assert poses.iterations[1] > 4 > np.median(poses.iterations[2:])
    assert poses.iterations[2:].sum() < 3 * len(alternating)
    repeated = fan.reach(marionette, {HAND: [*alternating[:2], alternating[0]]}, hanging)
    np.testing.assert_allclose(repeated.q_D[2], repeated.q_D[0], atol=1e-9)


def test_a_knee_rises_when_its_slack_string_comes_taut(marionette):
    x = marionette.rest()
    assert "knee_left" not in fan.reach(marionette, {HAND: hand_position(marionette, x)}, x)[0].taut
    knee = marionette.pose(x, "shin_left")[:3, 3]
    pose = fan.reach(
        marionette,
        {"shin_left": [np.nan, np.nan, knee[2] + 0.05]},
        x,
        bounds=fan.control.Bounds(
            held=tuple(n for n in marionette.coordinates.v_K if not n.startswith("knee_left"))
        ),
    )[0]
    assert pose and "knee_left" in pose.taut
    assert marionette.pose(pose.state, "shin_left")[2, 3] == pytest.approx(knee[2] + 0.05, abs=1e-6)


def test_a_tie_lets_a_lever_down_lowest_where_its_string_is_square_to_it():
    """The string's end and length are fixed; the tip's height follows from the law of cosines."""
    lever = fan.loads(LEVER_YAML)
    target = {("rod", (0, 0, -1.0)): [np.nan, np.nan, -9.0]}
    pose = fan.reach(lever, target, parameters={"tie": (-0.9, -0.4)})[0]

    def height(a: float) -> float:
        c = np.hypot(0.8, 0.2)
        angle = np.arccos((a * a + c * c - 0.25) / (2.0 * a * c))
        return float(np.sin(np.arctan2(0.2, 0.8) - angle))

    best = minimize_scalar(height, bounds=(0.4, 0.9), method="bounded", options={"xatol": 1e-9})
    assert best.x == pytest.approx(np.sqrt(0.68 - 0.25), abs=1e-6)
    assert pose.parameters["tie"] == pytest.approx(-best.x, abs=1e-4)
    assert pose.distance == pytest.approx(9.0 + best.fun, abs=1e-7)


def test_the_place_of_a_knees_string_is_confirmed_by_a_sweep():
    """An attachment in front of the thigh lifts the knee highest for a given motion of the hand."""
    file = importlib.resources.files("fantoccini") / "model" / "puppets" / "marionette.yaml"
    text = file.read_text()
    fixed_point = "at: [0.018, 0, -0.115]}"
    parameter_point = "at: [{parameter: tie, value: 0.018}, 0, -0.09]}"
    tied_text = text.replace(fixed_point, parameter_point)
    tied_puppet = fan.loads(tied_text.replace("puppet: marionette", "puppet: tied", 1))
    start = tied_puppet.rest(
        dict(zip(tied_puppet.coordinates.q_K, tied_puppet.rest().q_K, strict=True))
        | {"knee_left.length": 0.95}
    )
    tie_range, held = (0.0, 0.06), tuple(tied_puppet.coordinates.v_K)
    pose = fan.reach(
        tied_puppet,
        {"shin_left": [np.nan, np.nan, 9.0]},
        start,
        bounds=fan.control.Bounds(held=held),
        parameters={"tie": tie_range},
    )[0]
    ties, heights = np.linspace(*tie_range, 17), []
    for tie in ties:
        swept_puppet = tied_puppet.with_parameters({"tie": float(tie)})
        heights.append(swept_puppet.pose(swept_puppet.rest(start), "shin_left")[2, 3])
    best = float(ties[int(np.argmax(heights))])
    assert abs(pose.parameters["tie"] - best) <= ties[1] - ties[0]
    assert 9.0 - pose.distance >= max(heights) - 1e-6


def test_follow_warns_of_targets_out_of_reach():
    plumb = fan.loads(PLUMB_YAML)
    bounds = fan.control.Bounds(position={"line.x": (-0.1, 0.1)})
    message = r"bob hangs no nearer than 200 mm .* line.x would have to be above 0.1"
    with pytest.warns(UserWarning, match=message):
        fan.follow(plumb, {"bob": [0.3, 0.0, 1.0]}, 0.4, bounds=bounds, iterations=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fan.follow(plumb, {"bob": [0.05, 0.0, 1.0]}, 0.4, bounds=bounds, iterations=1)


def test_mistakes_are_named():
    plumb = fan.loads(PLUMB_YAML)
    with pytest.raises(fan.errors.UnknownNameError, match="bobb"):
        fan.reach(plumb, {"bobb": [0, 0, 1]})
    with pytest.raises(fan.errors.StateError, match="has the shape"):
        fan.reach(plumb, {"bob": [0, 0]})
    with pytest.raises(fan.errors.StateError, match="infinite"):
        fan.reach(plumb, {"bob": [0, 0, np.inf]})
    with pytest.raises(fan.errors.UnknownNameError, match="tie"):
        fan.reach(plumb, {"bob": [0, 0, 1]}, parameters={"tie": (0, 1)})
    falling = plumb.state({"bob.x": 0.3, "line.length": np.hypot(0.3, 1.0)})
    with pytest.raises(fan.errors.StateError, match="does not hang"):
        fan.reach(
            plumb,
            {"bob": [0, 0, 1]},
            falling.replace(taut=np.array([False])),
            bounds=fan.control.Bounds(held=("line.x",)),
            slack=True,
        )
