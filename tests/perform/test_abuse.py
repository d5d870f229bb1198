"""Impossible targets: hands lag or slip; nothing explodes, raises or restarts."""

from __future__ import annotations

import numpy as np
import pytest
from tests.perform.hands import hands_of

import fantoccini as fan
from fantoccini.dynamics.steppers import Stepper
from fantoccini.theatre.perform import reach
from fantoccini.theatre.perform.grip import HELD_SLIP
from properties import puppets

pytestmark = [pytest.mark.slow, pytest.mark.long]

NAMES = ("arm2d", "arm3d", "crane", "marionette", "marionette_bar", "stand6", "string_pendulum")
SETTLING_NAMES = ("marionette", "marionette_bar", "stand6")
"""Puppets with enough damping to come to rest within half a minute."""
MAX_ENERGY_GAIN = 12.0
"""Largest gain of energy, relative to the puppet's weight times 1 m; the largest seen was 7."""
OTHER_NAMES = ("wire", "cable_robot", "tackle", "beads", "winches", "springs")


def energy_gain_of_throws(live: fan.Performance, throws: int, ticks: int, seed: int) -> float:
    """Handles thrown 10 m away and back, strings wound to both ends; the largest gain of energy."""
    marionette, hands, rng = live.marionette, hands_of(live), np.random.default_rng(seed)
    homes = {h.name: live.place(h.name) for h in live.handles}
    lengths = {name: live.length(name) for name in live.lengths}
    start_energy, n = sum(marionette.energies(live.state)), len(hands.names)
    max_gain, v_K = 0.0, live.state.v_K
    for throw in range(throws):
        for handle in live.handles:
            offset = rng.normal(size=3)
            offset *= 10.0 / np.linalg.norm(offset)
            position, _ = homes[handle.name]
            if throw % 2 == 0 and rng.random() < 0.7:
                live.move(handle.name, position + offset, rng.normal(size=4))
            else:
                live.move(handle.name, *homes[handle.name])
        for name, length_range in live.lengths.items():
            live.wind(name, [-1e9, 1e9, lengths[name]][rng.integers(3)])
            assert length_range[0] <= live.target_length(name) <= length_range[1]
        for _ in range(ticks):
            x = live.step()
            for array in (x.q_D, x.v_D, x.q_K, x.v_K, x.slip, live.tension):
                assert np.all(np.isfinite(array))
            max_gain = max(max_gain, sum(marionette.energies(x)) - start_energy)
            assert not any("stopped" in reason for reason in live.lagging.values())
            assert np.all(reach.lengths(x.v_K, hands.group, n) <= hands.speed * (1 + 1e-9))
            if not marionette.coordinates.quaternions_K:
                accelerations = reach.lengths(x.v_K - v_K, hands.group, n) / live.tick
                assert np.all(accelerations <= hands.acceleration * (1 + 1e-9))
            v_K = x.v_K
    for name, place in homes.items():
        live.move(name, *place)
    for name, length in lengths.items():
        live.wind(name, length)
    return max_gain


@pytest.mark.parametrize("name", NAMES)
def test_a_puppet_thrown_a_hundred_times_returns_to_rest(name):
    marionette = getattr(fan.puppets, name)()
    live = fan.Performance(marionette)
    x0 = live.state
    max_gain = energy_gain_of_throws(live, throws=100, ticks=40, seed=1)
    assert max_gain < MAX_ENERGY_GAIN * marionette.weight
    live.advance(15.0)
    # The hands return to their positions ...
    assert np.max(np.abs(hands_of(live).away(live.state.q_K, x0.q_K)), initial=0.0) < 1e-12
    assert live.lagging == {} and np.all(live.slip < 1e-6)
    if name not in SETTLING_NAMES:
        return
    # ... and the puppet returns to its rest.
    live.advance(45.0)
    assert np.max(np.abs(live.state.v_D)) < 1.0
    positions, start_positions = (marionette.poses(x.q_D, x.q_K)[:, :, 3] for x in (live.state, x0))
    assert np.max(np.abs(positions - start_positions)) < 0.08
    kinetic, potential = marionette.energies(live.state)
    assert kinetic < 1e-3 * marionette.weight
    assert potential - marionette.energies(x0)[1] < 2e-3 * marionette.weight


@pytest.mark.parametrize("name", OTHER_NAMES)
def test_wires_pulleys_and_springs_return_to_rest_too(name):
    marionette = puppets.load(name)
    live = fan.Performance(marionette)
    assert energy_gain_of_throws(live, 40, 30, seed=2) < 2 * MAX_ENERGY_GAIN * marionette.weight
    live.advance(10.0)
    assert np.all(np.isfinite(live.state.q_D))


def test_a_hand_stops_just_beyond_the_puppets_reach_and_returns_at_once():
    arm = fan.puppets.arm3d()
    live = fan.Performance(arm)
    home, _ = live.place("hand")
    live.move("hand", home + np.array([10.0, 0.0, 0.0]))
    live.advance(4.0)
    # Shoulder to string end: 0.7 m up, and 0.6 m of arm and 1 m of string: x <= sqrt(1.6^2-0.7^2).
    reached_x = live.place("hand")[0][0]
    farthest_x = np.sqrt((0.6 + live.length("hand")) ** 2 - home[2] ** 2)
    assert farthest_x - 0.03 < reached_x < farthest_x + 0.03
    assert abs(live.slip[0] - HELD_SLIP) < 0.005
    assert "limit" in live.lagging["hand"] and "slips by" in live.lagging["hand"]
    assert live.tension[0] <= live.grip * (1 + 1e-9)
    live.move("hand", home)
    live.advance(0.05)
    assert live.place("hand")[0][0] < reached_x - 0.5 * 10.0 * 0.04**2
    live.advance(2.0)
    assert np.allclose(live.place("hand")[0], home, atol=1e-13)
    assert live.lagging == {}


