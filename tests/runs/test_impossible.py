"""Impossible inputs: the run reports them, names the strings and keeps its rows."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.slow

GIVES_UP = (fan.Status.IMPOSSIBLE_INPUT, fan.Status.TENSION_CAP)

BETWEEN = """
puppet: between
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1}
strings:
  - {name: left, path: [{body: bob}, {driven: [x], at: [-1, 0, 0.5]}], length: 1.2}
  - {name: right, path: [{body: bob}, {driven: [x], at: [1, 0, 0.5]}], length: 1.2}
  - {name: loose, path: [{body: bob}, {world: [0, 0, 0.5]}], length: 3.0}
"""

PULLEY = """
puppet: pulley
bodies:
  - {name: bob, joint: {type: translation, axes: [z]}, mass: 1}
strings:
  - {name: hoist, path: [{body: bob}, {world: [0, 0, 1]}, {world: [1, 0, 1]}], length: driven}
pose: {bob.z: 0.5, hoist.length: 1.5}
"""

SHORT = """
puppet: short
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: link, path: [{world: [0, 0, 0]}, {driven: [x], at: [0.5, 0, 0]}], length: 0.5}
  - {name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: 1.0}
"""

USELESS = """
puppet: useless
bodies:
  - name: rod
    joint: {type: revolute, axis: [0, 1, 0]}
    shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.3], radius: 0.01, mass: 0.1}]
strings:
  - {name: link, path: [{world: [0, 0, 1]}, {driven: [x], at: [0.5, 0, 1]}], length: 0.55}
"""


def shaken(marionette, x0, **moves):
    """Waypoints from the present values: suffix -> (time, change with alternating sign)."""
    points = {}
    for suffix, (t, change) in moves.items():
        names = [n for n in marionette.coordinates.q_K if n.endswith("." + suffix)]
        for i, name in enumerate(names):
            q = x0.q_K[marionette.coordinates.q_K.index(name)]
            points[name] = [(0.0, q), (t, q + (-1) ** i * change)]
    return fan.Input.waypoints(marionette, points)


@pytest.mark.parametrize(
    "points", [[(0, -1), (2, -2)], [(0, -1), (0.2, -3)], [(0, -1), (0.3, -0.5), (1, -2.5)]]
)
def test_two_hands_that_pull_a_line_apart(points):
    between = fan.loads(BETWEEN)
    inputs = fan.Input.waypoints(between, {"left.x": points})
    x0 = between.rest()
    with pytest.raises(fan.errors.SimulationError, match="because of left, right") as caught:
        fan.simulate(between, x0, inputs)
    run = caught.value.trajectory
    assert run.status in GIVES_UP
    assert set(run.causes) == {"left", "right"}
    assert len(run) > 10
    differences = np.diff(run.q_K[-1][[0, 1]])[0]
    assert 2.39 < differences < 2.4
    assert all(np.all(np.isfinite(x)) for x in (run.q_D, run.v_D, run.tension.values))
    assert np.max(run.violation.values) < 1e-12
    assert np.max(run.tension["loose"]) == 0.0


PROP = """
puppet: prop
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: pull, path: [{body: bob}, {driven: [x], at: [-0.8, 0, 0]}], length: 0.3}
  - {name: strut, path: [{body: bob}, {world: [0, 0, 0]}], length: 1.0, wire: true}
