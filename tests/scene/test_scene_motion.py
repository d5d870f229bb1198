"""Members of a scene move as they do alone."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.slow

TOY = """
puppet: toy
bodies:
  - {name: upper, joint: {type: ball, damping: 0.01, at: [0, 0, 1]},
     shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.4], radius: 0.03, mass: 0.5}]}
  - {name: lower, parent: upper, joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, -0.4]},
     shapes: [{type: capsule, from: [0, 0, 0], to: [0.3, 0, 0], radius: 0.03, mass: 0.3}]}
strings:
  - {name: hand, path: [{body: lower, at: [0.3, 0, 0]}, {driven: [x, y], at: [0.2, 0.1, 1.6]}],
     length: driven}
  - {name: wall, path: [{body: upper, at: [0, 0, -0.2]}, {world: [0.6, 0.5, 0.9]}], length: 0.9}
"""
SCENE = {
    "scene": "s",
    "puppets": [
        {
            "name": "one",
            "at": [1.0, -2.0, 0.5],
            "orientation": {"axis": [0.0, 0.0, 1.0], "angle": 2.0},
        },
        {"name": "two", "pose": {"lower": 0.4}},
    ],
    "props": [
        {
            "name": "ball",
            "shapes": [{"type": "sphere", "radius": 0.1, "mass": 1.0}],
            "at": [0.0, 0.0, 3.0],
        }
    ],
}
METHODS = ["event", "timestepping", "variational"]


@pytest.fixture(scope="module")
def alone() -> fan.Marionette:
    return fan.loads(TOY)


@pytest.fixture(scope="module")
def scene(alone) -> fan.Marionette:
    members = [member | {"puppet": alone.puppet} for member in SCENE["puppets"]]
    return fan.Marionette(fan.Scene.model_validate(SCENE | {"puppets": members}))


def inputs(marionette: fan.Marionette, prefix: str = "") -> dict[str, list[tuple[float, float]]]:
    return {f"{prefix}hand.length": [(0.0, 0.75), (0.5, 0.55), (1.0, 0.8)]}


@pytest.mark.parametrize("method", METHODS)
def test_members_and_props_do_not_disturb_each_other(alone, scene, method: str) -> None:
    """A turned and shifted puppet moves as it does alone, beside another one and a falling ball."""
    start = alone.project(alone.state({"hand.length": 0.75}))
    waypoints = {}
    for name in ("one", "two"):
        waypoints |= inputs(scene, f"{name}.")
    own = {f"{name}.hand.length": 0.75 for name in ("one", "two")}
    for name in ("one", "two"):
        own |= {f"{name}.lower": start["lower"], f"{name}.upper.rotation": start.q_D[:4]}
    x0 = scene.state(own)
    options = {
        "event": fan.Event(rtol=1e-11, atol=1e-11),
        "timestepping": fan.TimeStepping(dt=0.002, extrapolate=False),
        "variational": fan.Variational(dt=0.002),
    }[method]
    t = np.linspace(0.0, 1.0, 11)
    how = {"t_end": 1.0, "method": options}
    single = fan.simulate(alone, start, fan.Input.waypoints(alone, inputs(alone)), **how)
    both = fan.simulate(scene, x0, fan.Input.waypoints(scene, waypoints), **how)
    single, both = single.resample(t), both.resample(t)
    for name in ("one", "two"):
        for coordinate in ("lower", "upper.qx", "upper.qz"):
            mine, there = single[coordinate], both[f"{name}.{coordinate}"]
            assert there == pytest.approx(mine, abs=1e-8), coordinate
    fall = 3.0 - 9.81 * t * (t + 0.002 if method == "timestepping" else t) / 2
    assert both["ball.z"] == pytest.approx(fall, abs=1e-9)


def test_everything_that_takes_a_puppet_takes_a_scene(scene, tmp_path) -> None:
    x0 = scene.project(scene.state({"one.hand.length": 0.75, "two.hand.length": 0.75}))
    run = fan.simulate(scene, x0, t_end=0.2, method="timestepping")
    run.save(tmp_path / "run.npz")
    read = fan.Trajectory.load(tmp_path / "run.npz")
    assert read.puppet == scene.puppet and np.array_equal(read.q_D, run.q_D)
    batch = fan.simulate_batch(scene, [x0, x0], t_end=0.1, method="timestepping")
    assert all(batch.done) and np.array_equal(batch.q_D[0], batch.q_D[1])
    live = fan.Performance(scene)
    live.move("two.hand", [0.3, 0.1, 1.6])
    live.advance(0.1)
    step = scene.stepper(x0, method="timestepping")
    step.advance(0.01)
    assert step.state.t == pytest.approx(0.01)


def test_rest_that_is_not_found_says_which_solids_overlap():
    text = """
puppet: pair
floor: 0
contact: {restitution: 0, friction: 0}
gravity: [1, 0, -9.81]
bodies:
- {name: one, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
pose: {one.z: 0.1}
"""
    slide = fan.loads(text)
    with pytest.raises(fan.errors.StateError, match="let go, the puppet still moves"):
        slide.rest()
    with pytest.raises(fan.errors.StateError, match=r"one\|floor by 0.05 m. Move them apart"):
        slide.rest({"one.z": 0.05})


def test_a_swing_without_damping_rests_beside_a_ball_that_falls():
    """Strings alone do not stop the fall of the ball, and a released undamped swing never stops."""
    scene = fan.Scene.model_validate(
        {
            "scene": "swing",
            "floor": 0,
            "contact": True,
            "puppets": [{"name": "arm", "puppet": "arm2d", "at": [0, 0, 0.5]}],
            "props": [
                {
                    "name": "ball",
                    "at": [0.6, 0, 0.3],
                    "shapes": [{"type": "sphere", "radius": 0.05, "mass": 0.1}],
                }
            ],
        }
    )
    stage, arm = fan.Marionette(scene), fan.puppets.arm2d()
    rest = stage.rest()
    assert rest.q_D[:2] == pytest.approx(arm.rest().q_D, abs=1e-6)
    assert rest.q_D[4] == pytest.approx(0.05, abs=1e-6)
