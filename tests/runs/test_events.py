"""Events that are easily missed: grazing, simultaneous, within one step, at breaks of inputs."""

from __future__ import annotations

import json

import numpy as np
import pytest

import fantoccini as fan
from harness import start
from oracles.string_pendulum import flight

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

LENGTH, MASS, GRAVITY = 0.7, 0.3, 9.81

PENDULUM = {
    "puppet": "pendulum",
    "bodies": [{"name": "bob", "joint": {"type": "translation", "axes": ["x", "z"]}, "mass": MASS}],
    "strings": [
        {"name": "string", "path": [{"body": "bob"}, {"world": [0, 0, 0]}], "length": LENGTH}
    ],
    "pose": {"bob.x": 0, "bob.z": -LENGTH},
}

TABLE = {
    "puppet": "table",
    "bodies": [
        {
            "name": "top",
            "joint": {"type": "free"},
            "mass": 2.0,
            "com": [0, 0, 0],
            "inertia": [0.1, 0.2, 0.3],
        }
    ],
    "strings": [
        {
            "name": f"leg{i}",
            "path": [{"body": "top", "at": [x, y, 0]}, {"world": [x, y, 1.0]}],
            "length": 1.0,
        }
        for i, (x, y) in enumerate([(0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)])
    ],
}
"""A board on four upright strings, one of them redundant."""

LEVER = {
    "puppet": "lever",
    "bodies": [
        {
            "name": "rod",
            "joint": {"type": "free"},
            "mass": 1.0,
            "com": [0, 0, 0],
            "inertia": [0.0001, 1 / 12, 1 / 12],
        }
    ],
    "strings": [
        {
            "name": "left",
            "path": [{"body": "rod", "at": [-0.15, 0, 0]}, {"world": [-0.15, 0, 1]}],
            "length": 1.0,
        },
        {
            "name": "right",
            "path": [{"body": "rod", "at": [0.15, 0, 0]}, {"world": [0.15, 0, 1]}],
            "length": 1.0,
        },
    ],
}
"""A rod tied inside its radius of gyration: lifting one end lifts the other."""


def kinds(run) -> list[tuple[str, str]]:
    return [(e.kind.value, e.name) for e in run.events]


@pytest.fixture(scope="module")
def pendulum():
    return fan.loads(json.dumps(PENDULUM))


@pytest.mark.parametrize("k", [2.02, 2.1, 2.5, 3.3, 4.2, 4.8, 4.95])
def test_a_tangential_release_and_its_catch(pendulum, k):
    """It is released where the gap opens as t^3, and caught at -3 psi, even almost at once."""
    f = flight(k, LENGTH, MASS, GRAVITY)
    x0 = start(pendulum, {}, {"bob.x": np.sqrt(k * GRAVITY * LENGTH)})
    run = fan.simulate(
        pendulum, x0, t_end=f.t_catch + 0.01, method=fan.Event(rtol=1e-13, atol=1e-13)
    )
    assert kinds(run)[:2] == [("release", "string"), ("catch", "string")]
    released, caught = run.events[:2]
    at = [np.searchsorted(run.t, e.t) for e in (released, caught)]
    angles = [np.arctan2(run.q_D[i, 1], run.q_D[i, 0]) for i in at]
    assert np.sin(angles[0]) == pytest.approx((k - 2) / 3, abs=1e-10)
    assert np.cos(angles[1] + 3 * angles[0]) == pytest.approx(1.0, abs=1e-12)
    assert caught.t == pytest.approx(f.t_catch, abs=1e-11)
    assert caught.impulse == pytest.approx(f.impulse, rel=1e-10, abs=1e-12)


def test_four_strings_caught_at_once():
    """A level board falls into its four strings: one instant, equal shares, no chatter."""
    table = fan.loads(json.dumps(TABLE))
    run = fan.simulate(table, table.state({"top.z": 0.05}), t_end=1.0)
    caught = [e for e in run.events if e.kind == "catch"]
    assert len({e.t for e in caught}) == 1
    assert {e.name for e in caught} <= {f"leg{i}" for i in range(4)}
    speed = np.sqrt(2 * GRAVITY * 0.05)
    assert sum(e.impulse for e in caught) == pytest.approx(2.0 * speed, rel=1e-9)
    assert [e.impulse for e in caught] == pytest.approx([0.5 * speed] * 4, rel=1e-9)
    assert not [e for e in run.events if e.kind == "release"]
    assert run.taut.values[-1].all()
    assert run.tension.values[-1] == pytest.approx(np.full(4, 2.0 * GRAVITY / 4), rel=1e-9)


def test_a_catch_that_releases_another_string():
    """A rod on one string is caught by the other, and thrown out of the first."""
    lever = fan.loads(json.dumps(LEVER))
    # On its left string, with a rotation by which its right end falls.
    tilt, turn = 0.2, 1.0
    x0 = lever.state(
        {
            "rod.x": 0.15 * (np.cos(tilt) - 1.0),
            "rod.z": 0.15 * np.sin(tilt),
            "rod.rotation": [0.0, -tilt, 0.0],
            "v:rod.wy": turn,
            "v:rod.z": -0.15 * turn * np.cos(tilt),
            "v:rod.x": 0.15 * turn * np.sin(tilt),
        }
    )
    run = fan.simulate(lever, lever.project(x0), t_end=0.5)
    caught = next(e for e in run.events if e.kind == "catch" and e.name == "right")
    same = [e for e in run.events if e.t == caught.t]
    assert ("release", "left") in [(e.kind.value, e.name) for e in same]
    after = run.state(int(np.searchsorted(run.t, caught.t, side="right")) - 1)
    hdot = lever.A_D(after) @ after.v_D
    assert abs(hdot[1]) < 1e-10
    assert hdot[0] < -0.1


