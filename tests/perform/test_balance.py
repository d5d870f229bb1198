"""Pushes on bodies, and hands that balance the puppet against them."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from tests.show.toys import TOY

import fantoccini as fan
from fantoccini.base.errors import StateError, UnknownNameError

pytestmark = pytest.mark.medium


def kicked_state(arm: fan.Marionette, size: float = 2.0) -> fan.State:
    return arm.project(arm.rest().replace(v_D=size * np.array([0.6, -0.8])))


def late_speed(arm: fan.Marionette, live: fan.Performance) -> float:
    """Largest velocity over the last part of a time."""
    live.advance(1.2)
    speeds = []
    for _ in range(20):
        speeds.append(np.max(np.abs(live.advance(0.02).v_D)))
    return max(speeds)


def test_a_push_accelerates_by_force_over_mass():
    toy = fan.loads(TOY)
    live = fan.Performance(toy)
    live.push("bob", [0.3, -0.6, 0.0])
    x = live.advance(0.05)
    # On a string of 0.6 m, the weight has changed little of it by then.
    assert x.v_D[:3] == pytest.approx([0.05, -0.1, 0.0], abs=2e-3)
    live.push("bob", None)
    y = live.advance(1.0 / 120.0)
    assert np.linalg.norm(y.v_D[:2]) < np.linalg.norm(x.v_D[:2])


def test_a_push_beside_the_centre_of_mass_turns_the_body():
    toy = fan.loads(TOY)
    live = fan.Performance(toy)
    live.push("bob", [0.01, 0.0, 0.0], at=[0.0, 0.05, 0.0])
    torque, damping, inertia = -0.05 * 0.01, 2e-2, 1e-3
    x = live.advance(0.05)
    damping_factor = 1.0 - np.exp(-damping / inertia * 0.05)
    assert x.v_D[5] == pytest.approx(torque / damping * damping_factor, rel=0.01)


def test_mistakes_of_pushes_are_named():
    live = fan.Performance(fan.loads(TOY))
    with pytest.raises(UnknownNameError):
        live.push("bib", [1.0, 0.0, 0.0])
    with pytest.raises(StateError, match="three finite numbers"):
        live.push("bob", [1.0, np.nan, 0.0])
    live.record()
    with pytest.raises(StateError, match="cannot contain pushes"):
        live.push("bob", [1.0, 0.0, 0.0])


def test_hands_calm_a_kicked_arm(arm):
    late_speeds = []
    for balanced in (False, True):
        live = fan.Performance(arm, kicked_state(arm))
        if balanced:
            live.set_hand_law(fan.theatre.Balance(live))
        late_speeds.append(late_speed(arm, live))
    assert late_speeds[1] < 0.2 * late_speeds[0]


def test_hands_stay_within_their_bounds_and_bring_the_puppet_back(arm):
    live = fan.Performance(arm, speed=0.3, acceleration=3.0)
    place = live.state.q_D
    live.set_hand_law(fan.theatre.Balance(live))
    live.push("lower", [2.0, 0.0, 0.0])
    bounds, before, distance = live.bounds, live.state.v_K, 0.0
    for k in range(240):
        if k == 18:
            live.push("lower", None)
        x = live.step()
        distance = max(distance, float(np.max(np.abs(x.q_D - place))))
        assert np.all(np.abs(x.v_K) <= np.array(list(bounds.speed.values())) + 1e-9)
        max_change = np.array(list(bounds.acceleration.values())) * live.tick
        assert np.all(np.abs(x.v_K - before) <= max_change * (1.0 + 1e-9))
        before = x.v_K
    assert distance > 0.1
    assert np.max(np.abs(x.q_D - place)) < 0.2 * distance


def test_hands_that_balance_take_no_targets(arm):
    live = fan.Performance(arm)
    name = live.handles[0].name
    live.set_hand_law(fan.theatre.Balance(live))
    with pytest.raises(StateError, match="a law moves the hands"):
        live.move(name, [0.0, 0.0, 2.0])
    live.advance(0.1)
    live.set_hand_law(None)
    assert live.target(name)[0] == pytest.approx(live.place(name)[0], abs=1e-3)
    live.move(name, live.place(name)[0] + [0.1, 0.0, 0.0])
    assert live.law is None


def test_a_reset_ends_the_balancing(arm):
    live = fan.Performance(arm)
    live.set_hand_law(fan.theatre.Balance(live))
    live.reset()
    assert live.law is None


def test_a_thread_makes_the_updates_and_counts_those_that_are_late(arm):
    live = fan.Performance(arm, kicked_state(arm, 1.0))
    law = fan.theatre.Balance(live, nodes=20, threaded=True)
    live.set_hand_law(law)
    end = time.monotonic() + 60.0
    while law.mpc is None or law.mpc.updates < 20:
        assert time.monotonic() < end and not law.message
        live.step()
        time.sleep(live.tick)
    assert f"{law.late} late" in law.summary
    # A puppet that runs ahead of the updates follows the old plan, and they come late.
    late, skipped = law.late, law.mpc.skipped
    for _ in range(5):
        live.advance(0.1)
        time.sleep(0.02)
    assert law.late + law.mpc.skipped > late + skipped
    live.set_hand_law(None)
    assert "balance" not in [thread.name for thread in threading.enumerate()]
    n = law.mpc.updates
    live.advance(0.1)
    assert law.mpc.updates == n
