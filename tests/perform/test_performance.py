"""Gentle motions of hands: targets are reached exactly, and velocities do not jump."""

from __future__ import annotations

import inspect
import threading

import numpy as np
import pytest
from tests.perform.hands import hands_of

import fantoccini as fan
from fantoccini.base import rotation
from fantoccini.theatre.perform import reach

pytestmark = pytest.mark.medium

CRANES_PUPPET = """
puppet: bridge
bodies:
  - {name: bridge, joint: {type: prismatic, axis: [0, 1, 0], at: [0, 0, 3], driven: true}}
  - name: trolley
    parent: bridge
    joint: {type: prismatic, axis: [1, 0, 0], driven: true}
  - {name: arm, joint: {type: revolute, axis: [0, 0, 1], at: [2, 0, 3], driven: true}}
  - {name: head, joint: {type: ball, at: [0, 2, 3], driven: true}}
  - name: load
    joint: {type: translation, axes: [x, y, z], damping: 0.4}
    shapes: [{type: sphere, radius: 0.05, mass: {parameter: m, value: 1.0}}]
strings:
  - {name: hoist, path: [{body: load}, {body: trolley}], length: driven}
pose: {load.z: 2.0, hoist.length: 1.0}
"""


def turn_between(p, q) -> float:
    """Angle between two orientations [rad]."""
    return float(np.linalg.norm(rotation.between(p, q)))


@pytest.fixture(scope="module")
def bar():
    return fan.puppets.marionette_bar()


@pytest.fixture(scope="module")
def bridge_crane():
    return fan.loads(CRANES_PUPPET)


def test_methods_have_their_arguments_and_documentation():
    """The public methods include those that set targets."""
    public = {name: f for name, f in vars(fan.Performance).items() if not name.startswith("_")}
    assert all(f.__doc__ for f in public.values())
    move = inspect.signature(fan.Performance.move)
    assert list(move.parameters) == ["self", "name", "position", "wxyz"]
    assert {"place", "wind", "hold", "play", "play_take", "lead_back", "set_hand_law"} < set(public)


def test_quaternions_of_matrices():
    rng = np.random.default_rng(0)
    turns = np.concatenate([rng.normal(size=(50, 4)), np.eye(4), 1e-9 + np.eye(4)])
    for q in rotation.normalised(turns):
        turned_back = rotation.quaternion(rotation.matrix(q))
        assert min(np.max(np.abs(turned_back - q)), np.max(np.abs(turned_back + q))) < 1e-14


def test_a_puppet_hangs_at_rest_and_stays(marionette):
    live = fan.Performance(marionette)
    before = live.state
    live.advance(1.0)
    assert live.t == pytest.approx(1.0)
    assert np.max(np.abs(live.state.v_D)) < 1e-3
    assert np.max(np.abs(live.state.q_D - before.q_D)) < 1e-3
    assert np.sum(live.tension) == pytest.approx(marionette.weight, rel=0.05)
    assert live.lagging == {} and np.all(live.slip == 0)


def test_a_dragged_string_end_arrives_exactly_and_stays(marionette):
    live = fan.Performance(marionette)
    assert [h.kind for h in live.handles] == ["end"] * 7
    start_position, orientation = live.place("hand_left")
    live.move(
        "hand_left", start_position + np.array([0.08, 0.03, 0.2])
    )  # up is not one of its axes
    assert np.allclose(
        live.target("hand_left")[0], start_position + np.array([0.08, 0.03, 0.0]), atol=1e-15
    )
    live.advance(1.5)
    assert np.allclose(
        live.place("hand_left")[0], start_position + np.array([0.08, 0.03, 0.0]), atol=1e-14
    )
    assert np.array_equal(live.place("hand_left")[1], orientation)
    assert np.all(live.state.v_K == 0) or np.max(np.abs(live.state.v_K)) < 1e-13
    live.wind("hand_left", live.length("hand_left") - 0.05)
    live.advance(1.5)
    assert live.length("hand_left") == pytest.approx(live.target_length("hand_left"), abs=1e-14)
    assert live.lagging == {}


def test_a_control_bar_is_moved_and_turned_at_once(bar):
    live = fan.Performance(bar)
    (handle,) = live.handles
    assert (handle.name, handle.kind, handle.joint) == ("bar", "body", "free")
    assert handle.axes.shape == handle.turn_axes.shape == (3, 3)
    start_position, orientation = live.place("bar")
    turned = rotation.multiply(orientation, rotation.exp(np.array([0.2, -0.3, 0.4])))
    live.move("bar", start_position + np.array([0.1, -0.1, 0.05]), -3.0 * turned)
    live.advance(2.0)
    position, wxyz = live.place("bar")
    assert np.allclose(position, start_position + np.array([0.1, -0.1, 0.05]), atol=1e-14)
    assert turn_between(wxyz, turned) < 1e-13
    assert np.max(np.abs(live.state.v_K)) < 1e-12


