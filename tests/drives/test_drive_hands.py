"""Hands on puppets with drives and chains: a body's target applies to all its parts."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from drives.test_drives import BOB
from fantoccini.base.errors import StateError
from fantoccini.theatre.perform.hands import Hands

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

BAR = """
puppet: bar
bodies:
  - name: bar
    joint: {type: free, driven: true, at: [0, 0, 1], orientation: {rpy: [0, 0, 0.3]}}
    mass: 0.5
    inertia: [2.0e-3, 3.0e-3, 2.0e-3]
drives:
  - {on: bar.z, mass: 0.3, control: {type: computed_torque, bandwidth: 20}}
"""
ROPE = "length: driven\n    chain: {pieces: 3, mass: 0.03, stiffness: 500, damping: 0.5}"


def test_a_body_moves_as_a_whole_where_a_drive_moves_one_axis():
    live = fan.Performance(fan.loads(BAR))
    assert [h.name for h in live.handles] == ["bar.carriage1", "bar.carriage2", "bar"]
    start, there, turned = live.place("bar")[0], np.array([0.2, 0.1, 1.3]), [0.8, 0, 0, 0.6]
    live.move("bar", there, turned)
    np.testing.assert_allclose(live.target("bar")[0], there, atol=1e-14)
    np.testing.assert_allclose(live.target("bar")[1], turned, atol=1e-14)
    live.advance(3.0)
    np.testing.assert_allclose(live.place("bar")[0], there, atol=1e-6)
    np.testing.assert_allclose(live.place("bar")[1], turned, atol=1e-9)
    live.move("bar.carriage2", start)
    live.advance(3.0)
    np.testing.assert_allclose(live.place("bar")[0], [0.2, 0.1, 1.0], atol=1e-6)


def test_a_chain_is_wound():
    """Its drive winds it, not shorter than its time steps allow."""
    puppet = fan.loads(BOB.replace("length: driven", ROPE))
    live = fan.Performance(puppet)
    at = live.marionette.coordinates.q_D.index("bob.z")
    before, (low, high) = live.state.q_D[at], live.lengths["line"]
    assert high == pytest.approx(1.6, rel=1e-2)

    def longest_step(length):
        """2 (sqrt(1 + zeta^2) - zeta) / omega of three pieces between fixed ends."""
        k, c, m = (x for x in (3 * 500 / length, 3 * 0.5 / length, 0.015))
        omega = 2 * np.sqrt(k / m) * np.cos(np.pi / 6)
        zeta = c * omega / (2 * k)
        return 2 * (np.sqrt(1 + zeta**2) - zeta) / omega

    slow = Hands.default_ranges(puppet, live.state, 0.002)["line"][0]
    for dt, shortest in ((live.dt, low), (0.002, slow)):
        assert dt <= longest_step(shortest) and (
            shortest < 0.081 or dt > longest_step(shortest / 1.13)
        )
    with pytest.raises(StateError, match="`fantoccini show` no other dt: change the pieces"):
        fan.Performance(puppet, dt=0.004, tick=0.004)
    live.wind("line", 0.6)
    live.advance(3.0)
    assert live.length("line") == pytest.approx(0.6)
    assert live.state.q_D[at] - before == pytest.approx(0.2, abs=0.01)
    live.wind("line", 0.0)
    assert live.target_length("line") == low