def test_events_do_not_depend_on_the_steps(pendulum):
    """Long steps find the events of short ones: a flight and its catch are not skipped."""
    f = flight(4.9, LENGTH, MASS, GRAVITY)
    x0 = start(pendulum, {}, {"bob.x": np.sqrt(4.9 * GRAVITY * LENGTH)})
    runs = [
        fan.simulate(
            pendulum, x0, t_end=f.t_catch + 0.5, method=fan.Event(rtol=1e-6, atol=1e-6, max_step=h)
        )
        for h in (10.0, 0.001)
    ]
    assert kinds(runs[0]) == kinds(runs[1])
    assert len(runs[0].events) >= 2
    assert runs[0].events[1].t == pytest.approx(f.t_catch, abs=1e-4)


def test_breaks_of_the_inputs_are_events(pendulum):
    """At a jump of an input's acceleration the tension jumps, and there is an event."""
    hoist = fan.loads(
        json.dumps(PENDULUM | {"strings": [{**PENDULUM["strings"][0], "length": "driven"}]})
    )
    x0 = hoist.rest({"string.length": LENGTH})
    inputs = fan.Input.segments(hoist, [0.0, 0.3, 0.6], x0.q_K, [0.0], [[-2.0], [2.0]])
    run = fan.simulate(hoist, x0, inputs)
    assert kinds(run) == [("breakpoint", "")]
    before, after = np.flatnonzero(run.t == run.events[0].t)
    assert run.tension["string"][before] == pytest.approx(MASS * (GRAVITY + 2.0), rel=1e-9)
    assert run.tension["string"][after] == pytest.approx(MASS * (GRAVITY - 2.0), rel=1e-9)


def test_an_acceleration_beyond_gravity_releases_the_string(pendulum):
    """A string let out faster than its load falls goes slack at the break itself."""
    hoist = fan.loads(
        json.dumps(PENDULUM | {"strings": [{**PENDULUM["strings"][0], "length": "driven"}]})
    )
    x0 = hoist.rest({"string.length": LENGTH})
    acc = [[0.5], [12.0], [-20.0]]
    inputs = fan.Input.segments(hoist, [0.0, 0.2, 0.3, 0.365], x0.q_K, [0.0], acc)
    run = fan.simulate(hoist, x0, inputs, 0.365)
    assert kinds(run) == [
        ("breakpoint", ""),
        ("release", "string"),
        ("breakpoint", ""),
        ("catch", "string"),
    ]
    assert run.events[1].t == pytest.approx(0.2, abs=1e-12)
    # The gap grows by 1.095 t^2 for 0.1 s and is closed at 14.905 t^2 with the speed at that time.
    gap, speed = 1.095 * 0.1**2, 2.19 * 0.1
    t = (speed + np.sqrt(speed**2 + 4 * 14.905 * gap)) / (2 * 14.905)
    assert run.events[-1].t == pytest.approx(0.3 + t, abs=1e-10)


TRIO = """
puppet: trio
bodies:
  - {name: heavy, joint: {type: translation, axes: [x, z]}, mass: 10}
  - {name: light, joint: {type: translation, axes: [x, z]}, mass: {parameter: light, value: 1.0}}
  - {name: third, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: one, path: [{body: heavy}, {world: [0, 0, 1]}], length: 1}
  - {name: other, path: [{body: heavy}, {world: [0, 0, 1]}], length: 1}
  - {name: thin, path: [{body: light}, {world: [0, 0, 1]}], length: 1}
  - {name: bounce, path: [{body: third}, {world: [0, 0, 1]}], length: 1, restitution: 0.5}
pose: {third.z: 0.5}
"""


@pytest.mark.parametrize("light", [1.0, 1e-2, 5e-4])
def test_a_catch_is_the_same_beside_redundant_strings_and_unlike_masses(light):
    trio = fan.loads(TRIO).with_parameters({"light": light})
    run = fan.simulate(trio, trio.state(), t_end=0.7)
    caught = [e for e in run.events if e.kind == "catch" and e.name == "bounce"]
    speed = np.sqrt(2 * GRAVITY * 0.5)
    assert caught[0].impulse == pytest.approx(1.5 * speed, rel=1e-9)
    assert caught[1].impulse == pytest.approx(0.75 * speed, rel=1e-9)
    assert caught[1].t - caught[0].t == pytest.approx(speed / GRAVITY, abs=1e-9)
    assert {e.name for e in run.events} == {"bounce"}


def test_a_fast_wheel_is_not_damped_by_large_steps():
    """Only motions caused by impossible inputs are damped."""
    wheel = fan.loads("""
puppet: wheel
bodies:
  - {name: wheel, joint: {type: revolute, axis: [0, 1, 0]}, mass: 1, com: [0, 0, 0],
     inertia: [0.01, 0.01, 0.01]}
""")
    run = fan.simulate(
        wheel, wheel.state({"v:wheel": 60.0}), t_end=1.0, method=fan.TimeStepping(dt=0.01)
    )
    assert run.v_D[-1] == pytest.approx([60.0], rel=1e-12)