def test_handles_of_every_joint_go_where_their_joint_lets_them(bridge_crane):
    live = fan.Performance(bridge_crane)
    kinds = {h.name: (h.joint, len(h.axes), len(h.turn_axes)) for h in live.handles}
    assert kinds == {
        "bridge": ("prismatic", 1, 0),
        "trolley": ("prismatic", 1, 0),
        "arm": ("revolute", 0, 1),
        "head": ("ball", 0, 3),
    }
    turn_about_z = rotation.exp(np.array([0.0, 0.0, 2.5]))
    tilted = rotation.exp(np.array([0.5, 1.0, -2.0]))
    live.move("bridge", [7.0, 0.4, -2.0])
    live.move("trolley", [0.3, 9.0, 9.0])
    live.move(
        "arm",
        [5.0, 5.0, 5.0],
        rotation.multiply(turn_about_z, rotation.exp(np.array([1e-3, 0, 0]))),
    )
    live.move("head", None, tilted)
    live.advance(4.0)
    assert np.allclose(live.place("bridge")[0], [0.0, 0.4, 3.0], atol=1e-13)
    # The trolley moves with the bridge.
    assert np.allclose(live.place("trolley")[0], [0.3, 0.4, 3.0], atol=1e-13)
    assert turn_between(live.place("arm")[1], turn_about_z) < 2e-3
    assert np.allclose(live.place("arm")[0], [2.0, 0.0, 3.0], atol=1e-15)
    assert turn_between(live.place("head")[1], tilted) < 1e-12
    for name in ("bridge", "trolley", "arm", "head"):
        (p, q), (at, turn) = live.place(name), live.target(name)
        assert np.allclose(p, at, atol=1e-12) and turn_between(q, turn) < 1e-7


def test_driven_velocity_is_continuous_and_bounded(bar):
    live = fan.Performance(bar)
    live.record()
    rng = np.random.default_rng(3)
    start_position, _ = live.place("bar")
    for _ in range(12):
        live.move("bar", start_position + 0.2 * rng.normal(size=3), rng.normal(size=4))
        live.advance(rng.uniform(0.05, 0.4))
    recording = live.stop()
    assert recording.end_reason == ""
    inputs, hands = recording.inputs, hands_of(live)
    inside = recording.times[1:-1]
    q_0, v_0, _ = inputs.evaluate(np.nextafter(inside, 0.0))
    q_1, v_1, _ = inputs.evaluate(np.nextafter(inside, 10.0))
    assert np.max(np.abs(v_1 - v_0)) < 1e-11
    assert np.max(np.abs(q_1 - q_0)) < 1e-11
    run = recording.trajectory
    # The run followed the recorded input.
    assert np.max(np.abs(run.v_K[1:-1] - v_1)) < 1e-11
    for v, acc in zip(run.v_K, recording.acc_K, strict=False):
        assert np.all(reach.lengths(v, hands.group, 2) <= hands.speed * (1 + 1e-12))
        assert np.all(reach.lengths(acc, hands.group, 2) <= hands.acceleration * (1 + 1e-12))


def test_targets_may_be_set_from_other_threads(marionette):
    live = fan.Performance(marionette)
    homes = {h.name: live.place(h.name)[0] for h in live.handles}
    stop, failures = threading.Event(), []

    def drag(names, seed):
        rng = np.random.default_rng(seed)
        try:
            while not stop.is_set():
                for name in names:
                    live.move(name, homes[name] + 0.1 * rng.normal(size=3))
                    live.place(name), live.target(name), live.lagging, live.state
        except Exception as error:
            failures.append(error)

    names = list(homes)
    threads = [
        threading.Thread(target=drag, args=(group, i))
        for i, group in enumerate((names[:4], names[3:]))
    ]
    for thread in threads:
        thread.start()
    live.advance(2.0)
    stop.set()
    for thread in threads:
        thread.join()
    assert failures == []
    assert live.t == pytest.approx(2.0)
    assert np.all(np.isfinite(live.state.q_D))


def test_whole_ticks_are_simulated_and_the_remainder_is_kept(marionette):
    live = fan.Performance(marionette, tick=0.01)
    live.advance(0.025)
    assert live.t == pytest.approx(0.02)
    live.advance(0.005)
    assert live.t == pytest.approx(0.03)
    live.step()
    assert live.t == pytest.approx(0.04)


