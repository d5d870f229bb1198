"""Motions that keep clear of obstacles, and of the puppet's own body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.optimal.clear_rows import ClearanceRows
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.dynamics.clearance import Clearance

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

POST, RADIUS = np.array([0.9, 0.0, -0.9]), 0.1 + 0.05


@pytest.fixture(scope="module")
def ball_arm() -> fan.Marionette:
    """A rod on a string, and a ball that swings at its end, near a post."""
    return fan.loads("""
puppet: arm
bodies:
- name: rod
  joint: {name: pin, type: revolute, axis: [0, -1, 0]}
  mass: 1.0
  com: [0, 0, -0.5]
  inertia: [0.1, 0.1, 0.001]
  shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -1], radius: 0.03}]
- name: ball
  parent: rod
  joint: {name: swing, type: revolute, axis: [0, -1, 0], at: [0, 0, -1], damping: 0.05}
  mass: 0.3
  com: [0, 0, -0.2]
  inertia: [0.002, 0.002, 0.001]
  shapes: [{type: sphere, at: [0, 0, -0.2], radius: 0.05}]
strings:
- name: line
  path: [{body: rod, at: [0, 0, -0.6]}, {driven: [x, z], at: [0.8, 0, 0.2]}]
  length: driven
pose: {pin: 60 deg, swing: -60 deg, line.length: 0.5}
obstacles:
- {name: post, type: sphere, at: [0.9, 0, -0.9], radius: 0.1}
""")


def lowering(ball_arm: fan.Marionette, clearance: float | None = None) -> fan.Task:
    """The ball moves down past the post, to a place where it would touch it."""
    x0 = ball_arm.rest()
    ball_position = (ball_arm.pose(x0, "ball") @ [0, 0, -0.2, 1])[:3]
    target = ball_position + np.array([0.12, 0.0, -0.25])
    tracks = [
        fan.control.Track.point("ball", target, at=(0, 0, -0.2), weight=10, end_weight=1e3),
        fan.control.Track.velocity("*", 0.0, weight=0.1, end_weight=10.0),
    ]
    limits = fan.control.Bounds(acceleration=10.0, clearance=clearance).with_taut_strings(
        ball_arm, x0
    )
    smooth = fan.control.Smooth(1e-2, 1e-5)
    return fan.Task(ball_arm, x0, 2.0, tracks, smooth, limits, interval=0.04, dt=0.01)


def test_clearances_of_all_parts_are_those_of_the_whole():
    puppet = fan.puppets.marionette_bar()
    whole_clearance = Clearance(
        puppet,
        [{"name": "b", "type": "box", "size": [0.2, 0.2, 0.2], "at": [0.3, 0, 0.5]}],
        self_collision=True,
    )
    part_clearances = whole_clearance.parts()
    rest = puppet.rest()
    random = np.random.default_rng(1)
    q_D = np.repeat(rest.q_D[None], 50, axis=0)
    scalars = [q for q, _ in puppet.coordinates.scalars_D]
    q_D[:, scalars] += 0.3 * random.normal(size=(50, len(scalars)))
    part_distances = np.array([part.at(q_D, rest.q_K) for part in part_clearances.values()])
    assert len(part_clearances) > 5 and np.min(part_distances, axis=0) == pytest.approx(
        whole_clearance.at(q_D, rest.q_K)
    )
    assert any(name.startswith("string ") for name in part_clearances)


def test_obstacles_of_a_task_count_as_those_of_the_file_do(ball_arm: fan.Marionette):
    task = replace(lowering(ball_arm.with_obstacles([]), 0.02), obstacles=ball_arm.puppet.obstacles)
    with_task_obstacles, with_file_obstacles = (
        fan.optimise(task_version, iterations=2)
        for task_version in (task, lowering(ball_arm, 0.02))
    )
    assert (
        with_task_obstacles.cost == with_file_obstacles.cost
        and with_task_obstacles.violation == with_file_obstacles.violation
    )


def test_pictures_show_the_obstacles_of_a_task(ball_arm: fan.Marionette):
    task = replace(lowering(ball_arm.with_obstacles([]), 0.02), obstacles=ball_arm.puppet.obstacles)
    assert task.drawn_marionette.puppet.obstacles == ball_arm.puppet.obstacles


def test_obstacles_of_a_task_are_avoided_without_a_clearance(ball_arm: fan.Marionette):
    """A plan of the same task avoids them too."""
    task = replace(lowering(ball_arm.with_obstacles([])), obstacles=ball_arm.puppet.obstacles)
    assert np.min(Clearance(ball_arm).of(fan.optimise(task).run)) > -1e-3


def test_values_and_derivatives_are_those_of_two_spheres(ball_arm: fan.Marionette):
    rows = ClearanceRows(ball_arm, 0.02, self_collision=False)
    nodes = Nodes.constant(ball_arm, ball_arm.rest().replace(q_D=np.array([0.9, -0.6])), 1.0, 2)
    j = rows.names.index("ball")
    pin, swing = nodes.q_D[1]

    def ball_position(pin: float, swing: float) -> np.ndarray:
        ball_direction = np.array([np.sin(pin + swing), 0.0, -np.cos(pin + swing)])
        return np.array([np.sin(pin), 0.0, -np.cos(pin)]) + 0.2 * ball_direction

    offset = ball_position(pin, swing) - POST
    assert rows.value(nodes)[0, j] == pytest.approx(np.linalg.norm(offset) - RADIUS, abs=1e-12)
    normal = offset / np.linalg.norm(offset)
    tangent = np.array([np.cos(pin + swing), 0.0, np.sin(pin + swing)])
    velocity_of_pin = np.array([np.cos(pin), 0.0, np.sin(pin)]) + 0.2 * tangent
    assert rows.value(nodes)[0, j] < 0.1
    expected = [normal @ velocity_of_pin, normal @ (0.2 * tangent)]
    assert rows.derivatives(nodes)[0, j, :2] == pytest.approx(expected, abs=1e-5)
    assert not np.any(rows.derivatives(nodes)[0, j, 2:])


def test_a_ball_goes_round_a_post(ball_arm: fan.Marionette):
    heedless = fan.optimise(lowering(ball_arm))
    assert np.min(Clearance(ball_arm).of(heedless.run)) < -0.01
    best = fan.optimise(lowering(ball_arm, clearance=0.02))
    assert best.holds, best.summary()
    assert best.cost > heedless.cost
    dense = fan.simulate(ball_arm, best.task.x0, best.inputs, t_end=2.0)
    assert np.min(Clearance(ball_arm).of(dense)) >= 0.02 - 1e-3
    assert np.min(Clearance(ball_arm).of(best.run)) == pytest.approx(0.02, abs=1e-4)


def test_a_motion_that_begins_too_near_is_violated(ball_arm: fan.Marionette):
    best = fan.optimise(lowering(ball_arm, clearance=0.4), iterations=5)
    assert not best and best.status is fan.control.AnswerStatus.VIOLATED
    assert best.violation > 0.01


def test_bodies_of_one_puppet_keep_apart_on_request():
    puppet = fan.puppets.marionette()
    nodes = Nodes.constant(puppet, puppet.rest(), 1.0, 1)
    j = ClearanceRows(puppet, 0.01, self_collision=True).names.index("forearm_right")
    clearances = [
        ClearanceRows(puppet, 0.01, self_collision=own_body).value(nodes)[0, j]
        for own_body in (True, False)
    ]
    assert clearances[0] < clearances[1]