pose: {bob.x: -1, bob.z: 0}
"""


@pytest.mark.parametrize(("end", "status"), [(-0.7, 2), (-0.69999, 3)])
def test_attribution_is_a_share_of_strings_that_pull_and_wires_that_push(end, status):
    """It was -1 for the pulling string, which was not named, and 1.1 above the cap."""
    prop = fan.loads(PROP)
    inputs = fan.Input.waypoints(prop, {"pull.x": [(0, -0.8), (4, end)]})
    batch = fan.simulate_batch(prop, [prop.rest()], inputs, t_end=4.0, method="event")
    assert batch.status[0] == status and batch.causes(0) == ("pull", "strut")
    assert np.all((batch.attribution.values > 0.9) & (batch.attribution.values <= 1.0))


def test_contradictory_rows_are_named():
    """A string between two ends without dynamic coordinates: the driven one moves away."""
    short = fan.loads(SHORT)
    inputs = fan.Input.waypoints(short, {"link.x": [(0, 0.5), (1, 0.8)]})
    run = fan.simulate(short, short.rest(), inputs, throw=False)
    assert run.status is fan.Status.IMPOSSIBLE_INPUT
    assert run.causes == ("link",)
    assert run.t[-1] < 0.1


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
def test_a_string_without_dynamic_ends_is_not_redundant(method):
    """All strings are between a driven end and the world: W is 0."""
    useless = fan.loads(USELESS)
    inputs = fan.Input.waypoints(useless, {"link.x": [(0, 0.5), (1, 0.8)]})
    run = fan.simulate(useless, useless.rest(), inputs, method=method, throw=False)
    if method == "timestepping":
        assert run.status is fan.Status.OVERSTEPPED
    else:
        assert run.status in GIVES_UP and run.causes == ("link",)


def test_a_hook_pulled_into_its_pulley_collapses():
    pulley = fan.loads(PULLEY)
    inputs = fan.Input.waypoints(pulley, {"hoist.length": [(0, 1.5), (1, 0.9)]})
    run = fan.simulate(pulley, pulley.rest(), inputs, throw=False)
    assert run.status is fan.Status.COLLAPSED
    assert run.causes == ("hoist",)
    assert run.q_D[-1][0] == pytest.approx(1.0, abs=1e-2)


@pytest.mark.parametrize("ask", ["apart", "short", "both"])
def test_the_marionette_is_torn_apart(ask):
    """Event-driven runs stop with names; time-stepping continues, with the necessary violation,
    and reports it at its end.
    """
    puppet = fan.puppets.marionette()
    x0 = puppet.rest()
    lengths = max(puppet.string_lengths(x0.q_D, x0.q_K))
    moves = {"apart": {"x": (1.0, 1.0)}, "short": {}, "both": {"x": (1.0, 1.0)}}[ask]
    inputs = shaken(puppet, x0, **moves)
    if ask != "apart":
        names = [n for n in puppet.coordinates.q_K if n.endswith(".length")]
        places = [x0.q_K[puppet.coordinates.q_K.index(n)] for n in names]
        points = {n: [(0, q), (1, 0.05)] for n, q in zip(names, places, strict=True)}
        for name in (n for n in puppet.coordinates.q_K if n.endswith(".x") and moves):
            q = x0.q_K[puppet.coordinates.q_K.index(name)]
            sign = -1 if list(puppet.coordinates.q_K).index(name) % 2 else 1
            points[name] = [(0, q), (1, q + sign)]
        inputs = fan.Input.waypoints(puppet, points)
    run = fan.simulate(puppet, x0, inputs, 3.0, throw=False)
    assert run.status in GIVES_UP and run.causes
    assert 0.3 < run.t[-1] < 1.0
    assert np.max(run.violation.values) < 1e-10
    for dt in (0.002, 0.01):
        run = fan.simulate(puppet, x0, inputs, 3.0, method=fan.TimeStepping(dt=dt), throw=False)
        assert run.status is fan.Status.OVERSTEPPED and run.t[-1] == 3.0
        assert np.all(np.isfinite(run.tension.values))
        # Ends move by up to 1 m and strings shorten by up to their length.
        assert np.max(run.violation.values) < 1.0 + lengths


def test_a_singular_mass_matrix_is_named():
    """A point on its rotation axis has no inertia about it."""
    gimbal = fan.loads("""
puppet: gimbal
bodies:
  - {name: outer, joint: {type: revolute, axis: [0, 0, 1]}}
  - {name: inner, parent: outer, joint: {type: revolute, axis: [0, 1, 0]}, com: [0, 0, -1],
     mass: 1, inertia: [0, 0, 0]}
""")
    assert fan.simulate(gimbal, gimbal.state({"inner": 1.0}), t_end=1.0).status is fan.Status.DONE
    run = fan.simulate(gimbal, gimbal.state({"v:outer": 1.0}), t_end=1.0, throw=False)
    assert run.status is fan.Status.SINGULAR_MASS
