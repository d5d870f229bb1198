"""Flat sticking contacts are solved as patches: the motion obeys the law for each point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks.contact import programs
from benchmarks.contact.subject import ONE
from numpy.typing import NDArray

import fantoccini as fan

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

HERE = Path(__file__).resolve().parent
DT = 2e-3
SAME = 1e-12  # m/s and rad/s

SLOPE = """
puppet: slope
floor: 0
gravity: [3.1, 1.2, -9.2]
contact: {friction: 0.6}
bodies:
- name: body
  joint: {type: free}
  shapes:
  - {type: box, size: [0.2, 0.3, 0.1], mass: 1}
  - {type: sphere, radius: 0.02, at: [0.05, 0.08, 0.02], mass: 2}
"""

# A weight on a spring in a box slides to and fro, or turns.
SHAKEN = """
puppet: shaken
floor: 0
contact: {{friction: {friction}}}
bodies:
- name: box
  joint: {{type: free}}
  shapes: [{{type: box, size: [0.2, 0.3, 0.1], mass: 1}}]
- name: weight
  parent: box
  joint: {{type: {joint}, spring: {{stiffness: {stiffness}}}}}
  shapes: [{{type: sphere, radius: 0.03, at: [0, 0, {height}], mass: 1}}]
pose: {{box.z: 0.05, weight: {start}}}
"""

HEAP = """
puppet: wall
floor: 0
contact: {friction: 0.7}
bodies:
- {name: left, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.1, 0.1], mass: 1}]}
- {name: right, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.1, 0.1], mass: 1}]}
- {name: top, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.1, 0.1], mass: 3}]}
pose: {left.x: -0.11, left.z: 0.05, right.x: 0.11, right.z: 0.05, top.x: 0.02, top.z: 0.15}
"""


class Course:
    """Output of patches.cpp, by step."""

    def __init__(self, marionette: fan.Marionette, x: fan.State, steps: int):
        program = programs.compile_scene(marionette, DT, HERE / "patches.cpp")
        rows: NDArray = np.array(program.numbers(x, str(steps))).reshape(steps, 6)
        self.apart, self.speed, held, self.points, self.residual, self.alone = rows.T
        self.held = held > 0.5

    def is_lawful(self) -> bool:
        """Whether the velocities agree with the solver for points, up to its residual."""
        same = self.apart <= SAME + self.alone
        return bool(np.all(self.residual <= 1e-10) and np.all(same))


def test_a_box_pressed_off_its_middle_on_a_slope_is_held_as_a_patch():
    block = fan.loads(SLOPE)
    place = {"body.z": 0.05, "body.rotation": (0.9, 0.0, 0.0, 0.19**0.5)}
    course = Course(block, block.state(place), 200)
    assert course.is_lawful()
    assert course.held[20:].all()
    assert np.all(course.points[20:] == 4), "inside its corners the pressure has them all push"
    assert course.speed[20:].max() < 1e-13
    force = block.state(place)
    run = fan.simulate(block, force, t_end=0.4, method=fan.TimeStepping(dt=DT))
    weight = 3.0 * np.array([-3.1, -1.2, 9.2])
    assert np.allclose(run.contact.at_sample(len(run) - 1).force.sum(axis=0), weight, atol=1e-9)


@pytest.mark.parametrize(
    ("friction", "joint", "height", "stiffness", "start", "points", "others"),
    [
        pytest.param(0.3, "prismatic, axis: [1, 0, 0]", 0.0, 60, 0.15, 4, 100, id="slides"),
        pytest.param(2.0, "prismatic, axis: [1, 0, 0]", 0.3, 60, 0.08, 2, 0, id="tips"),
        pytest.param(0.3, "revolute, axis: [0, 0, 1]", 0.0, 1.0, 1.2, 4, 100, id="turns"),
    ],
)
def test_a_patch_is_left_when_it_slides_tips_or_turns(
    friction, joint, height, stiffness, start, points, others
):
    """Pushed to and fro, the box sticks flat, slides, or stands on an edge."""
    text = SHAKEN.format(
        friction=friction, joint=joint, height=height, stiffness=stiffness, start=start
    )
    shaken = fan.loads(text)
    course = Course(shaken, shaken.state(), 600)
    assert course.is_lawful()
    assert course.held.sum() > 100
    assert (~course.held).sum() > others
    assert set(course.points) >= {points, 4}


def test_a_wall_has_redundant_rows():
    """Three boxes with four patches: 24 rows on 18 velocities."""
    wall = fan.loads(HEAP)
    course = Course(wall, wall.state(), 150)
    assert course.is_lawful()
    assert course.held[20:].all()
    assert course.speed[20:].max() < 1e-12


def test_a_marionette_that_is_pushed_settles_on_patches():
    """Strings are taut or slack while both feet are flat on the floor."""
    x = ONE.standing
    rng = np.random.default_rng(0)
    course = Course(ONE.marionette, x.replace(v_D=0.02 * rng.normal(size=x.v_D.shape)), 400)
    assert course.is_lawful()
    assert course.held.sum() > 100
