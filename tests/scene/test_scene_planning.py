"""Plans in scenes: other puppets and props are obstacles."""

from __future__ import annotations

import pytest

import fantoccini as fan
from fantoccini.dynamics.clearance import Clearance

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

LAMP = """
puppet: lamp
bodies:
  - {name: bulb, joint: {type: translation, axes: [x, y, z], damping: 0.1},
     shapes: [{type: sphere, radius: 0.05, mass: 0.2}]}
strings:
  - {name: cord, path: [{body: bulb}, {driven: [x], at: [0, 0, 1]}], length: 0.8}
pose: {bulb.z: 0.2}
"""


@pytest.fixture(scope="module")
def scene() -> fan.Marionette:
    lamp = fan.loads(LAMP).puppet
    hook = {"type": "sphere", "radius": 0.06, "mass": 1.0}
    return fan.Marionette(
        fan.Scene.model_validate(
            {
                "scene": "s",
                "puppets": [
                    {"name": "one", "puppet": lamp},
                    {"name": "two", "puppet": lamp, "at": [0.5, 0.0, 0.0]},
                ],
                "props": [{"name": "ball", "shapes": [hook], "at": [0.0, 0.0, -0.2]}],
            }
        )
    )


def test_clearances_are_those_between_members(scene) -> None:
    x = scene.state()
    clearance = Clearance(scene)
    nearest = clearance.nearest(x)
    assert clearance.of(x) == pytest.approx(0.4 - 0.05 - 0.06)
    assert {nearest.first, nearest.second} == {"one.bulb", "ball"}
    closer = scene.state({"two.bulb.x": -0.35})
    assert clearance.of(closer) == pytest.approx(0.15 - 0.1)
    assert {(n := clearance.nearest(closer)).first, n.second} == {"one.bulb", "two.bulb"}


def test_a_plan_keeps_a_puppet_away_from_the_other(scene) -> None:
    """The first lamp's goal is the place of the second, which has to move away."""
    lamps = fan.Marionette(scene.puppet.model_copy(update={"bodies": scene.puppet.bodies[:-1]}))
    x0 = lamps.rest()
    goal = {"one.bulb.x": 0.5, "two.bulb.x": 0.4}
    plan = fan.plan(
        lamps,
        x0,
        goal,
        tolerance=0.2,
        seed=0,
        bounds=fan.control.Bounds(
            speed=1.0,
            acceleration=4.0,
            position={"one.cord.x": (-0.5, 1.5), "two.cord.x": (-1.0, 1.5)},
        ),
    )
    assert plan, plan.reason
    run = plan.verify(method="event").run
    assert float(Clearance(lamps).of(run).min()) > 0.0