def test_reset_restores_the_start(bar):
    live = fan.Performance(bar)
    before = live.state
    live.move("bar", [1.0, 0.0, 1.0])
    live.advance(0.5)
    live.reset()
    for name in ("q_D", "v_D", "q_K", "v_K", "slip"):
        assert np.array_equal(getattr(live.state, name), getattr(before, name)), name
    live.advance(0.5)
    assert np.array_equal(live.state.q_K, before.q_K)


def test_parameters_change_during_a_performance(bridge_crane):
    live = fan.Performance(bridge_crane)
    live.move("trolley", [0.5, 0, 3])
    live.advance(0.2)
    before, pull = live.state, live.tension[0]
    assert live.set_parameters({"m": 2.0}) == ()
    after = live.state
    assert np.allclose(after.q_D, before.q_D, atol=1e-5) and after.t == before.t
    assert np.allclose(live.target("trolley")[0], [0.5, 0, 3])
    live.advance(6.0)
    assert live.tension[0] == pytest.approx(2 * 9.81, rel=0.05)
    assert live.tension[0] > 1.5 * pull
    with pytest.raises(fan.errors.UnknownNameError):
        live.set_parameters({"mass": 1.0})
    live.reset()
    live.advance(0.1)
    assert live.tension[0] == pytest.approx(2 * 9.81, rel=0.01)


def test_a_changed_puppet_continues_where_names_are_the_same(bridge_crane):
    live = fan.Performance(bridge_crane)
    live.move("bridge", [0, 0.3, 0])
    live.move("head", None, rotation.exp(np.array([0.3, 0.0, 0.0])))
    live.advance(0.3)
    before = live.state
    shorter = CRANES_PUPPET.replace("{name: head, joint", "{name: skull, joint").replace(
        "z: 2.0, hoist.length: 1.0", "z: 2.2, hoist.length: 0.8"
    )
    lost = live.replace(fan.loads(shorter))
    assert "head.qw is gone" in lost and "skull.qw is new" in lost
    names = live.marionette.coordinates.q_K
    places = [names.index(n) for n in ("bridge", "trolley", "hoist.length")]
    places_before = [bridge_crane.coordinates.q_K.index(names[i]) for i in places]
    assert np.array_equal(live.state.q_K[places], before.q_K[places_before])
    assert np.allclose(live.target("bridge")[0], [0, 0.3, 3.0])
    live.advance(3.0)
    assert np.allclose(live.place("bridge")[0], [0, 0.3, 3.0], atol=1e-13)
    with pytest.raises(fan.errors.UnknownNameError, match="skull"):
        live.place("head")


def test_a_puppet_whose_strings_became_too_short_is_wound_up(bridge_crane):
    live = fan.Performance(bridge_crane)
    fixed = CRANES_PUPPET.replace("length: driven", "length: 0.5").replace(
        "{load.z: 2.0, hoist.length: 1.0}", "{load.z: 2.5}"
    )
    live.replace(fan.loads(fixed))
    for _ in range(240):
        assert np.all(np.isfinite(live.step().q_D))
    live.advance(3.0)
    assert live.state.q_D[2] == pytest.approx(2.5, abs=5e-3)
    assert live.slip[0] < 1e-6


def test_mistakes_are_named_and_change_nothing(bridge_crane):
    live = fan.Performance(bridge_crane)
    with pytest.raises(fan.errors.UnknownNameError, match="trolley"):
        live.move("troley", [0, 0, 0])
    with pytest.raises(fan.errors.StateError, match="three finite numbers"):
        live.move("trolley", [0, np.nan, 0])
    with pytest.raises(fan.errors.StateError, match="quaternion"):
        live.move("head", None, [0, 0, 0, 0])
    with pytest.raises(fan.errors.StateError, match="finite"):
        live.wind("hoist", np.inf)
    with pytest.raises(fan.errors.UnknownNameError, match="hoist"):
        live.wind("hoists", 1.0)
    with pytest.raises(ValueError, match="speed"):
        fan.Performance(bridge_crane, speed=0.0)
    with pytest.raises(fan.errors.StateError, match="recorded"):
        live.stop()
    before = live.state
    live.advance(0.2)
    assert np.array_equal(live.state.q_K, before.q_K)


def test_a_puppet_with_only_driven_joints_is_performed_too():
    live = fan.Performance(
        fan.loads("""
puppet: turntable
bodies:
  - {name: table, joint: {type: revolute, axis: [0, 0, 1], driven: true}, mass: 1.0,
     inertia: [0.1, 0.1, 0.2]}
""")
    )
    live.move("table", None, [np.cos(0.3), 0.0, 0.0, np.sin(0.3)])
    live.advance(2.0)
    assert live.state.q_K[0] == pytest.approx(0.6, abs=1e-12)