def test_a_hand_that_does_not_move_is_not_pushed_by_one_that_pulls():
    marionette = fan.puppets.marionette()
    live = fan.Performance(marionette)
    homes = {h.name: live.place(h.name)[0] for h in live.handles}
    live.move("hand_left", homes["hand_left"] + [10.0, 5.0, 0.0])
    for _ in range(360):
        live.step()
        for name, home in homes.items():
            if name != "hand_left":
                assert np.max(np.abs(live.place(name)[0] - home)) < 1e-13
    assert "hand_left" in live.lagging
    assert np.linalg.norm(live.place("hand_left")[0] - homes["hand_left"]) < 2.0


def test_a_wire_cannot_slip_and_holds_its_hand():
    marionette = fan.loads("""
puppet: wired
bodies:
  - name: rod
    joint: {type: revolute, axis: [0, -1, 0], damping: 1.0e-3}
    mass: 0.2
    com: [0.2, 0, 0]
    inertia: [1.0e-5, 3.0e-3, 3.0e-3]
strings:
  - {name: hold, path: [{body: rod, at: [0.4, 0, 0]}, {driven: [x, z], at: [0.3, 0, 0.6]}],
     length: 0.6, wire: true}
pose: {rod: 0.1}
""")
    live = fan.Performance(marionette, marionette.project(marionette.state()))
    home, _ = live.place("hold")
    for offset in ([10, 0, 0], [0, 0, 10], [0, 0, -10], [-10, 0, 3]):
        live.move("hold", home + np.array(offset, dtype=float))
        live.advance(3.0)
        x, _, z = live.place("hold")[0]
        assert np.hypot(x, z) <= 1.0 + 1e-3
        assert abs(marionette.constraint(live.state)[0]) < 1e-3
        assert "limit" in live.lagging["hold"]
        live.move("hold", home)
        live.advance(3.0)
        assert np.allclose(live.place("hold")[0], home, atol=1e-13)


def test_a_winch_of_the_puppet_slips_as_its_file_says():
    marionette = fan.loads("""
puppet: load
bodies:
  - name: load
    joint: {type: translation, axes: [x, z], damping: 0.5}
    shapes: [{type: sphere, radius: 0.08, mass: 1.0}]
strings:
  - {name: left, path: [{body: load}, {driven: [x], at: [-1, 0, 1]}], length: 1.2,
     max_tension: 30, rewind_speed: 0.3}
  - {name: right, path: [{body: load}, {driven: [x], at: [1, 0, 1]}], length: 1.2}
""")
    live = fan.Performance(marionette)
    live.move("left", [-3.0, 0.0, 1.0])
    live.advance(4.0)
    # Its hand is not held back: the winch lets out the missing length.
    assert np.allclose(live.place("left")[0], [-3.0, 0.0, 1.0], atol=1e-13)
    assert live.slip[0] > 1.0 and live.slip[1] == 0.0
    assert live.tension[0] == pytest.approx(30.0, rel=1e-6)
    assert live.lagging == {"left": f"winch slips by {1000 * live.slip[0]:.0f} mm"}


def test_parameters_may_change_at_random():
    arm = fan.puppets.arm2d()
    live, rng = fan.Performance(arm), np.random.default_rng(5)
    for _ in range(40):
        live.set_parameters({"m1": rng.uniform(0.01, 5.0), "m2": rng.uniform(0.01, 5.0)})
        live.move("hand", [rng.uniform(-10, 10), 0, 0])
        live.advance(0.3)
        assert np.all(np.isfinite(live.state.q_D)) and np.max(np.abs(live.state.v_D)) < 500


def test_if_the_stepper_fails_the_hands_stop_and_the_recording_ends(monkeypatch):
    arm = fan.puppets.arm2d()
    live = fan.Performance(arm)
    live.record()
    home, _ = live.place("hand")
    live.move("hand", home + np.array([0.3, 0.0, 0.0]))
    live.advance(0.1)
    real_reported, failing_steppers = Stepper.reported.fget, []  # type: ignore[attr-defined]

    def reported_status(stepper):
        """Fail for the first stepper, not for its replacements."""
        failing_steppers[:] = failing_steppers or [stepper]
        return fan.Status.NOT_SETTLED if stepper is failing_steppers[0] else real_reported(stepper)

    monkeypatch.setattr(Stepper, "reported", property(reported_status))
    x = live.step()
    assert np.all(x.v_K == 0) and np.all(np.isfinite(x.q_D))
    assert "stopped" in live.lagging["hand"]
    assert not live.recording
    recording = live.stop()
    assert len(recording) == 12 and "stopped" in recording.end_reason
    assert np.array_equal(recording.replay().q_D, recording.trajectory.q_D)
    live.advance(2.0)
    assert np.allclose(live.place("hand")[0], home + np.array([0.3, 0.0, 0.0]), atol=1e-13)
    assert live.lagging == {}
