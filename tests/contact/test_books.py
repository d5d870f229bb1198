"""Fixed steps with contact: the ledger of impulses, and rows that become active within a step."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

BALL = fan.loads(
    """
puppet: ball
floor: 0
contact: {restitution: 0.7}
bodies: [{name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}]
pose: {b.z: 1.1}
"""
)


@pytest.mark.parametrize("dt", [0.004, 0.002])
def test_bounces_absorb_all_the_energy_of_a_fall(dt):
    """The work of gravity during their steps is not included: it was 0.25 J of 9.8 J at 2 ms."""
    run = fan.simulate(BALL, BALL.state(), t_end=3.0, method=fan.TimeStepping(dt=dt))
    assert run.ledger["kinetic"][-1] < 1e-12
    assert run.ledger["impact"][-1] == pytest.approx(9.81, abs=0.3 * dt * 9.81)
    assert abs(run.ledger["residual"][-1]) < 0.3 * dt * 9.81


def test_a_body_at_rest_loses_nothing_at_newly_loaded_corners():
    """A hand tilts and rolls a tray under a box: its corners take turns."""
    tray = fan.loads(
        """
puppet: tray
contact: {friction: 0.9}
bodies:
- name: tray
  joint: {type: ball, driven: true}
  shapes: [{type: box, size: [0.6, 0.6, 0.02], mass: 1}]
- {name: box, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.2, 0.2], mass: 1}]}
pose: {box.z: 0.11}
"""
    )
    x0 = tray.state()
    turn = {
        "tray.rotation": [
            (t, [np.cos(a / 2), np.sin(a / 2) * np.cos(3 * t), np.sin(a / 2) * np.sin(3 * t), 0])
            for t, a in zip(np.linspace(0, 2, 9), [0, *[0.08] * 7, 0], strict=True)
        ]
    }
    run = fan.simulate(tray, x0, fan.Input.waypoints(tray, turn), method="timestepping")
    carries = run.contact.force_on("box", len(run))[:, 2]
    assert carries[10:].min() > 0.5 * 9.81
    worked = np.max(np.abs(run.ledger["work"]))
    assert worked > 0.005
    assert abs(run.ledger["impact"][-1]) < 0.1 * worked
    assert np.max(np.abs(run.ledger["residual"])) < 0.1 * worked


def test_a_slack_string_pulls_in_the_step_of_an_impact_that_would_stretch_it():
    """Inactive strings and points become active before the step is complete."""
    pair = fan.loads(
        """
puppet: pair
gravity: [0, 0, 0]
contact: true
bodies:
- {name: a, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 1}]}
strings:
- {name: leash, path: [{body: b, at: [0, 0, 0]}, {world: [-1, 0, 0]}], length: 1.0005}
pose: {a.x: -0.1004}
"""
    )
    x0 = pair.state()
    x0 = x0.replace(v_D=np.where(np.arange(len(x0.v_D)) == 0, 2.0, 0.0))
    run = fan.simulate(pair, x0, t_end=0.05, method=fan.TimeStepping(dt=0.002))
    assert run.tension["leash"].max() > 100.0
    assert run.violation["leash"].max() < 1e-12
    assert run.contact.gap.min() > -1e-12
    assert np.all(np.diff(run.ledger["kinetic"]) < 1e-12)


def test_another_corner_carries_in_the_step_of_its_landing():
    """A box standing on one edge rocks onto the other; no corner passes the floor."""
    box = fan.loads(
        """
puppet: box
floor: 0
contact: {friction: 0.8}
bodies: [{name: b, joint: {type: free}, shapes: [{type: box, size: [0.1, 0.3, 0.4], mass: 1}]}]
pose: {b.z: 0.2}
"""
    )
    x0 = box.state()
    kick = x0.v_D.copy()
    kick[box.coordinates.v_D.index("b.wy")] = 0.8
    run = fan.simulate(box, box.project(x0.replace(v_D=kick)), t_end=2.0, method="timestepping")
    beside = run.contact.point[:, 0] - run.q_D[run.contact.sample, 0]
    alone = [set(np.sign(beside[run.contact.sample == i])) for i in range(len(run))]
    assert {1.0} in alone and {-1.0} in alone
    assert run.contact.gap.min() > -1e-6
    assert run.ledger["kinetic"][-1] < 1e-9
